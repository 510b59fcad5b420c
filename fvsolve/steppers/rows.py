"""Rows and fields: when the next is due, and what is written of those a step has passed. Knows no step and no model."""

from fvsolve.jit import njit
from fvsolve.steppers.orders import (
    DONE,
    EVERY,
    FIELD,
    FIELD_COUNT,
    FIELD_EVERY,
    NEXT_FIELD,
    NEXT_OUTPUT,
    RATED,
    ROWS,
    ROWS_FULL,
    START,
    STOP_AT,
    T,
)
from fvsolve.steppers.step import interpolate


@njit(forceinline=True)
def output_due(orders, memory, count_at, every, limit):
    """Time of the next row or field: START + count * every, or infinity."""
    if every <= 0.0 or memory[count_at] > limit:
        return 1e308
    return orders[START] + memory[count_at] * every


@njit(forceinline=True)
def row_due(orders, memory, times):
    """Time of the next row: the next of `times` where there are any [s]."""
    if times.size == 0:
        return output_due(orders, memory, NEXT_OUTPUT, orders[EVERY], 1e300)
    count = int(memory[NEXT_OUTPUT])
    return times[count] if count < times.size else 1e308


@njit(forceinline=True)
def next_due(orders, memory, times):
    """Time of whatever is to be written next [s]."""
    row = row_due(orders, memory, times)
    return min(row, output_due(orders, memory, NEXT_FIELD, orders[FIELD_EVERY], orders[FIELD_COUNT]))


@njit
def emit(
    rhs, observe, handle, orders, memory, times, flags, t_old, y_old, f_old, y, f, k, dense, out, y_out, spare, rows,
):  # fmt: skip
    """Write the rows due up to now; stops early at a field, which waits in y_out, or when the rows are full.

    spare : float64[n], for rates, which some probes hang on
    """
    t, h = memory[T], memory[T] - t_old
    while True:
        row = row_due(orders, memory, times)
        field = output_due(orders, memory, NEXT_FIELD, orders[FIELD_EVERY], orders[FIELD_COUNT])
        due = min(row, field)
        if due > t or (due >= orders[STOP_AT]):
            return DONE
        if row <= due and flags[ROWS] == rows.shape[0]:
            return ROWS_FULL
        interpolate((due - t_old) / h, h, y_old, f_old, y, f, k, dense, y_out)
        rhs(due, y_out, spare if orders[RATED] == 1.0 else spare[:0], out, handle)
        if row <= due:
            rows[flags[ROWS], 0] = due
            observe(due, y_out, out, handle, rows[flags[ROWS], 1:])
            flags[ROWS] += 1
            memory[NEXT_OUTPUT] += 1.0
        if field <= due:
            memory[NEXT_FIELD] += 1.0
            return FIELD
