"""One fully implicit Runge-Kutta step; simplified Newton solves all stages together.

Z are the increments of the q implicit stages over the start of the step, and K = (h A)^-1 (Z - h a_0 k_0) their slopes;
a_0 are the weights of an explicit first stage with slope k_0, h is the step and J the Jacobian. A^-1 = T L T^-1 with L
block diagonal: a real shift for every real eigenvalue, a complex shift for every complex pair (Butcher 1976; Hairer and
Wanner 1996, IV.8). With W = T^-1 Z and the rates F of the stages, Newton solves
(L / h x I - I x J) dW = T^-1 (F - K), block by block (x is the Kronecker product).
Where a single Jacobian is not sufficient for all stages, `stage_sweeps.py` solves the stages one after another.
"""

from __future__ import annotations

import functools
from math import sqrt

import numpy as np

from fvsolve.jit import inline, njit
from fvsolve.steppers.coefficients import error_of, nodes_of, weights_of
from fvsolve.steppers.loop_indices import (
    CALLS,
    CONTROL,
    DAMPED_STEP,
    END,
    FACTOR_SIZE,
    FACTORS,
    HAS_JACOBIAN,
    HEADER,
    JACOBIAN_STEP,
    KNOWN_STEPS,
    LAST,
    NEWTON,
    NEWTON_FAILED,
    RADIUS,
    SHIFT,
    SIZE,
    STAGES_STEP,
    STEPS,
    TOLERANCE,
    WATCH,
)
from fvsolve.steppers.newton import (
    CONVERGED,
    FAILED,
    INCREMENT,
    MOST,
    MOVED,
    RATE,
    STAGES,
    WEIGHTS,
    begin,
    book_increment,
    convergence,
    find_worst,
    renew,
    smoothed_error,
    spectral_radius,
)
from fvsolve.steppers.stage_sweeps import sweep
from fvsolve.steppers.step_operations import combine, copy, error_norm, error_scale
from fvsolve.steppers.structure import SIZE as STATES
from fvsolve.steppers.structure import STARTS
from fvsolve.steppers.tableau import Method

# Matrices q x q behind the Butcher array (`coefficients.py`), and last T^-1 A^-1 a_0 and A^-1 a_0.
T, T_INVERSE, BLOCKS, SLOPES, EXTRAPOLATION, CROUT, START = range(7)
# Rows of `vectors` for all stages, from STAGES on, q rows each: W, F, and the residuals, replaced by the solution dW.
W, F, R = range(3)
DEFECT_POINTS = (-0.1, -1e-2, -1e-3, -1e-4)  # points before a kink, in steps from it, where the defect is checked
# Weight of that defect in the error: Newton residual and method error contribute less than a hundred tolerances.
DEFECT_WEIGHT = 1e-2


@functools.cache
def pairs_of(method: Method) -> int:
    """Number of complex conjugate pairs among the eigenvalues of A^-1; A : coefficients of the implicit stages."""
    a = method.a[1:, 1:] if not method.a[0].any() else method.a
    return int(np.count_nonzero(np.linalg.eigvals(a).imag > 0))


@njit(inline="always")
def matrix(coefficients, s, index):
    """Flat coefficients of a method from matrix number `index` of its Newton data on.

    The data are listed in `newton_transform.transformed`; each of its matrices has q x q entries, row by row.
    s : number of stages, q = s - 1
    """
    return coefficients[s * s + 3 * s + index * (s - 1) * (s - 1) :]


@njit
def blend(base_weight, base, m, at, q, first, vectors, target):
    """Write base_weight base + sum over j < q of m[at + j] vectors[first + j] to `target`, three terms in each pass.

    m : flat matrix; target, base : float64[n]
    """
    n = target.size
    for j in range(0, q, 3):
        v0, v1, v2 = vectors[first + j], vectors[first + min(j + 1, q - 1)], vectors[first + min(j + 2, q - 1)]
        c0, c1, c2 = m[at + j], m[at + j + 1] if j + 1 < q else 0.0, m[at + j + 2] if j + 2 < q else 0.0
        if j > 0:
            for e in range(n):
                target[e] += c0 * v0[e] + (c1 * v1[e] + c2 * v2[e])
        else:
            for e in range(n):
                target[e] = base_weight * base[e] + (c0 * v0[e] + (c1 * v1[e] + c2 * v2[e]))


