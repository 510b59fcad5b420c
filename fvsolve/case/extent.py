"""Quantity in some parts of a case whose extremes over all steps are recorded, for limits and expectations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from fvsolve.case.probe import Kinds, Probe, may_be_piece
from fvsolve.errors import article, did_you_mean, listing
from fvsolve.parts import KINDS, Pipe, Reservoir
from fvsolve.parts.value import ValueFault
from fvsolve.units import show

ALL = {"pipes": "links", "nodes": "nodes"}  # words for all parts of a kind
OF_PRESSURE = {"pressure": "pressure", "gauge_pressure": "gauge_pressure", "head": "head", "pressure_head": "head"}


@dataclass(frozen=True)
class Extent:
    """Quantity in several parts, for a limit or an expectation on its extreme over all these parts and all steps.

    parts : pairs (group, name)
    The extreme in a pipe is that over every cell and both ends, for a pressure also over the points of its profile.
    """

    on: tuple[str, ...]  # as the file names them
    parts: tuple[tuple[str, str], ...]
    quantity: str
    dimension: str

    def probes(self, links: Mapping[str, Any]) -> Iterator[Probe]:
        """Probes whose extremes give those of the extent, together with the extreme pressures of all pipe cells."""
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
    """Probe at the fraction `share` of the length of a pipe, interpolated linearly between cells.

    quantity, dimension : as in `Probe`
    """
    return Probe(f"links.{pipe}.{quantity}@{share!r}", "links", pipe, quantity, share, dimension, straight=True)


def of_profiles(links: Mapping[str, Any]) -> Iterator[Probe]:
    """Pressure probes at both ends and at every profile point of pipes with an elevation profile."""
    for name, link in links.items():
        if getattr(link, "profile", None) is not None:
            inner = link.profile.distance[1:-1] / link.length
            for share in (0.0, *inner.tolist(), 1.0):
                yield along(name, "pressure", share, "pressure")


def read_extent(given: Any, quantity: str, kinds: Kinds, routes: Mapping[str, Any]) -> Extent | None:
    """Read a quantity in the parts or routes that `given` (a name or a list) names; None if one of the parts is faulty.

    kinds : as for `read_probe`; routes : by name. Raises ValueError for unknown names, and ValueFault (at the key
    `quantity`) if a part does not have the quantity.
    """
    names = [given] if isinstance(given, str) else given
    if not isinstance(names, (list, tuple)) or not names or not all(isinstance(word, str) for word in names):
        raise ValueError(
            f'{show(given)} is not a name; expected a part, a route, "pipes" or "nodes", or a list of names'
        )
    parts: dict[tuple[str, str], None] = {}
    problems, known = [], True
    for word in names:
        try:
            members = parts_of(word, quantity, kinds, routes)
        except ValueFault:
            raise
        except ValueError as error:
            problems.append(str(error))
        else:
            known = known and members is not None
            parts |= dict.fromkeys(members or ())
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
        has = f"has {', '.join(known)}{did_you_mean(quantity, known)}" if known else "has no quantities"
        verb = "have" if more else "has"
        text = f"{name}{more} {verb} no {show(quantity)}: {name} is {article(kinds[group][name].kind)} and {has}"
        raise ValueFault([(("quantity",), text)])
    if not known:
        return None
    return Extent(tuple(names), tuple(parts), quantity, dimensions.pop())


def parts_of(name: str, quantity: str, kinds: Kinds, routes: Mapping[str, Any]) -> list[tuple[str, str]] | None:
    """Pairs (group, name) of the parts denoted by `name`: a part, the pipes of a route, all "pipes" or all "nodes".

    None if a part is faulty. Raises ValueError for an unknown name or a missing quantity. kinds : as for `read_probe`
    """
    group, dot, rest = name.partition(".")
    if dot and group in ("nodes", "links") and rest in kinds[group]:
        return None if kinds[group][rest] is None else [(group, rest)]
    groups = [group for group in ("nodes", "links") if name in kinds[group]]
    if len(groups) > 1:
        raise ValueError(f"a node and a link are named {show(name)}; write nodes.{name} or links.{name}")
    if groups:
        return None if kinds[groups[0]][name] is None else [(groups[0], name)]
    if name in routes:
        if quantity not in (known := quantities_of(Pipe)):
            has = f"it has {', '.join(known)}{did_you_mean(quantity, known)}"
            raise ValueFault([(("quantity",), f"{name} has no {show(quantity)}: it is a route; {has}")])
        return None if routes[name] is None else [("links", pipe) for pipe in routes[name].pipes]
    if may_be_piece(name, kinds) or (name in ALL and None in kinds[ALL[name]].values()):
        return None
    if name in ALL:
        included = (lambda kind: kind is Pipe) if name == "pipes" else (lambda kind: counts_as_node(kind, quantity))
        matches = [(ALL[name], part) for part, kind in kinds[ALL[name]].items() if kind is not None and included(kind)]
        if not matches:
            if name == "pipes":
                raise ValueError(f"{show(name)} means all pipes, but the case has none")
            raise ValueFault([(("quantity",), f"no node has {show(quantity)}")])
        return matches
    known = [*kinds["nodes"], *kinds["links"], *routes, *ALL]
    raise ValueError(
        f"unknown part or route {show(name)}{did_you_mean(name, known) or f'; there are {listing(known)}'}"
    )


def counts_as_node(kind: Any, quantity: str) -> bool:
    """True if the word "nodes" in a limit or expectation includes this class of node for a quantity.

    A reservoir is not included for pressures and heads, since its pressure is given.
    """
    return quantity in quantities_of(kind) and not (kind is Reservoir and quantity in OF_PRESSURE)


def quantities_of(kind: Any) -> dict[str, str]:
    """Quantities that can be recorded in a class of part: name -> dimension."""
    result = {**getattr(kind, "quantities", {}), **getattr(kind, "along", {})}
    return result | ({"pressure_head": "head"} if "pressure" in result else {})


def only_dimension(quantity: str) -> str | None:
    """Dimension of a quantity in all types of parts; None if no type has it, or if the dimensions differ."""
    kinds = [kind for group in KINDS.values() for kind in group.values()]
    dimensions = {quantities_of(kind).get(quantity) for kind in kinds} - {None}
    return dimensions.pop() if len(dimensions) == 1 else None
