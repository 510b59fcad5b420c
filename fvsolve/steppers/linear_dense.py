"""Dense factors of shift I - J, row by row, with partial pivoting. Knows arrays; for some dozen states.

The store holds the rows of L and U, 1 / U_ii on the diagonal, and behind them the row that each pivot came from.
"""

import numpy as np

from fvsolve.jit import njit
from fvsolve.steppers.pivots import LEAST, reciprocal, size_of
from fvsolve.steppers.structure import ROWS, SIZE, STARTS


def prepare(pattern) -> tuple[np.ndarray, int]:
    """(nothing that the functions need beyond the pattern, length of the store)."""
    n = pattern.shape[1]
    return np.zeros(0, dtype=np.int64), n * n + n


@njit(forceinline=True)
def subtract(factor, x, y):
    """y <- y - factor x."""
    for i in range(y.size):
        y[i] -= factor * x[i]


def factor(shape, jacobian, shift, store):
    """store <- L U of shift I - J, rows exchanged; returns 0, or 1 + the column without a pivot."""
    n = shape[SIZE]
    starts, rows, came = shape[shape[STARTS] :], shape[shape[ROWS] :], store[n * n :]
    for e in range(n * n):
        store[e] = 0.0
    for j in range(n):
        for p in range(starts[j], starts[j + 1]):
            if rows[p] < n:
                store[rows[p] * n + j] = -jacobian[p]
        store[j * n + j] += shift
    for k in range(n):
        best, pivot = size_of(store[k * n + k]), k
        for i in range(k + 1, n):
            here = size_of(store[i * n + k])
            if here > best:
                best, pivot = here, i
        if not LEAST < best < 1.0 / LEAST:
            return k + 1
        came[k] = pivot
        above = store[k * n : k * n + n]
        if pivot != k:
            other = store[pivot * n : pivot * n + n]
            for j in range(n):
                above[j], other[j] = other[j], above[j]
        per = reciprocal(above[k])
        above[k] = per
        for i in range(k + 1, n):
            row = store[i * n : i * n + n]
            row[k] *= per
            subtract(row[k], above[k + 1 :], row[k + 1 :])
    return 0


def solve(shape, store, x):
    """x <- (shift I - J)^-1 x."""
    n = shape[SIZE]
    came = store[n * n :]
    for k in range(n):
        i = int(came[k].real)
        x[k], x[i] = x[i], x[k]
    for i in range(1, n):
        row, total = store[i * n : i * n + n], x[i]
        for j in range(i):
            total -= row[j] * x[j]
        x[i] = total
    for i in range(n - 1, -1, -1):
        row, total = store[i * n : i * n + n], x[i]
        for j in range(i + 1, n):
            total -= row[j] * x[j]
        x[i] = total * row[i]
