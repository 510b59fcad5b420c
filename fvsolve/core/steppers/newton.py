"""Newton iterations of implicit steps: renewal of the Jacobian and its factors, stopping tests, damping.

Simplified Newton with the Jacobian at the start of the step is used as long as it converges. Where the slope of f
changes by orders of magnitude within a step, as the slope of a valve does near zero pressure drop, the iterates
oscillate. Then Newton is damped, with a new Jacobian for every iterate.

Four arrays are kept between steps and stored for a restart (`Integrator.restart_arrays`): the record `newton`, the
Jacobian, the rate f at the start of the last step, and the stages of the last step. A resumed run factors again;
Jacobian and shift determine the factors to the bit.
The functions have these arguments: handle : handle of the model; r : open handle of the run; t, h : start and length of
a step; now, new : rows of y at its start and its end; i : number of a stage.
"""

from math import sqrt

import numpy as np

from fvsolve.core.steppers import loop_records as rec
from fvsolve.core.steppers import run_handle
from fvsolve.core.steppers.run_handle import stage_rates, store_ledger_rates
from fvsolve.core.steppers.step_operations import copy, error_scale
from fvsolve.core.steppers.structure import differences, multiply
from fvsolve.jit import inline

MOST = 10  # greatest number of iterations
# For given steps, relative: target accuracy, error that counts as rounding, and greatest error accepted.
FIXED, ROUNDED, FLOOR = 1e-13, 1e-10, 1e-7
STOP_FRACTION = 0.05  # fraction of the tolerance at which Newton stops
STALE = 0.03  # ratio of successive increments above which the Jacobian is renewed for the next step
CONVERGED, FAILED = 0, 1
MOST_DAMPED, LEAST_PART = 40, 1e-4  # greatest number of damped iterations, least damping factor
# least fraction of a step over which `solve_stage_from_start` continues a stage
LEAST_STAGE_PART = 1 / 64


def reset(newton: np.void) -> None:
    """Discard the Jacobian and the earlier stages at a kink; newton : record of Newton iterations."""
    for name in ("has_jacobian", "jacobian_step", "known_steps", "shift", "increment_ratio"):
        newton[name] = 0.0
    newton["stages_step"] = newton["damped_step"] = -1.0
    newton["convergence_factor"] = 1.0


@inline
def begin(r, now):
    """Prepare the first attempt of a step: store the last stages for prediction, discard a slow Jacobian.

    The weights of increments, 1 over the tolerance of each state, are stored too. Repeated attempts change nothing.
    A Jacobian is slow if the greatest ratio of successive Newton increments in the last step was above STALE.
    r : open handle of the run; now : row of y at the start of the step
    """
    state = r.state[0]
    newton = r.newton[0]
    control = r.control[0]
    k = r.k
    scale = r.scale
    y = r.y[now]
    # A repeated attempt: the stages of the last step are already stored, and k holds failed ones.
    if newton["stages_step"] == state["steps"]:
        return
    tolerance = control["size"] if control["mode"] == rec.TOLERANCE else FIXED
    weights = r.weights
    first = r.first
    last = r.last_stages[0]
    rates = k[0]
    for i in range(rates.size):
        weights[i] = 1.0 / (tolerance * error_scale(scale[i], y[i]))
        last[i], first[i] = first[i], rates[i]
    for j in range(1, k.shape[0]):
        copy(k[j], r.last_stages[j])
    follow_stages(state, newton)
    # Newton converged slowly in the last step: its Jacobian is out of date.
    if newton["increment_ratio"] > STALE:
        newton["has_jacobian"] = 0.0
    newton["increment_ratio"] = 0.0


@inline
def follow_stages(state, newton):
    """Count the earlier steps whose stages are known, and store the number of the present step."""
    follows = newton["stages_step"] == state["steps"] - 1.0 and state["last"] > 0.0
    newton["known_steps"] = min(newton["known_steps"] + 1.0, 2.0) if follows else 0.0
    newton["stages_step"] = state["steps"]


@inline
def renew(handle, r, t, y, f, ledger_rates, f_work):
    """Compute the Jacobian at (t, y) and store it in `jacobian`.

    f, ledger_rates : rates evaluated at (t, y); f_work : float64[n]  work array for rates
    """
    newton, state = r.newton[0], r.state[0]
    differences(stage_rates, handle, r, t, y, f, ledger_rates, f_work)
    state["jacobians"] += 1.0
    newton["has_jacobian"], newton["jacobian_step"] = 1.0, state["steps"]
    # The factors belong to the old Jacobian.
    newton["shift"] = newton["increment_ratio"] = 0.0


