"""One diagonally implicit Runge-Kutta step; simplified Newton solves one stage after another."""

from __future__ import annotations

from math import sqrt

from fvsolve.jit import inline, njit
from fvsolve.steppers.coefficients import error_of, nodes_of, row_of, weights_of
from fvsolve.steppers.loop_indices import (
    CALLS,
    CONTROL,
    DAMPED_STEP,
    FACTORS,
    HAS_JACOBIAN,
    HEADER,
    JACOBIAN_STEP,
    KNOWN_STEPS,
    LAST,
    NEWTON_FAILED,
    SHIFT,
    SIZE,
    STEPS,
    TOLERANCE,
)
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
    convergence,
    evaluate,
    find_worst,
    renew,
    size_of,
    smoothed_error,
    solve_stage_from_start,
)
from fvsolve.steppers.step_operations import combine, error_norm
from fvsolve.steppers.structure import SIZE as STATES
from fvsolve.steppers.structure import STARTS


@inline
def predict(b, c, x, first, vectors, k):
    """Predict the slope k of a stage at the time x h_last after the last step, whose length is h_last.

    The prediction is the slope of a parabola through both ends of the last step, with the slope at its end. The slope
    at the end is the slope of the last stage if c_s = 1, because a new evaluation of a stiff f would amplify the Newton
    residual; otherwise it is `first`, the rate f.
    b, c : weights and nodes of the method; vectors : rows with the slopes of the stages of the last step
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


@inline
def solve_stage(
    rhs, solve, handle, structure, t, h_gamma, i, k, y_stage, ledger_rates, ledger_offset, out, controls, loop_state,
    nnz, work, vectors, factors
):  # fmt: skip
    """Solve stage i, k[i] = f(t, base + h_gamma k[i]), by Newton iterations; returns CONVERGED or FAILED.

    base : state from earlier stages, in `vectors`; h_gamma : step times the diagonal coefficient of the method
    nnz : number of Jacobian entries; other arguments as for `attempt`
    The stored stage is exactly f + J d with the last increment d, so it conserves the quantities that f and the
    Jacobian J conserve.
    """
    s, n = k.shape
    base, d, f, weights = vectors[s + BASE], vectors[s + INCREMENT], vectors[s + RATE], vectors[s + WEIGHTS]
    before, status, shift, ki = 0.0, FAILED, 1.0 / h_gamma, k[i]
    for turn in range(MOST):
        evaluate(rhs, handle, t, h_gamma, base, ki, y_stage, f, out, loop_state, d)
        solve(structure, factors, d)
        for j in range(n):
            ki[j] += shift * d[j]
        size = sqrt(size_of(d, weights) / max(n, 1))
        done, status = convergence(turn, size, before, controls, work)
        before = size
        if done:
            break
    if status == FAILED:
        find_worst(d, f, weights, loop_state)
    elif ledger_rates.shape[1] > 0:
        for m in range(ledger_rates.shape[1]):
            ledger_rates[i, m] = out[ledger_offset + m]
        book_increment(structure, nnz, d, ledger_rates, i, work)
    return status


@inline
def try_stages(
    rhs, factor, solve, handle, coefficients, structure, t, h, y, y_stage, k, ledger_rates, ledger_offset, out, scale,
    controls, loop_state, nnz, work, vectors, factors,
):  # fmt: skip
    """Solve all stages with the current Jacobian; returns CONVERGED or FAILED.

    A stage that fails is solved again by damped Newton if the Jacobian is of this step.
    y : state at the start of the step; y_stage : work array; nnz : number of Jacobian entries
    Other arguments as for `attempt`.
    """
    s, fresh = k.shape[0], work[JACOBIAN_STEP] == loop_state[STEPS]
    c, b, base = nodes_of(coefficients, s), weights_of(coefficients, s), vectors[s + BASE]
    for i in range(1, s):
        row = row_of(coefficients, s, i)
        combine(0, y.size, y, h, row, i, k, base)
        if row[i] == 0.0:
            rhs(t + c[i] * h, base, k[i], out, handle)
            loop_state[CALLS] += 1.0
            for m in range(ledger_rates.shape[1]):
                ledger_rates[i, m] = out[ledger_offset + m]
            continue
        shift = 1.0 / (h * row[i])
        if work[SHIFT] != shift:
            loop_state[FACTORS] += 0.0 if work[SHIFT] == -shift else 1.0
            work[SHIFT] = 0.0
            if factor(structure, work[HEADER:], shift, factors) != 0:
                return FAILED
            work[SHIFT] = shift
        if work[KNOWN_STEPS] > 0.0:
            predict(b, c, c[i] * h / loop_state[LAST], k[0], vectors, k[i])
        else:
            for j in range(y.size):
                k[i, j] = k[i - 1, j]
        status = solve_stage(
            rhs, solve, handle, structure, t + c[i] * h, h * row[i], i, k, y_stage, ledger_rates, ledger_offset, out,
            controls, loop_state, nnz, work, vectors, factors,
        )  # fmt: skip
        if status == FAILED and fresh:
            if controls[CONTROL] == TOLERANCE:
                for j in range(y.size):
                    k[i, j] = shift * (y[j] - base[j])
            status = solve_stage_from_start(
                rhs, factor, solve, handle, structure, t + c[i] * h, h * row[i], i, k, y, y_stage, ledger_rates,
                ledger_offset, out, scale, controls, loop_state, nnz, work, vectors, factors,
            )  # fmt: skip
        if status == FAILED:
            return FAILED
    return CONVERGED


@njit
def attempt(
    rhs, factor, solve, factor_complex, solve_complex, join, handle, coefficients, structure, row_blocks, sums, t, h, y,
    now, new, k, ledger_rates, ledger_offset, out, scale, controls, loop_state, work, vectors, factors, complex_factors,
):  # fmt: skip
    """Compute y[new] and the stages k from y[now] and k[0] = f(t, y[now]); returns the error in units of the tolerance.

    The error is 0 unless the step is under error control, and NEWTON_FAILED if simplified and damped Newton fail with a
    fresh Jacobian.
    structure : flat array of `Structure.shape`; factor, solve : its functions for real shifts (`Structure.functions`)
    work : header of `loop_indices`, Jacobian and work space, kept between steps
    vectors : float64[rows, n]  data of the last step and work space, listed in `newton`
    factors : factors of the matrix shift I - J with the Jacobian J; other arguments as for `erk.attempt`
    Functions and factors for complex shifts are not used.
    """
    s = k.shape[0]
    nnz = structure[structure[STARTS] + structure[STATES]]
    begin(k, y[now], scale, controls, loop_state, work, vectors)
    while True:
        if work[HAS_JACOBIAN] == 0.0:
            renew(
                rhs, handle, structure, ledger_offset, t, y[now], k[0], ledger_rates[0], scale, out, loop_state, work,
                vectors[s + MOVED], vectors[s + RATE],
            )  # fmt: skip
        status = try_stages(
            rhs, factor, solve, handle, coefficients, structure, t, h, y[now], y[3], k, ledger_rates, ledger_offset,
            out, scale, controls, loop_state, nnz, work, vectors, factors,
        )  # fmt: skip
        if status == CONVERGED:
            break
        if work[JACOBIAN_STEP] == loop_state[STEPS]:
            return NEWTON_FAILED
        work[HAS_JACOBIAN] = 0.0
    combine(0, y[now].size, y[now], h, weights_of(coefficients, s), s, k, y[new])
    if controls[CONTROL] != TOLERANCE:
        return 0.0
    if work[DAMPED_STEP] == loop_state[STEPS]:
        return smoothed_error(
            rhs, factor, solve, handle, structure, ledger_offset, t, h, y[now], y[new], k, ledger_rates,
            error_of(coefficients, s), 1.0 / (h * row_of(coefficients, s, s - 1)[s - 1]), scale, out, controls,
            loop_state, work, vectors, factors,
        )  # fmt: skip
    return error_norm(h, error_of(coefficients, s), k, y[now], y[new], scale, controls[SIZE])
