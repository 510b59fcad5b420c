"""Figures of runs: history.png, envelope.png, long sections and phase planes.

Constant and duplicate curves are left out of history.png.
"""

import textwrap
from dataclasses import dataclass

import numpy as np

from fvsolve.report.draw import style

CONSTANT_TOLERANCE = 1e-9  # greatest range of a constant curve, as a fraction of its size
# greatest difference of coinciding curves, as a fraction of the range of their panel
SAME_TOLERANCE = 1e-3
# greatest residual of a curve after scaling and shifting another to it, as a fraction of its range
ALIKE_TOLERANCE = 1e-6
# equivalent quantities at a fixed place
OF_PRESSURE = ("pressure", "gauge_pressure", "head", "level")
MAX_PANELS = 6  # greatest number of panels
MAX_LINES = 8  # greatest number of curves in a panel
MAX_CONSTANTS = 4  # greatest number of constant probes with names
LEGEND_WIDTH = 26  # letters of a line of a legend
MAX_PIPES = 6  # greatest number of pipes drawn; the longest are chosen
MAX_POINTS = 4000  # greatest number of rows drawn; of longer tables the extremes of bins are drawn
LINE_LOOKS = {
    "vapour line": {"color": style.COLOURS[3], "linewidth": 1.2, "linestyle": ":"},
    "class line": {"color": style.COLOURS[6], "linewidth": 1.4, "linestyle": "-."},
}
LIMIT_LOOKS = {
    "maximum": {"color": style.COLOURS[6], "linewidth": 1.1, "linestyle": (0, (9, 3))},
    "minimum": {
        "color": style.COLOURS[6],
        "linewidth": 1.1,
        "linestyle": (0, (6, 2, 1.5, 2, 1.5, 2)),
    },
}
LINE_LENGTH = 22  # letters of a line of a name over a chainage


@dataclass
class DrawnLine:
    """Curve of a column of history.csv.

    column : index of the column; names : places (part, and position on it) whose values the curve shows
    alike : other quantities at the same place with an equivalent curve, which are not drawn
    """

    column: int
    names: list[str]
    alike: list[str]

    @property
    def label(self) -> str:
        return ", ".join(self.names) + (f" ({', '.join(self.alike)} alike)" if self.alike else "")


@dataclass
class DrawnPanel:
    """Curves of a panel, which have the same quantity and unit."""

    quantity: str
    unit: str
    lines: list[DrawnLine]


def select_curves(
    values: np.ndarray, probes, measured=()
) -> tuple[list[DrawnPanel], list[tuple[str, str, float]]]:
    """Panels with the curves to draw, and constant probes : (list of `DrawnPanel`, list of (probe, unit, value)).

    values : float64[k, n]; probes : (name, unit) of each column
    measured : names of probes with measurements, which are always drawn
    """
    swings = [_range_of(values[:, k]) for k in range(len(probes))]
    still = [k for k, (name, _) in enumerate(probes) if swings[k] is None and name not in measured]
    if len(still) == len(probes):
        still = []  # if all probes are constant, all are drawn
    panels: dict[tuple[str, str], DrawnPanel] = {}
    leaders: dict[str, list[tuple[int, DrawnLine]]] = {}
    for k, (name, unit) in enumerate(probes):
        if k in still:
            continue
        # `main.pressure@0.5` is the quantity `pressure` of the place `main at 0.5`
        path, _, spot = name.partition("@")
        place, _, quantity = path.rpartition(".")
        place += f" at {spot}" if spot else ""
        line = DrawnLine(k, [place], [])
        if name not in measured and quantity in OF_PRESSURE:
            first = next(
                (
                    leader
                    for j, leader in leaders.get(place, [])
                    if _is_scaled(values[:, j], values[:, k])
                ),
                None,
            )
            if first is not None:
                first.alike.append(quantity.replace("_", " "))
                continue
            leaders.setdefault(place, []).append((k, line))
        panels.setdefault((quantity, unit), DrawnPanel(quantity, unit, [])).lines.append(line)
    for panel in panels.values():
        panel.lines = _without_doubles(panel.lines, values, probes, measured)
    return list(panels.values()), [(*probes[k], float(values[0, k])) for k in still if len(values)]


