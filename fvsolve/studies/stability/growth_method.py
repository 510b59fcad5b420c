"""Choice between matrix powers and vectors, by the number of states, for the growth of deviations over many steps."""

from __future__ import annotations

from typing import Any

import numpy as np

from fvsolve.steppers.tableau import Method
from fvsolve.studies.stability.bisection import StepLimit
from fvsolve.studies.stability.power_growth import DENSE, STEPS, THRESHOLD, DenseGrowth


def growth_method(
    method: Method, e: Any, steps: int = STEPS, threshold: float = THRESHOLD, latest: float | None = None
) -> Any:
    """Object that computes the growth of deviations: `DenseGrowth` for up to 500 states, `VectorGrowth` for more.

    e : Jacobian in coordinates of the energy norm [1/s]; steps : number of steps over which growth counts
    threshold : growth above which a step fails
    latest : time of the monotonic clock [s] after which `VectorGrowth` raises TooLarge; default: in 30 s
    """
    if e.shape[0] <= DENSE:
        return DenseGrowth(method, e if isinstance(e, np.ndarray) else e.toarray(), steps, threshold)
    from scipy.sparse import csr_array

    from fvsolve.studies.stability.vector_growth import VectorGrowth

    return VectorGrowth(method, csr_array(e), steps, threshold, latest)


def predicted_limit(growth: Any) -> StepLimit:
    """Limit of the step of a linear system, below which no step is found to fail.

    growth : result of `growth_method`. The search goes from 0.1 / ||J||, or less if that fails, to 1e4 / ||J||, with
    the norm of the Jacobian J. The limit is inf if no step fails, and for J = 0.
    """
    if growth.size == 0.0:
        return StepLimit(np.inf, np.inf)
    return growth.limit()
