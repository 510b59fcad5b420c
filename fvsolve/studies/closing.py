"""A law over time that makes a peak small: straight pieces between a few knots. Knows runs; knows no physics."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve.case import Case, load
from fvsolve.case.text import path
from fvsolve.errors import CaseError, Fault, FvsolveError, did_you_mean, gathered, listing
from fvsolve.parts.schedule import Schedule
from fvsolve.run import run
from fvsolve.units import show

STARTS = (0.0, 1.0, -1.0)  # how much quicker, in logarithms, the first piece is than the last, of laws that begin
MOST_KNOTS = 12
REACH = 1.0  # of the first simplex about a start


@dataclass(frozen=True)
class ValveLaw:
    """A law and what it makes of the peak: times [s] and values [SI] of its knots, the peak in `unit`."""

    time: list[float]
    value: list[float]
    peak: float | None


@dataclass(frozen=True)
class Optimum:
    """The law of the key that makes `minimise` least, beside the linear one; runs : how many were made."""

    key: str
    minimise: str
    unit: str
    linear: ValveLaw
    best: ValveLaw
    runs: int
    laws: list[ValveLaw] = field(default_factory=list)

    def plain(self) -> dict[str, Any]:
        """As JSON says it."""
        return {"key": self.key, "minimise": self.minimise, "unit": self.unit, "linear": vars(self.linear),
                "best": vars(self.best), "runs": self.runs, "laws": [vars(law) for law in self.laws]}  # fmt: skip

    @property
    def schedule(self) -> str:
        """What the case would say."""
        times, values = ([float(f"{x:.6g}") for x in row] for row in (self.best.time, self.best.value))
        return f"{self.key.rpartition('.')[2]} = {{ time = {times}, value = {values} }}"


class Search:
    """One search while it lasts: laws between two times and two values, by the logarithms of their pieces' rises."""

    def __init__(self, case: Case, key: str, minimise: str, span: tuple, knots: int, progress: Callable | None) -> None:
        self.case, self.key, self.minimise, self.knots, self.progress = case, key, minimise, knots, progress
        self.begin, self.end, self.first, self.last = span
        self.laws: list[ValveLaw] = []
        self.unit = self.why = ""

    def law(self, z: np.ndarray) -> tuple[list[float], list[float]]:
        """Times and values of the knots; z : float64[knots], logarithms of rises over that of the last piece."""
        rises = np.exp(np.clip(np.append(z, 0.0), -12.0, 12.0))
        shares = np.concatenate([[0.0], np.cumsum(rises / rises.sum())])
        shares[-1] = 1.0
        times = np.linspace(self.begin, self.end, shares.size)
        return times.tolist(), (self.first + (self.last - self.first) * shares).tolist()

    def __call__(self, z: np.ndarray) -> float:
        """The peak of a law; infinite where its run does not come to its end."""
        time, value = self.law(z)
        quiet = {"output.fields": 0, "output.lines": {}, "expect": claim(self.minimise)}
        result = run(load(self.case, {self.key: {"time": time, "value": value}, **quiet}))
        if result.reason.startswith("interrupted"):
            raise KeyboardInterrupt
        found = result.expectations[0]
        self.unit = found.unit
        peak = found.found if result.ok else None
        self.laws.append(ValveLaw(time, value, peak))
        self.why = self.why or ("" if result.ok else result.reason)
        if self.progress is not None:
            self.progress(len(self.laws), "no end" if peak is None else f"{peak:.6g} {found.unit}")
        return np.inf if peak is None else peak


