"""Where rows of `power` and `stored` begin that count from the end, bushings first, basins last. Knows sizes."""

from fvsolve.jit import njit

OF_BUSHING, OF_BODY, OF_DEVICE, OF_WALL, OF_BASIN = 2, 3, 3, 2, 5  # rows of `power`; of `stored` one, a wall none


@njit(forceinline=True)
def basin_rows(tables, power):
    """First row of `power` of basins."""
    return power.size - OF_BASIN * tables.basins.size


@njit(forceinline=True)
def wall_rows(tables, power):
    """First row of `power` of walls that move."""
    return basin_rows(tables, power) - OF_WALL * tables.walls.size


@njit(forceinline=True)
def device_rows(tables, power):
    """First row of `power` of devices."""
    return wall_rows(tables, power) - OF_DEVICE * tables.devices.size


@njit(forceinline=True)
def body_rows(tables, power):
    """First row of `power` of bodies."""
    return device_rows(tables, power) - OF_BODY * tables.bodies.size


@njit(forceinline=True)
def bushing_rows(tables, power):
    """First row of `power` of bushings."""
    return body_rows(tables, power) - OF_BUSHING * tables.bushings.size


@njit(forceinline=True)
def device_stores(tables, stored):
    """First row of `stored` of devices."""
    return stored.size - tables.basins.size - tables.devices.size


@njit(forceinline=True)
def body_stores(tables, stored):
    """First row of `stored` of bodies."""
    return device_stores(tables, stored) - tables.bodies.size


@njit(forceinline=True)
def bushing_stores(tables, stored):
    """First row of `stored` of bushings."""
    return body_stores(tables, stored) - tables.bushings.size
