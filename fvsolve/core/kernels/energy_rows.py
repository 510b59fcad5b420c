"""Index of the first entry of devices in the energy arrays `power` and `stored`.

The order at their end is: rows of features, devices, last rows of features.
"""

from fvsolve.jit import njit

DEVICE_ROWS = 3  # rows of `power` for each device; `stored` has one


@njit(forceinline=True)
def device_power_row(tables, power):
    """Index of the first entry of devices in `power`."""
    return power.size - tables.layout[0]["last_power"] - DEVICE_ROWS * tables.devices.size


@njit(forceinline=True)
def device_stored_row(tables, stored):
    """Index of the first entry of devices in `stored`."""
    return stored.size - tables.layout[0]["last_stored"] - tables.devices.size
