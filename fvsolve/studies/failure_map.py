"""Failure map of a case: verdicts on runs of all methods over steps, or over values of a key."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from fvsolve.argument_checks import NAMES, NUMBER, NUMBERS, ROW, TEXT, Kind, is_row, validated
from fvsolve.case import load
from fvsolve.core.model.build import build
from fvsolve.core.model.step_division import dividing_rate
from fvsolve.core.output.result_table import PlainData
from fvsolve.core.schemes import LIMITED
from fvsolve.core.steppers.tableau import METHODS as KNOWN_METHODS
from fvsolve.declarations import declared
from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.studies.distance import Deviation, column_ranges, time_weights
from fvsolve.studies.failure_map_columns import (
    Columns,
    WaveGrowthLimit,
    cells_for_delay_lines,
    default_schemes,
    eigenvalues_of,
    map_columns,
    modes_step,
)
from fvsolve.studies.outcome import (
    GIVEN_UP,
    STUDY_ARGUMENTS,
    CappedRun,
    Outcome,
    Progress,
    has_diverged,
    name_list,
    outcome,
    refuse_basins,
)
from fvsolve.studies.parallel import RunQueue, RunRequest
from fvsolve.studies.reference import Reference, find_reference
from fvsolve.studies.resolution import delay_lines, fixed_choices
from fvsolve.studies.result_cache import OUT, ResultCache, cache_in

STABLE = "stable"
RINGING = "ringing"
COARSE = "coarse"
WRONG = "wrong"
BLOWN_UP = "blown up"
REFUSED = "refused"
NOT_RUN = "not run"
VERDICT_TEXTS = {
    STABLE: "error within the tolerance, and smooth",
    RINGING: "finite, but oscillates from step to step, or oscillates more and faster than the reference",
    COARSE: "error above the tolerance, but a shorter step helps",
    WRONG: "finite, error above the tolerance, and neither half nor a quarter of the step helps",
    BLOWN_UP: "not finite, or more than three ranges of a probe outside the values of the reference",
    REFUSED: "fvsolve refused the case, or stopped with a reason",
    NOT_RUN: "too many implicit steps, or given up after too much time",
}
# a run farther outside the values of the reference, in ranges of a probe, has blown up
BLOWN_RANGES = 3.0
MIN_SWINGS = 8  # successive changes of alternating sign that count as ringing
# least swings that count [range]: of a run, of the reference, may decay
SWING_RANGE, REFERENCE_SWING = 0.02, 1e-3
# swings count if they follow in less than this fraction of the time of those of the reference
PACE_RATIO = 0.5
# greatest excess of the variation of a probe, as a fraction of that of the reference
EXCESS_VARIATION = 0.25
ERROR_RATIO = 0.75  # a shorter step helps if at most this fraction of the error remains


@dataclass(frozen=True)
class Measures:
    """Measures of a run against the reference, each for the worst probe, relative to the range of the probe.

    reason : reason for the end of the run; ok : True if the run finished; refused : True if the run did not begin
    error : mean distance from the reference over time; nan if the run did not finish
    farthest : greatest distance of a recorded value from the range of values of the reference, 0 inside this range;
    nan if the run did not finish. Long runs record windows of steps, see `RecordedRun`.
    ringing, variation : see `ringing_amplitude` and `excess_variation`
    steps : number of steps; seconds : elapsed time of the steps [s]
    """

    reason: str
    ok: bool
    refused: bool = False
    error: float = math.nan
    farthest: float = math.nan
    ringing: float = 0.0
    variation: float = 0.0
    steps: int = 0
    seconds: float = math.nan


def verdict(run: Measures, shorter: Callable[[], Measures], tolerance: float) -> str:
    """Verdict on a run, a key of `VERDICT_TEXTS`.

    shorter : function that returns the measures of the run with half the step, and at the second call with a quarter;
    it is called only if the error is above the tolerance and no earlier verdict applies
    """
    if run.reason.startswith(GIVEN_UP):
        return NOT_RUN
    if run.refused or (not run.ok and not has_diverged(run.reason)):
        return REFUSED
    if not run.ok or not run.farthest <= BLOWN_RANGES:
        return BLOWN_UP
    if run.ringing > tolerance or run.variation > EXCESS_VARIATION:
        return RINGING
    if run.error <= tolerance:
        return STABLE
    enough = max(tolerance, ERROR_RATIO * run.error)
    for _ in range(2):
        shorter_run = shorter()
        if shorter_run.reason.startswith(GIVEN_UP):
            return NOT_RUN
        if shorter_run.error <= enough:
            return COARSE
    return WRONG


def ringing_amplitude(windows: Sequence[np.ndarray], ranges: np.ndarray) -> float:
    """Greatest amplitude of an oscillation from step to step, relative to the range of the probe.

    windows : float64[steps, probes] each  values after successive steps; ranges : float64[probes]
    Eight successive changes must alternate in sign; the amplitude is half of the least of these changes.
    """
    worst = 0.0
    for window in windows:
        change = np.diff(window, axis=0) / ranges
        if len(change) < MIN_SWINGS:
            continue
        turns = change[1:] * change[:-1] < 0.0
        sliding = np.lib.stride_tricks.sliding_window_view
        alternate = sliding(turns, MIN_SWINGS - 1, axis=0).all(axis=-1)
        least = 0.5 * sliding(np.abs(change), MIN_SWINGS, axis=0).min(axis=-1)
        worst = max(worst, float(np.max(least[alternate], initial=0.0)))
    return worst


def excess_variation(rows: np.ndarray, reference: np.ndarray, ranges: np.ndarray) -> float:
    """Excess of the total variation TV of the worst probe over the reference, (TV - TV_ref) / max(TV_ref, range).

    TV is the sum of |changes| from row to row. A probe counts only if its swings follow each other in less than half
    the time of the swings of the reference. Thus a swing of the reference that the method amplifies or does not damp
    does not count as ringing. Each row is first replaced by the median of itself and its neighbours, so that a single
    outlier after a jump does not count as a swing.
    rows, reference : float64[k, probes]  values of the run and the reference; ranges : float64[probes]
    """
    smooth, smooth_reference = (_medians(values) / ranges for values in (rows, reference))
    variation, expected = (
        np.abs(np.diff(values, axis=0)).sum(axis=0) for values in (smooth, smooth_reference)
    )
    excesses = (variation - expected) / np.maximum(expected, 1.0)
    quick = [
        turn_interval(a, SWING_RANGE) < PACE_RATIO * turn_interval(b, REFERENCE_SWING)
        for a, b in zip(smooth.T, smooth_reference.T, strict=True)
    ]
    return float(np.max(excesses[quick], initial=0.0))


def turn_interval(values: np.ndarray, height: float) -> float:
    """Median number of rows between turning points of swings of `height` or more; inf for fewer than two points."""
    turns = []
    low = 0
    high = 0
    direction = 0
    for i, value in enumerate(values):
        low, high = (i if value < values[low] else low), (i if value > values[high] else high)
        if direction >= 0 and value < values[high] - height:
            turns += [high] * direction
            direction, low = -1, i
        elif direction <= 0 and value > values[low] + height:
            turns += [low] * -direction
            direction, high = 1, i
    return float(np.median(np.diff(turns))) if len(turns) > 1 else np.inf


def _medians(rows: np.ndarray) -> np.ndarray:
    return np.median([rows[:-2], rows[1:-1], rows[2:]], axis=0) if len(rows) > 2 else rows


def probe_ranges(reference: np.ndarray) -> np.ndarray:
    """Greatest minus least value of each probe in the reference, inf for constant probes : float64[probes]."""
    return np.nan_to_num(column_ranges(reference), nan=np.inf)


def measure_run(outcome, windows: Sequence[np.ndarray], reference) -> Measures:
    """Measures of a run against a reference, interpolated to its times; windows : float64[steps, probes] each."""
    if not outcome.ok:
        return Measures(
            outcome.reason, False, outcome.refused, steps=outcome.counts.get("steps", 0)
        )
    t = outcome.rows[:, 0]
    rows = outcome.rows[:, 1:]
    reference_rows = reference.rows(reference.run)
    expected = np.column_stack(
        [np.interp(t, reference.run.rows[:, 0], column) for column in reference_rows.T]
    )
    widths, steps = probe_ranges(reference_rows), np.concatenate([rows[-1:], *windows])
    with np.errstate(over="ignore", invalid="ignore"):
        error = [
            Deviation(off, time_weights(t), width).ranges()["L1"]
            for off, width in zip((rows - expected).T, widths, strict=True)
        ]
        outside = (
            np.maximum(steps - reference_rows.max(axis=0), reference_rows.min(axis=0) - steps)
            / widths
        )
        return Measures(
            outcome.reason,
            True,
            False,
            float(np.max(error)),
            max(0.0, float(outside.max())),
            ringing_amplitude(windows, widths),
            excess_variation(rows, expected, widths),
            outcome.counts["steps"],
            outcome.seconds,
        )


WINDOW_STEPS = 9  # least number of successive steps in a window
CPU_LIMIT = 10.0  # CPU time after which a run is given up [s]
# in long runs the distance of windows is this fraction of the steps taken: 1 / 30
WINDOW_COUNT = 30


class RecordedRun(CappedRun):
    """Run that records its probes after every step; in a long run only in windows of nine or more successive steps.

    The steps are those of a run without recording.
    windows : for each window a list of float64[probes], the values of the probes after successive steps, in SI units
    """

    def __init__(self, *arguments) -> None:
        super().__init__(*arguments)
        self.windows: list[list[np.ndarray]] = [[]]
        self.budget = self.left = 1.0
        self.max_seconds = CPU_LIMIT

    def pause(self) -> None:
        """Record the probes, and in a long run skip the steps between two windows. Raises GivenUp at the CPU limit."""
        self.check()
        self.windows[-1].append(
            self.run_data.observe(self.loop.t, self.loop.now, self.loop.stepper.out)
        )
        apart = int(self.loop.state["steps"]) // WINDOW_COUNT
        self.budget = 1.0
        if apart > WINDOW_STEPS and len(self.windows[-1]) >= WINDOW_STEPS:
            self.windows.append([])
            self.budget = float(apart)


def run_recorded(case, set: Mapping | None = None) -> tuple[Outcome, list[np.ndarray]]:
    """(outcome of a run with the changed keys `set`, recorded windows : list of float64[steps, probes] in SI units)."""
    runs: list[RecordedRun] = []

    def run(*arguments) -> RecordedRun:
        runs.append(RecordedRun(*arguments))
        return runs[-1]

    result = outcome(case, set, run=run)
    windows = runs[-1].windows if runs else []
    return result, [np.array(window) for window in windows if len(window) > 1]


METHODS = ("euler", "ssp-rk3", "rk4", "implicit-euler", "trapezoid", "gauss-4", "radau-iia-5")
TOLERANCE = 0.02  # greatest mean error, over the range of a probe
MAX_IMPLICIT_STEPS = 50_000  # greatest number of steps of an implicit method
OUTPUT_ROWS = 1000  # rows of the history of each run


@dataclass(frozen=True)
class Square(PlainData):
    """Run of a failure map, with its verdict.

    column : number of its column; step : given step [s], None unless the column has one
    courant : step times the wave rate of the first column (see `Columns`), None without a given step or without cells
    halved_error : error with half the step, None if it was not run
    limit : predicted greatest stable step [s], inf if no step fails, None if it is not known
    """

    scheme: str
    method: str
    column: int
    step: float | None
    courant: float | None
    verdict: str
    measures: Measures
    halved_error: float | None
    limit: float | None

    json = "scheme method column step courant verdict halved_error limit " + " ".join(
        f"{entry.name}=measures.{entry.name}" for entry in fields(Measures)
    )


@dataclass(frozen=True)
class FailureMap(PlainData):
    """Verdicts on runs of a case over schemes, methods and columns.

    key : "step" [s] or the key of the case that changes along the columns; values : its values
    squares : runs of all schemes, methods and columns, in this order of loops
    tolerance : greatest allowed mean error, relative to the range of a probe
    reference : description of the reference of the first column
    doubt : greatest uncertainty of the references of all columns, relative to the range of a probe
    wave_rate : greatest number of cells that a wave crosses per second in the first column [1/s], None without cells
    limited : limited schemes, whose limits are computed with the weights in smooth flow; lines : True with delay lines
    """

    case: str
    key: str
    values: tuple
    schemes: tuple[str, ...]
    methods: tuple[str, ...]
    squares: tuple[Square, ...]
    tolerance: float
    reference: str
    doubt: float
    wave_rate: float | None
    limited: tuple[str, ...]
    lines: bool = False

    def row(self, scheme: str, method: str) -> list[Square]:
        """Runs of a scheme and a method in the order of the columns."""
        return [
            square for square in self.squares if (square.scheme, square.method) == (scheme, method)
        ]


KEY_VALUES = Kind(
    lambda value: (
        is_row(value, lambda item: True)
        and len(value) == 2
        and TEXT.accepts(value[0])
        and ROW.accepts(value[1])
    ),
    'a key and its values, for example ("links.main.cells", [20, 40])',
)


@declared("study")
@validated(
    schemes=NAMES, methods=NAMES, courants=NUMBERS, steps=NUMBERS, key=KEY_VALUES, tolerance=NUMBER, out=OUT,
    **STUDY_ARGUMENTS,
)  # fmt: skip
def failure_map(
    case,
    schemes: Sequence[str] | None = None,
    methods: Sequence[str] | None = None,
    courants: Sequence[float] | None = None,
    steps: Sequence[float] | None = None,
    key: tuple[str, Sequence] | None = None,
    tolerance: float = TOLERANCE,
    out: str | Path | ResultCache | None = None,
    progress: Progress | None = None,
    set: Mapping | None = None,
    jobs: int = 1,
    dask: str | None = None,
) -> FailureMap:
    """Run a case with every scheme and method at every step (or value of a key), and give a verdict on each run.

    case, set : as in `run`; schemes, methods : names; default: `default_schemes` and seven usual methods
    courants or steps : Courant numbers or steps [s] of the columns
    key : (NAME, values), a varied key whose values are the columns; then a single step or Courant number, or the step
    control of the case, applies to all columns
    tolerance : greatest allowed mean error, relative to the range of a probe
    out : folder in which finished runs are stored and found again
    progress : function of (runs done, runs in total, next run); jobs, dask : processes for the runs, as in `sweep`
    Raises CaseError for an invalid case, and FvsolveError for unknown names, for numbers out of range, for a case with
    basins, and if a reference is not accurate enough.
    """
    case = load(case, dict(set or {}))
    refuse_basins(case, "map")
    case = load(case, fixed_choices(case))
    if not (math.isfinite(tolerance) and tolerance > 0):
        raise FvsolveError(
            f"--tolerance {tolerance} is out of range; expected a positive number, for example 0.02"
        )
    base = {"output.every": (case.numerics.end - case.numerics.start) / OUTPUT_ROWS}
    column_set = map_columns(case, base, courants, steps, key)
    own_schemes = name_list(schemes) or default_schemes(case, column_set)
    schemes, methods = _check_names(own_schemes, name_list(methods) or METHODS)
    places = [
        (scheme, method, k)
        for scheme in schemes
        for method in methods
        for k in range(len(column_set.sets))
    ]
    squares, report = [], progress or (lambda *_: None)
    with cache_in(out) as points, RunQueue(case, jobs, dask) as queue:
        trials = MapRuns(case, base, column_set, tolerance, points, queue)
        if not queue.in_process:
            trials.run_ahead(places, report)
        for scheme, method, k in places:
            report(len(squares), len(places), f"{scheme}, {method}, {column_set.label(k)}")
            squares.append(trials.square(scheme, method, k))
        reference = trials.reference(0)
        words = f"{reference.words}, checked by {reference.second}"
    limited = tuple(name for name in schemes if name in LIMITED and column_set.wave_rate)
    return FailureMap(
        case.name,
        column_set.name,
        tuple(column_set.values),
        schemes,
        methods,
        tuple(squares),
        tolerance,
        words,
        trials.uncertainty,
        column_set.wave_rate,
        limited,
        bool(delay_lines(case)),
    )


class MapRuns:
    """Runs of one failure map, with their references, predicted limits and verdicts.

    base : keys and values that all runs set; column_set : columns of the map; points : cache of finished runs
    collecting : True while `missing_runs` lists the runs that are not in the cache; only references are run meanwhile
    """

    def __init__(
        self,
        case,
        base: dict,
        column_set: Columns,
        tolerance: float,
        points: ResultCache,
        queue: RunQueue,
    ) -> None:
        self.case, self.base, self.columns, self.tolerance, self.cache = (
            case,
            base,
            column_set,
            tolerance,
            points,
        )
        self.queue, self.collecting = queue, False
        self.span = column_set.span
        self._references: dict[int, Reference] = {}
        self._spectra: dict[tuple, np.ndarray | None] = {}
        self._limits: dict[tuple, float | None] = {}
        self._delay_line_limits: dict[int, WaveGrowthLimit] = {}

    @property
    def uncertainty(self) -> float:
        """Greatest uncertainty of all references, relative to the range of a probe."""
        return max(reference.uncertainty.trajectory for reference in self._references.values())

    def reference(self, k: int) -> Reference:
        """Reference for column k; columns that differ only in the step share one reference.

        Raises FvsolveError if the reference is not accurate enough for the tolerance.
        """
        at = k if self.columns.keys(k) else 0
        if at not in self._references:
            finest, stiff = {**self.base, **self.columns.keys(k)}, self.columns.stiff(k)
            finest |= cells_for_delay_lines(self.case, finest)
            reference = find_reference(self.case, finest, stiff=stiff, queue=self.queue)
            uncertainty = reference.uncertainty.trajectory
            if uncertainty > self.tolerance / 2:
                raise FvsolveError(
                    f"the reference is not accurate enough: its error may be {uncertainty:.2g} of the range of "
                    f"{reference.uncertainty.worst or 'a probe'}, but the tolerance is {self.tolerance:g}; try "
                    f"--tolerance {4 * uncertainty:.1g}, or more cells if the case has cells; if this probe shows only "
                    "rounding, remove this probe from output.probes"
                )
            self._references[at] = reference
        return self._references[at]

    def limit(self, scheme: str, method: str, k: int) -> float | None:
        """Greatest stable step [s] in column k, by eigenvalues and by waves in delay lines; None if one is unknown.

        It is inf for steps that the run itself divides where they are too long.
        """
        at = scheme, k if self.columns.keys(k) else 0
        if self.is_divided(method, scheme, k):
            return math.inf
        if at not in self._spectra:
            keys = {**self.base, **self.columns.keys(k), "numerics.scheme": scheme}
            self._spectra[at] = eigenvalues_of(self.case, keys)
        eigenvalues = self._spectra[at]
        if (method, *at) not in self._limits:
            of_modes = None if eigenvalues is None else modes_step(method, eigenvalues, self.span)
            both = of_modes, self.lines_limit(method, *at)
            self._limits[method, *at] = None if None in both else min(both)
        return self._limits[method, *at]

    def is_divided(self, method: str, scheme: str, k: int) -> bool:
        """True if a run with this method divides all steps that are too long: explicit given steps of delay lines."""
        step = self.columns.sets[k].get("numerics.step")
        if step is None or not (method not in KNOWN_METHODS or KNOWN_METHODS[method].explicit):
            return False
        case = load(self.case, {**self.base, **self.columns.keys(k), "numerics.scheme": scheme})
        if not delay_lines(case):
            return False
        model = build(case)
        return dividing_rate(model, step) > 0.0 and not model.tables.settings["rate"][0] > 0.0

    def lines_limit(self, method: str, scheme: str, k: int) -> float | None:
        """Predicted greatest step [s] in column k at which waves between storing nodes and delay lines hardly grow.

        It is the result of `WaveGrowthLimit`; inf without delay lines, or without fixed steps.
        """
        set = {**self.base, **self.columns.keys(k), "numerics.scheme": scheme}
        steps = [keys["numerics.step"] for keys in self.columns.sets if "numerics.step" in keys]
        if not steps or not delay_lines(load(self.case, set)):
            return math.inf
        if k not in self._delay_line_limits:
            self._delay_line_limits[k] = WaveGrowthLimit(self.case, set, steps)
        return self._delay_line_limits[k](method)

    def square(self, scheme: str, method: str, k: int) -> Square:
        """Run of a scheme and a method in column k, with its verdict.

        If only the error decides on the verdict and is above the tolerance, a run with half the step follows, and if
        that does not help, one with a quarter. Implicit methods are not run for more than 50 000 steps.
        """
        trial = {
            **self.base,
            **self.columns.sets[k],
            "numerics.scheme": scheme,
            "numerics.method": method,
        }
        step, waves = trial.get("numerics.step"), self.columns.wave_rate
        limit, errors = self.limit(scheme, method, k), []

        def shorter() -> Measures:
            measures = self.measure(
                {**trial, **_shorter_steps(self.case, trial, 2 ** (len(errors) + 1))}, k
            )
            errors.append(measures.error)
            return measures

        explicit = method not in KNOWN_METHODS or KNOWN_METHODS[method].explicit
        if step and self.span / step > MAX_IMPLICIT_STEPS and not explicit:
            run, word = Measures(f"{self.span / step:.0f} implicit steps", False), NOT_RUN
        else:
            run = self.measure(trial, k)
            word = verdict(run, shorter, self.tolerance)
        courant = step * waves if step and waves else None
        return Square(
            scheme, method, k, step, courant, word, run, errors[0] if errors else None, limit
        )

    def run_ahead(self, places: Sequence[tuple[str, str, int]], report: Progress) -> None:
        """Make all runs in other processes, shorter steps last; places : (scheme, method, column) of each square."""
        while missing := self.missing_runs(places):
            # the most expensive last
            missing.sort(key=lambda run: -run.trial.get("numerics.step", 0.0))
            requests = [RunRequest(run_recorded, run.keys) for run in missing]
            for count, at in enumerate(self.queue.run_ahead(requests), 1):
                self.measure(missing[at].trial, missing[at].column)
                report(count, len(missing), f"{len(places)} squares")

    def missing_runs(self, places: Sequence[tuple[str, str, int]]) -> list[MissingRun]:
        """Runs that the squares of the map need next and that are not in the cache, each once."""
        missing, self.collecting = {}, True
        for place in places:
            try:
                self.square(*place)
            except MissingRun as run:
                missing[repr(run.trial)] = run
        self.collecting = False
        return [*missing.values()]

    def measure(self, trial: dict, k: int) -> Measures:
        """Measures of a run with the keys `trial` against the reference of column k, taken from the cache if possible.

        Raises MissingRun for a run that is not in the cache while `missing_runs` collects such runs.
        """
        # no rows between two steps
        every = max(trial["output.every"], trial.get("numerics.step", 0.0))
        reference, run = self.reference(k), {**trial, "output.every": every}
        extra = {"study": "map", "set": trial, "reference": reference.words}
        if self.collecting and self.cache.find(self.case, extra) is None:
            raise MissingRun(trial, run, k)

        def make() -> dict:
            return asdict(
                measure_run(*self.queue(self.case, RunRequest(run_recorded, run)), reference)
            )

        data = self.cache.get(self.case, extra, make)
        return Measures(
            **{name: math.nan if value is None else value for name, value in data.items()}
        )


class MissingRun(Exception):
    """Signal that a run is not in the cache.

    trial : keys and values of the run, under which its result is stored
    keys : the keys and values of `trial`, with an output interval of at least one step
    column : number of the column whose reference the run is compared with
    """

    def __init__(self, trial: dict, keys: dict, column: int) -> None:
        super().__init__(repr(trial))
        self.trial, self.keys, self.column = trial, keys, column


def _shorter_steps(case, trial: dict, ratio: int) -> dict:
    """Key and value that shorten the steps of the run `trial` by `ratio`; a tolerance is divided by ratio^2."""
    factors = {"numerics.step": ratio, "numerics.courant": ratio, "numerics.rtol": ratio**2}
    own = {key: getattr(case.numerics, key.removeprefix("numerics.")) for key in factors}
    for values in (trial, own):
        for key, factor in factors.items():
            if values.get(key) is not None:
                return {key: values[key] / factor}
    return {}


def _check_names(*given: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Given schemes and given methods, both without repetition. Raises FvsolveError for an unknown name."""
    from fvsolve.case.sections import MethodNames
    from fvsolve.core.schemes import SCHEMES

    for kind, requested, known in zip(
        ("scheme", "method"), given, (tuple(SCHEMES), tuple(MethodNames())), strict=True
    ):
        for name in requested:
            if name not in known:
                raise FvsolveError(f'no {kind} named "{name}"{did_you_mean(name, known)}')
    return tuple(dict.fromkeys(given[0])), tuple(dict.fromkeys(given[1]))
