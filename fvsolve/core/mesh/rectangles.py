"""Meshes of rectangles: graded grids of cells with holes, and patches on their sides."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from fvsolve.core.mesh.mesh import WALL, Edges, Grid, Mesh, assemble, edges_of
from fvsolve.errors import Fault, MeshError, did_you_mean

SIDES = {"west": 1, "east": 1, "south": 0, "north": 0}  # axis along each side
LINE_TOLERANCE = 1e-6  # of the size: greatest distance of a number from its grid line

HOLES = "the holes"  # words for messages
Side = str | tuple[str, float, float]


def rectangle(
    size: Sequence[float],
    cells: Sequence[int],
    origin: Sequence[float] = (0.0, 0.0),
    grading: Sequence[float] = (1.0, 1.0),
    patches: Mapping[str, Side] | None = None,
    holes: Sequence[Sequence[float]] = (),
    lacks: Sequence[tuple[str, Callable[[np.ndarray, np.ndarray], np.ndarray]]] = (),
) -> Mesh:
    """Mesh of a rectangle of a size [m] from its south-west corner, `origin` [m]; cells are numbered row by row.

    size, cells, origin, grading : two values, along x and y; cells : numbers of columns and rows
    grading : ratio of last to first spacing of grid lines; it changes geometrically between them
    patches : name -> a side ("west", "east", "south" or "north"), or (side, from, to) with coordinates along it [m]
    holes : rectangles (x0, y0, x1, y1) [m] on grid lines, without cells; faces must connect the remaining cells
    lacks : (words for messages, function of the grid lines along x and y : bool[ny, nx]), True for cells that are
    holes too
    Raises MeshError with all faults.
    """
    faults = _bad_numbers(size, cells, origin, grading)
    if faults:
        raise MeshError(faults, "rectangle")
    lines = [_graded(*axis) for axis in zip(origin, size, cells, grading, strict=True)]
    if any(np.diff(axis).min() <= 0.0 for axis in lines):
        text = f"{_list_text(grading)}: the smallest cells vanish; expected ratios nearer to 1"
        raise MeshError([Fault("grading", text)], "rectangle")
    solid = np.ones((cells[1], cells[0]), bool)
    for k, hole in enumerate(holes):
        faults += _cut(solid, lines, f"holes[{k}]", hole)
    gaps = " and ".join(dict.fromkeys(words for words, _ in lacks)) or HOLES
    place = "holes" if gaps == HOLES else ""
    for _, empty in lacks:
        solid &= ~empty(*lines)
    if faults or not solid.any():
        text = f"{gaps} leave no cell; expected {'smaller cells' if lacks else 'smaller holes'}"
        raise MeshError(faults or [Fault(place, text)], "rectangle")
    index = np.where(solid, np.cumsum(solid).reshape(solid.shape) - 1, -1)
    points, corners = _corners(lines, solid)
    edges = edges_of(corners, len(points))
    piece = edges.pieces(len(corners))
    pieces = np.bincount(piece)
    if pieces.size > 1:
        text = f"{gaps} leave {pieces.size} pieces that share no face, {pieces.max()} of {pieces.sum()} cells in the"
        x, y = points[corners[np.argmax(piece != np.argmax(pieces)), 0]]
        faults.append(
            Fault(place, f"{text} largest, another piece at {x:.6g},{y:.6g} m; expected one piece")
        )
    names, patch = _patches(patches or {}, lines, solid, points, edges, faults)
    if faults:
        raise MeshError(faults, "rectangle")
    grid = Grid(cells[0], cells[1], *lines, index)
    return assemble(points, corners, edges, names, patch, grid)


def _bad_numbers(
    size: Sequence, cells: Sequence, origin: Sequence, grading: Sequence
) -> list[Fault]:
    def is_pair(given: Sequence) -> bool:
        return not isinstance(given, str) and len(given) == 2

    def is_count(n: object) -> bool:
        return isinstance(n, (int, np.integer)) and not isinstance(n, bool) and n >= 1

    def is_positive(v: float) -> bool:
        return math.isfinite(v) and v > 0.0

    checks = [
        ("size", size, is_positive, "two positive lengths [m], along x and y"),
        ("cells", cells, is_count, "two whole numbers of cells, along x and y, at least 1"),
        ("origin", origin, math.isfinite, "the two coordinates [m] of the south-west corner"),
        (
            "grading",
            grading,
            is_positive,
            "two positive ratios of last to first spacing, along x and y",
        ),
    ]
    faults = [
        Fault(key, f"{_list_text(given)}; expected {expected}")
        for key, given, is_valid, expected in checks
        if not (is_pair(given) and all(is_valid(value) for value in given))
    ]
    if not faults and any(n == 1 and g != 1.0 for n, g in zip(cells, grading, strict=True)):
        text = f"{_list_text(grading)} with cells {_list_text(cells)}; expected 1 along an axis with one cell"
        faults.append(Fault("grading", text))
    return faults


def _list_text(given: Sequence) -> str:
    return (
        "["
        + ", ".join(f"{value:.9g}" if isinstance(value, float) else str(value) for value in given)
        + "]"
    )


def _graded(start: float, size: float, cells: int, grading: float) -> np.ndarray:
    """Grid lines from `start` over the length `size`, with geometrically graded spacings : float64[cells + 1] [m].

    grading : ratio of last to first spacing
    """
    share = np.arange(cells + 1) / cells
    if grading != 1.0:
        rate = math.log(grading) / (cells - 1)
        share = np.expm1(rate * np.arange(cells + 1)) / math.expm1(rate * cells)
    lines = start + size * share
    lines[-1] = start + size
    return lines


def _line(lines: np.ndarray, value: float) -> int | None:
    """Number of the grid line at the position `value` [m]; None without a line near this position."""
    k = int(np.argmin(np.abs(lines - value)))
    return k if abs(lines[k] - value) <= LINE_TOLERANCE * (lines[-1] - lines[0]) else None


def _nearest(lines: np.ndarray, value: float) -> str:
    """Text like '0.25 and 0.5' with the positions of the grid lines on both sides of `value`.

    If `value` is beyond all lines, the text contains only the position of the outermost line next to it.
    """
    k = int(np.clip(np.searchsorted(lines, value), 1, lines.size - 1))
    around = (
        [lines[0]]
        if value < lines[0]
        else [lines[-1]]
        if value > lines[-1]
        else lines[k - 1 : k + 1]
    )
    return " and ".join(f"{line:.9g}" for line in around)


def _cut(
    solid: np.ndarray, lines: Sequence[np.ndarray], place: str, hole: Sequence[float]
) -> list[Fault]:
    """Mark the cells of a hole as False in `solid` : bool[ny, nx]; return the faults of the hole.

    lines : grid lines along x, along y; place : key of the hole for faults; hole : (x0, y0, x1, y1) [m]
    """
    names = ("x0", "y0", "x1", "y1")
    if (
        len(hole) != 4
        or not all(math.isfinite(v) for v in hole)
        or not (hole[0] < hole[2] and hole[1] < hole[3])
    ):
        return [
            Fault(
                place,
                f"{_list_text(hole)}; expected [x0, y0, x1, y1] [m] with x0 below x1 and y0 below y1",
            )
        ]
    indices = [_line(lines[k % 2], value) for k, value in enumerate(hole)]
    faults = [
        Fault(
            place,
            f"{name} = {value:.9g} m is on no grid line; nearest {name[0]}: {_nearest(lines[k % 2], value)} m",
        )
        for k, (name, value) in enumerate(zip(names, hole, strict=True))
        if indices[k] is None
    ]
    if not faults and (indices[0] == indices[2] or indices[1] == indices[3]):
        text = f"{_list_text(hole)} contains no cells; expected x0 and x1, y0 and y1 on different grid lines"
        return [Fault(place, text)]
    if not faults:
        solid[indices[1] : indices[3], indices[0] : indices[2]] = False
    return faults


def _corners(lines: Sequence[np.ndarray], solid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(points of the cells of a grid, corners of each cell), row by row : float64[p, 2], int64[n, 4].

    lines : grid lines along x, along y; solid : bool[ny, nx]  False in holes
    """
    row, column = np.nonzero(solid)
    wide = lines[0].size
    first = row * wide + column
    cells = np.stack([first, first + 1, first + wide + 1, first + wide], axis=1)
    used = np.zeros(wide * lines[1].size, bool)
    used[cells] = True
    x, y = np.meshgrid(*lines)
    return np.stack([x.ravel()[used], y.ravel()[used]], axis=1), (np.cumsum(used) - 1)[cells]


