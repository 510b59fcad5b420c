"""Sets of states, and pairs of rates and states, for the sparsity pattern of the Jacobian."""

import numpy as np


def unique_states(*parts) -> np.ndarray:
    """Sorted indices of states, each once, from arrays or numbers."""
    return np.unique(
        np.concatenate([np.zeros(0, dtype=np.int64), *(np.atleast_1d(part) for part in parts)])
    )


def pairs_of(rows: np.ndarray, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Couplings of all given rows with all given states : (row, state) of each pair."""
    return np.repeat(rows, states.size), np.tile(states, rows.size)
