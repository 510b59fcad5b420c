"""Picture of a network: pipes in the colours of a field, axes, and symbols and names of parts without overlap."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from fvsolve.errors import visible
from fvsolve.report.draw import style
from fvsolve.report.draw.scene import (
    DrawnScene,
    Projection,
    box_corners,
    choose_projection,
    draw_box,
    fit_limits,
)
from fvsolve.report.draw.sheet import (
    COLOUR_MAP,
    HALF_SYMBOL,
    SIZE,
    PictureSheet,
    colour_range,
    draw_symbol,
    symbol_of,
)

SYMBOL_SPACING = 4.8  # least distance of symbols, in half widths of a symbol
SMALL_SYMBOL_COUNT = 40  # number of parts above which symbols are small
MAX_NAMED_PIPES = 14  # greatest number of pipes with names
MAX_PARTS_WITH_JOINTS = 400  # greatest number of parts with symbols and names for plain junctions
HALO_WIDTH = 2.2  # width of the white border of a name [points]
EDGE_MARGIN = 5.0  # free margin of the sheet [pixels]
# Directions of a name from its point, best first.
LABEL_PLACES = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)]
RANK_COST = 0.5  # cost of each lower rank of a direction, in covered points of lines
# distance of points along lines, and free space around names [pixels]
POINT_SPACING, PADDING = 4.0, 3.0


def draw_parts(stage, scene: DrawnScene, segments: np.ndarray) -> tuple[int, int]:
    """Draw symbols and names of the parts of a scene; return the number of names drawn and the number of all names.

    stage : picture with `sheet`, `axes`, `aspect` (projection), `half` (half width of a symbol [points]), and
            texts : texts that names may not cover; cover : float64[k, 2]  points that names should not cover
            labels : list of (name, point), other names to draw
    segments : float64[c, 2, 2]  pipes in picture coordinates
    """
    if not (scene.parts or scene.pipes or stage.labels):
        return 0, 0
    axes = stage.axes
    half = stage.half
    aspect = stage.aspect
    point = stage.sheet.figure.dpi / 72.0  # [pixels]
    at = symbol_positions(scene, aspect, axes, SYMBOL_SPACING * half * point)
    blocks, ties = [], []
    for part in [
        part
        for part in scene.parts
        if not (part.joint and len(scene.parts) > MAX_PARTS_WITH_JOINTS)
    ]:
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
    return _write_names(
        stage, scene, segments, at, np.array(blocks).reshape(-1, 4), np.reshape(ties, (-1, 2, 2))
    )


def symbol_positions(
    scene: DrawnScene, aspect: Projection, axes, apart: float
) -> dict[str, np.ndarray]:
    """Positions of symbols [pixels] : key of a part, or of a linked patch -> float64[2].

    A node whose position is not fixed is moved if a link to it is shorter than `apart` [pixels]. The symbol of a link
    is at the middle of its ends, or above its only end, unless it has its own place.
    aspect : projection of the picture
    """
    nodes = [part for part in scene.parts if not part.link]
    seen = axes.transData.transform(aspect.on_sheet(scene.shown([item.at for item in scene.parts])))
    at = {part.key: place for part, place in zip(scene.parts, seen, strict=True)}
    at |= dict(
        zip(
            scene.anchors,
            axes.transData.transform(aspect.on_sheet(scene.shown(list(scene.anchors.values())))),
            strict=True,
        )
    )
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
    labels += [
        DrawnName(name, axes.transData.transform(place), 6.0, look) for name, place in stage.labels
    ]
    halo = [withStroke(linewidth=HALO_WIDTH, foreground="white")]
    always = {"zorder": 7, "parse_math": False, "va": "bottom", "path_effects": halo}
    texts = [axes.text(0.0, 0.0, visible(item.text), **always, **item.look) for item in labels]
    sizes = [text.get_window_extent(renderer).size for text in texts]
    ticks = [text.get_window_extent(renderer).extents for text in stage.texts]
    point = figure.dpi / 72.0
    at, gaps = [item.at for item in labels], [point * item.gap for item in labels]
    lines = np.vstack(
        [points_along(np.concatenate([pixels, ties])), axes.transData.transform(stage.cover)]
    )
    left, right = EDGE_MARGIN + axes.bbox.x0 * axes.axison, figure.bbox.x1 - EDGE_MARGIN
    within = left, axes.bbox.y0 - EDGE_MARGIN, right, axes.bbox.y1 + EDGE_MARGIN
    places = place_labels(
        at, sizes, gaps, np.vstack([blocks, np.reshape(ticks, (-1, 4))]), lines, within
    )
    for text, corner in zip(texts, places, strict=True):
        if corner is None:
            text.remove()
        else:
            text.set_position(axes.transData.inverted().transform(corner))
    without = (
        sum(item.joint for item in scene.parts) if len(scene.parts) > MAX_PARTS_WITH_JOINTS else 0
    )
    return sum(item is not None for item in places), len(labels) + without


def _names_to_draw(scene: DrawnScene, at, pixels, half: float) -> list[DrawnName]:
    """Names to draw, in order of priority: parts, pipes if they are few, and plain junctions if parts are few.

    at : positions of symbols [pixels]; pixels : float64[c, 2, 2]  pipes [pixels]
    half : half width of a symbol [points]
    """
    plain, small = {"color": style.INK, "fontsize": 8}, {"color": style.INK, "fontsize": 7.5}
    parts = [
        DrawnName(item.name, at[item.key], half + 3.0, plain)
        for item in scene.parts
        if not item.joint
    ]
    joints = [DrawnName(item.name, at[item.key], 5.0, small) for item in scene.parts if item.joint]
    joints = joints if len(scene.parts) <= MAX_PARTS_WITH_JOINTS else []
    if len(scene.names) > MAX_NAMED_PIPES or not scene.pipes or not scene.names:
        return parts + joints
    look = {"color": style.MUTED, "fontsize": 7.5, "fontstyle": "italic"}
    middles = {
        name: pixels[scene.pipes[0][3] == k].reshape(-1, 2) for k, name in enumerate(scene.names)
    }
    pipes = [
        DrawnName(name, item[len(item) // 2], 4.0, look)
        for name, item in middles.items()
        if len(item)
    ]
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
            if (box[:2] < within[:2]).any() or (box[2:] > within[2:]).any():
                continue  # not inside
            if any(
                (wider[:2] < other[2:]).all() and (other[:2] < wider[2:]).all() for other in taken
            ):
                continue  # covers a name or a block
            cost = RANK_COST * rank
            if len(lines):
                cost += int(
                    ((lines > box[:2] - PADDING) & (lines < box[2:] + PADDING)).all(axis=1).sum()
                )
            if cost < least:
                best, least = box, cost
        places.append(None if best is None else (float(best[0]), float(best[1])))
        if best is not None:
            taken.append(best)
    return places


def points_along(segments: np.ndarray) -> np.ndarray:
    """Points along line segments at distances of about POINT_SPACING : float64[k, 2]. segments : float64[c, 2, 2]"""
    if not len(segments):
        return np.zeros((0, 2))
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    parts = [
        np.linspace(a, b, max(2, int(length / POINT_SPACING)))
        for (a, b), length in zip(segments, lengths, strict=True)
    ]
    return np.concatenate(parts)


PIPE_WIDTH, EDGE_WIDTH = 3.6, 4.8  # widths of a pipe and of its edge [points]
LEVEL_HEIGHT = 3.2  # height of a picture of a network along a level line [inch]
# margins of a profile at its sides and above it, as fractions of its size
SIDE_MARGIN, TOP_MARGIN = 0.11, 0.12
BOX_MARGIN = 0.03  # margin between a network and its box, as a fraction of its size
PLAN_MARGINS = (46.0, 24.0, 46.0, 24.0)  # margins of a plan: left, low, right, high [points]
BOX_MARGINS = (60.0, 40.0, 46.0, 16.0)  # margins of a network with a box [points]


class NetworkPicture:
    """Picture of a network of pipes; `show` draws a frame.

    film : True for frames of an animation, which have a lower resolution
    """

    def __init__(self, scene: DrawnScene, film: bool) -> None:
        self.scene, lines = scene, scene.pipes[0][1]
        points = scene.shown(scene.pipes[0][0])
        self.nodes = scene.shown([part.at for part in scene.parts if not part.link])
        self.all = np.vstack([points, self.nodes])
        self.aspect = choose_projection(
            self.all, len(scene.parts) > SMALL_SYMBOL_COUNT, scene.height_ratio
        )
        if self.aspect.kind == "profile" and scene.plan == "laid out":  # the first pipe begins at 0
            self.aspect.begin = float(
                self.aspect.on_sheet(points if len(points) else self.all)[:, 0].min()
            )
        self.level = self.aspect.kind == "profile" and not np.ptp(self.all[:, 2]) > 0.0
        high = LEVEL_HEIGHT if self.level else SIZE[1]
        self.sheet = PictureSheet(film, ruled=self.aspect.kind != "aslant", high=high)
        self.axes = self.sheet.axes
        self.half = HALF_SYMBOL if len(scene.parts) <= SMALL_SYMBOL_COUNT else 0.7 * HALF_SYMBOL
        segments = self.aspect.on_sheet(points)[lines]
        self.lines = self._pipes(segments)
        self._axes()
        self.sheet.figure.canvas.draw()  # axis limits are final from here on
        self.named, self.name_total = draw_parts(self, scene, segments)
        if len(lines):
            values = np.concatenate([self._shown(pipes[2]) for pipes in scene.pipes])
            self.limits = colour_range(float(values.min()), float(values.max()))
            self.lines.set_clim(self.limits)
            self.sheet.bar(self.limits, scene.quantity.label)
        self.sheet.legend(scene.parts)

    def _pipes(self, segments: np.ndarray):
        """Draw pipes with dark edges; returns the line collection that shows the field.

        segments : float64[c, 2, 2]  pipes in picture coordinates
        """
        from matplotlib.collections import LineCollection

        count = len(self.scene.names)
        thin = (
            1.0 if count <= SMALL_SYMBOL_COUNT else 0.6 if count <= MAX_PARTS_WITH_JOINTS else 0.3
        )
        round_ends = {"capstyle": "round"}
        edge = LineCollection(
            segments, colors=style.INK, linewidths=thin * EDGE_WIDTH, zorder=2, **round_ends
        )
        inner = LineCollection(
            segments, cmap=COLOUR_MAP, linewidths=thin * PIPE_WIDTH, zorder=3, **round_ends
        )
        for collection in (edge, inner):
            self.axes.add_collection(collection)
        return inner

    def show(self, k: int) -> None:
        """Draw frame `k` of the scene."""
        self.lines.set_array(self._shown(self.scene.pipes[k][2]))
        notes = [self.scene.frames[k][0], *self._notes()]
        self.sheet.caption(self.scene.title, "; ".join(notes))

    def _shown(self, values: np.ndarray) -> np.ndarray:
        return values * self.scene.quantity.factor + self.scene.quantity.shift

    def _notes(self) -> list[str]:
        notes = []
        if self.aspect.kind == "aslant":
            own, times = self.scene.plan == "own scale", self.aspect.rise / self.scene.height_ratio
            notes.append(
                "heights have a separate scale" if own else f"heights enlarged {times:g} times"
            )
        if self.scene.plan == "laid out":
            notes.append("laid out by lengths")
        if self.scene.plan == "own scale":
            notes.append("the plan is not to scale")
        if self.named < self.name_total:
            notes.append(f"{self.named} of {self.name_total} names")
        return notes

    def _axes(self) -> None:
        """Set limits and draw axes with units."""
        unit = "" if self.scene.plan == "own scale" else f" [{self.scene.length.unit}]"
        axes = self.axes
        seen = self.aspect.on_sheet(self.all)
        high = self.scene.height.unit
        self.texts, self.cover, self.labels = [], np.zeros((0, 2)), []
        if self.aspect.kind == "aslant":
            axes.set_axis_off()
            box = self.all.min(axis=0), self.all.max(axis=0)
            margin = BOX_MARGIN * np.ptp(self.all, axis=0).max() * np.array([1.0, 1.0, 0.0])
            box = box[0] - margin, box[1] + margin
            corners = box_corners(*box)
            seen = self.aspect.on_sheet(np.vstack([corners[::2], corners[1:2], self.all]))
            fit_limits(axes, seen, BOX_MARGINS)
            self.texts = draw_box(axes, self.aspect, *box, (f"x{unit}", f"y{unit}", f"z [{high}]"))
            return self._height_lines()
        style.style_axes(axes)
        axes.ticklabel_format(axis="both", style="plain", useOffset=False)
        if self.aspect.kind == "plan":
            fit_limits(axes, seen, PLAN_MARGINS)
            names = f"x{unit}", f"y{unit}"
        else:
            low, most = seen.min(axis=0), seen.max(axis=0)
            space = (SIDE_MARGIN, TOP_MARGIN) * (most - low)
            axes.set_xlim(low[0] - space[0], most[0] + space[0])
            axes.set_ylim(low[1] - (space[1] or 1.0), most[1] + (space[1] or 1.0))
            along = (
                "x"
                if tuple(self.aspect.right) == (1.0, 0.0, 0.0) and self.scene.plan != "laid out"
                else "distance"
            )
            names = f"{along}{unit}", f"elevation [{high}]"
        style.name_axes(axes, names[0], "" if self.level else names[1])
        if self.scene.plan == "schematic":  # drawn distances have no meaning
            axes.set_axis_off()
        if self.level:
            axes.set_yticks([])
            axes.spines["left"].set_visible(False)

    def _height_lines(self) -> None:
        """Draw lines that show the heights: from the nodes down to the floor, and the pipes projected onto it."""
        from matplotlib.collections import LineCollection

        floor = self.all[:, 2].min()
        points = self.scene.shown(self.scene.pipes[0][0])
        lines = self.scene.pipes[0][1]
        below = points * (1.0, 1.0, 0.0) + (0.0, 0.0, floor)
        shade = self.aspect.on_sheet(below)[lines]
        self.axes.add_collection(
            LineCollection(shade, colors=style.HAIR, linewidths=2.0, zorder=0.5)
        )
        foot = self.nodes * (1.0, 1.0, 0.0) + (0.0, 0.0, floor)
        posts = np.stack([self.aspect.on_sheet(self.nodes), self.aspect.on_sheet(foot)], axis=1)
        self.axes.add_collection(
            LineCollection(posts, colors=style.MUTED, linewidths=0.5, zorder=0.6)
        )
