"""Figures of the report as plain data for plotly.js: histories of probes and long sections, as traces and layout.

Long histories keep the extremes of bins. plotly.js interprets some markup in names and titles, so all texts of a case
pass through `escape_markup`.
"""

import base64
import html
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fvsolve.errors import visible
from fvsolve.report.draw.plot import name_lines, probe_quantity, thin_series
from fvsolve.report.draw.style import COLOURS, DOUBT, HAIR, INK, MUTED
from fvsolve.report.long_section import VAPOUR_LINE as VAPOUR_LINE
from fvsolve.report.long_section import HeadAnimation, Section, SectionDevice, head_window
from fvsolve.report.tables import decimal_sign

SHOWN_LINES = 8  # lines of a panel that are visible at first; a click on a name shows the others
MAX_PROBES = 48  # greatest number of probes of a report; history.csv has all
MAX_NUMBERS = 40_000  # greatest number of values of all series of a report together
GREATEST_COLOUR, LEAST_COLOUR, NOW_COLOUR, VAPOUR_COLOUR = COLOURS[:4]
CLASS_COLOUR = COLOURS[6]
BACKGROUND = "#ffffff"
DASH, DOT, LONG_DASH = "9px,5px", "2px,3px", "14px,5px"
LINE_LOOKS = {
    VAPOUR_LINE: {"colour": VAPOUR_COLOUR, "width": 1.4, "dash": DOT},
    "class line": {"colour": CLASS_COLOUR, "width": 1.8, "dash": "9px,3px,2px,3px"},
}
LIMIT_LOOKS = {
    "maximum": {"colour": CLASS_COLOUR, "width": 1.3, "dash": LONG_DASH},
    "minimum": {"colour": CLASS_COLOUR, "width": 1.3, "dash": "8px,3px,2px,3px,2px,3px"},
}
# Lines remain distinguishable in grey print.
DASHES = ("solid", DASH, DOT, "9px,3px,2px,3px", LONG_DASH, "14px,3px,2px,3px")
DARK_COLOURS = {
    INK: "#dde3ea",
    MUTED: "#9aa7b5",
    HAIR: "#37424e",
    BACKGROUND: "#12171d",
    DOUBT: "#ff8b5e",
} | dict(
    zip(
        COLOURS,
        ("#5db4ec", "#f08a4b", "#3cc3a4", "#c08ad8", "#e0b13c", "#8fd0f5", "#e8748c", "#a9bf6a"),
        strict=True,
    )
)  # colours for dark screens; printed pages use the light ones
SECTION_HEIGHT, HISTORY_HEIGHT = 920, 260  # heights of sections and histories [px]
TOOLBAR_HEIGHT = 22  # height of the tool bar above the names [px]
FONT = 'system-ui, -apple-system, "Segoe UI", "Helvetica Neue", Arial, sans-serif'


class Series(NamedTuple):
    """Series of a probe or of a measurement, in the units of history.csv; with a start time, `t` has dates.

    seen : True if it is visible at first; measured : True for a measurement
    """

    name: str
    t: np.ndarray
    values: np.ndarray
    seen: bool
    measured: bool = False


class HistoryPanel(NamedTuple):
    """Panel of series of one quantity and unit."""

    quantity: str
    unit: str
    lines: list[Series]


