"""Column colouring of a sparse pattern: columns of one colour have no row in common."""

from __future__ import annotations

import numpy as np

from fvsolve.jit import njit

PYTHON_ENTRIES = 200  # number of entries below which plain Python is quicker than loading compiled code


def colors(pattern) -> np.ndarray:
    """Colours of the columns of a sparse pattern : int64[n], by the greedy rule, columns with many neighbours first.

    pattern : sparse array stored by columns. Columns with a row in common get different colours (Curtis, Powell and
    Reid 1974; order of Welsh and Powell 1967).
    """
    rows, n = pattern.shape
    result = np.full(n, -1, dtype=np.int64)
    if pattern.indptr[-1] == rows * n:
        return np.arange(n, dtype=np.int64)
    by_rows = pattern.tocsr()
    per_row = np.diff(by_rows.indptr)
    degree = np.add.reduceat(np.append(per_row[pattern.indices], 0), pattern.indptr[:-1])
    degree[np.diff(pattern.indptr) == 0] = 0
    order = np.argsort(-degree, kind="stable")
    tables = (pattern.indptr, pattern.indices, by_rows.indptr, by_rows.indices, order)
    function = greedy.py_func if pattern.nnz < PYTHON_ENTRIES and hasattr(greedy, "py_func") else greedy
    function(*(np.asarray(table, dtype=np.int64) for table in tables), np.full(n + 1, -1, dtype=np.int64), result)
    return result


@njit
def greedy(starts, rows, row_starts, columns, order, seen, result):
    """Give each column in `order` the lowest colour that no other column with a common row has.

    starts, rows : pattern by columns; row_starts, columns : pattern by rows
    seen : int64[n + 1]  work array, initially -1; result : int64[n]  receives the colours, initially -1
    """
    for at in range(order.size):
        j = order[at]
        for p in range(starts[j], starts[j + 1]):
            for q in range(row_starts[rows[p]], row_starts[rows[p] + 1]):
                color = result[columns[q]]
                if color >= 0:
                    seen[color] = j
        color = 0
        while seen[color] == j:
            color += 1
        result[j] = color
