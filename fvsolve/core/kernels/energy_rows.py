"""Index of the first entry of each kind of part at the end of the energy arrays `power` and `stored`.

The order is: rows of features, devices, moving walls, basins.
"""

from fvsolve.jit import njit

# Rows of `power` for each part. `stored` has one row for each of these parts and none for a wall.
DEVICE_ROWS, WALL_ROWS, BASIN_ROWS = 3, 2, 5


@njit(forceinline=True)
def basin_power_row(tables, power):
    """Index of the first entry of basins in `power`."""
    return power.size - BASIN_ROWS * tables.basins.size


@njit(forceinline=True)
def wall_power_row(tables, power):
    """Index of the first entry of moving walls in `power`."""
    return basin_power_row(tables, power) - WALL_ROWS * tables.walls.size


@njit(forceinline=True)
def device_power_row(tables, power):
    """Index of the first entry of devices in `power`."""
    return wall_power_row(tables, power) - DEVICE_ROWS * tables.devices.size


@njit(forceinline=True)
def device_stored_row(tables, stored):
    """Index of the first entry of devices in `stored`."""
    return stored.size - tables.basins.size - tables.devices.size
