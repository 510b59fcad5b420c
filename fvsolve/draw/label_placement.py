"""Placement of names next to points of a picture without overlap."""

from __future__ import annotations

import numpy as np

# Directions of a name from its point, best first.
LABEL_PLACES = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)]
RANK_COST = 0.5  # cost of each lower rank of a direction, in covered points of lines
POINT_SPACING, PADDING = 4.0, 3.0  # distance of points along lines, and free space around names [pixels]


def place_labels(at, sizes, gaps, blocks, lines, within) -> list[tuple[float, float] | None]:
    """Lower left corner of each name [pixels], None for a name without free space; names are placed in order.

    at, sizes : float64[n, 2]  points of the names, and widths and heights of the names [pixels]
    gaps : float64[n]          distances from a point to its name [pixels]
    blocks : float64[b, 4]     boxes (left, low, right, high) that names may not cover
    lines : float64[l, 2]      points that names should not cover; each covered point has a cost
    within : box (left, low, right, high) that contains all names
    """
    taken = [np.asarray(block, float) for block in blocks]
    places: list[tuple[float, float] | None] = []
    for (x, y), (wide, high), gap in zip(at, sizes, gaps, strict=True):
        best, least = None, np.inf
        for rank, (dx, dy) in enumerate(LABEL_PLACES):
            reach = gap if 0 in (dx, dy) else 0.75 * gap
            left = x + dx * reach - (0.5 - 0.5 * dx) * wide
            low = y + dy * reach - (0.5 - 0.5 * dy) * high
            box = np.array([left, low, left + wide, low + high])
            wider = box + (-PADDING, 0.0, PADDING, 0.0)
            if _is_outside(box, within) or any(_overlap(wider, other) for other in taken):
                continue
            cost = RANK_COST * rank + (_covered_points(box, lines) if len(lines) else 0)
            if cost < least:
                best, least = box, cost
        places.append(None if best is None else (float(best[0]), float(best[1])))
        if best is not None:
            taken.append(best)
    return places


def _overlap(a, b) -> bool:
    return bool(a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3])


def _is_outside(box, within) -> bool:
    return bool(box[0] < within[0] or box[1] < within[1] or box[2] > within[2] or box[3] > within[3])


def _covered_points(box, points) -> int:
    x, y = points[:, 0], points[:, 1]
    return int(
        ((x > box[0] - PADDING) & (x < box[2] + PADDING) & (y > box[1] - PADDING) & (y < box[3] + PADDING)).sum()
    )


def points_along(segments: np.ndarray) -> np.ndarray:
    """Points along line segments at distances of about POINT_SPACING : float64[k, 2]. segments : float64[c, 2, 2]"""
    if not len(segments):
        return np.zeros((0, 2))
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    parts = [
        np.linspace(a, b, max(2, int(length / POINT_SPACING))) for (a, b), length in zip(segments, lengths, strict=True)
    ]
    return np.concatenate(parts)
