"""What implicit steps share: Jacobian and factors and when to renew them, stopping of Newton. Knows no tableau.

Newton is simplified, with the Jacobian of the step's start, as long as that converges. Where the slope of f changes by
orders within a step, as a valve's does about zero drop, it goes to and fro: then it is damped, with the Jacobian of
every iterate.

Kept between steps: `work`, a header and the Jacobian; in `vectors` f at the last step's start; its stages. A restart
stores them (`Stepper.memories`) and factors anew: factors follow from the Jacobian and the shift to the last bit.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from fvsolve.jit import inner
from fvsolve.steppers.differences import differences, multiply
from fvsolve.steppers.slots import (
    CALLS,
    CONTROL,
    DAMPED,
    FACTORS,
    HAS,
    HEADER,
    JACOBIANS,
    KNOWN,
    LAST,
    MADE,
    NEWTON,
    NEWTON_FAILED,
    RATIO,
    SEEN,
    SHIFT,
    SIZE,
    STEPS,
    STORE,
    SURE,
    TOLERANCE,
    WORST,
)
from fvsolve.steppers.step import copy, small

# Rows of `vectors` behind the s stages of the last step: f at its start, an increment, weights, two for differences,
# what a stage starts from (Rosenbrock: df/dt), a slope to fall back on; then, for fully implicit methods, transformed
# increments, f and residuals of all stages.
FIRST, INCREMENT, WEIGHTS, MOVED, RATE, BASE, REACHED, STAGES = range(8)

MOST = 10  # iterations
# Accuracy aimed at where the step is given, relative; what may be left by rounding; and what must be reached.
FIXED, ROUNDED, FLOOR = 1e-13, 1e-10, 1e-7
ENOUGH = 0.05  # of the tolerance
STALE = 0.03  # a Jacobian that gains less than this in an iteration is made anew for the next step
CONVERGED, FAILED = 0, 1
MOST_DAMPED, LEAST_PART = 40, 1e-4  # iterations, and what part of an increment is tried
LEAST_WAY = 1 / 64  # what part of a step's length a stage is followed by


def forget(work: np.ndarray) -> None:
    """Keep nothing over a kink: no Jacobian, no stages to go on from."""
    work[:STORE] = 0.0
    work[SEEN] = work[DAMPED] = -1.0
    work[SURE] = 1.0


@inner
def begin(k, y, scale, controls, loop_state, work, vectors):
    """At the first try of a step: keep the last stages to go on from; judge the Jacobian by their iterations."""
    s, n = k.shape
    if work[SEEN] == loop_state[STEPS]:
        return
    tolerance = controls[SIZE] if controls[CONTROL] == TOLERANCE else FIXED
    weights, first, last = vectors[s + WEIGHTS], vectors[s + FIRST], vectors[0]
    for i in range(n):
        weights[i] = 1.0 / (tolerance * small(scale[i], y[i]))
        last[i], first[i] = first[i], k[0, i]
    for j in range(1, s):
        copy(k[j], vectors[j])
    goes_on = work[SEEN] == loop_state[STEPS] - 1.0 and loop_state[LAST] > 0.0
    work[KNOWN] = min(work[KNOWN] + 1.0, 2.0) if goes_on else 0.0
    if work[RATIO] > STALE:
        work[HAS] = 0.0
    work[SEEN], work[RATIO] = loop_state[STEPS], 0.0


@inner
def renew(rhs, handle, structure, ledger_offset, t, y, f, ledger_rates, scale, out, loop_state, work, moved, rate):
    """The Jacobian at y, from the fresh f and ledger rates there; moved, rate : room for a state and its rates."""
    calls = differences(
        rhs, handle, structure, ledger_offset, t, y, f, ledger_rates, scale, moved, rate, out, work[HEADER:]
    )
    loop_state[CALLS] += calls
    loop_state[JACOBIANS] += 1.0
    work[HAS], work[MADE], work[SHIFT], work[RATIO] = 1.0, loop_state[STEPS], 0.0, 0.0


@inner
def spectral_radius(structure, work, nnz, scale, v):
    """Largest |eigenvalue| of the Jacobian, about, by five turns of the power method."""
    n, product, before, now = v.size, work[HEADER + nnz :], 0.0, 0.0
    for e in range(n):
        v[e] = scale[e] if e % 2 == 0 else -scale[e]
    for _ in range(5):
        multiply(structure, work[HEADER : HEADER + nnz], v, product)
        total = 0.0
        for e in range(n):
            total += (product[e] / scale[e]) * (product[e] / scale[e])
        before, now = now, sqrt(total)
        for e in range(n):
            v[e] = product[e] / now if now > 0.0 else 0.0
    return sqrt(before * now)  # of a pair, whose single quotients swing


@inner
def size_of(d, weights):
    """Sum of squares of an increment in units of the tolerance."""
    total = 0.0
    for i in range(weights.size):
        total += (d[i] * weights[i]) * (d[i] * weights[i])
    return total


@inner
def along(d, other, weights):
    """(<d, other> / <d, d>, |other|^2 / |d|^2): how far along d the next increment goes, and how long it is."""
    square = dot = size = 0.0
    for i in range(weights.size):
        w = weights[i] * weights[i]
        square += w * d[i] * d[i]
        dot += w * d[i] * other[i]
        size += w * other[i] * other[i]
    return dot / square, size / square


@inner
def shortened(part, ahead, size):
    """What part of an increment to take, having tried `part`: the same where the next one is shorter or goes on.

    The next one, by the same factors, is `ahead` along this one and of squared length `size`, both relative. Where it
    turns back, the secant says where it would not (natural monotonicity: Deuflhard 2004, 3.3).
    """
    if not size < np.inf:
        return 0.25 * part
    if 0.0 <= ahead <= 1.0 or size <= (1.0 - 0.25 * part) ** 2:
        return part
    if ahead > 1.0:  # it has grown: to where the parabola through both ends is least
        return part * min(0.5, max(0.1, 0.5 * part / (ahead - 1.0 + part)))
    return part * min(0.7, max(0.1, 1.0 / (1.0 - ahead)))


@inner
def goal(controls):
    """(increment at which Newton may stop, and at which what is left is rounding), in units of the tolerance."""
    if controls[CONTROL] == TOLERANCE:
        enough = max(1e-15 / controls[SIZE], ENOUGH)
        return enough, enough
    return 1.0, ROUNDED / FIXED


@inner
def tight(controls):
    """The same where Newton is damped, and what it must reach where nothing gains any more.

    As accurate as where the step is given, for f magnifies what is left.
    """
    unit = controls[SIZE] if controls[CONTROL] == TOLERANCE else FIXED
    floor = goal(controls)[1] if controls[CONTROL] == TOLERANCE else FLOOR / unit
    return FIXED / unit, min(ROUNDED / unit, floor), floor


@inner
def find_worst(d, f, weights, loop_state):
    """Note the component whose rate is no number, else the one that moves most against its tolerance."""
    worst = -1.0
    for i in range(weights.size):
        e = abs(d[i] * weights[i]) if abs(f[i]) < np.inf else np.inf
        if e > worst:  # a rate that is no number makes increments of others none too
            worst, loop_state[WORST] = e, i


@inner
def verdict(turn, size, before, controls, work):
    """(whether to stop, why) after iteration `turn` with an increment of `size`, the one before it of `before`."""
    enough, rounded = goal(controls)
    if not size < np.inf:
        return True, FAILED
    if turn > 0:
        ratio = size / before if before > 0.0 else 0.0
        work[RATIO] = max(work[RATIO], ratio)
        if ratio >= 0.3 and size <= rounded:
            return True, CONVERGED
        if ratio >= 0.99:
            return True, FAILED
        work[SURE] = ratio / (1.0 - ratio)
        if work[SURE] * size * ratio ** (MOST - 1 - turn) > rounded:
            return True, FAILED
    else:
        work[SURE] = max(work[SURE], 1e-4) ** 0.8
    if work[SURE] * size <= enough:
        return True, CONVERGED
    return turn == MOST - 1, CONVERGED if turn > 0 and work[SURE] * size <= rounded else FAILED


@inner
def book_increment(structure, nnz, d, ledger_rates, i, work):
    """Add to the ledger rates of stage i what the last increment d of its state changes in them, by that Jacobian."""
    n, product = d.size, work[HEADER + nnz :]
    multiply(structure, work[HEADER : HEADER + nnz], d, product)
    for m in range(ledger_rates.shape[1]):
        ledger_rates[i, m] += product[n + m]


@inner
def evaluate(rhs, handle, t, h_gamma, base, ki, y_stage, f, out, loop_state, residual):
    """f at the stage whose slope is ki, and f - ki."""
    for j in range(ki.size):
        y_stage[j] = base[j] + h_gamma * ki[j]
    rhs(t, y_stage, f, out, handle)
    loop_state[CALLS] += 1.0
    loop_state[NEWTON] += 1.0
    for j in range(ki.size):
        residual[j] = f[j] - ki[j]


@inner
def damp(
    rhs, factor, solve, handle, structure, t, h_gamma, i, k, y_stage, ledger_rates, ledger_offset, out, scale, controls,
    loop_state, nnz, work, vectors, factors,
):  # fmt: skip
    """k[i] = f(t, base + h gamma k[i]) by damped Newton, a Jacobian for every iterate; returns CONVERGED or FAILED."""
    s, n = k.shape
    base, d, f, weights = vectors[s + BASE], vectors[s + INCREMENT], vectors[s + RATE], vectors[s + WEIGHTS]
    other, shift, ki = vectors[s + MOVED], 1.0 / h_gamma, k[i]
    enough, rounded, floor = tight(controls)
    before = np.inf
    evaluate(rhs, handle, t, h_gamma, base, ki, y_stage, f, out, loop_state, d)
    for turn in range(MOST_DAMPED):
        for m in range(ledger_rates.shape[1]):
            ledger_rates[i, m] = out[ledger_offset + m]
        renew(
            rhs,
            handle,
            structure,
            ledger_offset,
            t,
            y_stage,
            f,
            ledger_rates[i],
            scale,
            out,
            loop_state,
            work,
            other,
            d,
        )
        loop_state[FACTORS] += 1.0
        if factor(structure, work[HEADER:], shift, factors) != 0:
            break
        work[SHIFT] = shift
        for j in range(n):
            d[j] = f[j] - ki[j]
        solve(structure, factors, d)
        size = sqrt(size_of(d, weights) / max(n, 1))
        done = size <= enough or size <= rounded and size >= 0.5 * before or size <= floor and turn == MOST_DAMPED - 1
        part, tried, length, before = 1.0, 0.0, 0.0, size
        while not done and part != tried and part > LEAST_PART:
            for j in range(n):
                ki[j] += shift * (part - tried) * d[j]
            evaluate(rhs, handle, t, h_gamma, base, ki, y_stage, f, out, loop_state, other)
            if size <= rounded:  # which way the next increment goes says nothing
                tried = part
                break
            solve(structure, factors, other)
            ahead, length = along(d, other, weights)
            tried, part = part, shortened(part, ahead, length)
        if part != tried and size <= floor and length < np.inf:  # rounding, or a kink that no iterate sees through
            done = True
        if done:
            for j in range(n):
                ki[j] += shift * (1.0 - tried) * d[j]
            book_increment(structure, nnz, d, ledger_rates, i, work)
            work[DAMPED], work[RATIO], work[SURE] = loop_state[STEPS], 1.0, 1.0
            return CONVERGED
        if part != tried or not size < np.inf:
            break
    find_worst(d, f, weights, loop_state)
    work[HAS] = 0.0
    return FAILED


@inner
def reach(
    rhs, factor, solve, handle, structure, t, h_gamma, i, k, y, y_stage, ledger_rates, ledger_offset, out, scale,
    controls, loop_state, nnz, work, vectors, factors,
):  # fmt: skip
    """The same by `damp`; where that fails and the step is given from the stage y, and last along h gamma.

    There the slope of a step of no length is followed as it grows. Under a tolerance a shorter step is cheaper.
    """
    base, known, ki = vectors[k.shape[0] + BASE], vectors[k.shape[0] + REACHED], k[i]
    done, part, turn, worst = 0.0, 1.0, 0, loop_state[WORST]  # as plain Newton left it
    while part >= LEAST_WAY:
        if turn == 1:
            for j in range(ki.size):
                ki[j] = (y[j] - base[j]) / h_gamma
        elif turn > 1:
            copy(known, ki)
        why = damp(
            rhs, factor, solve, handle, structure, t, h_gamma * (done + part), i, k, y_stage, ledger_rates,
            ledger_offset, out, scale, controls, loop_state, nnz, work, vectors, factors,
        )  # fmt: skip
        if why == CONVERGED:
            done += part
            if done == 1.0:
                return CONVERGED
            copy(ki, known)
        elif controls[CONTROL] == TOLERANCE:
            return FAILED
        elif turn == 0:
            for j in range(ki.size):
                known[j] = 0.0
        else:
            part *= 0.5
        loop_state[WORST] = worst
        turn += 1
    return FAILED


@inner
def smoothed_error(
    rhs, factor, solve, handle, structure, ledger_offset, t, h, y, y_new, k, ledger_rates, error, shift, scale, out,
    controls, loop_state, work, vectors, factors,
):  # fmt: skip
    """Error of a damped step, (I - J / shift)^-1 h sum e_j k_j with J from its start, in units of the tolerance.

    A stiff f counts for what it moves within the step (Hosea and Shampine 1996). Where a jump makes J turn the error
    round, it counts as it is.
    """
    s, n = k.shape
    d, f, whole, dot, smooth = vectors[s + INCREMENT], vectors[s + RATE], 0.0, 0.0, 0.0
    renew(
        rhs,
        handle,
        structure,
        ledger_offset,
        t,
        y,
        k[0],
        ledger_rates[0],
        scale,
        out,
        loop_state,
        work,
        vectors[s + MOVED],
        f,
    )
    loop_state[FACTORS] += 1.0
    work[RATIO] = 1.0
    if factor(structure, work[HEADER:], shift, factors) != 0:
        return NEWTON_FAILED
    for i in range(n):
        f[i] = 0.0
        for j in range(s):
            f[i] += h * error[j] * k[j, i]
        d[i] = shift * f[i]
    solve(structure, factors, d)
    for i in range(n):
        w = 1.0 / (controls[SIZE] * (scale[i] + max(abs(y[i]), abs(y_new[i]))))
        whole += (w * f[i]) * (w * f[i])
        dot += (w * f[i]) * (w * d[i])
        smooth += (w * d[i]) * (w * d[i])
    return sqrt((smooth if dot > 0.0 else whole) / max(n, 1))
