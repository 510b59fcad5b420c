"""Bounds of the depths and velocities in basins."""

import numpy as np

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model.state_bounds import NO_STATE, bound_rows


def depths(basins):
    """Yield `bound_rows` that keep depths of water in basin cells at 0 or above, and limit velocities between steps.

    With bed friction, a velocity between two steps lies between those of the steps.
    """
    for basin in basins:
        states = int(basin.row["y"]) + np.arange(basin.n)
        if basin.deep:
            yield bound_rows(states, NO_STATE, NO_STATE, basin.at_rest(), 0.0, -1.0, np.inf)
        if basin.fades > 0.0 and basin.row["friction"] != rec.NO_DRAG:
            for k in range(1, len(basin.quantities)):
                yield bound_rows(states + k * basin.n, states, NO_STATE, basin.at_rest(), 1.0, basin.fades, -1.0)
