"""Factors of shift I - J on a fixed pattern, row by row, pivots on the diagonal. Knows lists; searches for nothing.

States are put in an order that keeps the factors sparse; where these can differ from zero is found once. The store
holds L and U by rows, the reciprocal pivots, and a row to work in.
"""

import numpy as np

from fvsolve.jit import njit
from fvsolve.steppers.pivots import LEAST, bad_row, reciprocal, size_of
from fvsolve.steppers.structure import OWN, SIZE

# Offsets, from the start of the kind's own part: of each new row its state; L, U and J by rows in the new order,
# J with the place of every entry in the Jacobian.
ORDER, L_STARTS, L_COLUMNS, U_STARTS, U_COLUMNS, J_STARTS, J_COLUMNS, J_PLACES = range(8)
PARTS = 8
LOST = 1e-10  # share of its diagonal entry that a pivot must keep


def prepare(pattern) -> tuple[np.ndarray, int]:
    """(order, patterns of L, U and J by rows behind their offsets; length of the store)."""
    n = pattern.shape[1]
    order = minimum_degree(pattern[:n])
    j_starts, j_columns, j_places = rows_in_order(pattern, order)
    l_starts, l_columns, u_starts, u_columns = fill(n, j_starts, j_columns)
    parts = (order, l_starts, l_columns, u_starts, u_columns, j_starts, j_columns, j_places)
    offsets = PARTS + np.cumsum([0] + [part.size for part in parts[:-1]])
    own = np.concatenate([np.asarray(part, dtype=np.int64) for part in (offsets, *parts)])
    return own, l_columns.size + u_columns.size + 2 * n


def minimum_degree(pattern) -> np.ndarray:
    """int64[n]: the states in an order of few neighbours first, multiple minimum degree on A + A^T (Liu 1985).

    SuperLU finds it while it factors a diagonally dominant matrix of this pattern, whose pivots stay put.
    """
    from scipy.sparse import csc_array, diags_array
    from scipy.sparse.linalg import splu

    n = pattern.shape[0]
    ones = csc_array(pattern, dtype=np.float64)
    dominant = csc_array(diags_array(np.full(n, 2.0 * ones.sum(axis=1).max() + 2.0)) - ones)
    factors = splu(dominant, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0)
    return np.argsort(factors.perm_c).astype(np.int64)


def rows_in_order(pattern, order) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(starts, columns, places in the Jacobian) of the rows of the states, rows and columns in a new order."""
    from scipy.sparse import csc_array

    n = pattern.shape[1]
    places = csc_array((np.arange(1, pattern.nnz + 1), pattern.indices, pattern.indptr), shape=pattern.shape)
    rows = places[:n].tocsr()[order][:, order]
    rows.sort_indices()
    return rows.indptr.astype(np.int64), rows.indices.astype(np.int64), rows.data - 1


def fill(n: int, starts, columns) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(starts and columns of L, starts and columns of U) by rows, for pivots on the diagonal."""
    room = 4 * columns.size + 16
    while True:
        l_starts, u_starts, chain = (np.zeros(n + 1, dtype=np.int64) for _ in range(3))
        l_columns, u_columns = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64)
        if eliminate(starts, columns, l_starts, l_columns, u_starts, u_columns, chain):
            return l_starts, l_columns[: l_starts[n]].copy(), u_starts, u_columns[: u_starts[n]].copy()
        room *= 2


@njit
def eliminate(starts, columns, l_starts, l_columns, u_starts, u_columns, chain):
    """Patterns of L and U; False where there is no room for them.

    A row of U holds what its row of J does, and the rows of U that L calls for. chain : int64[n + 1]  the columns
    of the row, each with the next one; chain[n] holds the first, n ends it.
    """
    n = chain.size - 1
    for i in range(n):
        last = n
        for p in range(starts[i], starts[i + 1]):
            chain[last], last = columns[p], columns[p]
        chain[last] = n
        at, end, k = l_starts[i], u_starts[i], chain[n]
        while k < i:
            if at == l_columns.size:
                return False
            l_columns[at] = k
            at += 1
            last = k
            for p in range(u_starts[k], u_starts[k + 1]):
                j = u_columns[p]
                while chain[last] < j:
                    last = chain[last]
                if chain[last] != j:
                    chain[last], chain[j] = j, chain[last]
                last = j
            k = chain[k]
        k = chain[k] if k == i else k
        while k < n:
            if end == u_columns.size:
                return False
            u_columns[end] = k
            end += 1
            k = chain[k]
        l_starts[i + 1], u_starts[i + 1] = at, end
    return True


@njit(forceinline=True)
def place(shape, which):
    """Where one of the kind's own lists begins."""
    return shape[OWN] + shape[shape[OWN] + which]


def factor(shape, jacobian, shift, store):
    """store <- L, U and reciprocal pivots of shift I - J; returns 0, or 1 + the state without a good pivot.

    A pivot is good that keeps 1e-10 of its diagonal entry: the measure does not depend on the units of states.
    """
    n, order = shape[SIZE], shape[place(shape, ORDER) :]
    l_starts, l_columns = shape[place(shape, L_STARTS) :], shape[place(shape, L_COLUMNS) :]
    u_starts, u_columns = shape[place(shape, U_STARTS) :], shape[place(shape, U_COLUMNS) :]
    j_starts, j_columns, j_places = (
        shape[place(shape, J_STARTS) :],
        shape[place(shape, J_COLUMNS) :],
        shape[place(shape, J_PLACES) :],
    )
    lower, upper = store, store[l_starts[n] :]
    per, row = upper[u_starts[n] :], upper[u_starts[n] + n :]
    bad = bad_row(shape, jacobian)
    if bad > 0:
        return bad
    for i in range(n):
        row[i] = 0.0
    for i in range(n):
        for p in range(j_starts[i], j_starts[i + 1]):
            row[j_columns[p]] = -jacobian[j_places[p]]
        row[i] += shift
        start = size_of(row[i])
        for p in range(l_starts[i], l_starts[i + 1]):
            k = l_columns[p]
            share = row[k] * per[k]
            lower[p], row[k] = share, 0.0
            for q in range(u_starts[k], u_starts[k + 1]):
                row[u_columns[q]] -= share * upper[q]
        pivot = row[i]
        row[i] = 0.0
        kept = size_of(pivot)
        if not (LEAST < kept < 1.0 / LEAST and kept > LOST * start):
            return order[i] + 1
        per[i] = reciprocal(pivot)
        for q in range(u_starts[i], u_starts[i + 1]):
            upper[q], row[u_columns[q]] = row[u_columns[q]], 0.0
    return 0


def solve(shape, store, x):
    """x <- (shift I - J)^-1 x."""
    n, order = shape[SIZE], shape[place(shape, ORDER) :]
    l_starts, l_columns = shape[place(shape, L_STARTS) :], shape[place(shape, L_COLUMNS) :]
    u_starts, u_columns = shape[place(shape, U_STARTS) :], shape[place(shape, U_COLUMNS) :]
    lower, upper = store, store[l_starts[n] :]
    per, work = upper[u_starts[n] :], upper[u_starts[n] + n :]
    for i in range(n):
        total = x[order[i]]
        for p in range(l_starts[i], l_starts[i + 1]):
            total -= lower[p] * work[l_columns[p]]
        work[i] = total
    for i in range(n - 1, -1, -1):
        total = work[i]
        for p in range(u_starts[i], u_starts[i + 1]):
            total -= upper[p] * work[u_columns[p]]
        total *= per[i]
        work[i] = x[order[i]] = total
