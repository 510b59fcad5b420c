"""Choice of the method for powers of a step by the number of states, and the predicted limit."""

from __future__ import annotations

from typing import Any

import numpy as np

from fvsolve.steppers.tableau import Method
from fvsolve.studies.stability.bisection import StepLimit
from fvsolve.studies.stability.power_growth import DENSE, STEPS, THRESHOLD, DenseGrowth


def growth_method(
    method: Method, e: Any, steps: int = STEPS, threshold: float = THRESHOLD, latest: float | None = None
) -> Any:
    """Growth of steps by full matrices, or by vectors above `DENSE` states; latest : end on the monotonic clock [s]."""
    if e.shape[0] <= DENSE:
        return DenseGrowth(method, e if isinstance(e, np.ndarray) else e.toarray(), steps, threshold)
    from scipy.sparse import csr_array

    from fvsolve.studies.stability.vector_growth import VectorGrowth

    return VectorGrowth(method, csr_array(e), steps, threshold, latest)


def predicted_limit(growth: Any) -> StepLimit:
    """Limit of the step of a linear system, below which no step fails; searched from 0.1 to 1e4 over ||J||."""
    if growth.size == 0.0:
        return StepLimit(np.inf, np.inf)
    return growth.limit()
