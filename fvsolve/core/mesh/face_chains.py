"""Chains of faces along a line: walls and sections of a mesh."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fvsolve.core.mesh.mesh import Mesh, cross

BESIDE = 1e-9  # of the extent of the mesh: distance from faces of a segment that lies on them


class FaceChain(NamedTuple):
    """Faces between the cells on both sides of a line.

    faces : int64[k]  numbers of the faces
    turn : float64[k]  1 if the normal of the face points to the left of the line, else -1
    cosine, sine : float64[k]  normal of the line in the frame of the face: along its normal, at least 0, and to the
    left of its normal
    stretch : length of the line inside the mesh over the sum of lengths of faces times `cosine`
    """

    faces: np.ndarray
    turn: np.ndarray
    cosine: np.ndarray
    sine: np.ndarray
    stretch: float = 1.0


def chain_along(mesh: Mesh, points: Sequence[Sequence[float]]) -> FaceChain:
    """Faces between cells whose centres lie on different sides of a line through points [m].

    The segment between both centres crosses the line an odd number of times. So each path from cell to cell through
    faces from one side of the line to the other passes one of these faces. A centre on the line counts as left of it.
    """
    left, right = mesh.centre[mesh.left[: mesh.inner]], mesh.centre[mesh.right[: mesh.inner]]
    normal = mesh.normal[: mesh.inner]
    count = np.zeros(mesh.inner, int)
    turn = np.zeros(mesh.inner)
    across = normal.copy()
    for start, stop in zip(
        np.asarray(points[:-1], float), np.asarray(points[1:], float), strict=True
    ):
        along = stop - start
        ahead = cross(along, right - start) >= 0.0
        crosses = ((cross(along, left - start) >= 0.0) != ahead) & (
            (cross(right - left, start - left) >= 0.0) != (cross(right - left, stop - left) >= 0.0)
        )
        count += crosses
        side = np.where(ahead, 1.0, -1.0)
        turn[crosses] = side[crosses]
        across[crosses] = np.outer(side[crosses], (-along[1], along[0])) / np.hypot(*along)
    faces = np.flatnonzero(count % 2)
    cosine = np.maximum(np.sum(normal * across, axis=1), 0.0)[faces]
    sine = cross(normal, across)[faces]
    length = sum(
        length_inside(mesh, *np.array(ends, float))
        for ends in zip(points[:-1], points[1:], strict=True)
    )
    whole = float(mesh.length[faces] @ cosine)
    return FaceChain(faces, turn[faces], cosine, sine, length / whole if whole > 0.0 else 1.0)


def length_inside(mesh: Mesh, start: np.ndarray, stop: np.ndarray) -> float:
    """Length of the part of a segment that lies in cells [m]; start, stop : float64[2]  its ends [m]

    A segment along faces counts as slightly right of them.
    """
    along = stop - start
    start = start + BESIDE * np.ptp(mesh.points, axis=0).max() * np.array(
        [along[1], -along[0]]
    ) / np.hypot(*along)
    corners = mesh.points[np.where(mesh.cells < 0, mesh.cells[:, :1], mesh.cells)]
    edges = np.roll(corners, -1, axis=1) - corners
    height, rise = (
        cross(edges, start - corners),
        cross(edges, along),
    )  # inside a cell: height + t rise >= 0 at all edges
    with np.errstate(divide="ignore", invalid="ignore"):
        at = -height / rise
    low = np.where(rise > 0.0, at, 0.0).max(axis=1, initial=0.0)
    high = np.where(rise < 0.0, at, 1.0).min(axis=1, initial=1.0)
    outside = ((rise == 0.0) & (height < 0.0)).any(axis=1)
    return float(np.hypot(*along) * np.where(outside, 0.0, np.maximum(high - low, 0.0)).sum())
