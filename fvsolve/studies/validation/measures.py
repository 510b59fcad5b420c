"""Values that rows of a validation compute from runs: extremes, crossing times, differences from measured series."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import trapezoid

from fvsolve import exact as exact_solutions
from fvsolve.case.validation_table import (
    CROSSING,
    DIFFERENCE,
    ERRORS,
    EXACT,
    OF_SERIES,
    PROFILE,
    PROFILE_KEYS,
    Measure,
    Row,
)
from fvsolve.core.output.unit_columns import UnitColumn, column
from fvsolve.core.run import model_of
from fvsolve.errors import FvsolveError
from fvsolve.exact import shallow_water
from fvsolve.parts.csv_rows import read_rows
from fvsolve.studies.reference import initial_values

SHIFT_SHARE = 0.5  # a shift in time that leaves at most this share of the difference is named
MAX_SHIFT = 0.25  # greatest shift that is tried, as a fraction of the compared time
SHIFTS = 401  # number of shifts that are tried


class SeriesPair(NamedTuple):
    """Measured and computed series of a row over the times that count : float64[n] each; t [s], values in SI."""

    t: np.ndarray
    measured: np.ndarray
    computed: np.ndarray


def value_of(row: Row, run: Any) -> float:
    """Computed value of a row [SI], nan if it does not exist, such as the time of a value that is never passed.

    run : result of a run of the case
    """
    measure = row.measure
    if measure.function == PROFILE:
        return profile_error(run, measure.field)
    if measure.function in OF_SERIES:
        return difference(series_of(row, run), measure.function)
    if measure.run_up is not None:
        return run_up(measure, run)
    if measure.extent is not None or (
        measure.function in ("max", "min") and row.from_ is None and row.to is None
    ):
        return extreme(row, run)
    t, values = window(row, run.seconds, run.si(measure.probe.text))
    if not len(t):
        return np.nan
    if measure.function == CROSSING:
        return crossing_time(t, values, measure.argument)
    if measure.function == "at":
        return (
            float(np.interp(measure.argument, t, values))
            if t[0] <= measure.argument <= t[-1]
            else np.nan
        )
    if measure.function == "mean":
        return float(trapezoid(values, t) / (t[-1] - t[0])) if t[-1] > t[0] else float(values[-1])
    return {"max": values.max, "min": values.min, "final": lambda: values[-1]}[measure.function]()


def run_up(measure: Measure, run: Any) -> float:
    """Greatest or least run-up, or that of the sector at an angle [deg] or distance [m] [m]."""
    table = run.run_up[measure.run_up.name]
    if measure.function != "at":
        return float({"max": np.nanmax, "min": np.nanmin}[measure.function](table["run_up"]))
    along = next(values for key, values in table.items() if key in ("angle", "distance"))
    gap = np.abs(along - measure.run_up.place)
    gap = np.minimum(gap, 360.0 - gap) if "angle" in table else gap
    return float(table["run_up"][int(np.argmin(gap))])


def extreme(row: Row, run: Any) -> float:
    """Extreme of a probe over all steps, or of a quantity over parts [SI]."""
    measure, side = row.measure, {"max": "maximum", "min": "minimum"}[row.measure.function]
    if measure.extent is None:
        return float(
            run.column(measure.probe.text).to_si(getattr(run.extremes[measure.probe.text], side))
        )
    found = [
        getattr(run.extremes[probe.text], side)
        for probe in measure.extent.probes(run.case.links)
        if probe.text in run.extremes
    ]
    return float(max(found) if measure.function == "max" else min(found))


def window(row: Row, t: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times and values between the first and the last time that count."""
    counts = np.full(len(t), True)
    counts &= True if row.from_ is None else t >= row.from_
    counts &= True if row.to is None else t <= row.to
    return t[counts], values[counts]