@inline
def renew_at_start(handle, r, t, now):
    """Compute the Jacobian at the start of the step, from row `now` of y and the first stage.

    The states of its differences are next to an accepted one, from which iterations within f start: they may stop
    sooner.
    """
    r.out[rec.NEARBY] = 1.0
    renew(handle, r, t, r.y[now], r.k[0], r.ledger_rates[0], r.rate)
    r.out[rec.NEARBY] = 0.0


@inline
def factor_for(r, shift):
    """Factor the matrix shift I - J for the real shift of a stage, if it is not that of the last factors.

    Returns 0, or 1 + the number of a state without a good pivot. A resumed run factors again without counting it.
    """
    newton = r.newton[0]
    if newton["shift"] == shift:
        return 0
    # A restored shift is negative: its factors were counted before the restart.
    r.state[0]["factorisations"] += 0.0 if newton["shift"] == -shift else 1.0
    # Until the factors are complete, none are valid.
    newton["shift"] = 0.0
    bad = run_handle.call_factor(
        r.calls[run_handle.REAL_FACTOR], r.structure, r.jacobian, shift, r.factors
    )
    if bad == 0:
        newton["shift"] = shift
    return bad


@inline
def spectral_radius(r):
    """Approximate largest |eigenvalue| of the Jacobian, by five iterations of the power method."""
    v = r.increment
    product = r.product
    scale = r.scale
    before = 0.0
    now = 0.0
    for e in range(v.size):
        # Alternating signs contain the shortest waves of a grid, which are its fastest modes.
        v[e] = scale[e] if e % 2 == 0 else -scale[e]
    for _ in range(5):
        multiply(r.structure, r.jacobian, v, product)
        total = 0.0
        for e in range(v.size):
            total += (product[e] / scale[e]) * (product[e] / scale[e])
        before, now = now, sqrt(total)
        for e in range(v.size):
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
    # The trial has left the range in which f is defined.
    if not size < np.inf:
        return 0.25 * part
    if 0.0 <= ahead <= 1.0 or size <= (1.0 - 0.25 * part) ** 2:
        return part
    if ahead > 1.0:  # the increment has grown: go to the minimum of the parabola through both ends
        return part * min(0.5, max(0.1, 0.5 * part / (ahead - 1.0 + part)))
    return part * min(0.7, max(0.1, 1.0 / (1.0 - ahead)))


@inline
def stop_limits(control):
    """(size of the increment at which Newton may stop, size that counts as rounding), in units of the tolerance."""
    if control["mode"] == rec.TOLERANCE:
        enough = max(1e-15 / control["size"], STOP_FRACTION)
        return enough, enough
    return 1.0, ROUNDED / FIXED


@inline
def damped_limits(control):
    """(increment at which damped Newton stops, increment that counts as rounding, greatest increment accepted).

    All are in units of the tolerance. Newton is as accurate as for steps of given length, because f amplifies the
    Newton residual.
    """
    unit = control["size"] if control["mode"] == rec.TOLERANCE else FIXED
    floor = stop_limits(control)[1] if control["mode"] == rec.TOLERANCE else FLOOR / unit
    return FIXED / unit, min(ROUNDED / unit, floor), floor


@inline
def find_worst(r, d, f):
    """Store as `worst` a state whose rate f is not finite, or the state with the greatest increment d."""
    weights = r.weights
    worst = -1.0
    at = r.state[0]["worst"]
    for i in range(weights.size):
        e = abs(d[i] * weights[i]) if abs(f[i]) < np.inf else np.inf
        if e > worst:  # a rate that is not a number makes other increments NaN as well
            worst, at = e, float(i)
    r.state[0]["worst"] = at


@inline
def convergence(r, turn, size, before):
    """(True to stop after Newton iteration `turn`, CONVERGED or FAILED).

    size, before : norms of this and of the previous increment, in units of the tolerance
    The greatest ratio of increments and the convergence factor are stored. A stage whose rates are not valid (its
    status in `out`) is not solved.
    """
    newton, (enough, rounded) = r.newton[0], stop_limits(r.control[0])
    valid = CONVERGED if r.out[rec.STATUS] == 0.0 else FAILED
    if not size < np.inf:
        return True, FAILED
    if turn > 0:
        ratio = size / before if before > 0.0 else 0.0
        newton["increment_ratio"] = max(newton["increment_ratio"], ratio)
        # Tiny increments that hardly fall any more are rounding.
        if ratio >= 0.3 and size <= rounded:
            return True, valid
        if ratio >= 0.99:
            return True, FAILED
        factor = ratio / (1.0 - ratio)
        newton["convergence_factor"] = factor
        # At this rate the increments left would not fall to the limit (Hairer and Wanner 1996, IV.8).
        if factor * size * ratio ** (MOST - 1 - turn) > rounded:
            return True, FAILED
    else:
        # No ratio is known yet: that of the last stage, moved towards 1 (Hairer and Wanner 1996, IV.8).
        factor = max(newton["convergence_factor"], 1e-4) ** 0.8
        newton["convergence_factor"] = factor
    if factor * size <= enough:
        return True, valid
    return turn == MOST - 1, valid if turn > 0 and factor * size <= rounded else FAILED


