"""Cells of interior patches: places inside a basin, such as manholes and gullies, that links join."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from fvsolve.errors import listing
from fvsolve.parts.value import ValueFault

if TYPE_CHECKING:
    from fvsolve.core.mesh import Mesh

EDGE = 1e-9  # of the size: distance from the edge of a patch within which a centre counts as inside


def interior_patches(basin: Any, mesh: Mesh) -> dict[str, np.ndarray]:
    """Cells of the interior patches of a basin, by name. Raises ValueFault with all faults."""
    named = {name: patch for name, patch in basin.patches.items() if patch.is_interior}
    if not named:
        return {}
    from fvsolve.core.mesh.mesh import MeshPoints

    faults: list[tuple[tuple, str]] = []
    faults += [
        (("patches", name), text) for name in named for text in name_faults(basin, mesh, name)
    ]
    result, points = {}, MeshPoints(mesh)
    for name, patch in named.items():
        x, y = patch.at or np.mean(patch.polygon, axis=0)
        if patch.at:  # a square
            half = 0.5 * np.sqrt(patch.area) * (1.0 + EDGE)
            inside = (np.abs(mesh.centre - np.array(patch.at)) <= half).all(axis=1)
        else:
            inside = in_polygon(mesh.centre, np.array(patch.polygon))
        cells = np.flatnonzero(inside)
        middle = points.cell(x, y)
        if middle < 0 and (patch.at or not cells.size):
            near = ", ".join(f"{value:.6g}" for value in points.nearest(x, y))
            key = "at" if patch.at else "polygon"
            text = f"{x:g}, {y:g} m lies outside the mesh or in a hole; the nearest point inside is {near}"
            faults.append((("patches", name, key), text))
            continue
        result[name] = cells if cells.size else np.array([middle])
        if result[name].size == mesh.area.size:
            faults.append(
                (("patches", name), "contains all cells of the basin; expected cells around it")
            )
    faults += [(("patches", name), text) for name, text in overlaps(result, mesh)]
    if faults:
        raise ValueFault(faults)
    return result


def name_faults(basin: Any, mesh: Mesh, name: str) -> Iterator[str]:
    """Yield a fault text if a basin cannot have interior patches, or if its mesh has a patch of the same name."""
    if name in mesh.patches:
        yield "is also a group of lines of the mesh; expected another name"
    if not basin.physics_type.has_closures:
        yield "lies inside the basin; interior patches need a free surface; expected a patch on the boundary"
    elif basin.on is not None or any(patch.moves for patch in basin.patches.values()):
        where = "on a body" if basin.on is not None else "with a moving wall"
        yield f"lies inside a basin {where}; expected a patch on the boundary"


def in_polygon(points: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """True for the points inside a polygon, by the number of its sides to the right of a point : bool[n].

    points : float64[n, 2]; polygon : float64[corners, 2]
    """
    inside = np.zeros(len(points), bool)
    x, y = points.T
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        between = (y0 <= y) != (y1 <= y)
        inside ^= between & (x < x0 + (y - y0) * ((x1 - x0) / (y1 - y0) if y1 != y0 else 0.0))
    return inside


def overlaps(cells: dict[str, np.ndarray], mesh: Mesh) -> Iterator[tuple[str, str]]:
    """Yield (name, fault text) of each patch that has a cell of an earlier one. cells : name -> its cells"""
    owner: dict[int, str] = {}
    for name, own in cells.items():
        others = sorted({owner[i] for i in own.tolist() if i in owner})
        if others:
            x, y = mesh.centre[next(i for i in own.tolist() if i in owner)]
            yield (
                name,
                f"has a cell of {listing(others)} too, at {x:.6g}, {y:.6g} m; expected patches apart",
            )
        owner |= {i: name for i in own.tolist() if i not in owner}
