"""One diagonally implicit Runge-Kutta step, its stages solved in turn by simplified Newton. Knows arrays."""

from __future__ import annotations

from fvsolve.jit import njit
from fvsolve.steppers.coefficients import error_of, nodes_of, row_of, weights_of
from fvsolve.steppers.newton import (
    CONVERGED,
    FAILED,
    HAS,
    JACOBIAN,
    KNOWN,
    MADE,
    MOST,
    SHIFT,
    begin,
    book_increment,
    increment_size,
    part,
    renew,
    store_of,
    verdict,
)
from fvsolve.steppers.orders import (
    CALLS,
    CONTROL,
    FACTORS,
    LAST,
    NEWTON,
    NEWTON_FAILED,
    SIZE,
    STEPS,
    TOLERANCE,
)
from fvsolve.steppers.step import combine, copy, error_norm
from fvsolve.steppers.structure import SIZE as STATES
from fvsolve.steppers.structure import STARTS


@njit
def predict(b, c, x, first, last, k):
    """k <- slope at x last steps beyond the last one's end, by the parabola through its ends and the slope at its end.

    That slope is the last stage's where it lies there, else f: a stiff f magnifies what Newton left.
    """
    s, n, at_end = b.size, k.size, c[c.size - 1] == 1.0
    for i in range(n):
        whole = 0.0
        for j in range(s):
            whole += b[j] * last[j * n + i]
        slope = last[(s - 1) * n + i] if at_end else first[i]
        k[i] = slope + 2.0 * x * (slope - whole)


@njit
def solve_stage(
    rhs, solve, handle, shape, t, h_gamma, base, i, k, y_stage, supply, where, out, orders, memory, nnz, work, store
):  # fmt: skip
    """k[i] = f(t, base + h gamma k[i]) by Newton; returns CONVERGED or FAILED.

    With its last increment d the stage is f + J d, to the bit: what is conserved by f and J is conserved.
    """
    n = base.size
    d, f, weights = part(work, 0, n), part(work, 3, n), part(work, 1, n)
    before, why, shift = 0.0, FAILED, 1.0 / h_gamma
    for turn in range(MOST):
        for j in range(n):
            y_stage[j] = base[j] + h_gamma * k[i, j]
        rhs(t, y_stage, f, out, handle)
        memory[CALLS] += 1.0
        memory[NEWTON] += 1.0
        for j in range(n):
            d[j] = f[j] - k[i, j]
        solve(shape, store, d)
        for j in range(n):
            k[i, j] += shift * d[j]
        size = increment_size(d, weights, memory)
        done, why = verdict(turn, size, before, orders, work)
        before = size
        if done:
            break
    if why == CONVERGED:
        for m in range(supply.shape[1]):
            supply[i, m] = out[where + m]
        book_increment(shape, nnz, d, supply, i, work)
    return why


@njit
def attempt(
    rhs, factor, solve, factor_complex, solve_complex, handle, coefficients, shape, t, h, y, now, new, k, supply,
    where, out, scale, orders, memory, work, work_complex,
):  # fmt: skip
    """y[new] and the stages k from y[now] and k[0] = f(t, y[now]); returns the error in units of the tolerance.

    Of the linear algebra the real part is used. Returns NEWTON_FAILED where a fresh Jacobian does not help.
    """
    s, n = k.shape
    nnz = shape[shape[STARTS] + shape[STATES]]
    c, b = nodes_of(coefficients, s), weights_of(coefficients, s)
    base, store = part(work, 5, n), store_of(work)[0]
    begin(k, y[now], scale, orders, memory, nnz, work)
    last = work[JACOBIAN + nnz : JACOBIAN + nnz + s * n]
    i = 1
    while i < s:
        row = row_of(coefficients, s, i)
        combine(y[now], h, row, i, k, base)
        if row[i] == 0.0:
            rhs(t + c[i] * h, base, k[i], out, handle)
            memory[CALLS] += 1.0
            for m in range(supply.shape[1]):
                supply[i, m] = out[where + m]
            i += 1
            continue
        if work[HAS] == 0.0:
            renew(rhs, handle, shape, where, t, y[now], k, supply, scale, out, memory, nnz, work)
        shift, why = 1.0 / (h * row[i]), FAILED
        if work[SHIFT] == shift or factor(shape, work[JACOBIAN : JACOBIAN + nnz], shift, store) == 0:
            memory[FACTORS] += 0.0 if work[SHIFT] == shift else 1.0
            work[SHIFT] = shift
            if work[KNOWN] == 1.0:
                predict(b, c, c[i] * h / memory[LAST], k[0], last, k[i])
            else:
                copy(k[i - 1] if i > 1 else k[0], k[i])
            why = solve_stage(
                rhs, solve, handle, shape, t + c[i] * h, h * row[i], base, i, k, y[3], supply, where, out, orders,
                memory, nnz, work, store,
            )  # fmt: skip
        if why == CONVERGED:
            i += 1
        elif work[MADE] == memory[STEPS] and work[HAS] == 1.0:
            return NEWTON_FAILED
        else:
            work[HAS] = 0.0
            i = 1
    combine(y[now], h, b, s, k, y[new])
    if orders[CONTROL] != TOLERANCE:
        return 0.0
    return error_norm(h, error_of(coefficients, s), k, y[now], y[new], scale, orders[SIZE])
