"""The time loop: steps of any method with dense output, step control and event location. Knows no physics.

One compiled loop serves every method (a step is a function of declared type, Butcher arrays are data) and every
model (functions of declared type).
"""

import functools
from math import isfinite

from fvsolve.jit import argument, njit
from fvsolve.steppers.coefficients import row_of, weights_of
from fvsolve.steppers.control import grown, kept, next_step, reduced, shortest, too_short, watch
from fvsolve.steppers.events import arm, fallen, locate, turned
from fvsolve.steppers.orders import (
    BAD_STATUS,
    BAD_VALUE,
    BEHIND,
    BENT,
    BUDGET,
    CALLS,
    CASES,
    CHUNK,
    CONTROL,
    DONE,
    EMIT,
    END,
    ERROR_OLD,
    EVERY,
    EXPLICIT,
    FIELD,
    FIELD_COUNT,
    FIELD_EVERY,
    FRESH,
    FSAL,
    HAS,
    KIND,
    KNOWN,
    LAST,
    LEAPS,
    LEAPT,
    N_MARK,
    NEWTON_FAILED,
    NEWTON_FAILURES,
    NEWTON_SOLVED,
    NEWTON_STUCK,
    NEXT_FIELD,
    NEXT_OUTPUT,
    NOT_FINITE,
    NOW,
    OLD,
    PHASE,
    RATE,
    READY,
    REJECTIONS,
    ROWS,
    ROWS_FULL,
    SEEN,
    START,
    STATUS,
    STEP,
    STEPS,
    STOP_AT,
    STOP_HERE,
    STOPPED,
    T_MARK,
    TINY_STEP,
    TOLERANCE,
    UNBOOKED,
    WATCH,
    WHERE,
    T,
)
from fvsolve.steppers.step import add_stored, all_finite, book, copy, interpolate


@functools.cache
def function_types():
    """Numba types of (attempt, leap, observe, record, events, rhs, and linear algebra, real and complex).

    Declared, so that the loop is compiled once and cached.
    """
    from numba import types

    f, c, i = types.float64, types.complex128, types.int64
    v, z, handle = types.float64[::1], types.complex128[::1], types.int64[::1]
    rhs = types.FunctionType(types.void(f, v, v, v, handle))
    algebra = (
        types.FunctionType(i(handle, v, f, v)), types.FunctionType(types.void(handle, v, v)),
        types.FunctionType(i(handle, v, c, z)), types.FunctionType(types.void(handle, z, z)),
    )  # fmt: skip
    attempt = types.FunctionType(f(*attempt_arguments(rhs, *algebra)))
    leap = types.FunctionType(types.void(f, f, v, v, v, handle, v))
    observe = types.FunctionType(types.void(f, v, v, handle, v))
    events = types.FunctionType(types.void(f, v, handle, v))
    return attempt, leap, observe, observe, events, rhs, *algebra


def attempt_arguments(*functions):
    """Numba types of what a step takes, after rhs and linear algebra; see `erk.attempt`."""
    from numba import types

    f, i, v, w = types.float64, types.int64, types.float64[::1], types.float64[:, ::1]
    ints = types.int64[::1]
    return (*functions, ints, v, ints, f, f, w, i, i, w, w, i, v, v, v, v, v, w, v, types.complex128[::1])


def no_factor(shape, jacobian, shift, store):
    """In place of a factorisation, where nothing is solved."""
    return 0


def no_solve(shape, store, x):
    """In place of a solution, where nothing is solved."""


@functools.cache
def no_algebra():
    """(factor, solve, factor_complex, solve_complex) for steps that solve nothing."""
    types = [kind.signature.args for kind in function_types()[6:]]
    return tuple(compiled_as(njit(f), kinds) for f, kinds in zip((no_factor, no_solve) * 2, types, strict=True))


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


@njit(forceinline=True)
def may_leap(orders, memory, times, h):
    """Whether a step of h ends before the segment does, and before anything is due to be written."""
    if orders[LEAPS] == 0.0 or too_short(orders, memory, h) or h >= (orders[END] - memory[T]) * (1.0 - 1e-9):
        return False
    return next_due(orders, memory, times) > memory[T_MARK] + (memory[N_MARK] + 1.0) * h


