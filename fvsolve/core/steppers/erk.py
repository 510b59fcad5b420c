"""One explicit Runge-Kutta step, equation (14) of docs/course.md, and one semi-implicit step with fast decay.

Semi-implicit SSP methods solve y' = f + G y, with a fast decay G = -r of each state (bed friction). Each stage is a
mean of Euler steps of the full length h, y + h (f + G y) / (1 + h R) (Chertock, Cui, Kurganov and Wu 2015, SIAM J.
Numer. Anal. 53). A correction at the end of the step makes it second order. Where f + G y is zero the state does not
change, so steady states do not depend on h. The rate R [1/s] may be greater than the decay rate r.
"""

from math import sqrt

from fvsolve.core.kernels.calls import damp_in_turn
from fvsolve.core.kernels.stage_sums import (
    CHECKED,
    EDGES,
    MODE,
    OFF,
    OTHERS,
    STAGE,
    STAGE_AND_END,
    request_sums,
    sum_runs,
)
from fvsolve.core.steppers import loop_records as rec
from fvsolve.core.steppers.coefficients import nodes_of, row_of, weights_of
from fvsolve.core.steppers.run_handle import (
    evaluate,
    note_stage,
    open_run,
    stage_rates,
    store_ledger_rates,
)
from fvsolve.core.steppers.step_operations import (
    BEGIN,
    STOP,
    combine,
    copy,
    error_of_bands,
    error_scale,
)
from fvsolve.jit import njit

CHUNK = 512  # number of states of a vector loop whose operands stay in the cache


@njit
def quotient(f_new, f, y_new, y, scale):
    """Estimate of the spectral radius of the Jacobian from two stages at the end of a step (Hairer and Wanner IV.2).

    It is |f_new - f| / |y_new - y|, with the rates f_new, f and states y_new, y of the two stages. The weight of each
    state in the norms is 1 / `error_scale`.
    """
    above, below = 0.0, 0.0
    for i in range(y.size):
        w = 1.0 / error_scale(scale[i], y[i])
        above += ((f_new[i] - f[i]) * w) * ((f_new[i] - f[i]) * w)
        below += ((y_new[i] - y[i]) * w) * ((y_new[i] - y[i]) * w)
    return sqrt(above / below) if below > 0.0 else 0.0


@njit
def form_sum(r, h, weights, count, now, target):
    """Write y[now] + h sum over j < count of weights[j] k[j] to `target`, for all states of this band."""
    row_blocks = r.row_blocks
    k = r.k
    y = r.y[now]
    for m in range(row_blocks.shape[0]):
        combine(row_blocks[m, BEGIN], row_blocks[m, STOP], y, h, weights, count, k, target)


@njit
def attempt(handle, run, t, h, now, new):
    """Compute y[new] and the stages k from y[now] and k[0] = f(t, y[now]); returns the error in units of the tolerance.

    The error is 0 unless the step is under error control. Under the stiffness test the spectral radius is stored.
    handle, run : handles of the model and of the run, see `run_handle`; t, h : start and length of the step
    now, new : rows of y; y[3] is work space. The ledger rates of all stages are stored too.
    `structure` describes stage sums that rhs forms in blocks, see `kernels.stage_sums`; it is empty if rhs forms none.
    """
    r = open_run(run)
    control = r.control[0]
    k = r.k
    structure = r.structure
    y = r.y[now]
    s = k.shape[0]
    b = weights_of(r.coefficients, k.shape[0])
    c = nodes_of(r.coefficients, k.shape[0])
    last_is_new, blocked = control["fsal"] == 1, structure.size > 0
    for i in range(1, s):
        last, row = i == s - 1, row_of(r.coefficients, s, i)
        # First same as last: the last stage is the end of the step. In blocks, the end replaces the last stage.
        target = r.y[new] if last and (last_is_new or blocked) else r.y[3]
        if blocked:
            runs = structure[OTHERS] + structure[CHECKED] + structure[EDGES]
            sum_runs(structure, 0, runs, y, h, row, i, k, target)
            # Sums of rows are formed by the rhs itself, while its block lies in the cache.
            mode = STAGE_AND_END if last and not last_is_new else STAGE
            request_sums(structure, mode, y, h, row, i, k, target, b)
        else:
            form_sum(r, h, row, i, now, target)
        if last and last_is_new:  # the first stage of the next step
            evaluate(handle, r, t + c[i] * h, target, k[i])
        else:
            stage_rates(handle, r, t + c[i] * h, target, k[i])
        note_stage(r)
        if blocked:
            # Other calls of the rhs must not form stages.
            structure[MODE] = OFF
        store_ledger_rates(r, i)
    if blocked and s > 1 and not last_is_new:
        sum_runs(structure, 0, structure[OTHERS] + structure[CHECKED], y, h, b, s, k, r.y[new])
    elif not last_is_new:
        form_sum(r, h, b, s, now, r.y[new])
    if control["watch"] != 0:
        # y[3] still holds the state of the second-last stage, since the last one went to y[new].
        r.state[0]["radius"] = quotient(k[s - 1], k[s - 2], r.y[new], r.y[3], r.scale)
    if control["mode"] != rec.TOLERANCE:
        return 0.0
    return error_of_bands(handle, r, h, now, new)


