"""Values and derivatives of schedules at a time: pieces of polynomials, powers and waves, and outputs of blocks."""

from math import cos, sin

from fvsolve.core.kernels.calls import law_njit, prevent_inlining
from fvsolve.core.kernels.formula_programs import program_slopes, run_program
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.jit import njit

# kinds of pieces; CREST: wave cut off below zero
POLYNOMIAL, POWER, WAVE, CREST = 0.0, 1.0, 2.0, 3.0
# scale times output of a block plus offset, and the positive part of this value
BLOCK, BLOCK_PART = 4.0, 5.0
FORMULA = 6.0  # header of the steps of a formula, see `formula_programs`


@njit(forceinline=True)
def piece_at(pieces, first, count, t, limit):
    """Row of `pieces` that applies at time t [s]; from time `limit` on, row of the piece that ends there (left limit).

    first, count : first row and number of pieces of the schedule
    """
    low, high = first, first + count
    while high - low > 1:
        middle = (low + high) // 2
        start = pieces[middle, 0]
        # A piece that begins at the end of the segment applies only from there on.
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
        # Beyond its duration the piece keeps its end value; a power of a negative number does not exist.
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
        span = pieces[row, 5]
        n = pieces[row, 6]
        rest = 1.0 - s / pieces[row, 5]
        fall = (pieces[row, 4] - pieces[row, 3]) * n / span
        # At its end only a linear piece still has a slope.
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
    if record["pieces"] < 0:
        return program_slopes(tables.pieces, record["first"], t, limit, tables.stack)
    if record["pieces"] == 1:
        return piece_slopes(tables.pieces, record["first"], t)
    row = piece_at(tables.pieces, record["first"], record["pieces"], t, limit)
    return piece_slopes(tables.pieces, row, min(t, limit))


@njit(forceinline=True)
def schedule_value(tables, index, t):
    """Value of schedule `index` at time t [s].

    From the end of the schedule segment on, a schedule of several pieces keeps its left limit at this end.
    """
    record = tables.schedules[index]
    # The usual case, a single piece, needs neither a search nor a call.
    if record["pieces"] == 1:
        return piece_value(tables.pieces, record["first"], t)
    return piecewise_value(tables, index, t)


@law_njit
def piecewise_value(tables, index, t):
    """Value of a schedule that has several pieces, or follows a block or a formula, as `schedule_value`."""
    prevent_inlining()
    record, limit = tables.schedules[index], tables.clock[0]["limit"]
    first, count = record["first"], record["pieces"]
    if count == 0:
        return block_value(tables.pieces, first, tables.applied[int(tables.pieces[first, 2])])
    if count < 0:
        return run_program(
            tables.pieces, first, t, limit, 0, tables.stack, tables.armed, tables.armed[:0]
        )
    return piece_value(
        tables.pieces, piece_at(tables.pieces, first, count, t, limit), min(t, limit)
    )


@njit
def formula_events(t, y, out, handle, g):
    """Write to g the two event functions of each kink of the formulas of time."""
    tables = open_tables(handle)
    limit, schedules = tables.clock[0]["limit"], tables.schedules
    for k in range(schedules.size):
        if schedules[k]["pieces"] < 0:
            run_program(
                tables.pieces, schedules[k]["first"], t, limit, 0, tables.stack, tables.armed, g
            )


@njit(forceinline=True)
def block_value(pieces, row, output):
    """Value of a schedule that follows a block; row : its row in `pieces`, output : output of the block."""
    value = pieces[row, 3] * output + pieces[row, 4]
    return max(value, 0.0) if pieces[row, 1] == BLOCK_PART else value


@njit(forceinline=True)
def value_with_limit(schedules, pieces, index, t, limit):
    """Value of schedule `index` at time t [s], continuous from the right; from `limit` [s] on, its left limit there.

    A schedule that follows a block has its value at the start.
    """
    record = schedules[index]
    if record["pieces"] == 0:
        return block_value(pieces, record["first"], pieces[record["first"], 5])
    if record["pieces"] == 1:
        return piece_value(pieces, record["first"], t)
    row = piece_at(pieces, record["first"], record["pieces"], t, limit)
    return piece_value(pieces, row, min(t, limit))
