"""One step of a Rosenbrock method: every stage is a linear solve with the Jacobian at the start of the step.

(I / (h g) - J) u_i = f(t + c_i h, y + sum a_ij u_j) + sum C_ij u_j / h + d_i h f_t, y+ = y + sum m_i u_i
with the step h, the Jacobian J, the time slope f_t = df/dt and the coefficients g, a, c, C, d, m of the method (Hairer
and Wanner 1996, (IV.7.25)). Stages are stored as k_i = u_i / h.
"""

from fvsolve.core.steppers import loop_records as rec
from fvsolve.core.steppers.coefficients import nodes_of, row_of, weights_of
from fvsolve.core.steppers.newton import factor_for, follow_stages, renew_at_start, spectral_radius
from fvsolve.core.steppers.run_handle import (
    REAL_SOLVE,
    call_solve,
    note_stage,
    open_run,
    stage_rates,
)
from fvsolve.core.steppers.step_operations import combine, copy, error_norm
from fvsolve.core.steppers.structure import multiply
from fvsolve.jit import inline, njit

# The array `base` of the run contains df/dt, `ledger_slopes` the time slopes of the ledger rates.


@inline
def slope_in_time(handle, r, t, h, now):
    """Compute the time slopes of f and of the ledger rates at constant y, by a difference within the step.

    Arguments as for `attempt`.
    """
    slope = r.base
    first = r.k[0]
    out = r.out
    ledger_slopes = r.ledger_slopes
    offset = r.control[0]["ledger_offset"]
    # The root balances rounding and curvature; a difference within the step meets no later kink.
    step = min((2.2e-16 * max(1e-5, abs(t))) ** 0.5, 1e-3 * h)
    later = t + step
    out[rec.NEARBY] = 1.0
    stage_rates(handle, r, later, r.y[now], slope)
    out[rec.NEARBY] = 0.0
    # the time difference is lost in rounding: df/dt is negligible
    per = 1.0 / (later - t) if later > t else 0.0
    for e in range(slope.size):
        slope[e] = (slope[e] - first[e]) * per
    for m in range(ledger_slopes.size):
        ledger_slopes[m] = (out[offset + m] - r.ledger_rates[0, m]) * per


@inline
def book_stage(r, i, gamma, time_weight, row, d):
    """Compute the ledger rates of stage i: gamma (rates + J d + time_weight slope + sum of C_ij ledger_rates_j).

    d : float64[n]  solution u_i of the stage; row : float64[s]  row C_i of the coefficients; J : Jacobian
    `out` holds the rates computed with f, `ledger_slopes` their time slopes.
    """
    product = r.product
    ledger_rates = r.ledger_rates
    offset = r.control[0]["ledger_offset"]
    multiply(r.structure, r.jacobian, d, product)
    for m in range(ledger_rates.shape[1]):
        total = r.out[offset + m] + product[d.size + m] + time_weight * r.ledger_slopes[m]
        for j in range(1, i):
            total += row[j] * ledger_rates[j, m]
        ledger_rates[i, m] = gamma * total


@inline
def prepare(handle, r, t, h, now):
    """Compute the Jacobian and the time slopes at the start of a step, unless a repeated attempt has them already."""
    newton, state = r.newton[0], r.state[0]
    first = newton["stages_step"] != state["steps"]
    # A repeated attempt starts from the same state, so its Jacobian is valid.
    if newton["has_jacobian"] != 0.0 and not first:
        return
    renew_at_start(handle, r, t, now)
    slope_in_time(handle, r, t, h, now)
    if first:
        follow_stages(state, newton)
    if r.control[0]["watch"] != 0:
        state["radius"] = spectral_radius(r)


@inline
def evaluate_stage(handle, r, t, h, i, now):
    """Write the rates f at the state of stage i to `rate`, except those of the first stage, which are k[0]."""
    if i == 1:
        for m in range(r.ledger_rates.shape[1]):
            r.out[r.control[0]["ledger_offset"] + m] = r.ledger_rates[0, m]
        return
    s, y = r.k.shape[0], r.y[now]
    combine(0, y.size, y, h, row_of(r.coefficients, s, i), i, r.k, r.y[3])
    stage_rates(handle, r, t + nodes_of(r.coefficients, s)[i] * h, r.y[3], r.rate)
    note_stage(r)


@njit
def attempt(handle, run, t, h, now, new):
    """Compute y[new] and the stages k from y[now] and k[0] = f(t, y[now]); returns the error in units of the tolerance.

    The error is 0 unless the step is under error control, and NEWTON_FAILED if the matrix I / (h g) - J is singular,
    with the Jacobian J and the diagonal coefficient g of the method. Arguments as for `erk.attempt`.
    """
    r = open_run(run)
    k = r.k
    y = r.y[now]
    d = r.increment
    slope = r.base
    s = r.k.shape[0]
    n = r.scale.size
    extra, per = r.coefficients[s * s + 3 * s :], 1.0 / h  # C, d, g
    gamma = extra[s * s + s]
    prepare(handle, r, t, h, now)
    bad_pivot = factor_for(r, 1.0 / (h * gamma))
    if bad_pivot != 0:
        r.state[0]["worst"] = bad_pivot - 1.0
        return rec.NEWTON_FAILED
    for i in range(1, s):
        evaluate_stage(handle, r, t, h, i, now)
        f = k[0] if i == 1 else r.rate
        time_weight = extra[s * s + i] * h
        u = k[i]
        row = extra[i * s : (i + 1) * s]
        # f may be k[0], which must not change, so the sum goes to work space.
        if time_weight != 0.0:
            for e in range(n):
                d[e] = f[e] + time_weight * slope[e]
            f = d
        combine(0, n, f, 1.0, row, i, k, u)
        call_solve(r.calls[REAL_SOLVE], r.structure, r.factors, u)
        # Before u is divided by h: the ledger needs the increment u_i itself.
        if r.ledger_rates.shape[1] > 0:
            copy(u, d)
            book_stage(r, i, gamma, time_weight, row, d)
        for e in range(n):
            u[e] *= per
    combine(0, n, y, h, weights_of(r.coefficients, s), s, k, r.y[new])
    if r.control[0]["mode"] != rec.TOLERANCE:
        return 0.0
    return error_norm(r, h, now, new)
