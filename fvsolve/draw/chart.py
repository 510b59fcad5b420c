"""Work-precision pictures: error against what it costs. Knows numbers, words and matplotlib; knows no run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fvsolve.draw import style

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h", "*", "d")
DEEP = 30.0  # a floor further below the least error than this factor is said, not drawn
FAILED = 0.965  # where failed points stand, in heights of the panel


@dataclass(frozen=True)
class Curve:
    """Points of one scheme and method from coarse to fine.

    errors, costs : one float64[n] per row and per column of panels; failed : bool[n]
    """

    colour: str  # what the colour stands for: the scheme, or the method where there is none
    marker: str  # what the marker stands for: the method
    errors: Sequence[np.ndarray]
    costs: Sequence[np.ndarray]
    failed: np.ndarray
    bold: bool = False  # the program's default


@style.as_it_stands
def chart_figure(curves: Sequence[Curve], rows: Sequence[str], columns: Sequence[str], floors, title: str = ""):
    """A panel per kind of error and of cost; shaded below the floor; what failed stands on the upper margin.

    rows, columns : what the errors and the costs are called; floors : of every row
    """
    figure = style.figure(0.9 + 3.1 * len(rows), width=9.5)
    grid = figure.subplots(len(rows), len(columns), sharex="col", sharey="row", squeeze=False)
    colours = _told_apart([one.colour for one in curves], style.COLOURS)
    markers = _told_apart([one.marker for one in curves], MARKERS)
    for axes in grid.flat:
        style.dress(axes)
    for axes in grid.flat:
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.margins(x=0.04)
    failed = any(one.failed.any() for one in curves)
    for i, panels in enumerate(grid):
        for j, axes in enumerate(panels):
            for one in sorted(curves, key=lambda one: one.bold):
                _curve(axes, one, one.errors[i], one.costs[j], colours[one.colour], markers[one.marker])
            _front(axes, curves, i, j, floors[i])
        _limits(panels, [one.errors[i][~one.failed] for one in curves], floors[i], failed)
        panels[0].set_ylabel(rows[i], fontsize=8.5, color=style.INK)
        if failed:
            panels[0].text(0.99, FAILED, "failed", transform=panels[0].transAxes, fontsize=7.5, ha="right", va="center",
                           color=style.DOUBT, in_layout=False)  # fmt: skip
    for axes, name in zip(grid[-1], columns, strict=True):
        axes.set_xlabel(name, fontsize=8.5, color=style.INK)
    for axes in grid.flat:
        style.label_decades(axes)
    _legend(figure, colours, markers, curves)
    style.title(figure, title)
    return figure


def save(figure, path, dpi: float | None = None) -> None:
    """Write a picture; text in an SVG stays text, and the same picture gives the same file."""
    from matplotlib import rc_context

    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "fvsolve"}):
        kind = {"metadata": {"Date": None}} if str(path).endswith(".svg") else {}
        figure.savefig(path, **kind, **({} if dpi is None else {"dpi": dpi}))


def _told_apart(words, signs) -> dict:
    return {word: signs[k % len(signs)] for k, word in enumerate(dict.fromkeys(words))}


def _curve(axes, one: Curve, errors, costs, colour: str, marker: str) -> None:
    good = ~one.failed & np.isfinite(errors) & (errors > 0)
    axes.plot(
        costs[good], errors[good], color=colour, marker=marker, markersize=5.5 if one.bold else 4.2,
        linewidth=2.2 if one.bold else 0.9, markeredgecolor=style.INK if one.bold else "white", markeredgewidth=0.5,
        zorder=3 if one.bold else 2,
    )  # fmt: skip
    lost = one.failed & np.isfinite(costs) & (costs > 0)
    if lost.any():
        axes.plot(
            costs[lost], np.full(lost.sum(), FAILED), color=colour, marker=marker, markersize=4.5, linestyle="none",
            markerfacecolor="none", transform=axes.get_xaxis_transform(), clip_on=False, in_layout=False,
        )  # fmt: skip


def _front(axes, curves, i: int, j: int, floor: float) -> None:
    """Steps below the cheapest points, down to the floor."""
    errors = np.concatenate([np.where(one.failed, np.inf, one.errors[i]) for one in curves])
    costs = np.concatenate([one.costs[j] for one in curves])
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
    drawn = floor > seen.min() / DEEP
    low = min(seen.min(), floor) / 2.0 if drawn else seen.min() / 2.0
    room = 2.0 * (seen.max() / low) ** 0.1 if failed else 2.0  # a strip for what failed
    for axes in panels:
        axes.set_ylim(low, seen.max() * room)
        if drawn:
            axes.axhspan(low, floor, color=style.HAIR, alpha=0.7, zorder=0, linewidth=0)
    said = "the references disagree here" if drawn else f"references agree to {floor:.0e}, below"
    panels[0].text(0.015, 0.015, said, transform=panels[0].transAxes, fontsize=7, color=style.MUTED, va="bottom",
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
    if any(one.bold for one in curves):
        handles.append(Line2D([], [], color=style.INK, linewidth=2.4, label="bold: the default"))
    handles.append(Line2D([], [], color=style.MUTED, linewidth=4.0, alpha=0.4, label="front"))
    figure.legend(handles=handles, loc="outside right center", frameon=False, fontsize=8, labelcolor=style.INK)
