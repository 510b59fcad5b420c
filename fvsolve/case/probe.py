"""A quantity of a part that is recorded. Knows how probes are written; knows no values."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fvsolve import units
from fvsolve.errors import did_you_mean, listing
from fvsolve.parts import Link, Node, Pipe, Scalar
from fvsolve.units import show

if TYPE_CHECKING:
    from fvsolve.case.basins import Pool

_PROBE = re.compile(r"(?:(nodes|links)\.)?([^.@]+(?:\.[^.@]+)?)\.([^.@]+)(?:@(.*))?")


DEFAULT_OF_NODES = ("pressure", "head", "level", "position", "velocity", "angle", "travel")
DEFAULT_OF_LINKS = ("flow", "flow_P", "flow_T", "flow_A", "flow_B", "force")


@dataclass(frozen=True)
class Probe:
    """What is recorded: text of the case, part and quantity; along a pipe the fraction from `from`, in a basin the
    point [m]; straight : read along a straight line between cells, not by the scheme's polynomial."""

    text: str
    part: str  # "nodes" | "links"
    name: str
    quantity: str
    fraction: float | None
    dimension: str
    point: tuple[float, float] | None = None
    unit: str = ""  # of a scalar, a label
    straight: bool = False


Kinds = Mapping[str, Mapping[str, "type[Node] | type[Link] | Pool | Scalar | None"]]


def read_probe(given: object, kinds: Kinds) -> Probe | None:
    """The probe a text names; None where its part is at fault itself.

    `kinds` holds for "nodes" and "links" the class of each name (None where its type is unknown), of a basin what of
    it can be read, and the "scalars". Raises ValueError.
    """
    match = _PROBE.fullmatch(given.strip()) if isinstance(given, str) else None
    if match is None:
        raise ValueError(f'{show(given)} is no probe; wanted NAME.QUANTITY, for example "gate.pressure"')
    part, name, quantity, place = match.groups()
    parts = [part] if part else [part for part in ("nodes", "links") if name in kinds[part]]
    parts = [part for part in parts if name in kinds[part]]
    if not parts and part != "nodes" and name in kinds.get("routes", {}):
        return of_route(given.strip(), name, quantity, place, kinds)
    if not parts and kinds["nodes"].get(name.partition(".")[0], name) is None:
        return None  # a patch of a basin that is at fault
    if not parts and of_uncut(name, kinds):
        return None
    if not parts:
        names = [*kinds["nodes"], *kinds["links"]] if part is None else list(kinds[part])
        what = {"nodes": "node", "links": "link"}.get(part or "", "part")
        raise ValueError(f"no {what} named {show(name)}; {what}s are {listing(names)}{did_you_mean(name, names)}")
    if any(kinds[part][name] is None for part in parts):
        return None
    found, problems = [], []
    for part in parts:
        try:
            found.append(_probe(given.strip(), part, name, quantity, place, kinds))
        except ValueError as error:
            problems.append(str(error))
    if not found:
        raise ValueError("; ".join(problems))
    if len(found) > 1:
        raise ValueError(f"a node and a link are named {show(name)}; write nodes.{given} or links.{given}")
    return found[0]


def of_uncut(name: str, kinds: Kinds) -> bool:
    """Whether a name may be that of a piece, bend or place of a part of which it is not known what it has."""
    return any(name.startswith((f"{whole}-", f"{whole}.")) for whole in kinds.get("uncut", ()))


def of_route(text: str, name: str, quantity: str, place: str | None, kinds: Kinds) -> Probe | None:
    """A place along a route, by a share of its length or a chainage; None where the route is at fault itself."""
    along = Pipe.along | _carried(Pipe, kinds, "along")
    if quantity not in along:
        near = did_you_mean(quantity, along)
        raise ValueError(f"{name} is a route, without {show(quantity)}; it has {', '.join(along)}{near}")
    if kinds["routes"][name] is None:
        return None
    legs, _ = kinds["routes"][name]
    if place is None and quantity not in Pipe.quantities:
        raise ValueError(f'{name} is a route: say where, for example "{name}.{quantity}@0.5"')
    begin, end = legs[0].begin, legs[-1].end
    at = begin + share_of(place or "0", end - begin, begin) * (end - begin)
    leg = next((one for one in legs if at <= one.end), legs[-1])
    if leg.backwards and quantity in ("flow", "velocity"):
        raise ValueError(f"{name} runs against {leg.pipe} there; wanted {leg.pipe}.{quantity}@x, whose sign is its own")
    share = min(max((at - leg.begin) / (leg.end - leg.begin), 0.0), 1.0)
    share = 1.0 - share if leg.backwards else share
    scalar = kinds["scalars"].get(quantity)
    return Probe(text, "links", leg.pipe, quantity, share, along[quantity], unit="" if scalar is None else scalar.unit)