@inline
def predict(coefficients, h, h_last, s, buffer, vectors):
    """Predict the transformed stage increments W = T^-1 Z by extrapolation of the slopes of the last step.

    Z : increments of the implicit stages over the start of the step; T : see `newton_transform.transformed`
    coefficients, s : flat coefficients of the method, and its number of stages; h, h_last : this step and the last step
    buffer : float64[q q]  work array; W is stored in `vectors`
    """
    q, c = s - 1, nodes_of(coefficients, s)
    back, ahead = matrix(coefficients, s, T_INVERSE), matrix(coefficients, s, EXTRAPOLATION)
    for e in range(q * q):
        buffer[e] = 0.0
    for k in range(q):
        x = c[k + 1] * h / h_last
        for j in range(q):
            w = 0.0
            for d in range(q - 1, -1, -1):
                w = (w + ahead[j * q + d]) * x
            for i in range(q):
                buffer[i * q + j] += back[i * q + k] * w * h_last
    for i in range(q):
        blend(0.0, vectors[s + WEIGHTS], buffer, i * q, q, 1, vectors, vectors[s + STAGES + i])


@inline
def factor_blocks(factor, factor_complex, structure, coefficients, s, h, work, factors, complex_factors, n):
    """Factor shift I - J for every block (real or complex shift) of L / h, and store the factors one after another.

    L : block diagonal matrix of `newton_transform.transformed`; J : Jacobian; n : number of states
    Returns the number of factors, or 0 if a block has no good pivot. Other arguments as for `attempt`.
    """
    q, blocks, b, real, pair, count = s - 1, matrix(coefficients, s, BLOCKS), 0, 0, n, 0
    jacobian, size = work[HEADER:], int(work[FACTOR_SIZE])
    while b < q:
        shift = blocks[b * q + b] / h
        if b + 1 < q and blocks[(b + 1) * q + b] != 0.0:
            if (
                factor_complex(structure, jacobian, complex(shift, blocks[(b + 1) * q + b] / h), complex_factors[pair:])
                != 0
            ):
                return 0
            b, pair = b + 2, pair + size
        else:
            if factor(structure, jacobian, shift, factors[real:]) != 0:
                return 0
            b, real = b + 1, real + size
        count += 1
    return count


@inline
def solve_blocks(solve, solve_complex, structure, coefficients, s, size, factors, complex_factors, vectors):
    """Solve (L / h x I - I x J) dW = R with the factors of `factor_blocks`; dW replaces R in `vectors`.

    L : block diagonal matrix of `newton_transform.transformed`; J : Jacobian; x : Kronecker product
    size : length of the factors of one block; other arguments as for `attempt`
    """
    q, blocks, b, real, n = s - 1, matrix(coefficients, s, BLOCKS), 0, 0, vectors.shape[1]
    first, pair, both = s + STAGES + R * q, n, complex_factors[:n]
    while b < q:
        if b + 1 < q and blocks[(b + 1) * q + b] != 0.0:
            u, v = vectors[first + b], vectors[first + b + 1]
            for e in range(n):
                both[e] = complex(u[e], v[e])
            solve_complex(structure, complex_factors[pair:], both)
            for e in range(n):
                u[e], v[e] = both[e].real, both[e].imag
            b, pair = b + 2, pair + size
        else:
            solve(structure, factors[real:], vectors[first + b])
            b, real = b + 1, real + size


