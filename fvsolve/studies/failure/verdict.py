"""What became of a run, in one word: stable, ringing, coarse, wrong, blown up, refused. Knows rows; runs nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fvsolve.studies.accuracy.timing import GIVEN_UP
from fvsolve.studies.distance import Gap, ranges, times
from fvsolve.studies.outcome import grown

STABLE, RINGING, COARSE, WRONG, BLOWN, REFUSED, SKIPPED = (
    "stable", "ringing", "coarse", "wrong", "blown up", "refused", "not run",
)  # fmt: skip
VERDICTS = {
    STABLE: "error within the tolerance, and smooth",
    RINGING: "finite, but it swings from step to step, or more than the reference and quicker",
    COARSE: "error above the tolerance, but a shorter step helps",
    WRONG: "finite, error above the tolerance, and neither half nor a quarter of the step helps",
    BLOWN: "not finite, or three ranges of a probe beyond what the reference reaches",
    REFUSED: "the program refused the case, or stopped by name",
    SKIPPED: "would take too many implicit steps, or was given up after too long",
}
FAR = 3.0  # ranges of a probe outside the reference's span: beyond, a run has blown up
SWINGS = 8  # changes in a row that alternate in sign: ringing
SWING, FAINT = 0.02, 1e-3  # ranges: swings of a run that count, and those of the reference, which may have decayed
HASTE = 0.5
MORE = 0.25  # of the reference's variation: what a probe may swing more
HELPS = 0.75  # of the error is left at most where a shorter step helps


@dataclass(frozen=True)
class Measures:
    """A run measured against the reference, in ranges of each probe, worst probe; nan where it did not finish.

    error : mean distance over the rows; farthest : how far steps lie outside the reference's span
    ringing, variation : see `ringing` and `excess`; reason : why the run ended; refused : before it began
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


def verdict(one: Measures, shorter: Callable[[], Measures], tolerance: float) -> str:
    """The word for a run; `shorter()` gives the same run at half the step, then at a quarter.

    It is asked only where the error is above the tolerance.
    """
    if one.reason.startswith(GIVEN_UP):
        return SKIPPED
    if one.refused or (not one.ok and not grown(one.reason)):
        return REFUSED
    if not one.ok or not one.farthest <= FAR:
        return BLOWN
    if one.ringing > tolerance or one.variation > MORE:
        return RINGING
    if one.error <= tolerance:
        return STABLE
    enough = max(tolerance, HELPS * one.error)
    for _ in range(2):
        half = shorter()
        if half.reason.startswith(GIVEN_UP):
            return SKIPPED
        if half.error <= enough:
            return COARSE
    return WRONG


def ringing(bursts: Sequence[np.ndarray], ranges: np.ndarray) -> float:
    """The greatest amplitude, in ranges, that a probe keeps up from step to step for SWINGS steps.

    bursts : float64[steps, probes] each; ranges : float64[probes]. A swing is half a change u[n+1] - u[n]; SWINGS
    changes in a row must alternate in sign, and the least of them counts.
    """
    worst = 0.0
    for burst in bursts:
        change = np.diff(burst, axis=0) / ranges
        if len(change) < SWINGS:
            continue
        turns = change[1:] * change[:-1] < 0.0
        windows = np.lib.stride_tricks.sliding_window_view
        alternate = windows(turns, SWINGS - 1, axis=0).all(axis=-1)
        least = 0.5 * windows(np.abs(change), SWINGS, axis=0).min(axis=-1)
        worst = max(worst, float(np.max(least[alternate], initial=0.0)))
    return worst


def excess(rows: np.ndarray, reference: np.ndarray, ranges: np.ndarray) -> float:
    """By what part a probe varies more than the reference: (TV - TV_ref) / max(TV_ref, range), worst probe.

    It counts only where the swings follow each other in less than HASTE of the time of the reference's: one that a
    method amplifies or does not damp is no ringing. TV is the sum of |changes| from row to row, after each row has been
    replaced by the median of itself and its neighbours: one row that sticks out, read within the step after a jump, is
    no swing.
    rows, reference : float64[k, probes], ranges : float64[probes]
    """
    one, other = (_medians(values) / ranges for values in (rows, reference))
    varies, known = (np.abs(np.diff(values, axis=0)).sum(axis=0) for values in (one, other))
    found = (varies - known) / np.maximum(known, 1.0)
    quick = [pace(a, SWING) < HASTE * pace(b, FAINT) for a, b in zip(one.T, other.T, strict=True)]
    return float(np.max(found[quick], initial=0.0))


def pace(values: np.ndarray, height: float) -> float:
    """Rows from one turn to the next, the median over turns between swings of `height` at least; inf with one turn."""
    turns, low, high, rises = [], 0, 0, 0
    for i, value in enumerate(values):
        low, high = (i if value < values[low] else low), (i if value > values[high] else high)
        if rises >= 0 and value < values[high] - height:
            turns += [high] * rises
            rises, low = -1, i
        elif rises <= 0 and value > values[low] + height:
            turns += [low] * -rises
            rises, high = 1, i
    return float(np.median(np.diff(turns))) if len(turns) > 1 else np.inf


def _medians(rows: np.ndarray) -> np.ndarray:
    return np.median([rows[:-2], rows[1:-1], rows[2:]], axis=0) if len(rows) > 2 else rows


def ranges_of(reference: np.ndarray) -> np.ndarray:
    """Greatest less least value of each probe; inf for one that stands still : float64[probes]."""
    return np.nan_to_num(ranges(reference), nan=np.inf)


def measured(outcome, bursts: Sequence[np.ndarray], truth) -> Measures:
    """A run against the truth's rows, read at the run's own times."""
    if not outcome.ok:
        return Measures(outcome.reason, False, outcome.refused, steps=outcome.counts.get("steps", 0))
    t, rows, known = outcome.rows[:, 0], outcome.rows[:, 1:], truth.rows(truth.run)
    true = np.column_stack([np.interp(t, truth.run.rows[:, 0], column) for column in known.T])
    wide, seen = ranges_of(known), np.concatenate([rows[-1:], *bursts])
    with np.errstate(over="ignore", invalid="ignore"):
        error = [Gap(off, times(t), width).ranges()["L1"] for off, width in zip((rows - true).T, wide, strict=True)]
        outside = np.maximum(seen - known.max(axis=0), known.min(axis=0) - seen) / wide
        return Measures(
            outcome.reason, True, False, float(np.max(error)), max(0.0, float(outside.max())), ringing(bursts, wide),
            excess(rows, true, wide), outcome.counts["steps"], outcome.seconds,
        )  # fmt: skip
