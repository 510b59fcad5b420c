"""Sheet of a picture: title, axes, colour bar, symbols of parts and their legend, and files of frames.

A symbol is a text of strokes in a square from -1 to 1, with the flow along x. `M x y` moves and `L x y` draws to a
point, `Z` closes a stroke, `O x y r` is a circle. Closed strokes are filled white, after `*` with ink, after `~` with
the colour of water. A kind without a symbol uses the symbol of the kind from which it is derived (an orifice is a
valve), else OTHER_NODE or OTHER_LINK: a new kind of part needs no entry here.
"""

import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.draw import style
from fvsolve.errors import visible

VALVE_BODY = "M -1 -.6 L 1 .6 L 1 -.6 L -1 .6 Z"
VALVE_STEM = "M 0 0 L 0 .7"
CAPSULE = "M -.7 -.9 L .7 -.9 L .7 .4 L .55 .75 L .3 .93 L 0 1 L -.3 .93 L -.55 .75 L -.7 .4 Z"
FILLED_BOX = "M -.8 -.8 L -.8 .8 L .8 .8 L .8 -.8 Z"
SYMBOLS = {
    "junction": "* O 0 0 .32",
    "reservoir": "M -.9 .7 L .9 .7 L 0 -.5 Z M -.6 -.75 L .6 -.75 M -.3 -1 L .3 -1",  # a free surface
    "tank": "M -.75 .9 L -.75 -.9 L .75 -.9 L .75 .9 Z ~ M -.75 .2 L -.75 -.9 L .75 -.9 L .75 .2 Z",
    "basin": "M -1 .5 L -1 -.6 L 1 -.6 L 1 .5 Z ~ M -1 .1 L -.5 .25 L 0 .1 L .5 .25 L 1 .1 L 1 -.6 L -1 -.6 Z",
    "accumulator": f"{CAPSULE} ~ M -.7 0 L -.7 -.9 L .7 -.9 L .7 0 Z",
    "chamber": "O 0 0 .8",
    "inflow": "* M -.2 -.5 L -.2 .5 L .9 0 Z M -1 0 L -.2 0",
    "air-valve": "O 0 -.2 .65 M 0 .45 L 0 1 M -.3 .7 L 0 1 L .3 .7",
    "valve": VALVE_BODY,
    "orifice": "M 0 1 L 0 .3 M 0 -1 L 0 -.3 M -.25 1 L .25 1 M -.25 -1 L .25 -1",
    "leak": "M 0 .9 L .55 -.2 L .4 -.7 L 0 -.9 L -.4 -.7 L -.55 -.2 Z",
    "check-valve": "* M -.8 -.7 L -.8 .7 L .7 0 Z M .75 -.8 L .75 .8",
    "relief-valve": f"{VALVE_BODY} M 0 0 L -.25 .25 L .25 .45 L -.25 .65 L .25 .85 L 0 1",  # its spring
    "surge-anticipating": f"{VALVE_BODY} {VALVE_STEM} * O 0 .75 .25",  # its pilot
    "rupture-disc": "M -.8 -.7 L -.8 .7 L .8 .7 L .8 -.7 Z M -.2 -.7 L .1 -.35 L .2 0 L .1 .35 L -.2 .7",
    "pressure-reducing": f"{VALVE_BODY} {VALVE_STEM} M -.5 .6 L -.3 1 L .3 1 L .5 .6 Z * M 0 0 L 1 .6 L 1 -.6 Z",
    "pressure-sustaining": f"{VALVE_BODY} {VALVE_STEM} M -.5 .6 L -.3 1 L .3 1 L .5 .6 Z * M 0 0 L -1 .6 L -1 -.6 Z",
    "flow-control": f"{VALVE_BODY} {VALVE_STEM} M -.5 .6 L -.3 1 L .3 1 L .5 .6 Z",
    "pump": "O 0 0 .9 * M -.4 .7 L -.4 -.7 L .85 0 Z",
    "turbine": "O 0 0 .9 * M .4 .7 L .4 -.7 L -.85 0 Z",
    "spool-valve": "M -1 -.4 L -1 .4 L 1 .4 L 1 -.4 Z M -.35 -.4 L -.35 .4 M .35 -.4 L .35 .4 M -.8 -.3 L -.5 .3",
    "cylinder": "M -1 -.5 L -1 .5 L .6 .5 L .6 -.5 Z * M -.25 -.5 L -.25 .5 L -.05 .5 L -.05 -.5 Z M 0 0 L 1 0",
    "rigid-column": "* M -1 -.2 L -1 .2 L 1 .2 L 1 -.2 Z",
    "bushing": "M -.8 -.4 L .8 -.4 M -.8 .4 L .8 .4 * M -.6 -.15 L -.6 .15 L .6 .15 L .6 -.15 Z",
    "pin": "O 0 0 .6 * O 0 0 .2",
    "mass": f"* {FILLED_BOX}",
    "body": "* M -.9 -.3 L -.9 .3 L .9 .3 L .9 -.3 Z",
    "frame": "M -1 .3 L 1 .3 M -.8 -.3 L -.4 .3 M -.2 -.3 L .2 .3 M .4 -.3 L .8 .3",
    "spring": "M -1 0 L -.7 0 L -.5 .5 L -.1 -.5 L .3 .5 L .7 -.5 L .8 0 L 1 0",
    "damper": "M -1 0 L -.1 0 M -.1 -.35 L -.1 .35 M .5 -.5 L -.5 -.5 M .5 .5 L -.5 .5 M .5 -.5 L .5 .5 M .5 0 L 1 0",
    "end-stop": "M -1 0 L .2 0 M .2 -.5 L .2 .5 * M .5 -.8 L .5 .8 L .8 .8 L .8 -.8 Z",
    "force": "M -1 0 L .3 0 * M .3 -.4 L .3 .4 L 1 0 Z",
    "torque": "M .5 -.6 L -.2 -.75 L -.75 -.2 L -.7 .4 L -.1 .75 L .4 .6 * M .3 .95 L .8 .3 L 0 .25 Z",
}
OTHER_NODE, OTHER_LINK = FILLED_BOX, "M -1 0 L 0 .7 L 1 0 L 0 -.7 Z"

