"""Pictures of validations: measured and computed series, values beside bands, errors over CPU time."""

import textwrap
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fvsolve.report.draw import style

COLUMNS = 2  # panels side by side
INKS = {"light": (style.INK, style.MUTED, style.HAIR), "dark": ("#e8edf2", "#9aa7b4", "#3a4550")}
MEASURED = style.COLOURS[1]
COMPUTED = style.COLOURS[0]
EXACT = style.COLOURS[2]


class LinePanel(NamedTuple):
    """Panel with lines : name -> float64[n, 2]; label : of the horizontal axis."""

    title: str
    label: str
    lines: dict[str, np.ndarray]
    logarithmic: bool = False


class ValueRow(NamedTuple):
    """Row of the panel of values, all in one unit; measured and gate as (least, greatest)."""

    what: str
    unit: str
    value: float
    error: float
    measured: tuple[float, float] | None
    others: tuple[float, ...]
    gate: tuple[float, float]
    passes: bool


def validation_figure(panels: Sequence[LinePanel], rows: Sequence[ValueRow], theme: str = "light"):
    """Figure of a validation with transparent background, for a light or a dark page."""
    ink, muted, hair = INKS[theme]
    lines = -(-len(panels) // COLUMNS)
    heights = [2.4 * lines] * bool(panels) + [0.7 + 0.36 * len(rows)] * bool(rows)
    figure = style.figure(sum(heights))
    places = iter(figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False).ravel())
    axes = []
    if panels:
        grid = next(places).add_gridspec(lines, COLUMNS)
        for k, panel in enumerate(panels):
            alone = k == len(panels) - 1 and k % COLUMNS == 0
            axes.append(
                grid.figure.add_subplot(
                    grid[k // COLUMNS, :] if alone else grid[k // COLUMNS, k % COLUMNS]
                )
            )
            draw_lines(axes[-1], panel)
    if rows:
        axes.append(next(places).subplots())
        draw_values(axes[-1], rows)
    for part in (figure, *figure.subfigs):
        part.set_facecolor("none")
    for ax in axes:
        ax.set_facecolor("none")
        ax.tick_params(which="both", colors=muted, labelcolor=ink, labelsize=8)
        for spine in ax.spines.values():
            spine.set_color(muted)
        ax.grid(True, color=hair, linewidth=0.5)
        legend = ax.get_legend()
        for text in (
            ax.title,
            ax._left_title,
            ax.xaxis.label,
            *ax.texts,
            *(legend.get_texts() if legend else ()),
        ):
            text.set_color(ink)
    return figure


def draw_lines(axes, panel: LinePanel) -> None:
    """Draw a panel of lines: measured values as dots, computed and exact values as lines, others as thin lines."""
    from matplotlib.ticker import NullFormatter

    style.style_axes(axes)
    others = iter(style.COLOURS[3:])
    for name, line in panel.lines.items():
        x, y = line.T
        if panel.logarithmic:
            axes.loglog(x, y, "o-", markersize=3.5, linewidth=1.2, label=name)
        elif name == "measured":
            step = max(1, len(x) // 160)
            axes.plot(
                x[::step], y[::step], "o", color=MEASURED, markersize=2.6, label=name, zorder=3
            )
        elif name in ("computed", "exact"):
            dash = {"linestyle": "--", "zorder": 3} if name == "exact" else {}
            axes.plot(
                x,
                y,
                color=EXACT if name == "exact" else COMPUTED,
                linewidth=1.5,
                label=name,
                **dash,
            )
        else:
            axes.plot(x, y, color=next(others, style.MUTED), linewidth=0.9, label=name)
    if panel.logarithmic:
        axes.margins(x=0.06)
        axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_title(panel.title, fontsize=8.5, loc="left")
    axes.set_xlabel(panel.label, fontsize=8)
    axes.legend(fontsize=7.5, frameon=False)


def draw_values(axes, rows: Sequence[ValueRow]) -> None:
    """Draw values, each row over its own gate, which spans from 1/4 to 3/4 of the axis."""
    style.style_axes(axes)
    for k, row in enumerate(rows):
        least, greatest = row.gate
        width = max(greatest - least, 1e-300)

        def place(value, least=least, width=width):
            return float(np.clip(0.25 + 0.5 * (value - least) / width, 0.0, 1.0))

        axes.barh(k, 0.5, left=0.25, height=0.7, color=EXACT, alpha=0.18)
        if row.measured is not None:
            ends = [place(value) for value in row.measured]
            axes.plot(
                ends,
                [k, k],
                "D-" if ends[0] == ends[1] else "-",
                markersize=5,
                color=MEASURED,
                linewidth=5,
                alpha=0.7,
                solid_capstyle="round",
            )
        for value in row.others:
            axes.plot(
                place(value), k, "|", color=style.COLOURS[3], markersize=11, markeredgewidth=1.6
            )
        axes.plot(
            [place(row.value - row.error), place(row.value + row.error)],
            [k, k],
            color=COMPUTED,
            linewidth=1.2,
        )
        axes.plot(
            place(row.value), k, "o" if row.passes else "X", color=COMPUTED, markersize=6, zorder=4
        )
        axes.text(1.01, k, f"{row.value:.4g} {row.unit}", va="center", fontsize=7.5)
    axes.set_yticks(range(len(rows)), [textwrap.fill(row.what, 44) for row in rows])
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xticks([0.25, 0.75], ["least that passes", "greatest that passes"])
    marks = {
        "computed, with numerical error": {"marker": "o", "color": COMPUTED},
        "gate": {"color": EXACT, "alpha": 0.18, "linewidth": 7},
        "measured": {"color": MEASURED, "alpha": 0.7, "linewidth": 5},
        "other codes": {"marker": "|", "color": style.COLOURS[3], "linestyle": "", "markersize": 9},
    }
    shown = {
        "measured": any(row.measured is not None for row in rows),
        "other codes": any(row.others for row in rows),
    }
    for name, mark in marks.items():
        if shown.get(name, True):
            axes.plot([], [], label=name, **mark)
    axes.legend(fontsize=7.5, frameon=False, ncols=4, loc="lower left", bbox_to_anchor=(0.0, 1.0))
