"""Output rows and field frames: times at which they are due, and values from dense output or separate steps."""

from fvsolve.core.kernels.stage_sums import HUGE
from fvsolve.core.steppers import loop_records as rec
from fvsolve.core.steppers import run_handle
from fvsolve.core.steppers.coefficients import start_slope_of
from fvsolve.core.steppers.row_substeps import needs_defect, substep_row
from fvsolve.core.steppers.run_handle import evaluate, open_run, store_ledger_rates
from fvsolve.core.steppers.step_control import NEVER
from fvsolve.core.steppers.step_operations import BEGIN, STOP, copy, interpolate
from fvsolve.jit import njit

BASE, GAIN, LEAST, MOST = range(4)
AT_END = 1e-9  # in steps: a row closer to the step's end takes the state there
NEGLIGIBLE = 1e-9  # reference amount below which shares of it are not computed


@njit(forceinline=True)
def output_due(start, count, every, limit):
    """Time [s] of the next output row or field: start of the run + count * every, or 1e308 after the last.

    count : number of the output; limit : greatest number; every : interval [s], 0 for no output
    """
    if every <= 0.0 or count > limit:
        return NEVER
    return start + count * every


@njit(forceinline=True)
def row_due(r):
    """Time [s] of the next output row: from the list `times`, or, if it is empty, as in `output_due`.

    r : open handle of the run
    """
    control = r.control[0]
    count = r.state[0]["next_output"]
    times = r.times
    if times.size > 0:
        return times[int(count)] if count < times.size else NEVER
    return output_due(control["start"], count, control["every"], NEVER)


@njit(forceinline=True)
def field_due(r):
    """Time [s] of the next field frame; 1e308 after the last."""
    control = r.control[0]
    return output_due(
        control["start"], r.state[0]["next_field"], control["field_every"], control["field_count"]
    )


@njit(forceinline=True)
def next_due(r):
    """Time [s] of the next output row or field frame."""
    return min(row_due(r), field_due(r))


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


@njit(forceinline=True)
def per_amount(value, total, thin):
    """Ratio of a state to its reference amount, which fades to zero below the amount `thin`."""
    wide = max(total, thin)
    return value * (2.0 * total / (total * total + wide * wide))


@njit
def limit_ratio(states, row, y_old, y, out):
    """Limit the ratio of an interpolated state to its reference amount to the range of both ends of the step.

    Strong damping within a step makes rates at its ends useless for interpolation: between slow states the polynomial
    has fast ones, without bound. states, row : as for `limit_to_bounds`, of one state; other arguments as there
    """
    first = per_amount(y_old[states[0]], max(reference_amount(states, row, y_old), 0.0), row[LEAST])
    last = per_amount(y[states[0]], max(reference_amount(states, row, y), 0.0), row[LEAST])
    total = max(reference_amount(states, row, out), 0.0)
    found = per_amount(out[states[0]], total, row[LEAST])
    limited = min(max(found, min(first, last)), max(first, last))
    if limited != found:
        # The ratio of `per_amount`, solved for the state.
        wide = max(total, row[LEAST])
        out[states[0]] = (
            limited * (total * total + wide * wide) / (2.0 * total) if total > 0.0 else 0.0
        )


@njit
def limit_to_bounds(states, bounds, y_old, y, out, checked):
    """Limit interpolated states to their bounds, because a polynomial between two valid states may leave them.

    states : int64[3 q]  for each bounded state its number and the numbers of up to two states for its reference amount,
    -1 for none, see `reference_amount`
    bounds : float64[q, 4]  base and gain of the reference amount, least and greatest ratio of the state to this amount;
    ratios outside this range at the start or end of the step widen it. A row with a greatest ratio below the least is
    a flow, for which the least is an amount, below which the ratio fades to zero, see `limit_ratio`
    y_old, y : states at the start and the end of the step; out : interpolated state, which is changed
    checked : True if the error of the interpolation is within the tolerance of the steps: flows are not limited then
    """
    for r in range(bounds.shape[0]):
        row_states = states[3 * r : 3 * r + 3]
        low = bounds[r, LEAST]
        high = bounds[r, MOST]
        if high < low:
            if not checked:
                limit_ratio(row_states, bounds[r], y_old, y, out)
            continue
        # A state that is outside its bounds at an end must stay continuous there.
        for y_end in (y_old, y):
            total = reference_amount(row_states, bounds[r], y_end)
            if total > NEGLIGIBLE:
                share = y_end[row_states[0]] / total
                low, high = min(low, share), max(high, share)
        total = max(reference_amount(row_states, bounds[r], out), 0.0)
        value = max(out[row_states[0]], low * total)
        out[row_states[0]] = min(value, high * total) if high < HUGE else value


@njit(forceinline=True)
def needs_separate_step(r):
    """True if output rows within the last step come from separate steps, see `Integrator.separate_rows`."""
    separate = r.control[0]["separate_rows"]
    if r.control[0]["mode"] == rec.TOLERANCE or separate == rec.NEVER_SEPARATE:
        return False
    return separate == rec.ALWAYS_SEPARATE or r.newton[0]["known_steps"] < 2.0


