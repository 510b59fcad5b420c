"""Recorded quantities: probes of single parts, and extents of several parts whose extremes are recorded."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fvsolve import units
from fvsolve.errors import article, did_you_mean, listing
from fvsolve.parts import KINDS, Link, Node, Pipe, Reservoir, Scalar
from fvsolve.parts.nodes_and_links import is_in_network
from fvsolve.parts.value import ValueFault
from fvsolve.units import show

if TYPE_CHECKING:
    from fvsolve.case.basins import BasinFields

_PROBE = re.compile(r"(?:(nodes|links)\.)?([^.@]+(?:\.[^.@]+)?)\.([^.@]+)(?:@(.*))?")

DEFAULT_OF_NODES = ("pressure", "head", "level", "position", "velocity", "angle", "travel")
DEFAULT_OF_LINKS = ("flow", "flow_P", "flow_T", "flow_A", "flow_B", "force")
PROBED = ("nodes", "links", "controls", "reactions", "sections")
ALL = {"pipes": "links", "nodes": "nodes"}  # words for all parts of a kind
OF_PRESSURE = {
    "pressure": "pressure",
    "gauge_pressure": "gauge_pressure",
    "head": "head",
    "pressure_head": "head",
}


@dataclass(frozen=True)
class Probe:
    """Recorded quantity of a part.

    text : text of the probe in the case, such as "main.pressure@0.5"
    part, name : "nodes", "links", "controls", "reactions" or "sections", and name of the part, block, reaction, section
    quantity, dimension : such as "level" and "length"
    fraction : distance from the `from` end of a pipe over its length [-], else None
    point : x, y in a basin [m], else None
    straight : True to interpolate linearly between cells, not by the polynomial of the scheme
    place : probe of a scalar at the place of a reaction, None for the sum over all places
    """

    text: str
    part: str  # "nodes" | "links" | "controls" | "reactions" | "sections"
    name: str
    quantity: str
    fraction: float | None
    dimension: str
    point: tuple[float, float] | None = None
    unit: str = ""  # of a scalar, a label
    straight: bool = False
    place: Probe | None = None


Kinds = Mapping[str, Mapping[str, "type[Node] | type[Link] | BasinFields | Scalar | None"]]


def read_probe(given: object, kinds: Kinds) -> Probe | None:
    """Probe from its text, such as "gate.pressure"; None if the part is faulty. Raises ValueError.

    kinds : "nodes" and "links" -> class of each part by name (None if faulty, `BasinFields` for a basin);
    "sections" -> `SectionKind` of each section; "scalars" -> scalars; "pipes" -> pipes and conduits
    "routes" -> (legs, links) of each route; "uncut" -> faulty parts with unknown points, patches or pieces
    """
    match = _PROBE.fullmatch(given.strip()) if isinstance(given, str) else None
    if match is None:
        raise ValueError(
            f'{show(given)} is not a probe; expected NAME.QUANTITY, for example "gate.pressure"'
        )
    part, name, quantity, place = match.groups()
    parts = [part] if part else PROBED
    parts = [part for part in parts if name in kinds.get(part, ())]
    if not parts and part != "nodes" and name in kinds.get("routes", {}):
        return route_probe(given.strip(), name, quantity, place, kinds)
    if not parts and kinds["nodes"].get(name.partition(".")[0], name) is None:
        return None  # a patch of a faulty basin
    if not parts and may_be_piece(name, kinds):
        return None
    if not parts:
        groups = PROBED if part is None else (part,)
        names = [name for group in groups for name in kinds.get(group, ())]
        noun = {"nodes": "node", "links": "link"}.get(part or "", "part")
        raise ValueError(
            f"no {noun} named {show(name)}; {noun}s are {listing(names)}{did_you_mean(name, names)}"
        )
    if any(kinds[part][name] is None for part in parts):
        return None
    probes, problems = [], []
    for part in parts:
        try:
            probes.append(_probe(given.strip(), part, name, quantity, place, kinds))
        except ValueError as error:
            problems.append(str(error))
    if not probes:
        raise ValueError("; ".join(problems))
    if len(probes) > 1:
        raise ValueError(
            f"a node and a link are named {show(name)}; write nodes.{given} or links.{given}"
        )
    probe = probes[0]
    # of a control whose input is faulty
    return None if probe is None or not probe.dimension else probe


def may_be_piece(name: str, kinds: Kinds) -> bool:
    """True if `name` may be that of a piece, bend, point or patch of a faulty part for which these are unknown.

    kinds : as for `read_probe`
    """
    return any(name.startswith((f"{pipe}-", f"{pipe}.")) for pipe in kinds.get("uncut", ()))


def route_probe(
    text: str, name: str, quantity: str, place: str | None, kinds: Kinds
) -> Probe | None:
    """Probe of a quantity on a route; None if the route is faulty. Raises ValueError.

    text : text of the probe; name : name of the route; kinds : as for `read_probe`
    place : text after "@", a fraction of the length of the route or a chainage with unit
    """
    along = Pipe.along | _scalars_of(Pipe, kinds, "along")
    if quantity not in along:
        near = did_you_mean(quantity, along)
        raise ValueError(
            f"{name} is a route, which has no {show(quantity)}; it has {', '.join(along)}{near}"
        )
    if kinds["routes"][name] is None:
        return None
    legs, _ = kinds["routes"][name]
    if place is None and quantity not in Pipe.quantities:
        raise ValueError(
            f'{name} is a route, and a probe of it needs a place, for example "{name}.{quantity}@0.5"'
        )
    begin, end = legs[0].begin, legs[-1].end
    at = begin + fraction_of(place or "0", end - begin, begin) * (end - begin)
    leg = next((item for item in legs if at <= item.end), legs[-1])
    if leg.backwards and quantity in ("flow", "velocity"):
        text = f"{name} runs against the direction of {leg.pipe} at this place"
        raise ValueError(
            f"{text}; expected a probe of the pipe, for example {leg.pipe}.{quantity}@0.5"
        )
    share = min(max((at - leg.begin) / (leg.end - leg.begin), 0.0), 1.0)
    share = 1.0 - share if leg.backwards else share
    scalar = kinds["scalars"].get(quantity)
    return Probe(
        text,
        "links",
        leg.pipe,
        quantity,
        share,
        along[quantity],
        unit="" if scalar is None else scalar.unit,
    )


def fraction_of(place: str, length: float | None, begin: float) -> float:
    """Fraction of the length of a pipe or route, from a text such as "0.5" or "1.2 km". Raises ValueError.

    length : length of the pipe or route [m]; None for a faulty pipe, where every chainage is accepted
    begin : chainage of its start [m]
    """
    try:
        share = float(place)
        text = f'"@{place}" is not a fraction of the length; expected 0 to 1'
    except ValueError:
        try:
            share = units.parse(place, "length") - begin
            share = 0.0 if length is None else share / length
        except ValueError:
            text = f'"@{place}" is not a fraction of the length; expected 0 to 1, or a chainage with its unit'
            raise ValueError(text) from None
        text = (
            ""
            if length is None
            else f'"@{place}" is outside {begin:.10g} m to {begin + length:.10g} m'
        )
    if not -1e-12 <= share <= 1.0 + 1e-12:
        raise ValueError(text or f'"@{place}" is not a fraction of the length; expected 0 to 1')
    return min(max(share, 0.0), 1.0)


def default_probes(kinds: Kinds) -> list[Probe]:
    """Default probes: main quantities of all nodes (such as pressure and level) and of all links (flow, force).

    Scalars are included for nodes with a pressure. kinds : as for `read_probe`
    """
    probes = []
    for part, quantities in (("nodes", DEFAULT_OF_NODES), ("links", DEFAULT_OF_LINKS)):
        other = kinds["links" if part == "nodes" else "nodes"]
        for name, kind in kinds[part].items():
            known = {} if kind is None else kind.quantities
            own = [
                key
                for key in quantities
                if key in known and key not in getattr(kind, "on_request", ())
            ]
            own += [key for key in getattr(kind, "main_quantities", ()) if key not in own]
            for quantity in [*own, *_scalars_of(kind, kinds, "quantities")] if own else []:
                text = f"{part}.{name}.{quantity}" if name in other else f"{name}.{quantity}"
                probes.append(_probe(text, part, name, quantity, None, kinds))
    for group, quantity in (("controls", "output"), ("reactions", "rate"), ("sections", "flow")):
        for name, kind in kinds.get(group, {}).items():
            if kind is not None:
                probes.append(_probe(f"{name}.{quantity}", group, name, quantity, None, kinds))
    return probes


def _scalars_of(kind: type[Node] | type[Link], kinds: Kinds, where: str) -> dict[str, str]:
    """Scalars (name -> "number") of a class of part: all of the case if it has a pressure or states them; else none.

    where : attribute of the class that lists its quantities, "along" for those along a pipe, or "quantities"
    """
    has = "pressure" in getattr(kind, where, {}) or getattr(kind, "own_scalars", "") == where
    return dict.fromkeys(kinds["scalars"] if has else (), "number")


def _probe(
    text: str, part: str, name: str, quantity: str, place: str | None, kinds: Kinds
) -> Probe:
    kind = kinds[part][name]
    if part == "reactions":
        return reaction_probe(text, name, quantity, place, kinds)
    scalar = None if is_in_network(kind) else kinds["scalars"].get(quantity)
    unit = scalar.unit if scalar is not None else ""
    if quantity in (fields := getattr(kind, "fields", {})):  # of a basin
        point = kind.point(f"{name}.{quantity}", place)
        return Probe(text, part, name, quantity, None, fields[quantity], point, unit)
    along = getattr(kind, "along", {}) | _scalars_of(kind, kinds, "along")
    quantities = kind.quantities | _scalars_of(kind, kinds, "quantities")
    pipe = kinds.get("pipes", {}).get(name) if part == "links" else None
    profile = getattr(pipe, "profile", None)
    begin = 0.0 if profile is None else float(profile.chainage[0])
    fraction, dimension = _quantity(
        kind, along, quantities, name, quantity, place, pipe and pipe.length, begin
    )
    return Probe(text, part, name, quantity, fraction, dimension, unit=unit)


def reaction_probe(
    text: str, name: str, quantity: str, place: str | None, kinds: Kinds
) -> Probe | None:
    """Probe of a reaction; None if its place is faulty. Raises ValueError.

    text : text of the probe; name : name of the reaction with its prefix; kinds : as for `read_probe`
    place : text after "@", for an affinity: a node, PIPE@0.5 or BASIN@x,y
    """
    kind = kinds["reactions"][name]
    if quantity not in kind.quantities:
        known = kind.quantities
        reason = kind.missing if quantity in ("affinity", "power") else f"it has {listing(known)}"
        raise ValueError(f"{name} has no {show(quantity)}{did_you_mean(quantity, known)}; {reason}")
    dimension, where = kind.quantities[quantity], None
    if place is not None:
        if quantity != "affinity":
            raise ValueError(f"{quantity} of {name} is the sum over all places; leave @{place} out")
        node, _, position = place.partition("@")
        where = read_probe(f"{node}.{kind.scalar}" + (f"@{position}" if position else ""), kinds)
        if where is None:
            return None
    return Probe(text, "reactions", name, quantity, None, dimension, place=where)


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
    known = {**getattr(kind, "fields", {}), **along, **own}
    if quantity not in known:
        has = 'with sloshing = "frozen" its water moves with its body; expected a probe of the body'
        has = f"it has {', '.join(known)}{did_you_mean(quantity, known)}" if known else has
        raise ValueError(f"{name} is {article(kind.kind)}, which has no {show(quantity)}; {has}")
    if place is None:
        if quantity not in own:
            text = f'{name} is {article(kind.kind)}, and this probe needs a place, for example "{name}.{quantity}@0.5"'
            raise ValueError(text)
        return (0.0 if quantity in along else None), known[quantity]
    if quantity not in along:
        raise ValueError(
            f"{name} is {article(kind.kind)}, and {quantity} has no place along it; leave @{place} out"
        )
    return fraction_of(place, length, begin), known[quantity]


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
        quantity, dimension = (
            ("pressure", "pressure") if pressed else (self.quantity, self.dimension)
        )
        for group, name in self.parts:
            pipe = links.get(name) if group == "links" else None
            if pipe is None or quantity not in pipe.along:
                yield Probe(f"{group}.{name}.{quantity}", group, name, quantity, None, dimension)
            else:
                count = 0 if pressed or pipe.kind != "pipe" else pipe.cells
                shares = [(k + 0.5) / count for k in range(count)]
                for share in (0.0, *shares, 1.0):
                    yield along(name, quantity, share, dimension)


def along(pipe: str, quantity: str, share: float, dimension: str) -> Probe:
    """Probe at the fraction `share` of the length of a pipe, interpolated linearly between cells.

    quantity, dimension : as in `Probe`
    """
    return Probe(
        f"links.{pipe}.{quantity}@{share!r}",
        "links",
        pipe,
        quantity,
        share,
        dimension,
        straight=True,
    )


def of_profiles(links: Mapping[str, Any]) -> Iterator[Probe]:
    """Pressure probes at both ends and at every profile point of pipes with an elevation profile."""
    for name, link in links.items():
        if getattr(link, "profile", None) is not None:
            inner = link.profile.distance[1:-1] / link.length
            for share in (0.0, *inner.tolist(), 1.0):
                yield along(name, "pressure", share, "pressure")


def read_extent(
    given: Any, quantity: str, kinds: Kinds, routes: Mapping[str, Any]
) -> Extent | None:
    """Read a quantity in the parts or routes that `given` (a name or a list) names; None if one of the parts is faulty.

    kinds : as for `read_probe`; routes : by name. Raises ValueError for unknown names, and ValueFault (at the key
    `quantity`) if a part does not have the quantity.
    """
    names = [given] if isinstance(given, str) else given
    if (
        not isinstance(names, (list, tuple))
        or not names
        or not all(isinstance(word, str) for word in names)
    ):
        text = f'{show(given)} is not a name; expected a part, a route, "pipes" or "nodes", or a list of names'
        raise ValueError(text)
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
        has = (
            f"has {', '.join(known)}{did_you_mean(quantity, known)}"
            if known
            else "has no quantities"
        )
        verb = "have" if more else "has"
        text = f"{name}{more} {verb} no {show(quantity)}: {name} is {article(kinds[group][name].kind)} and {has}"
        raise ValueFault([(("quantity",), text)])
    if not known:
        return None
    return Extent(tuple(names), tuple(parts), quantity, dimensions.pop())


def parts_of(
    name: str, quantity: str, kinds: Kinds, routes: Mapping[str, Any]
) -> list[tuple[str, str]] | None:
    """Pairs (group, name) of the parts denoted by `name`: a part, the pipes of a route, all "pipes" or all "nodes".

    None if a part is faulty. Raises ValueError for an unknown name or a missing quantity. kinds : as for `read_probe`
    """
    group, dot, rest = name.partition(".")
    if dot and group in ("nodes", "links") and rest in kinds[group]:
        return None if kinds[group][rest] is None else [(group, rest)]
    groups = [group for group in ("nodes", "links") if name in kinds[group]]
    if len(groups) > 1:
        raise ValueError(
            f"a node and a link are named {show(name)}; write nodes.{name} or links.{name}"
        )
    if groups:
        return None if kinds[groups[0]][name] is None else [(groups[0], name)]
    if name in routes:
        if quantity not in (known := quantities_of(Pipe)):
            has = f"it has {', '.join(known)}{did_you_mean(quantity, known)}"
            raise ValueFault(
                [(("quantity",), f"{name} has no {show(quantity)}: it is a route; {has}")]
            )
        return None if routes[name] is None else [("links", pipe) for pipe in routes[name].pipes]
    if may_be_piece(name, kinds) or (name in ALL and None in kinds[ALL[name]].values()):
        return None
    if name in ALL:
        known = {part: kind for part, kind in kinds[ALL[name]].items() if kind is not None}
        if name == "pipes":
            matches = [(ALL[name], part) for part, kind in known.items() if issubclass(kind, Pipe)]
        else:  # without reservoirs, whose pressure is given
            matches = [
                (ALL[name], part)
                for part, kind in known.items()
                if quantity in quantities_of(kind)
                and not (kind is Reservoir and quantity in OF_PRESSURE)
            ]
        if not matches:
            if name == "pipes":
                raise ValueError(f"{show(name)} means all pipes, but the case has none")
            raise ValueFault([(("quantity",), f"no node has {show(quantity)}")])
        return matches
    known = [*kinds["nodes"], *kinds["links"], *routes, *ALL]
    text = f"unknown part or route {show(name)}{did_you_mean(name, known) or f'; there are {listing(known)}'}"
    raise ValueError(text)


def quantities_of(kind: Any) -> dict[str, str]:
    """Quantities that can be recorded in a class of part: name -> dimension."""
    result = {**getattr(kind, "quantities", {}), **getattr(kind, "along", {})}
    return result | ({"pressure_head": "head"} if "pressure" in result else {})


def only_dimension(quantity: str) -> str | None:
    """Dimension of a quantity in all types of parts; None if no type has it, or if the dimensions differ."""
    dimensions = _dimensions(tuple(kind for group in KINDS.values() for kind in group)).get(
        quantity, ()
    )
    return next(iter(dimensions)) if len(dimensions) == 1 else None


@functools.cache
def _dimensions(types: tuple[str, ...]) -> dict[str, set[str]]:
    """Dimensions of each quantity in all types of parts; types : their names, to which a plugin may add."""
    result: dict[str, set[str]] = {}
    for kind in (kind for group in KINDS.values() for kind in group.values()):
        for quantity, dimension in quantities_of(kind).items():
            result.setdefault(quantity, set()).add(dimension)
    return result
