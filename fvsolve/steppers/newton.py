"""Newton iterations of implicit steps: renewal of the Jacobian and its factors, stopping tests, damping.

Simplified Newton with the Jacobian at the start of the step is used as long as it converges. Where the slope of f
changes by orders of magnitude within a step, as the slope of a valve does near zero pressure drop, the iterates
oscillate. Then Newton is damped, with a new Jacobian for every iterate.

Three data are kept between steps and stored for a restart (`Integrator.restart_arrays`): the array `work` with a header
and the Jacobian, the rate f at the start of the last step, and the stages of the last step. A resumed run factors
again; Jacobian and shift determine the factors to the bit.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from fvsolve.jit import inline
from fvsolve.steppers.differences import differences, multiply
from fvsolve.steppers.loop_indices import (
    CALLS,
    CONTROL,
    CONVERGENCE_FACTOR,
    DAMPED_STEP,
    FACTOR_SIZE,
    FACTORS,
    HAS_JACOBIAN,
    HEADER,
    INCREMENT_RATIO,
    JACOBIAN_STEP,
    JACOBIANS,
    KNOWN_STEPS,
    LAST,
    NEWTON,
    NEWTON_FAILED,
    SHIFT,
    SIZE,
    STAGES_STEP,
    STEPS,
    TOLERANCE,
    WORST,
)
from fvsolve.steppers.step_operations import copy, error_scale

# Rows of `vectors` after the s stages of the last step: f at its start, an increment, weights, two rows for
# differences, base of a stage (Rosenbrock: df/dt), fallback slope; then, for fully implicit methods, transformed
# increments, f and residuals of all stages.
FIRST, INCREMENT, WEIGHTS, MOVED, RATE, BASE, FALLBACK, STAGES = range(8)

MOST = 10  # greatest number of iterations
# For given steps, relative: target accuracy, error that counts as rounding, and greatest error accepted.
FIXED, ROUNDED, FLOOR = 1e-13, 1e-10, 1e-7
STOP_FRACTION = 0.05  # fraction of the tolerance at which Newton stops
STALE = 0.03  # ratio of successive increments above which the Jacobian is renewed for the next step
CONVERGED, FAILED = 0, 1
MOST_DAMPED, LEAST_PART = 40, 1e-4  # greatest number of damped iterations, least damping factor
LEAST_STAGE_PART = 1 / 64  # least fraction of a step over which `solve_stage_from_start` continues a stage


def reset(work: np.ndarray) -> None:
    """Discard the Jacobian and the earlier stages at a kink."""
    work[:FACTOR_SIZE] = 0.0
    work[STAGES_STEP] = work[DAMPED_STEP] = -1.0
    work[CONVERGENCE_FACTOR] = 1.0


@inline
def begin(k, y, scale, controls, loop_state, work, vectors):
    """Prepare the first attempt of a step: store the last stages for prediction, discard a slow Jacobian.

    The weights of increments, 1 over the tolerance of each state, are written to `vectors`. Repeated attempts change
    nothing.
    A Jacobian is slow if the greatest ratio of successive Newton increments in the last step was above STALE.
    Arguments as for `dirk.attempt`; y : state at the start of the step.
    """
    s, n = k.shape
    if work[STAGES_STEP] == loop_state[STEPS]:
        return
    tolerance = controls[SIZE] if controls[CONTROL] == TOLERANCE else FIXED
    weights, first, last = vectors[s + WEIGHTS], vectors[s + FIRST], vectors[0]
    for i in range(n):
        weights[i] = 1.0 / (tolerance * error_scale(scale[i], y[i]))
        last[i], first[i] = first[i], k[0, i]
    for j in range(1, s):
        copy(k[j], vectors[j])
    follows = work[STAGES_STEP] == loop_state[STEPS] - 1.0 and loop_state[LAST] > 0.0
    work[KNOWN_STEPS] = min(work[KNOWN_STEPS] + 1.0, 2.0) if follows else 0.0
    if work[INCREMENT_RATIO] > STALE:
        work[HAS_JACOBIAN] = 0.0
    work[STAGES_STEP], work[INCREMENT_RATIO] = loop_state[STEPS], 0.0


@inline
def renew(rhs, handle, structure, ledger_offset, t, y, f, ledger_rates, scale, out, loop_state, work, moved, rate):
    """Compute the Jacobian at (t, y) and store it in `work`.

    f, ledger_rates : rates evaluated at (t, y); moved, rate : float64[n]  work arrays for a state and its rates
    Other arguments as for `dirk.attempt`.
    """
    calls = differences(
        rhs, handle, structure, ledger_offset, t, y, f, ledger_rates, scale, moved, rate, out, work[HEADER:]
    )
    loop_state[CALLS] += calls
    loop_state[JACOBIANS] += 1.0
    work[HAS_JACOBIAN], work[JACOBIAN_STEP], work[SHIFT], work[INCREMENT_RATIO] = 1.0, loop_state[STEPS], 0.0, 0.0


@inline
def spectral_radius(structure, work, nnz, scale, v):
    """Approximate largest |eigenvalue| of the Jacobian in `work`, by five iterations of the power method.

    nnz : number of Jacobian entries; scale : float64[n]  sizes of the states; v : float64[n]  work array
    """
    n, product, before, now = v.size, work[HEADER + nnz :], 0.0, 0.0
    for e in range(n):
        v[e] = scale[e] if e % 2 == 0 else -scale[e]
    for _ in range(5):
        multiply(structure, work[HEADER : HEADER + nnz], v, product)
        total = 0.0
        for e in range(n):
            total += (product[e] / scale[e]) * (product[e] / scale[e])
        before, now = now, sqrt(total)
        for e in range(n):
            v[e] = product[e] / now if now > 0.0 else 0.0
    return sqrt(before * now)  # for a complex pair the single quotients oscillate


@inline
def size_of(d, weights):
    """Sum of squares of an increment d, with weights that express it in units of the tolerance."""
    total = 0.0
    for i in range(weights.size):
        total += (d[i] * weights[i]) * (d[i] * weights[i])
    return total


@inline
def next_increment(d, other, weights):
    """(component of the next increment `other` along the increment d, its squared length), both relative to d.

    The results are <d, other> / <d, d> and |other|^2 / |d|^2, with the given weights of the states.
    """
    square = dot = size = 0.0
    for i in range(weights.size):
        w = weights[i] * weights[i]
        square += w * d[i] * d[i]
        dot += w * d[i] * other[i]
        size += w * other[i] * other[i]
    return dot / square, size / square


@inline
def damping_factor(part, ahead, size):
    """Damping factor of an increment after a trial with the factor `part`; it equals `part` if the trial is accepted.

    ahead, size : results of `next_increment` for the next increment, computed with the same Jacobian factors
    The trial is accepted if the next increment is at most 1 - part / 4 times as long, or if 0 <= ahead <= 1. If the
    next increment is reversed, the factor follows from the secant rule (natural monotonicity: Deuflhard 2004, 3.3).
    """
    if not size < np.inf:
        return 0.25 * part
    if 0.0 <= ahead <= 1.0 or size <= (1.0 - 0.25 * part) ** 2:
        return part
    if ahead > 1.0:  # the increment has grown: go to the minimum of the parabola through both ends
        return part * min(0.5, max(0.1, 0.5 * part / (ahead - 1.0 + part)))
    return part * min(0.7, max(0.1, 1.0 / (1.0 - ahead)))


@inline
def stop_limits(controls):
    """(size of the increment at which Newton may stop, size that counts as rounding), in units of the tolerance.

    controls : array of the time loop, see `loop_indices`
    """
    if controls[CONTROL] == TOLERANCE:
        enough = max(1e-15 / controls[SIZE], STOP_FRACTION)
        return enough, enough
    return 1.0, ROUNDED / FIXED


@inline
def damped_limits(controls):
    """(increment at which damped Newton stops, increment that counts as rounding, greatest increment accepted).

    All are in units of the tolerance. Newton is as accurate as for steps of given length, because f amplifies the
    Newton residual. controls : array of the time loop, see `loop_indices`
    """
    unit = controls[SIZE] if controls[CONTROL] == TOLERANCE else FIXED
    floor = stop_limits(controls)[1] if controls[CONTROL] == TOLERANCE else FLOOR / unit
    return FIXED / unit, min(ROUNDED / unit, floor), floor


@inline
def find_worst(d, f, weights, loop_state):
    """Store in loop_state[WORST] a state whose rate f is not finite, or the state with the greatest increment d.

    weights : factors that express increments in units of the tolerance
    """
    worst = -1.0
    for i in range(weights.size):
        e = abs(d[i] * weights[i]) if abs(f[i]) < np.inf else np.inf
        if e > worst:  # a rate that is not a number makes other increments NaN as well
            worst, loop_state[WORST] = e, i


@inline
def convergence(turn, size, before, controls, work):
    """(True to stop after Newton iteration `turn`, CONVERGED or FAILED).

    size, before : norms of this and of the previous increment, in units of the tolerance
    controls, work : as for `dirk.attempt`; the ratio of increments and its factor are stored in `work`
    """
    enough, rounded = stop_limits(controls)
    if not size < np.inf:
        return True, FAILED
    if turn > 0:
        ratio = size / before if before > 0.0 else 0.0
        work[INCREMENT_RATIO] = max(work[INCREMENT_RATIO], ratio)
        if ratio >= 0.3 and size <= rounded:
            return True, CONVERGED
        if ratio >= 0.99:
            return True, FAILED
        work[CONVERGENCE_FACTOR] = ratio / (1.0 - ratio)
        if work[CONVERGENCE_FACTOR] * size * ratio ** (MOST - 1 - turn) > rounded:
            return True, FAILED
    else:
        work[CONVERGENCE_FACTOR] = max(work[CONVERGENCE_FACTOR], 1e-4) ** 0.8
    if work[CONVERGENCE_FACTOR] * size <= enough:
        return True, CONVERGED
    return turn == MOST - 1, CONVERGED if turn > 0 and work[CONVERGENCE_FACTOR] * size <= rounded else FAILED


@inline
def book_increment(structure, nnz, d, ledger_rates, i, work):
    """Correct the ledger rates of stage i by their change J d, with the last increment d of the state of the stage.

    J : Jacobian in `work`; nnz : number of its entries; structure : flat array of `Structure.shape`
    """
    n, product = d.size, work[HEADER + nnz :]
    multiply(structure, work[HEADER : HEADER + nnz], d, product)
    for m in range(ledger_rates.shape[1]):
        ledger_rates[i, m] += product[n + m]


@inline
def evaluate(rhs, handle, t, h_gamma, base, ki, y_stage, f, out, loop_state, residual):
    """Write the rates at the state base + h_gamma ki of a stage with slope ki to f, and f - ki to `residual`.

    t : time of the stage; base : state from earlier stages; h_gamma : step times the diagonal coefficient of the method
    y_stage : float64[n]  receives the state; other arguments as for `dirk.attempt`
    """
    for j in range(ki.size):
        y_stage[j] = base[j] + h_gamma * ki[j]
    rhs(t, y_stage, f, out, handle)
    loop_state[CALLS] += 1.0
    loop_state[NEWTON] += 1.0
    for j in range(ki.size):
        residual[j] = f[j] - ki[j]


@inline
def damped_newton(
    rhs, factor, solve, handle, structure, t, h_gamma, i, k, y_stage, ledger_rates, ledger_offset, out, scale, controls,
    loop_state, nnz, work, vectors, factors,
):  # fmt: skip
    """Solve stage i, k[i] = f(t, base + h_gamma k[i]), by damped Newton, with a new Jacobian for every iterate.

    The iteration starts from k[i].
    t : time of the stage; base : state from earlier stages, in `vectors`
    h_gamma : step times the diagonal coefficient of the method; nnz : number of Jacobian entries
    Returns CONVERGED or FAILED. Other arguments as for `dirk.attempt`.
    """
    s, n = k.shape
    base, d, f, weights = vectors[s + BASE], vectors[s + INCREMENT], vectors[s + RATE], vectors[s + WEIGHTS]
    other, shift, ki = vectors[s + MOVED], 1.0 / h_gamma, k[i]
    enough, rounded, floor = damped_limits(controls)
    before = np.inf
    evaluate(rhs, handle, t, h_gamma, base, ki, y_stage, f, out, loop_state, d)
    for turn in range(MOST_DAMPED):
        for m in range(ledger_rates.shape[1]):
            ledger_rates[i, m] = out[ledger_offset + m]
        renew(
            rhs,
            handle,
            structure,
            ledger_offset,
            t,
            y_stage,
            f,
            ledger_rates[i],
            scale,
            out,
            loop_state,
            work,
            other,
            d,
        )
        loop_state[FACTORS] += 1.0
        if factor(structure, work[HEADER:], shift, factors) != 0:
            break
        work[SHIFT] = shift
        for j in range(n):
            d[j] = f[j] - ki[j]
        solve(structure, factors, d)
        size = sqrt(size_of(d, weights) / max(n, 1))
        done = size <= enough or size <= rounded and size >= 0.5 * before or size <= floor and turn == MOST_DAMPED - 1
        part, tried, length, before = 1.0, 0.0, 0.0, size
        while not done and part != tried and part > LEAST_PART:
            for j in range(n):
                ki[j] += shift * (part - tried) * d[j]
            evaluate(rhs, handle, t, h_gamma, base, ki, y_stage, f, out, loop_state, other)
            if size <= rounded:  # the direction of the next increment is rounding
                tried = part
                break
            solve(structure, factors, other)
            ahead, length = next_increment(d, other, weights)
            tried, part = part, damping_factor(part, ahead, length)
        if part != tried and size <= floor and length < np.inf:  # rounding, or a kink between the iterates
            done = True
        if done:
            for j in range(n):
                ki[j] += shift * (1.0 - tried) * d[j]
            book_increment(structure, nnz, d, ledger_rates, i, work)
            work[DAMPED_STEP], work[INCREMENT_RATIO], work[CONVERGENCE_FACTOR] = loop_state[STEPS], 1.0, 1.0
            return CONVERGED
        if part != tried or not size < np.inf:
            break
    find_worst(d, f, weights, loop_state)
    work[HAS_JACOBIAN] = 0.0
    return FAILED


@inline
def solve_stage_from_start(
    rhs, factor, solve, handle, structure, t, h_gamma, i, k, y, y_stage, ledger_rates, ledger_offset, out, scale,
    controls, loop_state, nnz, work, vectors, factors,
):  # fmt: skip
    """Solve a stage by `damped_newton`, if necessary from other starting values; returns CONVERGED or FAILED.

    If the first try fails in a step of given length, the iteration starts again from the state y, and then follows the
    solution from a step of zero length. Under error control a shorter step is cheaper, so there is only one try.
    y : state at the start of the step; other arguments as for `damped_newton`
    """
    base, reached, ki = vectors[k.shape[0] + BASE], vectors[k.shape[0] + FALLBACK], k[i]
    done, part, turn, worst = 0.0, 1.0, 0, loop_state[WORST]  # WORST keeps the result of simplified Newton
    while part >= LEAST_STAGE_PART:
        if turn == 1:
            for j in range(ki.size):
                ki[j] = (y[j] - base[j]) / h_gamma
        elif turn > 1:
            copy(reached, ki)
        status = damped_newton(
            rhs, factor, solve, handle, structure, t, h_gamma * (done + part), i, k, y_stage, ledger_rates,
            ledger_offset, out, scale, controls, loop_state, nnz, work, vectors, factors,
        )  # fmt: skip
        if status == CONVERGED:
            done += part
            if done == 1.0:
                return CONVERGED
            copy(ki, reached)
        elif controls[CONTROL] == TOLERANCE:
            return FAILED
        elif turn == 0:
            for j in range(ki.size):
                reached[j] = 0.0
        else:
            part *= 0.5
        loop_state[WORST] = worst
        turn += 1
    return FAILED


@inline
def smoothed_error(
    rhs, factor, solve, handle, structure, ledger_offset, t, h, y, y_new, k, ledger_rates, error, shift, scale, out,
    controls, loop_state, work, vectors, factors,
):  # fmt: skip
    """Error of a step that damped Newton has solved, in units of the tolerance.

    It is the norm of (I - J / shift)^-1 h sum e_j k_j. J is the Jacobian at the start of the step, and `error` contains
    the weights e_j. The matrix reduces the error of stiff components (Hosea and Shampine 1996). If it reverses the
    error, because J jumps, the unfiltered error is used. Returns NEWTON_FAILED if the matrix is singular.
    y, y_new : states at the start and the end of the step; other arguments as for `dirk.attempt`
    """
    s, n = k.shape
    d, f, plain, dot, smooth = vectors[s + INCREMENT], vectors[s + RATE], 0.0, 0.0, 0.0
    renew(
        rhs,
        handle,
        structure,
        ledger_offset,
        t,
        y,
        k[0],
        ledger_rates[0],
        scale,
        out,
        loop_state,
        work,
        vectors[s + MOVED],
        f,
    )
    loop_state[FACTORS] += 1.0
    work[INCREMENT_RATIO] = 1.0
    if factor(structure, work[HEADER:], shift, factors) != 0:
        return NEWTON_FAILED
    for i in range(n):
        f[i] = 0.0
        for j in range(s):
            f[i] += h * error[j] * k[j, i]
        d[i] = shift * f[i]
    solve(structure, factors, d)
    for i in range(n):
        w = 1.0 / (controls[SIZE] * (scale[i] + max(abs(y[i]), abs(y_new[i]))))
        plain += (w * f[i]) * (w * f[i])
        dot += (w * f[i]) * (w * d[i])
        smooth += (w * d[i]) * (w * d[i])
    return sqrt((smooth if dot > 0.0 else plain) / max(n, 1))
