"""Sparse LU factors of shift I - J on a fixed pattern of 2 x 2 blocks, with pivots on the diagonal.

States are grouped in pairs, pairs in an order that keeps the factors sparse; the pattern of the factors is computed
once. The array `factors` holds the blocks of L and U by rows, the inverses of the diagonal blocks, and a work row; a
block is four numbers, row by row.
"""

import numpy as np

from fvsolve.core.steppers.structure import LEAST_PIVOT, SOLVER_DATA, bad_row, size_of
from fvsolve.jit import njit

# Data of this solver in the structure: number of blocks, then offsets from its start to these lists: the two states of
# each reordered row; L and U by rows; the entries of J by rows: their places in the work row, and in the Jacobian.
BLOCKS, ORDER, L_STARTS, L_COLUMNS, U_STARTS, U_COLUMNS, J_STARTS, J_PLACES, J_ENTRIES = range(9)
PARTS = 9
LEAST_DETERMINANT = (
    # least determinant of a diagonal block, relative to the sizes of its two products, see `factor`
    1e-13
)


def prepare(pattern) -> tuple[np.ndarray, int]:
    """(data that the compiled functions of this solver read : int64[:], length of the array `factors`).

    pattern : sparse pattern of the Jacobian J, by columns. The data are the number of blocks, offsets, then the order
    of the states and the patterns of L, U and J by rows.
    """
    members, rows, columns, places = blocks(pattern)
    count = len(members)
    order = minimum_degree(pattern_of(rows, columns, count))
    new = np.argsort(order)
    i, j = new[rows // 2], new[columns // 2]
    in_order = pattern_of(2 * i, 2 * j, count).tocsr()
    l_starts, l_columns, u_starts, u_columns = fill(count, in_order.indptr, in_order.indices)
    by_rows = np.argsort(i, kind="stable")
    j_starts = np.concatenate(([0], np.cumsum(np.bincount(i, minlength=count))))
    # Place of an entry in the work row, which has four numbers for each block.
    j_places = (4 * j + 2 * (rows % 2) + columns % 2)[by_rows]
    parts = (
        members[order].ravel(),
        l_starts,
        l_columns,
        u_starts,
        u_columns,
        j_starts,
        j_places,
        places[by_rows],
    )
    offsets = PARTS + np.cumsum([0] + [part.size for part in parts[:-1]])
    own = np.concatenate([np.asarray(part, dtype=np.int64) for part in ([count], offsets, *parts)])
    return own, 4 * (l_columns.size + u_columns.size + 2 * count)


def blocks(pattern) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(pairs of states, rows, columns, indices in the Jacobian) of the Jacobian entries between states.

    Row and column are 2 pair + member, with the number of the pair and 0 or 1 for the member of the pair.
    pattern : sparse pattern of the Jacobian, by columns
    """
    n = pattern.shape[1]
    members = pairs(pattern[:n])
    member = np.empty(n, dtype=np.int64)
    member[members[:, 1]] = 2 * np.arange(len(members)) + 1
    member[members[:, 0]] = 2 * np.arange(len(members))
    places = np.flatnonzero(pattern.indices < n)
    columns = np.repeat(np.arange(n), np.diff(pattern.indptr))
    return members, member[pattern.indices[places]], member[columns[places]], places


def pattern_of(rows, columns, count: int):
    """Sparse pattern, count x count by columns, of the 2 x 2 blocks that contain an entry at (rows, columns).

    rows, columns : positions of entries; entry (i, j) is in block (i // 2, j // 2)
    """
    from scipy.sparse import coo_array, csc_array

    pattern = csc_array(
        coo_array((np.ones(rows.size, dtype=bool), (rows // 2, columns // 2)), shape=(count, count))
    )
    pattern.sum_duplicates()
    return pattern


def minimum_degree(pattern) -> np.ndarray:
    """Order of the rows that keeps the factors sparse : int64[n], by multiple minimum degree on A + A^T (Liu 1985).

    SuperLU computes the order while it factors a diagonally dominant matrix A with this pattern, which needs no row
    exchanges.
    """
    from scipy.sparse import csc_array, diags_array
    from scipy.sparse.linalg import splu

    n = pattern.shape[0]
    ones = csc_array(pattern, dtype=np.float64)
    dominant = csc_array(diags_array(np.full(n, 2.0 * ones.sum(axis=1).max() + 2.0)) - ones)
    factors = splu(
        dominant, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0
    )
    return np.argsort(factors.perm_c).astype(np.int64)


def fill(n: int, starts, columns) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Patterns of L and U by rows for pivots on the diagonal: starts and columns of L, starts and columns of U.

    n : number of rows; starts, columns : pattern of the matrix by rows
    """
    starts, columns = np.asarray(starts, dtype=np.int64), np.asarray(columns, dtype=np.int64)
    capacity = 4 * columns.size + 16
    # The number of entries that fill in is not known before.
    while True:
        l_starts, u_starts, chain = (np.zeros(n + 1, dtype=np.int64) for _ in range(3))
        l_columns = np.empty(capacity, dtype=np.int64)
        u_columns = np.empty(capacity, dtype=np.int64)
        if eliminate(starts, columns, l_starts, l_columns, u_starts, u_columns, chain):
            return (
                l_starts,
                l_columns[: l_starts[n]].copy(),
                u_starts,
                u_columns[: u_starts[n]].copy(),
            )
        capacity *= 2


@njit
def eliminate(starts, columns, l_starts, l_columns, u_starts, u_columns, chain):
    """Write the patterns of L and U by rows to four arrays; returns False if the arrays are too short.

    starts, columns : pattern of the matrix by rows. A row of U contains the entries of the matrix row, and of the rows
    of U whose numbers are the columns of the row of L.
    l_starts, l_columns, u_starts, u_columns : receive the patterns of L and U
    chain : int64[n + 1]  linked list of the columns of a row; chain[n] holds the first column, n ends the list
    """
    n = chain.size - 1
    for i in range(n):
        last = n
        for p in range(starts[i], starts[i + 1]):
            chain[last], last = columns[p], columns[p]
        chain[last] = n
        at = l_starts[i]
        end = u_starts[i]
        k = chain[n]
        # Columns before the diagonal are entries of L; each brings the entries of its row of U.
        while k < i:
            if at == l_columns.size:
                return False
            l_columns[at] = k
            at += 1
            last = k
            for p in range(u_starts[k], u_starts[k + 1]):
                j = u_columns[p]
                # Both rows have rising columns, so that a single pass merges them.
                while chain[last] < j:
                    last = chain[last]
                if chain[last] != j:
                    chain[last], chain[j] = j, chain[last]
                last = j
            k = chain[k]
        # The columns behind the diagonal are the row of U.
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
def place(structure, index):
    """Offset of list number `index` of this solver in the array `structure`.

    The lists, such as the patterns of L and U, are those of `prepare`.
    """
    return structure[SOLVER_DATA] + structure[structure[SOLVER_DATA] + index]


@njit(forceinline=True)
def clear(block):
    """Set the four entries of a 2 x 2 block to zero."""
    block[0] = block[1] = block[2] = block[3] = 0.0


def factor(structure, jacobian, shift, factors):
    """Factor the matrix shift I - J = L U by blocks; returns 0, or 1 + the number of a state without a good pivot.

    The pivot of a diagonal block is good if its determinant is above 1e-13 times the sum of the sizes of its two
    products, after and before elimination. This measure does not depend on the units of states.
    structure : flat array of `Structure.shape`; jacobian : entries of J in the order of the pattern
    factors : receives L, U and the inverses of the diagonal blocks
    """
    count, order = structure[structure[SOLVER_DATA]], structure[place(structure, ORDER) :]
    l_starts = structure[place(structure, L_STARTS) :]
    l_columns = structure[place(structure, L_COLUMNS) :]
    u_starts = structure[place(structure, U_STARTS) :]
    u_columns = structure[place(structure, U_COLUMNS) :]
    starts = structure[place(structure, J_STARTS) :]
    places = structure[place(structure, J_PLACES) :]
    entries = structure[place(structure, J_ENTRIES) :]
    lower, upper = factors, factors[4 * l_starts[count] :]
    inverse, row = upper[4 * u_starts[count] :], upper[4 * (u_starts[count] + count) :]
    bad = bad_row(structure, jacobian)
    if bad > 0:
        return bad
    for e in range(4 * count):
        row[e] = 0.0
    for i in range(count):
        for p in range(starts[i], starts[i + 1]):
            row[places[p]] = -jacobian[entries[p]]
        own = row[4 * i : 4 * i + 4]
        # A state without a partner has a second row without entries, which gets a pivot of 1.
        own[0] += shift
        own[3] += shift if order[2 * i] != order[2 * i + 1] else 1.0
        # The size before elimination, against which cancellation shows.
        first = size_of(own[0] * own[3]) + size_of(own[1] * own[2])
        for p in range(l_starts[i], l_starts[i + 1]):
            k = l_columns[p]
            x = row[4 * k : 4 * k + 4]
            d = inverse[4 * k : 4 * k + 4]
            share = lower[4 * p : 4 * p + 4]
            l0, l1 = x[0] * d[0] + x[1] * d[2], x[0] * d[1] + x[1] * d[3]
            l2, l3 = x[2] * d[0] + x[3] * d[2], x[2] * d[1] + x[3] * d[3]
            share[0], share[1], share[2], share[3] = l0, l1, l2, l3
            clear(x)
            for q in range(u_starts[k], u_starts[k + 1]):
                u, y = upper[4 * q : 4 * q + 4], row[4 * u_columns[q] : 4 * u_columns[q] + 4]
                y0, y1 = y[0] - (l0 * u[0] + l1 * u[2]), y[1] - (l0 * u[1] + l1 * u[3])
                y2, y3 = y[2] - (l2 * u[0] + l3 * u[2]), y[3] - (l2 * u[1] + l3 * u[3])
                y[0], y[1], y[2], y[3] = y0, y1, y2, y3
        a = own[0]
        b = own[1]
        c = own[2]
        d = own[3]
        # The work row must be empty for the next row.
        clear(own)
        diagonal, cross = a * d, b * c
        det = diagonal - cross
        remaining = size_of(det)
        if not (
            LEAST_PIVOT < remaining < 1.0 / LEAST_PIVOT
            and remaining > LEAST_DETERMINANT * max(first, size_of(diagonal) + size_of(cross))
        ):
            return order[2 * i] + 1
        per = det.conjugate() / (det.real * det.real + det.imag * det.imag)
        y = inverse[4 * i : 4 * i + 4]
        y[0], y[1], y[2], y[3] = d * per, -b * per, -c * per, a * per
        for q in range(u_starts[i], u_starts[i + 1]):
            u, x = upper[4 * q : 4 * q + 4], row[4 * u_columns[q] : 4 * u_columns[q] + 4]
            u[0], u[1], u[2], u[3] = x[0], x[1], x[2], x[3]
            clear(x)
    return 0


def solve(structure, factors, x):
    """Replace x with (shift I - J)^-1 x, with the factors that `factor` has computed."""
    count, order = structure[structure[SOLVER_DATA]], structure[place(structure, ORDER) :]
    l_starts = structure[place(structure, L_STARTS) :]
    l_columns = structure[place(structure, L_COLUMNS) :]
    u_starts = structure[place(structure, U_STARTS) :]
    u_columns = structure[place(structure, U_COLUMNS) :]
    lower, upper = factors, factors[4 * l_starts[count] :]
    inverse, work = upper[4 * u_starts[count] :], upper[4 * (u_starts[count] + count) :]
    # L has a unit diagonal: forward substitution without division.
    for i in range(count):
        a, b = x[order[2 * i]], x[order[2 * i + 1]]
        for p in range(l_starts[i], l_starts[i + 1]):
            share, y = lower[4 * p : 4 * p + 4], work[2 * l_columns[p] : 2 * l_columns[p] + 2]
            a -= share[0] * y[0] + share[1] * y[1]
            b -= share[2] * y[0] + share[3] * y[1]
        work[2 * i], work[2 * i + 1] = a, b
    # Backward substitution, with the stored inverses of the diagonal blocks.
    for i in range(count - 1, -1, -1):
        a, b = work[2 * i], work[2 * i + 1]
        for p in range(u_starts[i], u_starts[i + 1]):
            u, y = upper[4 * p : 4 * p + 4], work[2 * u_columns[p] : 2 * u_columns[p] + 2]
            a -= u[0] * y[0] + u[1] * y[1]
            b -= u[2] * y[0] + u[3] * y[1]
        d = inverse[4 * i : 4 * i + 4]
        first, second = d[0] * a + d[1] * b, d[2] * a + d[3] * b
        work[2 * i], work[2 * i + 1] = first, second
        x[order[2 * i + 1]] = second  # a single state overwrites its dummy
        x[order[2 * i]] = first


def pairs(pattern) -> np.ndarray:
    """Pairs of states : int64[blocks, 2]; a state without a partner is paired with itself.

    pattern : sparse pattern of the Jacobian. The weight of a coupling of two states is the number of walks of three
    edges between them. It is greatest between the two waves of a cell, which become a pair. Couplings are taken
    greedily, strongest first (heavy edge matching; Karypis and Kumar 1998).
    """
    from scipy.sparse import coo_array, csr_array

    n = pattern.shape[1]
    both = csr_array(pattern + pattern.T, dtype=np.float64)
    walks = coo_array(((both @ both) @ both) * both)
    upper = walks.row < walks.col
    i = walks.row[upper]
    j = walks.col[upper]
    weight = walks.data[upper]
    strongest = np.lexsort((j, i, -weight))
    partner = list(range(n))
    for a, b in zip(i[strongest].tolist(), j[strongest].tolist(), strict=True):
        if partner[a] == a and partner[b] == b:
            partner[a], partner[b] = b, a
    matches = np.column_stack((np.arange(n), partner))
    return matches[matches[:, 0] <= matches[:, 1]].astype(np.int64)
