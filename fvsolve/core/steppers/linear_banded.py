"""Banded LU factors of shift I - J with partial pivoting, for models that are a single line of cells.

States are reordered so that neighbours are adjacent. The array `factors` holds the rows of U from the first column that
they can reach, multipliers column by column, and the row exchanged with each pivot. A work vector and the upper
bandwidth of U follow.
"""

import numpy as np

from fvsolve.core.steppers.structure import (
    LEAST_PIVOT,
    SIZE,
    SOLVER_DATA,
    STARTS,
    bad_row,
    reciprocal,
    size_of,
)
from fvsolve.jit import njit

# Data of this solver in the structure: bandwidths and row length, then the state of each reordered row, then the place
# of every entry.
BELOW, ABOVE, WIDTH, ORDER = 0, 1, 2, 3
CHUNK = 4  # columns processed at once
# The diagonal entry is the pivot from this fraction of the greatest entry on: without row exchange it is quicker.
DIAGONAL_PIVOT = 0.1


def prepare(pattern) -> tuple[np.ndarray, int]:
    """(data that the compiled functions of this solver read : int64[:], length of the array `factors`).

    pattern : sparse pattern of the Jacobian, by columns. The data are bandwidths and row length, the order of the
    states, and for every Jacobian entry its index in `factors`.
    """
    n = pattern.shape[1]
    order, below, above = band(pattern)
    # Row exchanges widen U to both bandwidths together; rows end with a whole chunk.
    width = below + 1 + CHUNK * -(-(below + above) // CHUNK)
    size = n * width + n * below + 2 * n + 2
    rows, columns = entries(pattern)
    place = np.full(rows.size, size - 1)  # ledger rows go to an unused place
    inside = rows < n
    new = np.argsort(order)
    i, j = new[rows[inside]], new[columns[inside]]
    place[inside] = i * width + below + j - i
    return np.concatenate(([below, above, width], order, place)).astype(np.int64), size


def band(pattern) -> tuple[np.ndarray, int, int]:
    """(order of the states by the reverse Cuthill-McKee rule (1969), bandwidth below, bandwidth above the diagonal).

    pattern : sparse pattern of the Jacobian, by columns
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    n = pattern.shape[1]
    square = pattern[:n]
    order = reverse_cuthill_mckee(csr_matrix(square + square.T), symmetric_mode=True)
    new = np.argsort(order)
    rows, columns = entries(square)
    apart = new[rows] - new[columns]
    return order, int(max(apart.max(initial=0), 0)), int(max(-apart.min(initial=0), 0))


def entries(pattern) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of all entries of a sparse pattern, in the order in which they are stored, by columns."""
    return pattern.indices, np.repeat(np.arange(pattern.shape[1]), np.diff(pattern.indptr))


@njit(forceinline=True)
def subtract(factor, x, y, chunks):
    """Subtract `factor` times x from y, in the first 4 `chunks` entries, four at a time."""
    for c in range(chunks):
        a = y[4 * c] - factor * x[4 * c]
        b = y[4 * c + 1] - factor * x[4 * c + 1]
        d = y[4 * c + 2] - factor * x[4 * c + 2]
        e = y[4 * c + 3] - factor * x[4 * c + 3]
        y[4 * c], y[4 * c + 1], y[4 * c + 2], y[4 * c + 3] = a, b, d, e


def factor(structure, jacobian, shift, factors):
    """Factor the matrix shift I - J = L U with row exchanges; returns 0, or 1 + the number of a state without a pivot.

    structure : flat array of `Structure.shape`; jacobian : entries of J in the order of the pattern
    factors : receives L, U and the row exchanges
    """
    n, own = structure[SIZE], structure[structure[SOLVER_DATA] :]
    below = own[BELOW]
    above = own[ABOVE]
    width = own[WIDTH]
    order = own[ORDER:]
    place, lower = order[n:], factors[n * width :]
    pivots = lower[n * below :]
    bad = bad_row(structure, jacobian)
    if bad > 0:
        return bad
    for e in range(n * width):
        factors[e] = 0.0
    for p in range(structure[structure[STARTS] + n]):
        factors[place[p]] = -jacobian[p]
    for i in range(n):
        factors[i * width + below] += shift
    last = 0  # last column that exchanged rows have filled
    for k in range(n):
        at, rest = k * width + below, min(below, n - 1 - k)
        here, pivot = size_of(factors[at]), 0
        best = here
        for d in range(1, rest + 1):
            size = size_of(factors[at + d * (width - 1)])
            if size > best:
                best, pivot = size, d
        # A diagonal entry that is large enough spares the exchange of two rows.
        if here >= DIAGONAL_PIVOT * best:
            pivot, best = 0, here
        if not LEAST_PIVOT < best < 1.0 / LEAST_PIVOT:
            return order[k] + 1
        pivots[k] = pivot
        if pivot > 0:
            exchanged = at + pivot * (width - 1)
            for e in range(below + above + 1):
                factors[at + e], factors[exchanged + e] = factors[exchanged + e], factors[at + e]
            # An exchanged row reaches further to the right, and so do the rows from which it is subtracted.
            last = max(last, k + pivot + above)
        chunks = (max(above, last - k) + CHUNK - 1) // CHUNK
        per = reciprocal(factors[at])
        factors[at] = per
        for d in range(rest):
            row = at + (d + 1) * (width - 1)
            share = factors[row] * per
            lower[k * below + d] = share
            subtract(share, factors[at + 1 :], factors[row + 1 :], chunks)
    pivots[2 * n] = above if last == 0 else above + below
    return 0


def solve(structure, factors, x):
    """Replace x with (shift I - J)^-1 x, with the factors that `factor` has computed."""
    n, own = structure[SIZE], structure[structure[SOLVER_DATA] :]
    below = own[BELOW]
    width = own[WIDTH]
    order = own[ORDER:]
    lower = factors[n * width :]
    pivots = lower[n * below :]
    work, reach = pivots[n:], int(pivots[2 * n].real)
    for i in range(n):
        work[i] = x[order[i]]
    for k in range(n):
        pivot = int(pivots[k].real)
        value = work[k + pivot]
        work[k + pivot] = work[k]
        work[k] = value
        for d in range(min(below, n - 1 - k)):
            work[k + 1 + d] -= lower[k * below + d] * value
    for i in range(n - 1, -1, -1):
        at, total = i * width + below, work[i]
        for d in range(min(reach, n - 1 - i), 0, -1):
            total -= factors[at + d] * work[i + d]
        total *= factors[at]
        work[i] = x[order[i]] = total
