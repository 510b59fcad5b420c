"""States taken two at a time: those whose neighbours are most alike. Knows patterns; knows no values."""

from __future__ import annotations

import numpy as np


def pairs(pattern) -> np.ndarray:
    """int64[blocks, 2]: every state once, with a partner; one that finds none is its own.

    The two waves of a cell make a pair, though nothing says so: of all couplings, theirs closes the most walks of
    three steps. Couplings are taken greedily, strongest first (heavy edge matching; Karypis and Kumar 1998).
    """
    from scipy.sparse import coo_array, csr_array

    n = pattern.shape[1]
    both = csr_array(pattern + pattern.T, dtype=np.float64)
    walks = coo_array(((both @ both) @ both) * both)
    upper = walks.row < walks.col
    i, j, weight = walks.row[upper], walks.col[upper], walks.data[upper]
    strongest = np.lexsort((j, i, -weight))
    partner = list(range(n))
    for a, b in zip(i[strongest].tolist(), j[strongest].tolist(), strict=True):
        if partner[a] == a and partner[b] == b:
            partner[a], partner[b] = b, a
    found = np.column_stack((np.arange(n), partner))
    return found[found[:, 0] <= found[:, 1]].astype(np.int64)
