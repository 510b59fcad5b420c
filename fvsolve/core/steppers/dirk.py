"""One diagonally implicit Runge-Kutta step; simplified Newton solves one stage after another."""

from math import sqrt

from fvsolve.core.steppers import loop_records as rec
from fvsolve.core.steppers import newton as iterations
from fvsolve.core.steppers.coefficients import error_of, nodes_of, row_of, weights_of
from fvsolve.core.steppers.run_handle import (
    REAL_SOLVE,
    call_solve,
    note_stage,
    open_run,
    stage_rates,
    store_ledger_rates,
)
from fvsolve.core.steppers.step_operations import combine, copy, error_norm
from fvsolve.jit import inline, njit


@inline
def predict(b, c, x, first, last_stages, k):
    """Predict the slope k of a stage at the time x h_last after the last step, whose length is h_last.

    The prediction is the slope of a parabola through both ends of the last step, with the slope at its end. The slope
    at the end is the slope of the last stage if c_s = 1, because a new evaluation of a stiff f would amplify the Newton
    residual; otherwise it is `first`, the rate f.
    b, c : weights and nodes of the method; last_stages : slopes of the stages of the last step
    """
    s, n = b.size, k.size
    slopes = last_stages[s - 1] if c[s - 1] == 1.0 else first
    for i in range(n):
        k[i] = slopes[i] * (1.0 + 2.0 * x)
    for j in range(s):
        if b[j] != 0.0:
            w, last = 2.0 * x * b[j], last_stages[j]
            for i in range(n):
                k[i] -= w * last[i]


@inline
def solve_stage(handle, r, t, h_gamma, i):
    """Solve stage i, k[i] = f(t, base + h_gamma k[i]), by Newton iterations; returns CONVERGED or FAILED.

    t : time of the stage; base : state from earlier stages; h_gamma : step times the diagonal coefficient of the method
    The stored stage is exactly f + J d with the last increment d, so it conserves the quantities that f and the
    Jacobian J conserve.
    """
    d = r.increment
    before = 0.0
    status = iterations.FAILED
    shift = 1.0 / h_gamma
    ki = r.k[i]
    for turn in range(iterations.MOST):
        iterations.evaluate_stage(handle, r, t, h_gamma, ki, d)
        call_solve(r.calls[REAL_SOLVE], r.structure, r.factors, d)
        for j in range(ki.size):
            ki[j] += shift * d[j]
        size = sqrt(iterations.size_of(d, r.weights) / max(ki.size, 1))
        done, status = iterations.convergence(r, turn, size, before)
        before = size
        if done:
            break
    if status == iterations.FAILED:
        iterations.find_worst(r, d, r.rate)
    elif r.ledger_rates.shape[1] > 0:
        store_ledger_rates(r, i)
        iterations.book_increment(r, d, i)
    return status


@inline
def try_stages(handle, r, t, h, now):
    """Solve all stages with the current Jacobian; returns CONVERGED or FAILED.

    A stage that fails is solved again by damped Newton if the Jacobian is of this step. Arguments as for `attempt`.
    """
    state = r.state[0]
    k = r.k
    y = r.y[now]
    base = r.base
    s = r.k.shape[0]
    fresh = r.newton[0]["jacobian_step"] == state["steps"]
    adaptive = r.control[0]["mode"] == rec.TOLERANCE
    c, b = nodes_of(r.coefficients, s), weights_of(r.coefficients, s)
    for i in range(1, s):
        row, ki = row_of(r.coefficients, s, i), k[i]
        combine(0, y.size, y, h, row, i, k, base)
        # An explicit first stage has no equation to solve.
        if row[i] == 0.0:
            stage_rates(handle, r, t + c[i] * h, base, ki)
            note_stage(r)
            store_ledger_rates(r, i)
            continue
        shift = 1.0 / (h * row[i])
        if iterations.factor_for(r, shift) != 0:
            return iterations.FAILED
        if r.newton[0]["known_steps"] > 0.0:
            predict(b, c, c[i] * h / state["last"], k[0], r.last_stages, ki)
        else:
            # No earlier step is known, so the slope of the stage before is the best start.
            copy(k[i - 1], ki)
        status = solve_stage(handle, r, t + c[i] * h, h * row[i], i)
        if status == iterations.FAILED and fresh:
            if adaptive:
                # The iterate has diverged: damped Newton starts from the state at the start of the step.
                for j in range(y.size):
                    ki[j] = shift * (y[j] - base[j])
            status = iterations.solve_stage_from_start(handle, r, t + c[i] * h, h * row[i], i, y)
        if status == iterations.FAILED:
            return iterations.FAILED
    return iterations.CONVERGED


@njit
def attempt(handle, run, t, h, now, new):
    """Compute y[new] and the stages k from y[now] and k[0] = f(t, y[now]); returns the error in units of the tolerance.

    The error is 0 unless the step is under error control, and NEWTON_FAILED if simplified and damped Newton fail with a
    fresh Jacobian. Arguments as for `erk.attempt`.
    """
    r = open_run(run)
    k = r.k
    y = r.y[now]
    state = r.state[0]
    newton = r.newton[0]
    s, error = k.shape[0], error_of(r.coefficients, k.shape[0])
    iterations.begin(r, now)
    while True:
        if newton["has_jacobian"] == 0.0:
            iterations.renew_at_start(handle, r, t, now)
        if try_stages(handle, r, t, h, now) == iterations.CONVERGED:
            break
        # Only a failure with a fresh Jacobian ends the attempt.
        if newton["jacobian_step"] == state["steps"]:
            return rec.NEWTON_FAILED
        newton["has_jacobian"] = 0.0
    combine(0, y.size, y, h, weights_of(r.coefficients, s), s, k, r.y[new])
    if r.control[0]["mode"] != rec.TOLERANCE:
        return 0.0
    if newton["damped_step"] == state["steps"]:
        shift = 1.0 / (h * row_of(r.coefficients, s, s - 1)[s - 1])
        return iterations.smoothed_error(handle, r, t, h, now, new, error, shift)
    return error_norm(r, h, now, new)
