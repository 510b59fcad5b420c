"""Output rows and field frames: times at which they are due, and values from dense output or separate steps."""

from fvsolve.jit import njit
from fvsolve.steppers.loop_indices import (
    ALWAYS_SEPARATE,
    CALLS,
    CONTROL,
    CONVERGENCE_FACTOR,
    DAMPED_STEP,
    DONE,
    EVERY,
    FACTOR_SIZE,
    FIELD,
    FIELD_COUNT,
    FIELD_EVERY,
    HAS_JACOBIAN,
    KNOWN_STEPS,
    NEVER_SEPARATE,
    NEWTON_FAILED,
    NEXT_FIELD,
    NEXT_OUTPUT,
    RADIUS,
    ROWS,
    ROWS_FULL,
    SEPARATE_ROWS,
    STAGES_STEP,
    START,
    STOP_AT,
    TOLERANCE,
    WORST,
    T,
)
from fvsolve.steppers.step_operations import BEGIN, HUGE, STOP, copy, interpolate

BASE, GAIN, LEAST, MOST = range(4)
AT_END = 1e-9  # in steps: a row closer to the step's end takes the state there
NEGLIGIBLE = 1e-9  # reference amount below which shares of it are not computed


@njit(forceinline=True)
def output_due(controls, loop_state, count_at, every, limit):
    """Time [s] of the next output row or field: start of the run + count * every, or 1e308 after the last.

    count_at : index of the count in `loop_state`; limit : greatest count; every : interval [s], 0 for no output
    """
    if every <= 0.0 or loop_state[count_at] > limit:
        return 1e308
    return controls[START] + loop_state[count_at] * every


@njit(forceinline=True)
def row_due(controls, loop_state, times):
    """Time of the next output row [s], from the array `times` if it is not empty.

    controls, loop_state : arrays of the time loop, see `loop_indices`
    """
    if times.size == 0:
        return output_due(controls, loop_state, NEXT_OUTPUT, controls[EVERY], 1e300)
    count = int(loop_state[NEXT_OUTPUT])
    return times[count] if count < times.size else 1e308


@njit(forceinline=True)
def next_due(controls, loop_state, times):
    """Time of the next output row or field frame, whichever comes first [s].

    times : times of the rows, or empty if they are equidistant
    """
    row = row_due(controls, loop_state, times)
    return min(row, output_due(controls, loop_state, NEXT_FIELD, controls[FIELD_EVERY], controls[FIELD_COUNT]))


@njit(forceinline=True)
def reference_amount(states, bounds, y):
    """Reference amount of a bounded state, such as the water in a cell for the mass of a scalar there.

    It is base + gain (y[j] + y[k]), without the terms whose index is negative.
    states : number of the state, j, k; bounds : base and gain in the first two entries
    """
    amount = bounds[BASE]
    if states[1] >= 0:
        amount += bounds[GAIN] * (y[states[1]] + (y[states[2]] if states[2] >= 0 else 0.0))
    return amount


@njit
def limit_to_bounds(states, bounds, y_old, y, out):
    """Limit interpolated states to their bounds, because a polynomial between two valid states may leave them.

    states : int64[3 q]  for each bounded state its number and the numbers of up to two states for its reference amount,
    -1 for none, see `reference_amount`
    bounds : float64[q, 4]  base and gain of the reference amount, least and greatest ratio of the state to this amount;
    ratios outside this range at the start or end of the step widen it
    y_old, y : states at the start and the end of the step; out : interpolated state, which is changed
    """
    for r in range(bounds.shape[0]):
        row_states, low, high = states[3 * r : 3 * r + 3], bounds[r, LEAST], bounds[r, MOST]
        for y_end in (y_old, y):
            total = reference_amount(row_states, bounds[r], y_end)
            if total > NEGLIGIBLE:
                share = y_end[row_states[0]] / total
                low, high = min(low, share), max(high, share)
        total = max(reference_amount(row_states, bounds[r], out), 0.0)
        value = max(out[row_states[0]], low * total)
        out[row_states[0]] = min(value, high * total) if high < HUGE else value


