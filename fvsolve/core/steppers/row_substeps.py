"""Output rows within a step under error control whose dense output is not accurate: from substeps of their own.

In a stiff problem all stages may lie on the slow solution in a step of any length. Then the error estimate of the step
is nearly zero, although the polynomial between the stages is wrong. The defect of this polynomial p,
(I / (h g) - J)^-1 (p' - f(t, p)), is its distance from the slow solution where f is stiff, and about h g times the
error of its slope elsewhere. J is the Jacobian, h the step, g the diagonal coefficient of the method (Hairer and Wanner
1996, IV.8, use the same matrix for the error of a step).
Where the defect is above the tolerance, rows come from substeps from the start of the step: of the length at which the
dense output is accurate, or up to the next row, whichever is longer. The steps themselves do not depend on rows.
Substeps use the arrays behind the handle `spare`, whose records `state` and `progress` describe the last substep.
"""

from math import isfinite, sqrt

from fvsolve.core.kernels.dtypes import RATE_UNWANTED
from fvsolve.core.steppers import loop_records as rec
from fvsolve.core.steppers import run_handle
from fvsolve.core.steppers.coefficients import start_slope_of
from fvsolve.core.steppers.run_handle import evaluate, open_run, store_ledger_rates
from fvsolve.core.steppers.step_operations import (
    BEGIN,
    STOP,
    copy,
    error_scale,
    interpolate,
    interpolate_slope,
    start_slope_defect,
)
from fvsolve.jit import njit

# Points of a step where the defect is computed: near the extremes of the error of all interpolants, which is zero at
# both ends and, in a stiff problem, at stages.
POINTS = (0.4, 0.85)
LEAST_FACTOR, GREATEST_FACTOR = 0.1, 2.0  # of the length of a substep over that of the last one
LEAST_SUBSTEP = 1e-4  # least length of substeps, in steps
CLOSE = 1e-9  # in steps: substeps that end closer to the end of the step end there


@njit
def store_start_slopes(r):
    """Store the slopes at the start of the last step, for output rows within it."""
    control = r.control[0]
    row_blocks = r.row_blocks
    k = r.k
    f_old = r.f_old
    s = r.k.shape[0]
    known = control["kind"] == rec.NEWTON_SOLVED and r.newton[0]["known_steps"] > 0.0
    start_slope = start_slope_of(r.coefficients, s)
    use_slope = control["stage_slope"] == 1 and known
    # The rate f at the start would amplify the distance of y from the slow solution.
    slope = r.last_stages[s - 1] if known else k[0]
    for m in range(row_blocks.shape[0]):
        begin, end = row_blocks[m, BEGIN], row_blocks[m, STOP]
        if start_slope.size > 0:
            start_slope_defect(begin, end, start_slope, k, slope, known, f_old)
        elif use_slope:
            copy(slope[begin:end], f_old[begin:end])
        else:
            copy(k[0, begin:end], f_old[begin:end])


@njit
def needs_defect(r):
    """True if the dense output of steps has to be checked: in implicit steps under error control.

    Stability limits explicit steps; other methods end steps at rows, see `Integrator.end_at_rows`.
    """
    control = r.control[0]
    return (
        control["kind"] != rec.EXPLICIT
        and control["mode"] == rec.TOLERANCE
        and control["end_at_rows"] == 0
    )


@njit
def defect(handle, r, own, t, h, theta, now, old):
    """Norm of the defect of the dense output at t + theta h, in units of the tolerance; infinite for invalid rates.

    t, h : start and length of the last step; own : open handle of `spare`, whose arrays are used for work
    """
    y = r.y[old]
    y_new = r.y[now]
    stage = own.y[3]
    d = own.increment
    f = own.rate
    k = r.k
    scale = r.scale
    s = k.shape[0]
    size = r.control[0]["size"]
    total = 0.0
    out = r.out_row
    start_slope = start_slope_of(r.coefficients, s)
    interpolate(0, y.size, theta, h, y, r.f_old, y_new, k[s - 1], k, r.dense, start_slope, stage)
    interpolate_slope(theta, h, y, r.f_old, y_new, k[s - 1], k, r.dense, start_slope, d)
    # The rate that limits steps costs time and is not needed here.
    out[rec.RATE] = RATE_UNWANTED
    run_handle.call_rhs(r.calls[run_handle.RHS_CALL], t + theta * h, stage, f, out, handle)
    r.state[0]["calls"] += 1.0
    for i in range(y.size):
        d[i] -= f[i]
    # The Newton matrix turns the defect into an error of the state, also for stiff components.
    run_handle.call_solve(r.calls[run_handle.REAL_SOLVE], r.structure, r.factors, d)
    for i in range(y.size):
        e = d[i] / (size * error_scale(scale[i], max(abs(y[i]), abs(y_new[i]))))
        total += e * e
    return (
        sqrt(total / max(y.size, 1))
        if out[rec.STATUS] == 0.0 and isfinite(total)
        else rec.UNKNOWN_DEFECT
    )


