"""Extremes of a run with position and time: in pipes from the envelope, elsewhere from the probes."""

from __future__ import annotations

import numpy as np

from fvsolve.case.pipe_routes import Leg
from fvsolve.output.unit_columns import UnitColumn
from fvsolve.report.envelope_units import envelope_column
from fvsolve.report.section_pipes import SectionPath
from fvsolve.report.tables import ERROR_HEADER, ReportTable, in_unit
from fvsolve.run.result import not_valid

MAX_RANKED = 10  # greatest number of rows of a ranking on the page
EXTREMES = (  # quantity, its text, function of the index of the extreme, quantity of its time
    ("max_pressure", "maximum pressure", np.argmax, "t_max"),
    ("min_pressure", "minimum pressure", np.argmin, "t_min"),
    ("max_head", "maximum head", np.argmax, "t_max"),
    ("min_head", "minimum head", np.argmin, "t_min"),
)


def extremes_of_pipes(result, ways: list[SectionPath]) -> ReportTable | None:
    """Table of the extremes of each quantity over all pipes: value, pipe, distance, elevation, time.

    It is None without pipes, or if the run diverged. The chainage is added if the run has a single section, and if the
    chainage differs from the distance along the pipe. ways : paths of the long sections
    """
    envelope = result.envelope
    if not envelope or not_valid(result.summary):
        return None
    legs = {leg.pipe: leg for way in ways for leg in way.legs}
    if len(ways) > 1 or all(leg.begin == 0.0 and not leg.backwards for leg in legs.values()):
        legs = {}  # the chainage equals the distance, or the section would be ambiguous
    rows = []
    for name, words, most, when in EXTREMES:
        ends = {pipe: int(most(arrays[name])) for pipe, arrays in envelope.items()}
        pipes = list(ends)
        pipe = pipes[int(most([envelope[key][name][ends[key]] for key in pipes]))]
        arrays, k = envelope[pipe], ends[pipe]
        chainage = [_chainage(result, legs.get(pipe), arrays["distance"][k])] if legs else []
        rows.append(
            [
                words,
                float(arrays[name][k]),
                envelope_column(result, name).unit,
                pipe,
                float(arrays["distance"][k]),
                *chainage,
                float(arrays["elevation"][k]),
                float(arrays[when][k]),
            ]
        )
    units = [
        envelope_column(result, key).unit for key in ("distance", *["distance"] * bool(legs), "elevation", "t_max")
    ]
    heads = ("", "value", "unit", "pipe", "from its start", *["chainage"] * bool(legs), "elevation", "time")
    return ReportTable("Worst of all pipes", heads, rows, ("",) * 4 + tuple(units), mixed_units=frozenset({1}))


def ranked_pipes(result) -> list[ReportTable]:
    """Tables of pipes ranked by greatest and by least pressure, worst first; [] for a single pipe or a diverged run."""
    if len(result.envelope) < 2 or not_valid(result.summary):
        return []
    return [_ranking(result, name, words, most, when) for name, words, most, when in EXTREMES[:2]]


def _ranking(result, name: str, words: str, most, when: str) -> ReportTable:
    rows = []
    for pipe, arrays in result.envelope.items():
        k = int(most(arrays[name]))
        rows.append([pipe, *(float(arrays[key][k]) for key in (name, "distance", "elevation", when))])
    rows.sort(key=lambda row: row[1], reverse=most is np.argmax)
    units = ["", *(envelope_column(result, key).unit for key in (name, "distance", "elevation", when))]
    heads = ("pipe", words, "from its start", "elevation", "time")
    return ReportTable(f"{words.capitalize()} by pipe", heads, rows, units, most=MAX_RANKED,
                 more="in envelope.csv and in the workbook (--xlsx)")  # fmt: skip


def extremes_of_probes(result) -> ReportTable | None:
    """Table of the extremes of each probe over all accepted steps, with times and errors; None without probes."""
    peaks, rows, invalid = result.summary.get("peaks", {}), [], not_valid(result.summary) or None
    clock = UnitColumn("t", "time", result.summary["time_unit"])
    for name, extremes in result.extremes.items():
        errors = {side: [peaks[name][side]["error"]] if peaks else [] for side in ("minimum", "maximum")}
        first, last = (in_unit(clock, t) for t in (extremes.t_min, extremes.t_max))
        low, high = (invalid if value is None else value for value in (extremes.minimum, extremes.maximum))
        rows.append([name, result.units[name], low, *errors["minimum"], first, high, *errors["maximum"], last])
    heads = [column for side in ("minimum", "maximum") for column in (side, *[ERROR_HEADER] * bool(peaks), "time")]
    units = [clock.unit if column == "time" else "" for column in heads]
    loose = frozenset(2 + k for k, column in enumerate(heads) if column != "time")
    return ReportTable("Probes", ("probe", "unit", *heads), rows, ("", "", *units), mixed_units=loose,
                 more="in summary.json and in the workbook (--xlsx)") if rows else None  # fmt: skip


def _chainage(result, leg: Leg | None, distance: float) -> float | None:
    """Chainage of a point at a distance from the start of a pipe, in the units of the envelope.

    leg : leg of the pipe in a section, or None: then the result is None
    """
    shown = envelope_column(result, "distance")
    return None if leg is None else float(shown.from_si(leg.chainage(shown.to_si(distance))))
