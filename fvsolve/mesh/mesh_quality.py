"""Quality measures of a mesh: areas, angles, ratios of neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fvsolve.mesh.mesh import Mesh
from fvsolve.mesh.shapes import corners


@dataclass(frozen=True)
class Quality:
    """Quality measures of a mesh.

    smallest, largest : least and greatest area of a cell [m2]
    angle : least angle at a corner [rad]; sharpest : cell with this angle
    ratio : greatest ratio of the areas of two neighbours [-]; steepest : face between them
    A mesh without inner faces has ratio 1 and steepest -1.
    """

    smallest: float
    largest: float
    angle: float
    sharpest: int
    ratio: float
    steepest: int


def quality(mesh: Mesh) -> Quality:
    """Compute the quality measures of a mesh."""
    turn, straight, _ = corners(mesh.points, mesh.cells)
    angle = np.arctan2(turn, -straight).min(axis=1)
    sharpest = int(np.argmin(angle))
    left, right = mesh.area[mesh.left[: mesh.inner]], mesh.area[mesh.right[: mesh.inner]]
    ratio = np.maximum(left, right) / np.minimum(left, right)
    steepest = int(np.argmax(ratio)) if ratio.size else -1
    return Quality(
        smallest=float(mesh.area.min()),
        largest=float(mesh.area.max()),
        angle=float(angle[sharpest]),
        sharpest=sharpest,
        ratio=float(ratio[steepest]) if ratio.size else 1.0,
        steepest=steepest,
    )
