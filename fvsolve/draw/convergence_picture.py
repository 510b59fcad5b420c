"""Convergence pictures: errors over cell sizes or time steps on logarithmic axes, with fitted slopes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from fvsolve.draw import style

MARKERS = {"": "o", "pre-asymptotic": "^", "floor": "v", "reference": "X", "off the line": "D"}


@style.without_markup
def order_figure(sizes: Sequence[float], curves: Mapping, measure: str, title: str = ""):
    """Figure of errors over cell sizes or time steps, with a panel for each variable.

    curves : variable -> norm -> (errors : float64[sizes], fit); measure : label of the axis of sizes
    A fit has `order`, its uncertainty `spread`, `constant`, `reason` (a text if no order can be fitted), and `marks`, a
    text for each size. Sizes with an empty mark are fitted and have solid markers; other sizes have open markers. The
    line is the fitted slope, with its order in the legend. A variable without positive errors has no panel.
    """
    names = [name for name in curves if any(np.any(np.asarray(e) > 0.0) for e, _ in curves[name].values())]
    columns = min(2, max(1, len(names)))
    rows = max(1, math.ceil(len(names) / columns))
    figure = style.figure(0.5 + 3.1 * rows, width=4.8 * columns)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax in axes[len(names) :]:
        ax.set_visible(False)
    for ax, name in zip(axes, names, strict=False):
        panel(ax, np.asarray(sizes, float), curves[name], name)
        ax.set_xticks(sizes, [f"{size:.3g}" for size in sizes])
        ax.set_xticks([], minor=True)
        ax.set_xlabel(measure, fontsize=8.5, color=style.INK)
    style.title(figure, wrap_text(title, 62 * columns))
    return figure


def wrap_text(text: str, width: int) -> str:
    """Break a text into lines of at most `width` letters."""
    import textwrap

    return "\n".join(textwrap.wrap(text, width))


def panel(axes, sizes, norms: Mapping, name: str) -> None:
    """Draw the errors and fitted lines of the variable `name`; norms : norm -> (errors, fit), see `order_figure`."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    for colour, (norm, (errors, fit)) in zip(style.COLOURS, norms.items(), strict=False):
        errors = np.asarray(errors, float)
        shown = errors > 0.0
        label = f"{norm}: order {fit.order:.2f} ± {fit.spread:.2f}" if not fit.reason else f"{norm}: no order"
        axes.plot(sizes[shown], errors[shown], color=colour, linewidth=0.8, alpha=0.5)
        axes.plot([], [], color=colour, marker="o", markersize=4, linewidth=1.4, label=label)
        for mark, marker in MARKERS.items():
            here = shown & np.array([kind == mark for kind in fit.marks])
            face = colour if mark == "" else "white"
            axes.plot(sizes[here], errors[here], marker, color=colour, markerfacecolor=face, markersize=4.5)
        fitted = sizes[[mark == "" for mark in fit.marks]]
        if not fit.reason:
            span = np.array([fitted.max() * 1.15, fitted.min() / 1.15])
            axes.plot(span, fit.constant * span**fit.order, color=colour, linewidth=1.6)
    dress_panel(
        axes, name, sorted({mark for _, fit in norms.values() for mark in fit.marks if mark in MARKERS and mark})
    )


def dress_panel(axes, name: str, marks: list[str]) -> None:
    """Style the axes of a panel, and draw its title and its legend.

    name : variable of the panel; marks : reasons why points are left out of the fit, such as "pre-asymptotic"; the
    legend shows an open marker for each
    """
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.grid(True, which="major", color=style.HAIR, linewidth=0.5)
    axes.set_axisbelow(True)
    axes.tick_params(which="both", colors=style.MUTED, labelcolor=style.INK, labelsize=8, width=0.6)
    axes.margins(x=0.06)
    axes.set_title(f"error of {name}", fontsize=9, color=style.INK, loc="left")
    for mark in marks:
        axes.plot([], [], MARKERS[mark], color=style.MUTED, markerfacecolor="white", markersize=4.5, label=mark)
    axes.legend(frameon=False, fontsize=7.5, labelcolor=style.INK, loc="best")
