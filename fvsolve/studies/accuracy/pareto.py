"""Cheapest settings for an error: crossings with a target, and the Pareto front of error and cost.

A curve is a sequence of points of one method, from coarse to fine; failed points have infinite errors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Crossing:
    """Crossing of a curve of errors and costs with a target error.

    cost : cost at the target, interpolated in logarithms between two points, or that of the point of the crossing
    coarser, finer : indices of the two points around the target. Both are the index of a single point if all errors are
    within the target, or if the coarser error is infinite or the finer error is 0.
    share : position of the crossing between the points in logarithms, 0 at the coarser, 1 at the finer or single point
    """

    cost: float
    coarser: int
    finer: int
    share: float

    @property
    def within(self) -> bool:
        """True if the crossing lies between two points; False at a point, whose error may be less than the target."""
        return self.coarser != self.finer


def find_crossing(errors: Sequence[float], costs: Sequence[float], target: float) -> Crossing | None:
    """Crossing of a curve with the target error, such that all finer points have errors of at most `target`.

    errors, costs : of the points of the curve, from coarse to fine. None if the error of the finest point exceeds the
    target.
    """
    good = len(errors)
    while good > 0 and errors[good - 1] <= target:
        good -= 1
    if good == len(errors):
        return None
    if good == 0:
        return Crossing(costs[0], 0, 0, 1.0)
    before, after = errors[good - 1], errors[good]
    if not math.isfinite(before) or after <= 0.0:
        return Crossing(costs[good], good, good, 1.0)
    share = math.log(before / target) / math.log(before / after)
    return Crossing(interpolate_log(costs[good - 1], costs[good], share), good - 1, good, share)


def interpolate_log(low: float, high: float, share: float) -> float:
    """Number at the fraction `share` of the way from low to high, in logarithms."""
    return math.exp((1.0 - share) * math.log(low) + share * math.log(high))


def pareto_front(errors: Sequence[float], costs: Sequence[float]) -> list[int]:
    """Indices of the Pareto-optimal points (error, cost), from cheap to accurate."""
    indices, least = [], math.inf
    for k in sorted(range(len(errors)), key=lambda k: (costs[k], errors[k])):
        if errors[k] < least:
            least = errors[k]
            indices.append(k)
    return indices


def target_powers(errors: Sequence[float], floor: float) -> list[float]:
    """Target errors 1e-1, 1e-2, ..., not below `floor` and not below the least of `errors`."""
    least = max(min((e for e in errors if math.isfinite(e)), default=math.inf), floor)
    powers, exponent = [], -1
    while 10.0**exponent >= least and exponent > -16:
        powers.append(10.0**exponent)
        exponent -= 1
    return powers
