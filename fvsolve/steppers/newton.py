"""What implicit steps share: Jacobian and factors and when to renew them, stopping of Newton. Knows no tableau.

Kept between steps: `work`, a header and the Jacobian; in `vectors` f at the last step's start; its stages. A restart
stores them (`Stepper.memories`) and factors anew: factors follow from the Jacobian and the shift to the last bit.
"""

from __future__ import annotations

import numpy as np

from fvsolve.jit import inner
from fvsolve.steppers.differences import differences, multiply
from fvsolve.steppers.orders import (
    CALLS,
    CONTROL,
    HAS,
    HEADER,
    JACOBIANS,
    KNOWN,
    LAST,
    MADE,
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
# what a stage starts from (Rosenbrock: df/dt); then, for fully implicit methods, transformed increments, f and
# residuals of all stages.
FIRST, INCREMENT, WEIGHTS, MOVED, RATE, BASE, STAGES = range(7)

MOST = 10  # iterations
FIXED, FLOOR = 1e-13, 1e-7  # accuracy aimed at where the step is given, relative; and what must be reached
ENOUGH = 0.05  # of the tolerance
STALE = 0.03  # a Jacobian that gains less than this in an iteration is made anew for the next step
CONVERGED, FAILED = 0, 1


def forget(work: np.ndarray) -> None:
    """Keep nothing over a kink: no Jacobian, no stages to go on from."""
    work[:STORE] = 0.0
    work[SEEN], work[SURE] = -1.0, 1.0


@inner
def begin(k, y, scale, orders, memory, work, vectors):
    """At the first try of a step: keep the last stages to go on from; judge the Jacobian by their iterations."""
    s, n = k.shape
    if work[SEEN] == memory[STEPS]:
        return
    tolerance = orders[SIZE] if orders[CONTROL] == TOLERANCE else FIXED
    weights, first, last = vectors[s + WEIGHTS], vectors[s + FIRST], vectors[0]
    for i in range(n):
        weights[i] = 1.0 / (tolerance * small(scale[i], y[i]))
        last[i], first[i] = first[i], k[0, i]
    for j in range(1, s):
        copy(k[j], vectors[j])
    work[KNOWN] = 1.0 if work[SEEN] == memory[STEPS] - 1.0 and memory[LAST] > 0.0 else 0.0
    if work[RATIO] > STALE:
        work[HAS] = 0.0
    work[SEEN], work[RATIO] = memory[STEPS], 0.0


@inner
def renew(rhs, handle, shape, where, t, y, k, supply, scale, out, memory, work, vectors):
    """The Jacobian at the start of the step, from the fresh f there."""
    s = k.shape[0]
    calls = differences(
        rhs, handle, shape, where, t, y, k[0], supply[0], scale, vectors[s + MOVED], vectors[s + RATE], out,
        work[HEADER:],
    )  # fmt: skip
    memory[CALLS] += calls
    memory[JACOBIANS] += 1.0
    work[HAS], work[MADE], work[SHIFT], work[RATIO] = 1.0, memory[STEPS], 0.0, 0.0


@inner
def size_of(d, weights):
    """Sum of squares of an increment in units of the tolerance."""
    total = 0.0
    for i in range(weights.size):
        total += (d[i] * weights[i]) * (d[i] * weights[i])
    return total


@inner
def find_worst(d, f, weights, memory):
    """Note the component whose rate is no number, else the one that moves most against its tolerance."""
    worst = -1.0
    for i in range(weights.size):
        e = abs(d[i] * weights[i]) if abs(f[i]) < np.inf else np.inf
        if e > worst:  # a rate that is no number makes increments of others none too
            worst, memory[WORST] = e, i


@inner
def verdict(turn, size, before, orders, work):
    """(whether to stop, why) after iteration `turn` with an increment of `size`, the one before it of `before`."""
    enough, floor = 1.0, FLOOR / FIXED
    if orders[CONTROL] == TOLERANCE:
        enough = floor = max(1e-15 / orders[SIZE], ENOUGH)
    if not size < np.inf:
        return True, FAILED
    if turn > 0:
        ratio = size / before if before > 0.0 else 0.0
        work[RATIO] = max(work[RATIO], ratio)
        if ratio >= 0.3 and size <= floor:  # what remains is rounding, or a kink that no iteration sees through
            return True, CONVERGED
        if ratio >= 0.99:
            return True, FAILED
        work[SURE] = ratio / (1.0 - ratio)
        if work[SURE] * size * ratio ** (MOST - 1 - turn) > floor:
            return True, FAILED
    else:
        work[SURE] = max(work[SURE], 1e-4) ** 0.8
    if work[SURE] * size <= enough:
        return True, CONVERGED
    return turn == MOST - 1, CONVERGED if turn > 0 and work[SURE] * size <= floor else FAILED


@inner
def book_increment(shape, nnz, d, supply, i, work):
    """Add to the ledger rates of stage i what the last increment d of its state changes in them, by that Jacobian."""
    n, product = d.size, work[HEADER + nnz :]
    multiply(shape, work[HEADER : HEADER + nnz], d, product)
    for m in range(supply.shape[1]):
        supply[i, m] += product[n + m]