def _patches(
    given: Mapping[str, Side],
    lines: Sequence[np.ndarray],
    solid: np.ndarray,
    points: np.ndarray,
    edges: Edges,
    faults: list[Fault],
) -> tuple[list[str], np.ndarray]:
    """Names of the patches, and the patch of each boundary edge : int64[outer]; faults are appended to `faults`.

    given : as `patches` of `rectangle`; lines, solid : as for `_corners`; points : result of `_corners`
    edges : edges of the cells
    """
    names = [*(name for name in given if name != WALL), WALL]
    patch = np.full(edges.outer.size, len(names))  # no patch yet
    a, b = points[edges.start[edges.outer]], points[edges.stop[edges.outer]]
    for name, side in given.items():
        where, *span = (side,) if isinstance(side, str) else side
        limits = _patch_range(f"patches.{name}", where, span, lines, solid)
        if isinstance(limits, Fault):
            faults.append(limits)
            continue
        axis, low, high = SIDES[where], *limits
        edge = lines[1 - axis][0 if where in ("west", "south") else -1]
        middle = 0.5 * (a[:, axis] + b[:, axis])
        on = (a[:, 1 - axis] == edge) & (b[:, 1 - axis] == edge) & (low < middle) & (middle < high)
        taken = on & (patch < len(names))
        if taken.any():
            other, at = names[patch[taken][0]], middle[taken]
            text = (
                f'overlaps "{other}" on the {where} side, about {at.min():.9g} to {at.max():.9g} m'
            )
            faults.append(Fault(f"patches.{name}", f"{text}; expected each face in one patch"))
        patch[on] = names.index(name)
    return names, np.minimum(patch, len(names) - 1)


