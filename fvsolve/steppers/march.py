"""The time loop: steps of any method with dense output, step control and event location. Knows no physics.

One compiled loop serves every method (a step is a function of declared type, Butcher arrays are data) and every
model (functions of declared type).
"""

from math import isfinite

from fvsolve.jit import COMPILING, njit
from fvsolve.kernels.sums import BAD, LOOK, MODE, OFF
from fvsolve.steppers.coefficients import bend_of, error_of, row_of, weights_of
from fvsolve.steppers.control import (
    APPROACH,
    HUGE,
    approaches,
    arriving_step,
    closing_step,
    end_of,
    grown,
    kept,
    landing,
    next_step,
    reduced,
    shortest,
    too_short,
    watch,
)
from fvsolve.steppers.events import arm, fallen, locate, turned
from fvsolve.steppers.ledger import book, book_error
from fvsolve.steppers.rows import emit, next_due, row_due
from fvsolve.steppers.signatures import ATTEMPT, compiled_as
from fvsolve.steppers.slots import (
    AMENDED,
    ARRIVED,
    ARRIVES,
    BAD_STATUS,
    BAD_VALUE,
    BEHIND,
    BENT,
    BUDGET,
    CALLS,
    CASES,
    CHECKED,
    CHUNK,
    CLOSING,
    CONTROL,
    DONE,
    EMIT,
    END,
    ERROR_OLD,
    EXCEEDED,
    EXPLICIT,
    FRESH,
    FSAL,
    HAS,
    KIND,
    KNOWN,
    LAST,
    LEAPS,
    LEAPT,
    LEFT,
    N_MARK,
    NEWTON_FAILED,
    NEWTON_FAILURES,
    NEWTON_SOLVED,
    NEWTON_STUCK,
    NOT_FINITE,
    NOW,
    OLD,
    PARTED,
    PHASE,
    RATE,
    READY,
    REJECTIONS,
    SEEN,
    SIZE,
    STATUS,
    STEP,
    STEPS,
    STOP_HERE,
    STOPPED,
    SWITCHED,
    T_MARK,
    TINY_STEP,
    TOLERANCE,
    UNBOOKED,
    WATCH,
    WHERE,
    T,
)
from fvsolve.steppers.step import (
    BEGIN,
    STOP,
    add_stored,
    all_finite,
    bend_at_start,
    copy,
    exceeded,
    keep_carry,
)

if COMPILING:
    from fvsolve.steppers.signatures import (
        attempt_at,
        events_at,
        factor_at,
        factor_complex_at,
        join_at,
        leap_at,
        observe_at,
        record_at,
        rhs_at,
        solve_at,
        solve_complex_at,
    )


@njit(forceinline=True)
def may_leap(controls, loop_state, times, h):
    """Whether a step of h ends before the segment does, and before anything is due to be written."""
    if (
        controls[LEAPS] == 0.0
        or too_short(controls, loop_state, h)
        or h >= (controls[END] - loop_state[T]) * (1.0 - 1e-9)
    ):
        return False
    return next_due(controls, loop_state, times) > loop_state[T_MARK] + (loop_state[N_MARK] + 1.0) * h


@njit(forceinline=True)
def judged(h, e, coefficients, k, stored, ledger_rates, controls, ledger):
    """The error of a step in units of the tolerance: the greater of its states' and of its amounts'."""
    if controls[CONTROL] != TOLERANCE:
        return e
    return max(e, book_error(h, error_of(coefficients, k.shape[0]), k, stored, ledger_rates, controls[SIZE], ledger))


@njit(forceinline=True)
def bearable(e, passing):
    """Whether a step of error e is taken; `passing` on to a kink, before which round-off rules, any but no number."""
    return e <= 1.0 or (e == e and passing)


