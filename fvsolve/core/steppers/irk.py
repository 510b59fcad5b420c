"""One fully implicit Runge-Kutta step; simplified Newton solves all stages together, or one by one in sweeps.

Let A = C U be the coefficients of the q implicit stages, C lower triangular and U upper triangular with unit diagonal,
and K the slopes of the stages. The sweep K <- F(y + h (a_0 k_0 + C K + (A - C) K_before)) is a diagonally implicit
step, whose stages `newton.damped_newton` solves; a_0 are the weights of the slope k_0 at the start. Stiff components
converge in q sweeps, as I - U is nilpotent; the error of other components falls by a factor of 4 or more in each sweep
(van der Houwen and de Swart 1997). Limiters and weno weights can reduce this factor or make sweeps oscillate: then K is
extrapolated to the point where the last two changes cancel (Anderson 1965, depth one).

Z are the increments of the q implicit stages over the start of the step, and K = (h A)^-1 (Z - h a_0 k_0) their slopes;
a_0 are the weights of an explicit first stage with slope k_0, h is the step and J the Jacobian. A^-1 = T L T^-1 with L
block diagonal: a real shift for every real eigenvalue, a complex shift for every complex pair (Butcher 1976; Hairer and
Wanner 1996, IV.8). With W = T^-1 Z and the rates F of the stages, Newton solves
(L / h x I - I x J) dW = T^-1 (F - K), block by block (x is the Kronecker product).
Where a single Jacobian is not sufficient for all stages, `irk.py` solves the stages one after another.
"""

import functools
from math import sqrt

import numpy as np

from fvsolve.core.steppers import loop_records as rec
from fvsolve.core.steppers import newton as iterations
from fvsolve.core.steppers import run_handle
from fvsolve.core.steppers.coefficients import error_of, nodes_of, row_of, weights_of
from fvsolve.core.steppers.run_handle import open_run, stage_rates, store_ledger_rates
from fvsolve.core.steppers.step_operations import combine, copy, error_norm, error_scale
from fvsolve.core.steppers.tableau import Method
from fvsolve.jit import inline, njit

MOST_SWEEPS = 40
# Ratio of successive changes above which K is extrapolated; greatest extrapolation, in changes.
SLOW, GREATEST_EXTRAPOLATION = 0.4, 10.0


@inline
def base_of_stage(r, low, h, i, y):
    """Compute the state `base` of stage i in a sweep, from the slopes of this sweep and of the last one.

    low : as in `sweep`; y : state at the start of the step
    """
    s = r.k.shape[0]
    k = r.k
    base = r.base
    row = row_of(r.coefficients, r.k.shape[0], i)
    first = (i - 1) * (s - 1)
    for e in range(y.size):
        base[e] = y[e] + h * row[0] * k[0, e]
    for j in range(1, s):
        c_ij = low[first + j - 1]
        slope = k[j]
        last = r.transformed[j - 1]
        lead, lag = h * c_ij if j < i else 0.0, h * (row[j] - c_ij)
        for e in range(y.size):
            base[e] += lead * slope[e] + lag * last[e]


@inline
def sweep_once(handle, r, low, t, h, now, turn):
    """Solve all stages in turn; returns the sum of squares of the changes of the slopes, or -1 if a stage fails.

    turn : number of the sweep, from 0; other arguments as for `sweep`
    """
    k = r.k
    y = r.y[now]
    base = r.base
    weights = r.weights
    c = nodes_of(r.coefficients, r.k.shape[0])
    s, total = k.shape[0], 0.0
    # All slopes of the last sweep are stored first, because stages read those of later stages.
    for i in range(1, s):
        copy(k[i], r.transformed[i - 1])
    for i in range(1, s):
        own = h * low[(i - 1) * s]
        ki = k[i]
        last = r.transformed[i - 1]
        base_of_stage(r, low, h, i, y)
        if turn == 0:
            # The first sweep starts from the state at the start of the step.
            for e in range(y.size):
                ki[e] = (y[e] - base[e]) / own
        if (
            iterations.solve_stage_from_start(handle, r, t + c[i] * h, own, i, y)
            == iterations.FAILED
        ):
            return -1.0
        for e in range(y.size):
            change = h * (ki[e] - last[e]) * weights[e]
            total += change * change
    return total