def _without_doubles(
    lines: list[DrawnLine], values: np.ndarray, probes, measured
) -> list[DrawnLine]:
    """Curves of a panel without duplicates: coinciding curves become one curve, which has the places of all in `names`.

    A curve with measurements, or with quantities in `alike`, does not become part of another curve.
    values, probes, measured : as for `select_curves`
    """
    seen = np.concatenate([values[:, line.column] for line in lines])
    tolerance = SAME_TOLERANCE * np.ptp(seen[np.isfinite(seen)]) if np.isfinite(seen).any() else 0.0
    result: list[DrawnLine] = []
    for line in lines:
        may_join = probes[line.column][0] not in measured and not line.alike
        own = values[:, line.column]
        for other in result if may_join else ():
            drawn = values[:, other.column]
            if (
                np.array_equal(np.isnan(drawn), np.isnan(own))
                and not (np.abs(drawn - own) > tolerance).any()
            ):
                other.names += line.names
                break
        else:
            result.append(line)
    return result


def _range_of(values: np.ndarray) -> float | None:
    """Range of a curve; None if it is constant."""
    finite = values[np.isfinite(values)]
    swing = float(np.ptp(finite)) if finite.size else 0.0
    return swing if swing > CONSTANT_TOLERANCE * float(np.abs(finite).max(initial=0.0)) else None


def _is_scaled(a: np.ndarray, b: np.ndarray) -> bool:
    """True if curve b is curve a times a positive factor plus a constant; False if either is constant or not finite."""
    low, high = int(a.argmin()), int(a.argmax())
    if not (np.isfinite(a).all() and np.isfinite(b).all() and a[low] < a[high]):
        return False
    scale = (b[high] - b[low]) / (a[high] - a[low])
    return bool(
        scale > 0.0
        and np.abs(b - b[low] - scale * (a - a[low])).max() <= ALIKE_TOLERANCE * np.ptp(b)
    )


