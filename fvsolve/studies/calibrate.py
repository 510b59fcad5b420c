"""Values of keys by which runs come nearest to what was measured, and how sure they are. Knows runs and SciPy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve.case import Case, load
from fvsolve.doors import AMOUNT, CALL, COUNT, TABLE, TEXT, door
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.run.comparison import interpolated
from fvsolve.studies.many import many
from fvsolve.studies.outcome import refusal
from fvsolve.studies.plans import ranges, sampled
from fvsolve.studies.row import RowMaker
from fvsolve.studies.sheet import Column, Plain, Sheet
from fvsolve.studies.sweep import VARY

FIRST = 16  # points of the sample a key, among which the descent begins
DESCENTS = 3  # from the best of them
STEP = 1e-4  # of the range, over which slopes are taken
TIED = 0.999  # of a correlation, beyond which two keys are not told apart
EDGE = 1e-3  # of the range, within which a value lies at an end
ROUNDS = 6  # of weights, at most
SETTLED = 0.01  # of a weight, by which the next round may change it
LEAST = 1e-6  # of the range of a series, which its scatter is at least: digits of files, and steps
FAILED = 1e6  # what stands for the differences of a run that failed


@dataclass(frozen=True)
class Calibration(Plain):
    """What came nearest.

    values, sigma : by key [SI], and their standard deviations as the scatter of each series tells them, infinite where
    nothing does;
    correlation : of their errors, rows and columns as keys; rms : by probe, differences in its SI unit
    doubts : in words, what the measurements cannot tell; runs : how many it took
    """

    values: dict[str, float]
    sigma: dict[str, float]
    correlation: list[list[float]]
    rms: dict[str, float]
    doubts: list[str] = field(default_factory=list)
    runs: int = 0

    @property
    def sheet(self) -> Sheet:
        """A row for each key."""
        rows = [{"key": key, "value": value, "sigma": self.sigma[key]} for key, value in self.values.items()]
        return Sheet([Column("key"), Column("value", words=".8g"), Column("sigma", words=".3g")], rows)


class Differences(RowMaker):
    """What makes differences of values of keys: computed less measured, of each series in shares of its range."""

    def __call__(self, values: Mapping[str, Any]) -> list[np.ndarray] | str:
        """Of each series; why there are none, where the run failed."""
        from fvsolve.run import run

        try:
            case = self.read(values)
            result = run(case)
        except CaseError as error:
            return refusal(error)
        if result.reason.startswith("interrupted"):
            raise KeyboardInterrupt
        if result.reason != "finished":
            return result.reason
        found = []
        for one in case.compare.values():
            time = one.t + one.shift
            within = (time >= case.numerics.start) & (time <= case.numerics.end)
            computed = interpolated(result.seconds, result.si(one.probe.text), time[within])
            if not np.isfinite(computed).all():
                return f"{one.probe.text} is not finite"
            found.append((computed - one.v[within]) / spread(one.v))
        return found

    def lost(self, values: Mapping[str, Any]) -> str:
        return "lost"


def spread(measured: np.ndarray) -> float:
    """The range of a series, by which it is weighed beside others."""
    return float(np.ptp(measured)) or 1.0


@door(free=VARY, set=TABLE, seed=AMOUNT, jobs=COUNT, dask=TEXT, progress=CALL)
def calibrate(
    case,
    free: Mapping[str, Sequence[Any]],
    set: Mapping[str, Any] | None = None,
    seed: int = 0,
    jobs: int = 1,
    dask: str | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> Calibration:
    """Fit keys within their ranges to the series of `[compare]`, by least squares (`scipy.optimize.least_squares`).

    Of several series each is weighed by its own scatter about the fit, in rounds from equal weights (Aitken 1935).

    A sample of all ranges comes first, `jobs` at a time, and descents begin at the best of it: waves that are out of
    phase have many valleys. Raises FvsolveError where there is nothing to compare with, and where no run succeeds.
    """
    read = load(case, set)
    if not free:
        raise FvsolveError("nothing is free; give the two ends of a key at least, links.main.wave_speed=900,1300")
    if not read.compare:
        raise FvsolveError("nothing to fit to: the case has no [compare] with a measured series")
    bounds = ranges(read, free)
    points = sampled(read, free, f"sobol:{FIRST * len(bounds)}", seed)
    return Fitting(read, bounds, points, progress or (lambda done, total, what: None)).found(jobs, dask)


class Fitting:
    """One fit while it lasts; unknowns are shares of their ranges."""

    def __init__(self, case: Case, bounds: dict[str, tuple[float, float]], points: list[dict], told: Callable) -> None:
        self.case, self.bounds, self.points, self.told = case, bounds, points, told
        self.low, high = (np.array(side) for side in zip(*bounds.values(), strict=True))
        self.width = high - self.low
        self.work, self.runs = Differences(case, {"expect": {}}), 0
        self.weights = np.ones(len(case.compare))

    def found(self, jobs: int, dask: str | None) -> Calibration:
        """The best of all descents, with what it is worth."""
        from scipy.optimize import least_squares

        answers = [self.descend(least_squares, x) for x in self.beginnings(jobs, dask)]
        best = min(answers, key=lambda one: one.cost)
        for _ in range(ROUNDS if self.weights.size > 1 else 0):
            before, self.weights = self.weights, 1.0 / self.scatter(best)
            if np.allclose(self.weights / self.weights[0], before / before[0], rtol=SETTLED):
                break
            best = self.descend(least_squares, best.x)
        return self.judged(best)

    def scatter(self, answer: Any) -> np.ndarray:
        """Standard deviation of each series about the fit, in shares of its range: its squares over its points less
        its share of the keys, the trace of its part of J (J' J)^-1 J'. All together's where a series has no more."""
        found = self.differences(answer.x)
        parts = np.split(answer.jac, np.cumsum([one.size for one in found])[:-1])
        inverse = np.linalg.pinv(answer.jac.T @ answer.jac)
        free = np.array([len(part) - np.einsum("ij,jk,ik->", part, inverse, part) for part in parts])
        squares = np.array([float(one @ one) for one in found])
        pooled = squares.sum() / max(1.0, sum(one.size for one in found) - answer.x.size)
        return np.sqrt(np.maximum(np.where(free > 1.0, squares / np.maximum(free, 1.0), pooled), LEAST**2))

    def weighed(self, found: list[np.ndarray]) -> np.ndarray:
        """Differences of all series, each over its own scatter."""
        return np.concatenate([weight * one for weight, one in zip(self.weights, found, strict=True)])

    def beginnings(self, jobs: int, dask: str | None) -> list[np.ndarray]:
        """The best points of the sample."""
        costs, why = np.full(len(self.points), np.inf), ""
        for k, answer in many(self.work, self.points, jobs, dask):
            self.runs += 1
            self.told(self.runs, len(self.points), "of a sample, then descents")
            if isinstance(answer, str):
                why = why or answer
            else:
                costs[k] = sum(float(one @ one) for one in answer)
        if not np.isfinite(costs).any():
            raise FvsolveError(f"no run of the sample came to its end: {why}")
        best = [k for k in np.argsort(costs, kind="stable")[:DESCENTS] if np.isfinite(costs[k])]
        return [(np.array([*self.points[k].values()]) - self.low) / self.width for k in best]

    def descend(self, least_squares: Callable, x: np.ndarray) -> Any:
        """From one point, by slopes over a small share of the ranges."""
        size = sum(one.size for one in self.differences(x))

        def misfit(x: np.ndarray) -> np.ndarray:
            found = self.differences(x)
            return self.weighed(found) if found else np.full(size, FAILED)

        def slopes(x: np.ndarray) -> np.ndarray:
            return np.column_stack([self.slope(x, k, size) for k in range(x.size)])

        return least_squares(misfit, x, slopes, bounds=(0.0, 1.0), x_scale=1.0, xtol=1e-10, ftol=1e-10)

    def slope(self, x: np.ndarray, k: int, size: int) -> np.ndarray:
        """What unknown k changes, between the farthest two runs near a point that come to their end; 0 of fewer."""
        ran = []
        for at in (x[k] - STEP, x[k] + STEP, x[k]):
            near = np.clip(np.where(np.arange(x.size) == k, at, x), 0.0, 1.0)
            if len(ran) < 2 and (found := self.differences(near)):
                ran.append((near[k], self.weighed(found)))
        return (ran[1][1] - ran[0][1]) / (ran[1][0] - ran[0][0]) if len(ran) == 2 else np.zeros(size)

    def differences(self, x: np.ndarray) -> list[np.ndarray]:
        """Of each series at a point; nothing where its run fails."""
        self.runs += 1
        answer = self.work(self.values(x))
        self.told(len(self.points), len(self.points), f"{self.runs} runs")
        return [] if isinstance(answer, str) else answer

    def values(self, x: np.ndarray) -> dict[str, float]:
        return dict(zip(self.bounds, (self.low + x * self.width).tolist(), strict=True))

    def judged(self, answer: Any) -> Calibration:
        """Values, and what their slopes say of them."""
        keys, found = [*self.bounds], self.differences(answer.x)
        free = max(1, answer.fun.size - answer.x.size)
        scatter = 2.0 * answer.cost / free
        covariance, doubts = told_apart(answer.jac, keys)
        sigma = np.sqrt(scatter * np.diag(covariance)) * self.width
        sigma[[any(said.startswith(f"{key} changes nothing") for said in doubts) for key in keys]] = np.inf
        root = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(root, root)
        np.fill_diagonal(correlation, 1.0)
        doubts += [f"{key} lies at an end of its range" for key, x in zip(keys, answer.x, strict=True)
                   if min(x, 1.0 - x) <= EDGE]  # fmt: skip
        series = self.case.compare.values()
        rms = {one.probe.text: spread(one.v) * float(np.sqrt(np.mean(own**2)))
               for one, own in zip(series, found, strict=True)}  # fmt: skip
        return Calibration(self.values(answer.x), dict(zip(keys, sigma.tolist(), strict=True)),
                           correlation.tolist(), rms, doubts, self.runs)  # fmt: skip


def told_apart(slopes: np.ndarray, keys: list[str]) -> tuple[np.ndarray, list[str]]:
    """(inverse of J' J, what it says cannot be told, in words) for slopes J over shares of ranges.

    Keys that leave all as it is have no say in it; along a direction in which nothing changes the inverse is bounded.
    """
    u, s, v = np.linalg.svd(slopes, full_matrices=False)
    floor = max(float(s[0]), 1e-300) * 1e-9 if s.size else 0.0
    inverse = (v.T / np.maximum(s, floor) ** 2) @ v
    root = np.sqrt(np.diag(inverse))
    still = [key for key, size in zip(keys, np.linalg.norm(slopes, axis=0), strict=True) if size <= floor]
    doubts = [f"{key} changes nothing that was measured" for key in still]
    for j, one in enumerate(keys):
        for k, other in enumerate(keys[:j]):
            tied = float(inverse[j, k] / (root[j] * root[k]))
            if abs(tied) > TIED and one not in still and other not in still:
                doubts.append(f"{other} and {one} cannot be told apart: their errors correlate by {tied:.5f}")
    return inverse, doubts
