"""The pattern of the Jacobian of a model: cells, nodes and devices, then scalars. Knows who says what."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csc_array

from fvsolve.basins.lower_pattern import all_states
from fvsolve.model.scalar_couplings import scalar_pairs
from fvsolve.model.state_couplings import Couplings


def jacobian_pattern(model) -> csc_array:
    """bool[n + ledger, n]: where d(dydt, supply)/dy may differ from zero at any time, state and opening."""
    n, couplings = model.y_size, Couplings(model)
    pairs = [(np.arange(n), np.arange(n)), *couplings.pairs(), *scalar_pairs(couplings, model)]
    rows, states = (np.concatenate(side) for side in zip(*pairs, strict=True))
    return csc_array(
        coo_array((np.ones(rows.size, dtype=bool), (rows, states)), shape=(n + model.ledgers, n)), dtype=bool
    )


def lumped_states(model) -> np.ndarray:
    """States of lumped parts, int64[q]: their pressures are hundreds of bars; restrictions bend over few pascals."""
    if model.case.law.name not in ("linear", "log"):  # pressures come from iterations, rougher than rounding
        return np.zeros(0, dtype=np.int64)
    pipes = model.tables.pipes[model.tables.pipes["delay"] < 0]
    cells = [pipe["y"] + np.arange(2 * pipe["cells"]) for pipe in pipes] + [all_states(basin) for basin in model.basins]
    walls = [[at for at, _, _ in basin.stretches] for basin in model.basins]  # every cell's volume follows these
    return np.setdiff1d(np.arange(model.y_size), np.concatenate([[], *cells, *walls]))
