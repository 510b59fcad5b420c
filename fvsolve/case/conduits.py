"""Basins that represent the water of conduits, with the heads of their nodes at the start."""

from typing import Any

from fvsolve.mesh.rectangles import rectangle
from fvsolve.parts.nodes_and_links import is_kind


def stated_head(nodes: dict[str, Any], place: str, ambient: float, weight: float) -> float | None:
    """Head [m] that a place of a case has at the start, None if its keys do not give it.

    ambient : pressure [Pa]; weight : density times gravity [N/m3]
    """
    node = nodes.get(place.partition(".")[0])
    height = getattr(node, "elevation", None) or 0.0
    if is_kind(node, "reservoir"):
        if node.head is not None:
            return float(node.head.value[0])
        return height + (float(node.pressure.value[0]) - ambient) / weight
    level = getattr(node, "level", None)
    return height + level if isinstance(level, float) else None


def heads_at_start(conduits: dict[str, Any], stated: dict[str, float | None]) -> dict[str, float | None]:
    """Heads of the nodes of conduits; a node without a stated head has the least of those that conduits join to it.

    stated : head of each node, None if it is not known [m]
    """
    heads = dict(stated)
    for _ in heads:
        found: dict[str, float] = {}
        for link in conduits.values():
            for here, there in ((link.from_, link.to), (link.to, link.from_)):
                if heads[here] is None and heads[there] is not None:
                    found[here] = min(heads[there], found.get(here, heads[there]))
        if not found:
            break
        heads |= found
    return heads


def water_of_conduits(
    nodes: dict[str, Any], links: dict[str, Any], ambient: float, weight: float
) -> tuple[dict[str, Any], dict[str, Any]]:
    """(basins, their meshes) of the water of all conduits, by the names of the conduits.

    The level of the water at rest is that of both nodes, if these are equal and give the level at the start; otherwise
    a conduit is dry at rest.
    """
    conduits = {name: link for name, link in links.items() if is_kind(link, "conduit")}
    if not conduits:
        return {}, {}
    from fvsolve.parts.conduit.part import ConduitWater

    ends = {place: stated_head(nodes, place, ambient, weight) for link in conduits.values() for place in link.ports.values()}
    known = heads_at_start(conduits, ends)
    waters, meshes = {}, {}
    for name, link in conduits.items():
        heads = known[link.from_], known[link.to]
        rests = heads[0] is not None and heads[0] == heads[1] and link.initial_depth is None
        level = heads[0] if rests else min(link.inverts)
        waters[name] = ConduitWater.model_construct(physics="conduit", level=level, conduit=link, heads=heads)
        sides = {"from": "west", "to": "east"}
        meshes[name] = rectangle((link.length, link.diameter), (link.cells, 1), patches=sides)
    return waters, meshes
