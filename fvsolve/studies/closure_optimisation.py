"""Optimisation of a piecewise-linear schedule, such as a valve closure, for the least peak."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve.case import Case, load
from fvsolve.case.text import path
from fvsolve.core.output.result_table import PlainData
from fvsolve.core.run import run
from fvsolve.declarations import declared
from fvsolve.errors import Fault, FvsolveError, collect_faults, did_you_mean, listing
from fvsolve.parts.schedule import Schedule
from fvsolve.studies.outcome import NO_FIELDS, checked_case, end_if_interrupted
from fvsolve.units import show

# half the log ratio of the first slope to the last, of schedules at the start
START_SHAPES = 0.0, 1.0, -1.0
MAX_KNOTS = 12
SIMPLEX_SIZE = 1.0  # edge length of the first simplex


@dataclass(frozen=True)
class ValveSchedule:
    """Piecewise-linear schedule and the peak of its run.

    time, value : times [s] and values [SI] of all knots, including both ends; peak : peak in the unit `Optimum.unit`,
    None if the run failed or the peak is not known
    """

    time: list[float]
    value: list[float]
    peak: float | None


@dataclass(frozen=True)
class Optimum(PlainData):
    """Result of an optimisation of a schedule.

    key : key of the schedule; minimise : quantity whose peak is minimised, such as "max(gate.pressure)"
    unit : unit of the peaks; best : schedule with the least peak; linear : linear schedule, for comparison
    runs : number of runs; laws : schedules of all runs in order
    """

    key: str
    minimise: str
    unit: str
    linear: ValveSchedule
    best: ValveSchedule
    runs: int
    laws: list[ValveSchedule] = field(default_factory=list)

    @property
    def schedule(self) -> str:
        """Best schedule as a line of TOML for the case file."""
        times, values = (
            [float(f"{x:.6g}") for x in row] for row in (self.best.time, self.best.value)
        )
        return f"{self.key.rpartition('.')[2]} = {{ time = {times}, value = {values} }}"


class ClosureSearch:
    """Search for the schedule with the least peak, between fixed end times and end values.

    The schedule has knots + 1 linear pieces of equal duration. The unknowns are z : float64[knots], for each piece
    except the last the logarithm of (change of value over the piece / change over the last piece).
    span : as returned by `span_of`; other arguments as for `optimise`
    """

    def __init__(
        self,
        case: Case,
        key: str,
        minimise: str,
        span: tuple,
        knots: int,
        progress: Callable | None,
    ) -> None:
        self.case, self.key, self.minimise, self.knots, self.progress = (
            case,
            key,
            minimise,
            knots,
            progress,
        )
        self.begin, self.end, self.first, self.last = span
        self.laws: list[ValveSchedule] = []
        self.unit = self.failure_reason = ""

    def law(self, z: np.ndarray) -> tuple[list[float], list[float]]:
        """(times [s], values [SI]) of all knots of a schedule, including both ends; z : unknowns, as in the class."""
        rises = np.exp(np.clip(np.append(z, 0.0), -12.0, 12.0))
        shares = np.concatenate([[0.0], np.cumsum(rises / rises.sum())])
        shares[-1] = 1.0
        times = np.linspace(self.begin, self.end, shares.size)
        return times.tolist(), (self.first + (self.last - self.first) * shares).tolist()

    def __call__(self, z: np.ndarray) -> float:
        """Peak of a run with the schedule of z, see the class; infinite if the run failed or the peak is not known."""
        time, value = self.law(z)
        keys = {self.key: {"time": time, "value": value}, "expect": peak_expectation(self.minimise)}
        result = run(load(self.case, keys | NO_FIELDS))
        end_if_interrupted(result.reason)
        expectation = result.expectations[0]
        self.unit = expectation.unit
        peak = expectation.found if result.ok else None
        self.laws.append(ValveSchedule(time, value, peak))
        self.failure_reason = self.failure_reason or ("" if result.ok else result.reason)
        if self.progress is not None:
            self.progress(
                len(self.laws), "run failed" if peak is None else f"{peak:.6g} {expectation.unit}"
            )
        return np.inf if peak is None else peak


@declared("study")
def optimise(
    case,
    key: str,
    minimise: str,
    knots: int = 3,
    runs: int = 60,
    set: Mapping[str, Any] | None = None,
    progress: Callable | None = None,
) -> Optimum:
    """Find the piecewise-linear schedule that gives the least peak.

    key : key of a schedule between two values, such as a ramp; minimise : peak to minimise, a quantity as in
    `[expect]`, such as "max(gate.pressure)" or "max(main.head)"
    knots : number of knots between the ends of the schedule; runs : greatest number of runs
    set : key -> value for all runs; progress : called as progress(run, text) after every run

    The result is monotonic, with the end values and the duration of the original schedule. Simplex searches (Nelder and
    Mead 1965) start from three schedules: linear, fast at first, and slow at first. Raises CaseError for an invalid
    case or an unsuitable argument, FvsolveError if no run has a finite peak.
    """
    from scipy.optimize import minimize

    loaded = checked_case(case, set, lambda known: find_faults(known, key, minimise, knots, runs))
    search = ClosureSearch(loaded, key, minimise, span_of(loaded, key), knots, progress)
    search(np.zeros(knots))
    for k, start in enumerate(START_SHAPES):
        z = start * np.linspace(2.0, 0.0, knots + 1)[:-1]
        simplex = np.vstack([z, z + SIMPLEX_SIZE * np.eye(knots)])
        evaluations = (runs - len(search.laws)) // (len(START_SHAPES) - k)
        minimize(
            search,
            z,
            method="Nelder-Mead",
            options={
                "maxfev": evaluations,
                "initial_simplex": simplex,
                "xatol": 1e-2,
                "fatol": 0.0,
            },
        )
    if all(law.peak is None for law in search.laws):
        reason = search.failure_reason or "it is not a number"
        raise FvsolveError(f"no schedule gives {minimise} a finite value: {reason}")
    linear = search.laws[0]
    best = min(search.laws, key=lambda law: np.inf if law.peak is None else law.peak)
    return Optimum(key, minimise, search.unit, linear, best, len(search.laws), search.laws)


def find_faults(case: Case | None, key: str, minimise: str, knots: int, runs: int) -> list[Fault]:
    """Faults of the arguments of `optimise`, found before any run; case : None if the case itself has faults."""
    faults: list[Fault] = []
    fewest = len(START_SHAPES) * (min(max(knots, 1), MAX_KNOTS) + 2)
    if not 1 <= knots <= MAX_KNOTS:
        faults.append(Fault("knots", f"{knots} is out of range; expected 1 to {MAX_KNOTS}"))
    if runs < fewest:
        least = f"expected {fewest} or more for knots = {fewest // len(START_SHAPES) - 2}"
        faults.append(Fault("runs", f"{runs} is too few; {least}"))
    if case is not None:
        with collect_faults(faults, f"--schedule {key}"):
            span_of(case, key)
        load_faults: list[Fault] = []
        with collect_faults(load_faults):
            load(case, {"expect": peak_expectation(minimise)})
        faults += [Fault(f"--minimise {minimise}", fault.message) for fault in load_faults]
    return faults


def peak_expectation(minimise: str) -> dict[str, Any]:
    """Table `[expect]` with the quantity `minimise` alone, so that runs compute its value."""
    return {minimise: {"value": 1.0, "atol": 1.0}}


def span_of(case: Case, key: str) -> tuple[float, float, float, float]:
    """(start time [s], end time [s], first value [SI], last value [SI]) of the schedule of a key.

    Raises FvsolveError for a key that has no schedule between two different values.
    """
    laws = dict(schedules(case))
    schedule = laws.get(key)
    if schedule is None:
        suggestion = did_you_mean(key, laws)
        moving = [name for name, law in laws.items() if not law.constant]
        known = (
            f"Schedules that change: {listing(moving)}"
            if moving
            else "No schedule of this case changes"
        )
        raise FvsolveError(f"is not a schedule of this case{suggestion or f'. {known}'}")
    if (
        schedule.constant
        or schedule.kind not in ("linear", "smooth", "ramp")
        or len(schedule.time) < 2
    ):
        example = '{ start = "1 s", duration = "10 s", value = [1, 0] }'
        raise FvsolveError(
            f"does not change from one value to another; expected a ramp or a table, such as {example}"
        )
    ends = (
        float(schedule.time[0]),
        float(schedule.time[-1]),
        float(schedule.value[0]),
        float(schedule.value[-1]),
    )
    if ends[2] == ends[3]:
        raise FvsolveError(
            f"begins and ends at {show(ends[2])}; expected different values at start and end"
        )
    return ends


def schedules(case: Case) -> Iterator[tuple[str, Schedule]]:
    """Yield (dotted key, schedule) for all scheduled values of the nodes and links of a case."""
    for group in ("nodes", "links"):
        for name, part in getattr(case, group).items():
            values = {
                info.alias or field: getattr(part, field)
                for field, info in type(part).model_fields.items()
            }
            laws = {key: value for key, value in values.items() if isinstance(value, Schedule)}
            yield from ((path((group, name, key)), law) for key, law in laws.items())
