"""Error bounds of peaks and limit margins, from runs at half, one and twice the resolution.

The error of the margin of a design limit is bounded from the signals at some places of each part to which the limit
applies. With column separation no order of convergence is assumed, because peaks after cavity collapse converge slowly
(docs/fluids.md). Without cells, a peak between two rows of output is higher than the rows by up to an eighth of
their second difference.

Each error is bounded from the local maxima of a signal. A local maximum has the values c, m and f at half, one and
twice the resolution. Their differences are a = m - c and b = f - m, with the ratio r = |b| / |a|, limited to the range
from 1/4 (order 2) to 0.6 (order 3/4). The remainder of a maximum bounds the change of m by all finer resolutions. It is
2.15 times the larger of |b| / (1 - r) and |a| r / (1 - r), with 1 - r = 0.4 if a and b differ in sign. If the
differences have the same sign and grow, it is multiplied by |b| / |a|, at most by 2.

The error bound follows from all local maxima m with their remainders, because a lower maximum may come to exceed the
greatest. Remainders at places other than that of the greatest value are multiplied by 0.6. The ratio of the mean
differences of whole signals shows how far they have converged. If it is small, half of this bound is enough. The bound
is at least the larger of two terms: a fifth of the mean difference of all maxima, and the difference between the
signals at the times of their greatest values, because a moving crest may still grow. Both terms are limited to 16 times
the difference of the greatest value. The ratio r of the greatest value may be small by chance, so the bound is also at
least 1.6 / 2.15 of its remainder with the ratio of whole signals. The constants were chosen so that the bound holds for
random mains (benchmarks/peak_bands.py --random) and its median is least.

Arguments of several functions : runs, results at all resolutions, as from `refined_runs`; triple, values at half, one
and twice the resolution
"""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from fvsolve.case import load
from fvsolve.case.probe import OF_PRESSURE
from fvsolve.core.model.start_notices import LEAST_CELLS, answering_parts
from fvsolve.core.output.summary_shape import OPEN
from fvsolve.core.output.unit_columns import probe_columns
from fvsolve.core.run import Result, run
from fvsolve.core.run.verdicts import MAGNITUDES, PLACES_KEY, PlaceMargins, in_quantity, verdict
from fvsolve.errors import CaseError, listing
from fvsolve.parts.schedule import Schedule
from fvsolve.studies.line_reference import line_references
from fvsolve.studies.outcome import NO_FIELDS, study_model
from fvsolve.studies.resolution import (
    basins_from_files,
    cell_counts,
    delay_lines,
    fixed_choices,
    pipes,
    pipes_with_cells,
    refined_keys,
    scaled,
)
from fvsolve.studies.separated_peaks import first_peak, separate_maxima, separated_error

LEVELS = (0.5, 1.0, 2.0)
FINEST = 4.0  # greatest resolution, with column separation
# least relative error, from iterations, interpolated rows and nearly decayed oscillations
RELATIVE_FLOOR = 5e-6
# rounding error relative to the greatest value in that unit (for angles at least 1 rad)
ROUNDING = 1e-12
SIGNS = {"minimum": -1.0, "maximum": 1.0}
SIDES = tuple(SIGNS)
# limits of the number of rows of signals, at the resolution of the run itself
MIN_ROWS, MAX_ROWS = 500, 4000
PLACES_PER_PART = 12  # greatest number of places of a part with signals, under a bound
MAX_PLACES = 400  # greatest number of places with signals, of all limits
Signal = tuple[np.ndarray, np.ndarray]  # times and values
Part = tuple[str, str]  # group and name
# accumulated error of steps between jumps of delay lines, in tolerances of a step
MANY_STEPS = 20.0
# effect of jumps below a quarter of numerics.delay_tolerance, smoothed over a step, over that key
SMOOTHED = 0.05
# cells recommended for a pipe, and for the travel time of a short pipe in its neighbour
MIN_CELLS = 4
REFERENCE_ROWS = 4.0  # rows of references for each row of the run
REFERENCE_SAFETY = 1.5  # factor on the difference of both references
DIFFERENCE_SAFETY = 1.2  # factor on the difference to the second reference
# fraction of the greatest relative difference of both references that counts for every peak
SPREAD_SHARE = 0.5
MOST_SPREAD = 0.02  # limit of this difference: a single chaotic signal does not widen all bands
LINES_TEXT, FINEST_TEXT = "delay lines with short steps", f"{FINEST:g} times the resolution"
MAX_NAMES = 3  # greatest number of names in a text
WIDE_ERROR = 0.05  # error relative to the span of a signal above which a reason is given
SMALL_DIFFERENCE = 0.1  # differences below this fraction of an error are not its cause


# reasons of unknown or wide errors -----------------------------------------------------------------------------------


def short_pipes(case: Any) -> dict[str, tuple[str, int]]:
    """Pipes that a wave crosses faster than a neighbour's cell : pipe -> (neighbour, number of cells that it needs)."""
    pipes, short = pipes_with_cells(case), {}
    travel = {name: pipe.length / case.wave_speed(name) for name, pipe in pipes.items()}
    by_node: dict[str, list[str]] = {}
    for name, pipe in pipes.items():
        for node in (pipe.from_, pipe.to):
            by_node.setdefault(node, []).append(name)
    for name, pipe in pipes.items():
        for neighbour in (*by_node[pipe.from_], *by_node[pipe.to]):
            if travel[neighbour] / pipes[neighbour].cells > travel[name]:
                short[name] = neighbour, math.ceil(MIN_CELLS * travel[neighbour] / travel[name])
    return short


