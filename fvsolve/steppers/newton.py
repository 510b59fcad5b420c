"""What implicit steps share: Jacobian and factors and when to renew them, stopping of Newton. Knows no tableau.

Kept between steps, in one flat array: a header, the Jacobian, the last step's stages. A restart stores it and
factors anew: factors follow from the Jacobian and the shift to the last bit.
"""

from __future__ import annotations

import numpy as np

from fvsolve.jit import njit
from fvsolve.steppers.differences import differences, multiply
from fvsolve.steppers.orders import CALLS, CONTROL, JACOBIANS, LAST, SIZE, STEPS, TOLERANCE, WORST
from fvsolve.steppers.step import HUGE, copy

# The header of `work`: whether there is a Jacobian, the step it was made at, whether the last step's stages are known,
# the step that the present stages belong to, the shift factored last (0: none), the worst ratio of two increments
# of a step, the last such ratio / (1 - ratio), and places of arrays behind the kept part.
HAS, MADE, KNOWN, SEEN, SHIFT, RATIO, SURE = range(7)
PLACES = 7  # increment, weights, two vectors of n, one of n + m, of all stages three times, with the factors between
STORE_SIZE = 16
HEADER = 17
JACOBIAN = HEADER

MOST = 10  # iterations
FIXED = 1e-13  # accuracy of a step that is given, relative
STALLED = 1e-9  # below it an iteration that no longer gains has met rounding
CONVERGED, FAILED = 0, 1


def new_work(n: int, m: int, nnz: int, s: int, stores: int, size: int) -> tuple[np.ndarray, int]:
    """(work, how much of it must be remembered) for n states, m ledger rows, s stages, `stores` factors of `size`."""
    kept = HEADER + nnz + s * n + n
    sizes = (n, n, n, n, n + m, s * n, s * n, stores * size, s * n)
    work = np.zeros(kept + sum(sizes))
    work[PLACES : PLACES + len(sizes)] = kept + np.cumsum([0, *sizes[:-1]])
    work[STORE_SIZE] = size
    forget(work)
    return work, kept


def forget(work: np.ndarray) -> None:
    """Keep nothing over a kink: no Jacobian, no stages to go on from."""
    work[:PLACES] = 0.0
    work[SEEN], work[SURE] = -1.0, 1.0


@njit(inline="always")
def part(work, which, size):
    """One of the arrays behind the kept part."""
    at = int(work[PLACES + which])
    return work[at : at + size]


@njit(inline="always")
def store_of(work):
    """(room for factors, the size of one)."""
    return work[int(work[PLACES + 7]) : int(work[PLACES + 8])], int(work[STORE_SIZE])


@njit
def begin(k, y, scale, orders, memory, nnz, work):
    """At the first try of a step: keep the last stages to go on from; judge the Jacobian by their iterations."""
    s, n = k.shape
    tolerance = orders[SIZE] if orders[CONTROL] == TOLERANCE else FIXED
    weights = part(work, 1, n)
    for i in range(n):
        weights[i] = 1.0 / (tolerance * (scale[i] + abs(y[i])))
    if work[SEEN] == memory[STEPS]:
        return
    last = work[HEADER + nnz : HEADER + nnz + s * n]
    first = work[HEADER + nnz + s * n : HEADER + nnz + s * n + n]
    work[KNOWN] = 1.0 if work[SEEN] == memory[STEPS] - 1.0 and memory[LAST] > 0.0 else 0.0
    for i in range(n):
        last[i], first[i] = first[i], k[0, i]
    for j in range(1, s):
        copy(k[j], last[j * n : j * n + n])
    if work[RATIO] > 1e-3:
        work[HAS] = 0.0
    work[SEEN], work[RATIO] = memory[STEPS], 0.0


@njit
def renew(rhs, handle, shape, where, t, y, k, supply, scale, out, memory, nnz, work):
    """The Jacobian at the start of the step, from the fresh f there."""
    n = y.size
    calls = differences(
        rhs, handle, shape, where, t, y, k[0], supply[0], scale, part(work, 2, n), part(work, 3, n), out,
        work[JACOBIAN : JACOBIAN + nnz],
    )  # fmt: skip
    memory[CALLS] += calls
    memory[JACOBIANS] += 1.0
    work[HAS], work[MADE], work[SHIFT], work[RATIO] = 1.0, memory[STEPS], 0.0, 0.0


@njit
def increment_size(d, weights, memory):
    """Root mean square of an increment in units of the tolerance; infinite where it is not a number."""
    total, worst, at = 0.0, -1.0, 0
    n = weights.size
    for j in range(d.size // n):
        for i in range(n):
            e = abs(d[j * n + i] * weights[i])
            total += e * e
            if not e <= worst:
                worst, at = e, i
    memory[WORST] = at
    return np.sqrt(total / d.size) if total < HUGE * HUGE else np.inf


@njit
def verdict(turn, size, before, orders, work):
    """(whether to stop, why) after iteration `turn` with an increment of `size`, the one before it of `before`."""
    fixed = orders[CONTROL] != TOLERANCE
    enough = 1.0 if fixed else max(1e-15 / orders[SIZE], min(0.03, np.sqrt(orders[SIZE])))
    if not size < np.inf:
        return True, FAILED
    if turn > 0:
        ratio = size / before if before > 0.0 else 0.0
        stalled = size * FIXED <= STALLED if fixed else size * orders[SIZE] <= 1e-14
        if ratio >= 0.3 and stalled:
            return True, CONVERGED
        work[RATIO] = max(work[RATIO], ratio)
        if ratio >= 0.99:
            return True, FAILED
        work[SURE] = ratio / (1.0 - ratio)
        left = MOST - 1 - turn
        if work[SURE] * size * ratio**left > enough:
            return True, FAILED
    else:
        work[SURE] = max(work[SURE], 1e-16) ** 0.8
    if work[SURE] * size <= enough:
        return True, CONVERGED
    return turn == MOST - 1, FAILED


@njit
def book_increment(shape, nnz, d, supply, i, work):
    """Add to the ledger rates of stage i what the last increment d of its state changes in them, by that Jacobian."""
    n = d.size
    product = part(work, 4, n + supply.shape[1])
    if supply.shape[1] > 0:
        multiply(shape, work[JACOBIAN : JACOBIAN + nnz], d, product)
        for m in range(supply.shape[1]):
            supply[i, m] += product[n + m]