def crossing_time(t: np.ndarray, values: np.ndarray, level: float) -> float:
    """First time at which a series passes a level in either direction, linear between rows; nan if it never does."""
    above = values >= level
    places = np.flatnonzero(above[1:] != above[:-1])
    if not len(places):
        return np.nan
    k = places[0]
    share = (level - values[k]) / (values[k + 1] - values[k])
    return float(t[k] + share * (t[k + 1] - t[k]))


def series_of(row: Row, run: Any) -> SeriesPair:
    """Measured and computed series of a row at the measured times. Raises FvsolveError if no measured time counts."""
    name, computed_t = row.measure.probe.text, run.seconds
    series = measured_series(run.case, row.measure.probe)
    if series is None:
        exact = exact_solutions.solution(run.case, initial_values(model_of(run.case)))
        t, computed = window(row, computed_t, run.si(name))
        return SeriesPair(t, exact.probe(row.measure.probe, t), computed)
    t, measured = window(row, series.t + series.shift, series.v)
    inside = (t >= computed_t[0]) & (t <= computed_t[-1])
    if inside.sum() < 2:
        raise FvsolveError(
            f"{row.what}: {series.file} has no two rows between the times that count"
        )
    t, measured = t[inside], measured[inside]
    return SeriesPair(t, measured, np.interp(t, computed_t, run.si(name)))


def measured_series(case: Any, probe: Any) -> Any:
    """Series in `[compare]` of a case for a probe, None without one."""
    return next((item for item in case.compare.values() if item.probe.text == probe.text), None)


def difference(series: SeriesPair, function: str) -> float:
    """Difference of two series: `rms_difference` in SI, the others relative to the range of the measured series."""
    gap = np.abs(series.computed - series.measured)
    if function == DIFFERENCE:
        return float(np.sqrt(np.mean(gap**2)))
    if np.ptp(series.measured) == 0.0:
        raise FvsolveError(
            "the measured series is constant over the times that count; expected other times"
        )
    size = {
        "mean_error": gap.mean(),
        "rms_error": np.sqrt(np.mean(gap**2)),
        "greatest_error": gap.max(),
    }[function]
    return float(size / np.ptp(series.measured))


def best_shift(row: Row, run: Any) -> tuple[float, float]:
    """Shift of the computed series [s] with the least difference, positive if it is early, and that difference.

    The shift is 0 if no shift leaves at most `SHIFT_SHARE` of the difference without shift.
    """
    name, function = row.measure.probe.text, row.measure.function
    series = series_of(row, run)
    own = difference(series, function)
    span = MAX_SHIFT * (series.t[-1] - series.t[0])
    shifts = np.linspace(-span, span, SHIFTS)
    t, values = run.seconds, run.si(name)
    sizes = [
        difference(series._replace(computed=np.interp(series.t - shift, t, values)), function)
        for shift in shifts
    ]
    best = int(np.argmin(sizes))
    return (float(shifts[best]), sizes[best]) if sizes[best] <= SHIFT_SHARE * own else (0.0, own)


def lines_of(row: Row, run: Any) -> dict[str, np.ndarray]:
    """Lines for a figure of a row : name -> float64[n, 2], times [s] or places [m] and values in units of `[output]`.

    Names are "measured", "exact" or that of the row, and "computed"; the result is {} for a probe without measurement.
    """
    measure = row.measure
    series = None if measure.probe is None else measured_series(run.case, measure.probe)
    if series is not None or measure.function in OF_SERIES:
        pair = series_of(replace(row, from_=None, to=None), run)
        shown = column("", measure.probe.dimension, run.case, measure.probe.unit)
        inside = (run.seconds >= pair.t[0]) & (run.seconds <= pair.t[-1])
        computed = np.column_stack([run.seconds, shown.from_si(run.si(measure.probe.text))])[inside]
        published = row.gate["of"] == EXACT and (row.exact or {}).get("resolution") is None
        name = row.series or ("exact" if series is None or published else "measured")
        return {name: np.column_stack([pair.t, shown.from_si(pair.measured)]), "computed": computed}
    if measure.run_up is not None:
        table = run.run_up[measure.run_up.name]
        along = next(values for key, values in table.items() if key in ("angle", "distance"))
        if len(along) == 1:
            return {}
        return {"computed": np.column_stack([along, table["run_up"]])} | {
            name: curve_of(run.case.folder / file) for name, file in row.curves.items()
        }
    if measure.function != PROFILE:
        return {}
    basin, quantity = measure.field
    x = run.case.meshes[basin].centre[:, 0]
    line = np.unique(x, return_index=True)[1]  # one cell of each column
    exact = exact_field(run, x[line], quantity)
    computed = end_field(run.last_frame[basin], quantity)[line]
    return {
        "exact": np.column_stack([x[line], exact]),
        "computed": np.column_stack([x[line], computed]),
    }


