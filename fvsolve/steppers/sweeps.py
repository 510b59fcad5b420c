"""Stages of a fully implicit step solved in turn, for rates whose slope differs by orders from stage to stage.

With A = C U, C lower triangular and the diagonal of U one, K <- F(y + h (a_0 k_0 + C K + (A - C) K_before)) is a
diagonally implicit step, which `newton.damp` solves. On a stiff part it ends after q such sweeps, I - U being
nilpotent; a soft part gains a factor of 4 or more by each (van der Houwen and de Swart 1997). A limiter or weno's
weights take that gain, or let sweeps go to and fro: then K goes on from where the last two changes would cancel
(Anderson 1965, of depth one).
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from fvsolve.jit import inner
from fvsolve.steppers.coefficients import nodes_of, row_of
from fvsolve.steppers.newton import BASE, CONVERGED, FAILED, WEIGHTS, reach, tight
from fvsolve.steppers.slots import CONTROL, TOLERANCE
from fvsolve.steppers.step import copy

MOST = 40
SLOW, FARTHEST = 0.4, 10.0  # what a sweep may leave of the change of the one before; how many changes K is led on


@inner
def sweep(
    rhs, factor, solve, handle, coefficients, low, structure, t, h, y, y_stage, k, ledger_rates, ledger_offset, out,
    scale, controls, loop_state, nnz, room, work, vectors, factors,
):  # fmt: skip
    """Slopes k of the stages and their ledger rates; returns CONVERGED or FAILED.

    low : float64[q q], C flat; room : first of 3 q rows of `vectors`, for the slopes from which a sweep starts, what it
    changed, and what came of it.
    """
    s, n = k.shape
    q, c, base, weights = s - 1, nodes_of(coefficients, s), vectors[s + BASE], vectors[s + WEIGHTS]
    enough, rounded, floor = tight(controls)
    still = floor if controls[CONTROL] == TOLERANCE else rounded
    before = 0.0
    for i in range(1, s):
        if low[(i - 1) * s] == 0.0:
            return FAILED
        copy(k[0], k[i])
    for turn in range(MOST):
        total = 0.0
        for i in range(1, s):
            copy(k[i], vectors[room + i - 1])
        for i in range(1, s):
            row, own, first = row_of(coefficients, s, i), h * low[(i - 1) * s], (i - 1) * q
            for e in range(n):
                base[e] = y[e] + h * row[0] * k[0, e]
            for j in range(1, s):
                c_ij, last = low[first + j - 1], vectors[room + j - 1]
                lead, lag = h * c_ij if j < i else 0.0, h * (row[j] - c_ij)
                for e in range(n):
                    base[e] += lead * k[j, e] + lag * last[e]
            if turn == 0:
                for e in range(n):
                    k[i, e] = (y[e] - base[e]) / own
            if reach(
                rhs, factor, solve, handle, structure, t + c[i] * h, own, i, k, y, y_stage, ledger_rates, ledger_offset,
                out, scale, controls, loop_state, nnz, work, vectors, factors,
            ) == FAILED:  # fmt: skip
                return FAILED
            last = vectors[room + i - 1]
            for e in range(n):
                change = h * (k[i, e] - last[e]) * weights[e]
                total += change * change
        size = sqrt(total / max(q * n, 1))
        if size <= enough or size <= still and turn >= q and size >= 0.5 * before or size <= floor and turn == MOST - 1:
            return CONVERGED
        lead_on(q, k, room, weights, vectors, 1.0 if turn >= q and size > SLOW * before else 0.0)
        before = size
    return FAILED


@inner
def lead_on(q, k, room, weights, vectors, share):
    """K <- K - g (K - K_before), g = <d, d - d_before> / |d - d_before|^2 of the changes d; keeps both for the next.

    share : 0 to keep them alone.
    """
    dot, square = 0.0, 0.0
    for i in range(q):
        ki, last, change = k[i + 1], vectors[room + i], vectors[room + q + i]
        for e in range(weights.size):
            d = (ki[e] - last[e]) * weights[e]
            more = d - change[e] * weights[e]
            dot += d * more
            square += more * more
    g = share * max(dot / square, -FARTHEST) if square > 0.0 and square < np.inf else 0.0
    for i in range(q):
        ki, last, change, came = k[i + 1], vectors[room + i], vectors[room + q + i], vectors[room + 2 * q + i]
        for e in range(weights.size):
            new = ki[e]
            change[e] = new - last[e]
            ki[e] = new - g * (new - came[e])
            came[e] = new