@inline
def iterate(
    rhs, solve, solve_complex, handle, coefficients, structure, t, h, y, y_stage, k0, ledger_rates, ledger_offset, out,
    controls, loop_state, work, vectors, factors, complex_factors,
):  # fmt: skip
    """Compute the transformed stage increments W = T^-1 Z by Newton iterations; returns CONVERGED or FAILED.

    W is stored in `vectors`, in place of its prediction.
    Z : increments of the implicit stages over the start of the step; T : see `newton_transform.transformed`
    y, k0 : float64[n]  state and rates at the start of the step; y_stage : work array; other arguments as for `attempt`
    """
    s, n = ledger_rates.shape[0], y.size
    q, c, weights = s - 1, nodes_of(coefficients, s), vectors[s + WEIGHTS]
    t_matrix, back, blocks = (
        matrix(coefficients, s, T),
        matrix(coefficients, s, T_INVERSE),
        matrix(coefficients, s, BLOCKS),
    )
    start = matrix(coefficients, s, START)
    w_at, f_at, r_at = s + STAGES + W * q, s + STAGES + F * q, s + STAGES + R * q
    before, status = 0.0, FAILED
    for turn in range(MOST):
        for i in range(q):
            blend(1.0, y, t_matrix, i * q, q, w_at, vectors, y_stage)
            rhs(t + c[i + 1] * h, y_stage, vectors[f_at + i], out, handle)
            for m in range(ledger_rates.shape[1]):
                ledger_rates[i + 1, m] = out[ledger_offset + m]
        loop_state[CALLS] += q
        loop_state[NEWTON] += 1.0
        for i in range(q):
            blend(start[i], k0, back, i * q, q, f_at, vectors, vectors[r_at + i])
            j = i
            if i + 1 < q and blocks[(i + 1) * q + i] != 0.0:
                j = i + 1
            elif i > 0 and blocks[i * q + i - 1] != 0.0:
                j = i - 1
            own, other = -blocks[i * q + i] / h, -blocks[i * q + j] / h if j != i else 0.0
            r, wi, wj = vectors[r_at + i], vectors[w_at + i], vectors[w_at + j]
            for e in range(n):
                r[e] += own * wi[e] + other * wj[e]
        solve_blocks(
            solve, solve_complex, structure, coefficients, s, int(work[FACTOR_SIZE]), factors, complex_factors, vectors
        )
        total = 0.0
        for e in range(n):
            per, part = weights[e], 0.0
            for i in range(q):
                r = vectors[r_at + i, e]
                vectors[w_at + i, e] += r
                part += r * r
            total += per * per * part
        size = sqrt(total / max(q * n, 1))
        done, status = convergence(turn, size, before, controls, work)
        before = size
        if done:
            break
    if status == FAILED:
        f = vectors[s + RATE]
        copy(vectors[f_at], f)
        for i in range(1, q):
            for e in range(n):
                f[e] += vectors[f_at + i, e]
        find_worst(vectors[r_at], f, weights, loop_state)
    return status


@inline
def finish(coefficients, structure, nnz, h, k, ledger_rates, work, vectors):
    """Compute the slopes k of the stages from their increments W, and correct the ledger rates by the last increment.

    W : transformed increments of `iterate`, in `vectors`; nnz : number of Jacobian entries
    Other arguments as for `attempt`.
    """
    s = k.shape[0]
    q, d = s - 1, vectors[s + INCREMENT]
    slopes, start, buffer = matrix(coefficients, s, SLOPES), matrix(coefficients, s, START), work[work.size - q * q :]
    for e in range(q * q):
        buffer[e] = slopes[e] / h
    for i in range(q):
        blend(-start[q + i], k[0], buffer, i * q, q, s + STAGES + W * q, vectors, k[i + 1])
        if ledger_rates.shape[1] > 0:
            blend(0.0, k[0], matrix(coefficients, s, T), i * q, q, s + STAGES + R * q, vectors, d)
            book_increment(structure, nnz, d, ledger_rates, i + 1, work)


