"""Explicit Runge-Kutta steps with dense output, step control and event location. Knows no physics.

One compiled loop serves every method (Butcher arrays are data) and every model (functions of declared type).
"""

import functools
from math import isfinite, sqrt

from fvsolve.jit import njit

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

EVENT_TOLERANCE = 1e-13
HUGE = 1e100  # values beyond it count as not finite
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
def copy(source, target):
    """target = source, by a plain loop: numba's slice assignment looks for overlaps first."""
    for i in range(target.size):
        target[i] = source[i]


@njit
def combine(y, h, weights, count, k, out):
    """out = y + h sum of weights[j] k[j] over j < count; up to three terms a pass."""
    terms, c, which = 0, (0.0, 0.0, 0.0), (0, 0, 0)
    first = True
    for j in range(count):
        if weights[j] != 0.0:
            if terms == 0:
                c, which = (h * weights[j], 0.0, 0.0), (j, 0, 0)
            elif terms == 1:
                c, which = (c[0], h * weights[j], 0.0), (which[0], j, 0)
            else:
                c, which = (c[0], c[1], h * weights[j]), (which[0], which[1], j)
            terms += 1
            if terms == 3:
                add(y if first else out, c, which, terms, k, out)
                first, terms = False, 0
    if terms > 0:
        add(y if first else out, c, which, terms, k, out)
    elif first:
        copy(y, out)


@njit
def add(y, c, which, terms, k, out):
    """out = y + c0 k0 (+ c1 k1 (+ c2 k2))."""
    k0, k1, k2 = k[which[0]], k[which[1]], k[which[2]]
    c0, c1, c2 = c
    if terms == 1:
        for i in range(out.size):
            out[i] = y[i] + c0 * k0[i]
    elif terms == 2:
        for i in range(out.size):
            out[i] = y[i] + (c0 * k0[i] + c1 * k1[i])
    else:
        for i in range(out.size):
            out[i] = y[i] + (c0 * k0[i] + c1 * k1[i] + c2 * k2[i])


@njit
def stages(rhs, handle, a, b, c, last_is_new, t, h, y, k, supply, where, out, y_stage, y_new):
    """Stages 2 .. s from k[0], then y_new; supply[i] keeps the ledger rates of stage i."""
    s = b.size
    for i in range(1, s):
        target = y_new if last_is_new and i == s - 1 else y_stage
        combine(y, h, a[i], i, k, target)
        rhs(t + c[i] * h, target, k[i], out, handle)
        for m in range(supply.shape[1]):
            supply[i, m] = out[where + m]
    if not last_is_new:
        combine(y, h, b, s, k, y_new)


@njit
def error_norm(h, error, k, y, y_new, scale, tolerance):
    """Root mean square of h sum e_j k_j over tolerance (scale + max(|y|, |y_new|))."""
    total = 0.0
    for i in range(y.size):
        e = 0.0
        for j in range(error.size):
            e += error[j] * k[j, i]
        w = h * e / (tolerance * (scale[i] + max(abs(y[i]), abs(y_new[i]))))
        total += w * w
    return sqrt(total / max(y.size, 1))


@njit
def first_step(k, scale, order, tolerance, span):
    """A cautious first step from the size of the rates [s]."""
    total = 0.0
    for i in range(scale.size):
        total += (k[0, i] / scale[i]) ** 2
    d = sqrt(total / max(scale.size, 1))
    return min(span, 0.05 * tolerance ** (1.0 / (order + 1.0)) / d) if d > 0.0 else 1e-3 * span


