"""Places of nodes in plan, as far as a case gives them: stated positions, patches of basins, ends of links."""

from typing import Any, NamedTuple

import numpy as np

from fvsolve.core.output.network_layout import place


class NodePlaces(NamedTuple):
    """Places of nodes in the plane of a basin.

    at : node -> float64[2] [m]
    assumed : nodes whose place no key gives, which lie at the end of a link of known length
    basins : names of the basins that lie in the same plane, see `basins_in_plane`
    """

    at: dict[str, np.ndarray]
    assumed: set[str]
    basins: set[str]


def basins_in_plane(case: Any, basin: str) -> set[str]:
    """Names of the basins of which the place beside a basin is known, with this basin.

    Basins without a stated position all begin at (0, 0), and have no place beside each other.
    """
    if case.nodes[basin].position is None:
        return {basin}
    return {name for name in case.meshes if case.nodes[name].position is not None}


def node_places(case: Any, basin: str) -> NodePlaces:
    """Places of the nodes of a case that can be drawn on a map of a basin.

    A node has its stated position, or that of a patch that a link without length joins to it. Behind these, a node lies
    at the end of its link, in the direction in which the links before it lead.
    """
    found = NodePlaces({}, set(), basins_in_plane(case, basin))
    at = found.at
    for name, node in case.nodes.items():
        if node.position is not None and name not in case.meshes:
            at[name] = np.array(node.position, float)
    for name, spot in _at_patches(case, found.basins).items():
        at.setdefault(name, spot)
    while (following := _next_end(case, found)) is not None:
        name, spot = following
        at[name] = spot
        found.assumed.add(name)
    return found


def end_place(case: Any, places: NodePlaces, port: str) -> np.ndarray | None:
    """Place of the end of a link, a patch of a basin or a node : float64[2] [m]; None if it is unknown."""
    middle = patch_middle(case, port, places.basins)
    return places.at.get(place(port)) if middle is None else middle


def patch_middle(case: Any, port: str, basins: set[str]) -> np.ndarray | None:
    """Middle of the patch of a basin : float64[2] [m]; None if a port is not a patch of one of the basins."""
    owner, _, patch = port.partition(".")
    if owner not in basins or not patch:
        return None
    mesh = case.meshes[owner]
    if patch not in (*mesh.patches, *mesh.interior):
        return None
    shift = np.array(case.nodes[owner].position or (0.0, 0.0))
    if patch in mesh.interior:
        return shift + mesh.centre[mesh.interior[patch]].mean(axis=0)
    return shift + mesh.middle[mesh.faces(patch).index].mean(axis=0)


def _at_patches(case: Any, basins: set[str]) -> dict[str, np.ndarray]:
    """Nodes that a link without length joins to a patch, such as a shaft below a manhole."""
    found = {}
    for link in case.links.values():
        ports = list(link.ports.values())
        if len(ports) != 2 or getattr(link, "length", None):
            continue
        for port, opposite in (ports, ports[::-1]):
            middle = patch_middle(case, port, basins)
            if middle is not None and opposite in case.nodes and opposite not in case.meshes:
                found.setdefault(opposite, middle)
    return found


def _next_end(case: Any, places: NodePlaces) -> tuple[str, np.ndarray] | None:
    """Node without a place at the end of a link with a length that begins at a place, and its assumed place."""
    for link in case.links.values():
        ports = list(link.ports.values())
        length = getattr(link, "length", None)
        if len(ports) != 2 or not length:
            continue
        for start, end in (ports, ports[::-1]):
            if end not in case.nodes or end in case.meshes or end in places.at:
                continue
            spot = end_place(case, places, start)
            if spot is not None:
                return end, spot + float(length) * _direction(case, places, start, spot)
    return None


def _direction(case: Any, places: NodePlaces, start: str, spot: np.ndarray) -> np.ndarray:
    """Unit vector in which the links that end at a port lead; away from the middle of a basin at its patch."""
    owner = place(start)
    if owner in places.basins:
        shift = np.array(case.nodes[owner].position or (0.0, 0.0))
        total = spot - shift - case.meshes[owner].centroid
    else:
        total = np.zeros(2)
        for link in case.links.values():
            ports = list(link.ports.values())
            for port in ports if len(ports) == 2 and start in ports else ():
                other = end_place(case, places, port)
                if port != start and other is not None:
                    total += spot - other
    length = float(np.linalg.norm(total))
    return total / length if length > 0.0 else np.array([1.0, 0.0])
