"""Time loop: steps of any method with dense output, step control and event location.

A single compiled loop is used for every method and every model: the functions for a step and for the rates have
declared types, and the coefficients of a method are data.
"""

from math import isfinite

from fvsolve.jit import COMPILING, njit
from fvsolve.kernels.stage_sums import BAD, CHECK, MODE, OFF
from fvsolve.steppers.coefficients import error_of, row_of, start_slope_of, weights_of
from fvsolve.steppers.event_location import crossed, has_switched, locate, set_flags
from fvsolve.steppers.ledger import book, book_error
from fvsolve.steppers.loop_indices import (
    ALLOW_FUSED,
    ARRIVED,
    BAD_STATUS,
    BAD_VALUE,
    BUDGET,
    BUDGET_SPENT,
    CALLS,
    CLOSING_RATE,
    CONTROL,
    CORRECTED,
    DONE,
    EMIT,
    END,
    ERROR_OLD,
    EXPLICIT,
    FRESH,
    FSAL,
    FUSED,
    GROWTH_CHECK_STEPS,
    GROWTH_FOUND,
    HAS_JACOBIAN,
    HAS_LAST_STEP,
    JUMP_TIME,
    KIND,
    KNOWN_STEPS,
    LAST,
    N_MARK,
    NEWTON_FAILED,
    NEWTON_FAILURES,
    NEWTON_SOLVED,
    NEWTON_STUCK,
    NOT_FINITE,
    NOW,
    OLD,
    PHASE,
    PLACE,
    RATE,
    READY,
    REJECTIONS,
    SIZE,
    SPLIT_REMAINDER,
    SPLIT_STEPS,
    STAGES_STEP,
    STATUS,
    STEP,
    STEPS,
    STOP_HERE,
    STOPPED,
    SWITCH_COUNT,
    SWITCH_PENDING,
    SWITCHED,
    T_MARK,
    TINY_STEP,
    TOLERANCE,
    UNBOOKED,
    WATCH,
    T,
)
from fvsolve.steppers.output_rows import emit, next_due, row_due
from fvsolve.steppers.signatures import ATTEMPT, compiled_as
from fvsolve.steppers.step_control import (
    APPROACH,
    HUGE,
    approaches,
    arriving_step,
    closing_step,
    end_of,
    grown,
    next_step,
    reduced,
    retains_length,
    row_step_end,
    shortest,
    too_short,
    watch,
)
from fvsolve.steppers.step_operations import (
    BEGIN,
    STOP,
    add_stored,
    all_finite,
    copy,
    exceeded,
    start_slope_defect,
    update_carry,
)

if COMPILING:
    from fvsolve.steppers.signatures import (
        attempt_at,
        events_at,
        factor_at,
        factor_complex_at,
        fused_step_at,
        join_at,
        observe_at,
        record_at,
        rhs_at,
        solve_at,
        solve_complex_at,
    )


@njit(forceinline=True)
def can_use_fused_step(controls, loop_state, times, h):
    """True if fused steps are allowed, and a step of length h ends before the next row, field or end of the segment.

    times : times of the output rows if given as a list; controls, loop_state : arrays of the time loop
    """
    if (
        controls[ALLOW_FUSED] == 0.0
        or too_short(controls, loop_state, h)
        or h >= (controls[END] - loop_state[T]) * (1.0 - 1e-9)
    ):
        return False
    return next_due(controls, loop_state, times) > loop_state[T_MARK] + (loop_state[N_MARK] + 1.0) * h


@njit(forceinline=True)
def error_with_ledger(h, e, coefficients, k, stored, ledger_rates, controls, ledger):
    """Error of a step in units of the tolerance: the greater of the errors of its states and of its ledger amounts.

    e : error of the states; h : step; other arguments as for `run_steps`. Without error control it is e.
    """
    if controls[CONTROL] != TOLERANCE:
        return e
    return max(e, book_error(h, error_of(coefficients, k.shape[0]), k, stored, ledger_rates, controls[SIZE], ledger))


@njit(forceinline=True)
def acceptable(e, near_kink):
    """True if a step with the error e, in units of the tolerance, is accepted.

    near_kink : True if the segment ends so soon that rounding dominates; then every error except NaN is accepted
    """
    return e <= 1.0 or (e == e and near_kink)


