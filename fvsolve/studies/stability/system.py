"""Which way the powers of a step are looked at, by size, and the limit that they give. Knows sizes."""

from __future__ import annotations

from typing import Any

import numpy as np

from fvsolve.steppers.tableau import Method
from fvsolve.studies.stability.bracket import Limit
from fvsolve.studies.stability.growth import DENSE, STEPS, THRESHOLD, DenseGrowth


def system(
    method: Method, e: Any, steps: int = STEPS, threshold: float = THRESHOLD, latest: float | None = None
) -> Any:
    """The kind that fits the size; a large one answers until `latest` on the monotonic clock."""
    if e.shape[0] <= DENSE:
        return DenseGrowth(method, e if isinstance(e, np.ndarray) else e.toarray(), steps, threshold)
    from scipy.sparse import csr_array

    from fvsolve.studies.stability.carried import Sparse

    return Sparse(method, csr_array(e), steps, threshold, latest)


def predicted(one: Any) -> Limit:
    """The greatest step below which none fails, for a linear system; looked for from 0.1 to 1e4 over ||J||."""
    if one.size == 0.0:
        return Limit(np.inf, np.inf)
    return one.limit()
