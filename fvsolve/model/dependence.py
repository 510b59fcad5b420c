"""The pattern of the Jacobian of a model: cells, nodes and devices, then scalars. Knows who says what."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csc_array

from fvsolve.model.sparsity import Couplings
from fvsolve.model.sparsity_scalars import scalar_pairs


def sparsity(model) -> csc_array:
    """bool[n + ledger, n]: where d(dydt, supply)/dy may differ from zero at any time, state and opening."""
    n, couplings = model.y_size, Couplings(model)
    pairs = [(np.arange(n), np.arange(n)), *couplings.pairs(), *scalar_pairs(couplings, model)]
    rows, states = (np.concatenate(side) for side in zip(*pairs, strict=True))
    return csc_array(
        coo_array((np.ones(rows.size, dtype=bool), (rows, states)), shape=(n + model.ledgers, n)), dtype=bool
    )
