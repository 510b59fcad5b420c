"""Rates of the cells of liquids: on grids and other meshes, at rest, on bodies and between moving walls, all laws.

phi is the potential of gravity and inertial forces in the accelerated frame of a basin on a body [J/kg]
(`basin_frames`). Under the density law `linear`, p + rho phi is reconstructed instead of the pressure p, so the rates
are those of a liquid without acceleration. With the full momentum flux, the invariants are reduced by phi. At faces phi
is added again, and the pressures that would keep a cell at rest are subtracted from the forces on it. Beyond an open
side the liquid rests in the same axes, with its pressure at rest at their origin.
"""

from fvsolve.core.kernels import stage_sums as sums_of
from fvsolve.core.kernels.dtypes import RATE
from fvsolve.features.basins import basin_frames as frames
from fvsolve.features.basins import mesh_blocks
from fvsolve.features.basins.basin_patches import needs_rates, physics_code, put_open_flows
from fvsolve.features.basins.boundary_cells import band_cells
from fvsolve.features.basins.cell_sides import BLOCK, blocks, deviations_of
from fvsolve.features.basins.liquid import liquid_grid, liquid_mesh
from fvsolve.features.basins.liquid.liquid_sides import (
    LiquidGrid,
    LiquidScheme,
    Potentials,
    side_kinds,
)
from fvsolve.features.basins.moving_meshes import mesh_motion
from fvsolve.features.basins.moving_walls import grid_motion
from fvsolve.features.basins.tables import open_basins
from fvsolve.jit import njit, specialise

OWN_CODE = physics_code(__package__)
FIXED, ON_BODY, MOVING = range(3)  # motions of basins

mesh_rates = specialise(
    mesh_blocks.mesh_rates, "mesh_rates", EQUATION=liquid_mesh, __name__=__name__
)


@njit(forceinline=True)
def motion_of(basin):
    """Motion of a basin: with moving walls (MOVING), ON_BODY, or FIXED."""
    return MOVING if basin["walls"] > 0 else ON_BODY if basin["frame"] >= 0 else FIXED


@njit(forceinline=True)
def states_of(tables, basin, y):
    """(deviations of density [kg/m3], mass-flow densities along x, along y [kg/(m2 s)]) of the cells of a basin."""
    n = basin["n"]
    o = basin["y"]
    seen = deviations_of(basin, tables.seen, y)
    return seen[o : o + n], seen[o + n : o + 2 * n], seen[o + 2 * n : o + 3 * n]


@njit(forceinline=True)
def rates_of(tables, basin, dydt):
    """Arrays to which the rates of the three states of cells are written.

    If `dydt` is empty, they are work arrays, which only `frame_forces.add_frame_forces` reads. If walls move, the rates
    are those of the states of `basins.cell_sides`.
    """
    n, (to, first) = (
        basin["n"],
        (dydt, basin["y"]) if dydt.size > 0 else (tables.work, basin["boundary_rates"]),
    )
    return to[first : first + n], to[first + n : first + 2 * n], to[first + 2 * n : first + 3 * n]


@njit(forceinline=True)
def boundary_arrays(tables, basin):
    """(reflection coefficients of boundary faces, flows through them, work array) of a basin: three arrays."""
    plane = tables.plane
    work = tables.work
    outer = basin["outer_given"]
    through = basin["through"]
    reflect = plane[basin["reflect"] : basin["reflect"] + outer]
    return reflect, work[through : through + outer], work[basin["work"] :]


@njit(forceinline=True)
def grid_of(tables, b, reflect):
    """`LiquidGrid` of basin b and the band of this thread. reflect : reflection coefficients of its boundary faces"""
    basin, plane = tables.basins[b], tables.plane
    k = basin["spacing"]
    nx = basin["nx"]
    ny = basin["ny"]
    kx = plane[k : k + nx]
    ky = plane[k + nx : k + nx + ny]
    begin = tables.bands[2 * b]
    stop = tables.bands[2 * b + 1]
    return LiquidGrid(nx, ny, begin, stop, kx, ky, reflect, side_kinds(reflect, nx, ny))


