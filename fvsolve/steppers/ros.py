"""One step of a Rosenbrock method: every stage is a linear solve with the Jacobian at the start of the step.

(I / (h g) - J) u_i = f(t + c_i h, y + sum a_ij u_j) + sum C_ij u_j / h + d_i h f_t, y+ = y + sum m_i u_i
with the step h, the Jacobian J, the time slope f_t = df/dt and the coefficients g, a, c, C, d, m of the method (Hairer
and Wanner 1996, (IV.7.25)). Stages are stored as k_i = u_i / h.
"""

from __future__ import annotations

from fvsolve.jit import inline, njit
from fvsolve.steppers.coefficients import error_of, nodes_of, row_of, weights_of
from fvsolve.steppers.differences import multiply
from fvsolve.steppers.loop_indices import (
    CALLS,
    CONTROL,
    FACTORS,
    HAS_JACOBIAN,
    HEADER,
    KNOWN_STEPS,
    LAST,
    NEWTON_FAILED,
    RADIUS,
    SHIFT,
    SIZE,
    STAGES_STEP,
    STEPS,
    TOLERANCE,
    WATCH,
    WORST,
)
from fvsolve.steppers.newton import BASE, INCREMENT, MOVED, RATE, renew, spectral_radius
from fvsolve.steppers.step_operations import combine, copy, error_norm
from fvsolve.steppers.structure import SIZE as STATES
from fvsolve.steppers.structure import STARTS

SLOPE = BASE  # row of `vectors`, after the stages, for df/dt: Rosenbrock stages do not use the row BASE


@inline
def slope_in_time(rhs, handle, t, h, y, k, ledger_rates, ledger_offset, out, loop_state, work, vectors):
    """Compute the time slopes of f and of the ledger rates at constant y, by a difference within the step.

    The slope of f is stored in a row of `vectors`, the slopes of the ledger rates at the end of `work`.
    y : state at the start of the step; other arguments as for `dirk.attempt`
    """
    s, n = k.shape
    slope, ledgers = vectors[s + SLOPE], ledger_rates.shape[1]
    step = min((2.2e-16 * max(1e-5, abs(t))) ** 0.5, 1e-3 * h)
    later = t + step
    rhs(later, y, slope, out, handle)
    loop_state[CALLS] += 1.0
    per = 1.0 / (later - t) if later > t else 0.0  # the time difference is lost in rounding: df/dt is negligible
    for e in range(n):
        slope[e] = (slope[e] - k[0, e]) * per
    for m in range(ledgers):
        work[work.size - ledgers + m] = (out[ledger_offset + m] - ledger_rates[0, m]) * per


@inline
def book_stage(structure, nnz, i, gamma, time_weight, row, d, ledger_rates, ledger_offset, out, work):
    """Compute the ledger rates of stage i: gamma (rates + J d + time_weight slope + sum of C_ij ledger_rates_j).

    d : float64[n]  solution u_i of the stage; row : float64[s]  row C_i of the coefficients; J : Jacobian in `work`
    `out` holds the rates computed with f, the end of `work` their time slopes
    nnz : number of Jacobian entries; structure : flat array of `Structure.shape`
    """
    n, ledgers, product = d.size, ledger_rates.shape[1], work[HEADER + nnz :]
    multiply(structure, work[HEADER : HEADER + nnz], d, product)
    for m in range(ledgers):
        total = out[ledger_offset + m] + product[n + m] + time_weight * work[work.size - ledgers + m]
        for j in range(1, i):
            total += row[j] * ledger_rates[j, m]
        ledger_rates[i, m] = gamma * total


@njit
def attempt(
    rhs, factor, solve, factor_complex, solve_complex, join, handle, coefficients, structure, row_blocks, sums, t, h, y,
    now, new, k, ledger_rates, ledger_offset, out, scale, controls, loop_state, work, vectors, factors, complex_factors,
):  # fmt: skip
    """Compute y[new] and the stages k from y[now] and k[0] = f(t, y[now]); returns the error in units of the tolerance.

    The error is 0 unless the step is under error control, and NEWTON_FAILED if the matrix I / (h g) - J is singular,
    with the Jacobian J and the diagonal coefficient g of the method. Arguments as for `dirk.attempt`.
    """
    s, n = k.shape
    ledgers, nnz = ledger_rates.shape[1], structure[structure[STARTS] + structure[STATES]]
    c, extra = nodes_of(coefficients, s), coefficients[s * s + 3 * s :]  # C, d, g
    gamma, slope, d, f = extra[s * s + s], vectors[s + SLOPE], vectors[s + INCREMENT], vectors[s + RATE]
    if work[HAS_JACOBIAN] == 0.0 or work[STAGES_STEP] != loop_state[STEPS]:
        renew(
            rhs, handle, structure, ledger_offset, t, y[now], k[0], ledger_rates[0], scale, out, loop_state, work,
            vectors[s + MOVED], vectors[s + RATE],
        )  # fmt: skip
        slope_in_time(rhs, handle, t, h, y[now], k, ledger_rates, ledger_offset, out, loop_state, work, vectors)
        if work[STAGES_STEP] != loop_state[STEPS]:
            follows = work[STAGES_STEP] == loop_state[STEPS] - 1.0 and loop_state[LAST] > 0.0
            work[KNOWN_STEPS] = min(work[KNOWN_STEPS] + 1.0, 2.0) if follows else 0.0
        work[STAGES_STEP] = loop_state[STEPS]
        if controls[WATCH] != 0.0:
            loop_state[RADIUS] = spectral_radius(structure, work, nnz, scale, vectors[s + INCREMENT])
    shift = 1.0 / (h * gamma)
    if work[SHIFT] != shift:
        loop_state[FACTORS] += 0.0 if work[SHIFT] == -shift else 1.0
        work[SHIFT] = 0.0
        bad_pivot = factor(structure, work[HEADER:], shift, factors)
        if bad_pivot != 0:
            loop_state[WORST] = bad_pivot - 1.0
            return NEWTON_FAILED
        work[SHIFT] = shift
    per = 1.0 / h
    for i in range(1, s):
        if i == 1:
            f = k[0]
            for m in range(ledgers):
                out[ledger_offset + m] = ledger_rates[0, m]
        else:
            f = vectors[s + RATE]
            combine(0, y[now].size, y[now], h, row_of(coefficients, s, i), i, k, y[3])
            rhs(t + c[i] * h, y[3], f, out, handle)
        time_weight, u, row = extra[s * s + i] * h, k[i], extra[i * s : (i + 1) * s]
        if time_weight != 0.0:
            for e in range(n):
                d[e] = f[e] + time_weight * slope[e]
            f = d
        combine(0, n, f, 1.0, row, i, k, u)
        solve(structure, factors, u)
        if ledgers > 0:
            copy(u, d)
            book_stage(structure, nnz, i, gamma, time_weight, row, d, ledger_rates, ledger_offset, out, work)
        for e in range(n):
            u[e] *= per
    loop_state[CALLS] += s - 2.0
    combine(0, y[now].size, y[now], h, weights_of(coefficients, s), s, k, y[new])
    if controls[CONTROL] != TOLERANCE:
        return 0.0
    return error_norm(h, error_of(coefficients, s), k, y[now], y[new], scale, controls[SIZE])