@style.without_markup
def history_figure(t, values, probes, time_unit="s", marks=(), measured=None, title=""):
    """Figure of probes over time, with a panel for each quantity and unit. Constant probes are named in the legend.

    t : float64[k] in `time_unit`, or datetime64[k] in the zone `time_unit`; values : float64[k, n]
    probes : (name, unit) of each column
    marks : (time, cause) of events after which results are not to be trusted; the panels are shaded after the first
    measured : probe -> (times, values) of a measurement, which is drawn dotted
    """
    probes = list(probes)
    panels, still = select_curves(values, probes, measured or {})
    drawn = panels[:MAX_PANELS]
    figure = style.figure(0.7 + 2.1 * max(len(drawn), 1) + (0.5 if len(drawn) == 1 else 0.0))
    rows = figure.subplots(max(len(drawn), 1), 1, sharex=True, squeeze=False)[:, 0]
    for axes, panel in zip(rows, drawn, strict=False):
        _panel(
            axes, t, values, probes, panel.lines, measured or {}, still if axes is rows[-1] else []
        )
        style.name_axes(axes, y=f"{panel.quantity.replace('_', ' ')} [{panel.unit}]")
    for axes in rows:
        _shade(axes, t, marks, first=axes is rows[0])
    style.name_axes(rows[-1], f"time [{time_unit}]")
    if np.asarray(t).dtype.kind == "M":
        style.shorten_dates(rows[-1])
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
        style.name_axes(axes, y=f"head [{units['max_head']}]")
    figure.supxlabel(
        f"distance from the start of the pipe [{units['distance']}]", fontsize=8.5, color=style.INK
    )
    handles = {
        label: handle
        for axes in grid.flat
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        handles.values(),
        handles.keys(),
        loc="outside upper right",
        ncols=4,
        frameon=False,
        fontsize=8,
    )
    more = len(envelope) - len(names)
    style.title(
        figure, title + (f"\n(the {len(names)} longest of {len(envelope)} pipes)" if more else "")
    )
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
    high = np.array(
        [a + np.argmax(values[a:b]) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    )
    picked = np.unique(np.concatenate([[0], low, high, [len(t) - 1]]))
    return t[picked], values[picked]


def _panel(axes, t, values, probes, lines, measured, still) -> None:
    style.style_axes(axes)
    for i, curve in enumerate(lines[:MAX_LINES]):
        name, colour = probes[curve.column][0], style.COLOURS[i % len(style.COLOURS)]
        # the legend stays narrow
        label = textwrap.fill(curve.label, LEGEND_WIDTH, break_long_words=False)
        axes.plot(
            *thin_series(t, values[:, curve.column]), color=colour, linewidth=1.0, label=label
        )
        if name in measured:
            axes.plot(
                *measured[name], ":", color=colour, linewidth=1.4, label=f"{curve.label}, measured"
            )
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


def _shade(axes, t, marks, first: bool) -> None:
    if not marks or not len(t):
        return
    begun, cause = min(marks)
    axes.axvspan(begun, t[-1], color=style.DOUBT, alpha=0.08, linewidth=0)
    axes.axvline(begun, color=style.DOUBT, linewidth=0.8)
    late = begun - t[0] > t[-1] - begun
    # leaves space for the power of ten of the axis
    offset = 28 if begun - t[0] < 0.05 * (t[-1] - t[0]) else 4
    if first:
        place = {
            "xycoords": ("data", "axes fraction"),
            "textcoords": "offset points",
            "va": "bottom",
        }
        axes.annotate(
            f"not to be trusted from here: {cause}",
            (begun, 1.0),
            xytext=(-4 if late else offset, 2),
            ha="right" if late else "left",
            fontsize=7.5,
            color=style.DOUBT,
            **place,
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


@style.without_markup
def run_up_figure(columns, name, title=""):
    """Figure of a run-up over angle or distance. columns : "angle" [deg] or "distance" [m], and "run_up" [m]"""
    figure, along = style.figure(4.2), next(iter(columns))
    axes = figure.subplots()
    style.style_axes(axes)
    x, run_up = columns[along], columns["run_up"]
    axes.plot(x, run_up, ".-", color=style.COLOURS[0], linewidth=1.0, markersize=4)
    if along == "angle":
        axes.set_xlim(0.0, 360.0)
        axes.set_xticks(range(0, 361, 45))
    style.name_axes(axes, f"{along} [{'deg' if along == 'angle' else 'm'}]", f"run-up {name} [m]")
    style.title(figure, title)
    return figure


def mark_devices_and_limits(axes, section, window):
    """Write the limits outside the window of heads at its edges, and the names of devices at their chainages."""
    red = style.COLOURS[6]
    for limits, edge in ((window.above, 1), (window.below, 0)):
        if limits:
            axes.annotate(
                "\n".join(limits),
                (0.97, edge),
                xycoords="axes fraction",
                xytext=(0, -22 if edge else 22),
                textcoords="offset points",
                ha="right",
                va="top" if edge else "bottom",
                fontsize=8,
                color=red,
                arrowprops={"arrowstyle": "->", "color": red, "relpos": (1, edge)},
            )
    for x in [device.chainage for device in section.devices]:
        axes.axvline(x, color=style.HAIR, linewidth=0.8, zorder=0)
    for x, names, stands in section.labels():
        axes.annotate(
            "\n".join(name_lines(names)),
            (x, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 4),
            rotation=40,
            fontsize=7.5,
            textcoords="offset points",
            color=style.INK if stands else style.MUTED,
        )


@style.without_markup
def section_figure(section, window, units, title=""):
    """Figure of heads along a path, with pipe, vapour line, pressure class and limits; shaded where cavities formed.

    section, window : `Section` of `fvsolve.report.long_section`, and its `HeadWindow`; units : quantity -> unit
    """
    figure = style.figure(9.2)
    axes = figure.subplots()
    style.style_axes(axes)
    for a, b in section.cavity_spans:
        axes.axvspan(a, b, color=style.COLOURS[3], alpha=0.15, linewidth=0)
    k, posts = section.drawn_indices(), [device.chainage for device in section.devices]
    chainage = section.chainage[k]
    along = {name: values[k] for name, values in section.along.items()}
    high, low = along["max_head"], along["min_head"]
    axes.fill_between(chainage, low, high, color=style.COLOURS[0], alpha=0.08, linewidth=0)
    axes.plot(chainage, high, color=style.COLOURS[0], linewidth=1.4, label="maximum head")
    axes.plot(chainage, low, color=style.COLOURS[1], linewidth=1.4, label="minimum head")
    axes.plot(
        chainage,
        along["initial_head"],
        color=style.INK,
        linewidth=0.9,
        linestyle=(0, (5, 3)),
        label="initial head",
    )
    axes.plot(chainage, along["elevation"], color=style.MUTED, linewidth=2.4, label="pipe")
    for name, line in section.lines.items():
        look = LINE_LOOKS.get(name) or LIMIT_LOOKS[name.rpartition(", ")[2]]
        axes.plot(chainage, line[k], label=name, **look)
    if section.cavity_spans:
        axes.fill_between(
            [], [], color=style.COLOURS[3], alpha=0.3, label="vapour pressure reached"
        )
    if section.violations:
        at, heads, _ = zip(*section.violations, strict=True)
        axes.plot(
            at,
            heads,
            "x",
            color=style.DOUBT,
            markersize=7,
            markeredgewidth=2.0,
            clip_on=False,
            zorder=5,
            label="limit passed",
        )
    axes.set_xlim(min([chainage[0], *posts]), max([chainage[-1], *posts]))
    axes.set_ylim(window.low, window.high)
    mark_devices_and_limits(axes, section, window)
    style.name_axes(axes, f"chainage [{units['distance']}]", f"head [{units['max_head']}]")
    figure.legend(
        loc="outside lower center",
        ncols=4,
        handlelength=3,
        frameon=False,
        fontsize=8,
        labelcolor=style.INK,
    )
    style.title(figure, title)
    return figure


@style.without_markup
def initial_section_figure(section, along: str, height: str, title=""):
    """Figure of a section before a run: the pipe, and the heads at the start, with the names of places.

    section : arrays `chainage`, `elevation` and `head` : float64[n]; `places` : list of (chainage, names)
    along, height : units of chainage and head
    """
    figure = style.figure(4.6)
    axes = figure.subplots()
    style.style_axes(axes)
    axes.plot(
        section.chainage,
        section.head,
        color=style.COLOURS[0],
        linewidth=1.4,
        label="head at the start",
    )
    axes.plot(section.chainage, section.elevation, color=style.MUTED, linewidth=2.4, label="pipe")
    span = (section.chainage[-1] - section.chainage[0]) or 1.0
    last = None
    for x, names in section.places:
        axes.axvline(x, color=style.HAIR, linewidth=0.8, zorder=0)
        if last is not None and abs(x - last) < 0.03 * span:
            continue  # the names would overlap
        last = x
        axes.annotate(
            "\n".join(name_lines(names)),
            (x, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 4),
            rotation=40,
            fontsize=7.5,
            textcoords="offset points",
            color=style.INK,
        )
    low, high = axes.get_ylim()
    margin = 0.08 * (high - low)
    axes.set_ylim(low - margin, high + margin)
    style.name_axes(axes, f"chainage [{along}]", f"head [{height}]")
    style.legend(axes)
    style.title(figure, title)
    return figure


@style.without_markup
def phase_figure(pairs, title=""):
    """Figure with a phase plane for each pair of probes; a dot marks the start.

    pairs : list of (probe of x, probe of y), each probe as (name, unit, values : float64[k])
    """
    across = min(len(pairs), 2)
    down = -(-len(pairs) // across)
    figure = style.figure(
        0.6 + (4.4 if across == 1 else 3.6) * down, width=5.6 if across == 1 else style.WIDTH
    )
    grid = figure.subplots(down, across, squeeze=False)
    for axes, (x, y) in zip(grid.flat, pairs, strict=False):
        style.style_axes(axes)
        axes.margins(0.05)
        # of a long path only the extremes of both coordinates in bins of consecutive points are drawn
        rows = np.arange(len(x[2]), dtype=float)
        kept = np.union1d(thin_series(rows, x[2])[0], thin_series(rows, y[2])[0]).astype(int)
        axes.plot(x[2][kept], y[2][kept], color=style.COLOURS[0], linewidth=1.0)
        axes.plot(x[2][:1], y[2][:1], "o", color=style.COLOURS[1], markersize=5)
        style.name_axes(axes, f"{x[0]} [{x[1]}]", f"{y[0]} [{y[1]}]")
    for axes in list(grid.flat)[len(pairs) :]:
        axes.set_visible(False)
    style.title(figure, title)
    return figure


def name_lines(text: str) -> list[str]:
    """Lines of a name over a chainage, of at most about `LINE_LENGTH` letters; no letter is left out."""
    return textwrap.wrap(text, LINE_LENGTH, break_on_hyphens=True) or [text]
