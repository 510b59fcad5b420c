"""Checks between the parts of a case; the keys of each part are checked when it is read."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fvsolve import units
from fvsolve.case import basins, basins_on_bodies, bodies, moving_network_checks, sloshing
from fvsolve.case.bodies import WORLD
from fvsolve.case.expectations import Expect
from fvsolve.case.raw import Raw
from fvsolve.case.sections import CAVITY_SCHEMES, FluidSpec, Numerics
from fvsolve.errors import article, did_you_mean, listing
from fvsolve.parts import KINDS, Chamber
from fvsolve.parts.context import CaseContext
from fvsolve.parts.value import ROOT
from fvsolve.steppers.loop_records import LEAST_STEP, LEAST_TOLERANCE
from fvsolve.steppers.tableau import AUTO, METHODS
from fvsolve.units import show

Faults = Iterator[tuple[tuple, str]]


def network(table: dict[str, Any]) -> Faults:
    """Faults (key path, message) of connections of a case: unknown names, unconnected nodes, wrong domains.

    Further faults are separate networks, networks in which no part sets a pressure, and junctions that join only rigid
    columns.
    table : nested dicts of the case as in the file
    """
    nodes, links = ({n: p for n, p in _dict(table.get(group)).items()} for group in ("nodes", "links"))
    gone = [name for name in (*nodes, *links) if has_unknown_places(name, nodes, links)]
    places = _places(nodes, links, gone)
    ends: dict[str, list[str]] = {}
    unjoined = 0  # ports that join no known place
    for name, link in links.items():
        ports, fits = _ports(_dict(link)), True
        for keys, place, domain in ports:
            if isinstance(place, str) and place not in places:
                yield ("links", name, *keys), _unknown_place(place, places, nodes, links)
            elif isinstance(place, str) and None not in (domain, places[place]) and not _fits(places[place], domain):
                fits = False
                yield ("links", name, *keys), _wrong_domain(place, domain, places, nodes, _dict(link))
        sorts = {places.get(place): (keys, place) for keys, place, _ in ports if isinstance(place, str)}
        if fits and {"translational", "spatial"} <= set(sorts):
            keys, place = sorts["translational"]
            text = f"{show(place)} is a place on the axis of masses, {show(sorts['spatial'][1])} a place in space"
            yield (
                ("links", name, *keys),
                f"{text}; expected two masses, or two points in space (FRAME.POINT for a frame)",
            )
        joined = [place for _, place, _ in ports if isinstance(place, str)]
        for k, (keys, place, _) in enumerate(ports):
            if isinstance(place, str) and place in [other for _, other, _ in ports[:k]]:
                yield ("links", name, *keys), f"joins {show(place)} to itself"
        unjoined += len(ports) - len({*joined} & places.keys())
        ends[name] = [place for place in [*joined, *_owned_places(name, link)] if place in places]
    for group in ("nodes", "links"):
        kinds = [_dict(node).get("type") for node in nodes.values()]
        alone = "body" in kinds or any(own_places(name, node) is not None for name, node in nodes.items())
        if table.get(group) == {} and not alone:
            yield (group,), "is empty; expected at least two nodes and a link between them"
    tied = {name: _joined_places(name, node, places) for name, node in nodes.items()}
    hanging = _carrier_pairs(nodes, places)
    touched = {place for places in [*ends.values(), *tied.values(), *hanging] for place in places}
    loose = [name for name, node in nodes.items() if name not in gone and own_places(name, node) is None
             and not touched & {name, *points_of(name, node)}]  # fmt: skip
    if len(loose) > unjoined:  # otherwise faulty ports may be those that join them
        yield from ((("nodes", name), "no link touches it") for name in loose)
    if unjoined or gone:
        return  # the connections are not known
    own = {name: [name, *ties] if name in places else ties for name, ties in tied.items() if ties}
    own |= {f"{name}.": [name, *points] for name, node in nodes.items() if (points := points_of(name, node))}
    own |= {f"{k}..": group for k, group in enumerate(hanging)}
    islands = _islands(own | {f"links.{name}": places for name, places in ends.items()})
    if len(islands) > 1:
        sizes = " | ".join(listing(island, 6) for island in islands)
        text = f"disconnected network of {len(islands)} parts: {sizes}"
        yield ("links",), f"{text}; join these parts, or write a case for each part"
    for island in islands:
        wet = [name for name in island if places[name] in ("hydraulic", None)]
        kinds = [_kind("nodes", nodes[name]) if name in nodes else Chamber for name in wet]
        if kinds and all(kind is not None and not kind.fixes_pressure for kind in kinds):
            where = "" if len(islands) == 1 else f" of {listing(island, 6)}"
            yield ("nodes",), f"nothing fixes the pressure{where}; expected a reservoir, tank or chamber"
    yield from _rigid_junctions(nodes, links, ends)


def parts(
    nodes: dict[str, Any],
    links: dict[str, Any],
    ambient: float,
    gravity: float | None,
    fluid: Any,
    raw: Raw | None,
    start: float,
    meshes: dict[str, Any],
    lumped: dict[str, Any],
) -> Faults:
    """Faults (key path, message) of elevations, of bodies, and of each part in the context of the other parts.

    ambient : ambient pressure [Pa]; gravity [m/s2]; fluid : properties of the fluid, or None if it is faulty
    raw : case before its values were read, for messages; it may be None if `fluid` is None; start : start time [s]
    meshes, lumped : basin -> mesh, of basins with cells and of basins whose water is lumped masses
    """
    poses = bodies.poses(nodes, start)
    named = nodes if raw is None else _dict(raw.table.get("nodes"))
    high = {name: node for name, node in nodes.items() if moving_network_checks.has_elevation(node, poses)}
    raw_links = {} if raw is None else _dict(raw.table.get("links"))
    lends = any("profile" in _dict(link) or kind_name(link, "links") is None or not {*_ends(link)} <= named.keys()
                for name, link in raw_links.items() if name not in links or "profile" in _dict(link))  # fmt: skip
    yield from _elevations(
        {name: moving_network_checks.with_elevation(node, poses) for name, node in high.items()}, links, lends
    )

    def vacuum(group: str, name: str, key: str, pressures: list[float]) -> Faults:
        if fluid is not None:
            for keys, text in _vacuum((group, name, key), pressures, fluid, raw):
                yield (ROOT, *keys), text

    if meshes or lumped or gravity == 0.0 or any(map(in_space, (*nodes.values(), *links.values()))):
        yield from bodies.find_faults(nodes, named)
        yield from moving_network_checks.find_faults(nodes, links, basins.places_on_bodies(nodes, meshes), named)
        yield from bodies.coincident_ends(nodes, links, poses)
        yield from bodies.open_pins(nodes, links, poses)
        yield from sloshing.find_faults(nodes, lumped, poses)
        yield from sloshing.weightless(nodes, gravity)
        yield from basins_on_bodies.overturned(nodes, poses)
    around = CaseContext(
        nodes, links, ambient, gravity, fluid, vacuum, lambda *ends: bodies.separation(nodes, poses, *ends)
    )
    for group, members in (("links", links), ("nodes", nodes)):
        for name, part in members.items():
            for keys, text in part.faults(name, around):
                yield keys[1:] if keys[:1] == (ROOT,) else (group, name, *keys), text


PLACE_KEYS = ("on", "at", "attitude")  # keys of places on bodies


def in_space(part: Any) -> bool:
    """True if a part has points, a route or a position in space or on a body."""
    values = vars(part)
    return "points" in values or bool(values.get("route")) or any(values.get(key) is not None for key in PLACE_KEYS)


def numerics(numerics: Numerics, has_cells: bool) -> Faults:
    """Faults (key path, message) of times and step control; has_cells : True if the case has pipes or basins."""
    if not numerics.end > numerics.start:
        yield ("numerics", "end"), f"{numerics.end:g} s is not after the start at {numerics.start:g} s"
    method = METHODS.get(numerics.method)
    if numerics.courant is not None and not has_cells:
        or_rtol = " or `rtol`" if method is None or method.adaptive else ""
        yield ("numerics", "courant"), f"needs cells, and the case has no pipe or basin; give `step`{or_rtol} instead"
    least = LEAST_STEP * max(abs(numerics.start), abs(numerics.end))
    if numerics.step is not None and not numerics.step > least:
        yield (
            ("numerics", "step"),
            f"{numerics.step:g} s is below the rounding error of the time; expected more than {least:.2g} s",
        )
    if numerics.rtol is not None and numerics.rtol < LEAST_TOLERANCE:
        yield ("numerics", "rtol"), f"{numerics.rtol:g} is below rounding errors; expected {LEAST_TOLERANCE:g} or more"
    if numerics.method == AUTO and not numerics.courant is numerics.step is None:
        yield (
            ("numerics", "method"),
            'method "auto" controls the error of its steps; give `rtol`, not `courant` or `step`',
        )
    by_error = numerics.rtol is not None or (not has_cells and numerics.courant is numerics.step is None)
    if by_error and method is not None and not method.adaptive:
        able = " or ".join(dict.fromkeys(show(other.name) for other in METHODS.values() if other.adaptive))
        message = f"method {show(method.name)} estimates no error; use {able}, or {'`courant` or ' * has_cells}`step`"
        yield ("numerics", "method" if numerics.rtol is None else "rtol"), message


def follows_cavities(fluid: FluidSpec | None, has_cells: bool) -> bool:
    """True if cavities in pipes are computed: the case has cells and `cavitation`. fluid : None if it is faulty"""
    return has_cells and fluid is not None and bool(fluid.cavitation)


def cavities(numerics: Numerics, has_cells: bool, fluid: FluidSpec | None) -> Faults:
    """Yield a fault if a case with `cavitation` states a scheme that cannot compute cavities."""
    if follows_cavities(fluid, has_cells) and numerics.scheme not in (None, *CAVITY_SCHEMES):
        able = " or ".join(map(show, CAVITY_SCHEMES))
        yield ("numerics", "scheme"), f"{show(numerics.scheme)} cannot compute cavities in pipes; expected {able}"


def claims(expect: dict[str, Expect], numerics: Numerics) -> Faults:
    """Faults of expectations (`[expect]`) at a time outside the run."""
    for text, claim in expect.items() if numerics.end > numerics.start else ():
        if claim is not None and claim.time is not None and not numerics.start <= claim.time <= numerics.end:
            run = f"{numerics.start:g} s to {numerics.end:g} s"
            yield ("expect", text), f"{claim.time:g} s is not within the run, {run}"


def _dict(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _kind(group: str, part: Any) -> Any:
    return KINDS[group].get(str(_dict(part).get("type")))


def _owned_places(name: str, link: Any) -> dict[str, str]:
    """Domains of the nodes that a link contains, such as the chambers of a cylinder : full name -> domain.

    link : its keys as in the file
    """
    kind = _kind("links", link)
    return {f"{name}.{place}": domain for place, domain in kind.owns.items()} if kind else {}


def own_places(name: str, node: Any) -> list[str] | None:
    """Full names of the places of a node that links join, such as the patches of a basin.

    None for a node that links join by its own name. node : its keys as in the file
    """
    kind = _kind("nodes", node)
    own = kind.own_places(_dict(node)) if kind else None
    return None if own is None else [f"{name}.{place}" for place in own]


def kind_name(part: Any, group: str = "nodes") -> str | None:
    """Type of a part from its keys in the file; None if the type is unknown."""
    kind = _kind(group, part)
    return None if kind is None else kind.kind


def has_mesh_file(node: Any) -> bool:
    """True if a node is a basin with its mesh in a file; node : its keys as in the file."""
    return _dict(node).get("type") == "basin" and "mesh" in node


def named_places(name: str, links: dict[str, Any]) -> list[str]:
    """Names of points, patches or chambers of the part `name` that links join, without "NAME." before them.

    links : name -> keys as in the file
    """
    places = [place for link in links.values() for _, place, _ in _ports(_dict(link)) if isinstance(place, str)]
    return [place.partition(".")[2] for place in places if place.startswith(f"{name}.")]


def _ends(link: Any) -> list[str]:
    """Values of the keys `from` and `to` of a link in the file, as text."""
    return [str(_dict(link).get(key)) for key in ("from", "to")]


def _joined_places(name: str, node: Any, places: dict[str, Any]) -> list[str]:
    """Names that are connected to a node without a link: its own places (see `own_places`), and bodies in its keys.

    These are the body that carries the node, and bodies that move walls of a basin.
    node : its keys as in the file; places : names that links can join
    """
    own, kind = own_places(name, node) or [], _kind("nodes", node)
    return own + [body for body in (kind.bodies(_dict(node)) if kind else ()) if body in places]


def points_of(name: str, node: Any) -> list[str]:
    """Full names NODE.POINT of the points of a node; node : its keys as in the file."""
    kind = _kind("nodes", node)
    return [f"{name}.{point}" for point in _dict(_dict(node).get("points"))] if kind and "points" in kind.keys() else []


def _carrier_pairs(nodes: dict[str, Any], places: dict[str, Any]) -> list[list[str]]:
    """Pairs of connected names: each body with its carrier, and one point of each frame with the world.

    nodes : name -> keys as in the file; places : names that links can join
    """
    pairs = []
    for name, node in nodes.items():
        kind, on = _dict(node).get("type"), _dict(_dict(node).get("joint")).get("on")
        if kind == "body":
            pairs.append([name, on] if isinstance(on, str) and on in places else [name, WORLD])
        elif kind == "frame" and points_of(name, node):
            pairs.append([points_of(name, node)[0], WORLD])
    return pairs


def _fits(domain: str, domains: str) -> bool:
    """True if the domain of a node suits a port; domains : domains that the port accepts, joined by " or "."""
    return domain in domains.split(" or ")


def _places(nodes: dict[str, Any], links: dict[str, Any], gone: list[str]) -> dict[str, str | None]:
    """Domain of every place that links can join, by full name; None if its part is faulty.

    gone : parts whose points, patches or chambers are not known; the names that links use for these are included
    """
    result: dict[str, str | None] = {}
    for name, node in nodes.items():
        kind, own = _kind("nodes", node), own_places(name, node)
        result |= dict.fromkeys([name] if own is None else own, kind.domain if kind else None)
        result |= dict.fromkeys(points_of(name, node), "spatial")
    result |= {place: domain for name, link in links.items() for place, domain in _owned_places(name, link).items()}
    named = [f"{name}.{place}" for name in gone for place in named_places(name, links)]
    return dict.fromkeys(named, None) | result


def has_unknown_places(name: str, nodes: dict[str, Any], links: dict[str, Any]) -> bool:
    """True if the points, patches or chambers of a part are unknown because the part is faulty."""
    for group, parts in (("nodes", nodes), ("links", links)):
        if name in parts and _kind(group, parts[name]) is None:
            return True
    node = _dict(nodes.get(name))
    return any(not isinstance(node.get(key, {}), dict) for key in ("points", "patches"))


def _ports(link: dict[str, Any]) -> list[tuple[tuple, Any, str | None]]:
    """List of (key path in the link, name that the port joins, required domain) of the ports of a link.

    Ports that may be left out and are not given are omitted; the name of a missing port is None. For a link of unknown
    type the ports are `from` and `to`, with None as domain. link : its keys as in the file
    """
    kind = _kind("links", link)
    if kind is None:
        return [((key,), link.get(key), None) for key in ("from", "to")]
    given, below = (_dict(link.get("ports")), ("ports",)) if "ports" in kind.keys() else (link, ())
    ports = [port for port in kind.joins if port in given or port not in kind.may_lack]
    return [((*below, port), given.get(port), kind.joins[port]) for port in ports]


def _unknown_place(place: str, places: dict[str, Any], nodes: dict[str, Any], links: dict[str, Any]) -> str:
    if place in links:
        own = [other for other in places if other not in nodes and other.startswith(f"{place}.")]
        if own:
            return f"{show(place)} is {article(_dict(links[place])['type'])}; its places are {listing(own)}"
        text = f"{show(place)} is a link, and links join places, not links; put a junction between the two links"
        return f"{text}; places are {listing(places)}"
    return f"no place named {show(place)}; places are {listing(places)}{did_you_mean(place, places)}"


def chambers_of(link: Any) -> list[str]:
    """Names of the chambers with fluid that a link contains."""
    return [place for place, domain in link.owns.items() if domain == "hydraulic"]


def _wrong_domain(place: str, domain: str, places: dict[str, Any], nodes: dict[str, Any], link: dict[str, Any]) -> str:
    owned = "shaft" if places[place] == "rotational" else "chamber"
    owned = "point" if places[place] == "spatial" else owned
    state = f"is {article(nodes[place]['type'] if place in nodes else owned)}"
    alike = [name for name, other in places.items() if _fits(other or "", domain)]
    has = f"; {domain} places are {listing(alike)}" if alike else ""
    text = f"{show(place)} {state}, a {places[place]} place, and this port of {article(link['type'])} needs"
    return f"{text} a {domain} place{has}"


def _islands(ends: dict[str, list[str]]) -> list[list[str]]:
    """Groups of connected names, in order of appearance; ends : name of a link or node -> names that it connects."""
    root: dict[str, str] = {}

    def find(name: str) -> str:
        while root.setdefault(name, name) != name:
            root[name] = root[root[name]]
            name = root[name]
        return name

    for places in ends.values():
        for place in places:
            root[find(place)] = find(places[0])
    islands: dict[str, list[str]] = {}
    for name in list(root):
        islands.setdefault(find(name), []).append(name)
    return [[name for name in island if name != WORLD] for island in islands.values()]


def _rigid_junctions(nodes: dict[str, Any], links: dict[str, Any], ends: dict[str, list[str]]) -> Faults:
    touching: dict[str, set[str]] = {}
    for link, places in ends.items():
        for place in places:
            touching.setdefault(place, set()).add(str(_dict(links[link]).get("type")))
    for name, node in nodes.items():
        if _dict(node).get("type") in ("junction", "inflow") and touching.get(name) == {"rigid-column"}:
            fixed = ", since its demand is constant above its required_pressure" if "required_pressure" in node else ""
            message = f"only rigid columns join this node, so nothing sets its pressure{fixed}"
            yield ("nodes", name), f"{message}; use a chamber with a volume"


def _elevations(nodes: dict[str, Any], links: dict[str, Any], lends: bool) -> Faults:
    wet = {("nodes", name): node for name, node in nodes.items() if node.domain == "hydraulic"}
    wet |= {("links", name): link for name, link in links.items() if chambers_of(link)}
    stated = dict.fromkeys(name for (_, name), part in wet.items() if part.elevation is not None)
    for (group, name), part in wet.items():
        derived = getattr(part, "head", None) is not None or getattr(part, "on", None) is not None
        if stated and name not in stated and not derived and not lends:
            yield (group, name), f"elevation is missing, but stated for {listing(stated)}; expected for all or for none"
    heights_of = {name: node.elevation for name, node in nodes.items()}
    heights_of |= {f"{name}.{place}": link.elevation for name, link in links.items() for place in chambers_of(link)}
    for name, link in links.items():
        length = getattr(link, "length", None)
        heights = [heights_of[place] for place in link.ports.values() if place in heights_of]
        if length is None or len(heights) < 2 or None in heights:
            continue
        if abs(heights[1] - heights[0]) > length:
            climb = abs(heights[1] - heights[0])
            yield (
                ("links", name, "length"),
                f"{length:g} m is too short: the ends differ by {climb:g} m in elevation; expected a greater length",
            )


def _vacuum(keys: tuple, values: list[float], fluid: Any, raw: Raw) -> Faults:
    lowest = min(values)
    if lowest > fluid.vapor_pressure:
        return
    given, keys = _raw_value(keys, values.index(lowest), raw)
    if isinstance(given, (dict, list)) or given is None:
        given = lowest
    yield keys, units.vacuum(given, lowest, fluid.vapor_pressure)


def _raw_value(keys: tuple, index: int, raw: Raw) -> tuple[Any, tuple]:
    """Value of entry `index` of a schedule as in the file, and its key path : (value, key path).

    If the schedule is a signal, the entry is taken from `[signals]`; a value that is not a list is returned whole.
    """
    given = raw.get(keys)
    if isinstance(given, dict) and "signal" in given:
        keys = ("signals", given["signal"])
        given = raw.get(keys)
    if isinstance(given, dict) and isinstance(given.get("value"), list):
        return given["value"][index], (*keys, "value", index)
    return given, keys
