"""Comparison of a run with its case: extremes, design limits, expected values, measured series; and of two runs."""

import math
from typing import Any, NamedTuple

import numpy as np

from fvsolve.case.claims import VACUUM
from fvsolve.case.pipe_routes import Leg, is_cut, legs, pipe_leg
from fvsolve.case.probe import OF_PRESSURE
from fvsolve.core.output.csv_files import with_points
from fvsolve.core.output.summary_shape import FAILS, HOLDS, OPEN, Comparison
from fvsolve.core.output.unit_columns import UnitColumn, column, probe_columns

ENVELOPE_KEYS = ("distance", "elevation", "min_pressure", "t_min", "max_pressure", "t_max")
# relative to a limit and the typical size of its quantity; a smaller excess is within the limit
ROUNDING = 1e-9
SIZES = {"pressure": 1e5, "gauge_pressure": 1e5, "head": 10.0, "pressure_head": 10.0}
MAGNITUDES = ("velocity", "force")  # quantities of which a limit bounds the magnitude
# least number of common times of two compared runs, and share in the shorter run
FEWEST_COMMON, COMMON = 3, 0.1
# relative to a vapour pressure, within which a limit counts as equal to it: a cavity keeps about that much
NEAR = 1e-3
WORST = 10  # places that a limit lists
STATES = (FAILS, OPEN, HOLDS)  # worst first
SHARED = ("name", "quantity", "until")  # keys with one value for all places of a limit
PLACES_KEY = "beside"  # key of a row that is not written to files: all places of its part and bound


class PartExtremes(NamedTuple):
    """Extremes at the n recorded positions of a part : float64[n] each; n is 1 except for pipes.

    distance : from the `from` end of a pipe [m], nan for other parts; elevation [m]
    minimum, maximum : extremes over all steps [SI, pressures absolute]; t_min, t_max : their times [s]
    """

    group: str
    part: str
    distance: np.ndarray
    elevation: np.ndarray
    minimum: np.ndarray
    t_min: np.ndarray
    maximum: np.ndarray
    t_max: np.ndarray


def part_extremes(model, summary, extent) -> list[PartExtremes]:
    """Extremes of every part of an extent; quantities of pressure as absolute pressures.

    Extremes from the time at which a diverged run is not valid are nan.
    """
    is_pressure = extent.quantity in OF_PRESSURE
    pipes = {pipe.name: pipe for pipe in model.pipes}
    quantity = "pressure" if is_pressure else extent.quantity
    rows: dict[str, list] = {}  # watched probes along pipes
    for probe in model.watched:
        if probe.straight and probe.quantity == quantity:
            rows.setdefault(probe.name, []).append(probe)
    parts = []
    for group, name in extent.parts:
        if group == "links" and is_pressure and name in summary.envelope:
            cells = {key: summary.envelope[name][key] for key in ENVELOPE_KEYS}
            parts.append(PartExtremes(group, name, *with_points(summary, name, cells).values()))
        elif group == "links" and name in rows:
            # probes of which only extremes are recorded
            fraction = np.array([probe.fraction for probe in rows[name]])
            distance = fraction * model.case.links[name].length
            height = (
                pipes[name].height(distance)
                if name in pipes
                else model.case.axis_elevation(name, fraction)
            )
            found = np.array([summary.watched[probe.text] for probe in rows[name]])
            parts.append(PartExtremes("links", name, distance, height, *found.T))
        else:
            z = model.elevation.get(name, np.nan) if group == "nodes" else np.nan
            extremes = summary.watched[f"{group}.{name}.{quantity}"]
            parts.append(
                PartExtremes(
                    group, name, np.array([np.nan]), np.array([z]), *np.array([extremes]).T
                )
            )
    isolated = model.isolated if is_pressure else ()
    known = []
    for part in parts:
        # if something determined the pressure of an isolated node
        recorded = not np.all(part.minimum == np.inf)
        if recorded and f"{part.group}.{part.part}" not in isolated:
            known.append(part)
    parts = known or parts
    return (
        parts
        if np.isinf(summary.invalid_from)
        else [valid(probe, summary.invalid_from) for probe in parts]
    )


def valid(part: PartExtremes, until: float) -> PartExtremes:
    """Copy of the extremes of a part, with nan for those that occurred at the time `until` [s] or later."""
    sides = {
        side: np.where(getattr(part, f"t_{side[:3]}") < until, getattr(part, side), np.nan)
        for side in ("minimum", "maximum")
    }
    return part._replace(**sides)