@njit
def run_steps(
    attempt, fused_step, observe, record, events, rhs, factor, solve, factor_complex, solve_complex, join, handle,
    coefficients, structure, row_blocks, sums, dense, controls, loop_state, times, progress, y, k, f_old, ledger_rates,
    ledger_offset, ledger, scale, out, out_row, values, g, g_new, armed, stored, carry, y_out, rows, bounded_states,
    bounds, work, vectors, factors, complex_factors, spare, spare_ledger_rates, spare_flat, spare_complex, largest,
):  # fmt: skip
    """Step from loop_state[T] to controls[END]; returns the reason for the return, a code of `loop_indices`.

    The caller handles the reason and calls the function again with the same arrays.
    attempt : step of the method; rhs(t, y, dydt, out, handle) : rates dydt and other results `out` of the model; with
    an empty dydt it computes only `out`, which is enough for an output row
    observe, record : functions for the probes of an output row, and for each accepted state; events : event functions
    fused_step(t, h, y, y_new, out, handle, values) : complete step of a one-stage method that ends at t, with `out` and
    the record of its end; used if controls[ALLOW_FUSED] allows it and no output row is due
    join(sums, row_blocks, handle) : exchange of partial sums between bands that are stepped in parallel
    row_blocks, sums : states of this band, and an array of partial sums of all bands, see `step_operations`
    controls, loop_state, progress : arrays described in `loop_indices`; values : probe values of the present state
    dense : coefficients of the dense output; ledger : float64[5 m]  integrals of out[ledger_offset:], see `ledger`
    y : float64[4, n]  present, last and next state, and a stage; k : float64[s, n]  stages
    f_old : float64[n]  rates at the start of the last step, or result of `start_slope_defect`
    out_row, y_out : results and state of an output row
    g, g_new, armed : values of the event functions at the start and the end of a step, and event flags
    stored, carry : int64[q], float64[q]  states with compensated sums, and the rounding errors of these sums
    rows : float64[capacity, 1 + probes]  output rows; times : times of the rows if given as a list
    bounded_states, bounds : limits of interpolated rows, see `limit_to_bounds`
    work, vectors, factors, complex_factors : data that implicit steps keep, see `dirk.attempt`
    spare, spare_ledger_rates, spare_flat, spare_complex : arrays for `separate_step`
    largest : float64[n]  largest allowed states, checked every 16 steps, or empty
    Other arguments as for `erk.attempt` and `dirk.attempt`.
    """
    # event_known: g_new belongs to the end of the last step
    s, reuse, event_known, t_new = k.shape[0], False, False, 0.0
    blocked = controls[KIND] == EXPLICIT and structure.size > 0
    b, start_slope = weights_of(coefficients, s), start_slope_of(coefficients, s)
    # Where the last stage is the step's end, use its slope there: re-evaluating f would amplify the Newton residual.
    use_stage_slope = controls[KIND] == NEWTON_SOLVED and dense.shape[0] == 0
    for j in range(s):
        use_stage_slope = use_stage_slope and row_of(coefficients, s, s - 1)[j] == b[j]
    for _ in range(1 << 62):
        now, old = progress[NOW], progress[OLD]
        new = 3 - now - old
        if progress[PHASE] == FRESH:
            if event_known:
                copy(g_new, g)
            elif g.size > 0:
                events(loop_state[T], y[now], handle, g)
            event_known = False
            if has_switched(g, armed):
                progress[SWITCH_PENDING] = progress[
                    HAS_LAST_STEP
                ]  # rows due before the switch still use the previous rhs
                if progress[SWITCH_PENDING] == 0:
                    set_flags(g, armed)
                    return SWITCHED
            if reuse:
                for m in range(row_blocks.shape[0]):
                    begin, end = row_blocks[m, BEGIN], row_blocks[m, STOP]
                    copy(k[s - 1, begin:end], k[0, begin:end])
            else:
                if blocked:
                    structure[MODE], structure[BAD] = CHECK, 0
                rhs(loop_state[T], y[now], k[0], out, handle)
                if blocked:
                    structure[MODE] = OFF
                loop_state[CALLS] += 1.0
            checked, reuse = blocked and not reuse, False
            progress[PHASE] = EMIT
            record(loop_state[T], y[now], out, handle, values)
            if out[STATUS] == CORRECTED:
                rhs(loop_state[T], y[now], k[0], out, handle)
                loop_state[CALLS] += 1.0
                record(loop_state[T], y[now], out, handle, values)
            if not all_finite(join, handle, row_blocks, sums, y[now], structure, checked):
                out[STATUS] = NOT_FINITE
        if progress[PHASE] <= EMIT:
            if out[STATUS] == NOT_FINITE or not isfinite(out[RATE]):
                return BAD_VALUE
            if out[STATUS] != 0.0:
                return BAD_STATUS
            if loop_state[UNBOOKED] > 0.0:
                known = use_stage_slope and work[KNOWN_STEPS] > 0.0
                book(loop_state[UNBOOKED], b, ledger_rates, dense, use_stage_slope, known, out[ledger_offset:], ledger)
                loop_state[UNBOOKED] = 0.0
        if progress[PHASE] == EMIT:
            if progress[HAS_LAST_STEP] == 1 and next_due(controls, loop_state, times) <= loop_state[T]:
                f_end = k[s - 1] if use_stage_slope else k[0]
                status = emit(
                    attempt, rhs, observe, factor, solve, factor_complex, solve_complex, join, handle, coefficients,
                    structure, row_blocks, sums, controls, loop_state, times, progress,
                    loop_state[T] - loop_state[LAST], y, now, old, f_old, f_end, k, ledger_offset, dense, start_slope,
                    scale, out_row, y_out, rows, bounded_states, bounds, work, spare, spare_ledger_rates, spare_flat,
                    spare_complex,
                )  # fmt: skip
                if status != DONE:
                    return status
            if progress[SWITCH_PENDING] == 1:  # the rhs has switched: discard the step size and the Jacobian
                set_flags(g, armed)
                progress[SWITCH_PENDING], progress[PHASE] = 0, FRESH
                if controls[CONTROL] == TOLERANCE:
                    loop_state[STEP] = 0.0
                if controls[KIND] != EXPLICIT:
                    work[HAS_JACOBIAN], work[STAGES_STEP] = 0.0, -1.0
                return SWITCHED
            # a jump arrives now, after events have acted: the next record is of the state after it
            if out[JUMP_TIME] == loop_state[T]:
                out[STATUS] = ARRIVED
                record(loop_state[T], y[now], out, handle, values)
                progress[HAS_LAST_STEP], progress[PHASE] = 0, FRESH
                if controls[KIND] != EXPLICIT:
                    work[HAS_JACOBIAN], work[STAGES_STEP] = 0.0, -1.0
                continue
            progress[PHASE] = READY
        for m in range(ledger_rates.shape[1]):
            ledger_rates[0, m] = out[ledger_offset + m]
        if too_short(controls, loop_state, controls[END] - loop_state[T]):  # the rest of the segment is rounding
            loop_state[T] = controls[END]
            return DONE
        if out[PLACE] == STOP_HERE:
            return STOPPED
        if controls[BUDGET] <= 0.0:
            return BUDGET_SPENT
        h = (
            loop_state[SPLIT_REMAINDER]
            if loop_state[SPLIT_REMAINDER] > 0.0
            else next_step(controls, loop_state, out[RATE], k, scale)
        )
        if controls[CONTROL] != TOLERANCE:
            h = closing_step(loop_state, out[CLOSING_RATE], h, shortest(controls, loop_state))
        full_h, h = h, arriving_step(controls, loop_state, out[JUMP_TIME], h)
        fused, last = can_use_fused_step(controls, loop_state, times, h), False
        if fused:
            loop_state[CALLS] += 1.0
            fused_step(loop_state[T_MARK] + (loop_state[N_MARK] + 1.0) * h, h, y[now], y[new], out, handle, values)
        elif progress[PHASE] == FUSED:  # fused steps do not compute k[0], which the next step needs
            progress[PHASE] = FRESH
            loop_state[CALLS] -= 1.0
            continue
        failure, rate = TINY_STEP, out[RATE]
        due = HUGE if fused else row_step_end(controls, loop_state, row_due(controls, loop_state, times), h)
        h = min(h, due - loop_state[T])
        while not fused:
            rest = controls[END] - loop_state[T]
            last = h >= rest * (1.0 - 1e-9)
            if last and approaches(controls, loop_state, rest):
                h, last = APPROACH * rest, False
            elif last:
                h = rest
            if too_short(controls, loop_state, h) and (not last or failure == NEWTON_STUCK):
                return failure
            e = attempt(
                rhs, factor, solve, factor_complex, solve_complex, join, handle, coefficients, structure, row_blocks,
                sums, loop_state[T], h, y, now, new, k, ledger_rates, ledger_offset, out, scale, controls, loop_state,
                work, vectors, factors, complex_factors,
            )  # fmt: skip
            near_kink = rest <= 1e3 * shortest(controls, loop_state)
            if e != NEWTON_FAILED:
                e = error_with_ledger(h, e, coefficients, k, stored, ledger_rates, controls, ledger)
                if acceptable(e, near_kink):
                    t_new, event_known = end_of(controls, loop_state, h, last, due), True
                    changed = add_stored(h, b, k, y[now], y[new], stored, carry)
                    if g.size > 0:
                        events(t_new, y[new], handle, g_new)
                    if crossed(g, g_new):
                        event_known = False
                        length, e = locate(
                            attempt, rhs, factor, solve, factor_complex, solve_complex, events, join, handle,
                            coefficients, structure, row_blocks, sums, h, y, now, new, k, ledger_rates, ledger_offset,
                            out, scale, controls, loop_state, work, vectors, factors, complex_factors, g, g_new, e,
                        )  # fmt: skip
                        if e != NEWTON_FAILED:
                            h, loop_state[STEP], loop_state[SPLIT_REMAINDER] = length, 0.0, 0.0
                            last = last and loop_state[T] + h >= controls[END]
                            e = error_with_ledger(h, e, coefficients, k, stored, ledger_rates, controls, ledger)
            if e == NEWTON_FAILED:
                failure = NEWTON_STUCK
                loop_state[NEWTON_FAILURES] += 1.0
                # a given step is taken in parts that end together where it would have ended
                if controls[CONTROL] != TOLERANCE and loop_state[SPLIT_REMAINDER] == 0.0:
                    loop_state[SPLIT_REMAINDER] = h
                    loop_state[SPLIT_STEPS] += 1.0
                h = full_h = 0.25 * h
                if controls[CONTROL] == TOLERANCE:
                    loop_state[STEP] = h
                continue
            if acceptable(e, near_kink):
                if controls[CONTROL] != TOLERANCE:
                    break
                grow = grown(controls, loop_state, h, e)
                if failure == NEWTON_STUCK:
                    grow = min(grow, 1.0)
                shortened = last or h == due - loop_state[T] or h < full_h
                if (not shortened or grow < 1.0) and not retains_length(controls, grow):
                    loop_state[STEP] = h * grow
                loop_state[ERROR_OLD] = e
                if controls[WATCH] != 0.0 and watch(controls, loop_state, h, e, rate):
                    loop_state[SWITCH_COUNT], controls[BUDGET] = (
                        -1.0,
                        1.0,
                    )  # return after this step, to change the method
                break
            loop_state[REJECTIONS] += 1.0
            h = full_h = h * reduced(controls, e)
            loop_state[STEP] = h
        if not event_known:
            t_new, changed = (
                end_of(controls, loop_state, h, last, due),
                add_stored(h, b, k, y[now], y[new], stored, carry),
            )
        update_carry(h, b, k, y[now], stored, carry)
        loop_state[UNBOOKED] = h
        t_old = loop_state[T]
        is_part = loop_state[SPLIT_REMAINDER] > h
        loop_state[SPLIT_REMAINDER] = loop_state[SPLIT_REMAINDER] - h if is_part else 0.0
        loop_state[N_MARK] += 0.0 if is_part else 1.0
        loop_state[T] = t_new
        loop_state[LAST] = loop_state[T] - t_old
        loop_state[STEPS] += 1.0
        controls[BUDGET] -= 1.0
        if (
            largest.size > 0
            and loop_state[STEPS] % GROWTH_CHECK_STEPS == 0.0
            and exceeded(join, handle, row_blocks, sums, y[new], largest)
        ):
            controls[BUDGET] = GROWTH_FOUND
        if next_due(controls, loop_state, times) <= loop_state[T]:
            known = controls[KIND] == NEWTON_SOLVED and work[KNOWN_STEPS] > 0.0
            for m in range(row_blocks.shape[0]):
                begin, end = row_blocks[m, BEGIN], row_blocks[m, STOP]
                if start_slope.size > 0:
                    start_slope_defect(begin, end, start_slope, k, vectors[s - 1], known, f_old)
                elif use_stage_slope and known:
                    copy(vectors[s - 1, begin:end], f_old[begin:end])
                else:
                    copy(k[0, begin:end], f_old[begin:end])
        reuse = controls[FSAL] == 1.0 and controls[CONTROL] == TOLERANCE and not last and not changed
        progress[OLD], progress[NOW], progress[HAS_LAST_STEP], progress[PHASE] = now, new, 1, FUSED if fused else FRESH
    return DONE


