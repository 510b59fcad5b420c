"""The four functions that a density law offers to the stepper, compiled on first use."""

import functools

from fvsolve.kernels.observer import events, observe_linear, record_linear
from fvsolve.kernels.network import rhs_linear


@functools.cache
def functions(law: str) -> tuple:
    """(rhs, observe, record, events) of a law: linear, log or table."""
    if law == "linear":
        found = rhs_linear, observe_linear, record_linear, events
    else:
        from fvsolve.kernels.barotropic import observe_barotropic, record_barotropic, rhs_barotropic

        found = rhs_barotropic, observe_barotropic, record_barotropic, events
    if not hasattr(found[0], "compile"):
        return found
    from numba import types

    f, v, handle = types.float64, types.float64[::1], types.int64[::1]
    rows = ((f, v, v, v, handle), (f, v, v, handle, v), (f, v, v, handle, v), (f, v, handle, v))
    for function, signature in zip(found, rows, strict=True):
        if not function.overloads:
            function.compile(signature)
            function.disable_compile()
    return found
