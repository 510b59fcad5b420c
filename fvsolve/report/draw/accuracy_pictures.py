"""Pictures of accuracy: orders of convergence, work-precision charts, and energy balances over time."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fvsolve.file_replacement import replacing
from fvsolve.report.draw import style

MARKERS = {"": "o", "pre-asymptotic": "^", "floor": "v", "reference": "X", "off the line": "D"}
METHOD_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h", "*", "d")
# an error floor below the least error divided by this factor is stated as text, not drawn
FLOOR_DISTANCE = 30.0
# vertical position of failed points, as a fraction of the height of the panel
FAILED_HEIGHT = 0.965
# a bound lower than this number of ranges of its integral is stated as text, not drawn
BOUND_DISTANCE = 5.0
MAX_PARTS = 6  # greatest number of parts drawn of each kind; the rest is drawn as a sum
ENERGY_UNITS = ((1e9, "GJ"), (1e6, "MJ"), (1e3, "kJ"), (1.0, "J"), (1e-3, "mJ"), (1e-6, "uJ"))
COLOUR_MAPS = {"stored": "Blues", "dissipated": "Oranges", "supplied": "Greens"}


@style.without_markup
def order_figure(sizes: Sequence[float], curves: Mapping, measure: str, title: str = ""):
    """Figure of errors over cell sizes or time steps, with a panel for each variable.

    curves : variable -> norm -> (errors : float64[sizes], fit); measure : label of the axis of sizes
    A fit has `order`, its uncertainty `spread`, `constant`, `reason` (a text if no order can be fitted), and `marks`, a
    text for each size. Sizes with an empty mark are fitted and have solid markers; other sizes have open markers. The
    line is the fitted slope, with its order in the legend. A variable without positive errors has no panel.
    """
    names = [
        name
        for name in curves
        if any(np.any(np.asarray(e) > 0.0) for e, _ in curves[name].values())
    ]
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
        style.name_axes(ax, measure)
    style.title(figure, textwrap.fill(title, 62 * columns))
    return figure


def panel(axes, sizes, norms: Mapping, name: str) -> None:
    """Draw the errors and fitted lines of the variable `name`; norms : norm -> (errors, fit), see `order_figure`."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    for colour, (norm, (errors, fit)) in zip(style.COLOURS, norms.items(), strict=False):
        errors = np.asarray(errors, float)
        shown = errors > 0.0
        label = (
            f"{norm}: order {fit.order:.2f} ± {fit.spread:.2f}"
            if not fit.reason
            else f"{norm}: no order"
        )
        axes.plot(sizes[shown], errors[shown], color=colour, linewidth=0.8, alpha=0.5)
        axes.plot([], [], color=colour, marker="o", markersize=4, linewidth=1.4, label=label)
        for mark, marker in MARKERS.items():
            here = shown & np.array([kind == mark for kind in fit.marks])
            face = colour if mark == "" else "white"
            axes.plot(
                sizes[here],
                errors[here],
                marker,
                color=colour,
                markerfacecolor=face,
                markersize=4.5,
            )
        fitted = sizes[[mark == "" for mark in fit.marks]]
        if not fit.reason:
            span = np.array([fitted.max() * 1.15, fitted.min() / 1.15])
            axes.plot(span, fit.constant * span**fit.order, color=colour, linewidth=1.6)
    dress_panel(
        axes,
        name,
        sorted(
            {mark for _, fit in norms.values() for mark in fit.marks if mark in MARKERS and mark}
        ),
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
        axes.plot(
            [],
            [],
            MARKERS[mark],
            color=style.MUTED,
            markerfacecolor="white",
            markersize=4.5,
            label=mark,
        )
    axes.legend(frameon=False, fontsize=7.5, labelcolor=style.INK, loc="best")


@dataclass(frozen=True)
class Curve:
    """Points of one scheme and method in a work-precision chart, from coarse to fine cells or steps.

    errors : a float64[n] for each row of panels; costs : a float64[n] for each column; failed : bool[n]
    """

    # name that the colour stands for: the scheme, or the method of a case without schemes
    colour: str
    marker: str  # name that the marker stands for: the method
    errors: Sequence[np.ndarray]
    costs: Sequence[np.ndarray]
    failed: np.ndarray
    bold: bool = False  # the program's default


@style.without_markup
def chart_figure(
    curves: Sequence[Curve], rows: Sequence[str], columns: Sequence[str], floors, title: str = ""
):
    """Figure with a panel for each kind of error (rows) and of cost (columns).

    Panels are shaded below the error floor; failed points are at the top. rows, columns : labels of the axes
    floors : error floor of each row
    """
    figure = style.figure(0.9 + 3.1 * len(rows), width=9.5)
    grid = figure.subplots(len(rows), len(columns), sharex="col", sharey="row", squeeze=False)
    colours = _assign_signs([curve.colour for curve in curves], style.COLOURS)
    markers = _assign_signs([curve.marker for curve in curves], METHOD_MARKERS)
    for axes in grid.flat:
        style.style_axes(axes)
    for axes in grid.flat:  # after the style of all: axes share their scales
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.margins(x=0.04)
    failed = any(curve.failed.any() for curve in curves)
    for i, panels in enumerate(grid):
        for j, axes in enumerate(panels):
            for curve in sorted(curves, key=lambda curve: curve.bold):
                _curve(
                    axes,
                    curve,
                    curve.errors[i],
                    curve.costs[j],
                    colours[curve.colour],
                    markers[curve.marker],
                )
            _front(axes, curves, i, j, floors[i])
        _limits(panels, [curve.errors[i][~curve.failed] for curve in curves], floors[i], failed)
        style.name_axes(panels[0], y=rows[i])
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
        style.name_axes(axes, name)
    for axes in grid.flat:
        style.label_decades(axes)
    _legend(figure, colours, markers, curves)
    style.title(figure, title)
    return figure


def save_picture(figure, path, dpi: float | None = None) -> None:
    """Write a figure to a file; an SVG keeps its texts as text, and equal figures give equal files."""
    from matplotlib import rc_context

    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "fvsolve"}), replacing(path) as fresh:
        kind = {"metadata": {"Date": None}} if str(path).endswith(".svg") else {}
        figure.savefig(fresh, **kind, **({} if dpi is None else {"dpi": dpi}))


