"""What must hold of places of a network that ride on bodies, and of links that join them. Knows no basin's fields."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.case.riding import free_joints, place_faults
from fvsolve.parts.basin.part import Basin
from fvsolve.parts.node import Node, Rider
from fvsolve.units import show

Found = Iterator[tuple[tuple, str]]
PIPE_THERE = "wanted a pipe there, or a chamber"
CLOSE = 1e-6  # of a length, and of no way [m]: places are typed with a few digits


def standing(node: Node, poses: dict[str, Any]) -> Node:
    """A node whose elevation is that at the start where it rides on a body."""
    pose = poses.get(getattr(node, "on", None))
    if pose is None or isinstance(node, Basin):
        return node
    return node.model_copy(update={"elevation": float(pose.at(node.place)[2])})


def has_height(node: Node, poses: dict[str, Any]) -> bool:
    """Whether a node has one elevation: a basin on a body has none, nor what rides on one unknown."""
    on = getattr(node, "on", None)
    return on is None or (on in poses and not isinstance(node, Basin))


def misfits(nodes: dict[str, Any], links: dict[str, Any], patches: dict[str, Any], named: Any) -> Found:
    """Faults of places of a network that ride on bodies, and of links that join them; patches : of basins that do."""
    for name, node in nodes.items():
        if isinstance(node, Basin) or not isinstance(node, Rider):
            continue
        yield from place_faults(name, node, nodes, named)
        if node.on is not None and getattr(node, "head", None) is not None:
            yield ("nodes", name, "head"), f"it rides on {node.on}, and a head counts from the ground; wanted pressure"
    for name, link in links.items():
        ends = [place for port, place in link.ports.items() if link.joins.get(port) == "hydraulic"]
        yield from ((("links", name, *key), text) for key, text in link_faults(link, ends, nodes, patches))
    for place, text in unfelt(nodes, links, free=True):
        yield place, f"{text}, or a driven joint in place of a free one"


def unfelt(nodes: dict[str, Any], links: dict[str, Any], free: bool = False) -> Found:
    """What bodies would not feel of networks on them; of those alone that move freely, where that is asked."""

    def riding(name: str) -> bool:
        on = getattr(whose(name, nodes), "on", None)
        return on is not None and (not free or any(free_joints(on, nodes)))

    tanks = [name for name, node in nodes.items() if node.kind == "tank" and riding(name)]
    for name in tanks:
        for key in ("connection", "height"):
            if getattr(nodes[name], key) is not None:
                yield ("nodes", name, key), "what passes here is not felt by its body yet; leave it out"
        if hasattr(nodes[name].area, "area"):
            yield ("nodes", name, "area"), "a body feels tanks of one area alone yet; wanted a number"
    for name, link in links.items():
        ends = [place for port, place in link.ports.items() if link.joins.get(port) == "hydraulic"]
        if not any(map(riding, ends)):
            continue
        key = ("links", name)
        for end in dict.fromkeys(end for end in ends if isinstance(whose(end, nodes), Basin)):
            yield key, f"what passes {end} is not felt by its body yet; wanted a tank in place of the basin"
        if link.kind == "leak":
            yield key, "what leaves here is not felt by its body yet; wanted a valve to a reservoir"
        elif link.kind == "rigid-column":
            for end in ends:
                if end in nodes and led(end, nodes, links):
                    yield key, f"at {end} it meets none but valves and columns, which is not felt yet; {PIPE_THERE}"
        elif link.kind != "pipe" or free:
            for end in dict.fromkeys(end for end in ends if end in tanks):
                what = "a pipe answers at once" if link.kind == "pipe" else "a valve has no inertia"
                yield key, f"{what} to {end}, whose own flow has none either; wanted a rigid-column between"


def led(end: str, nodes: dict[str, Any], links: dict[str, Any]) -> bool:
    """Whether none but rigid columns and restrictions set the pressure of a place."""
    kinds = {link.kind for link in links.values() if end in link.ports.values()}
    return nodes[end].kind in ("junction", "inflow") and "pipe" not in kinds


def whose(place: str, nodes: dict[str, Any]) -> Any:
    """The node that a place is, or the basin whose patch it is."""
    return nodes.get(place, nodes.get(place.rpartition(".")[0]))


def link_faults(link: Any, ends: list[str], nodes: dict[str, Any], patches: dict[str, Any]) -> Found:
    """Faults of a link between places of which one or more ride."""
    stand = [whose(place, nodes) for place in ends]
    on = [getattr(node, "on", None) for node in stand]
    if None in stand or any(body is not None and body not in nodes for body in on):
        return  # at fault itself
    if not any(on):
        if getattr(link, "route", None):
            yield ("route",), "is a way on a body, and its ends ride on none; give both on and at"
        return
    if len(set(on)) > 1:
        each = zip(ends, on, strict=True)
        said = " and ".join(f"{end}, on {body}" if body else f"{end}, which stands still" for end, body in each)
        yield (), f"joins {said}: between these goes a hose, which there is not yet"
        return
    unable = [*dict.fromkeys(said for end, node in zip(ends, stand, strict=True) for said in shut(end, node))]
    yield from (((), text) for text in unable)
    where = [patches.get(end, node) for end, node in zip(ends, stand, strict=True)]
    if unable or any(isinstance(node, Basin) for node in where):
        return  # at fault itself
    length = getattr(link, "length", None)
    points = np.array([where[0].place, *getattr(link, "route", []), where[-1].place])
    way = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    if length is None and way > CLOSE:
        text = f"its ends lie {way:g} m apart{said_of(ends, patches)}, and a {link.kind} has no way between"
        yield (), f"{text}; wanted both at one place, and a pipe or rigid-column to the next"
    elif length is not None and way > length * (1.0 + CLOSE):
        yield ("length",), f"{length:g} m is too short: its way on {on[0]} is {way:g} m long{said_of(ends, patches)}"


def shut(end: str, node: Any) -> Iterator[str]:
    """Why nothing can join a patch of a basin that rides, if so."""
    if not isinstance(node, Basin):
        return
    if not node.own.docks:
        what = f"of a basin that rides, which physics {show(node.physics)} does not go with yet"
        yield f"joins {end} {what}; wanted a free surface, or a tank"
    elif node.lumped:
        yield f'joins {end}, behind which there are no cells; wanted sloshing = "cells"'


def said_of(ends: list[str], patches: dict[str, Any]) -> str:
    """Where patches are that nobody stated."""
    found = [f"{end} at [{', '.join(f'{one:.7g}' for one in patches[end].at)}]" for end in ends if end in patches]
    return f" ({' and '.join(found)})" if found else ""
