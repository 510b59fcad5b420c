"""One explicit Runge-Kutta step, equation (14) of docs/course.md."""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.stage_sums import CHECKED, EDGES, MODE, OFF, OTHERS, STAGE, STAGE_AND_END, request_sums, sum_runs
from fvsolve.steppers.coefficients import error_of, nodes_of, row_of, weights_of
from fvsolve.steppers.loop_indices import CALLS, CONTROL, FSAL, RADIUS, SIZE, TOLERANCE, WATCH
from fvsolve.steppers.step_operations import BEGIN, STOP, combine, error_of_bands


@njit
def quotient(f_new, f, y_new, y, scale):
    """Estimate of the spectral radius of the Jacobian from two stages at the end of a step (Hairer and Wanner IV.2).

    It is |f_new - f| / |y_new - y|, with the rates f_new, f and states y_new, y of the two stages. The weight of each
    state in the norms is 1 / (scale + |y|).
    """
    above, below = 0.0, 0.0
    for i in range(y.size):
        w = 1.0 / (scale[i] + abs(y[i]))
        above += ((f_new[i] - f[i]) * w) * ((f_new[i] - f[i]) * w)
        below += ((y_new[i] - y[i]) * w) * ((y_new[i] - y[i]) * w)
    return sqrt(above / below) if below > 0.0 else 0.0


@njit
def attempt(
    rhs, factor, solve, factor_complex, solve_complex, join, handle, coefficients, structure, row_blocks, sums, t, h, y,
    now, new, k, ledger_rates, ledger_offset, out, scale, controls, loop_state, work, vectors, factors, complex_factors,
):  # fmt: skip
    """Compute y[new] and the stages k from y[now] and k[0] = f(t, y[now]); returns the error in units of the tolerance.

    The error is 0 unless the step is under error control. If controls[WATCH] is set, the spectral radius is written to
    `loop_state`.
    t, h : start and length of the step; rhs(t, y, dydt, out, handle) : function for the rates f
    y : float64[4, n]  states, y[3] is work space; k : float64[s, n]  rates at the stages
    ledger_rates : float64[s, m]  receives out[ledger_offset : ledger_offset + m] at the stages
    coefficients : flat array, see `coefficients.coefficients`; scale : see `step_operations.error_scale`
    controls, loop_state : arrays of the time loop, see `loop_indices`
    join, row_blocks, sums : exchange of partial sums between bands of states, see `step_operations`
    structure : description of stage sums that rhs forms in blocks, see `kernels.stage_sums`; empty if rhs forms none
    Arguments for linear algebra and Newton iterations are not used.
    """
    s, b = k.shape[0], weights_of(coefficients, k.shape[0])
    c, last_is_new, blocked = nodes_of(coefficients, s), controls[FSAL] == 1.0, structure.size > 0
    for i in range(1, s):
        last, row = i == s - 1, row_of(coefficients, s, i)
        target = y[new] if last and (last_is_new or blocked) else y[3]
        if blocked:
            sum_runs(
                structure, 0, structure[OTHERS] + structure[CHECKED] + structure[EDGES], y[now], h, row, i, k, target
            )
            request_sums(
                structure, STAGE_AND_END if last and not last_is_new else STAGE, y[now], h, row, i, k, target, b
            )
        else:
            for m in range(row_blocks.shape[0]):
                combine(row_blocks[m, BEGIN], row_blocks[m, STOP], y[now], h, row, i, k, target)
        rhs(t + c[i] * h, target, k[i], out, handle)
        if blocked:
            structure[MODE] = OFF
        for m in range(ledger_rates.shape[1]):
            ledger_rates[i, m] = out[ledger_offset + m]
    if blocked and s > 1 and not last_is_new:
        sum_runs(structure, 0, structure[OTHERS] + structure[CHECKED], y[now], h, b, s, k, y[new])
    elif not last_is_new:
        for m in range(row_blocks.shape[0]):
            combine(row_blocks[m, BEGIN], row_blocks[m, STOP], y[now], h, b, s, k, y[new])
    loop_state[CALLS] += s - 1.0
    if controls[WATCH] != 0.0:
        loop_state[RADIUS] = quotient(k[s - 1], k[s - 2], y[new], y[3], scale)
    if controls[CONTROL] != TOLERANCE:
        return 0.0
    return error_of_bands(
        join, handle, row_blocks, sums, h, error_of(coefficients, s), k, y[now], y[new], scale, controls[SIZE]
    )