@njit
def march(
    attempt, leap, observe, record, events, rhs, factor, solve, factor_complex, solve_complex, join, handle,
    coefficients, structure, row_blocks, sums, dense, controls, loop_state, times, progress, y, k, f_old, ledger_rates,
    ledger_offset, ledger, scale, out, out_row, values, g, g_new, armed, stored, carry, y_out, rows, within_at,
    within_by, work, vectors, factors, complex_factors, spare, spare_ledger_rates, spare_flat, spare_complex, largest,
):  # fmt: skip
    """Step from memory[T] to orders[END]; returns why it came back, to be called again with the same arrays.

    rhs(t, y, dydt, out, handle) with an empty dydt computes `out` alone, which is all that a row wants;
    leap(t, h, y, y_new, out, handle, values), where orders[LEAPS] allows it, is a whole step to t of a method of one
    stage, with the `out` and the record of its end: taken wherever no row is due;
    join(sums, spans, handle) : fills in what other bands of the state, which step it beside this one, have;
    spans, sums : the states of this band, and room for a number of each row of all, see `step`;
    y : float64[4, n], the present, the last and the next state and a stage; k : float64[s, n];
    ledger : float64[5 m], sums of out[where:] (`ledger.py`); stored : int64[q],
    states that are summed with a carry too; rows : float64[cap, 1 + probes]; times : of rows, where given one by one;
    within_at, within_by : what rows are held to, see `rows.keep_within`; work, vectors, store, store_complex : what an
    implicit step keeps; spare, spare_supply, spare_flat, spare_complex : room for `rows.step_apart`;
    largest : float64[n], what no state may exceed, looked at every CHECKED steps, or empty.
    """
    s, reuse, met, t_new = k.shape[0], False, False, 0.0  # met: g_new is of the end of the step behind
    formed = controls[KIND] == EXPLICIT and structure.size > 0
    b, bend = weights_of(coefficients, s), bend_of(coefficients, s)
    steep = controls[KIND] == NEWTON_SOLVED and dense.shape[0] == 0  # slopes at ends: f magnifies what Newton left,
    for j in range(s):  # the last stage does not, where it is the end
        steep = steep and row_of(coefficients, s, s - 1)[j] == b[j]
    for _ in range(1 << 62):
        now, old = progress[NOW], progress[OLD]
        new = 3 - now - old
        if progress[PHASE] == FRESH:
            if met:
                copy(g_new, g)
            elif g.size > 0:
                events(loop_state[T], y[now], handle, g)
            met = False
            if turned(g, armed):
                progress[BENT] = progress[BEHIND]  # what is due before its end goes by the rule of the step behind
                if progress[BENT] == 0:
                    arm(g, armed)
                    return SWITCHED
            if reuse:
                for m in range(row_blocks.shape[0]):
                    begin, end = row_blocks[m, BEGIN], row_blocks[m, STOP]
                    copy(k[s - 1, begin:end], k[0, begin:end])
            else:
                if formed:
                    structure[MODE], structure[BAD] = LOOK, 0
                rhs(loop_state[T], y[now], k[0], out, handle)
                if formed:
                    structure[MODE] = OFF
                loop_state[CALLS] += 1.0
            looked, reuse = formed and not reuse, False
            progress[PHASE] = EMIT
            record(loop_state[T], y[now], out, handle, values)
            if out[STATUS] == AMENDED:
                rhs(loop_state[T], y[now], k[0], out, handle)
                loop_state[CALLS] += 1.0
                record(loop_state[T], y[now], out, handle, values)
            if not all_finite(join, handle, row_blocks, sums, y[now], structure, looked):
                out[STATUS] = NOT_FINITE
        if progress[PHASE] <= EMIT:
            if out[STATUS] == NOT_FINITE or not isfinite(out[RATE]):
                return BAD_VALUE
            if out[STATUS] != 0.0:
                return BAD_STATUS
            if loop_state[UNBOOKED] > 0.0:
                known = steep and work[KNOWN] > 0.0
                book(loop_state[UNBOOKED], b, ledger_rates, dense, steep, known, out[ledger_offset:], ledger)
                loop_state[UNBOOKED] = 0.0
        if progress[PHASE] == EMIT:
            if progress[BEHIND] == 1 and next_due(controls, loop_state, times) <= loop_state[T]:
                f_end = k[s - 1] if steep else k[0]
                why = emit(
                    attempt, rhs, observe, factor, solve, factor_complex, solve_complex, join, handle, coefficients,
                    structure, row_blocks, sums, controls, loop_state, times, progress,
                    loop_state[T] - loop_state[LAST], y, now, old, f_old, f_end, k, ledger_offset, dense, bend, scale,
                    out_row, y_out, rows, within_at, within_by, work, spare, spare_ledger_rates, spare_flat,
                    spare_complex,
                )  # fmt: skip
                if why != DONE:
                    return why
            if progress[BENT] == 1:  # now the other rule holds, and nothing learnt under the old one
                arm(g, armed)
                progress[BENT], progress[PHASE] = 0, FRESH
                if controls[CONTROL] == TOLERANCE:
                    loop_state[STEP] = 0.0
                if controls[KIND] != EXPLICIT:
                    work[HAS], work[SEEN] = 0.0, -1.0
                return SWITCHED
            if (
                out[ARRIVES] == loop_state[T]
            ):  # a jump is here: what is noted next lies behind it, and events act before
                out[STATUS] = ARRIVED
                record(loop_state[T], y[now], out, handle, values)
                progress[BEHIND], progress[PHASE] = 0, FRESH
                if controls[KIND] != EXPLICIT:
                    work[HAS], work[SEEN] = 0.0, -1.0
                continue
            progress[PHASE] = READY
        for m in range(ledger_rates.shape[1]):
            ledger_rates[0, m] = out[ledger_offset + m]
        if too_short(controls, loop_state, controls[END] - loop_state[T]):  # what is left of the segment is rounding
            loop_state[T] = controls[END]
            return DONE
        if out[WHERE] == STOP_HERE:
            return STOPPED
        if controls[BUDGET] <= 0.0:
            return CHUNK
        h = loop_state[LEFT] if loop_state[LEFT] > 0.0 else next_step(controls, loop_state, out[RATE], k, scale)
        if controls[CONTROL] != TOLERANCE:
            h = closing_step(loop_state, out[CLOSING], h, shortest(controls, loop_state))
        whole, h = h, arriving_step(controls, loop_state, out[ARRIVES], h)
        leaping, last = may_leap(controls, loop_state, times, h), False
        if leaping:
            loop_state[CALLS] += 1.0
            leap(loop_state[T_MARK] + (loop_state[N_MARK] + 1.0) * h, h, y[now], y[new], out, handle, values)
        elif progress[PHASE] == LEAPT:  # now the rates are wanted too
            progress[PHASE] = FRESH
            loop_state[CALLS] -= 1.0
            continue
        failed, rate = TINY_STEP, out[RATE]
        due = HUGE if leaping else landing(controls, loop_state, row_due(controls, loop_state, times), h)
        h = min(h, due - loop_state[T])
        while not leaping:
            rest = controls[END] - loop_state[T]
            last = h >= rest * (1.0 - 1e-9)
            if last and approaches(controls, loop_state, rest):
                h, last = APPROACH * rest, False
            elif last:
                h = rest
            if too_short(controls, loop_state, h) and (not last or failed == NEWTON_STUCK):
                return failed
            e = attempt(
                rhs, factor, solve, factor_complex, solve_complex, join, handle, coefficients, structure, row_blocks,
                sums, loop_state[T], h, y, now, new, k, ledger_rates, ledger_offset, out, scale, controls, loop_state,
                work, vectors, factors, complex_factors,
            )  # fmt: skip
            passing = rest <= 1e3 * shortest(controls, loop_state)
            if e != NEWTON_FAILED:
                e = judged(h, e, coefficients, k, stored, ledger_rates, controls, ledger)
                if bearable(e, passing):
                    t_new, met = end_of(controls, loop_state, h, last, due), True
                    rounded = add_stored(h, b, k, y[now], y[new], stored, carry)
                    if g.size > 0:
                        events(t_new, y[new], handle, g_new)
                    if fallen(g, g_new):
                        met = False
                        length, e = locate(
                            attempt, rhs, factor, solve, factor_complex, solve_complex, events, join, handle,
                            coefficients, structure, row_blocks, sums, h, y, now, new, k, ledger_rates, ledger_offset,
                            out, scale, controls, loop_state, work, vectors, factors, complex_factors, g, g_new, e,
                        )  # fmt: skip
                        if e != NEWTON_FAILED:
                            h, loop_state[STEP], loop_state[LEFT] = length, 0.0, 0.0
                            last = last and loop_state[T] + h >= controls[END]
                            e = judged(h, e, coefficients, k, stored, ledger_rates, controls, ledger)
            if e == NEWTON_FAILED:
                failed = NEWTON_STUCK
                loop_state[NEWTON_FAILURES] += 1.0
                if controls[CONTROL] != TOLERANCE and loop_state[LEFT] == 0.0:  # in parts that end where it would have
                    loop_state[LEFT] = h
                    loop_state[PARTED] += 1.0
                h = whole = 0.25 * h
                if controls[CONTROL] == TOLERANCE:
                    loop_state[STEP] = h
                continue
            if bearable(e, passing):
                if controls[CONTROL] != TOLERANCE:
                    break
                grow = grown(controls, loop_state, h, e)
                if failed == NEWTON_STUCK:
                    grow = min(grow, 1.0)
                cut = last or h == due - loop_state[T] or h < whole
                if (not cut or grow < 1.0) and not kept(controls, grow):
                    loop_state[STEP] = h * grow
                loop_state[ERROR_OLD] = e
                if controls[WATCH] != 0.0 and watch(controls, loop_state, h, e, rate):
                    loop_state[CASES], controls[BUDGET] = -1.0, 1.0  # come back after this step, for another kind
                break
            loop_state[REJECTIONS] += 1.0
            h = whole = h * reduced(controls, e)
            loop_state[STEP] = h
        if not met:
            t_new, rounded = (
                end_of(controls, loop_state, h, last, due),
                add_stored(h, b, k, y[now], y[new], stored, carry),
            )
        keep_carry(h, b, k, y[now], stored, carry)
        loop_state[UNBOOKED] = h
        t_old = loop_state[T]
        part = loop_state[LEFT] > h
        loop_state[LEFT] = loop_state[LEFT] - h if part else 0.0
        loop_state[N_MARK] += 0.0 if part else 1.0
        loop_state[T] = t_new
        loop_state[LAST] = loop_state[T] - t_old
        loop_state[STEPS] += 1.0
        controls[BUDGET] -= 1.0
        if (
            largest.size > 0
            and loop_state[STEPS] % CHECKED == 0.0
            and exceeded(join, handle, row_blocks, sums, y[new], largest)
        ):
            controls[BUDGET] = EXCEEDED
        if next_due(controls, loop_state, times) <= loop_state[T]:
            known = controls[KIND] == NEWTON_SOLVED and work[KNOWN] > 0.0
            for m in range(row_blocks.shape[0]):
                begin, end = row_blocks[m, BEGIN], row_blocks[m, STOP]
                if bend.size > 0:
                    bend_at_start(begin, end, bend, k, vectors[s - 1], known, f_old)
                elif steep and known:
                    copy(vectors[s - 1, begin:end], f_old[begin:end])
                else:
                    copy(k[0, begin:end], f_old[begin:end])
        reuse = controls[FSAL] == 1.0 and controls[CONTROL] == TOLERANCE and not last and not rounded
        progress[OLD], progress[NOW], progress[BEHIND], progress[PHASE] = now, new, 1, LEAPT if leaping else FRESH
    return DONE


