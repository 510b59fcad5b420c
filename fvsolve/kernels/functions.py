"""The functions that a density law offers to the stepper, compiled on first use."""

import functools

from fvsolve.jit import njit
from fvsolve.kernels.network import rhs_linear
from fvsolve.kernels.observer import events, observe_linear, record_linear


@functools.cache
def functions(law: str) -> tuple:
    """(rhs, observe, record, events) of a law: linear, log or table."""
    if law == "linear":
        found = rhs_linear, observe_linear, record_linear, events
    else:
        from fvsolve.kernels.barotropic import observe_barotropic, record_barotropic, rhs_barotropic

        found = rhs_barotropic, observe_barotropic, record_barotropic, events
    compile_as(found[0], "tvvvh")
    compile_as(found[1], "tvvhv")
    compile_as(found[2], "tvvhv")
    compile_as(found[3], "tvhv")
    return found


@functools.cache
def leap_function(wanted: bool):
    """A whole step of upwind and Euler under the linear law; not wanted, something of its type to pass on."""
    found = stay
    if wanted:
        from fvsolve.kernels.leap import leap_linear as found
    compile_as(found, "ttvvvhv")
    return found


@njit
def stay(t, h, y, y_new, out, handle, values):
    """Never called."""


def compile_as(function, letters: str) -> None:
    """Compile for arguments that are times (t), vectors (v) and a handle (h), and for no others."""
    if not hasattr(function, "compile") or function.overloads:
        return
    from numba import types

    kinds = {"t": types.float64, "v": types.float64[::1], "h": types.int64[::1]}
    function.compile(tuple(kinds[letter] for letter in letters))
    function.disable_compile()
