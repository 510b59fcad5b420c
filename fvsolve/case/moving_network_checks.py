"""Checks of nodes on bodies, and of links that join them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.case.basins_on_bodies import free_joints, place_faults
from fvsolve.errors import article
from fvsolve.parts.basin import Basin
from fvsolve.parts.node import Node, PlaceOnBody
from fvsolve.units import show

Faults = Iterator[tuple[tuple, str]]
USE_PIPE = "expected a pipe there, or a chamber"
LENGTH_TOLERANCE = (
    1e-6  # relative tolerance of a length, and tolerance of zero distance [m]: typed places have few digits
)


def with_elevation(node: Node, poses: dict[str, Any]) -> Node:
    """Copy of a node on a body with its elevation at the start; any other node, or a basin, is returned unchanged."""
    pose = poses.get(getattr(node, "on", None))
    if pose is None or isinstance(node, Basin):
        return node
    return node.model_copy(update={"elevation": float(pose.at(node.place)[2])})


def has_elevation(node: Node, poses: dict[str, Any]) -> bool:
    """True if a node is fixed in the world, or is on a body with a known pose and is not a basin.

    poses : name of a body -> `Pose`
    """
    on = getattr(node, "on", None)
    return on is None or (on in poses and not isinstance(node, Basin))


def find_faults(nodes: dict[str, Any], links: dict[str, Any], patches: dict[str, Any], named: Any) -> Faults:
    """Faults (key path, message) of nodes on bodies, and of links that join them.

    patches : patches of basins on bodies, by full name; named : tables of all nodes, also of faulty nodes
    """
    for name, node in nodes.items():
        if isinstance(node, Basin) or not isinstance(node, PlaceOnBody):
            continue
        yield from place_faults(name, node, nodes, named)
        if node.on is not None and getattr(node, "head", None) is not None:
            yield (
                ("nodes", name, "head"),
                f"the node is on {node.on}, and a head counts from the ground; expected `pressure` instead",
            )
    for name, link in links.items():
        ends = [place for port, place in link.ports.items() if link.joins.get(port) == "hydraulic"]
        yield from ((("links", name, *key), text) for key, text in link_faults(link, ends, nodes, patches))
    for place, text in missing_reactions(nodes, links, free=True):
        yield place, f"{text}, or a driven joint instead of a free joint"


def missing_reactions(nodes: dict[str, Any], links: dict[str, Any], free: bool = False) -> Faults:
    """Faults of parts whose flow acts on a body by a force that is not modelled.

    free : True to check only bodies that move freely; pipes at tanks on these are then faults too
    """

    def on_body(name: str) -> bool:
        on = getattr(node_of(name, nodes), "on", None)
        return on is not None and (not free or any(free_joints(on, nodes)))

    tanks = [name for name, node in nodes.items() if node.kind == "tank" and on_body(name)]
    for name in tanks:
        for key in ("connection", "height"):
            if getattr(nodes[name], key) is not None:
                flow = "flow through the connection" if key == "connection" else "spilled water"
                text = f"the reaction of the {flow} on the body is not modelled yet; expected a tank without this key"
                yield ("nodes", name, key), text
        if hasattr(nodes[name].area, "area"):
            yield ("nodes", name, "area"), "a tank on a body supports only a constant area; expected a number"
    for name, link in links.items():
        ends = [place for port, place in link.ports.items() if link.joins.get(port) == "hydraulic"]
        if not any(map(on_body, ends)):
            continue
        key = ("links", name)
        for end in dict.fromkeys(end for end in ends if isinstance(node_of(end, nodes), Basin)):
            yield (
                key,
                f"the reaction of the flow through {end} is not modelled yet; expected a tank instead of the basin",
            )
        if link.kind == "leak":
            yield key, "the reaction of the leak on the body is not modelled yet; expected a valve to a reservoir"
        elif link.kind == "rigid-column":
            for end in ends:
                if end in nodes and set_by_columns(end, nodes, links):
                    text = f"at {end} this column joins only valves and columns, whose reaction is not modelled yet"
                    yield key, f"{text}; {USE_PIPE}"
        elif link.kind != "pipe" or free:
            for end in dict.fromkeys(end for end in ends if end in tanks):
                reason = "the flow of a pipe" if link.kind == "pipe" else "the flow of a valve"
                yield (
                    key,
                    f"at {end} neither {reason} nor the tank has inertia; expected a rigid-column at the tank",
                )


def set_by_columns(end: str, nodes: dict[str, Any], links: dict[str, Any]) -> bool:
    """True if only rigid columns and restrictions set the pressure of the node `end`."""
    kinds = {link.kind for link in links.values() if end in link.ports.values()}
    return nodes[end].kind in ("junction", "inflow") and "pipe" not in kinds


def node_of(place: str, nodes: dict[str, Any]) -> Any:
    """Node with the name `place`, or basin of the patch `place` (BASIN.PATCH); None if neither exists."""
    return nodes.get(place, nodes.get(place.rpartition(".")[0]))


def link_faults(link: Any, ends: list[str], nodes: dict[str, Any], patches: dict[str, Any]) -> Faults:
    """Faults (key path in the link, message) of a link with an end on a body, or with a route on a body.

    ends : names of the places that its hydraulic ports join; patches : patches of basins on bodies, by full name
    """
    stand = [node_of(place, nodes) for place in ends]
    on = [getattr(node, "on", None) for node in stand]
    if None in stand or any(body is not None and body not in nodes for body in on):
        return  # an end is faulty
    if not any(on):
        if getattr(link, "route", None):
            text = "is a route on a body, but no end of the pipe is on a body"
            yield ("route",), f"{text}; give the nodes at both ends the keys `on` and `at`"
        return
    if len(set(on)) > 1:
        each = zip(ends, on, strict=True)
        words = " and ".join(f"{end}, on {body}" if body else f"{end}, which is fixed" for end, body in each)
        text = f"joins {words}: this would be a flexible hose, which is not supported yet"
        yield (), f"{text}; expected both ends on one body, or both fixed"
        return
    unable = [*dict.fromkeys(words for end, node in zip(ends, stand, strict=True) for words in patch_faults(end, node))]
    yield from (((), text) for text in unable)
    where = [patches.get(end, node) for end, node in zip(ends, stand, strict=True)]
    if unable or any(isinstance(node, Basin) for node in where):
        return  # an end is faulty
    length = getattr(link, "length", None)
    points = np.array([where[0].place, *getattr(link, "route", []), where[-1].place])
    way = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    if length is None and way > LENGTH_TOLERANCE:
        text = f"the ends lie {way:g} m apart{position_text(ends, patches)}, and {article(link.kind)} has no length"
        yield (), f"{text}; expected both ends at one place, and a pipe or rigid-column to the other place"
    elif length is not None and way > length * (1.0 + LENGTH_TOLERANCE):
        yield (
            ("length",),
            f"{length:g} m is too short: the route on {on[0]} is {way:g} m long{position_text(ends, patches)}",
        )


def patch_faults(end: str, node: Any) -> Iterator[str]:
    """Yield the reason, if there is one, why a link cannot join the place `end`, a patch of a basin on a body.

    node : node of the place, see `node_of`; nothing is yielded for a node that is not a basin
    """
    if not isinstance(node, Basin):
        return
    if not node.physics_type.links_on_bodies:
        place = f"of a basin on a body, which physics {show(node.physics)} does not support yet"
        yield f"joins {end} {place}; expected a free surface, or a tank"
    elif node.lumped:
        yield f'joins {end}, a patch of a basin without cells; expected sloshing = "cells" in this basin'


def position_text(ends: list[str], patches: dict[str, Any]) -> str:
    """Text with the computed positions of the ends of a link that are patches; "" if no end is a patch.

    patches : patches of basins on bodies, by full name
    """
    texts = [
        f"{end} at [{', '.join(f'{coordinate:.7g}' for coordinate in patches[end].at)}]"
        for end in ends
        if end in patches
    ]
    return f" ({' and '.join(texts)})" if texts else ""
