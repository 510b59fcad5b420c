"""Lines and points on a map of a basin: walls, patches, structures, sections, gauges, conduits, shafts and pipes."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from fvsolve.core.output.network_layout import link_bends, link_path, place
from fvsolve.core.output.node_places import NodePlaces, end_place, node_places

BEND_POINTS = 9  # points of a bent link


class MapShape(NamedTuple):
    """Line or point on a map.

    kind : "wall", "patch", "section", "structure", "conduit", "pipe", "node" or "gauge"; name : of the part
    points : float64[n, 2] [m], one point or the corners of a line, rows of NaN between separate lines
    text : further words for the reader, such as the type of the part; assumed : True if its place is not stated
    """

    kind: str
    name: str
    points: np.ndarray
    text: str = ""
    assumed: bool = False


def shapes_of(case: Any, basin: str) -> list[MapShape]:
    """Shapes on the map of a basin, in the order in which they are drawn, in its own coordinates [m]."""
    places, shift = node_places(case, basin), _shift(case, basin)
    found = [
        *_patches(case, basin),
        *_sections(case, basin),
        *_links(case, places),
        *_walls(case, basin),
        *_structures(case, basin, places),
        *_nodes(case, places),
        *_gauges(case, basin),
    ]
    return [shape._replace(points=shape.points - shift) for shape in found]


def _shift(case: Any, basin: str) -> np.ndarray:
    return np.array(case.nodes[basin].position or (0.0, 0.0))


def chains(lines: np.ndarray) -> np.ndarray:
    """Ends of separate lines as a chain of points with a row of NaN after each line : float64[3 n, 2].

    lines : float64[n, 2, 2]
    """
    gaps = np.full((len(lines), 1, 2), np.nan)
    return np.concatenate([lines, gaps], axis=1).reshape(-1, 2)


def _patches(case: Any, basin: str) -> Iterator[MapShape]:
    mesh, part = case.meshes[basin], case.nodes[basin]
    for name in part.patches:
        faces = mesh.faces(name).index
        lines = mesh.points[mesh.ends[faces]] + _shift(case, basin)
        text = "interior patch" if name in mesh.interior else "patch"
        yield MapShape("patch", f"{basin}.{name}", chains(lines), text)


def _walls(case: Any, basin: str) -> Iterator[MapShape]:
    mesh = case.meshes[basin]
    for name, wall in (getattr(case.nodes[basin], "walls", None) or {}).items():
        lines = mesh.points[mesh.ends[wall.chain(mesh).faces]] + _shift(case, basin)
        yield MapShape("wall", f"{basin}.{name}", chains(lines), "wall")


def _sections(case: Any, basin: str) -> Iterator[MapShape]:
    for name, section in case.output.sections.items():
        if section.basin == basin:
            points = np.array(section.points, float) + _shift(case, basin)
            yield MapShape("section", name, points, "section")


def _gauges(case: Any, basin: str) -> Iterator[MapShape]:
    for name, gauge in case.output.gauges.items():
        if gauge.basin == basin:
            yield MapShape(
                "gauge", name, np.array([gauge.at], float) + _shift(case, basin), "gauge"
            )


def _links(case: Any, places: NodePlaces) -> Iterator[MapShape]:
    """Conduits, pipes and other links with a length between nodes with places."""
    bends = link_bends(case.links)
    for name, link in case.links.items():
        if not is_line(case, link):
            continue
        points = link_points(case, places, name, bends[name])
        if points is not None:
            ends = [place(port) for port in link.ports.values()]
            kind = "conduit" if link.kind == "conduit" else "pipe"
            assumed = any(end in places.assumed for end in ends)
            yield MapShape(kind, name, points, link.kind.replace("-", " "), assumed)


def is_line(case: Any, link: Any) -> bool:
    """True if a link is drawn as a line between nodes: it has a length, and does not join two patches of basins."""
    ports = [place(port) for port in link.ports.values()]
    in_basins = all(port in case.meshes for port in ports)
    return bool(getattr(link, "length", None)) and len(ports) == 2 and not in_basins


def link_points(case: Any, places: NodePlaces, name: str, bend: float) -> np.ndarray | None:
    """Points of a pipe or conduit in plan : float64[n, 2] [m]; None if an end has no place.

    bend : as from `link_bends`
    """
    link = case.links[name]
    profile = getattr(link, "profile", None)
    if profile is not None and profile.plan is not None:
        return np.asarray(profile.plan_at(profile.distance), float)
    ends = [end_place(case, places, port) for port in link.ports.values()]
    if any(end is None for end in ends):
        return None
    fractions = np.linspace(0.0, 1.0, BEND_POINTS if bend else 2)
    return link_path(ends[0], ends[-1], fractions, bend)


def _structures(case: Any, basin: str, places: NodePlaces) -> Iterator[MapShape]:
    """Links without a length, or between two patches, that end at a patch of the basin."""
    for name, link in case.links.items():
        ports = list(link.ports.values())
        if is_line(case, link) or basin not in map(place, ports):
            continue
        ends = [spot for port in ports if (spot := end_place(case, places, port)) is not None]
        yield MapShape("structure", name, np.array(ends), link.kind.replace("-", " "))


def _nodes(case: Any, places: NodePlaces) -> Iterator[MapShape]:
    """Nodes with places, but junctions only where links other than pipes and conduits end."""
    for name, spot in places.at.items():
        node = case.nodes[name]
        yield MapShape(
            "node", name, spot[None], node.kind.replace("-", " "), name in places.assumed
        )
