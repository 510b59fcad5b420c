"""Power of what comes into basins by patches, under the linear law. Knows the tables; adds nothing up over time.

Rows of `power`, last of all, a basin: what comes in by patches at their potential, what is lost there (what enters has
no speed, what leaves takes its own along and is not paid for it), friction, rate of storage, what its law takes of it
besides where it rides on a body [W]; of `stored`: its
change since the profile [J]. A physics fills what is not zero of its own, squares being those of a cell's mean.
"""

from fvsolve.jit import njit
from fvsolve.kernels.accounts import OF_BASIN, basin_rows
from fvsolve.kernels.energy import potential
from fvsolve.kernels.handle import open_tables


@njit
def row_of(tables, power, b):
    """The first of the rows of `power` of basin b."""
    return basin_rows(tables, power) + OF_BASIN * b


@njit(forceinline=True)
def at_rest(st, basin):
    """Potential of the profile [Pa]."""
    return basin["rest"] - st["rho"] * st["gravity"] * st["datum"]


@njit
def patch_power(t, y, dydt, out, handle, power):
    """What comes in by the patches of all basins."""
    tables = open_tables(handle)
    rho, patches, layout = tables.settings[0]["rho"], tables.patches, tables.layout[0]
    for k in range(row_of(tables, power, 0), power.size):
        power[k] = 0.0
    for k in range(patches.size):
        node = patches[k]["node"]
        flow = out[layout["net"] + node] + out[layout["supply"] + node]
        power[row_of(tables, power, patches[k]["basin"])] += potential(tables, out, node) * flow / rho