@njit
def length_factor(error, order):
    """Factor on the length of a substep whose defect is `error`, in units of the tolerance; order : power of h."""
    return min(GREATEST_FACTOR, max(LEAST_FACTOR, 0.9 * max(error, 1e-10) ** (-1.0 / order)))


@njit
def greatest_defect(handle, r, own, t, h, now, old):
    """Greatest defect of the dense output of the last step behind `r`, in units of the tolerance; see `defect`."""
    error = 0.0
    for theta in POINTS:
        error = max(error, defect(handle, r, own, t, h, theta, now, old))
    return error


@njit
def begin_substeps(handle, r, own, t, h, now, old):
    """Begin the substeps of the last step at its start, and store their length as `step`; 0 if they are not needed.

    Arguments as for `defect`
    """
    state = own.state[0]
    progress = own.progress[0]
    newton = own.newton[0]
    size = r.state[0]["t"]
    # The defect of a step is computed once for all its rows.
    if progress["t_old"] != t or progress["t_new"] != size:
        error = greatest_defect(handle, r, own, t, h, now, old)
        state["step"] = h * length_factor(error, r.control[0]["order"]) if error > 1.0 else 0.0
        progress["t_old"], progress["t_new"] = t, size
    state["t"], state["last"], state["steps"] = t, 0.0, 1.0
    progress["now"], progress["old"], progress["no_sweeps"] = 0, 1, 1
    # no Jacobian, no earlier stages
    newton["has_jacobian"] = newton["jacobian_step"] = newton["known_steps"] = 0.0
    newton["shift"] = newton["increment_ratio"] = 0.0
    newton["stages_step"] = newton["damped_step"] = -1.0
    newton["convergence_factor"], newton["factor_size"] = 1.0, r.newton[0]["factor_size"]
    copy(r.y[old], own.y[0])


@njit
def substep(handle, r, own, h, end, due):
    """Take a substep of length h to the time `end`; returns True if its stages could be solved.

    It is not accepted if a row at the time `due` lies within it and its dense output is not accurate; then a shorter
    length is stored.
    """
    state, progress = own.state[0], own.progress[0]
    now, new = progress["now"], progress["old"]
    evaluate(handle, own, state["t"], own.y[now], own.k[0])
    store_ledger_rates(own, 0)
    e = run_handle.call_attempt(r.calls[run_handle.STEP], handle, r.spare, state["t"], h, now, new)
    if e == rec.NEWTON_FAILED:
        return False
    store_start_slopes(own)
    progress["changed"] = 0
    if due < end:
        progress["changed"] = 1
        error = greatest_defect(handle, own, own, state["t"], h, new, now)
        state["step"] = h * length_factor(error, own.control[0]["order"])
        if error > 1.0 and state["step"] > LEAST_SUBSTEP * (r.state[0]["t"] - progress["t_old"]):
            return True
    state["t"], state["last"], progress["now"], progress["old"] = end, h, new, now
    state["steps"] += 1.0
    return True


@njit
def count_work(r, own):
    """Count the work of substeps with that of the steps."""
    state, total = own.state[0], r.state[0]
    total["calls"] += state["calls"]
    total["jacobians"] += state["jacobians"]
    total["factorisations"] += state["factorisations"]
    total["newton"] += state["newton"]
    state["calls"] = state["jacobians"] = state["factorisations"] = state["newton"] = 0.0


@njit
def substep_row(handle, r, t_old, due, now, old):
    """Write the state at the time `due` within the last step to `y_out`, from substeps.

    Returns False if the dense output of the step is accurate, or if a substep could not be solved.
    """
    own = open_run(r.spare)
    t = r.state[0]["t"]
    h = r.state[0]["t"] - t_old
    state, progress = own.state[0], own.progress[0]
    begun = progress["t_old"] == t_old and progress["t_new"] == t
    checked = due >= state["t"] or progress["changed"] == 1  # the dense output of the last substep
    # An earlier row, or one that the last substep cannot serve, needs substeps from the start again.
    if not begun or due < state["t"] - state["last"] or not checked:
        begin_substeps(handle, r, own, t_old, h, now, old)
    if state["step"] == 0.0:
        return False
    while state["t"] < due:
        # A substep that ends at the row needs no dense output; a longer one serves further rows.
        end = max(due, state["t"] + state["step"])
        end = t if end > t - CLOSE * h else end
        solved = substep(handle, r, own, end - state["t"], end, due)
        count_work(r, own)
        if not solved:
            # No further row of this step is tried by substeps.
            state["step"] = 0.0
            return False
    y = own.y[progress["old"]]
    y_new = own.y[progress["now"]]
    last = state["last"]
    k = own.k
    s = own.k.shape[0]
    if due == state["t"]:
        copy(y_new, r.y_out)
    else:
        theta, start_slope = (due - (state["t"] - last)) / last, start_slope_of(r.coefficients, s)
        interpolate(
            0, y.size, theta, last, y, own.f_old, y_new, k[s - 1], k, r.dense, start_slope, r.y_out
        )
    return True