def curve_of(path: Path) -> np.ndarray:
    """Places and values of a CSV file with two columns, by rising places : float64[n, 2]."""
    try:
        rows = read_rows(path)
        table = np.column_stack([rows.plain(0), rows.plain(rows.column(None, 1))])
    except ValueError as error:
        raise FvsolveError(f"validation.compare.curves: {error}") from None
    return table[np.argsort(table[:, 0])]


def profile_error(run: Any, field: tuple[str, str]) -> float:
    """Mean error of a field of a basin at the end of a run, over the mean magnitude of the exact field, by areas.

    Cells in which the exact field is unknown do not count.
    """
    basin, quantity = field
    mesh = run.case.meshes[basin]
    exact = exact_field(run, mesh.centre[:, 0], quantity)
    computed = end_field(run.last_frame[basin], quantity)
    area = np.where(np.isnan(exact), 0.0, mesh.area)
    gap = np.abs(computed - np.nan_to_num(exact))
    return float(np.sum(gap * area) / np.sum(np.abs(np.nan_to_num(exact)) * area))


def exact_field(run: Any, x: np.ndarray, quantity: str) -> np.ndarray:
    """Exact field at places x [m] at the end of a run, nan outside the keys `from` and `to` of the profile."""
    given = run.case.validation.profile
    values = getattr(profile(given, x, run.summary["t"]), quantity)
    return np.where(
        (x >= given.get("from", -np.inf)) & (x <= given.get("to", np.inf)), values, np.nan
    )


def profile(given: Mapping[str, Any], x: np.ndarray, t: float) -> shallow_water.Flow:
    """Exact fields at places x [m] and time t [s]; given : table `profile` of a validation"""
    data = {
        key: float(value) for key, value in given.items() if key not in ("solution", *PROFILE_KEYS)
    }
    return shallow_water.SOLUTIONS[given["solution"]](x, t, **data)


def end_field(frame: Mapping[str, np.ndarray], quantity: str) -> np.ndarray:
    """Values of a quantity in the cells of a basin : float64[cells]; frame : fields of the basin by name"""
    u = frame["velocity"][:, 0]
    return (
        {"u": u, "discharge": u * frame["depth"]}.get(quantity)
        if quantity in ("u", "discharge")
        else frame[quantity]
    )


def shown_in(row: Row, case: Any) -> UnitColumn:
    """Unit in which tables show the values of a row: that of `[output]`; none for a ratio."""
    measure = row.measure
    target = measure.probe or measure.extent or measure.run_up
    if target is None or measure.function in ERRORS:
        return UnitColumn("", "number", "")
    if measure.function == CROSSING:
        return column("", "time", case)
    return column("", target.dimension, case, getattr(target, "unit", ""))


def unit_of_lines(row: Row, case: Any) -> str:
    """Unit of the values in `lines_of`; "-" for a number without unit."""
    probe, field = row.measure.probe, row.measure.field
    if field is not None:
        return {"u": "m/s", "discharge": "m2/s"}.get(field[1], "m")
    return "-" if probe is None else column("", probe.dimension, case, probe.unit).unit or "-"
