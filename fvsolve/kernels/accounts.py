"""First rows of parts that stand at the end of `power` and `stored`: bushings first, basins last."""

from fvsolve.jit import njit

# Rows of `power` for each part. `stored` has one row for each of these parts and none for a wall.
OF_BUSHING, OF_BODY, OF_DEVICE, OF_WALL, OF_BASIN = 2, 3, 3, 2, 5


@njit(forceinline=True)
def basin_rows(tables, power):
    """First row of the basins in `power`."""
    return power.size - OF_BASIN * tables.basins.size


@njit(forceinline=True)
def wall_rows(tables, power):
    """First row of the moving walls in `power`."""
    return basin_rows(tables, power) - OF_WALL * tables.walls.size


@njit(forceinline=True)
def device_rows(tables, power):
    """First row of the devices in `power`."""
    return wall_rows(tables, power) - OF_DEVICE * tables.devices.size


@njit(forceinline=True)
def body_rows(tables, power):
    """First row of the bodies in `power`."""
    return device_rows(tables, power) - OF_BODY * tables.bodies.size


@njit(forceinline=True)
def bushing_rows(tables, power):
    """First row of the bushings in `power`."""
    return body_rows(tables, power) - OF_BUSHING * tables.bushings.size


@njit(forceinline=True)
def device_stores(tables, stored):
    """First row of the devices in `stored`."""
    return stored.size - tables.basins.size - tables.devices.size


@njit(forceinline=True)
def body_stores(tables, stored):
    """First row of the bodies in `stored`."""
    return device_stores(tables, stored) - tables.bodies.size


@njit(forceinline=True)
def bushing_stores(tables, stored):
    """First row of the bushings in `stored`."""
    return body_stores(tables, stored) - tables.bushings.size
