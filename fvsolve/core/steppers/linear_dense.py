"""Dense LU factors of shift I - J with partial pivoting, row by row, for few states, or where sparse factors fill up.

The array `factors` holds the rows of L and U, with 1 / U_ii on the diagonal, then the row exchanged at each pivot.
"""

import numpy as np

from fvsolve.core.steppers.structure import LEAST_PIVOT, ROWS, SIZE, STARTS, reciprocal, size_of


def prepare(pattern) -> tuple[np.ndarray, int]:
    """(empty array, because this solver needs no data; length of the array `factors`).

    pattern : sparse pattern of the Jacobian, by columns
    """
    n = pattern.shape[1]
    return np.zeros(0, dtype=np.int64), n * n + n


def factor(structure, jacobian, shift, factors):
    """Factor the matrix shift I - J = L U with row exchanges; returns 0, or 1 + the number of a column without a pivot.

    structure : flat array of `Structure.shape`; jacobian : entries of J in the order of the pattern
    factors : receives L, U and the row exchanges
    """
    n = structure[SIZE]
    starts = structure[structure[STARTS] :]
    rows = structure[structure[ROWS] :]
    pivots = factors[n * n :]
    a = factors[: n * n].reshape((n, n))
    for e in range(n * n):
        factors[e] = 0.0
    for j in range(n):
        for p in range(starts[j], starts[j + 1]):
            # Rows of ledger rates are not factored.
            if rows[p] < n:
                a[rows[p], j] = -jacobian[p]
        a[j, j] += shift
    for k in range(n):
        # The largest entry of the column as pivot keeps the entries of L small.
        best, pivot = size_of(a[k, k]), k
        for i in range(k + 1, n):
            size = size_of(a[i, k])
            if size > best:
                best, pivot = size, i
        if not LEAST_PIVOT < best < 1.0 / LEAST_PIVOT:
            return k + 1
        pivots[k] = pivot
        if pivot != k:
            for j in range(n):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        # The reciprocal is stored, so that solutions multiply instead of divide.
        per = reciprocal(a[k, k])
        a[k, k] = per
        for i in range(k + 1, n):
            if a[i, k] != 0.0:
                a[i, k] *= per
                for j in range(k + 1, n):
                    a[i, j] -= a[i, k] * a[k, j]
    return 0


def solve(structure, factors, x):
    """Replace x with (shift I - J)^-1 x, with the factors that `factor` has computed."""
    n = structure[SIZE]
    pivots = factors[n * n :]
    # All row exchanges come first, then L, then U.
    for k in range(n):
        i = int(pivots[k].real)
        x[k], x[i] = x[i], x[k]
    for i in range(1, n):
        row, total = factors[i * n : i * n + n], x[i]
        for j in range(i):
            total -= row[j] * x[j]
        x[i] = total
    for i in range(n - 1, -1, -1):
        row, total = factors[i * n : i * n + n], x[i]
        for j in range(i + 1, n):
            total -= row[j] * x[j]
        x[i] = total * row[i]
