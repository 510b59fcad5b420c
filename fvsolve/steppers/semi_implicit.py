"""One step of a semi-implicit SSP method for y' = f + G y, with a fast decay G = -r of each state (bed friction).

Each stage is a mean of Euler steps of the full length h, y + h (f + G y) / (1 + h R) (Chertock, Cui, Kurganov and Wu
2015, SIAM J. Numer. Anal. 53). A correction at the end of the step makes it second order. Where f + G y is zero the
state does not change, so steady states do not depend on h. The rate R [1/s] may be greater than the decay rate r.
"""

from fvsolve.jit import njit
from fvsolve.kernels.calls import damp_in_turn
from fvsolve.steppers.coefficients import nodes_of, row_of, weights_of
from fvsolve.steppers.erk import form_sum
from fvsolve.steppers.run_handle import evaluate, open_run, store_ledger_rates
from fvsolve.steppers.step_operations import BEGIN, STOP, copy


@njit
def second_order_correction(begin, end, b, damping, k):
    """Correct k of the last stage so that y + h sum b_j k_j is second order in h, for states from `begin` to `end` - 1.

    The correction is an Euler step of length h (h R) from the end of the step, implicit in the decay. Its rate f + G y
    is that of the stage at the end of the step, k[2] (1 + h R). f + G y are the rates, with a fast decay G = -r.
    b : weights of the stages; damping : float64[n]  h R with the rate R of each state
    """
    last = b.size - 1
    for i in range(begin, end):
        q, mean = damping[i], 0.0
        for j in range(1, b.size):
            mean += b[j] * k[j, i]
        k[last, i] += q * (k[2, i] * (1.0 + q) + q * (k[1, i] - mean)) / ((1.0 + q * q) * b[last])


@njit
def attempt(handle, run, t, h, now, new):
    """Compute y[new] and the stages k from y[now] and k[0] = f(t, y[now]), a stage of weight zero; returns 0.

    k[1] is k[0] divided by 1 + h R, with the step h and the rate R of fast decay of each state. `factors` receives h R
    of the first two stages, then of the later stages : float64[2 n]; zero for states without fast decay.
    Arguments as for `erk.attempt`.
    """
    r = open_run(run)
    k, row_blocks, ledger_rates, n = r.k, r.row_blocks, r.ledger_rates, r.scale.size
    s, b, c = k.shape[0], weights_of(r.coefficients, k.shape[0]), nodes_of(r.coefficients, k.shape[0])
    early, late = r.factors[:n], r.factors[n:]
    for m in range(row_blocks.shape[0]):
        copy(k[0, row_blocks[m, BEGIN] : row_blocks[m, STOP]], k[1, row_blocks[m, BEGIN] : row_blocks[m, STOP]])
    copy(ledger_rates[0], ledger_rates[1])
    damp_in_turn(h, r.y[now], k[1], early, handle)
    for i in range(2, s):
        form_sum(r, h, row_of(r.coefficients, s, i), i, now, r.y[3])
        evaluate(handle, r, t + c[i] * h, r.y[3], k[i])
        store_ledger_rates(r, i)
        damp_in_turn(h, r.y[3], k[i], early if i == 2 else late, handle)
    for m in range(row_blocks.shape[0] if s > 2 else 0):
        second_order_correction(row_blocks[m, BEGIN], row_blocks[m, STOP], b, early, k)
    form_sum(r, h, b, s, now, r.y[new])
    return 0.0
