"""One diagonally implicit Runge-Kutta step; simplified Newton solves one stage after another."""

from __future__ import annotations

from math import sqrt

from fvsolve.jit import inner, njit
from fvsolve.steppers.coefficients import error_of, nodes_of, row_of, weights_of
from fvsolve.steppers.newton import (
    BASE,
    CONVERGED,
    FAILED,
    INCREMENT,
    MOST,
    MOVED,
    RATE,
    WEIGHTS,
    begin,
    book_increment,
    evaluate,
    find_worst,
    reach,
    renew,
    size_of,
    smoothed_error,
    verdict,
)
from fvsolve.steppers.slots import (
    CALLS,
    CONTROL,
    DAMPED,
    FACTORS,
    HAS,
    HEADER,
    KNOWN,
    LAST,
    MADE,
    NEWTON_FAILED,
    SHIFT,
    SIZE,
    STEPS,
    TOLERANCE,
)
from fvsolve.steppers.step import combine, error_norm
from fvsolve.steppers.structure import SIZE as STATES
from fvsolve.steppers.structure import STARTS


@inner
def predict(b, c, x, first, vectors, k):
    """k <- predicted slope at x last steps beyond the end of the last step.

    The prediction is a parabola through both ends of the last step with the slope at its end. That slope is the slope
    of the last stage if c_s = 1, else f: re-evaluating a stiff f would amplify the Newton residual.
    """
    s, n = b.size, k.size
    slopes = vectors[s - 1] if c[s - 1] == 1.0 else first
    for i in range(n):
        k[i] = slopes[i] * (1.0 + 2.0 * x)
    for j in range(s):
        if b[j] != 0.0:
            w, last = 2.0 * x * b[j], vectors[j]
            for i in range(n):
                k[i] -= w * last[i]


@inner
def solve_stage(
    rhs, solve, handle, shape, t, h_gamma, i, k, y_stage, supply, where, out, orders, memory, nnz, work, vectors, store
):  # fmt: skip
    """Solve k[i] = f(t, base + h gamma k[i]) by Newton; returns CONVERGED or FAILED.

    The stored stage is f + J d with the last increment d, to the bit: quantities that f and J conserve are conserved.
    """
    s, n = k.shape
    base, d, f, weights = vectors[s + BASE], vectors[s + INCREMENT], vectors[s + RATE], vectors[s + WEIGHTS]
    before, status, shift, ki = 0.0, FAILED, 1.0 / h_gamma, k[i]
    for turn in range(MOST):
        evaluate(rhs, handle, t, h_gamma, base, ki, y_stage, f, out, memory, d)
        solve(shape, store, d)
        for j in range(n):
            ki[j] += shift * d[j]
        size = sqrt(size_of(d, weights) / max(n, 1))
        done, status = verdict(turn, size, before, orders, work)
        before = size
        if done:
            break
    if status == FAILED:
        find_worst(d, f, weights, memory)
    elif supply.shape[1] > 0:
        for m in range(supply.shape[1]):
            supply[i, m] = out[where + m]
        book_increment(shape, nnz, d, supply, i, work)
    return status


@inner
def try_stages(
    rhs, factor, solve, handle, coefficients, shape, t, h, y, y_stage, k, supply, where, out, scale, orders, memory,
    nnz, work, vectors, store,
):  # fmt: skip
    """Solve all stages with the current Jacobian, with damping where it is fresh; returns CONVERGED or FAILED."""
    s, fresh = k.shape[0], work[MADE] == memory[STEPS]
    c, b, base = nodes_of(coefficients, s), weights_of(coefficients, s), vectors[s + BASE]
    for i in range(1, s):
        row = row_of(coefficients, s, i)
        combine(0, y.size, y, h, row, i, k, base)
        if row[i] == 0.0:
            rhs(t + c[i] * h, base, k[i], out, handle)
            memory[CALLS] += 1.0
            for m in range(supply.shape[1]):
                supply[i, m] = out[where + m]
            continue
        shift = 1.0 / (h * row[i])
        if work[SHIFT] != shift:
            memory[FACTORS] += 0.0 if work[SHIFT] == -shift else 1.0
            work[SHIFT] = 0.0
            if factor(shape, work[HEADER:], shift, store) != 0:
                return FAILED
            work[SHIFT] = shift
        if work[KNOWN] > 0.0:
            predict(b, c, c[i] * h / memory[LAST], k[0], vectors, k[i])
        else:
            for j in range(y.size):
                k[i, j] = k[i - 1, j]
        status = solve_stage(
            rhs, solve, handle, shape, t + c[i] * h, h * row[i], i, k, y_stage, supply, where, out, orders, memory,
            nnz, work, vectors, store,
        )  # fmt: skip
        if status == FAILED and fresh:
            if orders[CONTROL] == TOLERANCE:
                for j in range(y.size):
                    k[i, j] = shift * (y[j] - base[j])
            status = reach(
                rhs, factor, solve, handle, shape, t + c[i] * h, h * row[i], i, k, y, y_stage, supply, where, out,
                scale, orders, memory, nnz, work, vectors, store,
            )  # fmt: skip
        if status == FAILED:
            return FAILED
    return CONVERGED


@njit
def attempt(
    rhs, factor, solve, factor_complex, solve_complex, join, handle, coefficients, shape, spans, sums, t, h, y, now,
    new, k, supply, where, out, scale, orders, memory, work, vectors, store, store_complex,
):  # fmt: skip
    """Compute y[new] and the stages k from y[now] and k[0] = f(t, y[now]); returns the error in units of the tolerance.

    Uses the real part of the linear algebra. Returns NEWTON_FAILED where a fresh Jacobian does not help.
    """
    s = k.shape[0]
    nnz = shape[shape[STARTS] + shape[STATES]]
    begin(k, y[now], scale, orders, memory, work, vectors)
    while True:
        if work[HAS] == 0.0:
            renew(
                rhs, handle, shape, where, t, y[now], k[0], supply[0], scale, out, memory, work, vectors[s + MOVED],
                vectors[s + RATE],
            )  # fmt: skip
        status = try_stages(
            rhs, factor, solve, handle, coefficients, shape, t, h, y[now], y[3], k, supply, where, out, scale, orders,
            memory, nnz, work, vectors, store,
        )  # fmt: skip
        if status == CONVERGED:
            break
        if work[MADE] == memory[STEPS]:
            return NEWTON_FAILED
        work[HAS] = 0.0
    combine(0, y[now].size, y[now], h, weights_of(coefficients, s), s, k, y[new])
    if orders[CONTROL] != TOLERANCE:
        return 0.0
    if work[DAMPED] == memory[STEPS]:
        return smoothed_error(
            rhs, factor, solve, handle, shape, where, t, h, y[now], y[new], k, supply, error_of(coefficients, s),
            1.0 / (h * row_of(coefficients, s, s - 1)[s - 1]), scale, out, orders, memory, work, vectors, store,
        )  # fmt: skip
    return error_norm(h, error_of(coefficients, s), k, y[now], y[new], scale, orders[SIZE])