WATER = "#8ab6d6"
SIZE = (10.0, 6.0)  # [inch]
DPI, ANIMATION_DPI = 150, 100  # resolution of a picture, and of an animation [dots per inch]
COLOUR_MAP = "viridis"
FOOT_HEIGHT = 0.95  # height below the axes for the colour bar and the legend [inch]
HEAD_HEIGHT = 0.62  # height above the axes for the title [inch]
MARGIN = 0.62  # margin of axes with ticks [inch]
HALF_SYMBOL = 8.0  # half width of a symbol [points]
EVEN_RANGE = 0.05  # half width of the colour range of a uniform field, as a fraction of its value
EVEN_TOLERANCE = 1e-9  # relative range of a uniform field
ZERO_TOLERANCE = 1e-3  # end of a range that is shown as zero, as a fraction of the range
LEGEND_ROWS = 4  # rows of the legend
FRAME_TIME = 100  # duration of a frame [ms]


def symbol_of(kinds: Sequence[str], link: bool) -> str:
    """Symbol of a part, as a text of strokes (see `strokes`).

    kinds : kind of the part and the kinds from which it is derived, nearest first; link : True for a link
    """
    return next((SYMBOLS[kind] for kind in kinds if kind in SYMBOLS), OTHER_LINK if link else OTHER_NODE)


@cache
def strokes(symbol: str) -> list[tuple[str, tuple[tuple[float, float], ...], bool]]:
    """Strokes of a symbol in the order of drawing : list of (fill, points, True if closed).

    fill : "white", "ink" or "water"
    """
    result: list[tuple[str, list, bool]] = []
    words, at, fill = symbol.split(), 0, "white"
    while at < len(words):
        word = words[at]
        if word in "*~":
            fill, at = {"*": "ink", "~": "water"}[word], at + 1
        elif word == "Z":
            result[-1] = (*result[-1][:2], True)
            fill, at = "white", at + 1
        elif word == "O":
            x, y, r = map(float, words[at + 1 : at + 4])
            angles = [k * math.pi / 16 for k in range(32)]
            result.append((fill, [(x + r * math.cos(angle), y + r * math.sin(angle)) for angle in angles], True))
            fill, at = "white", at + 4
        else:
            if word == "M":
                result.append((fill, [], False))
            result[-1][1].append((float(words[at + 1]), float(words[at + 2])))
            at += 3
    return [(fill, tuple(points), closed) for fill, points, closed in result]