def optimise(
    case, key: str, minimise: str, knots: int = 3, runs: int = 60, set: Mapping[str, Any] | None = None,
    progress: Callable | None = None,
) -> Optimum:  # fmt: skip
    """The law of a schedule between its two ends that makes a peak least, by straight pieces between inner knots.

    key : of a schedule that goes from one value to another, such as a ramp; minimise : what `[expect]` knows,
    "max(gate.pressure)" or "greatest(main.head)"; it goes one way, as its linear law does, and takes as long. Simplexes
    of Nelder and Mead 1965 from laws that are linear, quick and slow at first. Raises FvsolveError for what is no such
    schedule and where no run has a finite peak, CaseError for what is no case.
    """
    from scipy.optimize import minimize

    faults: list[Fault] = []
    made = None
    with gathered(faults):
        made = load(case, dict(set or {}))
    faults += asked(made, key, minimise, knots, runs)
    if faults:
        raise CaseError(faults, "case" if made is None else made.name)
    search = Search(made, key, minimise, span_of(made, key), knots, progress)
    search(np.zeros(knots))
    for k, start in enumerate(STARTS):
        z = start * np.linspace(2.0, 0.0, knots + 1)[:-1]
        simplex = np.vstack([z, z + REACH * np.eye(knots)])
        left = (runs - len(search.laws)) // (len(STARTS) - k)
        minimize(search, z, method="Nelder-Mead",
                 options={"maxfev": left, "initial_simplex": simplex, "xatol": 1e-2, "fatol": 0.0})  # fmt: skip
    if all(law.peak is None for law in search.laws):
        raise FvsolveError(f"no law gives {minimise} a finite value: {search.why or 'it is not a number'}")
    linear = search.laws[0]
    best = min(search.laws, key=lambda law: np.inf if law.peak is None else law.peak)
    return Optimum(key, minimise, search.unit, linear, best, len(search.laws), search.laws)


def asked(case: Case | None, key: str, minimise: str, knots: int, runs: int) -> list[Fault]:
    """All that is wrong of a search before it runs; case : None where it is at fault itself."""
    faults: list[Fault] = []
    least = len(STARTS) * (min(max(knots, 1), MOST_KNOTS) + 2)
    if not 1 <= knots <= MOST_KNOTS:
        faults.append(Fault("knots", f"{knots} is out of range; wanted 1 to {MOST_KNOTS}"))
    if runs < least:
        faults.append(Fault("runs", f"{runs} are too few; wanted {least} or more for {least // len(STARTS) - 2} knots"))
    if case is not None:
        with gathered(faults, f"--law {key}"):
            span_of(case, key)
        claimed: list[Fault] = []
        with gathered(claimed):
            load(case, {"expect": claim(minimise)})
        faults += [Fault(f"--minimise {minimise}", one.message) for one in claimed]
    return faults


def claim(minimise: str) -> dict[str, Any]:
    """`[expect]` that asks for a peak alone."""
    return {minimise: {"value": 1.0, "atol": 1.0}}


def span_of(case: Case, key: str) -> tuple[float, float, float, float]:
    """(begin, end [s], first, last value [SI]) of the schedule under a key; FvsolveError where none moves there."""
    laws = dict(schedules(case))
    schedule = laws.get(key)
    if schedule is None:
        near = did_you_mean(key, laws)
        moving = [name for name, one in laws.items() if not one.constant] or ["none"]
        raise FvsolveError(f"is no schedule of this case{near or f'; those that move are {listing(moving)}'}")
    if schedule.constant or schedule.kind not in ("linear", "smooth", "ramp") or len(schedule.time) < 2:
        example = '{ start = "1 s", duration = "10 s", value = [1, 0] }'
        raise FvsolveError(f"does not go from one value to another; wanted a ramp or a table, such as {example}")
    ends = float(schedule.time[0]), float(schedule.time[-1]), float(schedule.value[0]), float(schedule.value[-1])
    if ends[2] == ends[3]:
        raise FvsolveError(f"begins and ends at {show(ends[2])}; wanted a law from one value to another")
    return ends


def schedules(case: Case) -> Iterator[tuple[str, Schedule]]:
    """Schedules of parts, by their keys."""
    for group in ("nodes", "links"):
        for name, part in getattr(case, group).items():
            said = {info.alias or field: getattr(part, field) for field, info in type(part).model_fields.items()}
            yield from ((path((group, name, key)), one) for key, one in said.items() if isinstance(one, Schedule))
