"""Factors of shift I - J inside a band, with partial pivoting. Knows arrays; for scenes that are one line.

States are put in an order that brings neighbours together. The store holds the rows of U from the first column that
they can reach, multipliers column by column, the row that each pivot came from, a vector to work in, and how far
rows of U reach.
"""

import numpy as np

from fvsolve.jit import njit
from fvsolve.steppers.pivots import LEAST, bad_row, reciprocal, size_of
from fvsolve.steppers.structure import OWN, SIZE, STARTS

# The kind's own part: bandwidths and lengths, then of each new row its state, then the place of every entry.
BELOW, ABOVE, WIDTH, ORDER = 0, 1, 2, 3
CHUNK = 4  # columns that are taken at once
STAYS = 0.1  # share of the greatest entry at which the diagonal one is the pivot: rows that stay are quicker


def prepare(pattern) -> tuple[np.ndarray, int]:
    """(bandwidths, order of the states, place of every entry of the Jacobian in the store; length of the store)."""
    n = pattern.shape[1]
    order, below, above = band(pattern)
    width = below + 1 + CHUNK * -(-(below + above) // CHUNK)
    size = n * width + n * below + 2 * n + 2
    rows, columns = entries(pattern)
    place = np.full(rows.size, size - 1)  # of ledger rows: nobody looks there
    inside = rows < n
    new = np.argsort(order)
    i, j = new[rows[inside]], new[columns[inside]]
    place[inside] = i * width + below + j - i
    return np.concatenate(([below, above, width], order, place)).astype(np.int64), size


def band(pattern) -> tuple[np.ndarray, int, int]:
    """(order of the states, entries below and above the diagonal in it), by Cuthill and McKee 1969, reversed."""
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
    """(row, column) of every entry of a pattern by columns, in its order."""
    return pattern.indices, np.repeat(np.arange(pattern.shape[1]), np.diff(pattern.indptr))


@njit(forceinline=True)
def subtract(factor, x, y, chunks):
    """y <- y - factor x, in chunks of four."""
    for c in range(chunks):
        a = y[4 * c] - factor * x[4 * c]
        b = y[4 * c + 1] - factor * x[4 * c + 1]
        d = y[4 * c + 2] - factor * x[4 * c + 2]
        e = y[4 * c + 3] - factor * x[4 * c + 3]
        y[4 * c], y[4 * c + 1], y[4 * c + 2], y[4 * c + 3] = a, b, d, e


def factor(shape, jacobian, shift, store):
    """store <- L U of shift I - J, rows exchanged; returns 0, or 1 + the state without a pivot."""
    n, own = shape[SIZE], shape[shape[OWN] :]
    below, above, width, order = own[BELOW], own[ABOVE], own[WIDTH], own[ORDER:]
    place, lower = order[n:], store[n * width :]
    came = lower[n * below :]
    bad = bad_row(shape, jacobian)
    if bad > 0:
        return bad
    for e in range(n * width):
        store[e] = 0.0
    for p in range(shape[shape[STARTS] + n]):
        store[place[p]] = -jacobian[p]
    for i in range(n):
        store[i * width + below] += shift
    last = 0  # column that rows which moved up have brought along
    for k in range(n):
        at, rest = k * width + below, min(below, n - 1 - k)
        here, pivot = size_of(store[at]), 0
        best = here
        for d in range(1, rest + 1):
            found = size_of(store[at + d * (width - 1)])
            if found > best:
                best, pivot = found, d
        if here >= STAYS * best:
            pivot, best = 0, here
        if not LEAST < best < 1.0 / LEAST:
            return order[k] + 1
        came[k] = pivot
        if pivot > 0:
            other = at + pivot * (width - 1)
            for e in range(below + above + 1):
                store[at + e], store[other + e] = store[other + e], store[at + e]
            last = max(last, k + pivot + above)
        chunks = (max(above, last - k) + CHUNK - 1) // CHUNK
        per = reciprocal(store[at])
        store[at] = per
        for d in range(rest):
            under = at + (d + 1) * (width - 1)
            share = store[under] * per
            lower[k * below + d] = share
            subtract(share, store[at + 1 :], store[under + 1 :], chunks)
    came[2 * n] = above if last == 0 else above + below
    return 0


def solve(shape, store, x):
    """x <- (shift I - J)^-1 x."""
    n, own = shape[SIZE], shape[shape[OWN] :]
    below, width, order = own[BELOW], own[WIDTH], own[ORDER:]
    lower = store[n * width :]
    came = lower[n * below :]
    work, reach = came[n:], int(came[2 * n].real)
    for i in range(n):
        work[i] = x[order[i]]
    for k in range(n):
        pivot = int(came[k].real)
        value = work[k + pivot]
        work[k + pivot] = work[k]
        work[k] = value
        for d in range(min(below, n - 1 - k)):
            work[k + 1 + d] -= lower[k * below + d] * value
    for i in range(n - 1, -1, -1):
        at, total = i * width + below, work[i]
        for d in range(min(reach, n - 1 - i), 0, -1):
            total -= store[at + d] * work[i + d]
        total *= store[at]
        work[i] = x[order[i]] = total
