"""Calibration of values in a case against measured series by least squares, with standard deviations."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve.argument_checks import COUNT, COUNT_FROM_ZERO, FUNCTION, TABLE, TEXT, validated
from fvsolve.case import Case, load
from fvsolve.core.output.result_table import Column, PlainData, ResultTable
from fvsolve.core.run.verdicts import interpolated
from fvsolve.declarations import declared
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.studies.outcome import end_if_interrupted, refusal_text
from fvsolve.studies.parallel import TaskPool
from fvsolve.studies.sampling import key_ranges, sample_points
from fvsolve.studies.sweep import VARY
from fvsolve.studies.sweep_row import RowMaker

SAMPLE_PER_KEY = 16  # sample points per key; the minimisations start at the best of them
DESCENTS = 3  # number of minimisations
SLOPE_STEP = 1e-4  # difference step of slopes, as a fraction of the range
CORRELATED = 0.999  # correlation of errors above which two keys cannot be distinguished
# distance from an end of the range, as a fraction of it, below which a value counts as at the end
AT_BOUND = 1e-3
MAX_ROUNDS = 6  # greatest number of rounds of weights
WEIGHT_TOLERANCE = 0.01  # relative change of weights below which the rounds end
# least scatter as a fraction of the range of a series, from digits of files and time steps
LEAST_SCATTER = 1e-6
FAILED_RESIDUAL = 1e6  # residual of a run that failed


@dataclass(frozen=True)
class Calibration(PlainData):
    """Result of a calibration.

    values : key of the case, such as "links.main.wave_speed" -> fitted value [SI]
    sigma : key -> standard deviation of the fitted value [SI], infinite for a key without effect
    correlation : correlation matrix of the errors of the fitted values, in the order of the keys [-]
    rms : probe -> root mean square of the computed minus the measured values [SI]
    doubts : texts on keys that the measurements do not determine, and on values at an end of their range
    runs : number of runs
    """

    values: dict[str, float]
    sigma: dict[str, float]
    correlation: list[list[float]]
    rms: dict[str, float]
    doubts: list[str] = field(default_factory=list)
    runs: int = 0

    @property
    def sheet(self) -> ResultTable:
        """Table with a row for each fitted key: key, value and sigma [SI]."""
        rows = [
            {"key": key, "value": value, "sigma": self.sigma[key]}
            for key, value in self.values.items()
        ]
        return ResultTable(
            [Column("key"), Column("value", words=".8g"), Column("sigma", words=".3g")], rows
        )


class Residuals(RowMaker):
    """Callable that runs a case with values of keys; returns the differences between run and measured series.

    The differences of a series are computed minus measured values, divided by the range of the measured series.
    """

    def __call__(self, values: Mapping[str, Any]) -> list[np.ndarray] | str:
        """Run with values of keys; differences float64[times in the run] of each series, or the reason of a failure."""
        from fvsolve.core.run import run

        try:
            case = self.read(values)
            result = run(case)
        except CaseError as error:
            return refusal_text(error)
        end_if_interrupted(result.reason)
        if result.reason != "finished":
            return result.reason
        differences = []
        for series in case.compare.values():
            time = series.t + series.shift
            within = (time >= case.numerics.start) & (time <= case.numerics.end)
            computed = interpolated(result.seconds, result.si(series.probe.text), time[within])
            if not np.isfinite(computed).all():
                return f"{series.probe.text} is not finite"
            differences.append((computed - series.v[within]) / series_range(series.v))
        return differences

    def lost_result(self, values: Mapping[str, Any]) -> str:
        return "lost"


def series_range(measured: np.ndarray) -> float:
    """Range of a measured series, by which its differences to the run are divided; 1 for a constant series."""
    return float(np.ptp(measured)) or 1.0


@declared("study")
@validated(vary=VARY, set=TABLE, seed=COUNT_FROM_ZERO, jobs=COUNT, dask=TEXT, progress=FUNCTION)
def calibrate(
    case,
    vary: Mapping[str, Sequence[Any]],
    set: Mapping[str, Any] | None = None,
    seed: int = 0,
    jobs: int = 1,
    dask: str | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> Calibration:
    """Fit values in a case to its measured series, by least squares (`scipy.optimize.least_squares`).

    case : as for `run`, with measured series under `[compare]`; vary : key -> (least, greatest value)
    set : key -> value for all runs; seed : seed of the sample; jobs, dask : processes for the sample, as in `sweep`
    progress : called as progress(done, total, text)

    A sample of values within the ranges is run first. Minimisations start at the best points of the sample, because
    waves out of phase cause many local minima. Several series are weighted by the inverse of their standard deviations
    about the fit, in rounds that begin with equal weights (Aitken 1935).
    Raises FvsolveError if `vary` is empty, if the case has no measured series, and if every run of the sample fails;
    CaseError for a fault of the case or of a range.
    """
    loaded = load(case, set)
    if not vary:
        raise FvsolveError(
            "no key to fit; give at least one key and its range: links.main.wave_speed=900,1300"
        )
    if not loaded.compare:
        raise FvsolveError(
            "no measured series to fit to; expected a series under [compare] in the case"
        )
    bounds = key_ranges(loaded, vary)
    points = sample_points(loaded, vary, f"sobol:{SAMPLE_PER_KEY * len(bounds)}", seed)
    return LeastSquaresFit(
        loaded, bounds, points, progress or (lambda done, total, text: None)
    ).solve(jobs, dask)


class LeastSquaresFit:
    """Least-squares fit of keys. The unknowns x : float64[keys] are 0 at the low end of a range and 1 at its high end.

    bounds : key -> (low, high) [SI]; points : values of the keys in the runs of the sample
    """

    def __init__(self, case: Case, bounds: dict, points: list[dict], progress: Callable) -> None:
        self.case, self.bounds, self.points, self.progress = case, bounds, points, progress
        self.low, high = (np.array(side) for side in zip(*bounds.values(), strict=True))
        self.width = high - self.low
        self.work, self.runs = Residuals(case, {"expect": {}}), 0
        self.weights = np.ones(len(case.compare))

    def solve(self, jobs: int, dask: str | None) -> Calibration:
        """Minimise from several start points; returns the best fit with standard deviations.

        With several series, weights are computed and the best fit is repeated until the weights hardly change, at most
        `MAX_ROUNDS` times. jobs, dask : processes for the sample, as in `sweep`
        """
        from scipy.optimize import least_squares

        answers = [self.minimise(least_squares, x) for x in self.start_points(jobs, dask)]
        best = min(answers, key=lambda answer: answer.cost)
        for _ in range(MAX_ROUNDS if self.weights.size > 1 else 0):
            before, self.weights = self.weights, 1.0 / self.scatter(best)
            if np.allclose(
                self.weights / self.weights[0], before / before[0], rtol=WEIGHT_TOLERANCE
            ):
                break
            best = self.minimise(least_squares, best.x)
        return self.result(best)

    def scatter(self, answer: Any) -> np.ndarray:
        """Standard deviation of each series about the fit, relative to the range of the series : float64[series].

        answer : result of `least_squares`, with the Jacobian J of the weighted differences

        The square of a deviation is the sum of squared differences divided by the degrees of freedom. These are the
        number of points of the series, minus the part of the trace of J (J' J)^-1 J' that belongs to the series. A
        series with at most one degree of freedom has the common deviation of all series. The result is at least
        `LEAST_SCATTER`.
        """
        differences = self.differences(answer.x)
        parts = np.split(answer.jac, np.cumsum([series.size for series in differences])[:-1])
        inverse = np.linalg.pinv(answer.jac.T @ answer.jac)
        degrees = np.array(
            [len(part) - np.einsum("ij,jk,ik->", part, inverse, part) for part in parts]
        )
        squares = np.array([float(series @ series) for series in differences])
        pooled = squares.sum() / max(
            1.0, sum(series.size for series in differences) - answer.x.size
        )
        variances = np.where(degrees > 1.0, squares / np.maximum(degrees, 1.0), pooled)
        return np.sqrt(np.maximum(variances, LEAST_SCATTER**2))

    def weighted(self, differences: list[np.ndarray]) -> np.ndarray:
        """Differences of all series, multiplied by the weight of their series and joined to one array."""
        return np.concatenate(
            [weight * series for weight, series in zip(self.weights, differences, strict=True)]
        )

    def start_points(self, jobs: int, dask: str | None) -> list[np.ndarray]:
        """Run the sample; returns its best points, at most `DESCENTS`, as starts x of minimisations.

        The best points have the least sums of squared differences. jobs, dask : processes, as in `sweep`
        Raises FvsolveError if no run of the sample finishes.
        """
        costs, reason = np.full(len(self.points), np.inf), ""
        with TaskPool(self.work, jobs, dask) as pool:
            for k, answer in pool.run(self.points):
                self.runs += 1
                self.progress(self.runs, len(self.points), "sample; minimisations follow")
                if isinstance(answer, str):
                    reason = reason or answer
                else:
                    costs[k] = sum(float(series @ series) for series in answer)
        if not np.isfinite(costs).any():
            raise FvsolveError(f"no run of the sample finished: {reason}")
        best = [k for k in np.argsort(costs, kind="stable")[:DESCENTS] if np.isfinite(costs[k])]
        return [(np.array([*self.points[k].values()]) - self.low) / self.width for k in best]

    def minimise(self, least_squares: Callable, x: np.ndarray) -> Any:
        """Minimise the sum of squared weighted differences from the start x; returns the result of `least_squares`.

        Derivatives are those of `slope`. In a failed run all weighted differences are `FAILED_RESIDUAL`.
        """
        size = sum(series.size for series in self.differences(x))

        def residual(x: np.ndarray) -> np.ndarray:
            differences = self.differences(x)
            return self.weighted(differences) if differences else np.full(size, FAILED_RESIDUAL)

        def slopes(x: np.ndarray) -> np.ndarray:
            return np.column_stack([self.slope(x, k, size) for k in range(x.size)])

        return least_squares(
            residual, x, slopes, bounds=(0.0, 1.0), x_scale=1.0, xtol=1e-10, ftol=1e-10
        )

    def slope(self, x: np.ndarray, k: int, size: int) -> np.ndarray:
        """Derivatives of all weighted differences with respect to x[k] : float64[size], column k of the Jacobian.

        They are difference quotients of two finished runs at or near x, central if possible; 0 if fewer than two runs
        finish.
        """
        results = []
        for at in (x[k] - SLOPE_STEP, x[k] + SLOPE_STEP, x[k]):
            near = np.clip(np.where(np.arange(x.size) == k, at, x), 0.0, 1.0)
            if len(results) < 2 and (differences := self.differences(near)):
                results.append((near[k], self.weighted(differences)))
        if len(results) < 2:
            return np.zeros(size)
        return (results[1][1] - results[0][1]) / (results[1][0] - results[0][0])

    def differences(self, x: np.ndarray) -> list[np.ndarray]:
        """Run the case at x; returns the differences of every series as `Residuals`, or [] if the run fails."""
        self.runs += 1
        answer = self.work(self.values(x))
        self.progress(len(self.points), len(self.points), f"{self.runs} runs")
        return [] if isinstance(answer, str) else answer

    def values(self, x: np.ndarray) -> dict[str, float]:
        return dict(zip(self.bounds, (self.low + x * self.width).tolist(), strict=True))

    def result(self, answer: Any) -> Calibration:
        """`Calibration` from a result of `least_squares`, with standard deviations, correlations and doubts."""
        keys, differences = [*self.bounds], self.differences(answer.x)
        degrees = max(1, answer.fun.size - answer.x.size)
        scatter = 2.0 * answer.cost / degrees
        covariance, doubts = identifiability(answer.jac, keys)
        sigma = np.sqrt(scatter * np.diag(covariance)) * self.width
        sigma[
            [any(doubt.startswith(f"{key} changes nothing") for doubt in doubts) for key in keys]
        ] = np.inf
        root = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(root, root)
        np.fill_diagonal(correlation, 1.0)
        doubts += [
            f"{key} lies at an end of its range; try a wider range"
            for key, x in zip(keys, answer.x, strict=True)
            if min(x, 1.0 - x) <= AT_BOUND
        ]
        series = self.case.compare.values()
        rms = {
            entry.probe.text: series_range(entry.v) * float(np.sqrt(np.mean(series_difference**2)))
            for entry, series_difference in zip(series, differences, strict=True)
        }
        return Calibration(
            self.values(answer.x),
            dict(zip(keys, sigma.tolist(), strict=True)),
            correlation.tolist(),
            rms,
            doubts,
            self.runs,
        )


def identifiability(slopes: np.ndarray, keys: list[str]) -> tuple[np.ndarray, list[str]]:
    """Find the keys that the measurements do not determine.

    slopes : J, float64[points, keys], derivatives of the weighted differences with respect to x of `LeastSquaresFit`
    Returns (inverse of J' J : float64[keys, keys], texts on keys that are not determined). Singular values of J are
    bounded from below, so that the inverse is finite also for keys without effect.
    """
    u, s, v = np.linalg.svd(slopes, full_matrices=False)
    floor = max(float(s[0]), 1e-300) * 1e-9 if s.size else 0.0
    inverse = (v.T / np.maximum(s, floor) ** 2) @ v
    root = np.sqrt(np.diag(inverse))
    without_effect = [
        key for key, size in zip(keys, np.linalg.norm(slopes, axis=0), strict=True) if size <= floor
    ]
    doubts = [f"{key} changes nothing that was measured" for key in without_effect]
    for j, last in enumerate(keys):
        for k, other_key in enumerate(keys[:j]):
            correlation = float(inverse[j, k] / (root[j] * root[k]))
            if (
                abs(correlation) > CORRELATED
                and last not in without_effect
                and other_key not in without_effect
            ):
                reason = f"the correlation of their errors is {correlation:.5f}"
                doubts.append(f"{other_key} and {last} cannot be distinguished: {reason}")
    return inverse, doubts
