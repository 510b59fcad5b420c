"""Work-precision diagrams: error over cost of schemes and methods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fvsolve.draw import style

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h", "*", "d")
FLOOR_DISTANCE = 30.0  # an error floor below the least error divided by this factor is stated as text, not drawn
FAILED_HEIGHT = 0.965  # vertical position of failed points, as a fraction of the height of the panel


@dataclass(frozen=True)
class Curve:
    """Points of one scheme and method in a work-precision chart, from coarse to fine cells or steps.

    errors : a float64[n] for each row of panels; costs : a float64[n] for each column; failed : bool[n]
    """

    colour: str  # name that the colour stands for: the scheme, or the method of a case without schemes
    marker: str  # name that the marker stands for: the method
    errors: Sequence[np.ndarray]
    costs: Sequence[np.ndarray]
    failed: np.ndarray
    bold: bool = False  # the program's default


@style.without_markup
def chart_figure(curves: Sequence[Curve], rows: Sequence[str], columns: Sequence[str], floors, title: str = ""):
    """Figure with a panel for each kind of error (rows) and of cost (columns).

    Panels are shaded below the error floor; failed points are at the top. rows, columns : labels of the axes
    floors : error floor of each row
    """
    figure = style.figure(0.9 + 3.1 * len(rows), width=9.5)
    grid = figure.subplots(len(rows), len(columns), sharex="col", sharey="row", squeeze=False)
    colours = _assign_signs([curve.colour for curve in curves], style.COLOURS)
    markers = _assign_signs([curve.marker for curve in curves], MARKERS)
    for axes in grid.flat:
        style.style_axes(axes)
    for axes in grid.flat:
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.margins(x=0.04)
    failed = any(curve.failed.any() for curve in curves)
    for i, panels in enumerate(grid):
        for j, axes in enumerate(panels):
            for curve in sorted(curves, key=lambda curve: curve.bold):
                _curve(axes, curve, curve.errors[i], curve.costs[j], colours[curve.colour], markers[curve.marker])
            _front(axes, curves, i, j, floors[i])
        _limits(panels, [curve.errors[i][~curve.failed] for curve in curves], floors[i], failed)
        panels[0].set_ylabel(rows[i], fontsize=8.5, color=style.INK)
        if failed:
            panels[0].text(
                0.99,
                FAILED_HEIGHT,
                "failed",
                transform=panels[0].transAxes,
                fontsize=7.5,
                ha="right",
                va="center",
                color=style.DOUBT,
                in_layout=False,
            )
    for axes, name in zip(grid[-1], columns, strict=True):
        axes.set_xlabel(name, fontsize=8.5, color=style.INK)
    for axes in grid.flat:
        style.label_decades(axes)
    _legend(figure, colours, markers, curves)
    style.title(figure, title)
    return figure


def save_picture(figure, path, dpi: float | None = None) -> None:
    """Write a figure to a file; an SVG keeps its texts as text, and equal figures give equal files."""
    from matplotlib import rc_context

    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "fvsolve"}):
        kind = {"metadata": {"Date": None}} if str(path).endswith(".svg") else {}
        figure.savefig(path, **kind, **({} if dpi is None else {"dpi": dpi}))


def _assign_signs(words, signs) -> dict:
    return {word: signs[k % len(signs)] for k, word in enumerate(dict.fromkeys(words))}


def _curve(axes, curve: Curve, errors, costs, colour: str, marker: str) -> None:
    good = ~curve.failed & np.isfinite(errors) & (errors > 0)
    axes.plot(
        costs[good], errors[good], color=colour, marker=marker, markersize=5.5 if curve.bold else 4.2,
        linewidth=2.2 if curve.bold else 0.9, markeredgecolor=style.INK if curve.bold else "white", markeredgewidth=0.5,
        zorder=3 if curve.bold else 2,
    )  # fmt: skip
    lost = curve.failed & np.isfinite(costs) & (costs > 0)
    if lost.any():
        axes.plot(
            costs[lost],
            np.full(lost.sum(), FAILED_HEIGHT),
            color=colour,
            marker=marker,
            markersize=4.5,
            linestyle="none",
            markerfacecolor="none",
            transform=axes.get_xaxis_transform(),
            clip_on=False,
            in_layout=False,
        )


def _front(axes, curves, i: int, j: int, floor: float) -> None:
    """Draw the Pareto front of panel (i, j): least error up to each cost, not below the error floor."""
    errors = np.concatenate([np.where(curve.failed, np.inf, curve.errors[i]) for curve in curves])
    costs = np.concatenate([curve.costs[j] for curve in curves])
    picked = np.lexsort((errors, costs))
    picked = [k for k in picked if np.isfinite(errors[k])]
    least, x, y = np.inf, [], []
    for k in picked:
        if max(errors[k], floor) < least:
            least = max(errors[k], floor)
            x.append(costs[k])
            y.append(least)
    if x:
        axes.step(x, y, where="post", color=style.MUTED, linewidth=4.0, alpha=0.25, zorder=1)


def _limits(panels, errors, floor: float, failed: bool) -> None:
    seen = np.concatenate(errors) if errors else np.zeros(0)
    seen = seen[np.isfinite(seen) & (seen > 0)]
    if not seen.size:
        return
    drawn = floor > seen.min() / FLOOR_DISTANCE
    low = min(seen.min(), floor) / 2.0 if drawn else seen.min() / 2.0
    headroom = 2.0 * (seen.max() / low) ** 0.1 if failed else 2.0  # a strip for failed points
    for axes in panels:
        axes.set_ylim(low, seen.max() * headroom)
        if drawn:
            axes.axhspan(low, floor, color=style.HAIR, alpha=0.7, zorder=0, linewidth=0)
    note = "the references disagree here" if drawn else f"references agree to {floor:.0e}, below"
    panels[0].text(0.015, 0.015, note, transform=panels[0].transAxes, fontsize=7, color=style.MUTED, va="bottom",
                   in_layout=False)  # fmt: skip


def _legend(figure, colours: dict, markers: dict, curves) -> None:
    from matplotlib.lines import Line2D

    handles = []
    if set(colours) != set(markers):
        handles += [Line2D([], [], color=colour, linewidth=3.0, label=word) for word, colour in colours.items()]
        handles += [Line2D([], [], color=style.INK, marker=marker, markersize=4.5, linestyle="none", label=word)
                    for word, marker in markers.items()]  # fmt: skip
    else:
        handles += [Line2D([], [], color=colours[word], marker=markers[word], markersize=4.5, linewidth=1.2, label=word)
                    for word in colours]  # fmt: skip
    if any(curve.bold for curve in curves):
        handles.append(Line2D([], [], color=style.INK, linewidth=2.4, label="bold: the default"))
    handles.append(Line2D([], [], color=style.MUTED, linewidth=4.0, alpha=0.4, label="front"))
    figure.legend(handles=handles, loc="outside right center", frameon=False, fontsize=8, labelcolor=style.INK)
