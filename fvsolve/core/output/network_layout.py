"""Plan positions of nodes and paths of links in a picture of the network.

Positions of the case are used if every node has one, or lies on a pipe that is cut between two nodes that have one.
Otherwise nodes are laid out so that distances in the plan approximate the lengths along the network (classical scaling,
then stress majorization; Gansner, Koren and North 2004). The layout of a network is deterministic.
"""

import heapq
from typing import Any, NamedTuple

import numpy as np

from fvsolve.case.pipe_routes import is_cut

MAJORIZATION_ROUNDS = 200  # iterations of the stress majorization
# greatest number of nodes for the layout by all pairs; larger networks get a radial plan
MAX_DENSE_NODES = 400
SHORT_LINK = 0.02  # drawn length of a link without length, as a fraction of the longest pipe
BEND_SIZE = 0.15  # sideways bend of parallel links, as a fraction of their length


class PlaneReference(NamedTuple):
    """Reference of the plane in which nodes have positions.

    crs : coordinate reference system, such as "EPSG:32633", or ""; origin : float64[2]  easting and northing of the
    position (0, 0) [m]
    """

    crs: str
    origin: np.ndarray


def plane_of(case: Any) -> PlaneReference:
    """Reference of the positions of a case: as a table of the case states it, else that of its first basin with one."""
    basins = [node for node in case.nodes.values() if node.kind == "basin"]
    tables = [table for table in case.declared.values() if getattr(table, "crs", None)]
    crs = next((part.crs for part in (*tables, *basins) if part.crs), "")
    for table in tables:
        if table.origin is not None:
            return PlaneReference(crs, np.array(table.origin, float))
    for basin in basins:
        if basin.origin is not None:
            return PlaneReference(crs, np.array(basin.origin) - (basin.position or (0.0, 0.0)))
    return PlaneReference(crs, np.zeros(2))


def plan_positions(case, lengths: dict[str, float]) -> dict[str, np.ndarray]:
    """Plan position [m] of every node, and of links that own places : name -> float64[2].

    lengths : link -> length [m]
    """
    ports = {
        name: [place(port) for port in link.ports.values()] for name, link in case.links.items()
    }
    named = [part for ends in ports.values() for part in ends] + [
        place(part) for part in case.places
    ]
    owners = dict.fromkeys(part for part in named if part not in case.nodes)
    stated = {name: node.position for name, node in case.nodes.items() if node.position is not None}
    stated |= cut_positions(case, stated)
    if len(stated) == len(case.nodes):
        plan = {name: np.array(place, float) for name, place in stated.items()}
        return plan | {name: np.mean([plan[port] for port in ports[name]], 0) for name in owners}
    names = [*case.nodes, *owners]
    index = {name: i for i, name in enumerate(names)}
    short = SHORT_LINK * max(lengths.values(), default=1.0)
    edges = [
        (index[hub], index[other], max(lengths.get(name, short), short))
        for name, ends in ports.items()
        for hub, *others in [[name, *ends] if name in owners else ends]
        for other in others
    ]
    plan = _plan(len(names), edges)
    return dict(zip(names, plan, strict=True))


def cut_positions(case, stated: dict[str, tuple]) -> dict[str, tuple]:
    """Positions of nodes that divide a pipe: on the straight line between its ends, in proportion to length.

    stated : node -> position stated in the case
    """
    result = {}
    for name, route in case.routes.items():
        if not is_cut(name, route.pipes):
            continue
        pieces = [case.links[pipe] for pipe in route.pipes]
        ends = pieces[0].from_, pieces[-1].to
        if all(end in stated for end in ends):
            share = np.cumsum([piece.length for piece in pieces]) / sum(
                piece.length for piece in pieces
            )
            first, last = (np.array(stated[end], float) for end in ends)
            for piece, at in zip(pieces[:-1], share, strict=False):
                result[piece.to] = tuple(first + at * (last - first))
    return {
        name: position
        for name, position in result.items()
        if name in case.nodes and name not in stated
    }


def place(port: str) -> str:
    """Name of the part that owns a port: `cyl` for `cyl.A`."""
    return port.partition(".")[0]


def link_path(
    start: np.ndarray, end: np.ndarray, fractions: np.ndarray, aside: float
) -> np.ndarray:
    """Points of a link in plan at `fractions` of its length : float64[k, 2].

    The link is a parabola with the sideways bend `aside` times BEND_SIZE.
    """
    along = end - start
    normal = np.array([-along[1], along[0]])
    straight = start + fractions[:, None] * along
    return straight + (4.0 * BEND_SIZE * aside) * (fractions * (1.0 - fractions))[:, None] * normal


def link_bends(links: dict) -> dict[str, float]:
    """Sideways bend of each link in units of BEND_SIZE, so that links between the same two nodes do not overlap."""
    between: dict[tuple, list[str]] = {}
    for name, link in links.items():
        between.setdefault(tuple(sorted(_ends(link))), []).append(name)
    result = {}
    for ends, names in between.items():
        for i, name in enumerate(names):
            step = i - 0.5 * (len(names) - 1)
            result[name] = step if _ends(links[name])[0] == ends[0] else -step
    return result


def _ends(link) -> tuple[str, str]:
    ports = list(link.ports.values())
    return ports[0], ports[-1]


