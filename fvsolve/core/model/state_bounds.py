"""Bounds of states, to which steps are limited."""

import numpy as np

from fvsolve.core.kernels import dtypes as rec

NO_STATE = -1


def state_bounds(model) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of states, arguments of `steppers.output_rows.limit_to_bounds` : (at, by).

    at : int64[3 q]  a bounded state, and up to two states that give the amount of which it is a share, else -1
    by : float64[q, 4]  base and gain of this amount, least share, greatest share
    Bounds of depths come first, because depths bound amounts in the water.
    """
    rows = [*depths(model)]
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


def depths(model):
    """Yield `bound_rows` that keep depths of water in basin cells at 0 or above, and limit velocities between steps.

    With bed friction, a velocity between two steps lies between those of the steps.
    """
    for basin in model.basins:
        states = int(basin.row["y"]) + np.arange(basin.n)
        if basin.deep:
            yield bound_rows(states, NO_STATE, NO_STATE, basin.at_rest(), 0.0, -1.0, np.inf)
        if basin.fades > 0.0 and basin.row["friction"] != rec.NO_DRAG:
            for k in range(1, len(basin.quantities)):
                yield bound_rows(states + k * basin.n, states, NO_STATE, basin.at_rest(), 1.0, basin.fades, -1.0)
