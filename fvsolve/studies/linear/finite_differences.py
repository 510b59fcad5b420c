"""Derivatives by finite differences, where each step is compared with a shorter step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

STEPS = 2.0 ** -np.arange(8.0, 25.0, 4.0)  # in units of the small deviation: 1/256 to 6e-8
FINER_STEPS = 2.0 ** -np.arange(
    8.0, 37.0, 4.0
)  # if those give no slope: down to 1.5e-11, for the laminar range of a valve
COARSE_STEPS = 2.0 ** -np.arange(
    2.0, 8.0, 2.0
)  # before STEPS, for an input with a range: laminar ranges of laws end below
SLOPE_TOLERANCE = 1e-3  # relative difference of steps or sides above which there is no derivative
ROUNDING_SHARE = 1e-12  # of the size of a row, over the step: round-off of its slopes, with a safety factor of 1000
HIDDEN_KINK = 1e-4  # of a row: least constant difference of both sides that is a kink; friction factors have 3e-6
CONSTANT_SHARE = (
    0.25  # relative change of a constant difference of both sides from step to step; a smooth one loses 15/16
)
BEND_FACTOR = (
    4.0  # kink: sides differ by more than this times their change with the step; smooth ones by less than once
)

Function = Callable[[np.ndarray], np.ndarray]


def two_sided_differences(
    f: Function, x: np.ndarray, direction: np.ndarray, base: np.ndarray, steps: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Forward and backward difference quotients of f at x along `direction` : float64[steps, m] each.

    base : float64[m]  f(x); steps : factors on the vector `direction`, largest first
    """
    forward = [(f(x + h * direction) - base) / h for h in steps]
    return np.array(forward), np.array([(base - f(x - h * direction)) / h for h in steps])


def central_differences(
    f: Function, x: np.ndarray, direction: np.ndarray, base: np.ndarray, steps: np.ndarray = STEPS
) -> tuple[np.ndarray, np.ndarray]:
    """Central difference quotient of f at x along `direction`, and forward minus backward quotient.

    Both are float64[steps, m]; base, steps : as for `two_sided_differences`
    """
    forward, backward = two_sided_differences(f, x, direction, base, steps)
    return 0.5 * (forward + backward), forward - backward


def single_sided_differences(
    f: Function, x: np.ndarray, direction: np.ndarray, base: np.ndarray, steps: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """One-sided difference quotient of f at x along `direction`, returned twice: as forward and as backward quotient.

    It is (-3 f(x) + 4 f(x + h) - f(x + 2 h)) / 2 h, second order in the step h : float64[steps, m].
    base, steps : as for `two_sided_differences`
    """
    slopes = [(4.0 * (f(x + h * direction) - base) - (f(x + 2.0 * h * direction) - base)) / (2.0 * h) for h in steps]
    return np.array(slopes), np.array(slopes)


def longest_step_slopes(
    forward: np.ndarray, backward: np.ndarray, size: np.ndarray, steps: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivative, error and kink of each entry of f : float64[m] each, from the longest steps with a clear result.

    forward, backward, steps : difference quotients and steps of `two_sided_differences`
    size : float64[m]  size of each entry of f, from which the round-off of its quotients is estimated
    The derivative is taken at the longest steps at which forward and backward quotients agree and change little with
    the step. The error is the change with the step, relative to the quotient. If there are no such steps, the error is
    relative to the greatest quotient, so that a quotient that falls to zero with the step counts as zero.
    The kink is the difference of forward and backward quotients where it does not fall with the step, relative to the
    greatest quotient; 0 if they agree at some step. Laws smooth such a kink over a range below these steps.
    """
    slopes, magnitude = 0.5 * (forward + backward), np.maximum(np.abs(forward), np.abs(backward))
    clear = magnitude[1:] > ROUNDING_SHARE * size / steps[1:, None]
    change, sides, peak = (
        np.abs(np.diff(slopes, axis=0)),
        np.abs(forward - backward)[1:],
        above_zero(magnitude.max(axis=0)),
    )
    good = clear & (np.maximum(change, sides) <= SLOPE_TOLERANCE * magnitude[1:])
    started = np.maximum.accumulate(good, axis=0)
    stretch = good & ~np.maximum.accumulate(started & ~good, axis=0)
    none = ~started[-1]
    errors = np.where(none, change / peak, np.where(stretch, change / above_zero(magnitude[1:]), np.inf))
    errors = np.nan_to_num(errors, nan=np.inf)
    best, entries = np.argmin(errors, axis=0), np.arange(size.size)
    side_change = np.maximum(np.abs(np.diff(forward, axis=0)), np.abs(np.diff(backward, axis=0)))
    kink = np.where(clear & none, sides - BEND_FACTOR * side_change, 0.0)
    return slopes[best + 1, entries], errors[best, entries], np.max(kink, axis=0) / peak


def above_zero(x: np.ndarray) -> np.ndarray:
    """Array x with 1 in place of values that are not positive."""
    return np.where(x > 0.0, x, 1.0)


def best_slopes(slopes: np.ndarray, size: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivative of each matrix entry : float64[p], and error of each column : float64[columns], relative to `size`.

    They come from the two consecutive steps that agree best for the column.
    slopes : float64[steps, p]  difference quotients of the entries, column after column
    size : float64[p]  size of the row of each entry; starts : int64[columns]  first entry of each column
    """
    if slopes.shape[1] == 0:
        return slopes[0], np.zeros(0)
    changes = np.nan_to_num(np.abs(np.diff(slopes, axis=0)) / size, nan=np.inf)
    worst = np.maximum.reduceat(changes, starts, axis=1)
    best = np.argmin(worst, axis=0)
    lengths = np.diff(np.append(starts, slopes.shape[1]))
    values = slopes[np.repeat(best, lengths) + 1, np.arange(slopes.shape[1])]
    return values, worst[best, np.arange(starts.size)]


def side_differences(sides: np.ndarray, size: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Difference of forward and backward quotients of each column, relative to `size` : float64[columns].

    It is the greatest difference over the entries of a column, at the step where this is least.
    sides : float64[steps, p]  forward minus backward quotients; size, starts : as in `best_slopes`
    """
    if sides.shape[1] == 0:
        return np.zeros(0)
    return np.min(np.maximum.reduceat(np.abs(sides) / size, starts, axis=1), axis=0)


def hidden_kinks(
    sides: np.ndarray, size: np.ndarray, rounding: np.ndarray, starts: np.ndarray, steps: np.ndarray
) -> np.ndarray:
    """True for each column with a kink : bool[columns].

    A column has a kink if the difference of forward and backward quotients of an entry is constant over three steps and
    above 1e-4 of the size of its row. The difference of a smooth function falls with the step.
    sides : float64[steps, p]  forward minus backward quotients; starts : int64[columns]  first entry of each column
    size : float64[p]  size of the row of each entry over the longest step, which does not resolve the steep laminar
    range of a valve at zero pressure drop
    rounding : float64[p]  size of the row of each entry, from which its round-off is estimated
    steps : float64[steps]  steps as fractions of the small deviations
    """
    if sides.shape[1] == 0:
        return np.zeros(0, dtype=bool)
    constant = np.abs(np.diff(sides, axis=0)) <= CONSTANT_SHARE * np.abs(sides[1:])
    clear = np.abs(sides[2:]) > np.maximum(HIDDEN_KINK * size, ROUNDING_SHARE * rounding / steps[2:, None])
    return np.logical_or.reduceat(np.any(constant[:-1] & constant[1:] & clear, axis=0), starts)