@njit
def run_steps_at(
    calls, handle, coefficients, structure, row_blocks, sums, dense, controls, loop_state, times, progress, y, k, f_old,
    ledger_rates, ledger_offset, ledger, scale, out, out_row, values, g, g_new, armed, stored, carry, y_out, rows,
    bounded_states, bounds, work, vectors, factors, complex_factors, spare, spare_ledger_rates, spare_flat,
    spare_complex, largest,
):  # fmt: skip
    """Call `run_steps` with the functions whose addresses are in `calls`, in the order of its arguments.

    Other arguments and result as for `run_steps`.
    """
    return run_steps(
        attempt_at(calls[0]), fused_step_at(calls[1]), observe_at(calls[2]), record_at(calls[3]), events_at(calls[4]),
        rhs_at(calls[5]), factor_at(calls[6]), solve_at(calls[7]), factor_complex_at(calls[8]),
        solve_complex_at(calls[9]), join_at(calls[10]), handle, coefficients, structure, row_blocks, sums, dense,
        controls, loop_state, times, progress, y, k, f_old, ledger_rates, ledger_offset, ledger, scale, out, out_row,
        values, g, g_new, armed, stored, carry, y_out, rows, bounded_states, bounds, work, vectors, factors,
        complex_factors, spare, spare_ledger_rates, spare_flat, spare_complex, largest,
    )  # fmt: skip