@njit
def separate_step(handle, r, t, h, old, new):
    """Compute y[new] at t + h by a separate step from y[old] for an output row; returns True if it could be solved.

    The step uses the arrays behind the handle `spare` and no data of earlier steps, so that neither the steps of a run
    nor the stages that energy studies read depend on the output rows. Its calls of rhs are counted.
    """
    own, state = open_run(r.spare), r.state[0]
    # A row must leave no trace in what the steps report and decide.
    worst = state["worst"]
    radius = state["radius"]
    newton = own.newton[0]
    # no Jacobian, no earlier stages
    newton["has_jacobian"] = newton["jacobian_step"] = newton["known_steps"] = 0.0
    newton["shift"] = newton["increment_ratio"] = 0.0
    newton["stages_step"] = newton["damped_step"] = -1.0
    newton["convergence_factor"], newton["factor_size"] = 1.0, r.newton[0]["factor_size"]
    evaluate(handle, own, t, r.y[old], own.k[0])
    store_ledger_rates(own, 0)
    e = run_handle.call_attempt(r.calls[run_handle.STEP], handle, r.spare, t, h, old, new)
    state["worst"], state["radius"] = worst, radius
    return e != rec.NEWTON_FAILED


@njit
def interpolate_row(r, t_old, due, separate, now, old):
    """Write the state at the time `due` within the last step, which began at t_old, to `y_out`.

    separate : True for a linear interpolation, where a separate step could not be solved
    """
    y = r.y[old]
    y_new = r.y[now]
    out = r.y_out
    h = r.state[0]["t"] - t_old
    theta = (due - t_old) / h
    row_blocks = r.row_blocks
    s = r.k.shape[0]
    start_slope = start_slope_of(r.coefficients, s)
    f = r.k[s - 1] if r.control[0]["stage_slope"] == 1 else r.k[0]
    for m in range(row_blocks.shape[0]):
        begin, end = row_blocks[m, BEGIN], row_blocks[m, STOP]
        if separate:
            for i in range(begin, end):
                out[i] = y[i] + theta * (y_new[i] - y[i])
        else:
            interpolate(begin, end, theta, h, y, r.f_old, y_new, f, r.k, r.dense, start_slope, out)


@njit
def compute_row(handle, r, t_old, due, now, old):
    """Compute the state `y_out` of an output row at the time `due`, and the results `out_row` there.

    t_old : time of the last state; now, old : rows of y with the present and the last state
    Where a separate step cannot be solved, the row is interpolated linearly.
    """
    t = r.state[0]["t"]
    new = 3 - now - old
    y_out = r.y_out
    row_blocks = r.row_blocks
    separate = needs_separate_step(r)
    within = due < t - AT_END * (t - t_old)
    # From the most accurate source to the cheapest: substeps, a separate step, the dense output.
    if within and needs_defect(r) and substep_row(handle, r, t_old, due, now, old):
        pass
    elif separate and within and separate_step(handle, r, t_old, due - t_old, old, new):
        for m in range(row_blocks.shape[0]):
            begin, end = row_blocks[m, BEGIN], row_blocks[m, STOP]
            copy(r.y[new, begin:end], y_out[begin:end])
    else:
        interpolate_row(r, t_old, due, separate, now, old)
    limit_to_bounds(r.bounded_states, r.bounds, r.y[old], r.y[now], y_out, needs_defect(r))
    # Without rates: a row only needs the solved nodes.
    run_handle.call_rhs(r.calls[run_handle.RHS_CALL], due, y_out, y_out[:0], r.out_row, handle)


@njit
def emit(handle, r, last):
    """Write the output rows due up to the time `last` [s]; returns a code of `loop_records`.

    DONE : all rows are written; FIELD : a field frame is due, its state is in y_out; ROWS_FULL : `rows` has no space
    Rows from control["stop_at"] on are not written.
    """
    state = r.state[0]
    progress = r.progress[0]
    rows = r.rows
    t = r.state[0]["t"]
    t_old = t - state["last"]
    stop_at = r.control[0]["stop_at"]
    now = progress["now"]
    old = progress["old"]
    while True:
        row, field = row_due(r), field_due(r)
        due = min(row, field)
        if due > last or due >= stop_at:
            return rec.DONE
        if row <= due and progress["rows"] == rows.shape[0]:
            return rec.ROWS_FULL
        compute_row(handle, r, t_old, due, now, old)
        if row <= due:
            values = rows[progress["rows"], 1:]
            rows[progress["rows"], 0] = due
            run_handle.call_observer(
                r.calls[run_handle.OBSERVER], due, r.y_out, r.out_row, handle, values
            )
            progress["rows"] += 1
            state["next_output"] += 1.0
        # After the row of the same time, because the caller writes the frame and then calls again.
        if field <= due:
            state["next_field"] += 1.0
            return rec.FIELD
