"""Rates of a liquid in a basin on a body, in the accelerated frame of the basin.

phi is the potential of gravity and inertial forces in that frame [J/kg] (`basin_frames`). Under the density law
`linear`, p + rho phi is reconstructed instead of the pressure p, so the rates are those of a liquid without
acceleration. With the full momentum flux, the invariants are reduced by phi. At faces phi is added again, and the
pressures that would keep a cell at rest are subtracted from the forces on it. Beyond an open side the liquid rests in
the same axes, with its pressure at rest at their origin.
"""

from fvsolve.basins.basin_frames import (
    CELL_POSITIONS,
    POTENTIALS,
    add_potential,
    add_potential_points,
    add_potential_rows,
    potential_coefficients,
)
from fvsolve.basins.cell_sides import BLOCK, blocks
from fvsolve.basins.liquid.liquid_cell_rates import OWN_CODE, linear_grid_rates, mesh_rates, nonlinear_grid_rates
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import LAW_LINEAR
from fvsolve.kernels.table_handle import open_tables


@njit(forceinline=True)
def on_grid(basin):
    """True for a basin of liquid on a body, with a rectangular grid."""
    return basin["kind"] == OWN_CODE and basin["nx"] > 0 and basin["frame"] >= 0


@njit(forceinline=True)
def on_mesh(basin):
    """True for a basin of liquid on a body, with a mesh other than a rectangular grid."""
    return basin["kind"] == OWN_CODE and basin["nx"] == 0 and basin["frame"] >= 0


@njit
def equivalent_densities(tables, basin, y):
    """Write deviations of density plus rho phi / c^2 to `tables.work`, and return their offset there.

    phi is the potential of the frame of the basin, and rho phi / c^2 the deviation of density whose pressure is rho
    phi.
    """
    at, n, o = int(tables.plane[basin["frame"] + POTENTIALS]), basin["n"], basin["y"]
    per = basin["density"] / (basin["speed"] * basin["speed"])
    add_potential(tables.plane, basin, per, y[o : o + n], tables.work[at : at + n])
    return at


@njit
def grid_potentials(tables, basin):
    """Potential phi of the frame [J/kg] at cells, faces between columns and faces between rows: three arrays."""
    plane, at, nx, ny = tables.plane, int(tables.plane[basin["frame"] + CELL_POSITIONS]), basin["nx"], basin["ny"]
    x, y, lines = plane[at : at + nx], plane[at + nx : at + nx + ny], at + nx + ny
    across, along = plane[lines : lines + nx + 1], plane[lines + nx + 1 : lines + nx + ny + 2]
    work, n, face_count = tables.work[int(plane[basin["frame"] + POTENTIALS]) :], nx * ny, (nx + 1) * ny
    cells, columns, rows = work[:n], work[n : n + face_count], work[n + face_count : n + face_count + nx * (ny + 1)]
    phi = potential_coefficients(plane, basin["frame"], 1.0)
    add_potential_rows(phi, x, y, None, cells)
    add_potential_rows(phi, across, y, None, columns)
    add_potential_rows(phi, x, along, None, rows)
    return cells, columns, rows


@njit
def mesh_potentials(tables, basin):
    """Potential phi of the frame [J/kg] at cells and at the sides of cells of a mesh: two views of `tables.work`."""
    plane, at, n = tables.plane, int(tables.plane[basin["frame"] + CELL_POSITIONS]), basin["n"]
    integers = tables.integers[basin["links"] :]
    side_count, work = blocks(integers) * integers[0] * BLOCK, tables.work[int(plane[basin["frame"] + POTENTIALS]) :]
    cells, sides, phi = work[:n], work[n : n + side_count], potential_coefficients(plane, basin["frame"], 1.0)
    add_potential_points(phi, plane[at : at + n], plane[at + n : at + 2 * n], None, cells)
    at += 2 * n
    add_potential_points(phi, plane[at : at + side_count], plane[at + side_count : at + 2 * side_count], None, sides)
    return cells, sides


@njit
def waves_on_accelerated_grids(t, y, dydt, out, handle):
    """Write the rates of all liquids in basins on bodies with rectangular grids, under the density law `linear`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_grid(tables.basins[b]):
            at = equivalent_densities(tables, tables.basins[b], y)
            linear_grid_rates(tables, b, y, dydt, out, None, tables.work[at:])


@njit
def rates_on_accelerated_grids(t, y, dydt, out, handle):
    """Write the rates of all liquids in basins on bodies with rectangular grids, under the density law `log`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_grid(tables.basins[b]):
            nonlinear_grid_rates(tables, b, None, y, dydt, out, None, grid_potentials(tables, tables.basins[b]))


@njit
def table_on_accelerated_grids(t, y, dydt, out, handle):
    """Write the rates of all liquids in basins on bodies with rectangular grids, under the density law `table`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if on_grid(basin):
            nonlinear_grid_rates(
                tables, b, tables.plane[basin["table"] :], y, dydt, out, None, grid_potentials(tables, basin)
            )


@njit
def rates_on_accelerated_meshes(t, y, dydt, out, handle):
    """Write the rates of liquids in basins on bodies with meshes other than grids, density laws `linear` and `log`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if on_mesh(basin) and tables.settings[0]["law"] == LAW_LINEAR:
            at = equivalent_densities(tables, basin, y)
            mesh_rates(tables, b, None, y, dydt, out, None, tables.work[at:], None)
        elif on_mesh(basin):
            mesh_rates(tables, b, None, y, dydt, out, None, None, mesh_potentials(tables, basin))


@njit
def table_on_accelerated_meshes(t, y, dydt, out, handle):
    """Write the rates of liquids in basins on bodies with meshes other than grids, under the density law `table`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if on_mesh(basin):
            table, phi = tables.plane[basin["table"] :], mesh_potentials(tables, basin)
            mesh_rates(tables, b, table, y, dydt, out, None, None, phi)
