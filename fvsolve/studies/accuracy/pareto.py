"""Cheapest settings for an error: crossings with a target, and the Pareto front of error and cost.

A curve is a sequence of points of one method, from coarse to fine; failed points have infinite errors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Crossing:
    """Crossing of a curve with a target error: its cost, and the two points around it.

    cost : at the target, log-log between the two points; at the coarsest point if that is accurate enough
    coarser, finer : indices of the points, equal if the crossing is a point; share : fraction of the way, in logarithms
    """

    cost: float
    coarser: int
    finer: int
    share: float

    @property
    def within(self) -> bool:
        """True if the target lies between two points; False at a point, where the error may be less than the target."""
        return self.coarser != self.finer


def find_crossing(errors: Sequence[float], costs: Sequence[float], target: float) -> Crossing | None:
    """Coarsest place of a curve from which on all errors are at most `target`; None if its finest point exceeds it."""
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
    """Powers of ten 1e-1, 1e-2, ... down to the last that some error reaches and that is not below the floor."""
    least = max(min((e for e in errors if math.isfinite(e)), default=math.inf), floor)
    powers, exponent = [], -1
    while 10.0**exponent >= least and exponent > -16:
        powers.append(10.0**exponent)
        exponent -= 1
    return powers
