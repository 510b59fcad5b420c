"""Greatest step that does not fail: trial steps until two of them bracket it, then bisection; growth of modes in a run.

Notices of runs, stability studies and failure maps search for such steps, and for Courant numbers.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

STEP_RATIO = 1.3  # ratio of consecutive steps of a search upwards
LEAST_PART = 1e-9  # least step of a search downwards, over its first step
BRACKET_WIDTH = 1e-4  # relative width of the final bracket
MOST_HALVINGS = 2000  # more than any bracket of floating-point numbers allows


class StepLimit(NamedTuple):
    """Result of a search: greatest step found safe, `step` [s], and least step found to fail, `fails` [s].

    Both are inf if no failure was found, and nan if nothing was computed; `step` is 0 or nan if no safe step was found.
    """

    step: float
    fails: float


def multiples(first: float, factor: float, last: float) -> Iterator[float]:
    """Yield first, first factor, first factor^2, ...: with a factor above 1 up to the first number above `last`.

    With a factor below 1 the last number is the first that is not above `last`.
    """
    h = first
    while h <= last if factor > 1 else h > last:
        yield h
        h *= factor
    yield h


def greatest_step(
    fails: Callable[[float], bool],
    rising: Iterable[float],
    falling: Iterable[float] = (),
    **end: Any,
) -> StepLimit:
    """Find the least step h [s] at which fails(h) is true, among trial steps, and then by bisection.

    rising : rising steps, tried in turn; the limit is inf if none of them fails
    falling : falling steps, tried if already the first of the rising ones fails; `StepLimit.step` is 0 if all of them
    fail, or if there are none
    end : end of the bisection, see `bisect`
    """
    low = 0.0
    for high in rising:
        if fails(high):
            break
        low = high
    else:
        return StepLimit(math.inf, math.inf)
    return (
        step_below(fails, high, falling, **end) if low == 0.0 else bisect(fails, low, high, **end)
    )


def limit_from(
    fails: Callable[[float], bool],
    first: float,
    far: float,
    ratio: float = STEP_RATIO,
    width: float = BRACKET_WIDTH,
) -> StepLimit:
    """Find the least step h [s] at which fails(h) is true, by a search upwards or downwards from `first`.

    Steps rise by the factor `ratio`; if none up to `far` fails, the limit is inf. If `first` fails, it is halved down
    to 1e-9 of its value. width : relative width at which the bisection ends
    """
    rising, falling = multiples(first, ratio, far), multiples(0.5 * first, 0.5, LEAST_PART * first)
    return greatest_step(fails, rising, falling, width=width)


def step_below(
    fails: Callable[[float], bool], high: float, falling: Iterable[float], **end: Any
) -> StepLimit:
    """Find a limit below a step `high` [s] that fails; falling, end : as for `greatest_step`."""
    for low in falling:
        if not fails(low):
            return bisect(fails, low, high, **end)
        high = low
    return StepLimit(0.0, high)


def middle_of(low: float, high: float) -> float:
    """Arithmetic mean of two numbers."""
    return 0.5 * (low + high)


def bisect(
    fails: Callable[[float], bool],
    low: float,
    high: float,
    width: float = BRACKET_WIDTH,
    halvings: int = MOST_HALVINGS,
    mean: Callable[[Any, Any], Any] = middle_of,
) -> StepLimit:
    """Bisect between a safe step `low` [s] and a failing step `high` [s].

    width : relative width at which the search ends; halvings : greatest number of steps tried
    mean : function of both ends, the next step to try; the search also ends if it returns an end
    """
    for _ in range(halvings):
        between = mean(low, high)
        if not high - low > width * high or between in (low, high):
            break
        if fails(between):
            high = between
        else:
            low = between
    return StepLimit(float(low), float(high))


# growth of modes ----------


def modes_limit(
    r, s: np.ndarray, span: float, enough: float, *steps: Iterable[float], halvings: int
) -> StepLimit:
    """Greatest step up to which all modes grow less than `enough` times more in a run than in the exact solution.

    r : stability function of the method; s : eigenvalues of the modes [1/s]; span : duration of the run [s]
    steps : rising and falling trial steps [s], see `greatest_step`; halvings : number of bisections
    """

    def fails(h: float) -> bool:
        return growth_in_run(r, s, h, span) >= enough

    return greatest_step(fails, *steps, width=0.0, halvings=halvings)


def growth_in_run(r, s: np.ndarray, h: float, span: float) -> float:
    """Greatest growth factor of a mode in a run of `span` [s], over the exact growth factor; arguments as below."""
    return growth_factor(float(excess_growth(r, s, h).max()), span / h)


def excess_growth(r, s: np.ndarray, h: float) -> np.ndarray:
    """Growth factor of each mode in a step, divided by the exact growth factor (at least 1), minus 1.

    r : stability function of the method; s : eigenvalues of the modes [1/s]; h : time step [s]
    """
    with np.errstate(over="ignore", invalid="ignore"):
        ratio = np.abs(r(h * s)) / np.exp(np.maximum(h * s.real, 0.0))
        return (ratio if np.isfinite(ratio).all() else np.nan_to_num(ratio, nan=np.inf)) - 1.0


def growth_factor(excess: float, steps: float) -> float:
    """Growth factor (1 + excess)^steps over a number of steps, at most exp(700); 1 for a negative excess."""
    return math.exp(min(700.0, steps * math.log1p(max(excess, 0.0))))