def pulse_width(value: Any) -> float:
    """Shortest time in which a scheduled value rises and falls, or falls and rises [s]; inf if it never does.

    It is also inf for a harmonic schedule, and for a value that is not a `Schedule`.
    """
    if not isinstance(value, Schedule) or value.wave or len(value.time) < 3:
        return np.inf
    changes = np.flatnonzero(np.diff(value.value))
    turns = [
        (a, b)
        for a, b in zip(changes, changes[1:], strict=False)
        if np.prod(np.diff(value.value)[[a, b]]) < 0.0
    ]
    return min((float(value.time[b + 1] - value.time[a]) for a, b in turns), default=np.inf)


class Unresolved:
    """Reasons of unknown or wide errors of the peaks of a case, each with a remedy.

    unknown : (group, name) of a part -> reason for which the errors of its peaks are unknown
    shared : reasons of wide errors that concern all peaks
    tolerance : accumulated error of the steps of delay lines under error control, or error of the references, relative
    to the range of a signal
    """

    def __init__(self, case: Any, runs: dict[float, Any], references: dict[int, Any]) -> None:
        self.case, self.runs = case, runs
        self.unknown = unknown_parts(case)
        self.tolerance = 0.0
        self.vapor = VaporValues(case) if has_separation(runs) and case.law.cavitates else None
        if is_pair(references):
            self.tolerance = SPREAD_SHARE * greatest_spread(references)
        elif case.numerics.rtol is not None and delay_lines(case):
            self.tolerance = max(
                MANY_STEPS * case.numerics.rtol, SMOOTHED * case.numerics.delay_tolerance
            )
        liquid = (
            ["column separation, so no order is assumed; use more cells"]
            if has_separation(runs)
            else []
        )
        self.shared = [*liquid, *differing_events(runs), *coarse_pipes_at_devices(case)]

    def ceiling(self, probe: str) -> float:
        """Negative of the least possible value of a probe, in its unit; inf unless vapour bounds it."""
        return math.inf if self.vapor is None else self.vapor.ceiling(probe)

    def reason(
        self,
        part: tuple[str, str],
        triple: Sequence[float | None],
        error: float | None,
        span: float,
        unit: str,
        difference: float | None,
    ) -> str | None:
        """Reason why the error of a peak is unknown, or wide (above `WIDE_ERROR` times `span`); otherwise None.

        part : (group, name) of the part; triple : peak at half, one and twice the resolution; span : range of the
        signal; unit : unit of all values; difference : difference to a reference, or None
        """
        if error is None:
            return self.unknown.get(part) or stopped_runs_text(self.case, self.runs)
        if error <= WIDE_ERROR * span:
            return None
        causes = "; ".join(self.shared)
        if not causes:
            causes = difference_text(triple, error, unit, self.case)
            if difference is not None and difference > 0.5 * error:
                causes += "; " + reference_text(
                    self.case, self.runs[1.0], difference, error / (WIDE_ERROR * span), unit
                )
        if error > span:
            return (
                f"this estimate exceeds the range of the signal, so the peak is not known; {causes}"
            )
        return causes


class VaporValues:
    """Values of pressures and heads at the vapour pressure, below which `cavitation` allows none."""

    def __init__(self, case: Any) -> None:
        self.case, self.model = case, study_model(case)
        self.columns = {column.name: column for column in probe_columns(self.model)}
        self.probes = {probe.text: probe for probe in case.probes}

    def value(self, text: str) -> float:
        """Value of a probe at the vapour pressure, in its unit; -inf if it is no pressure or head."""
        if text not in self.probes:  # at places of limits
            other = VaporValues(load(self.case, {"output.probes": [text]}))
            return other.value(text) if text in other.probes else -math.inf
        probe, model = self.probes[text], self.model
        if probe.quantity not in OF_PRESSURE:
            return -math.inf
        if probe.part == "nodes":
            elevation = model.elevation.get(probe.name, 0.0)
        else:
            pipe = next((pipe for pipe in model.pipes if pipe.name == probe.name), None)
            if pipe is None:
                return -math.inf
            elevation = float(pipe.height(probe.fraction * self.case.links[probe.name].length))
        pressure = (1.0 + 1e-9) * self.case.properties.vapor_pressure  # at it a head is not finite
        return float(
            self.columns[text].from_si(in_quantity(model, probe.quantity, pressure, elevation))
        )

    def ceiling(self, text: str) -> float:
        """Negative of `value`."""
        return -self.value(text)

    def greatest_excess(self, neighbours: PlaceMargins) -> float:
        """Greatest possible excess below a limit at any place of a part, in the unit of the limit."""
        if "flow" in neighbours.probes[0] or "velocity" in neighbours.probes[0]:
            return math.inf
        text = neighbours.probes[0]
        first = self.value(text)
        if not math.isfinite(first) or text.rpartition(".")[2].startswith("head"):
            return math.inf
        return float(np.max(neighbours.limits)) - first


def first_of(signals: Sequence[Signal], sign: float, ceiling: float) -> dict[str, float] | None:
    """First peak of a probe with column separation : {value, time [s], error}; signals : with maxima in place of peaks.

    None if the signals are not usable or have no peak.
    """
    found = first_peak(signals, troughs, ceiling) if usable(signals) else None
    if found is None:
        return None
    least = RELATIVE_FLOOR * abs(found["value"]) if found["error"] > 0.0 else 0.0
    return {"value": sign * found["value"], "time": found["time"], "error": found["error"] + least}


def is_pair(references: dict) -> bool:
    """True for two references with delay lines; False without references, and for runs with column separation."""
    return len(references) == 2


