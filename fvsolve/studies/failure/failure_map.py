"""Failure map of a case: verdicts on runs of all methods over steps, or over values of a key."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from fvsolve.case import load
from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.schemes import LIMITED
from fvsolve.steppers.tableau import METHODS as KNOWN_METHODS
from fvsolve.studies.failure.map_columns import (
    Columns,
    WaveGrowthLimit,
    cells_for_delay_lines,
    default_schemes,
    eigenvalues_of,
    greatest_step,
    map_columns,
)
from fvsolve.studies.failure.run_verdict import NOT_RUN, Measures, measure_run, run_recorded, verdict
from fvsolve.studies.outcome import STUDY_ARGUMENTS, Progress, name_list, refuse_basins
from fvsolve.studies.parallel import RunQueue, RunRequest
from fvsolve.studies.reference import Reference, find_reference
from fvsolve.studies.resolution import delay_lines, fixed_choices
from fvsolve.studies.result_cache import OUT, ResultCache, cache_in
from fvsolve.studies.result_table import PlainData
from fvsolve.validation import NAMES, NUMBER, NUMBERS, ROW, TEXT, Kind, is_row, validated

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
        return [square for square in self.squares if (square.scheme, square.method) == (scheme, method)]


KEY_VALUES = Kind(
    lambda value: (
        is_row(value, lambda item: True) and len(value) == 2 and TEXT.accepts(value[0]) and ROW.accepts(value[1])
    ),
    'a key and its values, for example ("links.main.cells", [20, 40])',
)


@validated(
    schemes=NAMES,
    methods=NAMES,
    courants=NUMBERS,
    steps=NUMBERS,
    key=KEY_VALUES,
    tolerance=NUMBER,
    out=OUT,
    **STUDY_ARGUMENTS,
)
def failure_map(
    case, schemes: Sequence[str] | None = None, methods: Sequence[str] | None = None,
    courants: Sequence[float] | None = None, steps: Sequence[float] | None = None,
    key: tuple[str, Sequence] | None = None, tolerance: float = TOLERANCE, out: str | Path | ResultCache | None = None,
    progress: Progress | None = None, set: Mapping | None = None, jobs: int = 1, dask: str | None = None,
) -> FailureMap:  # fmt: skip
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
        raise FvsolveError(f"--tolerance {tolerance} is out of range. Expected a positive number, for example 0.02")
    base = {"output.every": (case.numerics.end - case.numerics.start) / OUTPUT_ROWS}
    column_set = map_columns(case, base, courants, steps, key)
    own_schemes = name_list(schemes) or default_schemes(case, column_set)
    schemes, methods = _check_names(own_schemes, name_list(methods) or METHODS)
    places = [(scheme, method, k) for scheme in schemes for method in methods for k in range(len(column_set.sets))]
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
        case.name, column_set.name, tuple(column_set.values), schemes, methods, tuple(squares), tolerance,
        words, trials.uncertainty, column_set.wave_rate, limited, bool(delay_lines(case)),
    )  # fmt: skip


class MapRuns:
    """Runs of one failure map, with their references, predicted limits and verdicts.

    base : keys and values that all runs set; column_set : columns of the map; points : cache of finished runs
    collecting : True while `missing_runs` lists the runs that are not in the cache; only references are run meanwhile
    """

    def __init__(
        self, case, base: dict, column_set: Columns, tolerance: float, points: ResultCache, queue: RunQueue
    ) -> None:
        self.case, self.base, self.columns, self.tolerance, self.cache = case, base, column_set, tolerance, points
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
                    f"{reference.uncertainty.worst or 'a probe'}, but the tolerance is {self.tolerance:g}. Try "
                    f"--tolerance {4 * uncertainty:.1g}, or more cells if the case has cells; if this probe shows only "
                    "rounding, remove this probe from output.probes"
                )
            self._references[at] = reference
        return self._references[at]

    def limit(self, scheme: str, method: str, k: int) -> float | None:
        """Predicted greatest stable step [s] in column k: the lesser limit of eigenvalues and of waves in delay lines.

        The result is None if one of these limits is not known.
        """
        at = scheme, k if self.columns.keys(k) else 0
        if at not in self._spectra:
            keys = {**self.base, **self.columns.keys(k), "numerics.scheme": scheme}
            self._spectra[at] = eigenvalues_of(self.case, keys)
        eigenvalues = self._spectra[at]
        if (method, *at) not in self._limits:
            of_modes = None if eigenvalues is None else greatest_step(method, eigenvalues, self.span)
            both = of_modes, self.lines_limit(method, *at)
            self._limits[method, *at] = None if None in both else min(both)
        return self._limits[method, *at]

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
        trial = {**self.base, **self.columns.sets[k], "numerics.scheme": scheme, "numerics.method": method}
        step, waves = trial.get("numerics.step"), self.columns.wave_rate
        limit, errors = self.limit(scheme, method, k), []

        def shorter() -> Measures:
            measures = self.measure({**trial, **_shorter_steps(self.case, trial, 2 ** (len(errors) + 1))}, k)
            errors.append(measures.error)
            return measures

        explicit = method not in KNOWN_METHODS or KNOWN_METHODS[method].explicit
        if step and self.span / step > MAX_IMPLICIT_STEPS and not explicit:
            run, word = Measures(f"{self.span / step:.0f} implicit steps", False), NOT_RUN
        else:
            run = self.measure(trial, k)
            word = verdict(run, shorter, self.tolerance)
        courant = step * waves if step and waves else None
        return Square(scheme, method, k, step, courant, word, run, errors[0] if errors else None, limit)

    def run_ahead(self, places: Sequence[tuple[str, str, int]], report: Progress) -> None:
        """Make all runs in other processes: first with the steps of the columns, then the runs with shorter steps.

        places : scheme, method and column of each square of the map; report : progress function of `failure_map`
        """
        while missing := self.missing_runs(places):
            missing.sort(key=lambda run: -run.trial.get("numerics.step", 0.0))  # the most expensive last
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
        every = max(trial["output.every"], trial.get("numerics.step", 0.0))  # no rows between two steps
        reference, run = self.reference(k), {**trial, "output.every": every}
        extra = {"study": "map", "set": trial, "reference": reference.words}
        if self.collecting and self.cache.find(self.case, extra) is None:
            raise MissingRun(trial, run, k)

        def make() -> dict:
            return asdict(measure_run(*self.queue(self.case, RunRequest(run_recorded, run)), reference))

        data = self.cache.get(self.case, extra, make)
        return Measures(**{name: math.nan if value is None else value for name, value in data.items()})


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
    """Key and value that shorten the steps of a run by the factor `ratio`; a tolerance is divided by ratio^2.

    trial : keys and values of the run with the original step
    """
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
    from fvsolve.schemes import SCHEMES

    for kind, requested, known in zip(("scheme", "method"), given, (tuple(SCHEMES), tuple(MethodNames())), strict=True):
        for name in requested:
            if name not in known:
                raise FvsolveError(f'no {kind} named "{name}"{did_you_mean(name, known)}')
    return tuple(dict.fromkeys(given[0])), tuple(dict.fromkeys(given[1]))