@njit
def attempt_with(
    calls, handle, coefficients, structure, row_blocks, sums, t, h, y, now, new, k, ledger_rates, ledger_offset, out,
    scale, controls, loop_state, work, vectors, factors, complex_factors,
):  # fmt: skip
    """Take one step with the functions whose addresses are in `calls`: step of the method, rhs, linear algebra, join.

    The other arguments and the result are as for `erk.attempt`, `irk.attempt` and the steps of other methods.
    """
    attempt = attempt_at(calls[0])
    return attempt(
        rhs_at(calls[1]), factor_at(calls[2]), solve_at(calls[3]), factor_complex_at(calls[4]),
        solve_complex_at(calls[5]), join_at(calls[6]), handle, coefficients, structure, row_blocks, sums, t, h, y, now,
        new, k, ledger_rates, ledger_offset, out, scale, controls, loop_state, work, vectors, factors, complex_factors,
    )  # fmt: skip


def compiled():
    """Time loop `run_steps`, compiled for calls from Python.

    Its arguments are the result of `addresses` for all functions, then the other arguments of `run_steps`.
    """
    if not COMPILING:
        return lambda functions, *others: run_steps(*functions, *others)
    return compiled_as(run_steps_at, "hhvhsvwvvvhwwvwivvvvvvvvhvvwhwvwvzwwvzv")


def compiled_attempt():
    """Single step `attempt_with`, compiled for calls from Python.

    Its arguments are the result of `addresses` for all functions, then the other arguments of `attempt_with`.
    """
    if not COMPILING:
        return lambda functions, *others: functions[0](*functions[1:], *others)
    return compiled_as(attempt_with, "h" + ATTEMPT)
