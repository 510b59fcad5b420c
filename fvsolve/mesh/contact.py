"""Search for boundary faces of a mesh that touch other than at their common ends."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fvsolve.mesh.shapes import cross

CONTACT_DISTANCE = 1e-6  # of a face's length: distance of a contact
BLOCK = 1 << 14  # number of segments per pass; the search ends after a pass with contacts


def contacts(a: np.ndarray, b: np.ndarray, thin: np.ndarray) -> tuple[dict[str, np.ndarray], bool]:
    """(pairs of segments that touch other than at common ends, by kind; True if all segments were searched).

    a, b : float64[k, 2]  ends of the segments; thin : bool[k]  True for segments that may coincide with another
    The pairs are {"same": int64[m, 2], "middle": int64[m, 2], "cross": int64[m, 2]}. same : both ends coincide, and
    neither segment is thin; middle : an end of the second segment lies within the first; cross : the segments intersect
    The search stops after a block of BLOCK segments in which it has found pairs.
    """
    middle, length = 0.5 * (a + b), np.hypot(*(b - a).T)
    tree = cKDTree(middle)
    for first in range(0, len(a), BLOCK):
        pairs = _touching(a, b, *_pairs(tree, middle, length, np.arange(first, min(first + BLOCK, len(a)))))
        pairs["same"] = pairs["same"][~thin[pairs["same"]].any(axis=1)]
        if any(map(len, pairs.values())):
            break
    return pairs, first + BLOCK >= len(a)


def _pairs(tree: cKDTree, middle: np.ndarray, length: np.ndarray, block: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers i, j of pairs of segments that may touch: two arrays.

    Segment i is in `block` and not shorter than j, and the distance between their middles is below the length of i.
    tree, middle, length : of all segments
    """
    near = tree.query_ball_point(middle[block], (1.0 + CONTACT_DISTANCE) * length[block], return_sorted=False)
    i = np.repeat(block, np.fromiter(map(len, near), np.int64, len(near)))
    j = np.concatenate(near).astype(np.int64)
    valid = (length[j] < length[i]) | ((length[j] == length[i]) & (i < j))
    return i[valid], j[valid]


def _touching(a: np.ndarray, b: np.ndarray, i: np.ndarray, j: np.ndarray) -> dict[str, np.ndarray]:
    near = CONTACT_DISTANCE * np.hypot(*(b[i] - a[i]).T)
    same = (_distance(a[i], b[j]) <= near) & (_distance(b[i], a[j]) <= near)
    same |= (_distance(a[i], a[j]) <= near) & (_distance(b[i], b[j]) <= near)
    within_i, within_j = (
        _within(a, b, i, a[j]) | _within(a, b, i, b[j]),
        _within(a, b, j, a[i]) | _within(a, b, j, b[i]),
    )
    through = _on_both_sides(a, b, i, j) & _on_both_sides(a, b, j, i)
    return {
        "same": np.stack([i[same], j[same]], axis=1),
        "middle": np.concatenate(
            [np.stack([i[within_i], j[within_i]], axis=1), np.stack([j[within_j], i[within_j]], axis=1)]
        ),
        "cross": np.stack([i[through], j[through]], axis=1),
    }


def _distance(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    return np.hypot(*(p - q).T)


def _within(a: np.ndarray, b: np.ndarray, i: np.ndarray, p: np.ndarray) -> np.ndarray:
    """True where the point p lies on segment i, away from its ends. a, b : ends of all segments"""
    along, to = b[i] - a[i], p - a[i]
    square = np.sum(along * along, axis=1)
    share = np.sum(along * to, axis=1) / square
    return (
        (CONTACT_DISTANCE < share)
        & (share < 1.0 - CONTACT_DISTANCE)
        & (np.abs(cross(along, to)) <= CONTACT_DISTANCE * square)
    )


def _on_both_sides(a: np.ndarray, b: np.ndarray, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """True where the ends of segment j lie on different sides of the line through segment i.

    a, b : ends of all segments
    """
    along = b[i] - a[i]
    least = CONTACT_DISTANCE * np.sum(along * along, axis=1)
    start, stop = cross(along, a[j] - a[i]), cross(along, b[j] - a[i])
    return ((start > least) & (stop < -least)) | ((start < -least) & (stop > least))
