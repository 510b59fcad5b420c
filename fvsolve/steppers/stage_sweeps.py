"""Stages of a fully implicit step solved one by one in sweeps, for slopes of f that differ by orders between stages.

Let A = C U be the coefficients of the q implicit stages, C lower triangular and U upper triangular with unit diagonal,
and K the slopes of the stages. The sweep K <- F(y + h (a_0 k_0 + C K + (A - C) K_before)) is a diagonally implicit
step, whose stages `newton.damped_newton` solves; a_0 are the weights of the slope k_0 at the start. Stiff components
converge in q sweeps, as I - U is nilpotent; the error of other components falls by a factor of 4 or more in each sweep
(van der Houwen and de Swart 1997). Limiters and weno weights can reduce this factor or make sweeps oscillate: then K is
extrapolated to the point where the last two changes cancel (Anderson 1965, depth one).
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from fvsolve.jit import inline
from fvsolve.steppers.coefficients import nodes_of, row_of
from fvsolve.steppers.loop_indices import CONTROL, TOLERANCE
from fvsolve.steppers.newton import BASE, CONVERGED, FAILED, WEIGHTS, damped_limits, solve_stage_from_start
from fvsolve.steppers.step_operations import copy

MOST = 40
# Ratio of successive changes above which K is extrapolated; greatest extrapolation, in changes.
SLOW, GREATEST_EXTRAPOLATION = 0.4, 10.0


@inline
def sweep(
    rhs, factor, solve, handle, coefficients, low, structure, t, h, y, y_stage, k, ledger_rates, ledger_offset, out,
    scale, controls, loop_state, nnz, first_row, work, vectors, factors,
):  # fmt: skip
    """Compute the slopes k of the stages and their ledger rates in sweeps; returns CONVERGED or FAILED.

    low : float64[q q]  lower triangular matrix C by rows, with A = C U, see `newton_transform.lower`
    first_row : first of 3 q rows of `vectors`, for the slopes before a sweep, their changes, and the slopes after it
    y : state at the start of the step; nnz : number of Jacobian entries; other arguments as for `dirk.attempt`
    """
    s, n = k.shape
    q, c, base, weights = s - 1, nodes_of(coefficients, s), vectors[s + BASE], vectors[s + WEIGHTS]
    enough, rounded, floor = damped_limits(controls)
    settled = floor if controls[CONTROL] == TOLERANCE else rounded
    before = 0.0
    for i in range(1, s):
        if low[(i - 1) * s] == 0.0:
            return FAILED
        copy(k[0], k[i])
    for turn in range(MOST):
        total = 0.0
        for i in range(1, s):
            copy(k[i], vectors[first_row + i - 1])
        for i in range(1, s):
            row, own, first = row_of(coefficients, s, i), h * low[(i - 1) * s], (i - 1) * q
            for e in range(n):
                base[e] = y[e] + h * row[0] * k[0, e]
            for j in range(1, s):
                c_ij, last = low[first + j - 1], vectors[first_row + j - 1]
                lead, lag = h * c_ij if j < i else 0.0, h * (row[j] - c_ij)
                for e in range(n):
                    base[e] += lead * k[j, e] + lag * last[e]
            if turn == 0:
                for e in range(n):
                    k[i, e] = (y[e] - base[e]) / own
            if solve_stage_from_start(
                rhs, factor, solve, handle, structure, t + c[i] * h, own, i, k, y, y_stage, ledger_rates, ledger_offset,
                out, scale, controls, loop_state, nnz, work, vectors, factors,
            ) == FAILED:  # fmt: skip
                return FAILED
            last = vectors[first_row + i - 1]
            for e in range(n):
                change = h * (k[i, e] - last[e]) * weights[e]
                total += change * change
        size = sqrt(total / max(q * n, 1))
        if (
            size <= enough
            or size <= settled
            and turn >= q
            and size >= 0.5 * before
            or size <= floor
            and turn == MOST - 1
        ):
            return CONVERGED
        extrapolate(q, k, first_row, weights, vectors, 1.0 if turn >= q and size > SLOW * before else 0.0)
        before = size
    return FAILED


@inline
def extrapolate(q, k, first_row, weights, vectors, weight):
    """Extrapolate the slopes K after a sweep, and store the change d and the result of this sweep.

    The new slopes are K - weight g (K - K_last), g = <d, d - d_before> / |d - d_before|^2, but g is at least
    -GREATEST_EXTRAPOLATION.
    d, d_before : changes in this and in the last sweep; K_last : result of the last sweep before its extrapolation
    q : number of implicit stages; first_row : as in `sweep`; weights : float64[n]  factors on states in the products
    weight : 1 to extrapolate, 0 to store only
    """
    dot, square = 0.0, 0.0
    for i in range(q):
        ki, last, change = k[i + 1], vectors[first_row + i], vectors[first_row + q + i]
        for e in range(weights.size):
            d = (ki[e] - last[e]) * weights[e]
            difference = d - change[e] * weights[e]
            dot += d * difference
            square += difference * difference
    g = weight * max(dot / square, -GREATEST_EXTRAPOLATION) if square > 0.0 and square < np.inf else 0.0
    for i in range(q):
        ki, last, change, swept = (
            k[i + 1],
            vectors[first_row + i],
            vectors[first_row + q + i],
            vectors[first_row + 2 * q + i],
        )
        for e in range(weights.size):
            new = ki[e]
            change[e] = new - last[e]
            ki[e] = new - g * (new - swept[e])
            swept[e] = new
