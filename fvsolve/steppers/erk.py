"""Explicit Runge-Kutta steps with dense output, step control and event location. Knows no physics.

One compiled loop serves every method (Butcher arrays are data) and every model (functions of declared type).
"""

import functools
from math import isfinite

from fvsolve.jit import njit
from fvsolve.steppers.events import arm, fallen, locate
from fvsolve.steppers.step import add_stored, all_finite, book, copy, error_norm, first_step, interpolate, stages

# What the loop remembers, in one flat array of floats that a restart stores.
T, STEP, T_MARK, N_MARK, ERROR_OLD, NEXT_OUTPUT, NEXT_FIELD, STEPS, REJECTIONS, CALLS, LAST, UNBOOKED = range(12)
MEMORY = 12
# What a call is told.
START, END, EVERY, FIELD_EVERY, CONTROL, SIZE, STEP_MAX, BUDGET, FIELD_COUNT, STOP_AT, LEAPS = range(11)
ORDERS = 11
COURANT, FIXED_STEP, TOLERANCE = 0, 1, 2  # values of CONTROL
# Why a call came back.
DONE, CHUNK, ROWS_FULL, FIELD, BAD_VALUE, TINY_STEP, BAD_STATUS, STOPPED = range(8)
# What passes between calls while rows are still to be written: phase, whether a step lies behind, buffers.
PHASE, BEHIND, NOW, OLD, ROWS = range(5)
FRESH, LEAPT, EMIT, READY = range(4)

RATE, STATUS, WHERE = 0, 1, 2  # the entries of `out` that the loop reads
NOT_FINITE = 3  # a value of out[STATUS]
STOP_HERE = -2.0  # in out[WHERE]: the record asks for an end


@functools.cache
def function_types():
    """Numba types of (rhs, leap, observe, record, events): declared, so that the loop is cached."""
    from numba import types

    f, v, handle = types.float64, types.float64[::1], types.int64[::1]
    rhs = types.FunctionType(types.void(f, v, v, v, handle))
    leap = types.FunctionType(types.void(f, f, v, v, v, handle, v))
    observe = types.FunctionType(types.void(f, v, v, handle, v))
    events = types.FunctionType(types.void(f, v, handle, v))
    return rhs, leap, observe, observe, events


@njit(forceinline=True)
def shortest(orders, memory):
    """A step that no rate shortens further: a column behind a valve that shuts gets infinitely quick [s]."""
    return 1e-13 * max(abs(memory[T]), abs(orders[END]))


@njit(forceinline=True)
def next_step(orders, memory, out_rate, k, scale, order):
    """Length of the step to try, before the end of the segment is looked at [s]."""
    if orders[CONTROL] == TOLERANCE:
        if memory[STEP] <= 0.0:
            memory[STEP] = first_step(k, scale, order, orders[SIZE], orders[END] - memory[T])
        stable = 2.0 / out_rate if out_rate > 0.0 else orders[STEP_MAX]  # error control alone would chatter there
        return min(memory[STEP], orders[STEP_MAX], max(stable, shortest(orders, memory)))
    h = orders[SIZE]
    if orders[CONTROL] == COURANT:
        h = min(orders[SIZE] / out_rate, orders[STEP_MAX]) if out_rate > 0.0 else orders[STEP_MAX]
        h = max(h, shortest(orders, memory))
    if h != memory[STEP]:
        memory[STEP], memory[T_MARK], memory[N_MARK] = h, memory[T], 0.0
    return h


@njit(forceinline=True)
def output_due(orders, memory, count_at, every, limit):
    """Time of the next row or field: START + count * every, or infinity."""
    if every <= 0.0 or memory[count_at] > limit:
        return 1e308
    return orders[START] + memory[count_at] * every


@njit(forceinline=True)
def next_due(orders, memory):
    """Time of whatever is to be written next [s]."""
    row = output_due(orders, memory, NEXT_OUTPUT, orders[EVERY], 1e300)
    return min(row, output_due(orders, memory, NEXT_FIELD, orders[FIELD_EVERY], orders[FIELD_COUNT]))


@njit(forceinline=True)
def too_short(orders, memory, h):
    """Whether a step would not move the time."""
    return not h > 4e-16 * max(abs(memory[T]), abs(orders[END]))


@njit(forceinline=True)
def may_leap(orders, memory, h):
    """Whether a step of h ends before the segment does, and before anything is due to be written."""
    if orders[LEAPS] == 0.0 or too_short(orders, memory, h) or h >= (orders[END] - memory[T]) * (1.0 - 1e-9):
        return False
    return next_due(orders, memory) > memory[T_MARK] + (memory[N_MARK] + 1.0) * h


