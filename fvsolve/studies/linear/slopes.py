"""Derivatives by differences, every step checked against a shorter one. Knows functions and arrays; knows no model."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

STEPS = 2.0 ** -np.arange(8.0, 25.0, 4.0)  # of what counts as a small deviation: 1/256 to 6e-8
FINER = 2.0 ** -np.arange(8.0, 37.0, 4.0)  # where those find no slope: down to 1.5e-11, the laminar part of a valve
COARSE = 2.0 ** -np.arange(2.0, 8.0, 2.0)  # before them, of an input with a range: laminar parts of laws end below
SMOOTH = 1e-3  # steps or sides that differ by more have no derivative in common
NOISE = 1e-12  # of the size of a row, over the step: rounding of its slopes, a thousand times so as to be safe
HIDDEN = 1e-4  # of a row: differences of both sides that stay count from here on; friction factors bend by 3e-6
STILL = 0.25  # of a difference of both sides, by which it may move from step to step: a smooth one loses 15/16
BEND = 4.0  # times as much as they move with the step: sides of a smooth function differ by less than once

Function = Callable[[np.ndarray], np.ndarray]


def two_sided(
    f: Function, x: np.ndarray, direction: np.ndarray, base: np.ndarray, steps: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(forward, backward difference of f along `direction`) : float64[steps, m] each."""
    forward = [(f(x + h * direction) - base) / h for h in steps]
    return np.array(forward), np.array([(base - f(x - h * direction)) / h for h in steps])


def central(
    f: Function, x: np.ndarray, direction: np.ndarray, base: np.ndarray, steps: np.ndarray = STEPS
) -> tuple[np.ndarray, np.ndarray]:
    """(derivative of f along `direction`, forward less backward difference) : float64[steps, m] each."""
    forward, backward = two_sided(f, x, direction, base, steps)
    return 0.5 * (forward + backward), forward - backward


def one_sided(
    f: Function, x: np.ndarray, direction: np.ndarray, base: np.ndarray, steps: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Both differences where x may only move along `direction`: (-3 f(x) + 4 f(x + h) - f(x + 2 h)) / 2 h, twice."""
    slopes = [(4.0 * (f(x + h * direction) - base) - (f(x + 2.0 * h * direction) - base)) / (2.0 * h) for h in steps]
    return np.array(slopes), np.array(slopes)


def longest(
    forward: np.ndarray, backward: np.ndarray, size: np.ndarray, steps: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(derivative [m], its error, kink) entry by entry, over the longest steps at which both sides have one slope.

    forward, backward : float64[steps, m]  differences; size : float64[m]  of rows, for their rounding
    Error and kink are relative to the entry. A slope that falls with the step is zero, unless both sides stood still at
    different values over longer steps: a kink that the law rounds off nearer than anything else in the scene.
    """
    slopes, own = 0.5 * (forward + backward), np.maximum(np.abs(forward), np.abs(backward))
    clear = own[1:] > NOISE * size / steps[1:, None]
    apart, sides, whole = np.abs(np.diff(slopes, axis=0)), np.abs(forward - backward)[1:], above_zero(own.max(axis=0))
    good = clear & (np.maximum(apart, sides) <= SMOOTH * own[1:])
    begun = np.maximum.accumulate(good, axis=0)
    stretch = good & ~np.maximum.accumulate(begun & ~good, axis=0)
    none = ~begun[-1]
    errors = np.where(none, apart / whole, np.where(stretch, apart / above_zero(own[1:]), np.inf))
    errors = np.nan_to_num(errors, nan=np.inf)
    best, entries = np.argmin(errors, axis=0), np.arange(size.size)
    moved = np.maximum(np.abs(np.diff(forward, axis=0)), np.abs(np.diff(backward, axis=0)))
    bent = np.where(clear & none, sides - BEND * moved, 0.0)
    return slopes[best + 1, entries], errors[best, entries], np.max(bent, axis=0) / whole


def above_zero(x: np.ndarray) -> np.ndarray:
    """x, 1 in place of 0."""
    return np.where(x > 0.0, x, 1.0)


def settled(slopes: np.ndarray, size: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(derivative [p], error of each column relative to `size`): of each column the pair of steps that agree best.

    slopes : float64[steps, p]  entries, column after column; size : float64[p]  of each entry's row
    starts : int64[columns]  where each column begins
    """
    if slopes.shape[1] == 0:
        return slopes[0], np.zeros(0)
    apart = np.nan_to_num(np.abs(np.diff(slopes, axis=0)) / size, nan=np.inf)
    worst = np.maximum.reduceat(apart, starts, axis=1)
    best = np.argmin(worst, axis=0)
    lengths = np.diff(np.append(starts, slopes.shape[1]))
    found = slopes[np.repeat(best, lengths) + 1, np.arange(slopes.shape[1])]
    return found, worst[best, np.arange(starts.size)]


def kinks(sides: np.ndarray, size: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """By how much both sides differ however short the step, column by column, relative to `size`."""
    if sides.shape[1] == 0:
        return np.zeros(0)
    return np.min(np.maximum.reduceat(np.abs(sides) / size, starts, axis=1), axis=0)


def hidden_kinks(
    sides: np.ndarray, size: np.ndarray, rounding: np.ndarray, starts: np.ndarray, steps: np.ndarray
) -> np.ndarray:
    """True for each column with an entry whose sides keep one difference over three steps, above HIDDEN of its row.

    The difference of a smooth function falls with the step. size : float64[p]  of each entry's row over the longest
    step, where the steep laminar part of a valve at a drop of zero is not seen
    rounding : float64[p]  size whose rounding counts
    """
    if sides.shape[1] == 0:
        return np.zeros(0, dtype=bool)
    still = np.abs(np.diff(sides, axis=0)) <= STILL * np.abs(sides[1:])
    clear = np.abs(sides[2:]) > np.maximum(HIDDEN * size, NOISE * rounding / steps[2:, None])
    return np.logical_or.reduceat(np.any(still[:-1] & still[1:] & clear, axis=0), starts)
