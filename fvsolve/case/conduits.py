"""Basins that represent the water of conduits, with the heads of their nodes at the start."""

from typing import Any

import numpy as np

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


def heads_at_start(
    conduits: dict[str, Any], stated: dict[str, float | None]
) -> dict[str, float | None]:
    """Heads of the nodes of conduits; unknown heads are interpolated along the lengths of conduits.

    stated : head of each node, None if it is not known [m]
    """
    from scipy.sparse.csgraph import connected_components

    heads, names = dict(stated), list(stated)
    graph = np.zeros((len(names), len(names)))
    for link in conduits.values():
        i, j = names.index(link.from_), names.index(link.to)
        graph[i, j] += 1.0 / link.length
        graph[j, i] += 1.0 / link.length
    _, group = connected_components(graph)
    for k in range(group.max() + 1):
        known = [i for i in np.flatnonzero(group == k) if heads[names[i]] is not None]
        free = [i for i in np.flatnonzero(group == k) if heads[names[i]] is None]
        if known and free:
            given = np.array([heads[names[i]] for i in known])
            matrix = np.diag(graph.sum(axis=1)) - graph
            found = np.linalg.solve(matrix[np.ix_(free, free)], graph[np.ix_(free, known)] @ given)
            found = np.clip(found, given.min(), given.max())  # equal heads remain equal to the bit
            heads |= dict(zip((names[i] for i in free), found.tolist(), strict=True))
    return heads


def chains_of(
    conduits: dict[str, Any],
    nodes: dict[str, Any],
    links: dict[str, Any],
    stated: dict[str, float | None],
) -> dict[str, Any]:
    """Chain of each conduit: all conduits that junctions and inflows join, at which there are no other links.

    stated : head of each node, None if it is not known [m]
    """
    from scipy.sparse.csgraph import connected_components

    from fvsolve.parts.conduit.part import Chain

    others = {
        place
        for name, link in links.items()
        if name not in conduits
        for place in link.ports.values()
    }
    inflows = {}
    for place in stated:
        node = nodes.get(place)
        if place not in others and is_kind(node, "inflow"):
            inflows[place] = float(node.flow.value[0])
        if place not in others and is_kind(node, "junction"):
            inflows[place] = -float(node.demand.value[0])
    ends = {name: (link.from_, link.to) for name, link in conduits.items()}
    joined = np.array([[place in both for place in inflows] for both in ends.values()], dtype=float)
    _, group = connected_components(joined @ joined.T)
    found = {}
    for k in range(max(group) + 1):
        own = {
            name: conduits[name] for name, mine in zip(conduits, group, strict=True) if mine == k
        }
        places = list(dict.fromkeys(place for name in own for place in ends[name]))
        heads = {
            place: -np.inf if stated[place] is None else stated[place]
            for place in places
            if place not in inflows
        }
        found |= dict.fromkeys(
            own, Chain(own, heads, {place: inflows[place] for place in places if place in inflows})
        )
    return found


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
    from fvsolve.core.mesh.rectangles import rectangle
    from fvsolve.parts.conduit.part import ConduitWater

    places = {place for link in conduits.values() for place in link.ports.values()}
    ends = {place: stated_head(nodes, place, ambient, weight) for place in sorted(places)}
    known, chains = heads_at_start(conduits, ends), chains_of(conduits, nodes, links, ends)
    waters, meshes = {}, {}
    for name, link in conduits.items():
        heads = known[link.from_], known[link.to]
        rests = heads[0] is not None and heads[0] == heads[1] and link.initial_depth is None
        level = heads[0] if rests else min(link.inverts)
        keys = {"level": level, "conduit": link, "heads": heads, "chain": chains[name]}
        waters[name] = ConduitWater.model_construct(physics="conduit", **keys)
        sides = {"from": "west", "to": "east"}
        meshes[name] = rectangle((link.length, link.diameter), (link.cells, 1), patches=sides)
    return waters, meshes
