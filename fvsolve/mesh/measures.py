"""How good a mesh is, in four numbers. Knows no scheme, and no opinion on what is good enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fvsolve.mesh.mesh import Mesh
from fvsolve.mesh.shapes import corners


@dataclass(frozen=True)
class Quality:
    """smallest, largest : areas of cells [m2]; angle : the least one in a corner [rad], in cell `sharpest`;
    ratio : the greatest of the areas of two neighbours, at face `steepest` (1 and -1 where no cell has one)."""

    smallest: float
    largest: float
    angle: float
    sharpest: int
    ratio: float
    steepest: int


def quality(mesh: Mesh) -> Quality:
    """The measures of a mesh."""
    turn, straight, _ = corners(mesh.points, mesh.cells)
    angle = np.arctan2(turn, -straight).min(axis=1)
    sharpest = int(np.argmin(angle))
    one, other = mesh.area[mesh.left[: mesh.inner]], mesh.area[mesh.right[: mesh.inner]]
    ratio = np.maximum(one, other) / np.minimum(one, other)
    steepest = int(np.argmax(ratio)) if ratio.size else -1
    return Quality(
        smallest=float(mesh.area.min()),
        largest=float(mesh.area.max()),
        angle=float(angle[sharpest]),
        sharpest=sharpest,
        ratio=float(ratio[steepest]) if ratio.size else 1.0,
        steepest=steepest,
    )