def _plan(count: int, edges: list[tuple[int, int, float]]) -> np.ndarray:
    if count == 1:
        return np.zeros((1, 2))
    if count > MAX_DENSE_NODES:
        return _radial_plan(count, edges)
    distance = _distances(count, edges)
    plan = _oriented(_minimise_stress(_classical_scaling(distance), distance))
    return np.round(plan, 6 - int(np.ceil(np.log10(distance.max()))))


def _distances(count: int, edges: list[tuple[int, int, float]]) -> np.ndarray:
    """Lengths of the shortest paths between all nodes : float64[count, count] (Floyd 1962).

    Between nodes that no path joins, the result is twice the greatest of these lengths. edges : (node, node, length) of
    each link
    """
    distance = np.full((count, count), np.inf)
    np.fill_diagonal(distance, 0.0)
    for i, j, length in edges:
        distance[i, j] = distance[j, i] = min(distance[i, j], length)
    for k in range(count):
        np.minimum(distance, distance[:, k, None] + distance[None, k], out=distance)
    apart = np.isinf(distance)
    distance[apart] = 2.0 * distance[~apart].max() if apart.any() else 0.0
    return distance


def _classical_scaling(distance: np.ndarray) -> np.ndarray:
    """Plan positions by classical scaling, a least-squares fit to the given distances (Torgerson 1952)."""
    count = len(distance)
    centre = np.eye(count) - 1.0 / count
    values, vectors = np.linalg.eigh(-0.5 * centre @ distance**2 @ centre)
    plan = np.zeros((count, 2))
    for column in range(min(2, count)):
        vector = vectors[:, -1 - column]
        largest = np.argmax(np.abs(vector) > 0.999 * np.abs(vector).max())
        plan[:, column] = vector * np.sign(vector[largest]) * np.sqrt(max(values[-1 - column], 0.0))
    # In two dimensions branches of equal length may coincide; a small fixed displacement separates them.
    angle = 2.399963 * np.arange(count)
    farthest = np.unravel_index(np.argmax(distance), distance.shape)
    off = distance[farthest[0]] + distance[farthest[1]] - distance[farthest]
    has_branches = float(off.max() > 1e-9 * distance.max())  # a chain of nodes stays straight
    return (
        plan
        + 1e-3 * distance.max() * np.column_stack([np.cos(angle), np.sin(angle)]) * has_branches
    )


def _minimise_stress(plan: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Plan positions x with less stress, sum((|x_i - x_j| - d_ij)^2 / d_ij^2), d_ij the given distance of two nodes.

    They follow from `plan` by Guttman transforms with weights 1 / d_ij^2.
    """
    weight = np.where(distance > 0.0, 1.0 / np.where(distance > 0.0, distance, 1.0) ** 2, 0.0)
    laplacian = np.diag(weight.sum(1)) - weight
    inverse = np.linalg.pinv(laplacian)
    for _ in range(MAJORIZATION_ROUNDS):
        gap = np.linalg.norm(plan[:, None] - plan[None], axis=2)
        ratio = -weight * distance / np.where(gap > 1e-12, gap, np.inf)
        np.fill_diagonal(ratio, 0.0)
        np.fill_diagonal(ratio, -ratio.sum(1))
        plan = inverse @ (ratio @ plan)
    return plan


def _oriented(plan: np.ndarray) -> np.ndarray:
    """Plan rotated, mirrored and shifted: longer side along x, least x and y at the origin.

    The first node is to the left of the centre of all nodes, and below it.
    """
    plan = plan - plan.mean(0)
    _, _, axes = np.linalg.svd(plan, full_matrices=False)
    plan = plan @ axes.T
    plan *= np.where(plan[0] > 0.0, -1.0, 1.0)
    return plan - plan.min(0)


def _radial_plan(count: int, edges: list[tuple[int, int, float]]) -> np.ndarray:
    """Plan of a large network: radius is the path length from the first node; each branch has its own sector."""
    reach, parent, order = _shortest_path_tree(count, edges)
    leaves = np.zeros(count)
    for i in reversed(order):
        leaves[i] = max(leaves[i], 1)
        if parent[i] >= 0:
            leaves[parent[i]] += leaves[i]
    used = np.zeros(count)
    middle = np.zeros(count)
    begun = 0.0
    for i in order:
        used[i] = used[parent[i]] if parent[i] >= 0 else begun
        middle[i] = used[i] + 0.5 * leaves[i]
        if parent[i] >= 0:
            used[parent[i]] += leaves[i]
        else:
            begun += leaves[i]
    angle = 2.0 * np.pi * middle / begun
    plan = reach[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.round(plan - plan.min(0), 3)


def _shortest_path_tree(
    count: int, edges: list[tuple[int, int, float]]
) -> tuple[np.ndarray, list[int], list[int]]:
    """Shortest paths from the first node (Dijkstra 1959): path lengths, parents (-1 for none), nodes by length.

    Parts of the network that are not connected to it have a first node each.
    """
    near: list[list[tuple[int, float]]] = [[] for _ in range(count)]
    for i, j, length in edges:
        near[i].append((j, length))
        near[j].append((i, length))
    reach = np.full(count, np.inf)
    parent = [-1] * count
    order = []
    for root in range(count):
        heap = [(0.0, root, -1)] if np.isinf(reach[root]) else []
        while heap:
            so_far, i, before = heapq.heappop(heap)
            if so_far >= reach[i]:
                continue
            reach[i], parent[i] = so_far, before
            order.append(i)
            for j, length in near[i]:
                heapq.heappush(heap, (so_far + length, j, i))
    return reach, parent, order
