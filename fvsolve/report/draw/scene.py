"""Scene of a field picture: frames, parts, names, units, and its projection onto the picture plane with axes."""

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fvsolve.report.draw import style


@dataclass
class DrawnPart:
    """Part of a network and its position.

    key : "nodes.NAME" or "links.NAME"
    kinds : kind of the part and the kinds from which it is derived, nearest first
    at : position [m]; between : keys of the parts that a link connects
    link : True for a link, False for a node
    joint : True for a plain junction; held : True if pipes or a stated position fix its position
    own_place : True for a link that is not drawn at the middle of its ends
    """

    key: str
    name: str
    kinds: tuple[str, ...]
    at: tuple[float, float, float]
    between: tuple[str, ...] = ()
    link: bool = False
    joint: bool = False
    held: bool = False
    own_place: bool = False


@dataclass
class DrawnUnit:
    """Quantity and its output unit: shown value = factor * SI value + shift."""

    name: str
    unit: str
    factor: float = 1.0
    shift: float = 0.0

    @property
    def label(self) -> str:
        return f"{self.name.replace('_', ' ')} [{self.unit}]"


@dataclass
class DrawnScene:
    """Frames of a field with the parts, names and units of the picture.

    quantity, length, height : units of the field, of lengths and of heights
    frames : (caption, files) of each time
    pipes : for networks, (points float64[p, 3] [m], lines int[c, 2], values float64[c] in SI, pipe int[c]) of each time
    plan : source of plan positions: "given", "laid out" (by lengths), "own scale" or "schematic" (both not to scale)
    contours : number of contour lines; over_run : True if the field is one of greatest values over the run, which are
    drawn on the greatest depth
    """

    title: str
    quantity: DrawnUnit
    length: DrawnUnit
    height: DrawnUnit
    frames: list[tuple[str, list[Path]]]
    pipes: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=list)
    names: list[str] = field(default_factory=list)  # names of pipes
    bodies: list[str] = field(default_factory=list)  # names of bodies by index
    parts: list[DrawnPart] = field(default_factory=list)
    # positions of linked patches [m]
    anchors: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    # faces of walls at their crests: float64[n, 2, 3] [m]
    walls: list[np.ndarray] = field(default_factory=list)
    plan: str = "given"
    contours: int = 0
    over_run: bool = False

    def shown(self, points) -> np.ndarray:
        """Convert points float64[n, 3] [m] to the output units of lengths and heights."""
        plan = self.length.factor
        return np.asarray(points, float).reshape(-1, 3) * (plan, plan, self.height.factor)

    @property
    def height_ratio(self) -> float:
        """Factor on heights in their output unit that gives equal scales of heights and lengths."""
        return self.length.factor / self.height.factor


# direction from the scene to the observer for basins; x to the right, y away
WATER_VIEW = (0.6, -1.0, 0.75)
NETWORK_VIEW = (0.35, -1.0, 1.1)  # direction to the observer for networks
LARGE_NETWORK_VIEW = (0.2, -1.0, 2.0)  # direction to the observer for large networks
HEIGHT_SHARE = 0.4  # drawn height of a network as a fraction of its width
# width over length up to which a network counts as straight and is drawn in profile
STRAIGHT_TOLERANCE = 1e-6
TICK_SPACING = 40.0  # least distance of ticks [points]
# Distances from an edge: end of ticks, tick labels, axis name [points].
TICK_LENGTH, LABEL_OFFSET, TITLE_OFFSET = 5.0, 9.0, 42.0
PLAUSIBLE_SCALE = (0.3, 1.02)  # range of drawn length / length of pipes for a plan that is to scale


class Projection:
    """Parallel projection of points float64[n, 3] onto the picture plane float64[n, 2].

    kind : "plan", "profile" (elevation view) or "aslant" (oblique view); rise : factor on heights
    along : horizontal axis of a profile; seen : direction to the observer of an oblique view
    right, up, back : float64[3]  axes of the picture, and its normal, which points to the observer
    begin : horizontal position of the origin of a profile
    """

    def __init__(self, kind: str, rise: float = 1.0, along=(1.0, 0.0), seen=NETWORK_VIEW) -> None:
        self.kind, self.rise, self.begin = kind, rise, 0.0
        if kind == "plan":
            self.right, self.up = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
        elif kind == "profile":
            self.right, self.up = np.array([*along, 0.0]), np.array([0.0, 0.0, 1.0])
        else:
            self.right = np.cross((0.0, 0.0, 1.0), seen)
            self.right /= np.linalg.norm(self.right)
            self.up = np.cross(np.array(seen) / np.linalg.norm(seen), self.right)
        self.back = np.cross(self.right, self.up)

    def on_sheet(self, points) -> np.ndarray:
        """Picture coordinates of points : float64[n, 2]."""
        scaled = np.asarray(points, float).reshape(-1, 3) * (1.0, 1.0, self.rise)
        return np.column_stack([scaled @ self.right - self.begin, scaled @ self.up])