def share_of(place: str, length: float | None, begin: float) -> float:
    """A place as a share of a length [m] that begins at a chainage [m]; ValueError where it is none.

    length : None of a pipe that is at fault itself, along which any chainage will do
    """
    try:
        found = float(place)
        said = f'"@{place}" is no fraction of the length; wanted 0 to 1'
    except ValueError:
        try:
            found = units.parse(place, "length") - begin
            found = 0.0 if length is None else found / length
        except ValueError:
            raise ValueError(
                f'"@{place}" is no fraction of the length; wanted 0 to 1, or a chainage with its unit'
            ) from None
        said = "" if length is None else f'"@{place}" is not within {begin:.10g} m to {begin + length:.10g} m'
    if not -1e-12 <= found <= 1.0 + 1e-12:
        raise ValueError(said or f'"@{place}" is no fraction of the length; wanted 0 to 1')
    return min(max(found, 0.0), 1.0)


def default_probes(kinds: Kinds) -> list[Probe]:
    """All nodes (pressure, head, level; position, velocity) and all links (flows; force)."""
    found = []
    for part, quantities in (("nodes", DEFAULT_OF_NODES), ("links", DEFAULT_OF_LINKS)):
        other = kinds["links" if part == "nodes" else "nodes"]
        for name, kind in kinds[part].items():
            own = [one for one in quantities if one in kind.quantities] if kind is not None else []
            own = [one for one in own if one not in getattr(kind, "asked", ())]
            for quantity in [*own, *_carried(kind, kinds, "quantities")] if own else []:
                text = f"{part}.{name}.{quantity}" if name in other else f"{name}.{quantity}"
                found.append(_probe(text, part, name, quantity, None, kinds))
    return found


def _carried(kind: type[Node] | type[Link], kinds: Kinds, where: str) -> dict[str, str]:
    """Scalars that the places of a kind carry: those that have a pressure."""
    return dict.fromkeys(kinds["scalars"] if "pressure" in getattr(kind, where, {}) else (), "number")


def _probe(text: str, part: str, name: str, quantity: str, place: str | None, kinds: Kinds) -> Probe:
    kind, scalar = kinds[part][name], kinds["scalars"].get(quantity)
    unit = scalar.unit if scalar is not None else ""
    if quantity in (fields := getattr(kind, "fields", {})):  # of a basin
        point = kind.point(f"{name}.{quantity}", place)
        return Probe(text, part, name, quantity, None, fields[quantity], point, unit)
    along = getattr(kind, "along", {}) | _carried(kind, kinds, "along")
    quantities = kind.quantities | _carried(kind, kinds, "quantities")
    pipe = kinds.get("pipes", {}).get(name) if part == "links" else None
    begin = 0.0 if pipe is None or pipe.profile is None else float(pipe.profile.chainage[0])
    fraction, dimension = _quantity(kind, along, quantities, name, quantity, place, pipe and pipe.length, begin)
    return Probe(text, part, name, quantity, fraction, dimension, unit=unit)


def _quantity(
    kind: Any,
    along: dict[str, str],
    own: dict[str, str],
    name: str,
    quantity: str,
    place: str | None,
    length: float | None,
    begin: float,
) -> tuple[float | None, str]:
    known = {**along, **own, **getattr(kind, "fields", {})}
    article = "an" if kind.kind[0] in "aeiou" else "a"
    if quantity not in known:
        has = f"it has {', '.join(known)}{did_you_mean(quantity, known)}" if known else "its water is one with its body"
        raise ValueError(f"{name} is {article} {kind.kind}, without {show(quantity)}; {has}")
    if place is None:
        if quantity not in own:
            raise ValueError(f'{name} is a {kind.kind}: say where, for example "{name}.{quantity}@0.5"')
        return (0.0 if quantity in along else None), known[quantity]
    if quantity not in along:
        raise ValueError(f"{name} is {article} {kind.kind}: {quantity} has no place along it; leave @{place} out")
    return share_of(place, length, begin), known[quantity]