def _assign_signs(words, signs) -> dict:
    return {word: signs[k % len(signs)] for k, word in enumerate(dict.fromkeys(words))}


def _curve(axes, curve: Curve, errors, costs, colour: str, marker: str) -> None:
    good = ~curve.failed & np.isfinite(errors) & (errors > 0)
    axes.plot(
        costs[good],
        errors[good],
        color=colour,
        marker=marker,
        markersize=5.5 if curve.bold else 4.2,
        linewidth=2.2 if curve.bold else 0.9,
        markeredgecolor=style.INK if curve.bold else "white",
        markeredgewidth=0.5,
        zorder=3 if curve.bold else 2,
    )
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
    least = np.inf
    x = []
    y = []
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
    panels[0].text(
        0.015,
        0.015,
        note,
        transform=panels[0].transAxes,
        fontsize=7,
        color=style.MUTED,
        va="bottom",
        in_layout=False,
    )


def _legend(figure, colours: dict, markers: dict, curves) -> None:
    from matplotlib.lines import Line2D

    handles = []
    if set(colours) != set(markers):
        handles += [
            Line2D([], [], color=colour, linewidth=3.0, label=word)
            for word, colour in colours.items()
        ]
        handles += [
            Line2D(
                [], [], color=style.INK, marker=marker, markersize=4.5, linestyle="none", label=word
            )
            for word, marker in markers.items()
        ]
    else:
        handles += [
            Line2D(
                [],
                [],
                color=colours[word],
                marker=markers[word],
                markersize=4.5,
                linewidth=1.2,
                label=word,
            )
            for word in colours
        ]
    if any(curve.bold for curve in curves):
        handles.append(Line2D([], [], color=style.INK, linewidth=2.4, label="bold: the default"))
    handles.append(Line2D([], [], color=style.MUTED, linewidth=4.0, alpha=0.4, label="front"))
    figure.legend(
        handles=handles, loc="outside right center", frameon=False, fontsize=8, labelcolor=style.INK
    )


