"""What must hold between the parts of a case. Knows the network; each part has checked itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fvsolve import units
from fvsolve.case.claims import Expect
from fvsolve.case.raw import Raw
from fvsolve.case.sections import Numerics
from fvsolve.errors import did_you_mean, listing
from fvsolve.parts import KINDS, Chamber, Reservoir
from fvsolve.steppers.methods import METHODS
from fvsolve.units import show

Found = Iterator[tuple[tuple, str]]


def network(table: dict[str, Any]) -> Found:
    """Faults of the incidence list, from names alone: unknown places, loose nodes, islands, nothing fixed."""
    nodes, links = ({n: p for n, p in _dict(table.get(group)).items()} for group in ("nodes", "links"))
    ends: dict[str, list[str]] = {}
    for name, link in links.items():
        found = {key: _dict(link).get(key) for key in ("from", "to")}
        for key, place in found.items():
            if isinstance(place, str) and place not in nodes:
                yield ("links", name, key), _unknown_place(place, nodes, links)
        if isinstance(found["from"], str) and found["from"] == found["to"]:
            yield ("links", name, "to"), f"joins {show(found['to'])} to itself"
        ends[name] = [place for place in found.values() if isinstance(place, str) and place in nodes]
    for group in ("nodes", "links"):
        if table.get(group) == {}:
            yield (group,), "is empty; wanted two places and a link between them at least"
    touched = {place for places in ends.values() for place in places}
    for name in nodes:
        if name not in touched:
            yield ("nodes", name), "no link touches it"
    if any(len(set(places)) < 2 for places in ends.values()):
        return  # what hangs together is not known
    islands = _islands(ends)
    if len(islands) > 1:
        sizes = " | ".join(listing(island, 6) for island in islands)
        yield ("links",), f"disconnected network of {len(islands)} pieces: {sizes}; write a case for each"
    for island in islands:
        kinds = [KINDS["nodes"].get(str(_dict(nodes[name]).get("type"))) for name in island]
        if all(kind is not None and not kind.fixes_pressure for kind in kinds):
            where = "" if len(islands) == 1 else f" of {listing(island, 6)}"
            yield ("nodes",), f"nothing fixes the pressure{where}; wanted a reservoir, tank or chamber"
    yield from _rigid_junctions(nodes, links, ends)


def parts(
    nodes: dict[str, Any], links: dict[str, Any], ambient: float, gravity: float | None, fluid: Any, raw: Raw
) -> Found:
    """Faults of elevations and pressures."""
    yield from _elevations(nodes, links)
    for name, node in nodes.items():
        level, height = getattr(node, "level", None), getattr(node, "height", None)
        if height is not None and level > height:
            yield ("nodes", name, "level"), f"{level:g} m is above its height of {height:g} m"
        if fluid is None:
            continue
        if isinstance(node, Chamber) and node.initial_pressure is not None:
            yield from _vacuum(("nodes", name, "initial_pressure"), [node.initial_pressure], fluid, raw)
        if isinstance(node, Reservoir) and node.pressure is not None:
            yield from _vacuum(("nodes", name, "pressure"), node.pressure.value.tolist(), fluid, raw)
        if isinstance(node, Reservoir) and node.head is not None and gravity is not None:
            head = float(node.head.value.min())
            pressure = ambient + fluid.density * gravity * (head - (node.elevation or 0.0))
            boiling = fluid.vapor_pressure
            if pressure <= boiling:
                place = f"a head of {head:g} m at elevation {node.elevation or 0.0:g} m"
                yield ("nodes", name, "head"), f"{place}: {units.vacuum(pressure, pressure, boiling)}"


def numerics(numerics: Numerics, has_cells: bool) -> Found:
    """Faults of times and of step control."""
    if not numerics.end > numerics.start:
        yield ("numerics", "end"), f"{numerics.end:g} s is not after the start at {numerics.start:g} s"
    if numerics.courant is not None and not has_cells:
        yield ("numerics", "courant"), "no pipe, so no cell to cross; give step or rtol"
    method = METHODS.get(numerics.method)
    if numerics.rtol is not None and method is not None and not method.adaptive:
        able = " or ".join(show(name) for name, other in METHODS.items() if other.adaptive)
        message = f"method {show(method.name)} estimates no error; use {able}, or courant or step"
        yield ("numerics", "rtol"), message


def claims(expect: dict[str, Expect], numerics: Numerics) -> Found:
    """Faults of claims at a time outside the run."""
    for text, claim in expect.items():
        if claim is not None and claim.time is not None and not numerics.start <= claim.time <= numerics.end:
            run = f"{numerics.start:g} s to {numerics.end:g} s"
            yield ("expect", text), f"{claim.time:g} s is not within the run, {run}"


def _dict(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _unknown_place(place: str, nodes: dict[str, Any], links: dict[str, Any]) -> str:
    if place in links:
        places = f"put a junction between; places are {listing(nodes)}"
        return f"{show(place)} is a link, and a link joins places: {places}"
    return f"no place named {show(place)}; places are {listing(nodes)}{did_you_mean(place, nodes)}"


def _islands(ends: dict[str, list[str]]) -> list[list[str]]:
    """Nodes that hang together by links, in order of appearance."""
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
    return list(islands.values())


def _rigid_junctions(nodes: dict[str, Any], links: dict[str, Any], ends: dict[str, list[str]]) -> Found:
    touching: dict[str, set[str]] = {}
    for link, places in ends.items():
        for place in places:
            touching.setdefault(place, set()).add(str(_dict(links[link]).get("type")))
    for name, node in nodes.items():
        if _dict(node).get("type") in ("junction", "inflow") and touching.get(name) == {"rigid-column"}:
            message = "only rigid columns meet here, so nothing sets its pressure; give it a chamber volume"
            yield ("nodes", name), message


def _elevations(nodes: dict[str, Any], links: dict[str, Any]) -> Found:
    stated = [name for name, node in nodes.items() if node.elevation is not None]
    by_head = [name for name, node in nodes.items() if isinstance(node, Reservoir) and node.head is not None]
    for name in nodes:
        if stated and name not in stated and name not in by_head:
            yield ("nodes", name), f"elevation is missing: {listing(stated)} state one, so all must, or none"
    for name, link in links.items():
        length = getattr(link, "length", None)
        heights = [nodes[place].elevation for place in (link.from_, link.to) if place in nodes]
        if length is None or len(heights) < 2 or None in heights:
            continue
        if abs(heights[1] - heights[0]) > length:
            climb = abs(heights[1] - heights[0])
            yield (
                ("links", name, "length"),
                f"{length:g} m is too short: its ends lie {climb:g} m apart in height",
            )


def _vacuum(keys: tuple, values: list[float], fluid: Any, raw: Raw) -> Found:
    lowest = min(values)
    if lowest > fluid.vapor_pressure:
        return
    given, keys = _said(keys, values.index(lowest), raw)
    if isinstance(given, (dict, list)) or given is None:
        given = lowest
    yield keys, units.vacuum(given, lowest, fluid.vapor_pressure)


def _said(keys: tuple, index: int, raw: Raw) -> tuple[Any, tuple]:
    """What the file says of one value of a schedule, and where."""
    given = raw.get(keys)
    if isinstance(given, dict) and "signal" in given:
        keys = ("signals", given["signal"])
        given = raw.get(keys)
    if isinstance(given, dict) and isinstance(given.get("value"), list):
        return given["value"][index], (*keys, "value", index)
    return given, keys
