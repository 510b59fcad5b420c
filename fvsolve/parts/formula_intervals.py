"""Enclosures of a formula of time over intervals: its poles, values out of range and narrow pulses between samples.

Interval arithmetic (Moore 1966): from the bounds of the arguments follow bounds of every function, so no value within
an interval is missed. Bounds are wider than the values where a name occurs twice; half the interval halves this
difference. Intervals in doubt are halved, so that each finding has a time at which the formula has that value.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels import formula_programs as code

ROUNDS = 80  # greatest number of bisections: enough for neighbouring floating-point numbers
# the same in a search for values out of range, which a smooth maximum at the limit never ends
RANGE_ROUNDS = 24
MOST = 4096  # greatest number of intervals in doubt
POLE = 1e6  # size beside a point in doubt, relative to all samples, that counts as a pole
# deviation from a straight line between two samples, relative to the range, that counts as a pulse
PULSE = 0.05
NARROW = 1e-9  # least width of a pulse, relative to the run
MOST_PULSES = 60  # more of them are a wave, which error control follows
PIECES = 16  # pieces of a pulse, at whose ends steps end
# value of a pulse, relative to the range, at its ends: a long step after it would multiply more
TAIL = 1e-6


class Enclosure(NamedTuple):
    """Least and greatest values of a part of a formula in each interval, and True where it may be no number."""

    low: np.ndarray
    high: np.ndarray
    doubt: np.ndarray


# of a formula of time, in intervals from `begin` to `end` [s]
Bounds = Callable[[np.ndarray, np.ndarray], Enclosure]


def bounds_of(low: np.ndarray, high: np.ndarray, doubt: np.ndarray) -> Enclosure:
    """Bounds, infinite where a bound is not a number, which is in doubt.

    A part may be infinite, for example by overflow, where the formula is not: exp(-t**200) is 0.
    """
    doubt = doubt | np.isnan(low) | np.isnan(high)
    return Enclosure(
        np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high), doubt
    )


def hull(values: list[np.ndarray], doubt: np.ndarray) -> Enclosure:
    """Bounds of a function that has its least and greatest values at the given places."""
    table = np.stack(values)
    invalid = np.isnan(table).any(axis=0)
    low, high = np.fmin.reduce(table), np.fmax.reduce(table)
    return bounds_of(np.where(invalid, -np.inf, low), np.where(invalid, np.inf, high), doubt)


def corners(function: Callable, x: Enclosure, y: Enclosure, doubt: np.ndarray) -> Enclosure:
    """Bounds of a function that is monotone in both arguments."""
    return hull([function(a, b) for a in (x.low, x.high) for b in (y.low, y.high)], doubt)


def has_multiple(x: Enclosure, offset: float, period: float) -> np.ndarray:
    """True where an interval contains offset + k period for an integer k."""
    return np.floor((x.high - offset) / period) >= np.ceil((x.low - offset) / period)


def wave(x: Enclosure, offset: float) -> Enclosure:
    """Bounds of sin(x + offset)."""
    a, b = np.sin(x.low + offset), np.sin(x.high + offset)
    top, bottom = (has_multiple(x, place - offset, 2 * np.pi) for place in (np.pi / 2, -np.pi / 2))
    point = x.low == x.high
    low = np.where(bottom & ~point, -1.0, np.minimum(a, b))
    high = np.where(top & ~point, 1.0, np.maximum(a, b))
    return bounds_of(low, high, x.doubt)


def power(x: Enclosure, y: Enclosure) -> Enclosure:
    """Bounds of x^y."""
    doubt, exponent = x.doubt | y.doubt, y.low
    fixed = y.low == y.high
    whole = fixed & (exponent == np.round(exponent))
    zero = (x.low <= 0.0) & (x.high >= 0.0)
    invalid = np.where(
        whole,
        zero & (exponent < 0.0),
        (x.low < 0.0) | zero & (y.low <= 0.0) & ~(fixed & (exponent > 0)),
    )
    ends = [np.power(base, to) for base in (x.low, x.high) for to in (y.low, y.high)]
    inner = np.where(zero & (y.low >= 0.0), np.power(0.0, np.maximum(y.low, 0.0)), ends[0])
    result = hull(
        [*(np.where(invalid, np.nan, end) for end in ends), np.where(invalid, np.nan, inner)], doubt
    )
    return Enclosure(result.low, result.high, result.doubt | invalid)


def quotient(x: Enclosure, y: Enclosure) -> Enclosure:
    """Bounds of x / y."""
    doubt = x.doubt | y.doubt
    invalid = (y.low <= 0.0) & (y.high >= 0.0)
    result = corners(np.divide, x, y, doubt)
    low, high = np.where(invalid, -np.inf, result.low), np.where(invalid, np.inf, result.high)
    return Enclosure(low, high, result.doubt | invalid)


def monotone(function: Callable, x: Enclosure, invalid: np.ndarray | bool = False) -> Enclosure:
    """Bounds of an increasing function; invalid : True where an argument may be outside its domain."""
    result = bounds_of(function(x.low), function(x.high), x.doubt)
    return Enclosure(result.low, result.high, result.doubt | invalid)


def chosen(condition: Enclosure, a: Enclosure, b: Enclosure) -> Enclosure:
    """Bounds of where(condition, a, b): of a, of b, or of both where the condition is not known."""
    yes = (condition.low > 0.0) | (condition.high < 0.0)
    no = (condition.low == 0.0) & (condition.high == 0.0)
    both = np.minimum(a.low, b.low), np.maximum(a.high, b.high), a.doubt | b.doubt
    parts = (np.where(yes, p, np.where(no, q, r)) for p, q, r in zip(a, b, both, strict=True))
    low, high, doubt = parts
    return Enclosure(low, high, doubt.astype(bool) | condition.doubt)


def compared(difference: Enclosure) -> Enclosure:
    """Bounds of the comparison difference <= 0, 1 or 0."""
    low, high = (difference.high <= 0.0).astype(float), (difference.low <= 0.0).astype(float)
    return Enclosure(low, high, difference.doubt)


def difference(x: Enclosure, y: Enclosure) -> Enclosure:
    """Bounds of x - y."""
    return bounds_of(x.low - y.high, x.high - y.low, x.doubt | y.doubt)


def magnitude(x: Enclosure) -> Enclosure:
    """Bounds of |x|."""
    a, b = np.abs(x.low), np.abs(x.high)
    low = np.where((x.low <= 0.0) & (x.high >= 0.0), 0.0, np.minimum(a, b))
    return Enclosure(low, np.maximum(a, b), x.doubt)


def direction_of(y: Enclosure, x: Enclosure) -> Enclosure:
    """Bounds of arctan2(y, x): from the corners on either side of the negative x axis, otherwise all angles."""
    doubt, crossing = x.doubt | y.doubt, (x.low <= 0.0) & (y.low <= 0.0) & (y.high >= 0.0)
    point = (x.low == x.high) & (y.low == y.high)
    result = corners(np.arctan2, y, x, doubt)
    cut = crossing & ~point
    return Enclosure(np.where(cut, -np.pi, result.low), np.where(cut, np.pi, result.high), doubt)


def sized(x: Enclosure, y: Enclosure) -> Enclosure:
    """Bounds of hypot(x, y)."""
    x, y = magnitude(x), magnitude(y)
    return bounds_of(np.hypot(x.low, y.low), np.hypot(x.high, y.high), x.doubt | y.doubt)


ONE: dict[int, Callable] = {
    code.NEGATE: lambda x: Enclosure(-x.high, -x.low, x.doubt),
    code.SINE: lambda x: wave(x, 0.0),
    code.COSINE: lambda x: wave(x, np.pi / 2),
    code.TANGENT: lambda x: tangent(x),
    code.EXPONENTIAL: lambda x: monotone(np.exp, x),
    code.LOGARITHM: lambda x: monotone(np.log, x, x.low <= 0.0),
    code.ROOT: lambda x: monotone(np.sqrt, x, x.low < 0.0),
    code.TANH: lambda x: monotone(np.tanh, x),
    code.ABSOLUTE: magnitude,
}
TWO: dict[int, Callable] = {
    code.ADD: lambda x, y: bounds_of(x.low + y.low, x.high + y.high, x.doubt | y.doubt),
    code.SUBTRACT: difference,
    code.MULTIPLY: lambda x, y: corners(np.multiply, x, y, x.doubt | y.doubt),
    code.DIVIDE: quotient,
    code.POWER_OF: power,
    code.ARCTANGENT: direction_of,
    code.HYPOTENUSE: sized,
    code.LEAST: lambda x, y: Enclosure(
        np.minimum(x.low, y.low), np.minimum(x.high, y.high), x.doubt | y.doubt
    ),
    code.GREATEST: lambda x, y: Enclosure(
        np.maximum(x.low, y.low), np.maximum(x.high, y.high), x.doubt | y.doubt
    ),
    code.LESS: lambda x, y: compared(difference(x, y)),
    code.MORE: lambda x, y: opposite(compared(difference(x, y))),
}


def tangent(x: Enclosure) -> Enclosure:
    """Bounds of tan(x)."""
    result, invalid = monotone(np.tan, x), has_multiple(x, np.pi / 2, np.pi) & (x.low < x.high)
    low, high = np.where(invalid, -np.inf, result.low), np.where(invalid, np.inf, result.high)
    return Enclosure(low, high, result.doubt | invalid)


def opposite(x: Enclosure) -> Enclosure:
    """Bounds of 1 - x."""
    return Enclosure(1.0 - x.high, 1.0 - x.low, x.doubt)


def enclose(steps: list[tuple[int, float]], begin: np.ndarray, end: np.ndarray) -> Enclosure:
    """Bounds of a formula of time in the intervals from `begin` to `end` [s]; the value where they are equal.

    steps : (code, number) of each step of the stack machine
    """
    stack: list[Enclosure] = []
    sure = np.zeros(begin.size, dtype=bool)
    with np.errstate(all="ignore"):
        for step, number in steps:
            if step == code.CONSTANT:
                stack.append(
                    Enclosure(np.full(begin.size, number), np.full(begin.size, number), sure)
                )
            elif step == code.TIME:
                stack.append(Enclosure(begin, end, sure))
            elif step in (code.BEFORE, code.AFTER):  # no break lies within an interval
                after = (0.5 * (begin + end) >= number).astype(float)
                value = after if step == code.AFTER else 1.0 - after
                stack.append(Enclosure(value, value, sure))
            elif step == code.WHERE:
                stack[-3:] = [chosen(*stack[-3:])]
            elif step in ONE:
                stack[-1] = ONE[step](stack[-1])
            else:
                stack[-2:] = [TWO[step](*stack[-2:])]
    return stack[0]


def in_unit(x: Enclosure, scale: float, offset: float) -> Enclosure:
    """Bounds of scale * x + offset, in doubt where it may be infinite."""
    with np.errstate(all="ignore"):
        low, high = (scale * bound + offset for bound in (x.low, x.high))
    doubt = x.doubt | ~np.isfinite(low) | ~np.isfinite(high)
    return Enclosure(np.minimum(low, high), np.maximum(low, high), doubt)


def values_at(bounds: Bounds, times: np.ndarray) -> np.ndarray:
    """Values of a formula at times [s] : float64[n]; NaN where it is no number."""
    found = bounds(times, times)
    return np.where(found.doubt, np.nan, found.low)


def bisected(begin: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both bisected of each interval that contains a floating-point number between its ends."""
    middle = 0.5 * (begin + end)
    inner = (begin < middle) & (middle < end)
    begin = begin[inner]
    middle = middle[inner]
    end = end[inner]
    return np.concatenate([begin, middle]), np.concatenate([middle, end])