@inline
def sweep(handle, r, low, t, h, now):
    """Compute the slopes k of the stages and their ledger rates in sweeps; returns CONVERGED or FAILED.

    low : float64[q q]  lower triangular matrix C by rows, with A = C U, see `coefficients.lower`
    The rows of `transformed` receive the slopes before a sweep, their changes, and the slopes after it.
    handle, r : handle of the model, open handle of the run; t, h, now : as for `irk.attempt`
    """
    k = r.k
    s = r.k.shape[0]
    n = r.k.shape[1]
    q = s - 1
    enough, rounded, floor = iterations.damped_limits(r.control[0])
    settled = floor if r.control[0]["mode"] == rec.TOLERANCE else rounded
    before = 0.0
    for i in range(1, s):
        if low[(i - 1) * s] == 0.0:
            return iterations.FAILED
        copy(k[0], k[i])
    for turn in range(MOST_SWEEPS):
        total = sweep_once(handle, r, low, t, h, now, turn)
        if total == -1.0:
            return iterations.FAILED
        size = sqrt(total / max(q * n, 1))
        # Stiff components need q sweeps, so that earlier changes do not show convergence.
        slow = turn >= q and size >= 0.5 * before
        if size <= enough or size <= settled and slow or size <= floor and turn == MOST_SWEEPS - 1:
            return iterations.CONVERGED
        extrapolate(r, 1.0 if turn >= q and size > SLOW * before else 0.0)
        before = size
    return iterations.FAILED


@inline
def extrapolate(r, weight):
    """Extrapolate the slopes K after a sweep, and store the change d and the result of this sweep.

    The new slopes are K - weight g (K - K_last), g = <d, d - d_before> / |d - d_before|^2, but g is at least
    -GREATEST_EXTRAPOLATION.
    d, d_before : changes in this and in the last sweep; K_last : result of the last sweep before its extrapolation
    weight : 1 to extrapolate, 0 to store only
    """
    k = r.k
    rows = r.transformed
    weights = r.weights
    dot = 0.0
    square = 0.0
    q = k.shape[0] - 1
    for i in range(q):
        ki = k[i + 1]
        last = rows[i]
        change = rows[q + i]
        for e in range(weights.size):
            d = (ki[e] - last[e]) * weights[e]
            difference = d - change[e] * weights[e]
            dot += d * difference
            square += difference * difference
    # A difference of zero, or values that are not finite, leave the slopes as they are.
    g = (
        weight * max(dot / square, -GREATEST_EXTRAPOLATION)
        if square > 0.0 and square < np.inf
        else 0.0
    )
    for i in range(q):
        ki = k[i + 1]
        last = rows[i]
        change = rows[q + i]
        swept = rows[2 * q + i]
        for e in range(weights.size):
            new = ki[e]
            change[e] = new - last[e]
            ki[e] = new - g * (new - swept[e])
            swept[e] = new


