"""Observed orders of convergence."""

from __future__ import annotations

import numpy as np


def observed_order(errors, sizes) -> float:
    """Slope of log error over log size between the last two entries."""
    e, h = np.log(np.asarray(errors, float)), np.log(np.asarray(sizes, float))
    return float((e[-1] - e[-2]) / (h[-1] - h[-2]))


def mean_error(found, exact) -> float:
    """Mean absolute error relative to the greatest exact value (L1 norm)."""
    found, exact = np.asarray(found), np.asarray(exact)
    return float(np.mean(np.abs(found - exact)) / np.max(np.abs(exact)))
