"""Places of nodes in plan, as far as a case gives them: stated positions, patches of basins, ends of conduits."""

from typing import Any, NamedTuple

import numpy as np

from fvsolve.core.output.network_layout import place


class NodePlaces(NamedTuple):
    """Places of nodes in the coordinates of basins.

    at : node -> float64[2] [m]
    assumed : nodes whose place no key gives, which lie at the end of a link of known length
    """

    at: dict[str, np.ndarray]
    assumed: set[str]


def node_places(case: Any) -> NodePlaces:
    """Places of the nodes of a case that can be drawn on a map of its basins.

    A node has its stated position, or that of a patch that a link without length joins to it. Behind these, a node lies
    at the end of its link, in the direction in which the links before it lead.
    """
    at = {
        name: np.array(node.position, float)
        for name, node in case.nodes.items()
        if node.position is not None and name not in case.meshes
    }
    at |= {name: np.array(spot) for name, spot in _at_patches(case).items() if name not in at}
    assumed: set[str] = set()
    while (found := _next_end(case, at)) is not None:
        name, spot = found
        at[name] = spot
        assumed.add(name)
    return NodePlaces(at, assumed)


def patch_middle(case: Any, port: str) -> np.ndarray | None:
    """Middle of the patch of a basin : float64[2] [m]; None if a port is not a patch of a basin with cells in plan."""
    owner, _, patch = port.partition(".")
    mesh = case.meshes.get(owner)
    if mesh is None or not patch or patch not in (*mesh.patches, *mesh.interior):
        return None
    shift = np.array(case.nodes[owner].position or (0.0, 0.0))
    if patch in mesh.interior:
        return shift + mesh.centre[mesh.interior[patch]].mean(axis=0)
    return shift + mesh.middle[mesh.faces(patch).index].mean(axis=0)


def _at_patches(case: Any) -> dict[str, np.ndarray]:
    """Nodes that a link without length joins to a patch, such as a shaft below a manhole."""
    found = {}
    for link in case.links.values():
        ports = list(link.ports.values())
        if len(ports) != 2 or getattr(link, "length", None):
            continue
        for port, opposite in (ports, ports[::-1]):
            middle = patch_middle(case, port)
            if middle is not None and opposite in case.nodes and opposite not in case.meshes:
                found.setdefault(opposite, middle)
    return found


def _next_end(case: Any, at: dict[str, np.ndarray]) -> tuple[str, np.ndarray] | None:
    """Node without a place at the end of a link with a length that begins at a place, and its assumed place."""
    for link in case.links.values():
        ports = [place(port) for port in link.ports.values()]
        length = getattr(link, "length", None)
        if len(ports) != 2 or not length:
            continue
        for start, end in (ports, ports[::-1]):
            if start in at and end in case.nodes and end not in at and end not in case.meshes:
                return end, at[start] + float(length) * _direction(case, at, start)
    return None


def _direction(case: Any, at: dict[str, np.ndarray], start: str) -> np.ndarray:
    """Unit vector in which the links that end at a node lead; along x if there are none."""
    ways = [
        at[start] - at[other]
        for link in case.links.values()
        for ports in [[place(port) for port in link.ports.values()]]
        if len(ports) == 2 and start in ports
        for other in ports
        if other != start and other in at
    ]
    total = np.sum(ways, axis=0) if ways else np.zeros(2)
    length = float(np.linalg.norm(total))
    return total / length if length > 0.0 else np.array([1.0, 0.0])