def _patch_range(
    place: str, side: str, span: list, lines: Sequence[np.ndarray], solid: np.ndarray
) -> tuple | Fault:
    """(start, end) of a patch along a side, on grid lines [m], or the fault of its range.

    place : key of the patch for faults; span : [] for the whole side, else stated start and end
    lines, solid : as for `_corners`
    """
    if side not in SIDES:
        return Fault(
            place,
            f'unknown side "{side}"; expected {", ".join(SIDES)}{did_you_mean(str(side), SIDES)}',
        )
    along = lines[SIDES[side]]
    cells = {"west": solid[:, 0], "east": solid[:, -1], "south": solid[0], "north": solid[-1]}[side]
    if not cells.any():
        return Fault(
            place, f"the holes remove the whole {side} side; expected another side, or other holes"
        )
    if not span:
        return along[0], along[-1]
    if len(span) != 2 or not all(math.isfinite(value) for value in span) or not span[0] < span[1]:
        text = f"expected two coordinates along the {side} side [m], the first below the second"
        return Fault(place, f"{_list_text(span)}; {text}")
    first, last = (_line(along, value) for value in span)
    text = f"{span[0]:.9g} to {span[1]:.9g} m"
    if first is None or last is None or first == last:
        i, j = (int(np.argmin(np.abs(along - value))) for value in span)
        i = min(i, along.size - 2)
        near = f"{along[i]:.9g} to {along[max(j, i + 1)]:.9g} m"
        return Fault(
            place, f"{text} does not consist of whole faces of the {side} side; nearest is {near}"
        )
    if not cells[first:last].all():
        ends = np.flatnonzero(np.diff(cells.astype(int), prepend=0, append=0)).reshape(-1, 2)
        free = " or ".join(f"{along[i]:.9g} to {along[j]:.9g} m" for i, j in ends)
        return Fault(
            place, f"{text} on the {side} side runs along a hole; expected a span within {free}"
        )
    return along[first], along[last]