def in_quantity(model, quantity: str, pressure, elevation):
    """Convert absolute pressures [Pa] to the quantity "pressure", "gauge_pressure", "head" or "pressure_head" [SI].

    elevation : elevation of the points [m]
    """
    if quantity == "pressure":
        return pressure
    if quantity == "gauge_pressure":
        return pressure - model.case.ambient_pressure
    head = model.head(pressure, elevation)
    return head if quantity == "head" else head - elevation


def pressure_of(model, quantity: str, value: float, elevation):
    """Absolute pressure [Pa] from a value of "pressure", "gauge_pressure", "head" or "pressure_head" [SI].

    elevation : elevation of the points [m]. The result is nan below the minimum pressure of the fluid.
    """
    if quantity == "pressure":
        return value
    if quantity == "gauge_pressure":
        return value + model.case.ambient_pressure
    return model.case.law.pressure_under(value - elevation if quantity == "head" else value)


class Nearest(NamedTuple):
    """Position in a part with the least margin under one bound of a limit [SI].

    margin : distance from the limit, negative beyond it; bound : "minimum" or "maximum"; at : index of the position
    margins, limits : float64[n]  margin and limit at all positions of the part
    """

    margin: float
    value: float
    limit: float
    bound: str
    time: float
    part: PartExtremes
    at: int
    state: str
    margins: np.ndarray  # of all places of the part
    limits: np.ndarray


class PlaceMargins(NamedTuple):
    """Probes at all positions of a part, with limits and margins there for one bound, in the unit of the limit."""

    probes: list[str]
    limits: np.ndarray
    margins: np.ndarray


def verdicts(model, summary) -> list[dict[str, Any]]:
    """Verdict on every limit of the case, in units of `[output]`, with its worst parts."""
    return [verdict(rows) for rows in places(model, summary, margins=False)]


def places(model, summary, margins=True) -> list[list[dict[str, Any]]]:
    """Rows for every limit of the case: for each part and each bound a dict on the position with the least margin.

    If a limit is not exceeded but the run is not ok, has marks, or ends before a schedule does, the state is open.
    margins : True if the rows are to have the margins at all positions, `PLACES_KEY`
    """
    chainage = Chainages(model.case)
    complete = bool(
        summary.ok
        and not summary.marks
        and not any(notice.kind == "end" for notice in model.case.notices)
    )
    tables = []
    for limit in model.case.limits.values():
        extent = limit.extent
        shown = column(
            extent.quantity,
            "head" if extent.quantity == "pressure_head" else extent.dimension,
            model.case,
        )
        shared = {"name": limit.name, "quantity": extent.quantity, "until": float(summary.t)}
        rows = []
        for part in part_extremes(model, summary, extent):
            for row in nearest(model, summary, limit, part, complete):
                all_places = (
                    {PLACES_KEY: place_margins(model, extent, shown, row)} if margins else {}
                )
                rows.append(row_of(row, shown, chainage, extent) | shared | all_places)
        tables.append(rows)
    return tables


