"""The functions that a density law offers to the stepper, compiled on first use."""

import functools

from fvsolve.jit import beside, njit
from fvsolve.kernels.network import rhs_linear
from fvsolve.kernels.observer import events, observe_linear, record_linear


@functools.cache
def functions(law: str) -> tuple:
    """(rhs, observe, record, events) of a law: linear, log or table."""
    found = law_functions(law)
    code = f"from fvsolve.kernels.functions import watchers; watchers({law!r}); "
    with beside(code + "from fvsolve.steppers.march import compiled; compiled()", "march.march-*.nbi"):
        compile_as(found[0], "tvvvh")
    watchers(law)
    return found


def law_functions(law: str) -> tuple:
    """The same, not yet compiled."""
    if law == "linear":
        return rhs_linear, observe_linear, record_linear, events
    from fvsolve.kernels.barotropic import observe_barotropic, record_barotropic, rhs_barotropic

    return rhs_barotropic, observe_barotropic, record_barotropic, events


def watchers(law: str) -> None:
    """Compile what reads a state: observe, record and events."""
    _, observe, record, watch = law_functions(law)
    compile_as(record, "tvvhv")
    compile_as(observe, "tvvhv")
    compile_as(watch, "tvhv")


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