@njit
def emit(
    rhs, observe, handle, orders, memory, times, flags, t_old, y_old, f_old, y, f, k, dense, out, y_out, rows,
):  # fmt: skip
    """Write the rows due up to now; stops early at a field, which waits in y_out, or when the rows are full."""
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
        rhs(due, y_out, y_out[:0], out, handle)
        if row <= due:
            rows[flags[ROWS], 0] = due
            observe(due, y_out, out, handle, rows[flags[ROWS], 1:])
            flags[ROWS] += 1
            memory[NEXT_OUTPUT] += 1.0
        if field <= due:
            memory[NEXT_FIELD] += 1.0
            return FIELD


@njit
def march(
    attempt, leap, observe, record, events, rhs, factor, solve, factor_complex, solve_complex, handle,
    coefficients, shape, dense, orders, memory, times, flags, y, k, f_old, supply, where, ledger, scale, out, out_row,
    values, g, g_new, armed, stored, carry, y_out, rows, work, vectors, store, store_complex,
):  # fmt: skip
    """Step from memory[T] to orders[END]; returns why it came back, to be called again with the same arrays.

    rhs(t, y, dydt, out, handle) with an empty dydt computes `out` alone, which is all that a row wants;
    leap(t, h, y, y_new, out, handle, values), where orders[LEAPS] allows it, is a whole step to t of a method of one
    stage, with the `out` and the record of its end: taken wherever no row is due;
    y : float64[4, n], the present, the last and the next state and a stage; k : float64[s, n];
    ledger : float64[2 m], sums of out[where:] with the step's own weights, and their carries; stored : int64[q],
    states that are summed with a carry too; rows : float64[cap, 1 + probes]; times : of rows, where given one by one;
    work, vectors, store, store_complex : what an implicit step keeps.
    """
    s, reuse = k.shape[0], False
    b = weights_of(coefficients, s)
    steep = orders[KIND] == NEWTON_SOLVED and dense.shape[0] == 0  # slopes at ends: f magnifies what Newton left,
    for j in range(s):  # the last stage does not, where it is the end
        steep = steep and row_of(coefficients, s, s - 1)[j] == b[j]
    for _ in range(1 << 62):
        now, old = flags[NOW], flags[OLD]
        new = 3 - now - old
        if flags[PHASE] == FRESH:
            events(memory[T], y[now], handle, g)
            if turned(g, armed):
                flags[BENT] = flags[BEHIND]  # what is due before its end goes by the rule of the step behind
                if flags[BENT] == 0:
                    arm(g, armed)
            if reuse:
                copy(k[s - 1], k[0])
            else:
                rhs(memory[T], y[now], k[0], out, handle)
                memory[CALLS] += 1.0
            reuse = False
            flags[PHASE] = EMIT
            record(memory[T], y[now], out, handle, values)
            if not all_finite(y[now]):
                out[STATUS] = NOT_FINITE
        if flags[PHASE] <= EMIT:
            if out[STATUS] == NOT_FINITE or not isfinite(out[RATE]):
                return BAD_VALUE
            if out[STATUS] != 0.0:
                return BAD_STATUS
            if memory[UNBOOKED] > 0.0:
                book(memory[UNBOOKED], b, supply, ledger)
                memory[UNBOOKED] = 0.0
            for m in range(supply.shape[1]):
                supply[0, m] = out[where + m]
        if flags[PHASE] == EMIT:
            if flags[BEHIND] == 1 and next_due(orders, memory, times) <= memory[T]:
                why = emit(
                    rhs, observe, handle, orders, memory, times, flags, memory[T] - memory[LAST], y[old], f_old,
                    y[now], k[s - 1] if steep else k[0], k, dense, out_row, y_out, rows,
                )  # fmt: skip
                if why != DONE:
                    return why
            if flags[BENT] == 1:  # now the other rule holds, and nothing learnt under the old one
                arm(g, armed)
                flags[BENT], flags[PHASE] = 0, FRESH
                if orders[CONTROL] == TOLERANCE:
                    memory[STEP] = 0.0
                if orders[KIND] != EXPLICIT:
                    work[HAS], work[SEEN] = 0.0, -1.0
                continue
            flags[PHASE] = READY
        if memory[T] >= orders[END]:
            return DONE
        if out[WHERE] == STOP_HERE:
            return STOPPED
        if orders[BUDGET] <= 0.0:
            return CHUNK
        h = next_step(orders, memory, out[RATE], k, scale)
        leaping, last = may_leap(orders, memory, times, h), False
        if leaping:
            memory[CALLS] += 1.0
            leap(memory[T_MARK] + (memory[N_MARK] + 1.0) * h, h, y[now], y[new], out, handle, values)
        elif flags[PHASE] == LEAPT:  # now the rates are wanted too
            flags[PHASE] = FRESH
            memory[CALLS] -= 1.0
            continue
        failed, rate = TINY_STEP, out[RATE]
        while not leaping:
            rest = orders[END] - memory[T]
            last = h >= rest * (1.0 - 1e-9)
            if last:
                h = rest
            if too_short(orders, memory, h) and (not last or failed == NEWTON_STUCK):
                return failed
            e = attempt(
                rhs, factor, solve, factor_complex, solve_complex, handle, coefficients, shape, memory[T], h, y, now,
                new, k, supply, where, out, scale, orders, memory, work, vectors, store, store_complex,
            )  # fmt: skip
            if e == NEWTON_FAILED:
                failed = NEWTON_STUCK
                memory[NEWTON_FAILURES] += 1.0
                h *= 0.25
                memory[STEP] = h if orders[CONTROL] == TOLERANCE else 0.0
                continue
            if orders[CONTROL] != TOLERANCE:
                break
            if e <= 1.0 or (e == e and rest <= 1e3 * shortest(orders, memory)):  # round-off rules before a kink
                grow = grown(orders, memory, h, e)
                if failed == NEWTON_STUCK:
                    grow = min(grow, 1.0)
                if (not last or grow < 1.0) and not kept(orders, grow):
                    memory[STEP] = h * grow
                memory[ERROR_OLD] = e
                if orders[WATCH] != 0.0 and watch(orders, memory, h, e, rate):
                    memory[CASES], orders[BUDGET] = -1.0, 1.0  # come back after this step, for another kind
                break
            memory[REJECTIONS] += 1.0
            h *= reduced(orders, e)
            memory[STEP] = h
        events(memory[T] + h, y[new], handle, g_new)
        if fallen(g, g_new):
            h = locate(
                attempt, rhs, factor, solve, factor_complex, solve_complex, events, handle, coefficients, shape, h, y,
                now, new, k, supply, where, out, scale, orders, memory, work, vectors, store, store_complex, g, g_new,
            )  # fmt: skip
            if h == NEWTON_FAILED:
                return NEWTON_STUCK
            last = last and memory[T] + h >= orders[END]
            if orders[CONTROL] != TOLERANCE:
                memory[STEP] = 0.0
        rounded = add_stored(h, b, k, y[now], y[new], stored, carry)
        memory[UNBOOKED] = h
        t_old = memory[T]
        memory[N_MARK] += 1.0
        if last:
            memory[T] = orders[END]
        elif orders[CONTROL] != TOLERANCE and h == memory[STEP]:
            memory[T] = memory[T_MARK] + memory[N_MARK] * h
        else:
            memory[T] = t_old + h
        memory[LAST] = memory[T] - t_old
        memory[STEPS] += 1.0
        orders[BUDGET] -= 1.0
        if next_due(orders, memory, times) <= memory[T]:
            copy(vectors[s - 1] if steep and work[KNOWN] == 1.0 else k[0], f_old)
        reuse = orders[FSAL] == 1.0 and orders[CONTROL] == TOLERANCE and not last and not rounded
        flags[OLD], flags[NOW], flags[BEHIND], flags[PHASE] = now, new, 1, LEAPT if leaping else FRESH
    return DONE


@functools.cache
def compiled_as(function, kinds: tuple):
    """A function compiled for arguments of these types alone, as the loop takes it."""
    if hasattr(function, "compile"):
        if not function.overloads:
            function.compile(kinds)
            function.disable_compile()
        function = argument(function)
    return function


def compiled_step(attempt):
    """A step compiled for the one signature that the loop calls."""
    return compiled_as(attempt, attempt_arguments(*function_types()[5:]))


@functools.cache
def compiled():
    """The loop compiled against its declared types (cached on disk), or plain where JIT is off."""
    if not hasattr(march, "compile"):
        return march
    from numba import types

    i, v, w, ints = types.int64, types.float64[::1], types.float64[:, ::1], types.int64[::1]
    march.compile(
        (*function_types(), ints, v, ints, w, v, v, v, ints, w, w, v, w, i, v, v, v, v, v, v, v, v, ints, v, v, w, v,
         w, v, types.complex128[::1])
    )  # fmt: skip
    march.disable_compile()
    return march
