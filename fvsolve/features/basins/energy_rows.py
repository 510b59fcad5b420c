"""Index of the first entries of moving walls and basins, which are the last ones of the energy array `power`.

Walls have no rows in `stored`, and each basin has one of its last rows.
"""

from fvsolve.jit import njit

WALL_ROWS, BASIN_ROWS = 2, 5  # rows of `power` for each wall and basin


@njit(forceinline=True)
def basin_power_row(tables, power):
    """Index of the first entry of basins in `power`."""
    return power.size - BASIN_ROWS * tables.basins.size


@njit(forceinline=True)
def wall_power_row(tables, power):
    """Index of the first entry of moving walls in `power`."""
    return basin_power_row(tables, power) - WALL_ROWS * tables.walls.size
