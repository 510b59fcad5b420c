"""Colours of a pattern's columns: columns of one colour share no row. Knows patterns; knows no values."""

from __future__ import annotations

import numpy as np

from fvsolve.jit import njit

PLAIN = 200  # entries below which Python is quicker than loading what is compiled


def colors(pattern) -> np.ndarray:
    """int64[n]: greedy colours, columns of many neighbours first, of a sparse pattern by columns.

    A_j and A_k need different colours where they share a row (Curtis, Powell and Reid 1974; order of Welsh and
    Powell 1967).
    """
    rows, n = pattern.shape
    found = np.full(n, -1, dtype=np.int64)
    if pattern.indptr[-1] == rows * n:
        return np.arange(n, dtype=np.int64)
    by_rows = pattern.tocsr()
    per_row = np.diff(by_rows.indptr)
    crowd = np.add.reduceat(np.append(per_row[pattern.indices], 0), pattern.indptr[:-1])
    crowd[np.diff(pattern.indptr) == 0] = 0
    order = np.argsort(-crowd, kind="stable")
    tables = (pattern.indptr, pattern.indices, by_rows.indptr, by_rows.indices, order)
    work = greedy.py_func if pattern.nnz < PLAIN and hasattr(greedy, "py_func") else greedy
    work(*(np.asarray(table, dtype=np.int64) for table in tables), np.full(n + 1, -1, dtype=np.int64), found)
    return found


@njit
def greedy(starts, rows, row_starts, columns, order, seen, found):
    """Give each column in `order` the least colour that none of those it shares a row with has; seen : int64[n + 1]."""
    for at in range(order.size):
        j = order[at]
        for p in range(starts[j], starts[j + 1]):
            for q in range(row_starts[rows[p]], row_starts[rows[p] + 1]):
                color = found[columns[q]]
                if color >= 0:
                    seen[color] = j
        color = 0
        while seen[color] == j:
            color += 1
        found[j] = color