@njit(forceinline=True)
def liquid_of(basin, full, table):
    """`LiquidScheme` of a basin. full : True with the full momentum flux; table : see `LiquidScheme`"""
    c = basin["speed"]
    rho = basin["density"]
    scheme = basin["scheme"]
    limiter = basin["limiter"]
    return LiquidScheme(c, rho, table, full, scheme, limiter, basin["small"], basin["wide"])


@njit
def by_blocks(tables, b, liquid, grid, states, through, work, y, rates):
    """Write the rates of a grid under the law `linear` in blocks of rows; return the rate that limits the step [1/s].

    The sums of Runge-Kutta stages requested in `tables.sums` are formed in the same pass, while the rows are in the
    cache.
    b : number of the basin; y : states of the model; other arguments as in `liquid_grid`
    """
    basin = tables.basins[b]
    sums = tables.sums
    nx = grid.nx
    mode = tables.sums[sums_of.MODE]
    formed_ahead, rows = grid.begin, max(sums[sums_of.CELLS] // nx, 1)
    for row in range(grid.begin, grid.stop, rows):
        block_stop = min(row + rows, grid.stop)
        ahead = min(liquid_grid.row_needed(block_stop, grid.ny), grid.stop)
        for q in range(3 if mode != sums_of.CHECK else 0):
            sums_of.form_rows(
                sums, False, basin["y"] + q * basin["n"], nx, formed_ahead, ahead, 0, nx
            )
        formed_ahead = ahead
        liquid_grid.linear_rows(
            liquid, grid, row, block_stop, states, through, work, rates, None, None
        )
        for q in range(3):
            if mode == sums_of.CHECK:
                sums_of.check_rows(sums, y, basin["y"] + q * basin["n"], nx, row, block_stop, 0, nx)
            elif mode == sums_of.STAGE_AND_END:
                sums_of.form_rows(
                    sums, True, basin["y"] + q * basin["n"], nx, row, block_stop, 0, nx
                )
    if mode == sums_of.STAGE_AND_END:
        sums_of.form_checked_runs(sums)
    return liquid.c * liquid_grid.max_spacing_rate(grid.kx, grid.ky)


@njit
def linear_grid(tables, b, y, dydt, table, moves, raised):
    """Write the rates of basin b, a grid, under the density law `linear`; return the rate that limits the step [1/s].

    table : None; moves : None, or `GridMotion`
    raised : None, or result of `raised_densities`, whose deviations of density replace those in y
    """
    basin = tables.basins[b]
    reflect, through, work = boundary_arrays(tables, basin)
    grid, liquid, (r, mx, my) = (
        grid_of(tables, b, reflect),
        liquid_of(basin, False, table),
        states_of(tables, basin, y),
    )
    rates = rates_of(tables, basin, dydt)
    if moves is None and raised is None and sums_of.requested_mode(tables, b) != sums_of.OFF:
        return by_blocks(tables, b, liquid, grid, (r, mx, my), through, work, y, rates)
    if raised is not None:
        r = raised[0]
    return liquid_grid.linear_grid_rates(
        liquid, grid, (r, mx, my), through, work, rates, moves, None
    )


@njit
def nonlinear_grid(tables, b, y, dydt, table, moves, phi):
    """Write the rates of basin b, a grid, with the full momentum flux; return the rate that limits the step [1/s].

    table : table of `riemann_invariants`, or None for the density law `log`
    moves, phi : None, or `GridMotion`; None, or `Potentials`
    """
    basin = tables.basins[b]
    reflect, through, work = boundary_arrays(tables, basin)
    grid = grid_of(tables, b, reflect)
    liquid = liquid_of(basin, True, table)
    rates = rates_of(tables, basin, dydt)
    return liquid_grid.nonlinear_grid_rates(
        liquid, grid, states_of(tables, basin, y), through, work, rates, moves, phi
    )


@njit
def linear_mesh(tables, b, y, dydt, table, moves, raised):
    """Write the rates of basin b on a mesh of any cells, law `linear`; arguments and result as for `linear_grid`.

    moves : None, or `MeshMotion`
    """
    r, mx, my = states_of(tables, tables.basins[b], y)
    if raised is not None:
        r = raised[0]
    return mesh_rates_of(tables, b, (r, mx, my), dydt, False, table, moves, None)


@njit
def nonlinear_mesh(tables, b, y, dydt, table, moves, phi):
    """Write the rates of basin b on a mesh of any cells, with the full momentum flux; as for `nonlinear_grid`.

    moves, phi : None, or `MeshMotion`; None, or see `mesh_blocks`
    """
    states = states_of(tables, tables.basins[b], y)
    return mesh_rates_of(tables, b, states, dydt, True, table, moves, phi)


@njit(forceinline=True)
def mesh_rates_of(tables, b, states, dydt, full, table, moves, phi):
    """Write the rates of basin b on a mesh of any cells; return the rate that limits the step [1/s].

    full : True with the full momentum flux; other arguments as for `nonlinear_mesh`
    """
    basin, band = tables.basins[b], band_cells(tables, b)
    reflect, through, work = boundary_arrays(tables, basin)
    floats = tables.plane[basin["mesh"] :]
    integers = tables.integers[basin["links"] :]
    no_flow = tables.work[:0]
    liquid, rates = liquid_of(basin, full, table), rates_of(tables, basin, dydt)
    return mesh_rates(
        liquid, floats, integers, reflect, states, no_flow, through, work, rates, band, moves, phi
    )


@njit
def no_motion(tables, basin):
    """Return None: walls do not move."""


@njit
def no_frame(tables, basin, y):
    """Return None: the basin is not on a body."""


@njit
def raised_densities(tables, basin, y):
    """Deviations of density plus rho phi / c^2, the deviation whose pressure is rho phi: (view of `tables.work`,).

    phi : potential of the frame of the basin
    """
    at = int(tables.plane[basin["frame"] + frames.POTENTIALS])
    n = basin["n"]
    o = basin["y"]
    raised, per = tables.work[at : at + n], basin["density"] / (basin["speed"] * basin["speed"])
    frames.add_potential(tables.plane, basin, per, y[o : o + n], raised)
    return (raised,)


@njit
def grid_potentials(tables, basin, y):
    """`Potentials` of the frame at cells, faces between columns and faces between rows: views of `tables.work`."""
    plane = tables.plane
    nx = basin["nx"]
    ny = basin["ny"]
    at = int(plane[basin["frame"] + frames.CELL_POSITIONS])
    x = plane[at : at + nx]
    y = plane[at + nx : at + nx + ny]
    lines = at + nx + ny
    across, along = plane[lines : lines + nx + 1], plane[lines + nx + 1 : lines + nx + ny + 2]
    work = tables.work[int(plane[basin["frame"] + frames.POTENTIALS]) :]
    n = nx * ny
    face_count = (nx + 1) * ny
    cells = work[:n]
    columns = work[n : n + face_count]
    rows = work[n + face_count : n + face_count + nx * (ny + 1)]
    phi = frames.potential_coefficients(plane, basin["frame"], 1.0)
    frames.add_potential_rows(phi, x, y, None, cells)
    frames.add_potential_rows(phi, across, y, None, columns)
    frames.add_potential_rows(phi, x, along, None, rows)
    return Potentials(cells, columns, rows)


@njit
def mesh_potentials(tables, basin, y):
    """Potential phi of the frame [J/kg] at cells and at the sides of cells of a mesh: two views of `tables.work`."""
    plane = tables.plane
    at = int(tables.plane[basin["frame"] + frames.CELL_POSITIONS])
    n = basin["n"]
    integers = tables.integers[basin["links"] :]
    work = tables.work[int(plane[basin["frame"] + frames.POTENTIALS]) :]
    count = blocks(integers) * integers[0] * BLOCK
    phi = frames.potential_coefficients(plane, basin["frame"], 1.0)
    cells, sides = work[:n], work[n : n + count]
    frames.add_potential_points(phi, plane[at : at + n], plane[at + n : at + 2 * n], None, cells)
    at += 2 * n
    frames.add_potential_points(
        phi, plane[at : at + count], plane[at + count : at + 2 * count], None, sides
    )
    return cells, sides


# Constants of the template: True for grids; motion; True for the law `table`; functions for rates, walls and frames.
GRIDS = True
MOTION = FIXED
TABLED = False
CELLS = linear_grid
MOVES = no_motion
FRAME = no_frame


def _rates(t, y, dydt, out, handle):
    """Write the rates of the cells of all liquids that have one kind of mesh and one motion, under one density law.

    The flows through open patches are written to `out`, and out[RATE], which limits the step, is raised.
    """
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] != OWN_CODE or (basin["nx"] > 0) != GRIDS or motion_of(basin) != MOTION:
            continue
        if MOTION == MOVING or needs_rates(basin, dydt):
            table = tables.plane[basin["table"] :] if TABLED else None
            rate = CELLS(tables, b, y, dydt, table, MOVES(tables, basin), FRAME(tables, basin, y))
            put_open_flows(tables, b, basin["thickness"], out)
            out[RATE] = max(out[RATE], rate)