@njit
def emit(rhs, observe, handle, orders, memory, flags, t_old, y_old, f_old, y, k, dense, out, y_out, rows):
    """Write the rows due up to now; stops early at a field, which waits in y_out, or when the rows are full."""
    t, h = memory[T], memory[T] - t_old
    while True:
        row = output_due(orders, memory, NEXT_OUTPUT, orders[EVERY], 1e300)
        field = output_due(orders, memory, NEXT_FIELD, orders[FIELD_EVERY], orders[FIELD_COUNT])
        due = min(row, field)
        if due > t or (due >= orders[STOP_AT]):
            return DONE
        if row <= due and flags[ROWS] == rows.shape[0]:
            return ROWS_FULL
        interpolate((due - t_old) / h, h, y_old, f_old, y, k[0], k, dense, y_out)
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
def run_erk(
    rhs, leap, observe, record, events, handle,
    a, b, c, error, dense, order, last_is_new,
    orders, memory, flags, y, k, f_old, supply, where, ledger, scale, out, out_row, values, g, g_new, armed,
    stored, carry, y_out, rows,
):  # fmt: skip
    """Step from memory[T] to orders[END]; returns why it came back, to be called again with the same arrays.

    rhs(t, y, dydt, out, handle) with an empty dydt computes `out` alone, which is all that a row wants;
    leap(t, h, y, y_new, out, handle, values), where orders[LEAPS] allows it, is a whole step to t of a method of one
    stage, with the `out` and the record of its end: taken wherever no row is due;
    y : float64[4, n], the present, the last and the next state and a stage; k : float64[s, n];
    ledger : float64[2 m], sums of out[where:] with the step's own weights, and their carries; stored : int64[q],
    states that are summed with a carry too; rows : float64[cap, 1 + probes].
    """
    s, reuse = b.size, False
    for _ in range(1 << 62):
        now, old = flags[NOW], flags[OLD]
        new = 3 - now - old
        if flags[PHASE] == FRESH:
            events(memory[T], y[now], handle, g)
            if arm(g, armed):
                reuse = False
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
            if flags[BEHIND] == 1 and next_due(orders, memory) <= memory[T]:
                why = emit(
                    rhs, observe, handle, orders, memory, flags, memory[T] - memory[LAST], y[old], f_old, y[now],
                    k, dense, out_row, y_out, rows,
                )  # fmt: skip
                if why != DONE:
                    return why
            flags[PHASE] = READY
        if memory[T] >= orders[END]:
            return DONE
        if out[WHERE] == STOP_HERE:
            return STOPPED
        if orders[BUDGET] <= 0.0:
            return CHUNK
        h = next_step(orders, memory, out[RATE], k, scale, order)
        leaping, last = may_leap(orders, memory, h), False
        if leaping:
            memory[CALLS] += 1.0
            leap(memory[T_MARK] + (memory[N_MARK] + 1.0) * h, h, y[now], y[new], out, handle, values)
        elif flags[PHASE] == LEAPT:  # now the rates are wanted too
            flags[PHASE] = FRESH
            memory[CALLS] -= 1.0
            continue
        while not leaping:
            rest = orders[END] - memory[T]
            last = h >= rest * (1.0 - 1e-9)
            if last:
                h = rest
            if too_short(orders, memory, h) and not last:
                return TINY_STEP
            stages(rhs, handle, a, b, c, last_is_new, memory[T], h, y[now], k, supply, where, out, y[3], y[new])
            memory[CALLS] += s - 1.0
            if orders[CONTROL] != TOLERANCE:
                break
            e = error_norm(h, error, k, y[now], y[new], scale, orders[SIZE])
            if e <= 1.0 or (e == e and rest <= 1e3 * shortest(orders, memory)):  # round-off rules before a kink
                grow = 0.9 * max(e, 1e-10) ** (-0.7 / order) * max(memory[ERROR_OLD], 1e-4) ** (0.4 / order)
                if not last or grow < 1.0:
                    memory[STEP] = h * min(5.0, max(0.2, grow))
                memory[ERROR_OLD] = e
                break
            memory[REJECTIONS] += 1.0
            h *= max(0.1, 0.9 * e ** (-1.0 / order)) if e == e else 0.1
            memory[STEP] = h
        events(memory[T] + h, y[new], handle, g_new)
        if fallen(g, g_new):
            h = locate(
                rhs, events, handle, a, b, c, last_is_new, memory[T], h, y[now], k, supply, where, out, y[3], y[new],
                g, g_new,
            )  # fmt: skip
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
        if next_due(orders, memory) <= memory[T]:
            copy(k[0], f_old)
        reuse = last_is_new and orders[CONTROL] == TOLERANCE and not last and not rounded
        flags[OLD], flags[NOW], flags[BEHIND], flags[PHASE] = now, new, 1, LEAPT if leaping else FRESH
    return DONE


@functools.cache
def compiled():
    """The loop compiled against its declared types (cached on disk), or plain where JIT is off."""
    if not hasattr(run_erk, "compile"):
        return run_erk
    from numba import types

    i, v, w = types.int64, types.float64[::1], types.float64[:, ::1]
    run_erk.compile(
        (*function_types(), types.int64[::1], w, v, v, v, w, i, types.boolean, v, v, types.int64[::1], w, w, v, w,
         i, v, v, v, v, v, v, v, v, types.int64[::1], v, v, w)
    )  # fmt: skip
    run_erk.disable_compile()
    return run_erk
