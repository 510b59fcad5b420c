"""One step of an SSP method whose stages are divided by what is quick in them, f + G y with G = -r by state.

Chertock, Cui, Kurganov and Wu 2015 (SIAM J. Numer. Anal. 53): each stage is a mean of Euler steps of the whole
length h, y + h (f + G y) / (1 + h R), and the step ends with what makes it second order. Where f + G y is zero nothing
changes, so a steady state is that of f + G y for any h. R >= r may be another rate than r, see `free_surface.friction`.
"""

from fvsolve.jit import njit
from fvsolve.kernels.calls import damp_in_turn
from fvsolve.steppers.coefficients import nodes_of, row_of, weights_of
from fvsolve.steppers.slots import CALLS
from fvsolve.steppers.step import BEGIN, STOP, combine, copy


@njit
def settle(begin, end, b, quick, k):
    """Let k of the last stage bring y + h sum b_j k_j, of [begin:end], to what is second order in h.

    An Euler step of length h (h R), backward in G, from there: with f + G y of the stage at the end, k[2] (1 + h R).
    """
    last = b.size - 1
    for i in range(begin, end):
        q, mean = quick[i], 0.0
        for j in range(1, b.size):
            mean += b[j] * k[j, i]
        k[last, i] += q * (k[2, i] * (1.0 + q) + q * (k[1, i] - mean)) / ((1.0 + q * q) * b[last])


@njit
def attempt(
    rhs, factor, solve, factor_complex, solve_complex, join, handle, coefficients, shape, spans, sums, t, h, y, now,
    new, k, supply, where, out, scale, orders, memory, work, vectors, store, store_complex,
):  # fmt: skip
    """y[new] and the stages k from y[now] and k[0] = f(t, y[now]), a stage of no weight; k[1] is that divided.

    supply[i] keeps the ledger rates of stage i. store : h R of the first two stages and of those that follow, zero
    where nothing is quick; what else other methods need is not looked at.
    """
    s, b, c, n = k.shape[0], weights_of(coefficients, k.shape[0]), nodes_of(coefficients, k.shape[0]), scale.size
    for m in range(spans.shape[0]):
        copy(k[0, spans[m, BEGIN] : spans[m, STOP]], k[1, spans[m, BEGIN] : spans[m, STOP]])
    for m in range(supply.shape[1]):
        supply[1, m] = supply[0, m]
    damp_in_turn(h, y[now], k[1], store[:n], handle)
    for i in range(2, s):
        for m in range(spans.shape[0]):
            combine(spans[m, BEGIN], spans[m, STOP], y[now], h, row_of(coefficients, s, i), i, k, y[3])
        rhs(t + c[i] * h, y[3], k[i], out, handle)
        for m in range(supply.shape[1]):
            supply[i, m] = out[where + m]
        damp_in_turn(h, y[3], k[i], store[:n] if i == 2 else store[n:], handle)
    for m in range(spans.shape[0]):
        if s > 2:
            settle(spans[m, BEGIN], spans[m, STOP], b, store[:n], k)
        combine(spans[m, BEGIN], spans[m, STOP], y[now], h, b, s, k, y[new])
    memory[CALLS] += s - 2.0
    return 0.0