def history_panels(result) -> list[HistoryPanel]:
    """Panels of histories in the order of the probes.

    In a panel of more than `SHOWN_LINES` series, only those with the widest range are visible at first.
    """
    chosen, measured = chosen_probes(result), result.history_drawn().get("measured", {})
    points = max(MAX_NUMBERS // max(2 * (len(chosen) + len(measured)), 1), 64)
    result_panels = []
    for (kind, unit), names in _by_panel(result, chosen).items():
        seen = names if len(names) <= SHOWN_LINES else _most_varying(result, names)
        lines = [
            Series(name, *thin_series(result.drawn_times, result[name], points), name in seen)
            for name in names
        ]
        lines += [
            Series(name, *thin_series(*measured[name], points), name in seen, True)
            for name in names
            if name in measured
        ]
        result_panels.append(HistoryPanel(kind, unit, lines))
    return result_panels


def chosen_probes(result) -> list[str]:
    """Names of the probes in the report: all, or if they are many, those with the widest range in each panel."""
    if len(result.probes) <= MAX_PROBES:
        return result.probes
    groups = _by_panel(result, result.probes)
    share = max(MAX_PROBES // len(groups), 1)
    selected = {name for names in groups.values() for name in _most_varying(result, names, share)}
    return [name for name in result.probes if name in selected]


def _by_panel(result, probes: list[str]) -> dict[tuple[str, str], list[str]]:
    """Names of probes by panel : (quantity, unit) -> names."""
    groups: dict[tuple[str, str], list[str]] = {}
    for name in probes:
        groups.setdefault((probe_quantity(name), result.units[name]), []).append(name)
    return groups


def _most_varying(result, names: list[str], count: int = SHOWN_LINES) -> set[str]:
    extremes = result.extremes
    swing = {
        name: (extremes[name].maximum or 0.0) - (extremes[name].minimum or 0.0) for name in names
    }
    return set(sorted(names, key=lambda name: -swing[name])[:count])


def section_figure(
    section: Section, moving: HeadAnimation | None, unit: str, along: str, bins: int
) -> dict[str, Any]:
    """Figure of a long section: heads, pipe, vapour and class lines, spans of cavities, devices, animated head.

    moving : animated head, or None; unit, along : units of head and chainage
    bins : number of bins into which a long line is divided; only the extremes of each bin are drawn
    """
    k = section.drawn_indices(bins)
    x = packed_array(section.chainage[k], "f4")
    lines = {name: packed_array(values[k], "f4") for name, values in section.along.items()}
    shade = {"fill": "tonexty", "fillcolor": "rgba(11,106,168,0.08)"}
    data = [
        _line("maximum head", x, lines["max_head"], GREATEST_COLOUR, width=2),
        _line("minimum head", x, lines["min_head"], LEAST_COLOUR, width=2, **shade),
        _line("initial head", x, lines["initial_head"], INK, width=1.2, dash=DASH),
        _line("pipe", x, lines["elevation"], MUTED, width=3.5),
    ]
    data += _limits(section, x, k)
    if section.cavity_spans:
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": "vapour pressure reached",
                "x": [None],
                "y": [None],
                "marker": {"symbol": "square", "size": 11, "color": VAPOUR_COLOUR, "opacity": 0.35},
            }
        )
    if section.violations:
        at, heads, names = zip(*section.violations, strict=True)
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": "limit passed",
                "x": at,
                "y": heads,
                "cliponaxis": False,
                "text": [escape_markup(name) for name in names],
                "marker": {"symbol": "x-thin", "size": 10, "line": {"color": DOUBT, "width": 2.5}},
            }
        )
    shapes = [_band(a, b, VAPOUR_COLOUR, 0.18) for a, b in section.cavity_spans]
    if moving is not None:
        places, heads = packed_array(moving.chainage, "f4"), packed_array(moving.heads[0], "f4")
        data.append(_line("head now", places, heads, NOW_COLOUR, width=2.6))
    layout = _section_layout([section], unit, along)
    layout["shapes"] = [*shapes, *layout["shapes"]]
    figure: dict[str, Any] = {"data": data, "layout": layout}
    if moving is not None:
        figure["moving"] = {
            "trace": len(data) - 1,
            "times": moving.times.tolist(),
            "heads": [[float(f"{v:.6g}") for v in row] for row in moving.heads.tolist()],
        }
    return figure


def study_section_figure(
    several: list[tuple[str, Section]], unit: str, along: str
) -> dict[str, Any]:
    """Figure of a long section in several runs: pipe, vapour line and limits once, heads of each run in another colour.

    several : list of (name of the run, section); unit, along : units of head and chainage
    """
    first = with_devices_of_all([section for _, section in several])
    k = first.drawn_indices()
    x = packed_array(first.chainage[k], "f4")
    data = [_line("pipe", x, packed_array(first.along["elevation"][k], "f4"), MUTED, width=3.5)]
    data += _limits(first, x, k)
    for n, (name, section) in enumerate(several):
        colour, k = COLOURS[n % len(COLOURS)], section.drawn_indices()
        x, group = packed_array(section.chainage[k], "f4"), {"legendgroup": f"run {n}"}
        high, low = (packed_array(section.along[key][k], "f4") for key in ("max_head", "min_head"))
        data.append(_line(name or "the case", x, high, colour, width=2, **group))
        data.append(_line("", x, low, colour, width=2, dash=DASH, showlegend=False, **group))
    sections = [section for _, section in several]
    return {"data": data, "layout": _section_layout([first, *sections], unit, along)}