def choose_projection(points: np.ndarray, large: bool = False, slant: float = 1.0) -> Projection:
    """Projection of a network: "profile" if it is straight in plan, "plan" if it is level, otherwise "aslant".

    points : float64[n, 3]  points of the network; large : True for many parts, which are drawn from a steeper angle
    slant : factor from units of height to units of length
    """
    spans = np.ptp(points, axis=0)
    plan = points[:, :2] - points[0, :2]
    _, widths, axes = np.linalg.svd(plan, full_matrices=False)
    if len(widths) < 2 or widths[1] <= STRAIGHT_TOLERANCE * widths[0]:
        along = axes[0] * (
            1.0 if axes[0] @ (plan[-1] if plan[-1].any() else plan.sum(axis=0)) >= 0.0 else -1.0
        )
        return Projection("profile", along=np.where(np.abs(along) < STRAIGHT_TOLERANCE, 0.0, along))
    if spans[2] <= 1e-9 * max(spans):
        return Projection("plan")
    rise = slant * round_scale(HEIGHT_SHARE * max(spans[:2]) / (slant * spans[2]))
    return Projection("aslant", rise, seen=LARGE_NETWORK_VIEW if large else NETWORK_VIEW)


def round_scale(value: float) -> float:
    """Greatest number 1, 2 or 5 times a power of ten that does not exceed `value`."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (5.0, 2.0, 1.0) if step * power <= value * (1.0 + 1e-9))


def box_corners(low, high) -> np.ndarray:
    """Corners of a box : float64[8, 3]; low, high : float64[3]  least and greatest coordinates."""
    return np.array(
        [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )


def fit_limits(axes, seen: np.ndarray, margins: tuple[float, float, float, float]) -> None:
    """Set the limits of axes so that points fit with equal scales along both axes.

    seen : float64[n, 2]  points in picture coordinates; margins : left, low, right and high margin [points]
    """
    point = axes.figure.dpi / 72.0
    left, low, right, high = (point * margin for margin in margins)
    least, most = seen.min(axis=0), seen.max(axis=0)
    wide, tall = axes.bbox.width - left - right, axes.bbox.height - low - high
    scale = max((most[0] - least[0]) / wide, (most[1] - least[1]) / tall) or 1.0  # length per pixel
    spare = 0.5 * (np.array([wide, tall]) - (most - least) / scale)
    start = least - scale * (spare + (left, low))
    axes.set_xlim(start[0], start[0] + scale * axes.bbox.width)
    axes.set_ylim(start[1], start[1] + scale * axes.bbox.height)


def draw_box(axes, aspect: Projection, low, high, names: tuple[str, str, str]) -> list:
    """Draw the axes of a box in oblique view with ticks and names, and the outline of its floor; return the texts.

    low, high : float64[3]  corners of the box; an edge of length 0 has no ticks; names : names of the three axes
    """
    from matplotlib.ticker import MaxNLocator

    (x0, y0, z0), (x1, y1, z1) = low, high
    floor = aspect.on_sheet([(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0), (x0, y0, z0)])
    axes.plot(*floor.T, color=style.HAIR, linewidth=0.8, zorder=0)
    sides = [
        ((x0, y0, z0), (x1, y0, z0)),
        ((x1, y0, z0), (x1, y1, z0)),
        ((x0, y0, z0), (x0, y0, z1)),
    ]
    middle, texts = floor[:4].mean(axis=0), []
    for axis, (start, end) in enumerate(sides):
        a, b = start[axis], end[axis]
        if b - a <= 0.0:
            continue
        ends = aspect.on_sheet([start, end])
        axes.plot(*ends.T, color=style.MUTED, linewidth=0.8, zorder=0)
        along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        out = np.array([along[1], -along[0]])
        out *= 1.0 if out @ (ends.mean(axis=0) - middle) > 0.0 else -1.0
        pixels = np.linalg.norm(np.diff(axes.transData.transform(ends), axis=0))
        spacing = TICK_SPACING if axis < 2 else 0.6 * TICK_SPACING
        count = max(1, min(6, int(pixels / (axes.figure.dpi / 72.0 * spacing))))
        ticks = MaxNLocator(count, steps=[1, 2, 2.5, 5, 10]).tick_values(a, b)
        beyond = 1e-9 * (b - a)
        for tick in [tick for tick in ticks if a - beyond <= tick <= b + beyond]:
            at = ends[0] + (tick - a) / (b - a) * (ends[1] - ends[0])
            texts.append(_write(axes, at, out, f"{tick:.6g}", LABEL_OFFSET, style.INK, 7.5))
            axes.annotate(
                "",
                at,
                xytext=tuple(TICK_LENGTH * out),
                textcoords="offset points",
                annotation_clip=False,
                arrowprops={
                    "arrowstyle": "-",
                    "color": style.MUTED,
                    "linewidth": 0.8,
                    "shrinkA": 0,
                    "shrinkB": 0,
                },
            )
        gap = TITLE_OFFSET if axis == 2 else 0.72 * TITLE_OFFSET
        texts.append(_write(axes, ends.mean(axis=0), out, names[axis], gap, style.INK, 8.5))
    return texts


def _write(axes, at, out, text: str, gap: float, colour: str, size: float):
    across = "center" if abs(out[0]) < 0.2 else "left" if out[0] > 0.0 else "right"
    upright = "center" if abs(out[1]) < 0.35 else "bottom" if out[1] > 0.0 else "top"
    return axes.annotate(
        text,
        at,
        xytext=tuple(gap * out),
        textcoords="offset points",
        fontsize=size,
        color=colour,
        ha=across,
        va=upright,
        annotation_clip=False,
        zorder=8,
    )