@inline
def book_increment(r, d, i):
    """Correct the ledger rates of stage i by their change J d, with the last increment d of the state of the stage."""
    product, ledger_rates = r.product, r.ledger_rates
    multiply(r.structure, r.jacobian, d, product)
    for m in range(ledger_rates.shape[1]):
        ledger_rates[i, m] += product[d.size + m]


@inline
def evaluate_stage(handle, r, t, h_gamma, ki, residual):
    """Write the rates at the state base + h_gamma ki of a stage with slope ki to `rate`, and their excess over ki.

    t : time of the stage; h_gamma : step times the diagonal coefficient of the method; y[3] receives the state
    residual : float64[n]  receives rate - ki
    """
    y_stage = r.y[3]
    base = r.base
    f = r.rate
    for j in range(ki.size):
        y_stage[j] = base[j] + h_gamma * ki[j]
    stage_rates(handle, r, t, y_stage, f)
    r.state[0]["newton"] += 1.0
    for j in range(ki.size):
        residual[j] = f[j] - ki[j]


@inline
def damped_increment(handle, r, t, h_gamma, i):
    """Compute the Newton increment of stage i with a new Jacobian; returns its norm in units of the tolerance, or -1.

    The increment is stored in `increment`; `rate` contains the rates of the stage. -1 : the matrix is singular.
    """
    d = r.increment
    f = r.rate
    ki = r.k[i]
    shift = 1.0 / h_gamma
    newton = r.newton[0]
    status, where = r.out[rec.STATUS], r.out[rec.PLACE]
    store_ledger_rates(r, i)
    renew(handle, r, t, r.y[3], f, r.ledger_rates[i], d)
    r.out[rec.STATUS], r.out[rec.PLACE] = status, where  # the Jacobian needs rates at other states
    r.state[0]["factorisations"] += 1.0
    if (
        run_handle.call_factor(
            r.calls[run_handle.REAL_FACTOR], r.structure, r.jacobian, shift, r.factors
        )
        != 0
    ):
        return -1.0
    newton["shift"] = shift
    # The differences of the Jacobian have used `increment` as work space.
    for j in range(ki.size):
        d[j] = f[j] - ki[j]
    run_handle.call_solve(r.calls[run_handle.REAL_SOLVE], r.structure, r.factors, d)
    return sqrt(size_of(d, r.weights) / max(ki.size, 1))


@inline
def damped_update(handle, r, t, h_gamma, i, size, rounded):
    """Add a part of the increment to the slope of stage i: the greatest trial part that is accepted.

    size, rounded : norm of the increment, and norm that counts as rounding
    Returns (part of the increment, part added so far, squared length of the next increment relative to this one); both
    parts are equal if the trial is accepted.
    """
    d = r.increment
    other = r.moved
    ki = r.k[i]
    shift = 1.0 / h_gamma
    part, tried, length = 1.0, 0.0, 0.0
    # Trials reuse the factors; only accepted iterates get a new Jacobian.
    while part != tried and part > LEAST_PART:
        for j in range(ki.size):
            ki[j] += shift * (part - tried) * d[j]
        evaluate_stage(handle, r, t, h_gamma, ki, other)
        if size <= rounded:  # the direction of the next increment is rounding
            tried = part
            break
        run_handle.call_solve(r.calls[run_handle.REAL_SOLVE], r.structure, r.factors, other)
        ahead, length = next_increment(d, other, r.weights)
        tried, part = part, damping_factor(part, ahead, length)
    return part, tried, length