def find_pole(bounds: Bounds, times: np.ndarray, values: np.ndarray) -> float | None:
    """Time [s] between samples at which a formula is no number, or grows beyond all samples; None without such a time.

    times, values : samples of the formula, increasing
    """
    begin = times[:-1]
    end = times[1:]
    most = POLE * (1.0 + np.abs(values).max())
    begin, end = begin[begin < end], end[begin < end]
    for _ in range(ROUNDS):
        doubt = bounds(begin, end).doubt
        begin, end = begin[doubt][:MOST], end[doubt][:MOST]
        if not begin.size:
            return None
        for places in (0.5 * (begin + end), begin, end):
            found = values_at(bounds, places)
            bad = ~(np.abs(found) <= most)
            if bad.any():
                return float(places[int(np.argmax(bad))])
        begin, end = bisected(begin, end)
    return None


def find_outside(bounds: Bounds, times: np.ndarray, least: float, greatest: float) -> float | None:
    """Time [s] between samples at which a formula is below `least` or above `greatest`; None if none is found."""
    begin, end = times[:-1], times[1:]
    begin, end = begin[begin < end], end[begin < end]
    slack = 1e-12 * max((abs(x) for x in (least, greatest) if np.isfinite(x)), default=0.0)
    for _ in range(RANGE_ROUNDS):
        found = bounds(begin, end)
        outside = (found.low < least - slack) | (found.high > greatest + slack)
        begin, end = begin[outside], end[outside]
        if not begin.size or begin.size > MOST:
            return None
        middle = 0.5 * (begin + end)
        value = values_at(bounds, middle)
        bad = (value < least - slack) | (value > greatest + slack)
        if bad.any():
            return float(middle[int(np.argmax(bad))])
        begin, end = bisected(begin, end)
    return None


