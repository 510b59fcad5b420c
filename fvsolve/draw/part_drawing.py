"""Symbols, connections and names of parts in a picture; names are placed without overlap."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from fvsolve.draw import style
from fvsolve.draw.projection import Projection
from fvsolve.draw.scene import DrawnScene
from fvsolve.draw.sheet import draw_symbol, symbol_of
from fvsolve.errors import visible

SYMBOL_SPACING = 4.8  # least distance of symbols, in half widths of a symbol
SMALL_SYMBOL_COUNT = 40  # number of parts above which symbols are small
MAX_NAMED_PIPES = 14  # greatest number of pipes with names
MAX_PARTS_WITH_JOINTS = 400  # greatest number of parts with symbols and names for plain junctions
HALO_WIDTH = 2.2  # width of the white border of a name [points]
EDGE_MARGIN = 5.0  # free margin of the sheet [pixels]
# Directions of a name from its point, best first.
LABEL_PLACES = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)]
RANK_COST = 0.5  # cost of each lower rank of a direction, in covered points of lines
POINT_SPACING, PADDING = 4.0, 3.0  # distance of points along lines, and free space around names [pixels]


def draw_parts(stage, scene: DrawnScene, segments: np.ndarray) -> tuple[int, int]:
    """Draw symbols and names of the parts of a scene; return the number of names drawn and the number of all names.

    stage : picture with `sheet`, `axes`, `aspect` (projection), `half` (half width of a symbol [points]), and
            texts : texts that names may not cover; cover : float64[k, 2]  points that names should not cover
            labels : list of (name, point), other names to draw
    segments : float64[c, 2, 2]  pipes in picture coordinates
    """
    if not (scene.parts or scene.pipes or stage.labels):
        return 0, 0
    axes, half, aspect = stage.axes, stage.half, stage.aspect
    point = stage.sheet.figure.dpi / 72.0  # [pixels]
    at = symbol_positions(scene, aspect, axes, SYMBOL_SPACING * half * point)
    blocks, ties = [], []
    for part in [part for part in scene.parts if not (part.joint and len(scene.parts) > MAX_PARTS_WITH_JOINTS)]:
        ends = [at[name] for name in part.between if name in at]
        ties += [(at[part.key], end) for end in ends]
        along = ends[-1] - ends[0] if len(ends) > 1 else np.array([1.0, 0.0])
        place = axes.transData.inverted().transform(at[part.key])
        size = half * (0.5 if part.joint and len(scene.parts) > SMALL_SYMBOL_COUNT else 1.0)
        draw_symbol(axes, symbol_of(part.kinds, part.link), place, along, size)
        reach = (0.4 if part.joint else 1.0) * size * point
        blocks.append([*(at[part.key] - reach), *(at[part.key] + reach)])
    back = axes.transData.inverted().transform
    for a, b in ties:
        axes.plot(*back(np.array([a, b])).T, color=style.INK, linewidth=1.1, zorder=5)
    return _write_names(stage, scene, segments, at, np.array(blocks).reshape(-1, 4), np.reshape(ties, (-1, 2, 2)))


def symbol_positions(scene: DrawnScene, aspect: Projection, axes, apart: float) -> dict[str, np.ndarray]:
    """Positions of symbols [pixels] : key of a part, or of a linked patch -> float64[2].

    A node whose position is not fixed is moved if a link to it is shorter than `apart` [pixels]. The symbol of a link
    is at the middle of its ends, or above its only end, unless it has its own place.
    aspect : projection of the picture
    """
    nodes = [part for part in scene.parts if not part.link]
    seen = axes.transData.transform(aspect.on_sheet(scene.shown([item.at for item in scene.parts])))
    at = {part.key: place for part, place in zip(scene.parts, seen, strict=True)}
    at |= dict(zip(scene.anchors, axes.transData.transform(aspect.on_sheet(
        scene.shown(list(scene.anchors.values())))), strict=True))  # fmt: skip
    held = {part.key for part in nodes if part.held} | set(scene.anchors)
    middle = seen.mean(axis=0) if len(seen) else np.zeros(2)
    for part in scene.parts:
        ends = [name for name in part.between if name in at]
        if len(ends) == 2 and ends[0] != ends[1]:
            first, last = ends if ends[1] not in held else ends[::-1]
            way = at[last] - at[first]
            if np.linalg.norm(way) < apart and last not in held:
                far = way if np.linalg.norm(way) > 1.0 else at[first] - middle
                far = far if np.linalg.norm(far) > 1.0 else np.array([1.0, 0.0])
                if aspect.kind == "profile":  # its height is not changed
                    at[last] = np.array([at[first][0] + np.copysign(apart, far[0]), at[last][1]])
                else:
                    at[last] = at[first] + apart * far / np.linalg.norm(far)
                held.add(last)
        if ends and not part.own_place:
            at[part.key] = np.mean([at[name] for name in ends], axis=0)
            if len(ends) == 1:
                at[part.key] = at[part.key] + (0.0, 0.7 * apart)
    return at


@dataclass
class DrawnName:
    """Name to draw next to a point `at` [pixels], at a distance `gap` [points]; look : properties of its text."""

    text: str
    at: np.ndarray
    gap: float
    look: dict[str, Any]


def _write_names(stage, scene: DrawnScene, segments, at, blocks, ties) -> tuple[int, int]:
    """Write the names that have free space; return the number of names written and the number of all names.

    at : positions of symbols [pixels], as from `symbol_positions`; blocks : float64[b, 4]  boxes of symbols [pixels]
    ties : float64[c, 2, 2]  lines from parts to their ends [pixels]; stage, segments : as for `draw_parts`
    """
    from matplotlib.patheffects import withStroke

    axes, figure = stage.axes, stage.sheet.figure
    pixels = axes.transData.transform(segments.reshape(-1, 2)).reshape(-1, 2, 2)
    labels, renderer = _names_to_draw(scene, at, pixels, stage.half), figure.canvas.get_renderer()
    look = {"color": style.INK, "fontsize": 8}
    labels += [DrawnName(name, axes.transData.transform(place), 6.0, look) for name, place in stage.labels]
    halo = [withStroke(linewidth=HALO_WIDTH, foreground="white")]
    always = {"zorder": 7, "parse_math": False, "va": "bottom", "path_effects": halo}
    texts = [axes.text(0.0, 0.0, visible(item.text), **always, **item.look) for item in labels]
    sizes = [text.get_window_extent(renderer).size for text in texts]
    ticks = [text.get_window_extent(renderer).extents for text in stage.texts]
    point = figure.dpi / 72.0
    at, gaps = [item.at for item in labels], [point * item.gap for item in labels]
    lines = np.vstack([points_along(np.concatenate([pixels, ties])), axes.transData.transform(stage.cover)])
    left, right = EDGE_MARGIN + axes.bbox.x0 * axes.axison, figure.bbox.x1 - EDGE_MARGIN
    within = left, axes.bbox.y0 - EDGE_MARGIN, right, axes.bbox.y1 + EDGE_MARGIN
    places = place_labels(at, sizes, gaps, np.vstack([blocks, np.reshape(ticks, (-1, 4))]), lines, within)
    for text, corner in zip(texts, places, strict=True):
        if corner is None:
            text.remove()
        else:
            text.set_position(axes.transData.inverted().transform(corner))
    without = sum(item.joint for item in scene.parts) if len(scene.parts) > MAX_PARTS_WITH_JOINTS else 0
    return sum(item is not None for item in places), len(labels) + without


def _names_to_draw(scene: DrawnScene, at, pixels, half: float) -> list[DrawnName]:
    """Names to draw, in order of priority: parts, pipes if they are few, and plain junctions if parts are few.

    at : positions of symbols [pixels]; pixels : float64[c, 2, 2]  pipes [pixels]
    half : half width of a symbol [points]
    """
    plain, small = {"color": style.INK, "fontsize": 8}, {"color": style.INK, "fontsize": 7.5}
    parts = [DrawnName(item.name, at[item.key], half + 3.0, plain) for item in scene.parts if not item.joint]
    joints = [DrawnName(item.name, at[item.key], 5.0, small) for item in scene.parts if item.joint]
    joints = joints if len(scene.parts) <= MAX_PARTS_WITH_JOINTS else []
    if len(scene.names) > MAX_NAMED_PIPES or not scene.pipes or not scene.names:
        return parts + joints
    look = {"color": style.MUTED, "fontsize": 7.5, "fontstyle": "italic"}
    middles = {name: pixels[scene.pipes[0][3] == k].reshape(-1, 2) for k, name in enumerate(scene.names)}
    pipes = [DrawnName(name, item[len(item) // 2], 4.0, look) for name, item in middles.items() if len(item)]
    return parts + pipes + joints


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