def reference_text(case: Any, own: Any, difference: float, times: float, unit: str) -> str:
    """Reason of an error that references show: its size, and the cells or the step that would resolve the peak.

    own : result of the case; times : factor of the resolution, if the error is of first order; unit : of the difference
    """
    factor = 2 ** math.ceil(math.log2(min(max(times, 2.0), 1e6)))
    counts = cell_counts(case)
    if counts:
        key = max(counts, key=lambda key: counts[key][0])
        remedy = f"use {factor} times the cells, {key} = {factor * counts[key][0]}"
    else:
        step = own.summary["t"] / max(own.summary["steps"], 1) / factor
        remedy = f"use steps of at most {case.step_amount(step, 2)}"
    return f"delay lines with short steps differ by {difference:.2g} {unit}; {remedy}"


def unknown_parts(case: Any) -> dict[Part, str]:
    """Parts with unknown errors of their peaks : (group, name) of a part -> reason.

    With a pulse in a schedule that is shorter than the longest time in which a wave crosses a cell, these are all
    parts. Otherwise they are the pipes of `short_pipes` and those with a single cell, and their end nodes.
    """
    reasons: dict[Part, str] = {}
    lengths = {name: pipe.length / pipe.cells for name, pipe in pipes_with_cells(case).items()}
    crossing = max(
        (length / case.wave_speed(name) for name, length in lengths.items()), default=0.0
    )
    pulses = []
    for group in ("nodes", "links"):
        for name, part in getattr(case, group).items():
            keys = type(part).model_fields
            pulses += [
                f"{group}.{name}.{key}"
                for key in keys
                if pulse_width(getattr(part, key)) < crossing
            ]
    if pulses:
        text = (
            f"{listing(pulses, MAX_NAMES)} {'change' if len(pulses) > 1 else 'changes'} in both directions within the "
            "travel time of a cell; use more cells"
        )
        reasons = {
            (group, name): text for group in ("nodes", "links") for name in getattr(case, group)
        }
    texts = {
        name: f"a wave crosses {name} faster than a cell of {neighbour}; set links.{neighbour}.cells = {cells}"
        for name, (neighbour, cells) in short_pipes(case).items()
    }
    half = scaled(cell_counts(case), 0.5)
    for name, pipe in pipes_with_cells(case).items():
        if half[f"links.{name}.cells"] == (pipe.cells,):  # no coarser cells
            texts[name] = f"{name} has a single cell; set links.{name}.cells = {MIN_CELLS}"
    for name, text in texts.items():
        link = case.links[name]
        for part in (("links", name), ("nodes", link.from_), ("nodes", link.to)):
            reasons.setdefault(part, text)
    return reasons


def stopped_runs_text(case: Any, runs: dict[float, Any]) -> str:
    """Reason why runs at other resolutions give no value of a peak; runs : factor of resolution -> result."""
    ended = [
        f"{times:g} times the resolution: {run.reason}"
        for times, run in runs.items()
        if run.reason != "finished"
    ]
    if len(runs) == 1:
        files = listing(basins_from_files(case), MAX_NAMES)
        return (
            f"the cells of {files} come from a file, so there is no run at another resolution; run the case with a "
            "file of finer cells, and compare both runs with fvsolve compare"
        )
    return (
        "; ".join(ended)
        or "at another resolution the peak is not a number; use more cells or shorter steps"
    )


def difference_text(triple: Sequence[float | None], error: float, unit: str, case: Any) -> str:
    """Reason of a wide error of the middle of three values from coarse to fine, with a remedy; unit : of the values."""
    remedy = "more cells" if cell_counts(case) else "shorter steps"
    peaks = [peak for peak in triple if peak is not None]
    steps = np.diff(peaks)
    if np.abs(steps).max() < SMALL_DIFFERENCE * error:
        return f"another peak of the signal, or a moving peak, may exceed the computed peak; use {remedy}"
    steps_text = " and ".join(f"{abs(peak):.2g}" for peak in steps)
    if len(steps) == 1:
        return f"a difference of {steps_text} {unit} between the only two resolutions; use {remedy}"
    falls = steps[0] * steps[1] > 0.0 and abs(steps[1]) < 0.6 * abs(steps[0])
    order = "decrease, but are large" if falls else "show no order of convergence"
    return f"differences of {steps_text} {unit} between resolutions {order}; use {remedy}"


def has_separation(runs: dict[float, Any]) -> bool:
    """True if column separation occurred in a run."""
    return any(run.summary["cavities"] for run in runs.values())


def coarse_pipes_at_devices(case: Any) -> list[str]:
    """Texts, at most `MAX_NAMES`, on pipes with too few cells next to a check valve or accumulator."""
    pipes, devices = pipes_with_cells(case), answering_parts(case)
    texts = [
        f"{name} has {pipe.cells} cell{'' if pipe.cells == 1 else 's'} beside {listing(devices[name], MAX_NAMES)}; "
        f"set links.{name}.cells = {LEAST_CELLS}"
        for name, pipe in pipes.items()
        if pipe.cells < LEAST_CELLS and devices[name]
    ]
    return texts[:MAX_NAMES]


def differing_events(runs: dict[float, Any]) -> list[str]:
    """List with a text on the devices whose numbers of events differ between resolutions, or an empty list."""
    finished = [runs[times] for times in sorted(runs) if runs[times].reason == "finished"]
    counts = [Counter(event["name"] for event in run.summary["events"]) for run in finished]
    names = sorted(set().union(*counts)) if len(finished) > 1 else []
    by_device = {name: [event[name] for event in counts] for name in names}
    texts = [
        f"{name} ({', '.join(map(str, values))})"
        for name, values in by_device.items()
        if len(set(values)) > 1
    ]
    return (
        [f"numbers of events differ between resolutions: {listing(texts, MAX_NAMES)}"]
        if texts
        else []
    )


