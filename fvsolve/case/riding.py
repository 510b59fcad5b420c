"""What must hold between what rides on bodies and the rest of a case. Knows no network."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fvsolve.case.bodies import hangs_on
from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.body.part import Body
from fvsolve.units import show

Found = Iterator[tuple[tuple, str]]


def misfits(name: str, basin: Any, nodes: dict[str, Any], joined: set[str]) -> Found:
    """Faults of a basin that rides on a body."""
    key = ("nodes", name)
    if basin.on is None:
        for other in ("at", "attitude"):
            if getattr(basin, other) is not None:
                yield (*key, other), "is a place on a body; name that with on"
        return
    yield from (((*key, "on"), text) for text in body_faults(basin.on, nodes))
    if basin.elevation is not None:
        yield (*key, "elevation"), f"it rides on {basin.on}; say where with at, in axes of that body"
    if not basin.own.rides:
        yield (*key, "on"), f'physics {show(basin.physics)} rides on no body yet; wanted "free-surface"'
    if any(one.moves for one in basin.patches.values()):
        yield (*key, "on"), "its walls move, and its axes too; wanted one of both"
    free = next(free_joints(basin.on, nodes), None)
    for patch, one in basin.patches.items():
        if one.boundary == "open" and free is not None:
            text = f"{free} moves freely, and would have to feel what leaves here; wanted a wall, or a driven joint"
            yield (*key, "patches", patch, "boundary"), text
        if f"{name}.{patch}" in joined:
            text = "a link joins here, and the basin rides on a body: between these goes a hose, which there is not yet"
            yield (*key, "patches", patch), text


def body_faults(on: str, nodes: dict[str, Any]) -> Iterator[str]:
    """Faults of the body that something rides on."""
    bodies = [one for one, node in nodes.items() if isinstance(node, Body)]
    if not isinstance(nodes.get(on), Body):
        what = f"is a {nodes[on].kind}" if on in nodes else "is not there"
        yield f"{show(on)} {what}; wanted a body: {listing(bodies) or 'there is none'}{did_you_mean(on, bodies)}"
        return


def free_joints(on: str, nodes: dict[str, Any]) -> Iterator[str]:
    """Bodies between one and the world whose joints forces move."""
    seen: set[str] = set()
    while isinstance(nodes.get(on), Body) and on not in seen:
        seen.add(on)
        joint = nodes[on].joint
        if joint.kind != "fixed" and joint.driven is None:
            yield on
        on = hangs_on(nodes[on])[0]
