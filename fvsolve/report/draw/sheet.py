"""Sheet of a picture: title, axes, colour bar, symbols of parts and their legend, and files of frames.

`fvsolve/data/part_symbols.toml` has the symbols and explains their strokes.
"""

import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.data import read_table
from fvsolve.errors import visible
from fvsolve.file_replacement import replacing
from fvsolve.report.draw import style

SYMBOLS = read_table("part_symbols")["kinds"]
OTHER_NODE, OTHER_LINK = (read_table("part_symbols")["other"][key] for key in ("node", "link"))

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
FRAME_COLOURS = 96  # of a frame of a page


def symbol_of(kinds: Sequence[str], link: bool) -> str:
    """Symbol of a part, as a text of strokes (see `strokes`).

    kinds : kind of the part and the kinds from which it is derived, nearest first; link : True for a link
    """
    return next(
        (SYMBOLS[kind] for kind in kinds if kind in SYMBOLS), OTHER_LINK if link else OTHER_NODE
    )


@cache
def strokes(symbol: str) -> list[tuple[str, tuple[tuple[float, float], ...], bool]]:
    """Strokes of a symbol in the order of drawing : list of (fill, points, True if closed).

    fill : "white", "ink" or "water"
    """
    result: list[tuple[str, list, bool]] = []
    words = symbol.split()
    at = 0
    fill = "white"
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
            result.append(
                (
                    fill,
                    [(x + r * math.cos(angle), y + r * math.sin(angle)) for angle in angles],
                    True,
                )
            )
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
            self.figure.text(
                0.18 / SIZE[0], 1.0 - 0.14 / high, "", fontsize=11, color=style.INK, va="top"
            ),
            self.figure.text(
                0.18 / SIZE[0], 1.0 - 0.38 / high, "", fontsize=8.5, color=style.MUTED, va="top"
            ),
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
        bar = self.figure.colorbar(
            ScalarMappable(Normalize(*limits), COLOUR_MAP), cax=place, orientation="horizontal"
        )
        bar.outline.set_visible(False)
        bar.set_ticks(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]).tick_values(*limits))
        bar.ax.set_xlim(*limits)
        bar.ax.tick_params(
            labelsize=8, colors=style.MUTED, labelcolor=style.INK, width=0.6, length=3
        )
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
            place.text(
                x + 0.03,
                y,
                kind.replace("-", " "),
                fontsize=8,
                color=style.INK,
                va="center",
                parse_math=False,
            )

    def picture(self) -> np.ndarray:
        """Pixels of the sheet : uint8[height, width, 3]."""
        self.figure.canvas.draw()
        return np.asarray(self.figure.canvas.buffer_rgba())[:, :, :3].copy()


def draw_symbol(
    axes, symbol: str, at, along=(1.0, 0.0), half: float = HALF_SYMBOL, shift=(0.0, 0.0)
) -> None:
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
        axes.add_patch(
            Polygon(
                points,
                closed=closed,
                fill=closed,
                facecolor=fills[fill],
                edgecolor=style.INK,
                linewidth=1.0,
                joinstyle="round",
                capstyle="round",
                transform=transform,
                zorder=6,
                clip_on=False,
            )
        )


def colour_range(low: float, high: float) -> tuple[float, float]:
    """Ends of the colour range of a field with values from `low` to `high`.

    A uniform field has a range of EVEN_RANGE times its value to each side of it, and a zero field the range (0, 1). For
    other fields, an end near zero is set to zero.
    """
    most = max(abs(low), abs(high))
    if most == 0.0:
        return 0.0, 1.0
    if high - low > EVEN_TOLERANCE * most:
        return tuple(
            0.0 if abs(end) < ZERO_TOLERANCE * (high - low) else end for end in (low, high)
        )
    middle, half = 0.5 * (low + high), EVEN_RANGE * most or 0.5
    return middle - half, middle + half


def write_frames(stage: Any, count: int, folder: Path) -> None:
    """Write all frames as files 0000.png, 0001.png, ... of few colours into a folder, for a page with a slider.

    stage, count : as for `write_animation`
    """
    from PIL import Image

    for k in range(count):
        stage.show(k)
        picture = Image.fromarray(stage.sheet.picture()).quantize(FRAME_COLOURS)
        picture.save(folder / f"{k:04d}.png", optimize=True)


def write_animation(stage: Any, count: int, out: Path) -> None:
    """Write a single frame as a picture, several frames as an animation (.gif or .mp4), to the file `out`.

    stage : object whose `show(k)` draws frame k on its `sheet`; count : number of frames
    """
    from PIL import Image

    pictures = []
    for k in range(count):
        stage.show(k)
        pictures.append(stage.sheet.picture())
    with replacing(out) as fresh:
        if count == 1:
            Image.fromarray(pictures[0]).save(fresh, optimize=True)
        elif out.suffix == ".mp4":
            import imageio

            imageio.mimsave(fresh, pictures, fps=1000 // FRAME_TIME, macro_block_size=1)
        else:
            drawn = [Image.fromarray(picture).quantize(255) for picture in pictures]
            drawn[0].save(
                fresh, save_all=True, append_images=drawn[1:], duration=FRAME_TIME, loop=0
            )
