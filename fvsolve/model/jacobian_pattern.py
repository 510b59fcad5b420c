"""Sparsity pattern of the Jacobian of a model."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csc_array

from fvsolve.basins.lower_pattern import all_states
from fvsolve.model.scalar_couplings import scalar_pairs
from fvsolve.model.state_couplings import Couplings


def jacobian_pattern(model) -> csc_array:
    """Sparsity pattern : bool[n + m, n], True where a derivative may differ from zero in any state of the model.

    Rows are the rates of the n states, then the m flows in the stepper's ledger (`Model.ledgers`); columns are the
    states.
    """
    n, couplings = model.y_size, Couplings(model)
    pairs = [(np.arange(n), np.arange(n)), *couplings.pairs(), *scalar_pairs(couplings, model)]
    rows, states = (np.concatenate(side) for side in zip(*pairs, strict=True))
    return csc_array(
        coo_array((np.ones(rows.size, dtype=bool), (rows, states)), shape=(n + model.ledgers, n)), dtype=bool
    )


def lumped_states(model) -> np.ndarray:
    """Indices of all states except waves in cells of pipes, states of basins and travels of their walls : int64[q].

    Most are states of lumped parts such as tanks, chambers and masses. Their pressures are hundreds of bars, while the
    flow of restrictions bends within a few pascals. The result is empty under density laws whose pressures come from
    iterations.
    """
    if model.case.law.name not in ("linear", "log"):  # pressures come from iterations, rougher than rounding
        return np.zeros(0, dtype=np.int64)
    pipes = model.tables.pipes[model.tables.pipes["delay"] < 0]
    cells = [pipe["y"] + np.arange(2 * pipe["cells"]) for pipe in pipes] + [all_states(basin) for basin in model.basins]
    walls = [[at for at, _, _ in basin.stretches] for basin in model.basins]  # every cell's volume follows these
    return np.setdiff1d(np.arange(model.y_size), np.concatenate([[], *cells, *walls]))
