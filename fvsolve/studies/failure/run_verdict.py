"""Verdict on a run, in a word, and runs that record their probes after every step."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fvsolve.studies.distance import Deviation, column_ranges, time_weights
from fvsolve.studies.outcome import GIVEN_UP, CappedRun, Outcome, has_diverged, outcome

STABLE, RINGING, COARSE, WRONG, BLOWN_UP, REFUSED, NOT_RUN = (
    "stable", "ringing", "coarse", "wrong", "blown up", "refused", "not run",
)  # fmt: skip
VERDICT_TEXTS = {
    STABLE: "error within the tolerance, and smooth",
    RINGING: "finite, but oscillates from step to step, or oscillates more and faster than the reference",
    COARSE: "error above the tolerance, but a shorter step helps",
    WRONG: "finite, error above the tolerance, and neither half nor a quarter of the step helps",
    BLOWN_UP: "not finite, or more than three ranges of a probe outside the values of the reference",
    REFUSED: "fvsolve refused the case, or stopped with a reason",
    NOT_RUN: "too many implicit steps, or given up after too much time",
}
BLOWN_RANGES = 3.0  # a run farther outside the values of the reference, in ranges of a probe, has blown up
MIN_SWINGS = 8  # successive changes of alternating sign that count as ringing
SWING_RANGE, REFERENCE_SWING = 0.02, 1e-3  # least swings that count [range]: of a run, of the reference, may decay
PACE_RATIO = 0.5  # swings count if they follow in less than this fraction of the time of those of the reference
EXCESS_VARIATION = 0.25  # greatest excess of the variation of a probe, as a fraction of that of the reference
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
    variation, expected = (np.abs(np.diff(values, axis=0)).sum(axis=0) for values in (smooth, smooth_reference))
    excesses = (variation - expected) / np.maximum(expected, 1.0)
    quick = [turn_interval(a, SWING_RANGE) < PACE_RATIO * turn_interval(b, REFERENCE_SWING)
             for a, b in zip(smooth.T, smooth_reference.T, strict=True)]  # fmt: skip
    return float(np.max(excesses[quick], initial=0.0))


def turn_interval(values: np.ndarray, height: float) -> float:
    """Median number of rows between turning points of swings of `height` or more; inf for fewer than two points."""
    turns, low, high, direction = [], 0, 0, 0
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
    """Measures of a run against a reference, whose rows are interpolated to the times of the run.

    outcome : result of the run; windows : float64[steps, probes] each  values of the probes after successive steps
    """
    if not outcome.ok:
        return Measures(outcome.reason, False, outcome.refused, steps=outcome.counts.get("steps", 0))
    t, rows, reference_rows = outcome.rows[:, 0], outcome.rows[:, 1:], reference.rows(reference.run)
    expected = np.column_stack([np.interp(t, reference.run.rows[:, 0], column) for column in reference_rows.T])
    widths, steps = probe_ranges(reference_rows), np.concatenate([rows[-1:], *windows])
    with np.errstate(over="ignore", invalid="ignore"):
        error = [Deviation(off, time_weights(t), width).ranges()["L1"]
                 for off, width in zip((rows - expected).T, widths, strict=True)]  # fmt: skip
        outside = np.maximum(steps - reference_rows.max(axis=0), reference_rows.min(axis=0) - steps) / widths
        return Measures(
            outcome.reason, True, False, float(np.max(error)), max(0.0, float(outside.max())),
            ringing_amplitude(windows, widths), excess_variation(rows, expected, widths), outcome.counts["steps"],
            outcome.seconds,
        )  # fmt: skip


WINDOW_STEPS = 9  # least number of successive steps in a window
CPU_LIMIT = 10.0  # CPU time after which a run is given up [s]
WINDOW_COUNT = 30  # in long runs the distance of windows is this fraction of the steps taken: 1 / 30


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
        self.windows[-1].append(self.run_data.observe(self.loop.t, self.loop.now, self.loop.stepper.out))
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
