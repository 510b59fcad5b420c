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
from fvsolve.steppers import loop_records as rec
from fvsolve.steppers.coefficients import nodes_of, row_of
from fvsolve.steppers.newton import CONVERGED, FAILED, damped_limits, solve_stage_from_start
from fvsolve.steppers.step_operations import copy

MOST = 40
# Ratio of successive changes above which K is extrapolated; greatest extrapolation, in changes.
SLOW, GREATEST_EXTRAPOLATION = 0.4, 10.0


@inline
def base_of_stage(r, low, h, i, y):
    """Compute the state `base` of stage i in a sweep, from the slopes of this sweep and of the last one.

    low : as in `sweep`; y : state at the start of the step
    """
    s, k, base, row = r.k.shape[0], r.k, r.base, row_of(r.coefficients, r.k.shape[0], i)
    first = (i - 1) * (s - 1)
    for e in range(y.size):
        base[e] = y[e] + h * row[0] * k[0, e]
    for j in range(1, s):
        c_ij, slope, last = low[first + j - 1], k[j], r.transformed[j - 1]
        lead, lag = h * c_ij if j < i else 0.0, h * (row[j] - c_ij)
        for e in range(y.size):
            base[e] += lead * slope[e] + lag * last[e]


@inline
def sweep_once(handle, r, low, t, h, now, turn):
    """Solve all stages in turn; returns the sum of squares of the changes of the slopes, or -1 if a stage fails.

    turn : number of the sweep, from 0; other arguments as for `sweep`
    """
    k, y, base, weights, c = r.k, r.y[now], r.base, r.weights, nodes_of(r.coefficients, r.k.shape[0])
    s, total = k.shape[0], 0.0
    for i in range(1, s):
        copy(k[i], r.transformed[i - 1])
    for i in range(1, s):
        own, ki, last = h * low[(i - 1) * s], k[i], r.transformed[i - 1]
        base_of_stage(r, low, h, i, y)
        if turn == 0:
            for e in range(y.size):
                ki[e] = (y[e] - base[e]) / own
        if solve_stage_from_start(handle, r, t + c[i] * h, own, i, y) == FAILED:
            return -1.0
        for e in range(y.size):
            change = h * (ki[e] - last[e]) * weights[e]
            total += change * change
    return total


@inline
def sweep(handle, r, low, t, h, now):
    """Compute the slopes k of the stages and their ledger rates in sweeps; returns CONVERGED or FAILED.

    low : float64[q q]  lower triangular matrix C by rows, with A = C U, see `coefficients.lower`
    The rows of `transformed` receive the slopes before a sweep, their changes, and the slopes after it.
    handle, r : handle of the model, open handle of the run; t, h, now : as for `irk.attempt`
    """
    k, s, n = r.k, r.k.shape[0], r.k.shape[1]
    q = s - 1
    enough, rounded, floor = damped_limits(r.control[0])
    settled = floor if r.control[0]["mode"] == rec.TOLERANCE else rounded
    before = 0.0
    for i in range(1, s):
        if low[(i - 1) * s] == 0.0:
            return FAILED
        copy(k[0], k[i])
    for turn in range(MOST):
        total = sweep_once(handle, r, low, t, h, now, turn)
        if total == -1.0:
            return FAILED
        size = sqrt(total / max(q * n, 1))
        slow = turn >= q and size >= 0.5 * before
        if size <= enough or size <= settled and slow or size <= floor and turn == MOST - 1:
            return CONVERGED
        extrapolate(r, 1.0 if turn >= q and size > SLOW * before else 0.0)
        before = size
    return FAILED


@inline
def extrapolate(r, weight):
    """Extrapolate the slopes K after a sweep, and store the change d and the result of this sweep.

    The new slopes are K - weight g (K - K_last), g = <d, d - d_before> / |d - d_before|^2, but g is at least
    -GREATEST_EXTRAPOLATION.
    d, d_before : changes in this and in the last sweep; K_last : result of the last sweep before its extrapolation
    weight : 1 to extrapolate, 0 to store only
    """
    k, rows, weights, dot, square = r.k, r.transformed, r.weights, 0.0, 0.0
    q = k.shape[0] - 1
    for i in range(q):
        ki, last, change = k[i + 1], rows[i], rows[q + i]
        for e in range(weights.size):
            d = (ki[e] - last[e]) * weights[e]
            difference = d - change[e] * weights[e]
            dot += d * difference
            square += difference * difference
    g = weight * max(dot / square, -GREATEST_EXTRAPOLATION) if square > 0.0 and square < np.inf else 0.0
    for i in range(q):
        ki, last, change, swept = k[i + 1], rows[i], rows[q + i], rows[2 * q + i]
        for e in range(weights.size):
            new = ki[e]
            change[e] = new - last[e]
            ki[e] = new - g * (new - swept[e])
            swept[e] = new
