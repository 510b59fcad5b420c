"""Style of pictures: colours, figures, axes, legends and titles."""

import functools
from collections.abc import Callable

from fvsolve.errors import visible

INK, MUTED, HAIR = "#1f2933", "#6b7785", "#d9dee4"
DOUBT = "#c2410c"  # marks: results are not to be trusted from there on
# Distinguishable for colour-blind readers (after Wong 2011, Nature Methods 8:441).
COLOURS = ("#0b6aa8", "#d1622b", "#12876f", "#8a4fa3", "#b8860b", "#4aa3d8", "#a3324a", "#5a6b2f")
WIDTH = 9.0  # of a picture [inch]
DPI = 150
MAX_TITLE_LENGTH = 200  # greatest number of letters of a title


def figure(height: float, width: float = WIDTH):
    """Empty figure with an Agg canvas, sizes in inch; pyplot and its windows are never imported."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    fig = Figure(figsize=(width, height), dpi=DPI, facecolor="white", layout="constrained")
    FigureCanvasAgg(fig)
    return fig


def without_markup(make: Callable) -> Callable:
    """Decorator of functions that make a figure, for texts without markup.

    In all texts `$` is an ordinary letter, except in the ticks of logarithmic axes.
    """

    @functools.wraps(make)
    def draw(*arguments, **keywords):
        from matplotlib.text import Text
        from matplotlib.ticker import LogFormatter

        figure = make(*arguments, **keywords)
        powers = [
            axis
            for axes in figure.axes
            for axis in (axes.xaxis, axes.yaxis)
            if isinstance(axis.get_major_formatter(), LogFormatter)
        ]
        markup = {text for axis in powers for text in axis.findobj(Text) if text is not axis.label}
        for text in set(figure.findobj(Text)) - markup:
            text.set_parse_math(False)  # `text.set` would list all properties of its class
            text.set_usetex(False)
        return figure

    return draw


def style_axes(axes) -> None:
    """Style axes: lines at the left and bottom only, and a light grid behind the curves."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(MUTED)
        axes.spines[side].set_linewidth(0.6)
    axes.grid(True, color=HAIR, linewidth=0.5)
    axes.set_axisbelow(True)
    axes.tick_params(colors=MUTED, labelcolor=INK, labelsize=8, width=0.6, length=3)
    axes.margins(x=0)
    axes.ticklabel_format(axis="y", scilimits=(-4, 5))
    axes.yaxis.get_offset_text().set(fontsize=8, color=MUTED)


def name_axes(axes, x: str = "", y: str = "") -> None:
    """Write the names of the axes, except empty names."""
    for write, name in ((axes.set_xlabel, x), (axes.set_ylabel, y)):
        if name:
            write(name, fontsize=8.5, color=INK)


def shorten_dates(axes) -> None:
    """Label an axis of dates at even times, each label without what the label before it states."""
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

    locator = AutoDateLocator()
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))
    axes.xaxis.get_offset_text().set(fontsize=8, color=MUTED)


def label_decades(axes) -> None:
    """Label logarithmic axes only at powers of ten, unless an axis spans less than a decade."""
    from matplotlib.ticker import NullFormatter

    axes.tick_params(which="minor", labelcolor=INK, labelsize=7)
    for axis in (axes.xaxis, axes.yaxis):
        low, high = sorted(axis.get_view_interval())
        if axis.get_scale() == "log" and high >= 10.0 * low:
            axis.set_minor_formatter(NullFormatter())


def legend(axes) -> None:
    """Draw the legend to the right of the axes, where it does not cover any curve. Without labels nothing is drawn."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            loc="upper left",
            bbox_to_anchor=(1.005, 1.02),
            frameon=False,
            fontsize=8,
            labelcolor=INK,
            handlelength=1.4,
            borderaxespad=0.0,
        )


def cut_title(text: str) -> str:
    """Text of a title; a text longer than `MAX_TITLE_LENGTH` is cut."""
    return text if len(text) <= MAX_TITLE_LENGTH else text[: MAX_TITLE_LENGTH - 3] + "..."


def title(fig, text: str) -> None:
    """Set the title of a figure, see `cut_title`."""
    if text:
        fig.suptitle(visible(cut_title(text)), fontsize=10.5, color=INK, x=0.012, ha="left")
