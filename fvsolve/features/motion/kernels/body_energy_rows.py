"""Index of the first entry of bushings and bodies in the energy arrays, before those of devices."""

from fvsolve.core.kernels.energy_rows import device_power_row, device_stored_row
from fvsolve.jit import njit

BUSHING_ROWS, BODY_ROWS = 2, 3  # rows of `power` for each part; `stored` has one row for each


@njit(forceinline=True)
def body_power_row(tables, power):
    """Index of the first entry of bodies in `power`."""
    return device_power_row(tables, power) - BODY_ROWS * tables.bodies.size


@njit(forceinline=True)
def bushing_power_row(tables, power):
    """Index of the first entry of bushings in `power`."""
    return body_power_row(tables, power) - BUSHING_ROWS * tables.bushings.size


@njit(forceinline=True)
def body_stored_row(tables, stored):
    """Index of the first entry of bodies in `stored`."""
    return device_stored_row(tables, stored) - tables.bodies.size


@njit(forceinline=True)
def bushing_stored_row(tables, stored):
    """Index of the first entry of bushings in `stored`."""
    return body_stored_row(tables, stored) - tables.bushings.size
