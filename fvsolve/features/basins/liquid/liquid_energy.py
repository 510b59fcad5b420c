"""Power and stored energy of a liquid under the density law `linear`, also between moving walls.

The stored energy per volume is P r / rho + a^2 r^2 / (2 rho) + |m|^2 / (2 rho): piezometric pressure P at rest [Pa],
density rho, its deviation r [kg/m3], wave speed a [m/s], mass-flow density m [kg/(m2 s)]. For the entries of the array
`power` see `basin_output`.
"""

from fvsolve.features.basins.basin_output import basin_first_row, rest_potential
from fvsolve.features.basins.basin_patches import physics_code
from fvsolve.features.basins.moving_walls import area_growth_rate, speed_of
from fvsolve.features.basins.tables import open_basins
from fvsolve.jit import njit

OWN_CODE = physics_code(__package__)


@njit
def add_power(t, y, dydt, out, handle, power):
    """Write the rate of change of the stored energy of every liquid to `power` [W]."""
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        if tables.basins[b]["kind"] == OWN_CODE:
            rows = power[basin_first_row(tables, power, b) :]
            liquid_power(tables.settings[0], tables.basins[b], tables.plane, y, dydt, rows)


@njit
def liquid_power(st, basin, plane, y, dydt, rows):
    """Write the rate of change of the stored energy of a liquid [W] to rows[3].

    rows : entries of the basin in `power`, see `basin_output`
    """
    n = basin["n"]
    o = basin["y"]
    rest = rest_potential(st, basin)
    area = plane[basin["drawn"] :]
    rate, square = 0.0, basin["speed"] * basin["speed"]
    for i in range(n):
        kinetic = y[o + n + i] * dydt[o + n + i] + y[o + 2 * n + i] * dydt[o + 2 * n + i]
        rate += area[i] * ((rest + square * y[o + i]) * dydt[o + i] + kinetic)
    rows[3] = basin["thickness"] * rate / st["rho"]


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Write the stored energy of every liquid, relative to that at rest, to `stored` [J]."""
    tables = open_basins(handle)
    st, basins = tables.settings[0], tables.basins
    for b in range(basins.size):
        basin, total = basins[b], 0.0
        if basin["kind"] != OWN_CODE:
            continue
        n = basin["n"]
        o = basin["y"]
        rest = rest_potential(st, basin)
        area = tables.plane[basin["area"] :]
        for i in range(n):
            r, square = y[o + i], y[o + n + i] ** 2 + y[o + 2 * n + i] ** 2
            total += area[i] * (rest * r + 0.5 * (basin["speed"] ** 2 * r * r + square))
        stored[stored.size - basins.size + b] = total * (basin["thickness"] / st["rho"])


@njit(forceinline=True)
def is_moving(basin):
    """True for a basin of liquid with moving walls."""
    return basin["kind"] == OWN_CODE and basin["walls"] > 0


@njit
def displaced_potential(tables, wall):
    """Gravitational energy of the volume that a wall adds to its basin, per travel of the wall along its axis [N].

    It is rho g z times the area of the wall, with the elevation z above energy datum; the sign is reversed if the axis
    points inward.
    """
    basin, length = tables.basins[wall["basin"]], 0.0
    for m in range(wall["count"]):
        length += tables.plane[wall["lengths"] + m]
    return wall["outward"] * (
        rest_potential(tables.settings[0], basin) * basin["thickness"] * length - wall["rest"]
    )


@njit
def add_wall_power(t, y, dydt, out, handle, power):
    """Correct the rate of change of the stored energy in `power` [W] for moving walls.

    In a smaller area the same mass has a higher density and energy. Moving walls also change the potential energy.
    """
    tables = open_basins(handle)
    st, plane = tables.settings[0], tables.plane
    for b in range(tables.basins.size):
        basin, total = tables.basins[b], 0.0
        n = basin["n"]
        o = basin["y"]
        rest = rest_potential(st, basin)
        square = basin["speed"] * basin["speed"]
        for i in range(n if is_moving(basin) else 0):
            r, m2 = y[o + i], y[o + n + i] ** 2 + y[o + 2 * n + i] ** 2
            content_energy = basin["density"] * (rest + square * r) + 0.5 * (square * r * r + m2)
            total += (
                plane[basin["drawn"] + i]
                * area_growth_rate(t, tables, basin, y, i)
                * content_energy
            )
        if is_moving(basin):
            power[basin_first_row(tables, power, b) + 3] -= basin["thickness"] / st["rho"] * total
    for k in range(tables.walls.size):
        wall = tables.walls[k]
        if is_moving(tables.basins[wall["basin"]]):
            power[basin_first_row(tables, power, wall["basin"]) + 3] += displaced_potential(
                tables, wall
            ) * speed_of(t, tables, wall, y)


@njit
def add_wall_stored(t, y, dydt, out, handle, stored):
    """Add the potential energy of the mass displaced by walls [J] to the stored energy of their basins."""
    tables = open_basins(handle)
    first = stored.size - tables.basins.size
    for k in range(tables.walls.size):
        wall = tables.walls[k]
        if is_moving(tables.basins[wall["basin"]]):
            stored[first + wall["basin"]] += displaced_potential(tables, wall) * y[wall["y"]]
