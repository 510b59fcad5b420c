"""Figures of history.png (probes over time) and envelope.png (extreme heads along pipes)."""

from __future__ import annotations

import textwrap

import numpy as np

from fvsolve.draw import style
from fvsolve.draw.curve_selection import select_curves

MAX_PANELS = 6  # greatest number of panels
MAX_LINES = 8  # greatest number of curves in a panel
MAX_CONSTANTS = 4  # greatest number of constant probes with names
LEGEND_WIDTH = 26  # letters of a line of a legend
MAX_PIPES = 6  # greatest number of pipes drawn; the longest are chosen
MAX_POINTS = 4000  # greatest number of rows drawn; of longer tables the extremes of bins are drawn


@style.without_markup
def history_figure(t, values, probes, time_unit="s", marks=(), measured=None, title=""):
    """Figure of probes over time, with a panel for each quantity and unit. Constant probes are named in the legend.

    t : float64[k] in `time_unit`; values : float64[k, n]; probes : (name, unit) of each column
    marks : (time, cause) of events after which results are not to be trusted; the panels are shaded after the first
    measured : probe -> (times, values) of a measurement, which is drawn dotted
    """
    probes = list(probes)
    panels, still = select_curves(values, probes, measured or {})
    drawn = panels[:MAX_PANELS]
    figure = style.figure(0.7 + 2.1 * max(len(drawn), 1) + (0.5 if len(drawn) == 1 else 0.0))
    rows = figure.subplots(max(len(drawn), 1), 1, sharex=True, squeeze=False)[:, 0]
    for axes, panel in zip(rows, drawn, strict=False):
        _panel(axes, t, values, probes, panel.lines, measured or {}, still if axes is rows[-1] else [])
        axes.set_ylabel(f"{panel.quantity.replace('_', ' ')} [{panel.unit}]", fontsize=8.5, color=style.INK)
    for axes in rows:
        _shade(axes, t, marks, first=axes is rows[0])
    rows[-1].set_xlabel(f"time [{time_unit}]", fontsize=8.5, color=style.INK)
    figure.align_ylabels(rows)
    style.title(figure, title)
    return figure