@inline
def filtered_error(
    rhs,
    solve,
    handle,
    structure,
    coefficients,
    t,
    h,
    y,
    now,
    new,
    k,
    out,
    scale,
    controls,
    loop_state,
    vectors,
    factors,
    retry,
):
    """Norm of the embedded error estimate, smoothed by the first Newton factor, in units of the tolerance.

    The error is e = (I - h g J)^-1 h (e_0 f(t, y) + sum of e_i k_i) with the weights e_i of the error estimate and the
    real eigenvalue 1 / g of A^-1 (Hairer and Wanner 1996, IV.8).
    retry : True for a repeated step or the first after a kink; then an error of 1 or more is estimated once more with
    f(t, y + e)
    Other arguments as for `attempt`.
    """
    s, n = k.shape
    error, d, f = error_of(coefficients, s), vectors[s + INCREMENT], vectors[s + RATE]
    shift, norm = matrix(coefficients, s, BLOCKS)[0], 0.0
    for turn in range(2):
        for e in range(n):
            total = error[0] * (f[e] if turn == 1 else k[0, e])
            for j in range(1, s):
                total += error[j] * k[j, e]
            d[e] = total * shift
        solve(structure, factors, d)
        norm = 0.0
        for e in range(n):
            w = d[e] / (controls[SIZE] * error_scale(scale[e], max(abs(y[now, e]), abs(y[new, e]))))
            norm += w * w
        norm = sqrt(norm / max(n, 1))
        if norm < 1.0 or turn == 1 or not retry:
            break
        for e in range(n):
            y[3, e] = y[now, e] + d[e]
        rhs(t, y[3], f, out, handle)
        loop_state[CALLS] += 1.0
    return norm


@inline
def defect_before_end(
    rhs,
    solve,
    handle,
    structure,
    coefficients,
    t,
    h,
    y,
    new,
    k,
    out,
    scale,
    controls,
    loop_state,
    work,
    vectors,
    factors,
):
    """Greatest defect of the collocation polynomial p just before the end of a step, in units of the tolerance.

    Stages do not show a stiff state that becomes free just before the end, where an opening closes. The defect is
    e = h g (p' - f(p + d)) with d = (I - h g J)^-1 h g (p' - f(p)), where 1 / g is the first real eigenvalue of A^-1.
    It is as small as d if the Jacobian J is valid there; otherwise it is the full defect.
    Arguments as for `attempt`.
    """
    s, n = k.shape
    q, ahead, buffer = s - 1, matrix(coefficients, s, EXTRAPOLATION), work[work.size - (s - 1) * (s - 1) :]
    d, f, step, greatest = vectors[s + INCREMENT], vectors[s + RATE], h / matrix(coefficients, s, BLOCKS)[0], 0.0
    for x in DEFECT_POINTS:
        for j in range(q):
            buffer[j], buffer[q + j] = 0.0, 0.0
            for m in range(q - 1, -1, -1):
                buffer[j] = (buffer[j] + ahead[j * q + m]) * x
                buffer[q + j] = buffer[q + j] * x + (m + 1) * ahead[j * q + m]
        for e in range(n):
            y[3, e] = y[new, e]
            for j in range(q):
                y[3, e] += h * buffer[j] * k[j + 1, e]
        total = 0.0
        for turn in range(2):
            rhs(t + (1.0 + x) * h, y[3], f, out, handle)
            loop_state[CALLS] += 1.0
            for e in range(n):
                d[e] = -f[e]
                for j in range(q):
                    d[e] += buffer[q + j] * k[j + 1, e]
                w = step * d[e] / (controls[SIZE] * error_scale(scale[e], abs(y[new, e])))
                total = total + w * w if turn == 1 else 0.0
            if turn == 0:
                solve(structure, factors, d)
                for e in range(n):
                    y[3, e] += d[e]
        greatest = max(greatest, sqrt(total / max(n, 1)))
    return greatest


