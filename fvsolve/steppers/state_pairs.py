"""Pairing of states for 2 x 2 block factors: each state with the state whose neighbours are most alike."""

from __future__ import annotations

import numpy as np


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
    i, j, weight = walks.row[upper], walks.col[upper], walks.data[upper]
    strongest = np.lexsort((j, i, -weight))
    partner = list(range(n))
    for a, b in zip(i[strongest].tolist(), j[strongest].tolist(), strict=True):
        if partner[a] == a and partner[b] == b:
            partner[a], partner[b] = b, a
    matches = np.column_stack((np.arange(n), partner))
    return matches[matches[:, 0] <= matches[:, 1]].astype(np.int64)
