"""What must hold of places of a network that ride on bodies, and of links that join them. Knows no basin's fields."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.case.riding import free_joints, place_faults
from fvsolve.parts.basin.part import Basin
from fvsolve.parts.node import Node, Rider

Found = Iterator[tuple[tuple, str]]
FELT = "rigid columns between tanks alone"
CLOSE = 1e-6  # of a length: places are typed with a few digits


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


def misfits(nodes: dict[str, Any], links: dict[str, Any], fluid: Any, named: Any) -> Found:
    """Faults of places of a network that ride on bodies, and of links that join them."""
    for name, node in nodes.items():
        if isinstance(node, Basin) or not isinstance(node, Rider):
            continue
        yield from place_faults(name, node, nodes, named)
        if node.on is not None and (free := next(free_joints(node.on, nodes), None)) is not None:
            if fluid is not None and fluid.law != "linear":
                yield ("fluid", "law"), f'{free} moves freely and carries {name}; wanted "linear", or a driven joint'
            yield from ((("nodes", name, *key), f"{free} moves freely, and {text}") for key, text in unfelt(node))
        if node.on is not None and getattr(node, "head", None) is not None:
            yield ("nodes", name, "head"), f"it rides on {node.on}, and a head counts from the ground; wanted pressure"
    for name, link in links.items():
        ends = [place for port, place in link.ports.items() if link.joins.get(port) == "hydraulic"]
        yield from ((("links", name, *key), text) for key, text in link_faults(link, ends, nodes))
        on = next((body for place in ends if (body := getattr(nodes.get(place), "on", None))), None)
        if on and link.kind != "rigid-column" and (free := next(free_joints(on, nodes), None)) is not None:
            yield (
                ("links", name),
                f"{free} moves freely, and feels {FELT} yet; wanted a rigid-column, or a driven joint",
            )


def unfelt(node: Rider) -> Found:
    """What a body that moves freely does not feel of a place."""
    if node.kind != "tank":
        yield (), f"feels {FELT} yet; wanted a tank, or a driven joint"
        return
    for key in ("connection", "height"):
        if getattr(node, key) is not None:
            yield (key,), "does not feel what passes here yet; leave it out, or drive the joint"
    if hasattr(node.area, "area"):
        yield ("area",), "feels tanks of one area alone yet; wanted a number, or a driven joint"


def link_faults(link: Any, ends: list[str], nodes: dict[str, Any]) -> Found:
    """Faults of a link between places of which one or more ride."""
    stand = [nodes.get(place) for place in ends]
    on = [getattr(node, "on", None) for node in stand]
    if not any(on):
        if getattr(link, "route", None):
            yield ("route",), "is a way on a body, and its ends ride on none; give both on and at"
        return
    if len(set(on)) > 1:
        each = zip(ends, on, strict=True)
        said = " and ".join(f"{end}, on {body}" if body else f"{end}, which stands still" for end, body in each)
        yield (), f"joins {said}: between these goes a hose, which there is not yet"
        return
    if any(isinstance(node, Basin) for node in stand):
        return  # said of its patch
    length = getattr(link, "length", None)
    points = np.array([stand[0].place, *getattr(link, "route", []), stand[-1].place])
    way = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    if length is None and way > 0.0:
        text = f"its ends lie {way:g} m apart, and a {link.kind} has no way between; wanted both at one place"
        yield (), f"{text}, and a pipe or rigid-column to the next"
    elif length is not None and way > length * (1.0 + CLOSE):
        yield ("length",), f"{length:g} m is too short: its way on {on[0]} is {way:g} m long"
