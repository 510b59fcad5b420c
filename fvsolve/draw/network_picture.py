"""Picture of a network: pipes in the colours of a field, symbols and names of parts, axes."""

import numpy as np

from fvsolve.draw import style
from fvsolve.draw.part_drawing import MAX_PARTS_WITH_JOINTS, SMALL_SYMBOL_COUNT, draw_parts
from fvsolve.draw.projection import box_corners, choose_projection, draw_box, fit_limits
from fvsolve.draw.scene import DrawnScene
from fvsolve.draw.sheet import COLOUR_MAP, HALF_SYMBOL, SIZE, PictureSheet, colour_range

PIPE_WIDTH, EDGE_WIDTH = 3.6, 4.8  # widths of a pipe and of its edge [points]
LEVEL_HEIGHT = 3.2  # height of a picture of a network along a level line [inch]
SIDE_MARGIN, TOP_MARGIN = 0.11, 0.12  # margins of a profile at its sides and above it, as fractions of its size
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
        self.aspect = choose_projection(self.all, len(scene.parts) > SMALL_SYMBOL_COUNT, scene.height_ratio)
        if self.aspect.kind == "profile" and scene.plan == "laid out":  # the first pipe begins at 0
            self.aspect.begin = float(self.aspect.on_sheet(points if len(points) else self.all)[:, 0].min())
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
        thin = 1.0 if count <= SMALL_SYMBOL_COUNT else 0.6 if count <= MAX_PARTS_WITH_JOINTS else 0.3
        round_ends = {"capstyle": "round"}
        edge = LineCollection(segments, colors=style.INK, linewidths=thin * EDGE_WIDTH, zorder=2, **round_ends)
        inner = LineCollection(segments, cmap=COLOUR_MAP, linewidths=thin * PIPE_WIDTH, zorder=3, **round_ends)
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
            notes.append("heights have a separate scale" if own else f"heights enlarged {times:g} times")
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
        axes, seen, high = self.axes, self.aspect.on_sheet(self.all), self.scene.height.unit
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
            along = "x" if tuple(self.aspect.right) == (1.0, 0.0, 0.0) and self.scene.plan != "laid out" else "distance"
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

        floor, points, lines = self.all[:, 2].min(), self.scene.shown(self.scene.pipes[0][0]), self.scene.pipes[0][1]
        below = points * (1.0, 1.0, 0.0) + (0.0, 0.0, floor)
        shade = self.aspect.on_sheet(below)[lines]
        self.axes.add_collection(LineCollection(shade, colors=style.HAIR, linewidths=2.0, zorder=0.5))
        foot = self.nodes * (1.0, 1.0, 0.0) + (0.0, 0.0, floor)
        posts = np.stack([self.aspect.on_sheet(self.nodes), self.aspect.on_sheet(foot)], axis=1)
        self.axes.add_collection(LineCollection(posts, colors=style.MUTED, linewidths=0.5, zorder=0.6))