def with_devices_of_all(sections: Sequence[Section]) -> Section:
    """The section with the most points, with the devices of all sections, such as those of protections in some runs."""
    first = max(sections, key=lambda section: len(section.devices))
    found: dict[tuple[str, float], list[str]] = {}
    for section in [first, *sections]:
        for device in section.devices:
            parts = found.setdefault((device.place, round(device.chainage, 6)), [])
            parts += [part for part in device.parts if part not in parts]
    devices = [
        SectionDevice(chainage, place, tuple(parts)) for (place, chainage), parts in found.items()
    ]
    return replace(first, devices=sorted(devices, key=lambda device: device.chainage))


def history_figure(panel: HistoryPanel, time_unit: str, doubt: float | None) -> dict[str, Any]:
    """Figure of the series of a panel over time; shaded from the time `doubt`, from which results are not valid.

    time_unit : unit of times, or zone of dates; doubt : None if all results are valid
    """
    data, names = [], [line.name for line in panel.lines if not line.measured]
    for line in panel.lines:
        place = names.index(line.name)
        colour = COLOURS[place % len(COLOURS)]
        dash = DASHES[place // len(COLOURS) % len(DASHES)]
        trace = _line(line.name, time_data(line.t), packed_array(line.values), colour, dash=dash)
        if line.measured:
            trace |= {
                "mode": "markers",
                "name": f"{trace['name']}, measured",
                "marker": {"size": 4, "color": colour},
            }
        data.append(trace | ({} if line.seen else {"visible": "legendonly"}))
    layout = chart_layout(
        f"{panel.quantity.replace('_', ' ')} [{panel.unit}]", f"time [{time_unit}]", HISTORY_HEIGHT
    )
    ends = [line.t[[0, -1]] for line in panel.lines if len(line.t)]
    if ends:
        first, last = min(a for a, _ in ends), max(b for _, b in ends)
        layout["xaxis"] |= {"range": [axis_time(first), axis_time(last)]}
        layout["xaxis"] |= {"type": "date"} if isinstance(first, np.datetime64) else {}
    if doubt is not None and ends:
        layout["shapes"] = [_band(axis_time(doubt), layout["xaxis"]["range"][1], DOUBT, 0.08)]
    layout |= {"yaxis": layout["yaxis"] | _range_at_rest(panel)}
    return {"data": data, "layout": layout}


def escape_markup(text: str) -> str:
    """Escape a text for plotly.js: no markup, and `$` does not begin a formula."""
    return html.escape(visible(str(text)), quote=False).replace("$", "&#36;")


def axis_time(t: Any) -> float | str:
    """Time on an axis of plotly.js: a number, or the text of a date without zone, which no browser shifts."""
    return str(t).replace("T", " ") if isinstance(t, np.datetime64) else float(t)


def time_data(t: np.ndarray) -> dict[str, str] | list[str]:
    """Times of a series for plotly.js: packed numbers, or texts of dates."""
    return [axis_time(at) for at in t] if t.dtype.kind == "M" else packed_array(t)


def packed_array(values: Sequence[float] | np.ndarray, kind: str = "f8") -> dict[str, str]:
    """Array in the base64 format of plotly.js; kind : "f8" (exact) or "f4" (seven digits)."""
    packed = np.ascontiguousarray(values, f"<{kind}").tobytes()
    return {"dtype": kind, "bdata": base64.b64encode(packed).decode()}


def _line(
    name: str, x, y, colour: str, width: float = 1.5, dash: str = "solid", **more: Any
) -> dict[str, Any]:
    return {
        "type": "scatter",
        "mode": "lines",
        "name": escape_markup(name),
        "x": x,
        "y": y,
        "line": {"color": colour, "width": width, "dash": dash},
        **more,
    }


def chart_layout(y: str, x: str, height: int) -> dict[str, Any]:
    axis = {
        "showline": True,
        "linecolor": MUTED,
        "gridcolor": HAIR,
        "zeroline": False,
        "ticks": "outside",
        "tickcolor": MUTED,
        "ticklen": 4,
        "automargin": True,
        "exponentformat": "power",
        "minexponent": 6,
        "separatethousands": True,
    }
    background = {"bgcolor": BACKGROUND, "bordercolor": HAIR}
    return {
        "height": height,
        "margin": {"l": 62, "r": 14, "t": TOOLBAR_HEIGHT + 6, "b": 50},
        "paper_bgcolor": BACKGROUND,
        "plot_bgcolor": BACKGROUND,
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": MUTED, "activecolor": INK},
        "font": {"family": FONT, "size": 12, "color": INK},
        "separators": f"{decimal_sign()}\u202f",
        "hovermode": "x unified",
        "hoverlabel": {"namelength": -1, "font": {"size": 11, "color": INK}} | background,
        "dragmode": "zoom",
        "showlegend": False,
        "xaxis": axis | {"title": {"text": escape_markup(x), "standoff": 8}},
        "yaxis": axis | {"title": {"text": escape_markup(y), "standoff": 8}},
    }


def _band(a: float, b: float, colour: str, opacity: float) -> dict[str, Any]:
    return {
        "type": "rect",
        "xref": "x",
        "yref": "paper",
        "x0": a,
        "x1": b,
        "y0": 0,
        "y1": 1,
        "fillcolor": colour,
        "opacity": opacity,
        "line": {"width": 0},
        "layer": "below",
    }


def _limits(section: Section, x, k: np.ndarray) -> list[dict[str, Any]]:
    """Curves of the vapour line and of limits for plotly.js; x : drawn chainages, k : their indices in the section."""
    looks = {
        name: LINE_LOOKS.get(name) or LIMIT_LOOKS[name.rpartition(", ")[2]]
        for name in section.lines
    }
    return [
        _line(name, x, packed_array(line[k], "f4"), **looks[name])
        for name, line in section.lines.items()
    ]


def _section_layout(sections: list[Section], unit: str, along: str) -> dict[str, Any]:
    """Layout of a figure of sections, with the chainages and devices of the first section.

    unit, along : units of head and chainage
    """
    first, seen = sections[0], head_window(sections, unit)
    layout = chart_layout(f"head [{unit}]", f"chainage [{along}]", SECTION_HEIGHT)
    names = _place_names(first)
    sizes = [name_lines(device) for _, device, _ in first.labels()]
    letters = max((len(line) for lines in sizes for line in lines), default=0)
    most = max(map(len, sizes), default=1)
    layout["margin"]["t"] = TOOLBAR_HEIGHT + 26 + 6 * letters + 12 * (most - 1)
    look = {"line": {"color": HAIR, "width": 1}, "layer": "below"}
    upright = {"type": "line", "xref": "x", "yref": "paper", "y0": 0, "y1": 1.015, **look}
    layout["shapes"] = [
        {**upright, "x0": device.chainage, "x1": device.chainage} for device in first.devices
    ]
    layout["annotations"] = [*names, *_limit_arrow(seen.above, 1), *_limit_arrow(seen.below, 0)]
    layout["xaxis"]["range"] = list(first.ends)
    layout["yaxis"]["range"] = [seen.low, seen.high]
    return layout


def _limit_arrow(limits: list[str], edge: int) -> list[dict[str, Any]]:
    """Arrow at the upper (edge = 1) or lower (edge = 0) edge of the axes, with texts on limits beyond that edge.

    limits : these texts; the result is [] without texts
    """
    # pixels from the edge
    text, away = "<br>".join(map(escape_markup, limits)), 7 * len(limits) + 6
    arrow = {
        "xref": "paper",
        "yref": "paper",
        "x": 0.97,
        "y": edge,
        "ax": 0,
        "ay": away if edge else -away,
        "showarrow": True,
        "arrowhead": 2,
        "arrowwidth": 1.2,
        "arrowcolor": CLASS_COLOUR,
        "xanchor": "right",
        "yanchor": "middle",
        "borderpad": 4,
        "bgcolor": BACKGROUND,
        "text": text,
        "font": {"size": 11, "color": CLASS_COLOUR},
    }
    return [arrow] if limits else []


def _place_names(section: Section) -> list[dict[str, Any]]:
    """Plotly annotations with the names of devices and nodes, above a section at their chainages."""
    late = section.ends[0] + 0.9 * (section.ends[1] - section.ends[0])
    return [
        {
            "x": x,
            "y": 1.02,
            "xref": "x",
            "yref": "paper",
            "showarrow": False,
            "textangle": -45,
            "xanchor": "right" if x > late else "left",
            "yanchor": "bottom",
            "text": "<br>".join(map(escape_markup, name_lines(names))),
            "hovertext": escape_markup(names),
            "font": {"size": 11, "color": INK if stands else MUTED},
        }
        for x, names, stands in section.labels()
    ]


def _range_at_rest(panel: HistoryPanel) -> dict[str, Any]:
    """Axis range for constant series, so that round-off is not magnified; {} for series that vary."""
    values = np.concatenate([line.values for line in panel.lines if line.seen] or [np.zeros(0)])
    values = values[np.isfinite(values)]
    if not values.size or np.ptp(values) >= 1e-9 * np.abs(values).max():
        return {}
    middle, half = float(values.mean()), float(np.abs(values).max()) * 1e-3 or 1.0
    return {"range": [middle - half, middle + half]}