@njit
def interpolate(theta, h, y, f, y_new, f_new, k, dense, out):
    """Dense output at t + theta h: the method's own polynomial, else the cubic through both ends."""
    if dense.shape[0] > 0:
        copy(y, out)
        for j in range(dense.shape[0]):
            w, power = 0.0, theta
            for m in range(dense.shape[1]):
                w += dense[j, m] * power
                power *= theta
            kj = f if j == 0 else k[j]
            if w != 0.0:
                for i in range(y.size):
                    out[i] += h * w * kj[i]
        return
    s, r = theta, 1.0 - theta
    h00, h01 = r * r * (1.0 + 2.0 * s), s * s * (1.0 + 2.0 * r)
    h10, h11 = h * s * r * r, -h * s * s * r
    for i in range(y.size):
        out[i] = h00 * y[i] + h01 * y_new[i] + (h10 * f[i] + h11 * f_new[i])


@njit
def all_finite(y):
    """False where any value is not finite or its square is not: counted in integers, which is vectorised."""
    bad = 0
    for i in range(y.size):
        bad += not abs(y[i]) < HUGE
    return bad == 0


@njit
def book(h, b, supply, ledger):
    """Add a step of length h to the ledger, by the step's own weights; only once its end is known to be sound."""
    count = supply.shape[1]
    for m in range(count):
        total = 0.0
        for i in range(b.size):
            total += b[i] * supply[i, m]
        ledger[m], ledger[count + m] = add_up(ledger[m], h * total, ledger[count + m])


@njit(forceinline=True)
def add_up(total, part, carry):
    """(total + part, what rounding took off), with what it took off before put back in (Kahan 1965)."""
    whole = part + carry
    new = total + whole
    return new, whole - (new - total)


@njit
def add_stored(h, b, k, y, y_new, stored, carry):
    """Stored masses once more, summed so that a million steps round as one; True where that changed a bit."""
    changed = False
    for q in range(stored.size):
        i, total = stored[q], 0.0
        for j in range(b.size):
            total += b[j] * k[j, i]
        new, carry[q] = add_up(y[i], h * total, carry[q])
        changed = changed or new != y_new[i]
        y_new[i] = new
    return changed


@njit
def arm(g, armed):
    """Note which event functions are at or below zero, where the rhs follows another rule; whether any changed.

    Only accepted states are asked, so no step, not even its stages beyond an event, meets the change of rule.
    """
    changed = False
    for i in range(g.size):
        now = 1.0 if g[i] <= 0.0 else 0.0
        changed = changed or now != armed[i]
        armed[i] = now
    return changed


@njit(forceinline=True)
def fallen(g, g_new):
    """Whether an event function went from above to zero or below."""
    for i in range(g.size):
        if g[i] > 0.0 and g_new[i] <= 0.0:
            return True
    return False


@njit
def nearness(g, g_new):
    """Least share of its value that an event function has kept over the step: 1 at its start, 0 at an event."""
    share = 1.0
    for i in range(g.size):
        if g[i] > 0.0:
            share = min(share, g_new[i] / g[i])
    return share


@njit
def locate(rhs, events, handle, a, b, c, last_is_new, t, h, y, k, supply, where, out, y_stage, y_new, g, g_new):
    """The step that ends just past the first event, by the Illinois rule on its length; y_new belongs to it."""
    low, high, at_low, at_high = 0.0, h, 1.0, nearness(g, g_new)
    for _ in range(100):
        if at_high >= -EVENT_TOLERANCE or high - low <= 4e-16 * max(abs(t), high):
            break
        guess = high - at_high * (high - low) / (at_high - at_low)
        guess += 1e-3 * EVENT_TOLERANCE * h
        if not low < guess < high:
            guess = 0.5 * (low + high)
        stages(rhs, handle, a, b, c, last_is_new, t, guess, y, k, supply, where, out, y_stage, y_new)
        events(t + guess, y_new, handle, g_new)
        here = nearness(g, g_new)
        if here <= 0.0:
            high, at_high, at_low = guess, here, 0.5 * at_low
        else:
            low, at_low, at_high = guess, here, 0.5 * at_high
    stages(rhs, handle, a, b, c, last_is_new, t, high, y, k, supply, where, out, y_stage, y_new)
    events(t + high, y_new, handle, g_new)
    return high


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
