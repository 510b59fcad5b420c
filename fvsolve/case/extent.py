"""Parts and a quantity whose extremes over all steps are kept. Knows how they are named; knows no values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from fvsolve.case.probe import Kinds, Probe, of_uncut
from fvsolve.errors import did_you_mean, listing
from fvsolve.parts import KINDS, Pipe, Reservoir
from fvsolve.parts.value import Misfit
from fvsolve.units import show

ALL = {"pipes": "links", "nodes": "nodes"}  # words for all parts of a kind
OF_PRESSURE = {"pressure": "pressure", "gauge_pressure": "gauge_pressure", "head": "head", "pressure_head": "head"}


@dataclass(frozen=True)
class Extent:
    """All of `parts`, pairs of group and name, along pipes every cell, end and point of a profile; `quantity` there."""

    on: tuple[str, ...]  # as the file names them
    parts: tuple[tuple[str, str], ...]
    quantity: str
    dimension: str

    def probes(self, links: Mapping[str, Any]) -> Iterator[Probe]:
        """What is to be watched for it beside the pressures of cells."""
        pressed = self.quantity in OF_PRESSURE
        quantity, dimension = ("pressure", "pressure") if pressed else (self.quantity, self.dimension)
        for group, name in self.parts:
            pipe = links.get(name) if group == "links" else None
            if pipe is None or pipe.kind != "pipe" or not (pressed or self.quantity in pipe.along):
                yield Probe(f"{group}.{name}.{quantity}", group, name, quantity, None, dimension)
            else:
                shares = [] if pressed else [(k + 0.5) / pipe.cells for k in range(pipe.cells)]
                for share in (0.0, *shares, 1.0):
                    yield along(name, quantity, share, dimension)


def along(pipe: str, quantity: str, share: float, dimension: str) -> Probe:
    """A place of a pipe that is watched."""
    return Probe(f"links.{pipe}.{quantity}@{share!r}", "links", pipe, quantity, share, dimension, straight=True)


def of_profiles(links: Mapping[str, Any]) -> Iterator[Probe]:
    """Pressures at both ends and at every point of pipes with a profile."""
    for name, link in links.items():
        if getattr(link, "profile", None) is not None:
            inner = link.profile.distance[1:-1] / link.length
            for share in (0.0, *inner.tolist(), 1.0):
                yield along(name, "pressure", share, "pressure")


def read_extent(given: Any, quantity: str, kinds: Kinds, routes: Mapping[str, Any]) -> Extent | None:
    """The extent of names; None where one of them is at fault itself.

    Raises ValueError for names that are none, Misfit (below the key `quantity`) where they have none such.
    """
    names = [given] if isinstance(given, str) else given
    if not isinstance(names, (list, tuple)) or not names or not all(isinstance(one, str) for one in names):
        raise ValueError(f'{show(given)} names nothing; wanted a part, a route, "pipes" or "nodes", or a list of such')
    parts: dict[tuple[str, str], None] = {}
    problems, known = [], True
    for one in names:
        try:
            found = parts_of(one, quantity, kinds, routes)
        except Misfit:
            raise
        except ValueError as error:
            problems.append(str(error))
        else:
            known = known and found is not None
            parts |= dict.fromkeys(found or ())
    if problems:
        raise ValueError("; ".join(problems))
    dimensions, lacking = set(), []
    for group, name in parts:
        known = quantities_of(kinds[group][name])
        if quantity in known:
            dimensions.add(known[quantity])
        else:
            lacking.append((group, name, known))
    if lacking:
        group, name, known = lacking[0]
        more = f", and {len(lacking) - 1} more" if len(lacking) > 1 else ""
        has = f"it has {', '.join(known)}{did_you_mean(quantity, known)}" if known else "it has none"
        text = f"{name}{more} without {show(quantity)}: a {kinds[group][name].kind}; {has}"
        raise Misfit([(("quantity",), text)])
    if not known:
        return None
    return Extent(tuple(names), tuple(parts), quantity, dimensions.pop())


def parts_of(one: str, quantity: str, kinds: Kinds, routes: Mapping[str, Any]) -> list[tuple[str, str]] | None:
    """Parts that a name stands for; None where it is at fault itself. Raises ValueError where it is none."""
    group, dot, rest = one.partition(".")
    if dot and group in ("nodes", "links") and rest in kinds[group]:
        return None if kinds[group][rest] is None else [(group, rest)]
    groups = [group for group in ("nodes", "links") if one in kinds[group]]
    if len(groups) > 1:
        raise ValueError(f"a node and a link are named {show(one)}; write nodes.{one} or links.{one}")
    if groups:
        return None if kinds[groups[0]][one] is None else [(groups[0], one)]
    if one in routes:
        if quantity not in (known := quantities_of(Pipe)):
            has = f"it has {', '.join(known)}{did_you_mean(quantity, known)}"
            raise Misfit([(("quantity",), f"{one} without {show(quantity)}: a route; {has}")])
        return None if routes[one] is None else [("links", pipe) for pipe in routes[one].pipes]
    if of_uncut(one, kinds) or (one in ALL and None in kinds[ALL[one]].values()):
        return None
    if one in ALL:
        wanted = (lambda kind: kind is Pipe) if one == "pipes" else (lambda kind: judged(kind, quantity))
        found = [(ALL[one], name) for name, kind in kinds[ALL[one]].items() if kind is not None and wanted(kind)]
        if not found:
            if one == "pipes":
                raise ValueError(f"{show(one)}: the case has no pipe")
            raise Misfit([(("quantity",), f"no node has {show(quantity)}")])
        return found
    known = [*kinds["nodes"], *kinds["links"], *routes, *ALL]
    raise ValueError(f"no part or route named {show(one)}{did_you_mean(one, known) or f'; there are {listing(known)}'}")


def judged(kind: Any, quantity: str) -> bool:
    """Whether a kind of node is among "nodes": a reservoir's pressure is given, perhaps at no elevation of its own."""
    return quantity in quantities_of(kind) and not (kind is Reservoir and quantity in OF_PRESSURE)


def quantities_of(kind: Any) -> dict[str, str]:
    """Quantities of a kind of part that can be watched -> dimension."""
    found = {**getattr(kind, "quantities", {}), **getattr(kind, "along", {})}
    return found | ({"pressure_head": "head"} if "pressure" in found else {})


def only_dimension(quantity: str) -> str | None:
    """The dimension of a quantity, whatever has it; None where none has, or not all the same."""
    kinds = [kind for group in KINDS.values() for kind in group.values()]
    found = {quantities_of(kind).get(quantity) for kind in kinds} - {None}
    return found.pop() if len(found) == 1 else None
