"""Delay: v(t) = x(t - delay), from the history of the input x."""

from fvsolve.features.controls.kernels.input_histories import START, value_before
from fvsolve.jit import njit


@njit
def decide(t, y, tables, control):
    """Output before its limits."""
    return tables.floats[control["data"] + START] + value_before(tables, control, t)