@njit
def any_nonzero(values):
    """True if a value is not zero."""
    if values.size > 0 and values[0] != 0.0:
        return True
    count = 0
    for i in range(values.size):  # without an early end, so that it is vectorised
        count += values[i] != 0.0
    return count > 0


@njit
def second_order_correction(begin, end, b, damping, k, means):
    """Correct k of the last stage so that y + h sum b_j k_j is second order in h, for states from `begin` to `end` - 1.

    The correction is an Euler step of length h (h R) from the end of the step, implicit in the decay. Its rate f + G y
    is that of the stage at the end of the step, k[2] (1 + h R). f + G y are the rates, with a fast decay G = -r.
    b : weights of the stages; damping : float64[n]  h R with the rate R of each state
    means : float64[n], work space
    """
    last = b.size - 1
    q = damping[begin:end]
    mean = means[begin:end]
    early = k[1, begin:end]
    late = k[2, begin:end]
    final = k[last, begin:end]
    # Most blocks have no fast decay: then the correction is zero, and its passes are saved.
    if not any_nonzero(q):
        return
    for i in range(mean.size):
        mean[i] = b[1] * early[i]
    for j in range(2, b.size):
        stage = k[j, begin:end]
        for i in range(mean.size):
            mean[i] += b[j] * stage[i]
    for i in range(mean.size):
        rate = late[i] * (1.0 + q[i]) + q[i] * (early[i] - mean[i])
        final[i] += q[i] * rate / ((1.0 + q[i] * q[i]) * b[last])


@njit
def damped_attempt(handle, run, t, h, now, new):
    """Compute y[new] and the stages k from y[now] and k[0] = f(t, y[now]), a stage of weight zero; returns 0.

    k[1] is k[0] divided by 1 + h R, with the step h and the rate R of fast decay of each state. `factors` receives h R
    of the first two stages, then of the later stages : float64[2 n]; zero for states without fast decay.
    Arguments as for `attempt`.
    """
    r = open_run(run)
    k = r.k
    row_blocks = r.row_blocks
    ledger_rates = r.ledger_rates
    n = r.scale.size
    s = k.shape[0]
    b = weights_of(r.coefficients, k.shape[0])
    c = nodes_of(r.coefficients, k.shape[0])
    early, late = r.factors[:n], r.factors[n:]
    for m in range(row_blocks.shape[0]):
        copy(
            k[0, row_blocks[m, BEGIN] : row_blocks[m, STOP]],
            k[1, row_blocks[m, BEGIN] : row_blocks[m, STOP]],
        )
    # The ledger has the rates of the equations, without damping.
    copy(ledger_rates[0], ledger_rates[1])
    damp_in_turn(h, r.y[now], k[1], early, handle)
    for i in range(2, s):
        form_sum(r, h, row_of(r.coefficients, s, i), i, now, r.y[3])
        stage_rates(handle, r, t + c[i] * h, r.y[3], k[i])
        note_stage(r)
        store_ledger_rates(r, i)
        damp_in_turn(h, r.y[3], k[i], early if i == 2 else late, handle)
    for m in range(row_blocks.shape[0]):
        # In chunks, so that correction and sum find their operands in the cache.
        for first in range(row_blocks[m, BEGIN], row_blocks[m, STOP], CHUNK):
            stop = min(first + CHUNK, row_blocks[m, STOP])
            if s > 2:
                second_order_correction(first, stop, b, early, k, r.y[3])
            combine(first, stop, r.y[now], h, b, s, k, r.y[new])
    return 0.0