class PictureSheet:
    """Figure with one pair of main axes.

    film : True for a frame of an animation, with a lower resolution; ruled : True if the axes have ticks outside
    high : height of the figure [inch]
    """

    def __init__(self, film: bool, ruled: bool = False, high: float = SIZE[1]) -> None:
        self.figure = style.figure(high, SIZE[0])
        self.figure.set_layout_engine("none")
        self.figure.set_dpi(ANIMATION_DPI if film else DPI)
        self.high = high
        low, top = FOOT_HEIGHT + (0.5 if ruled else 0.1), HEAD_HEIGHT + 0.08
        wide = MARGIN if ruled else 0.1
        self.axes = self.figure.add_axes(
            (wide / SIZE[0], low / high, 1.0 - (wide + 0.25) / SIZE[0], 1.0 - (low + top) / high)
        )
        self._captions = [
            self.figure.text(0.18 / SIZE[0], 1.0 - 0.14 / high, "", fontsize=11, color=style.INK, va="top"),
            self.figure.text(0.18 / SIZE[0], 1.0 - 0.38 / high, "", fontsize=8.5, color=style.MUTED, va="top"),
        ]
        for text in self._captions:
            text.set_parse_math(False)

    def caption(self, title: str, below: str) -> None:
        """Set the title, and the smaller line below it."""
        for text, content in zip(self._captions, (title, below), strict=True):
            text.set_text(visible(style.cut_title(content)))

    def bar(self, limits: tuple[float, float], label: str) -> list[str]:
        """Draw the colour bar with a label; return the texts of its ticks. limits : values at the ends of the bar"""
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize
        from matplotlib.ticker import MaxNLocator

        place = self.figure.add_axes((0.3 / SIZE[0], 0.42 / self.high, 0.4, 0.14 / self.high))
        bar = self.figure.colorbar(ScalarMappable(Normalize(*limits), COLOUR_MAP), cax=place, orientation="horizontal")
        bar.outline.set_visible(False)
        bar.set_ticks(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]).tick_values(*limits))
        bar.ax.set_xlim(*limits)
        bar.ax.tick_params(labelsize=8, colors=style.MUTED, labelcolor=style.INK, width=0.6, length=3)
        bar.ax.xaxis.get_offset_text().set(fontsize=8, color=style.MUTED)
        bar.ax.set_title(label, fontsize=8.5, color=style.INK, loc="left", pad=4, parse_math=False)
        self.figure.draw_without_rendering()
        low, high = limits
        shown = zip(bar.ax.get_xticks(), bar.ax.get_xticklabels(), strict=True)
        return [text.get_text() for tick, text in shown if low <= tick <= high]

    def legend(self, parts) -> None:
        """Draw the legend: symbol and name of each kind of part."""
        kinds = {part.kinds[0]: part for part in parts}
        place = self.figure.add_axes((0.5, 0.08 / self.high, 0.49, 0.8 / self.high))
        place.set_axis_off()
        place.set_xlim(0.0, 1.0)
        place.set_ylim(0.0, 1.0)
        across = max(3, -(-len(kinds) // LEGEND_ROWS))
        for k, (kind, part) in enumerate(kinds.items()):
            x, y = (k % across) / across + 0.03, 0.9 - (k // across) * 0.26
            draw_symbol(place, symbol_of(part.kinds, part.link), (x, y), half=6.0)
            place.text(x + 0.03, y, kind.replace("-", " "), fontsize=8, color=style.INK, va="center", parse_math=False)

    def picture(self) -> np.ndarray:
        """Pixels of the sheet : uint8[height, width, 3]."""
        self.figure.canvas.draw()
        return np.asarray(self.figure.canvas.buffer_rgba())[:, :, :3].copy()


def draw_symbol(axes, symbol: str, at, along=(1.0, 0.0), half: float = HALF_SYMBOL, shift=(0.0, 0.0)) -> None:
    """Draw a symbol at a point of the axes, rotated to the direction `along` and moved by `shift` [points].

    half : half width of the symbol [points]
    """
    from matplotlib.patches import Polygon
    from matplotlib.transforms import Affine2D, ScaledTranslation

    inch = half / 72.0
    turned = Affine2D().scale(inch).rotate(float(np.arctan2(along[1], along[0])))
    moved = turned.translate(shift[0] / 72.0, shift[1] / 72.0) + axes.figure.dpi_scale_trans
    transform = moved + ScaledTranslation(at[0], at[1], axes.transData)
    fills = {"white": "white", "ink": style.INK, "water": WATER}
    for fill, points, closed in strokes(symbol):
        axes.add_patch(Polygon(points, closed=closed, fill=closed, facecolor=fills[fill], edgecolor=style.INK,
                               linewidth=1.0, joinstyle="round", capstyle="round", transform=transform, zorder=6,
                               clip_on=False))  # fmt: skip


def colour_range(low: float, high: float) -> tuple[float, float]:
    """Ends of the colour range of a field with values from `low` to `high`.

    A uniform field has a range of EVEN_RANGE times its value to each side of it, and a zero field the range (0, 1). For
    other fields, an end near zero is set to zero.
    """
    most = max(abs(low), abs(high))
    if most == 0.0:
        return 0.0, 1.0
    if high - low > EVEN_TOLERANCE * most:
        return tuple(0.0 if abs(end) < ZERO_TOLERANCE * (high - low) else end for end in (low, high))
    middle, half = 0.5 * (low + high), EVEN_RANGE * most or 0.5
    return middle - half, middle + half


def write_animation(stage: Any, count: int, out: Path) -> None:
    """Write a single frame as a picture, several frames as an animation (.gif or .mp4), to the file `out`.

    stage : object whose `show(k)` draws frame k on its `sheet`; count : number of frames
    """
    from PIL import Image

    pictures = []
    for k in range(count):
        stage.show(k)
        pictures.append(stage.sheet.picture())
    if count == 1:
        Image.fromarray(pictures[0]).save(out, optimize=True)
    elif out.suffix == ".mp4":
        import imageio

        imageio.mimsave(out, pictures, fps=1000 // FRAME_TIME, macro_block_size=1)
    else:
        drawn = [Image.fromarray(picture).quantize(255) for picture in pictures]
        drawn[0].save(out, save_all=True, append_images=drawn[1:], duration=FRAME_TIME, loop=0)
