"""Derivatives by differences, every step checked against a shorter one. Knows functions and arrays; knows no model."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

STEPS = 2.0 ** -np.arange(8.0, 25.0, 4.0)  # of what counts as a small deviation: 1/256 to 6e-8
FINER = 2.0 ** -np.arange(8.0, 37.0, 4.0)  # where those find no slope: down to 1.5e-11, the laminar part of a valve
SMOOTH = 1e-3  # steps or sides that differ by more have no derivative in common

Function = Callable[[np.ndarray], np.ndarray]


def central(
    f: Function, x: np.ndarray, direction: np.ndarray, base: np.ndarray, steps: np.ndarray = STEPS
) -> tuple[np.ndarray, np.ndarray]:
    """(derivative of f along `direction`, forward less backward difference) : float64[steps, m] each."""
    slopes, sides = [], []
    for h in steps:
        up, down = f(x + h * direction), f(x - h * direction)
        slopes.append((up - down) / (2.0 * h))
        sides.append(((up - base) - (base - down)) / h)
    return np.array(slopes), np.array(sides)


def one_sided(
    f: Function, x: np.ndarray, direction: np.ndarray, base: np.ndarray, steps: np.ndarray = STEPS
) -> tuple[np.ndarray, np.ndarray]:
    """The same where x may only move along `direction`: (-3 f(x) + 4 f(x + h) - f(x + 2 h)) / 2 h; no sides."""
    slopes = [(4.0 * (f(x + h * direction) - base) - (f(x + 2.0 * h * direction) - base)) / (2.0 * h) for h in steps]
    return np.array(slopes), np.zeros((len(steps), base.size))


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