@style.without_markup
def energy_figure(
    t, supplied, stored, dissipated, numerical, title="", port=None, units=("s", None)
):
    """Figure with three panels over time: supplied energy, stored and dissipated energy, and numerical loss.

    supplied, stored, dissipated, numerical : name -> float64[k] [J], cumulative
    The first three are drawn as stacked areas, positive values upwards and negative values downwards. The last is drawn
    as lines. A stored energy that becomes negative is drawn relative to its least value. In the second panel, the gap
    between the areas and the line above them is the remainder of the energy balance.
    port : None, or data of a fourth panel as (name, work, bound): the integral of pressure times flow at the port
        float64[k] [J], and its lower bound float64[k] [J]
    units : (unit of t, unit of energies); the second is (size [J], name), or None to choose the unit by size
    """
    figure = style.figure(8.2 if port is None else 9.8)
    heights = (2, 3, 2, 2)[: 3 if port is None else 4]
    top, middle, low, *more = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    total = np.sum([np.zeros_like(t), *supplied.values()], axis=0)
    least = {name: np.min(line, initial=0.0) for name, line in stored.items()}
    stored = {name: line - least[name] for name, line in stored.items()}
    start = -sum(least.values())
    shown = [total + start, *supplied.values(), *stored.values(), *dissipated.values()]
    clock, given = units
    size, unit = given or energy_unit(max(np.max(np.abs(line), initial=0.0) for line in shown))
    _stack(top, t, {"supplied": supplied}, size)
    top.plot(t, total / size, color=style.INK, linewidth=1.2, label="total supplied")
    _stack(middle, t, {"dissipated": dissipated, "stored": stored}, size)
    middle.plot(
        t,
        (total + start) / size,
        color=style.INK,
        linewidth=1.2,
        label="supplied and\nstored at the start",
    )
    losses = [np.max(np.abs(line), initial=0.0) for line in numerical.values()]
    small, own = given or energy_unit(max(losses, default=0.0))
    for (name, values), colour in zip(numerical.items(), style.COLOURS, strict=False):
        look = (
            {"color": style.INK, "linestyle": (0, (4, 2))}
            if name == "remainder"
            else {"color": colour}
        )
        low.plot(t, values / small, linewidth=1.2, label=name, **look)
    low.axhline(0.0, color=style.MUTED, linewidth=0.6)
    names = (f"supplied [{unit}]", f"dissipated, stored [{unit}]", f"numerical loss [{own}]")
    for axes, name in zip((top, middle, low), names, strict=True):
        style.style_axes(axes)
        style.name_axes(axes, y=name)
        style.legend(axes)
    for axes in more:
        _port_panel(axes, t, *port, given)
    style.name_axes((more or [low])[-1], x=f"time [{clock}]")
    style.title(figure, title)
    return figure


def _port_panel(axes, t, name, work, bound, given) -> None:
    """Draw the supplied energy at the port `name`, and its lower bound.

    work : float64[k]  integral of pressure times flow [J]
    bound : float64[k]  its lower bound [J]; a bound that lies far below is stated only in the legend
    given : (size [J], name) of the unit of energies, or None to choose it by size
    """
    span = max(np.ptp(work), np.max(np.abs(work)))
    far = span > 0.0 and np.max(bound) < -BOUND_DISTANCE * span
    size, unit = given or energy_unit(
        max(np.max(np.abs(work)), 0.0 if far else np.max(np.abs(bound)))
    )
    axes.plot(t, work / size, color=style.COLOURS[0], linewidth=1.2, label="integral of p q")
    look = {"color": style.DOUBT, "linestyle": (0, (4, 2)), "linewidth": 1.2}
    if far:
        own, its = given or energy_unit(np.max(np.abs(bound)))
        axes.plot([], [], label=f"lower bound, {np.max(bound) / own:.4g} {its}", **look)
    else:
        axes.plot(t, bound / size, label="lower bound", **look)
    axes.axhline(0.0, color=style.MUTED, linewidth=0.6)
    style.style_axes(axes)
    style.name_axes(axes, y=f"port {name} [{unit}]")
    style.legend(axes)


def energy_unit(greatest: float) -> tuple[float, str]:
    """Size [J] and name of the largest unit in which the energy `greatest` [J] is at least 1.

    For an energy below 1 in all units, they are those of the smallest unit.
    """
    return next(((size, unit) for size, unit in ENERGY_UNITS if greatest >= size), ENERGY_UNITS[-1])


def _stack(axes, t, kinds, size) -> None:
    """Draw stacked areas of energies, kind by kind; positive and negative values are stacked separately.

    kinds : kind -> part -> float64[k] [J]; size : unit of the axis [J]
    """
    import matplotlib

    up, down = np.zeros_like(t), np.zeros_like(t)
    for kind, parts in kinds.items():
        named = _largest_parts(parts)
        shades = matplotlib.colormaps[COLOUR_MAPS[kind]](np.linspace(0.75, 0.3, len(named)))
        for (name, values), shade in zip(named.items(), shades, strict=True):
            above = up + np.maximum(values, 0.0) / size
            below = down + np.minimum(values, 0.0) / size
            look = {"facecolor": shade, "edgecolor": "white", "linewidth": 0.3}
            axes.fill_between(t, up, above, label=name, **look)
            axes.fill_between(t, below, down, **look)
            up, down = above, below
    axes.axhline(0.0, color=style.MUTED, linewidth=0.6)


def _largest_parts(parts):
    """Energies of the parts with the largest energies, and the sum of all other parts : name -> float64[k] [J].

    parts : name -> float64[k] [J], of all parts
    """
    order = sorted(parts, key=lambda name: -np.max(np.abs(parts[name]), initial=0.0))
    if len(order) <= MAX_PARTS:
        return {name: parts[name] for name in order}
    rest = np.sum([parts[name] for name in order[MAX_PARTS - 1 :]], axis=0)
    return {name: parts[name] for name in order[: MAX_PARTS - 1]} | {
        f"{len(order) - MAX_PARTS + 1} others": rest
    }
