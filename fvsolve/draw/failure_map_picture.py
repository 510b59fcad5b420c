"""Picture of a failure map: verdicts on runs with several methods and time steps, a coloured square for each run."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.draw import style

VERDICT_COLOURS = {
    "stable": "#12876f", "ringing": "#e0b13c", "coarse": "#8fc4e8", "wrong": "#8a4fa3", "blown up": "#c2410c",
    "refused": "#6b7785", "not run": "#eef1f4",
}  # fmt: skip
DARK_VERDICTS = ("stable", "wrong", "blown up", "refused")  # verdicts with dark colours, labelled in white


@style.without_markup
def failure_map_figure(result, title: str = "", head: str = ""):
    """Figure of a failure map with a panel for each scheme.

    A panel has a row for each method, and a column for each time step or value of a key. A bar in a row marks the
    predicted stability limit. head : label of the columns if they are values of a key
    """
    tall = 0.30 * len(result.methods)
    figure = style.figure(1.5 + len(result.schemes) * (tall + 0.75), width=max(7.0, 2.3 + 0.68 * len(result.values)))
    panels = figure.subplots(len(result.schemes), 1, squeeze=False)[:, 0]
    for axes, scheme in zip(panels, result.schemes, strict=True):
        _panel(axes, result, scheme)
    label = "step, and Courant number" if result.wave_rate else "step"
    panels[-1].set_xlabel(label if result.key == "step" else head or result.key, fontsize=8.5, color=style.INK)
    _legend(figure, result)
    style.title(figure, title)
    return figure


def column_labels(result) -> list[str]:
    """Labels of the columns of a failure map: time steps, with Courant numbers on a second line, or values of a key."""
    if result.key != "step":
        return [f"{value:.4g}" if isinstance(value, float) else str(value) for value in result.values]
    if not result.wave_rate:
        return [time_text(value) for value in result.values]
    return [f"{time_text(value)}\nC {value * result.wave_rate:.3g}" for value in result.values]


def time_text(value: float) -> str:
    """Text of a time [s] in a suitable unit: 1.4 us, 3.75 ms, 2 s."""
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("us", 1e6)):
        if value * factor >= 1.0 or unit == "us":
            return f"{value * factor:.3g} {unit}"
    return f"{value:.3g} s"


def _panel(axes, result, scheme: str) -> None:
    from matplotlib.patches import Rectangle

    for row, method in enumerate(result.methods):
        squares = result.row(scheme, method)
        for square in squares:
            colour, hatch = VERDICT_COLOURS[square.verdict], "////" if square.verdict == "not run" else None
            axes.add_patch(
                Rectangle(
                    (square.column - 0.5, row - 0.5), 1, 1, facecolor=colour, edgecolor="white", hatch=hatch, lw=1.2
                )
            )
            ink = "white" if square.verdict in DARK_VERDICTS else style.INK
            axes.text(square.column, row, _error_text(square), ha="center", va="center", fontsize=6.5, color=ink)
        place = limit_place(result, squares)
        if place is not None:
            look = "dotted" if scheme in result.limited else "solid"
            for start in (row - 0.5, row + 0.24):  # leaves the number free
                axes.plot([place] * 2, [start, start + 0.26], color=style.INK, lw=2.2, linestyle=look, zorder=3)
    axes.set_xlim(-0.55, len(result.values) - 0.45)
    axes.set_ylim(len(result.methods) - 0.45, -0.55)
    axes.set_xticks(range(len(result.values)), column_labels(result))
    axes.set_yticks(range(len(result.methods)), result.methods)
    axes.tick_params(colors=style.MUTED, labelcolor=style.INK, labelsize=7.5, length=0)
    for side in axes.spines.values():
        side.set_visible(False)
    if result.wave_rate:
        axes.set_title(scheme, fontsize=9, color=style.INK, loc="left", pad=4)


def _error_text(square) -> str:
    """Text of the error of a run as a percentage; "" if it is not known, and for blown up, refused or missing runs."""
    error = square.measures.error
    if not math.isfinite(error) or square.verdict in ("blown up", "refused", "not run"):
        return ""
    return f"{100 * error:.2g} %"


def limit_place(result, squares) -> float | None:
    """Position of the predicted stability limit in a row, in columns; None if no step exceeds it or it is unknown.

    If all steps exceed their limits, it is -0.5, before the first column. squares : runs of the row
    """
    limits = [square.limit for square in squares]
    if None in limits or any(square.step is None for square in squares):
        return None
    if result.key != "step":
        safe = [square.step <= square.limit for square in squares]
        flips = [k for k in range(1, len(safe)) if safe[k] != safe[k - 1]]
        return flips[0] - 0.5 if flips else (None if all(safe) else -0.5)
    limit, steps = limits[0], np.array([square.step for square in squares])
    if limit >= steps.max():
        return None
    if limit < steps.min():
        return -0.5
    order = np.argsort(steps)
    return float(np.interp(math.log(limit), np.log(steps[order]), np.arange(len(steps))[order]))


def _legend(figure, result) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    seen = {square.verdict for square in result.squares}
    handles = [
        Patch(facecolor=colour, label=word, hatch="////" if word == "not run" else None)
        for word, colour in VERDICT_COLOURS.items()
        if word in seen
    ]
    looks = {"dotted" if scheme in result.limited else "solid" for scheme in result.schemes}
    labels = {"solid": "predicted limit", "dotted": "predicted limit, with the weights of smooth flow"}
    handles += [
        Line2D([], [], color=style.INK, lw=2.2, linestyle=look, label=labels[look]) for look in labels if look in looks
    ]
    figure.legend(
        handles=handles,
        loc="outside lower left",
        ncols=5 if len(result.values) > 8 else 3,
        frameon=False,
        fontsize=8,
        labelcolor=style.INK,
    )