@njit
def attempt(
    rhs, factor, solve, factor_complex, solve_complex, join, handle, coefficients, structure, row_blocks, sums, t, h, y,
    now, new, k, ledger_rates, ledger_offset, out, scale, controls, loop_state, work, vectors, factors, complex_factors,
):  # fmt: skip
    """Compute y[new] and the stages k from y[now] and k[0] = f(t, y[now]); returns the error in units of the tolerance.

    The error is 0 unless the step is under error control, and NEWTON_FAILED if Newton with a fresh Jacobian and the
    sweeps of `stage_sweeps` fail.
    factor_complex, solve_complex, complex_factors : linear algebra and factors for complex shifts
    Other arguments as for `dirk.attempt`.
    """
    s, n = k.shape
    nnz = structure[structure[STARTS] + structure[STATES]]
    q, error = s - 1, error_of(coefficients, s)
    retry = (
        work[STAGES_STEP] == loop_state[STEPS] or work[STAGES_STEP] < 0.0
    )  # a repeated step, or the first after a kink
    begin(k, y[now], scale, controls, loop_state, work, vectors)
    while True:
        if work[HAS_JACOBIAN] == 0.0:
            renew(
                rhs, handle, structure, ledger_offset, t, y[now], k[0], ledger_rates[0], scale, out, loop_state, work,
                vectors[s + MOVED], vectors[s + RATE],
            )  # fmt: skip
            if controls[WATCH] != 0.0:
                loop_state[RADIUS] = spectral_radius(structure, work, nnz, scale, vectors[s + INCREMENT])
        status = FAILED
        if work[SHIFT] != 1.0 / h:
            known, work[SHIFT] = work[SHIFT] == -1.0 / h, 0.0
            count = factor_blocks(
                factor, factor_complex, structure, coefficients, s, h, work, factors, complex_factors, n
            )
            loop_state[FACTORS] += 0.0 if known else count
            if count > 0:
                work[SHIFT] = 1.0 / h
        if work[SHIFT] != 0.0:
            # high powers of h / h_last extrapolate badly
            if work[KNOWN_STEPS] > 0.0 and (q < 5 or h <= 2.0 * loop_state[LAST]):
                predict(coefficients, h, loop_state[LAST], s, work[work.size - q * q :], vectors)
            else:
                for i in range(q):
                    for e in range(n):
                        vectors[s + STAGES + i, e] = 0.0
            status = iterate(
                rhs, solve, solve_complex, handle, coefficients, structure, t, h, y[now], y[3], k[0], ledger_rates,
                ledger_offset, out, controls, loop_state, work, vectors, factors, complex_factors,
            )  # fmt: skip
        if status == CONVERGED:
            finish(coefficients, structure, nnz, h, k, ledger_rates, work, vectors)
            break
        if work[JACOBIAN_STEP] == loop_state[STEPS]:
            low, first_row = matrix(coefficients, s, CROUT), s + STAGES + W * q
            status = sweep(
                rhs, factor, solve, handle, coefficients, low, structure, t, h, y[now], y[3], k, ledger_rates,
                ledger_offset, out, scale, controls, loop_state, nnz, first_row, work, vectors, factors,
            )  # fmt: skip
            work[SHIFT] = 0.0  # the factors are those of a stage
            if status == FAILED:
                return NEWTON_FAILED
            break
        work[HAS_JACOBIAN] = 0.0
    combine(0, y[now].size, y[now], h, weights_of(coefficients, s), s, k, y[new])
    if controls[CONTROL] != TOLERANCE:
        return 0.0
    collocates = error[0] != 0.0 and matrix(coefficients, s, START)[0] == 0.0
    if work[DAMPED_STEP] == loop_state[STEPS]:
        error_size = smoothed_error(
            rhs, factor, solve, handle, structure, ledger_offset, t, h, y[now], y[new], k, ledger_rates, error,
            matrix(coefficients, s, BLOCKS)[0] / h, scale, out, controls, loop_state, work, vectors, factors,
        )  # fmt: skip
    elif collocates:
        error_size = filtered_error(
            rhs, solve, handle, structure, coefficients, t, h, y, now, new, k, out, scale, controls, loop_state,
            vectors, factors, retry,
        )  # fmt: skip
    else:
        error_size = error_norm(h, error, k, y[now], y[new], scale, controls[SIZE])
    if collocates and 0.0 <= error_size <= 1.0 and h >= (controls[END] - t) * (1.0 - 1e-9):
        error_size = max(error_size, DEFECT_WEIGHT * defect_before_end(
            rhs, solve, handle, structure, coefficients, t, h, y, new, k, out, scale, controls, loop_state, work,
            vectors, factors,
        ))  # fmt: skip
    return error_size
