"""Pictures of long sections (heads along a route) and of phase planes (a probe over another)."""

from __future__ import annotations

import numpy as np

from fvsolve.draw import style
from fvsolve.draw.plot import thin_series

LINE_LOOKS = {"vapour line": {"color": style.COLOURS[3], "linewidth": 1.2, "linestyle": ":"},
         "class line": {"color": style.COLOURS[6], "linewidth": 1.4, "linestyle": "-."}}  # fmt: skip
LIMIT_LOOKS = {"maximum": {"color": style.COLOURS[6], "linewidth": 1.1, "linestyle": (0, (9, 3))},
          "minimum": {"color": style.COLOURS[6], "linewidth": 1.1,
                      "linestyle": (0, (6, 2, 1.5, 2, 1.5, 2))}}  # fmt: skip
MAX_NAME_LENGTH = 22  # greatest number of letters of a name over a chainage


@style.without_markup
def section_figure(chainage, along, units, lines, seen, parted=(), beyond=(), posts=(), labels=(), title=""):
    """Figure of heads along a route, with pipe, vapour line, pressure class and limits; shaded where cavities formed.

    chainage : float64[n]; along : quantity of envelope.csv -> float64[n]; lines : name of a line -> float64[n]
    units : quantity -> unit; seen : `HeadWindow`, ends of the head axis and texts of the limits above and below it
    parted : spans of chainage with cavities; beyond : (chainage, head, name) of points where a limit is violated
    posts : chainages of vertical lines
    labels : (chainage, names, True for a device, False for only a junction) of each label above the axes
    """
    figure = style.figure(9.2)
    axes = figure.subplots()
    style.style_axes(axes)
    for a, b in parted:
        axes.axvspan(a, b, color=style.COLOURS[3], alpha=0.15, linewidth=0)
    high, low = along["max_head"], along["min_head"]
    axes.fill_between(chainage, low, high, color=style.COLOURS[0], alpha=0.08, linewidth=0)
    axes.plot(chainage, high, color=style.COLOURS[0], linewidth=1.4, label="maximum head")
    axes.plot(chainage, low, color=style.COLOURS[1], linewidth=1.4, label="minimum head")
    axes.plot(chainage, along["initial_head"], color=style.INK, linewidth=0.9, linestyle=(0, (5, 3)),
              label="initial head")  # fmt: skip
    axes.plot(chainage, along["elevation"], color=style.MUTED, linewidth=2.4, label="pipe")
    for name, line in lines.items():
        axes.plot(chainage, line, label=name, **(LINE_LOOKS.get(name) or LIMIT_LOOKS[name.rpartition(", ")[2]]))
    if parted:
        axes.fill_between([], [], color=style.COLOURS[3], alpha=0.3, label="vapour pressure reached")
    if beyond:
        at, heads, _ = zip(*beyond, strict=True)
        axes.plot(at, heads, "x", color=style.DOUBT, markersize=7, markeredgewidth=2.0, clip_on=False, zorder=5,
                  label="limit passed")  # fmt: skip
    axes.set_xlim(min([chainage[0], *posts]), max([chainage[-1], *posts]))
    axes.set_ylim(seen.low, seen.high)
    red = style.COLOURS[6]
    for limits, edge in ((seen.above, 1), (seen.below, 0)):
        if limits:
            axes.annotate("\n".join(limits), (0.97, edge), xycoords="axes fraction", xytext=(0, -22 if edge else 22),
                          textcoords="offset points", ha="right", va="top" if edge else "bottom", fontsize=8,
                          color=red, arrowprops={"arrowstyle": "->", "color": red, "relpos": (1, edge)})  # fmt: skip
    _places(axes, posts, labels)
    axes.set_xlabel(f"chainage [{units['distance']}]", fontsize=8.5, color=style.INK)
    axes.set_ylabel(f"head [{units['max_head']}]", fontsize=8.5, color=style.INK)
    figure.legend(loc="outside lower center", ncols=4, handlelength=3, frameon=False, fontsize=8, labelcolor=style.INK)
    style.title(figure, title)
    return figure


@style.without_markup
def phase_figure(pairs, title=""):
    """Figure with a phase plane for each pair of probes; a dot marks the start.

    pairs : list of (probe of x, probe of y), each probe as (name, unit, values : float64[k])
    """
    across = min(len(pairs), 2)
    down = -(-len(pairs) // across)
    figure = style.figure(0.6 + (4.4 if across == 1 else 3.6) * down, width=5.6 if across == 1 else style.WIDTH)
    grid = figure.subplots(down, across, squeeze=False)
    for axes, (x, y) in zip(grid.flat, pairs, strict=False):
        style.style_axes(axes)
        axes.margins(0.05)
        axes.plot(*_thin_path(x[2], y[2]), color=style.COLOURS[0], linewidth=1.0)
        axes.plot(x[2][:1], y[2][:1], "o", color=style.COLOURS[1], markersize=5)
        axes.set_xlabel(f"{x[0]} [{x[1]}]", fontsize=8.5, color=style.INK)
        axes.set_ylabel(f"{y[0]} [{y[1]}]", fontsize=8.5, color=style.INK)
    for axes in list(grid.flat)[len(pairs) :]:
        axes.set_visible(False)
    style.title(figure, title)
    return figure


def _places(axes, posts, labels) -> None:
    """Draw a vertical line at each chainage of `posts`, and the names in `labels`; see `section_figure`."""
    for x in posts:
        axes.axvline(x, color=style.HAIR, linewidth=0.8, zorder=0)
    for x, names, stands in labels:
        text = names if len(names) <= MAX_NAME_LENGTH else f"{names[: MAX_NAME_LENGTH - 1]}\u2026"
        axes.annotate(text, (x, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 4), rotation=40, fontsize=7.5,
                      textcoords="offset points", color=style.INK if stands else style.MUTED)  # fmt: skip


def _thin_path(x, y) -> tuple:
    """Reduce a long path (x, y) to the extremes of both coordinates in bins of consecutive points : (x, y)."""
    rows = np.arange(len(x), dtype=float)
    indices = np.union1d(thin_series(rows, x)[0], thin_series(rows, y)[0]).astype(int)
    return x[indices], y[indices]