def verdict(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Verdict on a limit, from its rows of `places`: the worst row, with the list `worst` of the worst rows added."""
    rows = [{key: value for key, value in row.items() if key != PLACES_KEY} for row in rows]
    rows.sort(
        key=lambda row: (
            STATES.index(row["state"]),
            -math.inf if row["margin"] is None else row["margin"],
        )
    )
    listed = [
        {key: value for key, value in row.items() if key not in SHARED} for row in worst(rows)
    ]
    return {**rows[0], "ok": rows[0]["state"] == HOLDS, "worst": listed}


def worst(rows: list[dict]) -> list[dict]:
    """First `WORST` of the sorted rows, and the first row of each bound if it is not among them."""
    first = {row["bound"]: row for row in reversed(rows)}
    return [*rows[:WORST], *(row for row in first.values() if row not in rows[:WORST])]


def nearest(model, summary, limit, part: PartExtremes, complete: bool):
    """Yield, for every bound of a limit, the position in a part with the least margin.

    A position with unknown value has a margin just within rounding. If the minimum is the cavity pressure and fails,
    the position of the first cavity of the pipe is yielded instead.
    complete : True if the run can decide that a limit holds
    """
    quantity = limit.extent.quantity
    both = zip(("minimum", "maximum"), extremes(model, quantity, part), (1.0, -1.0), strict=True)
    for bound, (values, times), sign in both:
        bounds = allowed(model, limit, bound, part)
        if bounds is None:
            continue
        bounds = np.broadcast_to(np.asarray(bounds, float), values.shape)
        margin = sign * (values - bounds)
        tolerance = ROUNDING * (abs(bounds) + SIZES.get(quantity, 0.0))
        unknown = np.isnan(margin) | (margin == np.inf)
        at = int(np.argmin(np.where(unknown, -tolerance, margin)))
        state = (
            FAILS
            if margin[at] < -tolerance[at]
            else HOLDS
            if complete and not unknown[at]
            else OPEN
        )
        if (
            state == FAILS
            and bound == "minimum"
            and bounds[at] == cavity_of(model, quantity, part.elevation[at])
        ):
            at = first_cavity(summary, part, margin, at)
        yield Nearest(
            float(margin[at]),
            float(values[at]),
            float(bounds[at]),
            bound,
            float(times[at]),
            part,
            at,
            state,
            margin,
            bounds,
        )


def place_margins(model, extent, shown: UnitColumn, row: Nearest) -> PlaceMargins:
    """Limits and margins at all positions of the part of a row.

    The probe for a pressure head is that of the head, so that its limit is increased by the elevation.
    """
    part, above = row.part, extent.quantity == "pressure_head"
    text = f"{part.group}.{part.part}.{'head' if above else extent.quantity}"
    shares = part.distance / getattr(model.case.links.get(part.part), "length", np.nan)
    texts = [
        text if np.isnan(share) else f"{text}@{min(max(float(share), 0.0), 1.0)!r}"
        for share in shares
    ]
    limits = row.limits + (part.elevation if above else 0.0)
    return PlaceMargins(
        texts, np.asarray(shown.from_si(limits)), np.asarray(shown.span_from_si(row.margins))
    )


def allowed(model, limit, bound: str, part: PartExtremes):
    """Limit at each position of a part [SI], for the bound "minimum" or "maximum"; None if the limit lacks this bound.

    Under `cavitation` no pressure falls below the vapour pressure. A minimum at or below it is replaced by the pressure
    below which a position counts as a cavity.
    """
    case = model.case
    quantity = limit.extent.quantity
    value = getattr(limit, bound)
    if bound == "maximum" and limit.class_fraction is not None:
        value = limit.class_fraction * case.links[part.part].allowable_pressure
        return in_quantity(model, quantity, value + case.ambient_pressure, part.elevation)
    if isinstance(value, str):
        pressure = case.ambient_pressure if value == VACUUM else case.law.cavity_pressure
        return in_quantity(model, quantity, pressure, part.elevation)
    if value is None or bound == "maximum" or quantity not in OF_PRESSURE or not case.law.cavitates:
        return value
    above = (
        pressure_of(model, quantity, value, part.elevation)
        > (1.0 + NEAR) * case.properties.vapor_pressure
    )
    return np.where(above, value, cavity_of(model, quantity, part.elevation))


def cavity_of(model, quantity: str, elevation):
    """Value of a pressure or head [SI] below which a position counts as a cavity.

    elevation [m]. The result is nan for other quantities and for density laws without cavities.
    """
    if quantity not in OF_PRESSURE or not model.case.law.cavitates:
        return np.nan
    return in_quantity(model, quantity, model.case.law.cavity_pressure, elevation)


def first_cavity(summary, part: PartExtremes, margin: np.ndarray, at: int) -> int:
    """Index of the position where the first cavity of a pipe opened, if the limit is exceeded there; else `at`."""
    distance = next(
        (
            cavity.distance
            for cavity in summary.cavities
            if cavity.place == f"{part.group}.{part.part}"
        ),
        np.nan,
    )
    place = int(np.argmin(abs(part.distance - distance))) if math.isfinite(distance) else at
    return place if margin[place] < 0.0 else at


def extremes(model, quantity: str, part: PartExtremes):
    """Pairs (values [SI], times [s]) of the least and greatest values of a quantity at all positions of a part.

    Values of velocities and forces are magnitudes; the least is 0, at the time nan, where the sign changes.
    """
    if quantity in OF_PRESSURE:
        low, high = (
            in_quantity(model, quantity, pressures, part.elevation)
            for pressures in (part.minimum, part.maximum)
        )
        return (low, part.t_min), (high, part.t_max)
    if quantity not in MAGNITUDES:
        return (part.minimum, part.t_min), (part.maximum, part.t_max)
    changes_sign = (part.minimum <= 0.0) & (part.maximum >= 0.0)
    reversed = -part.minimum > part.maximum
    low = np.where(changes_sign, 0.0, np.minimum(abs(part.minimum), abs(part.maximum)))
    t_low = np.where(changes_sign, np.nan, np.where(reversed, part.t_max, part.t_min))
    high = np.where(reversed, -part.minimum, part.maximum)
    t_high = np.where(reversed, part.t_min, part.t_max)
    return (low, t_low), (high, t_high)


class Chainages:
    """Chainages of positions: along a route that the limit names, else along another route, else along the pipe."""

    def __init__(self, case) -> None:
        self.case = case
        self.legs = {name: legs(route, case.links) for name, route in case.routes.items()}

    def of(self, part: PartExtremes, at: int, on: tuple[str, ...]) -> float | None:
        """Chainage of position `at` of a part [m]; None for a node on no route, and for a link other than a pipe.

        on : names of routes in the limit
        """
        if part.group == "links":
            distance = part.distance[at]
            return (
                float(self.leg(part.part, on).chainage(distance))
                if math.isfinite(distance)
                else None
            )
        for name in self.ordered(on):
            for leg in self.legs[name]:
                link = self.case.links[leg.pipe]
                if part.part in (link.from_, link.to):
                    return float(leg.chainage(0.0 if part.part == link.from_ else link.length))
        return None

    def leg(self, pipe: str, on: tuple[str, ...]) -> Leg:
        """Leg (pipe with chainages and direction) of a pipe for chainages; on : names of routes in the limit."""
        result = next(
            (leg for name in self.ordered(on) for leg in self.legs[name] if leg.pipe == pipe), None
        )
        return pipe_leg(pipe, self.case.links) if result is None else result

    def ordered(self, on: tuple[str, ...]) -> list[str]:
        """Names of all routes in order of preference: routes that the limit names first, those of a cut pipe last."""
        return sorted(
            self.legs, key=lambda name: (is_cut(name, self.case.routes[name].pipes), name not in on)
        )


def row_of(row: Nearest, shown: UnitColumn, chainage: Chainages, extent) -> dict[str, Any]:
    """Dict for a position: part, chainage and elevation [m], time [s]; value, limit, margin in the unit of `shown`."""
    part = row.part
    at = row.at
    known = not math.isnan(row.margin)
    return {
        "place": part.part,
        "chainage": chainage.of(part, at, extent.on) if known else None,
        "elevation": finite(part.elevation[at]),
        "time": finite(row.time) if known else None,
        "bound": row.bound,
        "value": finite(shown.from_si(row.value)),
        "limit": finite(shown.from_si(row.limit)),
        "margin": finite(shown.span_from_si(row.margin)),
        "unit": shown.unit,
        "error": None,
        "reason": None,
        "state": row.state,
    }


def finite(value) -> float | None:
    """Number for JSON; None if it is not finite."""
    return float(value) if math.isfinite(value) else None


def comparison(compare, column: UnitColumn, result) -> dict:
    """Entry of the summary for one measured series: differences at the measured times in the run, and both peaks.

    compare : series of the case; column : unit of its probe. Differences are computed minus measured values; they and
    the peaks are in the unit of the probe, times in s. All are None if no measured time is within the run.
    """
    t, computed = result.seconds, result[column.name]
    time, measured = compare.t + compare.shift, column.from_si(compare.v)
    within = (time >= t[0]) & (time <= t[-1]) if len(t) else np.zeros(len(time), bool)
    time, measured = time[within], measured[within]
    head = [column.name, column.unit, compare.file, float(compare.shift), len(time)]
    if not len(time):
        return dict.fromkeys(Comparison._fields) | dict(zip(Comparison._fields, head, strict=False))
    difference = interpolated(t, computed, time) - measured
    overlap = (t >= time.min()) & (t <= time.max())
    peak, top = int(np.argmax(measured)), int(np.argmax(np.where(overlap, computed, -np.inf)))
    worst = int(np.argmax(np.abs(difference)))
    values = [np.sqrt(np.mean(difference**2)), difference[worst], time[worst]]
    values += [measured[peak], time[peak], computed[top], t[top]]
    return dict(zip(Comparison._fields, [*head, *map(float, values)], strict=True))


def interpolated(t: np.ndarray, values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Values at `times`, linear between rows (t, values); at a jump (two rows at one time) the value of the later row.

    Beyond the rows they are those of the first and last row.
    """
    times = np.asarray(times, float)
    if len(t) == 1:
        return np.full(times.shape, values[0])
    after = np.minimum(np.maximum(t.searchsorted(times, side="right"), 1), len(t) - 1)
    before = after - 1
    start, gap = values[before], t[after] - t[before]
    part = np.where(gap > 0.0, (times - t[before]) / np.where(gap > 0.0, gap, 1.0), 1.0)
    exact = start + part * (values[after] - start)
    return np.where(part >= 1.0, values[after], np.where(part <= 0.0, start, exact))


def differences(a, b) -> dict:
    """Greatest and rms difference `b` - `a` of two results, for each probe that both have.

    The differences are in the units of `a`, at the times that both runs have. The greatest is that of the greatest
    magnitude, with its sign. With few common times (`FEWEST_COMMON`, `COMMON`), they are at those times of `a` that are
    within both runs, and values of `b` are interpolated; without such times they are None. "note" states which times
    are compared, "" for equal times. "only_a" and "only_b" list probes of one run only.
    """
    shared = [probe for probe in a.probes if probe in b.units]
    return {
        "a": str(a.directory),
        "b": str(b.directory),
        "note": _note(a.seconds, b.seconds),
        "probes": {probe: _difference(a, b, probe) for probe in shared},
        "only_a": [probe for probe in a.probes if probe not in b.units],
        "only_b": [probe for probe in b.probes if probe not in a.units],
    }


def _note(t: np.ndarray, theirs: np.ndarray) -> str:
    """Text that states which times of two runs are compared; "" for equal times."""
    if np.array_equal(t, theirs):
        return ""
    count = len(common_rows(t, theirs)[0])
    if count >= max(FEWEST_COMMON, COMMON * min(len(t), len(theirs))):
        return f"the rows of both runs differ: compared at their {count} common times of {len(t)} and {len(theirs)}"
    widest = float(np.diff(theirs).max(initial=0.0))
    return (
        f"the runs have {count} common times: values of the second run are interpolated between rows up to "
        f"{widest:.3g} s apart, so differences include those of this interpolation"
    )


def common_rows(t: np.ndarray, theirs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the rows of two runs at common times : int64[k], int64[k].

    At a jump (two rows at one time) both rows of one run belong to those of the other, or the later ones do.
    """
    if not t.size or not theirs.size:  # a run that stopped at its start
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    near = 1e-9 * max(np.abs(t).max(initial=0.0), np.abs(theirs).max(initial=0.0))
    rows: list[tuple[int, int]] = []
    later = [np.append(np.diff(x) > near, True) for x in (t, theirs)]
    for sides in (later, [~side for side in later]):  # all times; then the earlier rows of jumps
        ours, others = map(np.flatnonzero, sides)
        if others.size:
            at = np.minimum(np.searchsorted(theirs[others], t[ours] - near), others.size - 1)
            same = np.abs(theirs[others][at] - t[ours]) <= near
            rows += list(zip(ours[same].tolist(), others[at[same]].tolist(), strict=True))
    found = np.array(sorted(rows), dtype=np.int64).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def _difference(a, b, probe: str) -> dict:
    column = a.column(probe)
    other = b[probe] if a.units[probe] == b.units[probe] else column.from_si(b.si(probe))
    t = a.seconds
    ours = a[probe]
    theirs = b.seconds
    if not len(theirs):  # a run that stopped at its start
        t = t[:0]
        ours = ours[:0]
        theirs = theirs[:0]
    elif not np.array_equal(t, theirs):
        mine, same = common_rows(t, theirs)
        if len(mine) >= max(FEWEST_COMMON, COMMON * min(len(t), len(theirs))):
            t = t[mine]
            ours = ours[mine]
            other = other[same]
        else:
            within = (t >= theirs[0]) & (t <= theirs[-1])
            t, ours = t[within], ours[within]
            other = interpolated(theirs, other, t)
    difference = other - ours
    worst = int(np.argmax(np.abs(difference))) if len(t) else 0
    return {
        "unit": column.unit,
        "rows": len(t),
        "greatest": float(difference[worst]) if len(t) else None,
        "t_greatest": float(t[worst]) if len(t) else None,
        "rms": float(np.sqrt(np.mean(difference**2))) if len(t) else None,
    }


def claims(model, summary, result) -> dict:
    """Entries `expectations`, `verdicts` and `comparisons` of the summary of a run; also sets `result.places`."""
    columns = {column_.name: column_ for column_ in probe_columns(model)}
    case = model.case
    result.places = places(model, summary)
    return {
        "expectations": expectations(model, summary, result),
        "verdicts": [verdict(rows) for rows in result.places],
        "comparisons": [
            comparison(compare, columns[compare.probe.text], result)
            for compare in case.compare.values()
        ],
    }


def expectations(model, summary, result) -> list[dict]:
    """Entries of the summary for `[expect]`, in the order of the file."""
    columns = {column_.name: column_ for column_ in probe_columns(model)}
    first = min((mark.time for mark in summary.marks), default=math.inf)
    rows = []
    for text, expect in model.case.expect.items():
        if expect.run_up is not None:
            shown, time = column(text, expect.run_up.dimension, model.case), summary.t
            value = summary.run_ups[expect.run_up.name].value(expect.function, expect.run_up.place)
        elif expect.extent is None:
            shown = columns[expect.probe.text]
            value, time = _at_probe(expect, shown.name, summary, result)
        else:
            shown = column(text, expect.extent.dimension, model.case)
            value, time = _at_places(model, summary, expect)
        value = value if time < summary.invalid_from else math.nan
        rows.append(expectation(text, expect, shown, value, bool(summary.ok and time < first)))
    return rows


def expectation(text: str, expect, column: UnitColumn, value: float, complete: bool) -> dict:
    """Entry of the summary for one claim: claimed and found value and tolerance in the unit of `column`, and state.

    text, expect : name and data of the claim; value : value in the run [SI], not finite if unknown
    complete : True if the run is ok and valid at the time of the value; if False, a claim that is met is open
    `error` of the entry is None until an error estimate sets it.
    """
    tolerance = expect.atol + expect.rtol * abs(expect.value)
    known = math.isfinite(value)
    state = (
        FAILS
        if known and abs(value - expect.value) > tolerance
        else HOLDS
        if known and complete
        else OPEN
    )
    return {
        "text": text,
        "claimed": float(column.from_si(expect.value)),
        "found": float(column.from_si(value)) if known else None,
        "tolerance": float(column.span_from_si(tolerance)),
        "unit": column.unit,
        "state": state,
        "ok": state == HOLDS,
        "error": None,
    }


def _at_places(model, summary, expect) -> tuple[float, float]:
    """Greatest or least value [SI] in all parts of the extent of a claim, over all steps, and its time [s].

    It is nan if an extreme of a part is not valid.
    """
    extent, low = expect.extent, expect.function == "min"
    values, times = [], []
    for part in part_extremes(model, summary, extent):
        extreme = part.minimum if low else part.maximum
        times.append(part.t_min if low else part.t_max)
        values.append(
            in_quantity(model, extent.quantity, extreme, part.elevation)
            if extent.quantity in OF_PRESSURE
            else extreme
        )
    at = int((np.argmin if low else np.argmax)(np.concatenate(values)))
    return float(np.concatenate(values)[at]), float(np.concatenate(times)[at])


def _at_probe(expect, probe: str, summary, result) -> tuple[float, float]:
    """Value of a probe [SI] for a claim, and its time [s].

    `max` and `min` are over all steps and rows; `final` is the last row; `at` is interpolated between rows; `mean` is
    over time (trapezoids), with the end of the run as its time. The value is nan if there are no rows, and for an `at`
    outside their times.
    """
    if expect.function == "min":
        return summary.extremes[probe][:2]
    if expect.function == "max":
        return summary.extremes[probe][2:]
    t, values = result.seconds, result.si(probe)
    if not len(t):
        return math.nan, summary.t
    if expect.function == "final":
        return float(values[-1]), summary.t
    if expect.function == "at":
        inside = t[0] <= expect.time <= t[-1]
        return float(
            interpolated(t, values, np.array([expect.time]))[0]
        ) if inside else math.nan, expect.time
    span = t[-1] - t[0]
    area = np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(t))
    return float(area / span) if span > 0.0 else float(values[0]), summary.t
