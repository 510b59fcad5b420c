"""Bounds of states, to which steps are limited."""

import numpy as np

NO_STATE = -1


def state_bounds(model) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of states, arguments of `steppers.output_rows.limit_to_bounds` : (at, by).

    at : int64[3 q]  a bounded state, and up to two states that give the amount of which it is a share, else -1
    by : float64[q, 4]  base and gain of this amount, least share, greatest share
    Bounds of meshes come first, because depths bound amounts in the water.
    """
    rows = [row for part in model.meshed for row in part.bounds()]
    for feature in model.features:
        rows += feature.bounds(model)
    if not rows:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 4))
    at, by = (np.concatenate(column) for column in zip(*rows, strict=True))
    return at.ravel(), by


def bound_rows(states, first, second, base, gain, least, most) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of `states` : (int64[q, 3], float64[q, 4]), see `state_bounds`; arguments are arrays or numbers.

    A state lies between `least` and `most` times the amount base + gain (y[first] + y[second]).
    """
    at = np.column_stack(np.broadcast_arrays(states, first, second)).astype(np.int64)
    return at, np.column_stack(np.broadcast_arrays(base, gain, least, most, np.zeros(len(at)))[:4])
