"""Power and stored energy of a liquid under the density law `linear`.

The stored energy per volume is P r / rho + a^2 r^2 / (2 rho) + |m|^2 / (2 rho): piezometric pressure P at rest [Pa],
density rho, its deviation r [kg/m3], wave speed a [m/s], mass-flow density m [kg/(m2 s)]. For the entries of the array
`power` see `basin_energy`.
"""

from fvsolve.basins.basin_energy import basin_first_row, rest_potential
from fvsolve.basins.physics_codes import physics_code
from fvsolve.jit import njit
from fvsolve.kernels.table_handle import open_tables

OWN_CODE = physics_code(__package__)


@njit
def add_power(t, y, dydt, out, handle, power):
    """Write the rate of change of the stored energy of every liquid to `power` [W]."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if tables.basins[b]["kind"] == OWN_CODE:
            rows = power[basin_first_row(tables, power, b) :]
            liquid_power(tables.settings[0], tables.basins[b], tables.plane, y, dydt, rows)


@njit
def liquid_power(st, basin, plane, y, dydt, rows):
    """Write the rate of change of the stored energy of a liquid [W] to rows[3].

    rows : entries of the basin in `power`, see `basin_energy`
    """
    n, o, rest, area = basin["n"], basin["y"], rest_potential(st, basin), plane[basin["drawn"] :]
    rate, square = 0.0, basin["speed"] * basin["speed"]
    for i in range(n):
        kinetic = y[o + n + i] * dydt[o + n + i] + y[o + 2 * n + i] * dydt[o + 2 * n + i]
        rate += area[i] * ((rest + square * y[o + i]) * dydt[o + i] + kinetic)
    rows[3] = basin["thickness"] * rate / st["rho"]


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Write the stored energy of every liquid, relative to that at rest, to `stored` [J]."""
    tables = open_tables(handle)
    st, basins = tables.settings[0], tables.basins
    for b in range(basins.size):
        basin, total = basins[b], 0.0
        if basin["kind"] != OWN_CODE:
            continue
        n, o, rest, area = basin["n"], basin["y"], rest_potential(st, basin), tables.plane[basin["area"] :]
        for i in range(n):
            r, square = y[o + i], y[o + n + i] ** 2 + y[o + 2 * n + i] ** 2
            total += area[i] * (rest * r + 0.5 * (basin["speed"] ** 2 * r * r + square))
        stored[stored.size - basins.size + b] = total * (basin["thickness"] / st["rho"])
