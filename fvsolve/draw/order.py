"""Errors over sizes, both logarithmic, with fitted slopes. Knows numbers and matplotlib; knows no study."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from fvsolve.draw import style

MARKERS = {"": "o", "pre-asymptotic": "^", "floor": "v", "reference": "X", "off the line": "D"}


@style.as_it_stands
def order_figure(sizes: Sequence[float], curves: Mapping, measure: str, title: str = ""):
    """One pair of axes a variable: curves = {variable: {norm: (errors, fit)}}; a fit has `order`, `constant`, `marks`.

    Full markers are fitted; open ones are marked rows. The line is the fitted slope, its order in the legend.
    """
    names = [name for name in curves if any(np.any(np.asarray(e) > 0.0) for e, _ in curves[name].values())]
    columns = min(2, max(1, len(names)))
    rows = max(1, math.ceil(len(names) / columns))
    figure = style.figure(0.5 + 3.1 * rows, width=4.8 * columns)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for one in axes[len(names) :]:
        one.set_visible(False)
    for one, name in zip(axes, names, strict=False):
        panel(one, np.asarray(sizes, float), curves[name], name)
        one.set_xticks(sizes, [f"{size:.3g}" for size in sizes])
        one.set_xticks([], minor=True)
        one.set_xlabel(measure, fontsize=8.5, color=style.INK)
    style.title(figure, wrapped(title, 62 * columns))
    return figure


def wrapped(text: str, width: int) -> str:
    """Text in lines of a width."""
    import textwrap

    return "\n".join(textwrap.wrap(text, width))


def panel(axes, sizes, norms: Mapping, name: str) -> None:
    """One variable."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    for colour, (norm, (errors, fit)) in zip(style.COLOURS, norms.items(), strict=False):
        errors = np.asarray(errors, float)
        shown = errors > 0.0
        told = f"{norm}: order {fit.order:.2f} ± {fit.spread:.2f}" if not fit.reason else f"{norm}: no order"
        axes.plot(sizes[shown], errors[shown], color=colour, linewidth=0.8, alpha=0.5)
        axes.plot([], [], color=colour, marker="o", markersize=4, linewidth=1.4, label=told)
        for mark, marker in MARKERS.items():
            here = shown & np.array([one == mark for one in fit.marks])
            face = colour if mark == "" else "white"
            axes.plot(sizes[here], errors[here], marker, color=colour, markerfacecolor=face, markersize=4.5)
        fitted = sizes[[mark == "" for mark in fit.marks]]
        if not fit.reason:
            span = np.array([fitted.max() * 1.15, fitted.min() / 1.15])
            axes.plot(span, fit.constant * span**fit.order, color=colour, linewidth=1.6)
    dress(axes, name, sorted({mark for _, fit in norms.values() for mark in fit.marks if mark in MARKERS and mark}))


def dress(axes, name: str, marks: list[str]) -> None:
    """Axes, legend and what open markers mean."""
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