@inline
def damped_newton(handle, r, t, h_gamma, i):
    """Solve stage i, k[i] = f(t, base + h_gamma k[i]), by damped Newton, with a new Jacobian for every iterate.

    The iteration starts from k[i]. Returns CONVERGED or FAILED.
    t : time of the stage; h_gamma : step times the diagonal coefficient of the method
    """
    d = r.increment
    ki = r.k[i]
    newton = r.newton[0]
    shift = 1.0 / h_gamma
    enough, rounded, floor = damped_limits(r.control[0])
    before = np.inf
    evaluate_stage(handle, r, t, h_gamma, ki, d)
    for turn in range(MOST_DAMPED):
        size = damped_increment(handle, r, t, h_gamma, i)
        if size == -1.0:
            break
        done = (
            size <= enough
            or size <= rounded
            and size >= 0.5 * before
            or size <= floor
            and turn == MOST_DAMPED - 1
        )
        part = 1.0
        tried = 0.0
        length = 0.0
        before = size
        if not done:
            part, tried, length = damped_update(handle, r, t, h_gamma, i, size, rounded)
        # rounding, or a kink between the iterates
        if part != tried and size <= floor and length < np.inf:
            done = True
        if done and r.out[rec.STATUS] != 0.0:
            break
        if done:
            for j in range(ki.size):
                ki[j] += shift * (1.0 - tried) * d[j]
            book_increment(r, d, i)
            # The next step gets a new Jacobian, and its error estimate is smoothed.
            newton["damped_step"], newton["increment_ratio"] = r.state[0]["steps"], 1.0
            newton["convergence_factor"] = 1.0
            return CONVERGED
        # No damping factor was accepted, or the increment is not finite.
        if part != tried or not size < np.inf:
            break
    find_worst(r, d, r.rate)
    newton["has_jacobian"] = 0.0
    return FAILED


@inline
def solve_stage_from_start(handle, r, t, h_gamma, i, y):
    """Solve a stage by `damped_newton`, if necessary from other starting values; returns CONVERGED or FAILED.

    If the first try fails in a step of given length, the iteration starts again from the state y, and then follows the
    solution from a step of zero length. Under error control a shorter step is cheaper, so there is only one try.
    y : state at the start of the step; other arguments as for `damped_newton`
    """
    base = r.base
    reached = r.fallback
    ki = r.k[i]
    state = r.state[0]
    # `worst` keeps the result of simplified Newton
    done = 0.0
    part = 1.0
    turn = 0
    worst = state["worst"]
    while part >= LEAST_STAGE_PART:
        if turn == 1:
            # The state y itself: the slope that leads from the base back to the start of the step.
            for j in range(ki.size):
                ki[j] = (y[j] - base[j]) / h_gamma
        elif turn > 1:
            copy(reached, ki)
        status = damped_newton(handle, r, t, h_gamma * (done + part), i)
        if status == CONVERGED:
            done += part
            if done == 1.0:
                return CONVERGED
            copy(ki, reached)
        elif r.control[0]["mode"] == rec.TOLERANCE:
            return FAILED
        # The given slope was too far away: from the start of the step next, then along shorter steps.
        elif turn == 0:
            for j in range(ki.size):
                reached[j] = 0.0
        else:
            part *= 0.5
        state["worst"] = worst
        turn += 1
    return FAILED


@inline
def smoothed_error(handle, r, t, h, now, new, error, shift):
    """Error of a step that damped Newton has solved, in units of the tolerance.

    It is the norm of (I - J / shift)^-1 h sum e_j k_j. J is the Jacobian at the start of the step, and `error` contains
    the weights e_j. The matrix reduces the error of stiff components (Hosea and Shampine 1996). If it reverses the
    error, because J jumps, the unfiltered error is used. Returns NEWTON_FAILED if the matrix is singular.
    now, new : rows of y at the start and the end of the step
    """
    k = r.k
    d = r.increment
    f = r.rate
    y = r.y[now]
    y_new = r.y[new]
    scale = r.scale
    size = r.control[0]["size"]
    plain = 0.0
    dot = 0.0
    smooth = 0.0
    # Damped Newton has replaced the Jacobian by those of its iterates.
    renew_at_start(handle, r, t, now)
    r.state[0]["factorisations"] += 1.0
    r.newton[0]["increment_ratio"] = 1.0
    if (
        run_handle.call_factor(
            r.calls[run_handle.REAL_FACTOR], r.structure, r.jacobian, shift, r.factors
        )
        != 0
    ):
        return rec.NEWTON_FAILED
    for i in range(y.size):
        f[i] = 0.0
        for j in range(k.shape[0]):
            f[i] += h * error[j] * k[j, i]
        d[i] = shift * f[i]
    run_handle.call_solve(r.calls[run_handle.REAL_SOLVE], r.structure, r.factors, d)
    for i in range(y.size):
        w = 1.0 / (size * error_scale(scale[i], max(abs(y[i]), abs(y_new[i]))))
        plain += (w * f[i]) * (w * f[i])
        dot += (w * f[i]) * (w * d[i])
        smooth += (w * d[i]) * (w * d[i])
    return sqrt((smooth if dot > 0.0 else plain) / max(y.size, 1))
