"""Scenes with bodies under the density laws log and table. Knows both; adds no law of its own."""

from fvsolve.jit import njit
from fvsolve.kernels.barotropic import observe_barotropic, rhs_barotropic
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.mechanics import chambers, finish_bodies, observe_bodies, record_bodies


@njit
def rhs_barotropic_bodies(t, y, dydt, out, handle):
    """`rhs_barotropic` of a scene with bodies."""
    chambers(y, out, open_tables(handle))
    rhs_barotropic(t, y, dydt, out, handle)
    finish_bodies(t, y, dydt, out, open_tables(handle))


@njit
def observe_barotropic_bodies(t, y, out, handle, values):
    """`observe_barotropic` of a scene with bodies."""
    observe_barotropic(t, y, out, handle, values)
    observe_bodies(y, out, open_tables(handle), values)


@njit
def record_barotropic_bodies(t, y, out, handle, values):
    """`record_barotropic` of a scene with bodies."""
    observe_barotropic_bodies(t, y, out, handle, values)
    record_bodies(t, y, out, open_tables(handle), values)
