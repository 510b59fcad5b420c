"""Values of schedules at a time. Knows pieces of polynomials and powers; knows no units."""

from fvsolve.jit import njit


@njit(forceinline=True)
def piece_at(pieces, first, count, t, limit):
    """Row of the piece that holds at t; from `limit` on the piece that ends there (left limit)."""
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
    """a + b s + c s^2 + d s^3 with s = t - origin, or the power v1 + (v0 - v1) (1 - s / duration)^exponent."""
    s = t - pieces[row, 2]
    if pieces[row, 1] == 0.0:
        return pieces[row, 3] + s * (pieces[row, 4] + s * (pieces[row, 5] + s * pieces[row, 6]))
    rest = min(max(1.0 - s / pieces[row, 5], 0.0), 1.0)
    return pieces[row, 4] + (pieces[row, 3] - pieces[row, 4]) * rest ** pieces[row, 6]


@njit(forceinline=True)
def schedule_value(tables, index, t):
    """Value of schedule `index` at t [s], its left limit from the end of the segment on."""
    return value_until(tables.schedules, tables.pieces, index, t, tables.clock[0]["limit"])


@njit(forceinline=True)
def value_until(schedules, pieces, index, t, limit):
    """Value of schedule `index` at t [s], right-continuous, but its left limit from `limit` on."""
    record = schedules[index]
    if record["pieces"] == 1:
        return piece_value(pieces, record["first"], t)
    row = piece_at(pieces, record["first"], record["pieces"], t, limit)
    return piece_value(pieces, row, min(t, limit))
