"""Rows and fields: when the next is due, and what is written of those a step has passed. Knows no model."""

from fvsolve.jit import njit
from fvsolve.steppers.slots import (
    ALWAYS_APART,
    APART,
    CALLS,
    CONTROL,
    DAMPED,
    DONE,
    EVERY,
    FIELD,
    FIELD_COUNT,
    FIELD_EVERY,
    HAS,
    KNOWN,
    NEVER_APART,
    NEWTON_FAILED,
    NEXT_FIELD,
    NEXT_OUTPUT,
    RADIUS,
    ROWS,
    ROWS_FULL,
    SEEN,
    START,
    STOP_AT,
    STORE,
    SURE,
    TOLERANCE,
    WORST,
    T,
)
from fvsolve.steppers.step import BEGIN, HUGE, STOP, copy, interpolate

BASE, GAIN, LEAST, MOST = range(4)
AT_END = 1e-9  # of a step: a row so near its end is read there
LITTLE = 1e-9  # of what there are shares of, too little to tell them by


@njit(forceinline=True)
def output_due(controls, loop_state, count_at, every, limit):
    """Time of the next row or field: START + count * every, or infinity."""
    if every <= 0.0 or loop_state[count_at] > limit:
        return 1e308
    return controls[START] + loop_state[count_at] * every


@njit(forceinline=True)
def row_due(controls, loop_state, times):
    """Time of the next row: the next of `times` where there are any [s]."""
    if times.size == 0:
        return output_due(controls, loop_state, NEXT_OUTPUT, controls[EVERY], 1e300)
    count = int(loop_state[NEXT_OUTPUT])
    return times[count] if count < times.size else 1e308


@njit(forceinline=True)
def next_due(controls, loop_state, times):
    """Time of whatever is to be written next [s]."""
    row = row_due(controls, loop_state, times)
    return min(row, output_due(controls, loop_state, NEXT_FIELD, controls[FIELD_EVERY], controls[FIELD_COUNT]))


@njit(forceinline=True)
def whole(at, by, y):
    """What a state is a share of: base + gain (y[j] + y[k]), of both, one or none."""
    found = by[BASE]
    if at[1] >= 0:
        found += by[GAIN] * (y[at[1]] + (y[at[2]] if at[2] >= 0 else 0.0))
    return found


@njit
def keep_within(at, by, y_old, y, out):
    """Hold what is read between two states to the bounds that these have: a polynomial through both may leave them.

    at : int64[3 q]  a state, and up to two that say what it is a share of, else -1
    by : float64[q, 4]  BASE, GAIN (see `whole`), LEAST and MOST share, which either end may have left
    """
    for r in range(by.shape[0]):
        place, low, high = at[3 * r : 3 * r + 3], by[r, LEAST], by[r, MOST]
        for y_end in (y_old, y):
            total = whole(place, by[r], y_end)
            if total > LITTLE:
                share = y_end[place[0]] / total
                low, high = min(low, share), max(high, share)
        total = max(whole(place, by[r], out), 0.0)
        found = max(out[place[0]], low * total)
        out[place[0]] = min(found, high * total) if high < HUGE else found


@njit(forceinline=True)
def comes_apart(controls, work):
    """Whether rows within the step behind come from steps of their own, see `slots.APART`."""
    if controls[CONTROL] == TOLERANCE or controls[APART] == NEVER_APART:
        return False
    return controls[APART] == ALWAYS_APART or work[KNOWN] < 2.0


@njit
def step_apart(
    attempt, rhs, factor, solve, factor_complex, solve_complex, join, handle, coefficients, structure, row_blocks, sums,
    t, h, y, old, new, ledger_rates, ledger_offset, out, scale, controls, loop_state, work, spare, spare_flat,
    spare_complex,
):  # fmt: skip
    """y[new] at t + h by a step of the method from y[old], as from a start; True where it could be solved.

    It works on arrays of its own, so that neither the steps of a run nor the stages that `energy` reads depend on its
    rows; what it costs is counted.
    supply : float64[s, ledgers]; spare : float64[s + vectors, n]; spare_flat : float64[work + store]
    """
    s, worst, radius = ledger_rates.shape[0], loop_state[WORST], loop_state[RADIUS]
    if work.size > 0:  # no Jacobian, no stages to go on from
        spare_flat[:STORE] = 0.0
        spare_flat[HAS], spare_flat[SEEN], spare_flat[DAMPED], spare_flat[SURE] = 0.0, -1.0, -1.0, 1.0
        spare_flat[STORE] = work[STORE]
    rhs(t, y[old], spare[0], out, handle)
    loop_state[CALLS] += 1.0
    for m in range(ledger_rates.shape[1]):
        ledger_rates[0, m] = out[ledger_offset + m]
    e = attempt(
        rhs, factor, solve, factor_complex, solve_complex, join, handle, coefficients, structure, row_blocks, sums, t,
        h, y, old, new, spare[:s], ledger_rates, ledger_offset, out, scale, controls, loop_state,
        spare_flat[: work.size], spare[s:], spare_flat[work.size :], spare_complex,
    )  # fmt: skip
    loop_state[WORST], loop_state[RADIUS] = worst, radius
    return e != NEWTON_FAILED


@njit
def emit(
    attempt, rhs, observe, factor, solve, factor_complex, solve_complex, join, handle, coefficients, structure,
    row_blocks, sums, controls, loop_state, times, progress, t_old, y, now, old, f_old, f, k, ledger_offset, dense,
    bend, scale, out, y_out, rows, within_at, within_by, work, spare, spare_ledger_rates, spare_flat, spare_complex,
):  # fmt: skip
    """Write the rows due up to now; stops early at a field, which waits in y_out, or when the rows are full."""
    t, h, apart = loop_state[T], loop_state[T] - t_old, comes_apart(controls, work)
    while True:
        row = row_due(controls, loop_state, times)
        field = output_due(controls, loop_state, NEXT_FIELD, controls[FIELD_EVERY], controls[FIELD_COUNT])
        due = min(row, field)
        if due > t or (due >= controls[STOP_AT]):
            return DONE
        if row <= due and progress[ROWS] == rows.shape[0]:
            return ROWS_FULL
        solved, new = False, 3 - now - old
        if apart and due < t - AT_END * h:
            solved = step_apart(
                attempt, rhs, factor, solve, factor_complex, solve_complex, join, handle, coefficients, structure,
                row_blocks, sums, t_old, due - t_old, y, old, new, spare_ledger_rates, ledger_offset, out, scale,
                controls, loop_state, work, spare, spare_flat, spare_complex,
            )  # fmt: skip
        for m in range(row_blocks.shape[0]):
            begin, end = row_blocks[m, BEGIN], row_blocks[m, STOP]
            if solved:
                copy(y[new, begin:end], y_out[begin:end])
            elif apart:
                theta = (due - t_old) / h
                for i in range(begin, end):
                    y_out[i] = y[old, i] + theta * (y[now, i] - y[old, i])
            else:
                interpolate(begin, end, (due - t_old) / h, h, y[old], f_old, y[now], f, k, dense, bend, y_out)
        keep_within(within_at, within_by, y[old], y[now], y_out)
        rhs(due, y_out, y_out[:0], out, handle)
        if row <= due:
            rows[progress[ROWS], 0] = due
            observe(due, y_out, out, handle, rows[progress[ROWS], 1:])
            progress[ROWS] += 1
            loop_state[NEXT_OUTPUT] += 1.0
        if field <= due:
            loop_state[NEXT_FIELD] += 1.0
            return FIELD