ON_GRIDS = {"MOTION": ON_BODY, "FRAME": grid_potentials}
ON_MESHES = {"MOTION": ON_BODY, "FRAME": mesh_potentials}
RAISED = {"MOTION": ON_BODY, "FRAME": raised_densities}
MOVING_GRIDS = {"MOTION": MOVING, "MOVES": grid_motion}
MOVING_MESHES = {"MOTION": MOVING, "MOVES": mesh_motion}
LINEAR_GRID, LOG_GRID = {"CELLS": linear_grid}, {"CELLS": nonlinear_grid}
LINEAR_MESH = {"GRIDS": False, "CELLS": linear_mesh}
LOG_MESH = {"GRIDS": False, "CELLS": nonlinear_mesh}
TABLE_GRID, TABLE_MESH = LOG_GRID | {"TABLED": True}, LOG_MESH | {"TABLED": True}

linear_grids = specialise(_rates, "linear_grids", **LINEAR_GRID)
linear_meshes = specialise(_rates, "linear_meshes", **LINEAR_MESH)
log_grids = specialise(_rates, "log_grids", **LOG_GRID)
log_meshes = specialise(_rates, "log_meshes", **LOG_MESH)
table_grids = specialise(_rates, "table_grids", **TABLE_GRID)
table_meshes = specialise(_rates, "table_meshes", **TABLE_MESH)
linear_grids_on_bodies = specialise(_rates, "linear_grids_on_bodies", **LINEAR_GRID, **RAISED)
linear_meshes_on_bodies = specialise(_rates, "linear_meshes_on_bodies", **LINEAR_MESH, **RAISED)
log_grids_on_bodies = specialise(_rates, "log_grids_on_bodies", **LOG_GRID, **ON_GRIDS)
log_meshes_on_bodies = specialise(_rates, "log_meshes_on_bodies", **LOG_MESH, **ON_MESHES)
table_grids_on_bodies = specialise(_rates, "table_grids_on_bodies", **TABLE_GRID, **ON_GRIDS)
table_meshes_on_bodies = specialise(_rates, "table_meshes_on_bodies", **TABLE_MESH, **ON_MESHES)
linear_moving_grids = specialise(_rates, "linear_moving_grids", **LINEAR_GRID, **MOVING_GRIDS)
linear_moving_meshes = specialise(_rates, "linear_moving_meshes", **LINEAR_MESH, **MOVING_MESHES)
log_moving_grids = specialise(_rates, "log_moving_grids", **LOG_GRID, **MOVING_GRIDS)
log_moving_meshes = specialise(_rates, "log_moving_meshes", **LOG_MESH, **MOVING_MESHES)
table_moving_grids = specialise(_rates, "table_moving_grids", **TABLE_GRID, **MOVING_GRIDS)
table_moving_meshes = specialise(_rates, "table_moving_meshes", **TABLE_MESH, **MOVING_MESHES)