@style.without_markup
def envelope_figure(envelope, units, title=""):
    """Figure of least and greatest head along each of the longest pipes, with elevation and initial head.

    envelope : pipe -> quantity of envelope.csv -> float64[cells] in `units`; units : quantity -> unit
    """
    longest = sorted(envelope, key=lambda pipe: -envelope[pipe]["distance"][-1])[:MAX_PIPES]
    names = [pipe for pipe in envelope if pipe in longest]
    across = 1 if len(names) < 3 else 2
    down = -(-len(names) // across)
    figure = style.figure(0.9 + (2.9 if down == 1 else 2.2 * down))
    grid = figure.subplots(down, across, squeeze=False, sharey=True)
    hilly = any(np.any(envelope[pipe]["elevation"]) for pipe in names)
    for axes, pipe in zip(grid.flat, names, strict=False):
        _profile(axes, envelope[pipe], hilly)
        axes.set_title(pipe, fontsize=9, color=style.INK, loc="left", pad=4)
    for axes in list(grid.flat)[len(names) :]:
        axes.set_visible(False)
    for axes in grid[:, 0]:
        axes.set_ylabel(f"head [{units['max_head']}]", fontsize=8.5, color=style.INK)
    figure.supxlabel(f"distance from the start of the pipe [{units['distance']}]", fontsize=8.5, color=style.INK)
    handles = {
        label: handle for axes in grid.flat for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(handles.values(), handles.keys(), loc="outside upper right", ncols=4, frameon=False, fontsize=8)
    more = len(envelope) - len(names)
    style.title(figure, title + (f"\n(the {len(names)} longest of {len(envelope)} pipes)" if more else ""))
    return figure


def probe_quantity(probe: str) -> str:
    """Quantity of a probe: `pressure` for `main.pressure@0.5`."""
    return probe.partition("@")[0].rpartition(".")[2]


def thin_series(t, values, points=MAX_POINTS):
    """Reduce a series to at most about `points` rows, without loss of its peaks : (times, values).

    It keeps the least and the greatest value of each of equal bins of rows.
    """
    bins = points // 2
    if len(t) <= points:
        return t, values
    edges = np.linspace(0, len(t), bins + 1).astype(int)
    low = np.array([a + np.argmin(values[a:b]) for a, b in zip(edges[:-1], edges[1:], strict=True)])
    high = np.array([a + np.argmax(values[a:b]) for a, b in zip(edges[:-1], edges[1:], strict=True)])
    picked = np.unique(np.concatenate([[0], low, high, [len(t) - 1]]))
    return t[picked], values[picked]


def _panel(axes, t, values, probes, lines, measured, still) -> None:
    style.style_axes(axes)
    for i, curve in enumerate(lines[:MAX_LINES]):
        name, colour = probes[curve.column][0], style.COLOURS[i % len(style.COLOURS)]
        axes.plot(
            *thin_series(t, values[:, curve.column]), color=colour, linewidth=1.0, label=_wrapped_label(curve.label)
        )
        if name in measured:
            axes.plot(*measured[name], ":", color=colour, linewidth=1.4, label=f"{curve.label}, measured")
    if len(lines) > MAX_LINES:
        axes.plot([], [], " ", label=f"... {len(lines) - MAX_LINES} more in the table")
    if still:
        named = [f"{name} {value:.6g} {unit}" for name, unit, value in still[:MAX_CONSTANTS]]
        named += [f"... {len(still) - MAX_CONSTANTS} more"] if len(still) > MAX_CONSTANTS else []
        axes.plot([], [], " ", label="\n".join(["constant:", *named]))
    low, high = axes.get_ylim()
    if high - low < 1e-9 * max(abs(low), abs(high)):  # constant curves: do not magnify round-off
        middle, half = 0.5 * (low + high), max(abs(low), abs(high)) * 1e-3
        axes.set_ylim(middle - half, middle + half)
    if len(t) > 1:
        axes.set_xlim(t[0], t[-1])
    style.legend(axes)


def _wrapped_label(label: str) -> str:
    """Label broken into lines, so that the legend stays narrow."""
    return textwrap.fill(label, LEGEND_WIDTH, break_long_words=False)


def _shade(axes, t, marks, first: bool) -> None:
    if not marks or not len(t):
        return
    begun, cause = min(marks)
    axes.axvspan(begun, t[-1], color=style.DOUBT, alpha=0.08, linewidth=0)
    axes.axvline(begun, color=style.DOUBT, linewidth=0.8)
    late = begun > 0.5 * (t[0] + t[-1])
    offset = 28 if begun < t[0] + 0.05 * (t[-1] - t[0]) else 4  # leaves space for the power of ten of the axis
    if first:
        axes.annotate(
            f"not to be trusted from here: {cause}",
            (begun, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(-4 if late else offset, 2),
            textcoords="offset points",
            ha="right" if late else "left",
            va="bottom",
            fontsize=7.5,
            color=style.DOUBT,
        )


def _profile(axes, arrays, hilly: bool) -> None:
    style.style_axes(axes)
    x, ground = arrays["distance"], arrays["elevation"]
    low, high = arrays["min_head"], arrays["max_head"]
    blue = style.COLOURS[0]
    axes.fill_between(x, low, high, color=blue, alpha=0.10, linewidth=0)
    axes.plot(x, high, color=blue, linewidth=1.2, label="maximum head")
    start = arrays["initial_head"]
    axes.plot(x, start, color=style.INK, linewidth=0.9, linestyle=(0, (5, 3)), label="at the start")
    axes.plot(x, low, color=style.COLOURS[1], linewidth=1.2, label="minimum head")
    if hilly:  # if all elevations are zero, they would only compress the heads
        axes.plot(x, ground, color=style.MUTED, linewidth=1.8, label="pipe")
    axes.set_xlim(0.0, x[-1] + x[0])
