"""Which of many settings is cheapest for an error. Knows numbers; knows no case and no method.

A curve is a row of points of one method from coarse to fine; errors of points that failed are infinite.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Crossing:
    """Where a curve meets a target: its cost there, and between which points it lies.

    cost : at the target, log-log between the two points; at the coarsest point where that is good enough already
    coarser, finer : indices of the points; equal where nothing lies between; share : of the way in logarithms
    """

    cost: float
    coarser: int
    finer: int
    share: float

    @property
    def within(self) -> bool:
        """Whether the target lies between two points; else the coarsest one is better than asked."""
        return self.coarser != self.finer


def crossing(errors: Sequence[float], costs: Sequence[float], target: float) -> Crossing | None:
    """The coarsest place of a curve from which on all errors are at most `target`; None where its end misses it."""
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
    return Crossing(between(costs[good - 1], costs[good], share), good - 1, good, share)


def between(low: float, high: float, share: float) -> float:
    """The number at `share` of the way from low to high, in logarithms."""
    return math.exp((1.0 - share) * math.log(low) + share * math.log(high))


def front(errors: Sequence[float], costs: Sequence[float]) -> list[int]:
    """Indices of the points that none beats in error and cost at once, from cheap to accurate."""
    found, least = [], math.inf
    for k in sorted(range(len(errors)), key=lambda k: (costs[k], errors[k])):
        if errors[k] < least:
            least = errors[k]
            found.append(k)
    return found


def targets(errors: Sequence[float], floor: float) -> list[float]:
    """1e-1, 1e-2, ... down to the last power of ten that some error reaches and that is not below the floor."""
    least = max(min((e for e in errors if math.isfinite(e)), default=math.inf), floor)
    found, power = [], -1
    while 10.0**power >= least and power > -16:
        found.append(10.0**power)
        power -= 1
    return found