@njit
def march_at(
    calls, handle, coefficients, structure, row_blocks, sums, dense, controls, loop_state, times, progress, y, k, f_old,
    ledger_rates, ledger_offset, ledger, scale, out, out_row, values, g, g_new, armed, stored, carry, y_out, rows,
    within_at, within_by, work, vectors, factors, complex_factors, spare, spare_ledger_rates, spare_flat, spare_complex,
    largest,
):  # fmt: skip
    """`march` with the functions at these addresses, in its order."""
    return march(
        attempt_at(calls[0]), leap_at(calls[1]), observe_at(calls[2]), record_at(calls[3]), events_at(calls[4]),
        rhs_at(calls[5]), factor_at(calls[6]), solve_at(calls[7]), factor_complex_at(calls[8]),
        solve_complex_at(calls[9]), join_at(calls[10]), handle, coefficients, structure, row_blocks, sums, dense,
        controls, loop_state, times, progress, y, k, f_old, ledger_rates, ledger_offset, ledger, scale, out, out_row,
        values, g, g_new, armed, stored, carry, y_out, rows, within_at, within_by, work, vectors, factors,
        complex_factors, spare, spare_ledger_rates, spare_flat, spare_complex, largest,
    )  # fmt: skip


@njit
def attempt_with(
    calls, handle, coefficients, structure, row_blocks, sums, t, h, y, now, new, k, ledger_rates, ledger_offset, out,
    scale, controls, loop_state, work, vectors, factors, complex_factors,
):  # fmt: skip
    """One step with the functions at these addresses: the method's, rhs, linear algebra, the joint."""
    attempt = attempt_at(calls[0])
    return attempt(
        rhs_at(calls[1]), factor_at(calls[2]), solve_at(calls[3]), factor_complex_at(calls[4]),
        solve_complex_at(calls[5]), join_at(calls[6]), handle, coefficients, structure, row_blocks, sums, t, h, y, now,
        new, k, ledger_rates, ledger_offset, out, scale, controls, loop_state, work, vectors, factors, complex_factors,
    )  # fmt: skip


def compiled():
    """The loop as Python calls it: its functions as `addresses` gives them, then all else that `march` takes."""
    if not COMPILING:
        return lambda functions, *others: march(*functions, *others)
    return compiled_as(march_at, "hhvhsvwvvvhwwvwivvvvvvvvhvvwhwvwvzwwvzv")


def compiled_attempt():
    """One step as Python calls it, likewise."""
    if not COMPILING:
        return lambda functions, *others: functions[0](*functions[1:], *others)
    return compiled_as(attempt_with, "h" + ATTEMPT)