# errors of peaks and margins -----------------------------------------------------------------------------------------


def peak_errors(
    result: Result, case: Any, progress: Callable[[str], None] | None = None
) -> dict[str, Any]:
    """Add errors of peaks, expectations and limit verdicts to the summary of a run, from further runs of its case.

    Returns the summary. Its entry `peaks` has for each probe the `unit`, and `minimum` and `maximum` as {value, error,
    order, reason}. The `error` is None if it is not known, for example if the run at twice the resolution did not
    finish, or a pipe is too short. The `order` is None if no order can be determined. The `reason` is that of an
    unknown or wide error, otherwise None. Each expectation and each bound of a limit at each place gets its `error`; a
    limit that holds becomes open if an error is unknown or above its margin. The entry `resolution` describes the
    method.
    progress : called with a text before each run
    """
    own = result if result.places is not None else run(case, set=NO_FIELDS, pictures=False)
    case = load(case, fixed_choices(case))
    runs, references = refined_runs(own, case, progress)
    summary, unresolved = result.summary, Unresolved(case, runs, references)
    summary["peaks"] = peak_rows(result, runs, references, unresolved)
    summary["verdicts"] = [
        verdict([limit_row(runs, references, k, j, row, unresolved) for j, row in enumerate(rows)])
        for k, rows in enumerate(own.places)
    ]
    for k, claim in enumerate(summary["expectations"]):
        error = expectation_error(
            runs, references, case.expect[claim["text"]], k, summary["peaks"], claim["found"]
        )
        claim["error"] = error
    words = description(runs, case)
    if references:
        words += "; errors from " + (LINES_TEXT if is_pair(references) else FINEST_TEXT)
    summary["resolution"] = {
        "levels": sorted(runs),
        "kept": basins_from_files(case),
        "words": words,
        "reasons": reason_texts(summary),
    }
    return summary


def reason_texts(summary: dict[str, Any]) -> list[str]:
    """Reasons of unknown or wide errors in a summary, each once, after the names of its peaks and limits."""
    names_by_reason: dict[str, dict[str, None]] = {}
    for probe, peak in summary["peaks"].items():
        for side in SIDES:
            names_by_reason.setdefault(peak[side]["reason"], {})[probe] = None
    for limit in summary["verdicts"]:
        for row in limit["worst"]:
            names_by_reason.setdefault(row["reason"], {})[f"{limit['name']} at {row['place']}"] = (
                None
            )
    return [
        f"{listing(list(names), MAX_NAMES)}: {text}"
        for text, names in names_by_reason.items()
        if text is not None
    ]


def refined_runs(
    own: Result, case: Any, progress: Callable[[str], None] | None
) -> tuple[dict, dict]:
    """Run a case at half, one and twice the resolution, with about as many rows of output as steps, and references.

    At resolution 1 the number of rows is that of the steps, limited to `MIN_ROWS` to `MAX_ROWS`, or that of the case if
    it is larger. Returns ({0.5 | 1.0 | 2.0: result}, without resolutions that the case cannot have; references as from
    `line_references`).
    own : result of the case itself; progress : called with a text before each run
    """
    named = [probe.text for probe in case.output.probes]
    rows = min(max(own.summary["steps"], MIN_ROWS), MAX_ROWS)
    every = (
        min(case.output.every, own.summary["t"] / rows)
        if own.summary["t"] > 0.0
        else case.output.every
    )
    settings, runs = NO_FIELDS | {"output.probes": [*named, *limit_probes(own, case, named)]}, {}
    for times in LEVELS:
        keys = refined_keys(case, times) if times != 1.0 else {}
        if keys or times == 1.0:
            if progress is not None:
                progress(f"{times:g} times the resolution")
            runs[times] = run(
                case, set=keys | settings | {"output.every": every / times}, pictures=False
            )
    if has_separation(runs):
        return runs, separated_runs(
            runs, case, settings | {"output.every": every / FINEST}, progress
        )
    return runs, line_references(
        own, case, settings | {"output.every": every / REFERENCE_ROWS}, progress
    )


def separated_runs(
    runs: dict[float, Result],
    case: Any,
    settings: dict[str, Any],
    progress: Callable[[str], None] | None,
) -> dict[float, Result]:
    """Results at one, two and four times the resolution of a case of pipes with column separation, or {}.

    runs : results at lower resolutions; settings : changed keys of the run at four times the resolution
    """
    if case.meshes or any(
        times not in runs or runs[times].reason != "finished" for times in LEVELS[1:]
    ):
        return {}
    if progress is not None:
        progress(f"{FINEST:g} times the resolution")
    finest = run(case, set=refined_keys(case, FINEST) | settings, pictures=False)
    return (
        {times: runs[times] for times in LEVELS[1:]} | {FINEST: finest}
        if finest.reason == "finished"
        else {}
    )


def limit_probes(own: Result, case: Any, named: list[str]) -> list[str]:
    """Names of additional probes, at selected places of the parts to which design limits apply (see `selected_places`).

    Probes that the case does not accept are left out. own : result of the case; named : names of the probes of the case
    """
    rows = [row[PLACES_KEY] for rows in own.places for row in rows]
    texts = dict.fromkeys(
        neighbours.probes[position]
        for neighbours in rows
        for position in selected_places(neighbours, len(rows))
    )
    extra = [text for text in texts if text not in named]
    return (
        extra
        if accepts_probes(case, extra)
        else [text for text in extra if accepts_probes(case, [text])]
    )