def find_pulses(bounds: Bounds, times: np.ndarray, values: np.ndarray) -> list[float]:
    """Times [s] at which steps end, so that they do not pass over a pulse between two samples, increasing.

    times, values : samples of the formula; a pulse lies between two of them and is not seen at either.
    """
    spaced = np.flatnonzero(np.diff(times) > 0.0)
    begin = times[spaced]
    end = times[spaced + 1]
    owner = spaced
    seen: dict[int, list[tuple[float, float]]] = {}
    least = values.min()
    greatest = values.max()
    narrow = NARROW * (times[-1] - times[0])
    first, last = values[:-1], values[1:]
    for _ in range(ROUNDS):
        found = bounds(begin, end)
        margin = max(PULSE * (greatest - least), 1e-9 * max(abs(least), abs(greatest)))
        low, high = np.minimum(first[owner], last[owner]), np.maximum(first[owner], last[owner])
        excess = np.maximum(found.high - high, low - found.low)
        keep = np.flatnonzero((excess > margin) & (end - begin > narrow))
        keep = keep[np.argsort(-excess[keep], kind="stable")[:MOST]]
        if not keep.size:
            break
        begin = begin[keep]
        end = end[keep]
        owner = owner[keep]
        middle = 0.5 * (begin + end)
        value = values_at(bounds, middle)
        for k, t, v in zip(owner.tolist(), middle.tolist(), value.tolist(), strict=True):
            seen.setdefault(k, []).append((t, v))
        least, greatest = np.fmin(least, np.nanmin(value)), np.fmax(greatest, np.nanmax(value))
        begin = np.concatenate([begin, middle])
        end = np.concatenate([middle, end])
        owner = np.tile(owner, 2)
    return pulse_breaks(seen, times, values, greatest - least)


def pulse_breaks(seen: dict, times: np.ndarray, values: np.ndarray, span: float) -> list[float]:
    """Ends of equal pieces of each pulse, from the values `seen` between samples : interval -> [(time, value)]."""
    pulses = []
    for k, points in seen.items():
        t, v = np.array(sorted(points)).T
        line = np.interp(t, times[k : k + 2], values[k : k + 2])
        far = np.abs(v - line) > PULSE * span
        if not far.any():
            continue
        near = np.concatenate([[times[k]], t[np.abs(v - line) <= TAIL * span], [times[k + 1]]])
        rise, fall = t[far][0], t[far][-1]
        pulses.append(
            (near[near < rise].max(initial=times[k]), near[near > fall].min(initial=times[k + 1]))
        )
    if len(pulses) > MOST_PULSES:
        return []
    return sorted({float(t) for a, b in pulses for t in np.linspace(a, b, PIECES + 1)})
