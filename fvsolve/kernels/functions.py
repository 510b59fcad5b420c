"""The four functions that a density law offers to the stepper, compiled on first use."""

import functools

from fvsolve.kernels.observer import events, observe_linear, record_linear
from fvsolve.kernels.network import rhs_linear
from fvsolve.kernels.records import tables_type


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

    f, v, tables = types.float64, types.float64[::1], tables_type()
    rows = ((f, v, v, v, tables), (f, v, v, tables, v), (f, v, v, tables, v), (f, v, tables, v))
    for function, signature in zip(found, rows, strict=True):
        function.compile(signature)
        function.disable_compile()
    return found