# Matrices q x q behind the Butcher array (`coefficients.py`), and last T^-1 A^-1 a_0 and A^-1 a_0.
T, T_INVERSE, BLOCKS, SLOPES, EXTRAPOLATION, CROUT, START = range(7)
# Rows of the array `transformed`, q rows each: W, F, and the residuals, replaced by the solution dW.
W, F, R = range(3)
# points before a kink, in steps from it, where the defect is checked
DEFECT_POINTS = (-0.1, -1e-2, -1e-3, -1e-4)
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

    The data are listed in `coefficients.transformed`; each of its matrices has q x q entries, row by row.
    s : number of stages, q = s - 1
    """
    return coefficients[s * s + 3 * s + index * (s - 1) * (s - 1) :]


@njit
def blend(base_weight, base, m, at, q, first, rows, target):
    """Write base_weight base + sum over j < q of m[at + j] rows[first + j] to `target`, three terms in each pass.

    m : flat matrix; target, base : float64[n]
    """
    n = target.size
    for j in range(0, q, 3):
        # A missing row is replaced by the last one with weight 0: each pass adds three terms.
        v0 = rows[first + j]
        v1 = rows[first + min(j + 1, q - 1)]
        v2 = rows[first + min(j + 2, q - 1)]
        c0 = m[at + j]
        c1 = m[at + j + 1] if j + 1 < q else 0.0
        c2 = m[at + j + 2] if j + 2 < q else 0.0
        if j > 0:
            for e in range(n):
                target[e] += c0 * v0[e] + (c1 * v1[e] + c2 * v2[e])
        else:
            for e in range(n):
                target[e] = base_weight * base[e] + (c0 * v0[e] + (c1 * v1[e] + c2 * v2[e]))


@njit(inline="always")
def is_pair(blocks, q, b):
    """True if rows b and b + 1 of the block diagonal matrix `blocks` belong to a complex pair of eigenvalues."""
    return b + 1 < q and blocks[(b + 1) * q + b] != 0.0


@inline
def predict(r, h):
    """Predict the transformed stage increments W = T^-1 Z by extrapolation of the slopes of the last step.

    Z : increments of the implicit stages over the start of the step; T : see `coefficients.transformed`
    """
    s = r.k.shape[0]
    h_last = r.state[0]["last"]
    buffer = r.buffer
    q, c = s - 1, nodes_of(r.coefficients, s)
    back, ahead = matrix(r.coefficients, s, T_INVERSE), matrix(r.coefficients, s, EXTRAPOLATION)
    for e in range(q * q):
        buffer[e] = 0.0
    # Weights of the last slopes: T^-1 times their extrapolation to each stage.
    for k in range(q):
        x = c[k + 1] * h / h_last
        for j in range(q):
            w = 0.0
            for d in range(q - 1, -1, -1):
                w = (w + ahead[j * q + d]) * x
            for i in range(q):
                buffer[i * q + j] += back[i * q + k] * w * h_last
    for i in range(q):
        blend(0.0, r.weights, buffer, i * q, q, 1, r.last_stages, r.transformed[i])


@inline
def factor_blocks(r, h):
    """Factor shift I - J for every block (real or complex shift) of L / h, and store the factors one after another.

    L : block diagonal matrix of `coefficients.transformed`; J : Jacobian
    Returns the number of factors, or 0 if a block has no good pivot.
    """
    q = r.k.shape[0] - 1
    b = 0
    real = 0
    pair = r.scale.size
    count = 0
    blocks, size = matrix(r.coefficients, q + 1, BLOCKS), int(r.newton[0]["factor_size"])
    while b < q:
        shift = blocks[b * q + b] / h
        # The factors of the conjugate block are conjugate too, so one complex factorisation serves both.
        if is_pair(blocks, q, b):
            pair_shift = complex(shift, blocks[(b + 1) * q + b] / h)
            pair_factors, address = r.complex_factors[pair:], r.calls[run_handle.PAIR_FACTOR]
            if (
                run_handle.call_factor_complex(
                    address, r.structure, r.jacobian, pair_shift, pair_factors
                )
                != 0
            ):
                return 0
            b, pair = b + 2, pair + size
        else:
            address = r.calls[run_handle.REAL_FACTOR]
            if (
                run_handle.call_factor(address, r.structure, r.jacobian, shift, r.factors[real:])
                != 0
            ):
                return 0
            b, real = b + 1, real + size
        count += 1
    return count


@inline
def solve_blocks(r):
    """Solve (L / h x I - I x J) dW = R with the factors of `factor_blocks`; dW replaces R in `transformed`.

    L : block diagonal matrix of `coefficients.transformed`; J : Jacobian; x : Kronecker product
    """
    q = r.k.shape[0] - 1
    n = r.scale.size
    b = 0
    real = 0
    pair = r.scale.size
    blocks = matrix(r.coefficients, q + 1, BLOCKS)
    size = int(r.newton[0]["factor_size"])
    both = r.complex_factors[:n]
    while b < q:
        u = r.transformed[R * q + b]
        if is_pair(blocks, q, b):
            # Both real rows of a pair are real and imaginary part of a complex vector.
            v = r.transformed[R * q + b + 1]
            for e in range(n):
                both[e] = complex(u[e], v[e])
            address = r.calls[run_handle.PAIR_SOLVE]
            run_handle.call_solve_complex(address, r.structure, r.complex_factors[pair:], both)
            for e in range(n):
                u[e], v[e] = both[e].real, both[e].imag
            b, pair = b + 2, pair + size
        else:
            run_handle.call_solve(r.calls[run_handle.REAL_SOLVE], r.structure, r.factors[real:], u)
            b, real = b + 1, real + size


@inline
def evaluate_stages(handle, r, t, h, now):
    """Write the rates F at all implicit stages to `transformed`, and the ledger rates there.

    `out` receives the status of the last stage whose rates are not valid.
    """
    q = r.k.shape[0] - 1
    y_stage = r.y[3]
    rows = r.transformed
    status = 0.0
    where = -1.0
    c, t_matrix = nodes_of(r.coefficients, q + 1), matrix(r.coefficients, q + 1, T)
    for i in range(q):
        blend(1.0, r.y[now], t_matrix, i * q, q, W * q, rows, y_stage)
        stage_rates(handle, r, t + c[i + 1] * h, y_stage, rows[F * q + i])
        store_ledger_rates(r, i + 1)
        if r.out[rec.STATUS] != 0.0:
            status, where = r.out[rec.STATUS], r.out[rec.PLACE]
    # The later stages have overwritten the status of the faulty one.
    if status != 0.0:
        r.out[rec.STATUS], r.out[rec.PLACE] = status, where
    r.state[0]["newton"] += 1.0


@inline
def residuals(r, h):
    """Write the residuals R = T^-1 (F - K) of all implicit stages to `transformed`."""
    rows = r.transformed
    q = r.k.shape[0] - 1
    n = r.scale.size
    back, blocks = matrix(r.coefficients, q + 1, T_INVERSE), matrix(r.coefficients, q + 1, BLOCKS)
    start = matrix(r.coefficients, q + 1, START)
    # R = T^-1 F + T^-1 A^-1 a_0 k_0 - L W / h, row by row; a row of a pair has two terms of L.
    for i in range(q):
        blend(start[i], r.k[0], back, i * q, q, F * q, rows, rows[R * q + i])
        j = i
        if is_pair(blocks, q, i):
            j = i + 1
        elif i > 0 and blocks[i * q + i - 1] != 0.0:
            j = i - 1
        own, other = -blocks[i * q + i] / h, -blocks[i * q + j] / h if j != i else 0.0
        residual = rows[R * q + i]
        wi = rows[W * q + i]
        wj = rows[W * q + j]
        for e in range(n):
            residual[e] += own * wi[e] + other * wj[e]


@inline
def add_increments(r):
    """Add the increments dW to W; returns the norm of dW in units of the tolerance."""
    rows = r.transformed
    weights = r.weights
    q = r.k.shape[0] - 1
    total = 0.0
    for e in range(weights.size):
        per, part = weights[e], 0.0
        for i in range(q):
            d = rows[R * q + i, e]
            rows[W * q + i, e] += d
            part += d * d
        total += per * per * part
    return sqrt(total / max(q * weights.size, 1))


@inline
def iterate(handle, r, t, h, now):
    """Compute the transformed stage increments W = T^-1 Z by Newton iterations; returns CONVERGED or FAILED.

    W is stored in `transformed`, in place of its prediction.
    Z : increments of the implicit stages over the start of the step; T : see `coefficients.transformed`
    """
    rows = r.transformed
    f = r.rate
    q = r.k.shape[0] - 1
    before = 0.0
    status = iterations.FAILED
    for turn in range(iterations.MOST):
        evaluate_stages(handle, r, t, h, now)
        residuals(r, h)
        solve_blocks(r)
        size = add_increments(r)
        done, status = iterations.convergence(r, turn, size, before)
        before = size
        if done:
            break
    if status == iterations.FAILED:
        # A rate that is not finite in any stage shows in the sum.
        copy(rows[F * q], f)
        for i in range(1, q):
            for e in range(f.size):
                f[e] += rows[F * q + i, e]
        iterations.find_worst(r, rows[R * q], f)
    return status


@inline
def try_stages(handle, r, t, h, now):
    """Solve all stages with the current Jacobian; returns CONVERGED or FAILED.

    Arguments as for `attempt`.
    """
    newton = r.newton[0]
    state = r.state[0]
    q = r.k.shape[0] - 1
    if newton["shift"] != 1.0 / h:
        # A restored shift is negative: its factors were counted before the restart.
        known = newton["shift"] == -1.0 / h
        newton["shift"] = 0.0
        count = factor_blocks(r, h)
        state["factorisations"] += 0.0 if known else count
        if count == 0:
            return iterations.FAILED
        newton["shift"] = 1.0 / h
    # high powers of h / h_last extrapolate badly
    if newton["known_steps"] > 0.0 and (q < 5 or h <= 2.0 * state["last"]):
        predict(r, h)
    else:
        for i in range(q):
            row = r.transformed[W * q + i]
            for e in range(row.size):
                row[e] = 0.0
    return iterate(handle, r, t, h, now)


@inline
def finish(r, h):
    """Compute the slopes k of the stages from their increments W, and correct the ledger rates by the last increment.

    W : transformed increments of `iterate`
    """
    k = r.k
    d = r.increment
    buffer = r.buffer
    rows = r.transformed
    s = r.k.shape[0]
    q = s - 1
    slopes = matrix(r.coefficients, s, SLOPES)
    start = matrix(r.coefficients, s, START)
    # K = T L W / h - A^-1 a_0 k_0
    for e in range(q * q):
        buffer[e] = slopes[e] / h
    for i in range(q):
        blend(-start[q + i], k[0], buffer, i * q, q, W * q, rows, k[i + 1])
        if r.ledger_rates.shape[1] > 0:
            blend(0.0, k[0], matrix(r.coefficients, s, T), i * q, q, R * q, rows, d)
            iterations.book_increment(r, d, i + 1)


@inline
def filtered_error(handle, r, t, now, new, retry):
    """Norm of the embedded error estimate, smoothed by the first Newton factor, in units of the tolerance.

    The error is e = (I - h g J)^-1 h (e_0 f(t, y) + sum of e_i k_i) with the weights e_i of the error estimate and the
    real eigenvalue 1 / g of A^-1 (Hairer and Wanner 1996, IV.8).
    retry : True for a repeated step or the first after a kink; then an error of 1 or more is estimated once more with
    f(t, y + e)
    Other arguments as for `attempt`.
    """
    k = r.k
    d = r.increment
    f = r.rate
    y = r.y[now]
    y_new = r.y[new]
    stage = r.y[3]
    scale = r.scale
    error = error_of(r.coefficients, r.k.shape[0])
    s = r.k.shape[0]
    size = r.control[0]["size"]
    shift, norm = matrix(r.coefficients, s, BLOCKS)[0], 0.0
    for turn in range(2):
        for e in range(y.size):
            total = error[0] * (f[e] if turn == 1 else k[0, e])
            for j in range(1, s):
                total += error[j] * k[j, e]
            d[e] = total * shift
        run_handle.call_solve(r.calls[run_handle.REAL_SOLVE], r.structure, r.factors, d)
        norm = 0.0
        for e in range(y.size):
            w = d[e] / (size * error_scale(scale[e], max(abs(y[e]), abs(y_new[e]))))
            norm += w * w
        norm = sqrt(norm / max(y.size, 1))
        if norm < 1.0 or turn == 1 or not retry:
            break
        for e in range(y.size):
            stage[e] = y[e] + d[e]
        stage_rates(handle, r, t, stage, f)
    return norm


@inline
def defect_at(handle, r, t, h, new, x):
    """Defect of the collocation polynomial at the time x h after the end of the step, as in `defect_before_end`."""
    k = r.k
    buffer = r.buffer
    d = r.increment
    f = r.rate
    scale = r.scale
    y = r.y[new]
    stage = r.y[3]
    q = r.k.shape[0] - 1
    size = r.control[0]["size"]
    total = 0.0
    ahead = matrix(r.coefficients, q + 1, EXTRAPOLATION)
    step = h / matrix(r.coefficients, q + 1, BLOCKS)[0]
    for j in range(q):
        buffer[j], buffer[q + j] = 0.0, 0.0
        for m in range(q - 1, -1, -1):
            buffer[j] = (buffer[j] + ahead[j * q + m]) * x
            buffer[q + j] = buffer[q + j] * x + (m + 1) * ahead[j * q + m]
    for e in range(y.size):
        stage[e] = y[e]
        for j in range(q):
            stage[e] += h * buffer[j] * k[j + 1, e]
    for turn in range(2):
        stage_rates(handle, r, t + (1.0 + x) * h, stage, f)
        for e in range(y.size):
            d[e] = -f[e]
            for j in range(q):
                d[e] += buffer[q + j] * k[j + 1, e]
            w = step * d[e] / (size * error_scale(scale[e], abs(y[e])))
            total = total + w * w if turn == 1 else 0.0
        if turn == 0:
            run_handle.call_solve(r.calls[run_handle.REAL_SOLVE], r.structure, r.factors, d)
            for e in range(y.size):
                stage[e] += d[e]
    return sqrt(total / max(y.size, 1))


@inline
def defect_before_end(handle, r, t, h, new):
    """Greatest defect of the collocation polynomial p just before the end of a step, in units of the tolerance.

    Stages do not show a stiff state that becomes free just before the end, where an opening closes. The defect is
    e = h g (p' - f(p + d)) with d = (I - h g J)^-1 h g (p' - f(p)), where 1 / g is the first real eigenvalue of A^-1.
    It is as small as d if the Jacobian J is valid there; otherwise it is the full defect.
    Arguments as for `attempt`.
    """
    greatest = 0.0
    for x in DEFECT_POINTS:
        greatest = max(greatest, defect_at(handle, r, t, h, new, x))
    return greatest


@inline
def step_error(handle, r, t, h, now, new, retry):
    """Error of a step in units of the tolerance; arguments as for `attempt` and `filtered_error`."""
    s, error = r.k.shape[0], error_of(r.coefficients, r.k.shape[0])
    collocates = error[0] != 0.0 and matrix(r.coefficients, s, START)[0] == 0.0
    if r.newton[0]["damped_step"] == r.state[0]["steps"]:
        shift = matrix(r.coefficients, s, BLOCKS)[0] / h
        size = iterations.smoothed_error(handle, r, t, h, now, new, error, shift)
    elif collocates:
        size = filtered_error(handle, r, t, now, new, retry)
    else:
        size = error_norm(r, h, now, new)
    # Only at the end of a segment, where an opening may close.
    if collocates and 0.0 <= size <= 1.0 and h >= (r.control[0]["end"] - t) * (1.0 - 1e-9):
        size = max(size, DEFECT_WEIGHT * defect_before_end(handle, r, t, h, new))
    return size


@njit
def attempt(handle, run, t, h, now, new):
    """Compute y[new] and the stages k from y[now] and k[0] = f(t, y[now]); returns the error in units of the tolerance.

    The error is 0 unless the step is under error control, and NEWTON_FAILED if Newton with a fresh Jacobian and the
    sweeps of `irk` fail. Arguments as for `erk.attempt`.
    """
    r = open_run(run)
    y = r.y[now]
    state = r.state[0]
    newton = r.newton[0]
    s = r.k.shape[0]
    # a repeated step, or the first after a kink
    retry = newton["stages_step"] == state["steps"] or newton["stages_step"] < 0.0
    iterations.begin(r, now)
    while True:
        if newton["has_jacobian"] == 0.0:
            iterations.renew_at_start(handle, r, t, now)
            if r.control[0]["watch"] != 0:
                state["radius"] = iterations.spectral_radius(r)
        if try_stages(handle, r, t, h, now) == iterations.CONVERGED:
            finish(r, h)
            break
        if newton["jacobian_step"] == state["steps"]:
            # A shorter step costs less than sweeps.
            if r.progress[0]["no_sweeps"] == 1:
                return rec.NEWTON_FAILED
            status = sweep(handle, r, matrix(r.coefficients, s, CROUT), t, h, now)
            newton["shift"] = 0.0  # the factors are those of a stage
            if status == iterations.FAILED:
                return rec.NEWTON_FAILED
            break
        newton["has_jacobian"] = 0.0
    combine(0, y.size, y, h, weights_of(r.coefficients, s), s, r.k, r.y[new])
    if r.control[0]["mode"] != rec.TOLERANCE:
        return 0.0
    return step_error(handle, r, t, h, now, new, retry)