def selected_places(neighbours: PlaceMargins, rows: int) -> list[int]:
    """Indices of the places of a part whose signals are recorded, for one bound of a design limit.

    They are the place with the least margin, local minima of the margin along the part, and some evenly spaced places.
    neighbours : margins at all places of the part; rows : number of pairs of a part and a bound in all limits of the
    case
    """
    margins = np.where(np.isfinite(neighbours.margins), neighbours.margins, -np.inf)
    most = max(MAX_PLACES // rows, 1)
    padded = np.pad(margins, 1, constant_values=np.inf)
    least = np.flatnonzero((margins <= padded[:-2]) & (margins <= padded[2:]))
    least = least[np.argsort(margins[least], kind="stable")][
        : max(min(PLACES_PER_PART, most) // 2, 1)
    ]
    count = max(min(PLACES_PER_PART, most) - len(least), 0)
    spaced = np.linspace(0, len(margins) - 1, count).astype(int)
    return list(dict.fromkeys([int(np.argmin(margins)), *least.tolist(), *list(spaced)]))


def accepts_probes(case: Any, texts: list[str]) -> bool:
    """True if the case accepts these probes; texts : their names."""
    try:
        load(case, {"output.probes": texts})
    except CaseError:
        return False
    return True


def peak_rows(
    result: Result, runs: dict[float, Result], references: dict[int, Result], unresolved: Unresolved
) -> dict[str, Any]:
    """Entry `peaks` of the summary of `result`, as in `peak_errors`: unit, extremes of each probe, and their errors."""
    summary = result.summary
    largest = {"rad": 1.0}
    rows = {}
    parts = {probe.text: (probe.part, probe.name) for probe in unresolved.case.probes}
    flows = {probe.text for probe in unresolved.case.probes if probe.quantity == "flow"}
    # where water is at rest, its flow is the remainder of the steady start, compared with a wave of 1 bar
    admittances = (
        0.25 * math.pi * pipe.diameter**2 / unresolved.case.wave_speed(name)
        for name, pipe in pipes(unresolved.case).items()
    )
    flow_floor = (
        RELATIVE_FLOOR * 1e5 * max(admittances, default=0.0) / unresolved.case.properties.density
    )
    for extreme in summary["extremes"].values():
        values = [abs(extreme[side] or 0.0) for side in SIDES]
        largest[extreme["unit"]] = max(largest.get(extreme["unit"], 0.0), *values)
    for name, extreme in summary["extremes"].items():
        rows[name] = {"unit": extreme["unit"]}
        for side, sign in SIGNS.items():
            missed = 0.0 if summary["cells"] else between_rows(result, name, side)
            value_of = partial(extreme_of, name=name, side=side)
            triple = values_of_runs(runs, value_of, sign)
            unknown = parts[name] in unresolved.unknown
            places = [partial(signals, probe=name, rising=partial(np.multiply, sign))]
            ceiling = unresolved.ceiling(name) if side == "minimum" else math.inf
            error = (
                None
                if unknown
                else error_estimate(runs, references, value_of, sign, places, ceiling)
            )
            difference = reference_difference(references, value_of, extreme[side])
            span = (extreme["maximum"] or 0.0) - (extreme["minimum"] or 0.0)
            if error is not None:
                least = 2.0 * (missed + ROUNDING * largest[extreme["unit"]]) + RELATIVE_FLOOR * abs(
                    extreme[side]
                )
                least += float(result.column(name).from_si(flow_floor)) if name in flows else 0.0
                error += least + abs(sign * extreme[side] - triple[1]) + unresolved.tolerance * span
                # so that the rounding error of a constant does not count as wide
                span += 2.0 * least / WIDE_ERROR
            rows[name][side] = {
                "value": extreme[side],
                "error": error,
                "order": None if unknown else observed_order(triple, has_separation(runs)),
                "reason": unresolved.reason(
                    parts[name], triple, error, span, extreme["unit"], difference
                ),
            }
            if references and not is_pair(references):
                rows[name][side]["first"] = first_of(places[0](references), sign, ceiling)
    return rows


def extreme_of(run: Result, name: str, side: str) -> float | None:
    """Extreme of a probe in a run; side : "minimum" or "maximum"."""
    return run.summary["extremes"][name][side]


def error_estimate(
    runs: dict[float, Result],
    references: dict,
    value_of: Callable,
    sign: float,
    places: Sequence,
    ceiling: float = math.inf,
) -> float | None:
    """Error bound of the value of a run, from references if there are any, else from further resolutions.

    value_of(run) : value, which times `sign` is a maximum; places : for each place, a function that gives the signals
    of several runs, as from `signals`, with maxima in place of peaks; ceiling : least upper bound of these maxima
    """
    triple = values_of_runs(runs, value_of, sign)
    if references and None not in triple[1:]:
        values = [value_of(references[times]) for times in sorted(references)]
        if all(value is not None and math.isfinite(value) for value in values):
            values = [sign * value for value in values]
            found = [place(references) for place in places]
            if is_pair(references):
                return reference_error(triple[1], values, found)
            maxima = [separate_maxima(signals, troughs)[0] for signals in found if usable(signals)]
            return separated_error(values, np.vstack([np.empty((0, 3)), *maxima]), ceiling)
    return error_bound(runs, triple, [place(runs) for place in places])


def reference_difference(
    references: dict[int, Result], value_of: Callable, value: float | None
) -> float | None:
    """Difference between a value and that of the finer reference; None without references or values."""
    finer = value_of(references[max(references)]) if references else None
    return None if finer is None or value is None else abs(finer - value)


def greatest_spread(references: dict[int, Result]) -> float:
    """Greatest difference of a peak between both references, relative to the range of its signal."""
    first, second = (references[times].summary["extremes"] for times in sorted(references))
    spread = 0.0
    for name, extreme in second.items():
        values = [entry[side] for entry in (extreme, first[name]) for side in SIDES]
        if None in values or not values[1] > values[0]:
            continue
        low, high, other_low, other_high = values
        if high - low > RELATIVE_FLOOR * max(abs(low), abs(high)):
            spread = max(
                spread, abs(low - other_low) / (high - low), abs(high - other_high) / (high - low)
            )
    return min(spread, MOST_SPREAD)


def error_bound(
    runs: dict[float, Result], triple: Sequence[float | None], places: Sequence = ()
) -> float | None:
    """Error bound of the second of three values at increasing resolutions; None if it is not known.

    places : for each place, its signals at these resolutions, with a sign such that the peak is a maximum
    """
    c, *finer = triple
    if not all(value is not None and math.isfinite(value) for value in finer):
        return None
    all_finite = c is not None and math.isfinite(c)
    places = [value if all_finite else value[-2:] for value in places if usable(value)]
    return greatest_error(places, triple if all_finite else finer, not has_separation(runs))


def usable(signals_of_place: Sequence) -> bool:
    """True if a place has two or more signals (times, values) and all values are finite."""
    return len(signals_of_place) > 1 and all(
        len(v) > 0 and bool(np.isfinite(v).all()) for _, v in signals_of_place
    )


def signals(
    runs: dict[float, Result], probe: str, rising: Callable[[np.ndarray], np.ndarray]
) -> list:
    """Signals (times [s], rising(values)) of a probe in finished runs, coarse first; `rising` turns peaks to maxima."""
    finished = [runs[times] for times in sorted(runs) if runs[times].reason == "finished"]
    return [(run.seconds, rising(run[probe])) for run in finished if probe in run.units]


def limit_row(
    runs: dict[float, Result],
    references: dict[int, Result],
    limit: int,
    k: int,
    row: dict[str, Any],
    unresolved: Unresolved,
) -> dict:
    """Row of a limit with its error. The state becomes open if the error is unknown or above the margin.

    limit, k : indices of the limit and of the row in these results; row : row of `run.verdicts.places`
    """
    sign, magnitude = SIGNS[row["bound"]], row["quantity"] in MAGNITUDES
    triple = values_of_runs(runs, lambda run: run.places[limit][k]["margin"], -1.0)
    places = []
    for position, probe in enumerate(row[PLACES_KEY].probes):
        allowed = float(row[PLACES_KEY].limits[position])
        rising = partial(exceedance, sign=sign, allowed=allowed, magnitude=magnitude)
        places.append(partial(signals, probe=probe, rising=rising))
    part, error = (row[PLACES_KEY].probes[0].split(".")[0], row["place"]), None
    margin_of = partial(margin_in, limit=limit, k=k)
    if part not in unresolved.unknown:
        ceiling = math.inf
        if row["bound"] == "minimum" and unresolved.vapor is not None:
            ceiling = unresolved.vapor.greatest_excess(row[PLACES_KEY])
        error = error_estimate(runs, references, margin_of, -1.0, places, ceiling)
    found = [place(runs) for place in places]
    span = max((float(np.ptp(run[-2][1])) for run in found if usable(run)), default=math.inf)
    size = abs(row["value"] or 0.0)
    if error is not None:
        spread = span if math.isfinite(span) else 0.0
        # gauge values have another zero
        error += RELATIVE_FLOOR * (size + spread) + unresolved.tolerance * spread
        error += abs((row["margin"] or 0.0) + triple[1])  # other rows change steps
    doubtful = error is None or not abs(row["margin"] or 0.0) >= error
    span_and_floor = span + 2.0 * RELATIVE_FLOOR / WIDE_ERROR * size
    difference = reference_difference(references, margin_of, row["margin"])
    reason = unresolved.reason(part, triple, error, span_and_floor, row["unit"], difference)
    return row | {"error": error, "reason": reason, "state": OPEN if doubtful else row["state"]}


def margin_in(run: Result, limit: int, k: int) -> float | None:
    """Margin of a row of a limit in a run; limit, k : indices of the limit and of the row."""
    return run.places[limit][k]["margin"]


def exceedance(values: np.ndarray, sign: float, allowed: float, magnitude: bool) -> np.ndarray:
    """Values above an allowed maximum (sign 1), or below a minimum (sign -1); magnitude : True for their magnitudes."""
    return sign * ((np.abs(values) if magnitude else values) - allowed)


def expectation_error(
    runs: dict[float, Result],
    references: dict[int, Result],
    expect: Any,
    k: int,
    peak_rows: dict[str, Any],
    found: float,
) -> float | None:
    """Error of the value in an expectation: the error of the peak if it is a peak, else from the values of all runs.

    expect : expectation of the case; k : its index in the summaries; peak_rows : entry `peaks` of the summary
    found : value in the run itself, whose steps differ with the rows
    """
    side = {"min": "minimum", "max": "maximum"}.get(expect.function)
    if side is not None and expect.probe is not None and expect.probe.text in peak_rows:
        return peak_rows[expect.probe.text][side]["error"]
    error = error_estimate(
        runs, references, lambda run: run.summary["expectations"][k]["found"], 1.0, []
    )
    own = runs[1.0].summary["expectations"][k]["found"]
    return None if error is None else error + RELATIVE_FLOOR * abs(own) + abs(found - own)


def values_of_runs(
    runs: dict[float, Result], of: Callable, sign: float = 1.0
) -> tuple[float | None, ...]:
    """Values of(run) at half, one and twice the resolution, times `sign`; None for a missing or unfinished run."""
    results = [
        of(runs[times]) if times in runs and runs[times].reason == "finished" else None
        for times in LEVELS
    ]
    return tuple(None if value is None else sign * value for value in results)


def observed_order(triple: Sequence[float | None], separated: bool) -> float | None:
    """Observed order of three values, at most 2; None below order 1, or if the differences have opposite signs.

    It is also None if a value is missing, and if the first two are equal.
    separated : True if column separation occurred; no order is then assumed, and the result is None
    """
    if separated or any(value is None or not math.isfinite(value) for value in triple):
        return None
    first, second = triple[1] - triple[0], triple[2] - triple[1]
    if first == 0.0 or first * second < 0.0 or abs(second) > 0.5 * abs(first) * (1.0 + 1e-6):
        return None
    return min(math.log2(first / second), 2.0) if second else 2.0


def between_rows(result: Result, probe: str, side: str) -> float:
    """Greatest height of a smooth peak above the highest row of a probe (or depth of a minimum below the lowest row).

    It is an eighth of the second difference of the three rows around this row, in the unit of the probe. It is 0 if the
    row is the first or last, or beside a jump. side : "minimum" or "maximum"
    """
    t, v = result.t, result[probe]
    position = int(np.argmin(v) if side == "minimum" else np.argmax(v))
    if (
        not 0 < position < len(v) - 1
        or t[position - 1] == t[position]
        or t[position] == t[position + 1]
    ):
        return 0.0
    return abs(float(v[position - 1] - 2.0 * v[position] + v[position + 1])) / 8.0


def description(runs: dict[float, Result], case: Any) -> str:
    """Sentence that describes how the errors of peaks were found, and the restrictions for this case."""
    others = " and ".join(f"{factor:g}" for factor in sorted(runs) if factor != 1.0)
    if not others:
        files = listing(basins_from_files(case))
        return f"errors are unknown: cells of {files} come from files, and there are no other cells"
    text = f"peaks compared with those at {others} times the resolution"
    if basins_from_files(case):
        text += (
            f"; cells of {', '.join(basins_from_files(case))} come from files and did not change"
        )
        text += ": their error is not included"
    if has_separation(runs):
        text += "; column separation, so no order of convergence is assumed"
    stopped = [f"{factor:g}" for factor in sorted(runs) if runs[factor].reason != "finished"]
    if stopped:
        runs_text = (
            f"run{'s' if len(stopped) > 1 else ''} at {' and '.join(stopped)} times the resolution"
        )
        text += f"; the {runs_text} did not finish"
    if 0.5 not in runs:
        text += "; half the resolution is not possible (patches would begin within cells), so no order is assumed"
    return text


def reference_error(
    value: float, pair: Sequence[float], places: Sequence[Sequence[Signal]]
) -> float:
    """Error bound of a value from two references: its difference to the second, plus the error of the second itself.

    pair : values of both references; places : for each place, the signals of both references
    """
    first, second = pair
    own = REFERENCE_SAFETY * abs(second - first)
    for signals in places:
        if not usable(signals):
            continue
        _, maxima = local_maxima(signals)
        maxima = maxima[np.isfinite(maxima).all(axis=1)]
        changes = np.abs(maxima[:, 2] - maxima[:, 1])
        own = max(
            own, float(np.max(maxima[:, 2] + REFERENCE_SAFETY * changes, initial=second)) - second
        )
    return DIFFERENCE_SAFETY * abs(value - second) + own


# error bounds from local maxima --------------------------------------------------------------------------------------

SAFETY = 2.15  # factor on remainders
QUICK, SLOW = 0.25, 0.6  # ratios of differences at order 2, and at the least order that is accepted
GROWTH = 2.0  # greatest factor for differences that grow
OTHER_PLACES = 0.6  # factor on remainders of places other than that of the greatest value
MEAN_FRACTION = 0.2  # fraction of the mean difference of all maxima
MAX_MOVED = 16.0  # limit of the two further terms, in differences of the greatest value
# ratios of mean differences of signals -> factor on the bound
CONVERGED, TRUSTED = (0.35, 0.75), (0.5, 1.0)
MINIMUM_SAFETY = 1.6  # factor on the remainder by that ratio
RISE = 0.002  # drop between two separate maxima, as a fraction of the range of a signal


def greatest_error(
    places: Sequence[Sequence[Signal]], triple: Sequence[float], believed: bool = True
) -> float:
    """Error bound of the greatest value of several signals at the middle of three resolutions, or the first of two.

    places : for each place in the network, its signals (times, values) at two or three increasing resolutions
    triple : greatest value over all places and steps at each resolution; believed : False if no order of convergence
    may be assumed
    """
    own_maxima = three_values(np.array([triple], float))
    maxima = [local_maxima(signals) for signals in places]
    if not places:
        return error_of_maxima(own_maxima, remainders(own_maxima, believed))
    k = int(np.argmax([np.max(signals[-2][1]) for signals in places]))
    rows = [own_maxima, *(values[np.isfinite(values).all(axis=1)] for _, values in maxima)]
    factors = [1.0 if j in (0, k + 1) else OTHER_PLACES for j in range(len(rows))]
    bounds = [
        remainders(values, believed) * factor for values, factor in zip(rows, factors, strict=True)
    ]
    error = error_of_maxima(np.vstack(rows), np.concatenate(bounds))
    (cuts, _), (middle, fine), most = (
        maxima[k],
        places[k][-2:],
        float(np.max(np.abs(np.diff(own_maxima)))),
    )
    moved = 0.0  # greatest difference of both signals at the times of their greatest values
    if greatest_segment(cuts, middle) == greatest_segment(cuts, fine):
        times = [signal[0][np.argmax(signal[1])] for signal in (middle, fine)]
        moved = float(np.max(np.abs(np.interp(times, *fine) - np.interp(times, *middle))))
    mean = MEAN_FRACTION * float(
        np.mean(np.max(np.abs(np.diff(rows[k + 1], axis=1)), axis=1, initial=0.0))
    )
    ratio = convergence_ratio(places[k])
    error *= float(np.interp(ratio, CONVERGED, TRUSTED))
    least = MINIMUM_SAFETY * remainder_by_ratio(ratio, own_maxima[0])
    return max(error, min(max(moved, mean), MAX_MOVED * most), least)


def three_values(maxima: np.ndarray) -> np.ndarray:
    """Values at three resolutions : float64[maxima, 3]; from two columns, a coarser one is extrapolated linearly.

    maxima : float64[maxima, 2 or 3], values of local maxima at increasing resolutions
    """
    return (
        maxima
        if maxima.shape[1] == 3
        else np.column_stack([2.0 * maxima[:, 0] - maxima[:, 1], maxima])
    )


def greatest_segment(cuts: np.ndarray, signal: Signal) -> int:
    """Index of the local maximum at which a signal is greatest; cuts : separating times, as from `local_maxima`."""
    return int(np.searchsorted(cuts, signal[0][np.argmax(signal[1])]))


def local_maxima(signals: Sequence[Signal]) -> tuple[np.ndarray, np.ndarray]:
    """Local maxima of a signal; signals : (times, values) of this signal at two or three increasing resolutions.

    Returns (times that separate the local maxima of the finest signal, greatest values between these times :
    float64[maxima, 3]). The columns of the values are as from `three_values`; values are not finite in rows where a
    signal has no point between these times.
    """
    t, v = signals[-1]
    cuts = t[troughs(v, RISE * float(np.ptp(v)))]
    greatest = np.full((len(cuts) + 1, len(signals)), -np.inf)
    for k, (times, values) in enumerate(signals):
        np.maximum.at(greatest[:, k], np.searchsorted(cuts, times), values)
    return cuts, three_values(greatest)


def troughs(values: np.ndarray, rise: float) -> list[int]:
    """Indices of the least values between successive maxima, both of which are higher by more than `rise`."""
    turns = np.concatenate(
        [[0], 1 + np.flatnonzero(np.diff(np.sign(np.diff(values)))), [len(values) - 1]]
    )
    positions = []
    rising = True
    high = 0
    low = 0
    for i in turns.tolist():
        if rising and values[i] < values[high] - rise:
            rising, low = False, i
        elif not rising and values[i] > values[low] + rise:
            positions.append(low)
            rising, high = True, i
        high = i if values[i] > values[high] else high
        low = i if values[i] < values[low] else low
    return positions


def error_of_maxima(maxima: np.ndarray, off: np.ndarray) -> float:
    """Error bound of the greatest of several local maxima at the middle resolution.

    maxima : float64[maxima, 3]; off : float64[maxima]  bounds of the changes of the middle values, from `remainders`
    """
    c, m, f = maxima.T
    sways, most = (m - c) * (f - m) < 0.0, float(np.max(m))
    above = float(np.max(np.where((f >= m) | sways, m + off, m)))
    below = float(np.max(np.where((f <= m) | sways, m - off, m)))
    return max(above - most, most - below)


def remainders(triples: np.ndarray, believed: bool = True) -> np.ndarray:
    """Bounds of the changes of the middle values by all finer resolutions : float64[values].

    triples : float64[values, 3]  at three resolutions; believed : False if no order of convergence may be assumed
    """
    first, second = np.diff(triples, axis=1).T
    a = np.abs(first)
    b = np.abs(second)
    sways = first * second < 0.0
    ratio = np.divide(b, a, out=np.where(b > 0.0, np.inf, 0.0), where=a > 0.0)
    r = np.clip(ratio, QUICK, SLOW) if believed else np.full(len(a), SLOW)
    rest = SAFETY * np.maximum(b, a * r) / (1.0 - np.where(sways, SLOW, r))
    return rest * np.where(sways, 1.0, np.clip(ratio, 1.0, GROWTH))


def remainder_by_ratio(ratio: float, values: np.ndarray) -> float:
    """Bound of the change of the middle value by all finer resolutions, without a safety factor.

    values : float64[3]  at three resolutions; ratio : ratio of differences, used if larger than that of the values
    """
    a, b = np.abs(np.diff(values)).tolist()
    r = min(max(b / a if a > 0.0 else 0.0, ratio, QUICK), SLOW)
    return max(b, a * r) / (1.0 - r)


def convergence_ratio(signals: Sequence[Signal]) -> float:
    """Mean difference between the two finest of three signals, divided by that between the two coarsest.

    It is `SLOW` for two signals, and if the two coarsest are equal. signals : (times, values), coarsest first
    """
    if len(signals) < 3:
        return SLOW
    t = signals[-1][0]
    coarse, middle, fine = (np.interp(t, *signal) for signal in signals)
    before = float(np.mean(np.abs(middle - coarse)))
    return float(np.mean(np.abs(fine - middle))) / before if before > 0.0 else SLOW
