"""The functions that a density law offers to the stepper, compiled on first use."""

import functools

from fvsolve.jit import beside, njit
from fvsolve.kernels.network import rhs_linear
from fvsolve.kernels.observer import events, observe_linear, record_linear


@functools.cache
def functions(law: str, bodies: bool = False) -> tuple:
    """(rhs, observe, record, events) of a law, linear, log or table, in scenes with or without bodies."""
    found = law_functions(law, bodies)
    code = f"from fvsolve.kernels.functions import watchers; watchers({law!r}, {bodies}); "
    with beside(code + "from fvsolve.steppers.march import compiled; compiled()", "march.march-*.nbi"):
        compile_as(law_functions(law)[0], "tvvvh")
        compile_as(found[0], "tvvvh")
    watchers(law, bodies)
    return found


def law_functions(law: str, bodies: bool = False) -> tuple:
    """The same, not yet compiled."""
    if law == "linear" and not bodies:
        return rhs_linear, observe_linear, record_linear, events
    if law == "linear":
        from fvsolve.kernels import mechanics as own

        return own.rhs_linear_bodies, own.observe_linear_bodies, own.record_linear_bodies, own.events_bodies
    if bodies:
        from fvsolve.kernels import barotropic_mechanics as own
        from fvsolve.kernels.mechanics import events_bodies

        return own.rhs_barotropic_bodies, own.observe_barotropic_bodies, own.record_barotropic_bodies, events_bodies
    from fvsolve.kernels.barotropic import observe_barotropic, record_barotropic, rhs_barotropic

    return rhs_barotropic, observe_barotropic, record_barotropic, events


def watchers(law: str, bodies: bool = False) -> None:
    """Compile what reads a state: observe, record and events."""
    _, observe, record, watch = law_functions(law, bodies)
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
