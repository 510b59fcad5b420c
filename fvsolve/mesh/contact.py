"""Faces of a boundary that touch elsewhere than at their ends. Knows line segments; knows no cells and no words."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fvsolve.mesh.shapes import cross

NEAR = 1e-6  # of a face's length: how near is a touch


def contacts(a: np.ndarray, b: np.ndarray) -> dict[str, np.ndarray]:
    """What pairs of the segments from float64[k, 2] a to b do: int64[m, 2] each.

    same : both ends coincide; middle : an end of the second lies within the first; cross : they pass through each other
    """
    i, j = _pairs(a, b)
    near = NEAR * np.hypot(*(b[i] - a[i]).T)
    same = (_apart(a[i], b[j]) <= near) & (_apart(b[i], a[j]) <= near)
    same |= (_apart(a[i], a[j]) <= near) & (_apart(b[i], b[j]) <= near)
    one, other = _within(a, b, i, a[j]) | _within(a, b, i, b[j]), _within(a, b, j, a[i]) | _within(a, b, j, b[i])
    middle = np.concatenate([np.stack([i[one], j[one]], 1), np.stack([j[other], i[other]], 1)])
    through = _astride(a, b, i, j) & _astride(a, b, j, i) & ~one & ~other
    return {
        "same": np.stack([i[same], j[same]], axis=1),
        "middle": middle,
        "cross": np.stack([i[through], j[through]], axis=1),
    }


def _pairs(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (i, j) of all that could touch, the longer one first: their middles are nearer than it is long."""
    middle, length = 0.5 * (a + b), np.hypot(*(b - a).T)
    near = cKDTree(middle).query_ball_point(middle, (1.0 + NEAR) * length)
    count = np.fromiter(map(len, near), np.int64, len(near))
    i = np.repeat(np.arange(len(a)), count)
    j = np.concatenate(near).astype(np.int64)
    keep = (length[j] < length[i]) | ((length[j] == length[i]) & (i < j))
    return i[keep], j[keep]


def _apart(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    return np.hypot(*(p - q).T)


def _within(a: np.ndarray, b: np.ndarray, i: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Whether p lies on segment i, away from its ends."""
    along, to = b[i] - a[i], p - a[i]
    square = np.sum(along * along, axis=1)
    share = np.sum(along * to, axis=1) / square
    return (NEAR < share) & (share < 1.0 - NEAR) & (np.abs(cross(along, to)) <= NEAR * square)


def _astride(a: np.ndarray, b: np.ndarray, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """Whether the ends of segment j lie on different sides of the line through i."""
    along = b[i] - a[i]
    least = NEAR * np.sum(along * along, axis=1)
    one, other = cross(along, a[j] - a[i]), cross(along, b[j] - a[i])
    return ((one > least) & (other < -least)) | ((one < -least) & (other > least))