@njit(forceinline=True)
def needs_separate_step(controls, work):
    """True if output rows within the last step come from separate steps, see `Integrator.separate_rows`."""
    if controls[CONTROL] == TOLERANCE or controls[SEPARATE_ROWS] == NEVER_SEPARATE:
        return False
    return controls[SEPARATE_ROWS] == ALWAYS_SEPARATE or work[KNOWN_STEPS] < 2.0


@njit
def separate_step(
    attempt, rhs, factor, solve, factor_complex, solve_complex, join, handle, coefficients, structure, row_blocks, sums,
    t, h, y, old, new, ledger_rates, ledger_offset, out, scale, controls, loop_state, work, spare, spare_flat,
    spare_complex,
):  # fmt: skip
    """Compute y[new] at t + h by a separate step from y[old] for an output row; returns True if it could be solved.

    The step uses separate arrays and no data of earlier steps, so that neither the steps of a run nor the stages that
    energy studies read depend on the output rows. Its calls of rhs are counted.
    ledger_rates : float64[s, ledgers]; spare : float64[s + vectors, n]; spare_flat : float64[work + factors]
    spare_complex : factors for complex shifts; other arguments as for `erk.attempt` and `dirk.attempt`
    """
    s, worst, radius = ledger_rates.shape[0], loop_state[WORST], loop_state[RADIUS]
    if work.size > 0:  # no Jacobian and no earlier stages
        spare_flat[:FACTOR_SIZE] = 0.0
        spare_flat[HAS_JACOBIAN], spare_flat[STAGES_STEP], spare_flat[DAMPED_STEP], spare_flat[CONVERGENCE_FACTOR] = (
            0.0,
            -1.0,
            -1.0,
            1.0,
        )
        spare_flat[FACTOR_SIZE] = work[FACTOR_SIZE]
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
    start_slope, scale, out, y_out, rows, bounded_states, bounds, work, spare, spare_ledger_rates, spare_flat,
    spare_complex,
):  # fmt: skip
    """Write the output rows due up to the present time; returns a code of `loop_indices`.

    DONE : all rows are written; FIELD : a field frame is due, its state is in y_out; ROWS_FULL : `rows` has no space
    Rows from controls[STOP_AT] on are not written. Where a separate step cannot be solved, its row is interpolated
    linearly.
    t_old : time of the last state; now, old : rows of the present and the last state in y
    f_old, f : rates of the last and the present state; start_slope : result of `start_slope_correction`
    Other arguments as for `time_loop.run_steps`.
    """
    t, h, separate = loop_state[T], loop_state[T] - t_old, needs_separate_step(controls, work)
    while True:
        row = row_due(controls, loop_state, times)
        field = output_due(controls, loop_state, NEXT_FIELD, controls[FIELD_EVERY], controls[FIELD_COUNT])
        due = min(row, field)
        if due > t or (due >= controls[STOP_AT]):
            return DONE
        if row <= due and progress[ROWS] == rows.shape[0]:
            return ROWS_FULL
        solved, new = False, 3 - now - old
        if separate and due < t - AT_END * h:
            solved = separate_step(
                attempt, rhs, factor, solve, factor_complex, solve_complex, join, handle, coefficients, structure,
                row_blocks, sums, t_old, due - t_old, y, old, new, spare_ledger_rates, ledger_offset, out, scale,
                controls, loop_state, work, spare, spare_flat, spare_complex,
            )  # fmt: skip
        for m in range(row_blocks.shape[0]):
            begin, end = row_blocks[m, BEGIN], row_blocks[m, STOP]
            if solved:
                copy(y[new, begin:end], y_out[begin:end])
            elif separate:
                theta = (due - t_old) / h
                for i in range(begin, end):
                    y_out[i] = y[old, i] + theta * (y[now, i] - y[old, i])
            else:
                interpolate(begin, end, (due - t_old) / h, h, y[old], f_old, y[now], f, k, dense, start_slope, y_out)
        limit_to_bounds(bounded_states, bounds, y[old], y[now], y_out)
        rhs(due, y_out, y_out[:0], out, handle)
        if row <= due:
            rows[progress[ROWS], 0] = due
            observe(due, y_out, out, handle, rows[progress[ROWS], 1:])
            progress[ROWS] += 1
            loop_state[NEXT_OUTPUT] += 1.0
        if field <= due:
            loop_state[NEXT_FIELD] += 1.0
            return FIELD
