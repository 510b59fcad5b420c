"""Values and derivatives of schedules at a time: pieces of polynomials, powers and waves."""

from math import cos, sin

from fvsolve.jit import njit

POLYNOMIAL, POWER, WAVE, CREST = 0.0, 1.0, 2.0, 3.0  # kinds of pieces; CREST: wave cut off below zero


@njit(forceinline=True)
def piece_at(pieces, first, count, t, limit):
    """Row of `pieces` that applies at time t [s]; from time `limit` on, row of the piece that ends there (left limit).

    first, count : first row and number of pieces of the schedule
    """
    low, high = first, first + count
    while high - low > 1:
        middle = (low + high) // 2
        start = pieces[middle, 0]
        if start < limit and start <= t:
            low = middle
        else:
            high = middle
    return low


@njit(forceinline=True)
def piece_value(pieces, row, t):
    """Value at time t of a piece of a schedule: polynomial, power or wave of s = t - origin.

    Polynomial: a + b s + c s^2 + d s^3. Power: v1 + (v0 - v1) (1 - s / duration)^exponent. Wave: mean + amplitude
    sin(frequency s + phase), cut off below zero for the kind CREST. The coefficients are in pieces[row].
    """
    s = t - pieces[row, 2]
    if pieces[row, 1] == POLYNOMIAL:
        return pieces[row, 3] + s * (pieces[row, 4] + s * (pieces[row, 5] + s * pieces[row, 6]))
    if pieces[row, 1] == POWER:
        rest = min(max(1.0 - s / pieces[row, 5], 0.0), 1.0)
        return pieces[row, 4] + (pieces[row, 3] - pieces[row, 4]) * rest ** pieces[row, 6]
    value = pieces[row, 3] + pieces[row, 4] * sin(pieces[row, 5] * s + pieces[row, 6])
    return max(value, 0.0) if pieces[row, 1] == CREST else value


@njit(forceinline=True)
def piece_slopes(pieces, row, t):
    """(first, second) derivative of a piece of a schedule at time t [per s, per s2]; not valid for the kind CREST.

    row : row of the piece in `pieces`
    """
    s = t - pieces[row, 2]
    if pieces[row, 1] == POLYNOMIAL:
        c, d = pieces[row, 5], pieces[row, 6]
        return pieces[row, 4] + s * (2.0 * c + s * 3.0 * d), 2.0 * c + 6.0 * d * s
    if pieces[row, 1] == POWER:
        span, n, rest = pieces[row, 5], pieces[row, 6], 1.0 - s / pieces[row, 5]
        fall = (pieces[row, 4] - pieces[row, 3]) * n / span
        if rest <= 0.0:
            return fall if n == 1.0 else 0.0, 0.0
        return fall * rest ** (n - 1.0), -fall * (n - 1.0) / span * rest ** (n - 2.0)
    frequency, at = pieces[row, 5], pieces[row, 5] * s + pieces[row, 6]
    return pieces[row, 4] * frequency * cos(at), -pieces[row, 4] * frequency * frequency * sin(at)


@njit
def schedule_slopes(tables, index, t):
    """(first, second) derivative of schedule number `index` at time t [per s, per s2].

    From the end of the schedule segment on, a schedule of several pieces keeps its derivatives from the left at this
    end; a single piece continues.
    """
    record, limit = tables.schedules[index], tables.clock[0]["limit"]
    if record["pieces"] == 1:
        return piece_slopes(tables.pieces, record["first"], t)
    row = piece_at(tables.pieces, record["first"], record["pieces"], t, limit)
    return piece_slopes(tables.pieces, row, min(t, limit))


@njit(forceinline=True)
def schedule_value(tables, index, t):
    """Value of schedule `index` at time t [s].

    From the end of the schedule segment on, a schedule of several pieces keeps its left limit at this end.
    """
    return value_with_limit(tables.schedules, tables.pieces, index, t, tables.clock[0]["limit"])


@njit(forceinline=True)
def value_with_limit(schedules, pieces, index, t, limit):
    """Value of schedule `index` at time t [s], continuous from the right; from `limit` [s] on, its left limit there."""
    record = schedules[index]
    if record["pieces"] == 1:
        return piece_value(pieces, record["first"], t)
    row = piece_at(pieces, record["first"], record["pieces"], t, limit)
    return piece_value(pieces, row, min(t, limit))
