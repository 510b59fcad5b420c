"""The picture of a failure map: a coloured square per run. Knows squares and matplotlib; runs nothing."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.draw import style

COLOURS = {
    "stable": "#12876f", "ringing": "#e0b13c", "coarse": "#8fc4e8", "wrong": "#8a4fa3", "blown up": "#c2410c",
    "refused": "#6b7785", "not run": "#eef1f4",
}  # fmt: skip
DARK = ("stable", "wrong", "blown up", "refused")  # which white letters stand on


@style.as_it_stands
def failure_map_figure(found, title: str = "", head: str = ""):
    """Methods down, steps or values across, one panel a scheme; a bar where eigenvalues predict the limit."""
    tall = 0.30 * len(found.methods)
    figure = style.figure(1.5 + len(found.schemes) * (tall + 0.75), width=max(7.0, 2.3 + 0.68 * len(found.values)))
    panels = figure.subplots(len(found.schemes), 1, squeeze=False)[:, 0]
    for axes, scheme in zip(panels, found.schemes, strict=True):
        _panel(axes, found, scheme)
    what = "step, and Courant number" if found.wave_rate else "step"
    panels[-1].set_xlabel(what if found.key == "step" else head or found.key, fontsize=8.5, color=style.INK)
    _legend(figure, found)
    style.title(figure, title)
    return figure


def column_labels(found) -> list[str]:
    """What stands under the columns: a step and its Courant number on two lines, or a value."""
    if found.key != "step":
        return [f"{value:.4g}" if isinstance(value, float) else str(value) for value in found.values]
    if not found.wave_rate:
        return [seconds(value) for value in found.values]
    return [f"{seconds(value)}\nC {value * found.wave_rate:.3g}" for value in found.values]


def seconds(value: float) -> str:
    """A time with a unit that keeps it short: 1.4 us, 3.75 ms, 2 s."""
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("us", 1e6)):
        if value * factor >= 1.0 or unit == "us":
            return f"{value * factor:.3g} {unit}"
    return f"{value:.3g} s"


def _panel(axes, found, scheme: str) -> None:
    from matplotlib.patches import Rectangle

    for row, method in enumerate(found.methods):
        squares = found.row(scheme, method)
        for one in squares:
            colour, hatch = COLOURS[one.verdict], "////" if one.verdict == "not run" else None
            axes.add_patch(
                Rectangle((one.column - 0.5, row - 0.5), 1, 1, facecolor=colour, edgecolor="white", hatch=hatch, lw=1.2)
            )
            ink = "white" if one.verdict in DARK else style.INK
            axes.text(one.column, row, _said(one), ha="center", va="center", fontsize=6.5, color=ink)
        place = limit_place(found, squares)
        if place is not None:
            look = "dotted" if scheme in found.limited else "solid"
            for start in (row - 0.5, row + 0.24):  # clear of the number
                axes.plot([place] * 2, [start, start + 0.26], color=style.INK, lw=2.2, linestyle=look, zorder=3)
    axes.set_xlim(-0.55, len(found.values) - 0.45)
    axes.set_ylim(len(found.methods) - 0.45, -0.55)
    axes.set_xticks(range(len(found.values)), column_labels(found))
    axes.set_yticks(range(len(found.methods)), found.methods)
    axes.tick_params(colors=style.MUTED, labelcolor=style.INK, labelsize=7.5, length=0)
    for side in axes.spines.values():
        side.set_visible(False)
    if found.wave_rate:
        axes.set_title(scheme, fontsize=9, color=style.INK, loc="left", pad=4)


def _said(one) -> str:
    """The error as a percentage, where there is one."""
    error = one.measures.error
    if not math.isfinite(error) or one.verdict in ("blown up", "refused", "not run"):
        return ""
    return f"{100 * error:.2g} %"


def limit_place(found, squares) -> float | None:
    """Where the predicted limit lies across the columns of a row; None where none is predicted among them."""
    limits = [one.limit for one in squares]
    if None in limits or any(one.step is None for one in squares):
        return None
    if found.key != "step":
        safe = [one.step <= one.limit for one in squares]
        flips = [k for k in range(1, len(safe)) if safe[k] != safe[k - 1]]
        return flips[0] - 0.5 if flips else (None if all(safe) else -0.5)
    limit, steps = limits[0], np.array([one.step for one in squares])
    if limit >= steps.max():
        return None
    if limit < steps.min():
        return -0.5
    order = np.argsort(steps)
    return float(np.interp(math.log(limit), np.log(steps[order]), np.arange(len(steps))[order]))


def _legend(figure, found) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    seen = {one.verdict for one in found.squares}
    handles = [
        Patch(facecolor=colour, label=word, hatch="////" if word == "not run" else None)
        for word, colour in COLOURS.items()
        if word in seen
    ]
    looks = {"dotted" if scheme in found.limited else "solid" for scheme in found.schemes}
    said = {"solid": "predicted limit (13)", "dotted": "predicted, by weights in smooth flow"}
    handles += [
        Line2D([], [], color=style.INK, lw=2.2, linestyle=look, label=said[look]) for look in said if look in looks
    ]
    figure.legend(
        handles=handles,
        loc="outside lower left",
        ncols=5 if len(found.values) > 8 else 3,
        frameon=False,
        fontsize=8,
        labelcolor=style.INK,
    )
