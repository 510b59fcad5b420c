"""Rates of the cells of a liquid under laws linear and log."""

from fvsolve.basins.basin_patches import needs_rates, put_open_flows
from fvsolve.basins.cell_stretching import deviations_of
from fvsolve.basins.liquid import grid_linear, grid_nonlinear, liquid_mesh
from fvsolve.basins.physics_codes import physics_code
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import RATE
from fvsolve.kernels.stage_sums import (
    CELLS,
    CHECK,
    MODE,
    OFF,
    STAGE_AND_END,
    check_rows,
    form_checked_runs,
    form_rows,
    requested_mode,
)
from fvsolve.kernels.table_handle import open_tables

OWN_CODE = physics_code(__package__)


@njit(forceinline=True)
def on_grid(basin):
    """True for a rectangle of liquid without moving walls that is not on a body."""
    return basin["kind"] == OWN_CODE and basin["nx"] > 0 and basin["walls"] == 0 and basin["frame"] < 0


@njit(forceinline=True)
def on_mesh(basin):
    """True for a liquid on any other mesh without moving walls that is not on a body."""
    return basin["kind"] == OWN_CODE and basin["nx"] == 0 and basin["walls"] == 0 and basin["frame"] < 0


@njit(forceinline=True)
def states_of(tables, basin, y):
    """Deviations of density and both mass-flow densities of cells."""
    n, o, seen = basin["n"], basin["y"], deviations_of(basin, tables.seen, y)
    return seen[o : o + n], seen[o + n : o + 2 * n], seen[o + 2 * n : o + 3 * n]


@njit(forceinline=True)
def rates_of(tables, basin, dydt):
    """Arrays for the rates of cells (of contents if walls move); unused work arrays if no rates are needed."""
    n, (to, first) = basin["n"], (dydt, basin["y"]) if dydt.size > 0 else (tables.work, basin["boundary_rates"])
    return to[first : first + n], to[first + n : first + 2 * n], to[first + 2 * n : first + 3 * n]


@njit(forceinline=True)
def boundary_arrays(tables, basin):
    """Reflection coefficients of the boundary, array for flows through it, and work array."""
    plane, work, outer, through = tables.plane, tables.work, basin["outer_given"], basin["through"]
    reflect = plane[basin["reflect"] : basin["reflect"] + outer]
    return reflect, work[through : through + outer], work[basin["work"] :]


@njit(forceinline=True)
def spacing_of(plane, basin):
    """1 / widths of columns and rows."""
    k, nx, ny = basin["spacing"], basin["nx"], basin["ny"]
    return plane[k : k + nx], plane[k + nx : k + nx + ny]


@njit
def finish_liquid(tables, b, rate, out):
    """Record flows through an open boundary, and the rate that limits the step."""
    put_open_flows(tables, b, tables.basins[b]["thickness"], out)
    out[RATE] = max(out[RATE], rate)


@njit
def by_blocks(tables, b, kx, ky, reflect, r, mx, my, through, work, y, rate_r, rate_x, rate_y):
    """Compute `grid_linear.grid_rates` block by block, with the requested stages formed in the same pass."""
    basin, sums, nx, ny = tables.basins[b], tables.sums, tables.basins[b]["nx"], tables.basins[b]["ny"]
    begin, stop = tables.bands[2 * b], tables.bands[2 * b + 1]
    formed_ahead, rows, side_kinds = begin, max(sums[CELLS] // nx, 1), grid_linear.side_kinds_of(reflect, nx, ny)
    for row in range(begin, stop, rows):
        block_stop = min(row + rows, stop)
        ahead = min(grid_linear.row_needed(block_stop, ny), stop)
        for q in range(3 if sums[MODE] != CHECK else 0):
            form_rows(sums, False, basin["y"] + q * basin["n"], nx, formed_ahead, ahead, 0, nx)
        formed_ahead = ahead
        grid_linear.row_rates(
            basin["speed"], basin["small"], basin["scheme"], basin["limiter"], nx, ny, begin, stop, row, block_stop, kx,
            ky, reflect, side_kinds, r, mx, my, through, work, rate_r, rate_x, rate_y, None,
        )  # fmt: skip
        for q in range(3):
            if sums[MODE] == CHECK:
                check_rows(sums, y, basin["y"] + q * basin["n"], nx, row, block_stop, 0, nx)
            elif sums[MODE] == STAGE_AND_END:
                form_rows(sums, True, basin["y"] + q * basin["n"], nx, row, block_stop, 0, nx)
    if sums[MODE] == STAGE_AND_END:
        form_checked_runs(sums)
    return basin["speed"] * grid_linear.max_spacing_rate(kx, ky)


@njit
def linear_grid_rates(tables, b, y, dydt, out, moves, raised):
    """Rates under law linear on a grid. moves : as in `grid_linear.grid_rates`.

    raised : None, or densities to use instead
    """
    basin = tables.basins[b]
    kx, ky = spacing_of(tables.plane, basin)
    (r, mx, my), (rate_r, rate_x, rate_y) = states_of(tables, basin, y), rates_of(tables, basin, dydt)
    reflect, through, work = boundary_arrays(tables, basin)
    if moves is None and raised is None and requested_mode(tables, b) != OFF:
        rate = by_blocks(tables, b, kx, ky, reflect, r, mx, my, through, work, y, rate_r, rate_x, rate_y)
        finish_liquid(tables, b, rate, out)
        return
    if raised is not None:
        r = raised
    rate = grid_linear.grid_rates(
        basin["speed"], basin["small"], basin["scheme"], basin["limiter"], basin["nx"], basin["ny"],
        tables.bands[2 * b], tables.bands[2 * b + 1], kx, ky, reflect, r, mx, my, through, work, rate_r, rate_x, rate_y,
        moves,
    )  # fmt: skip
    finish_liquid(tables, b, rate, out)


@njit
def waves_on_grids(t, y, dydt, out, handle):
    """Rates under law linear on grids."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_grid(tables.basins[b]) and needs_rates(tables.basins[b], dydt):
            linear_grid_rates(tables, b, y, dydt, out, None, None)


@njit
def nonlinear_grid_rates(tables, b, table, y, dydt, out, moves, phi):
    """Rates with the full momentum flux on a grid, from a table of its waves or, without table, under law log."""
    basin = tables.basins[b]
    kx, ky = spacing_of(tables.plane, basin)
    (r, mx, my), (rate_r, rate_x, rate_y) = states_of(tables, basin, y), rates_of(tables, basin, dydt)
    reflect, through, work = boundary_arrays(tables, basin)
    rate = grid_nonlinear.grid_rates(
        basin["speed"], basin["density"], table, basin["small"], basin["scheme"], basin["limiter"], basin["nx"],
        basin["ny"], tables.bands[2 * b], tables.bands[2 * b + 1], kx, ky, reflect, r, mx, my, through, work, rate_r,
        rate_x, rate_y, moves, phi,
    )  # fmt: skip
    finish_liquid(tables, b, rate, out)


@njit
def rates_on_grids(t, y, dydt, out, handle):
    """Rates under law log on grids."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_grid(tables.basins[b]) and needs_rates(tables.basins[b], dydt):
            nonlinear_grid_rates(tables, b, None, y, dydt, out, None, None)


@njit
def mesh_rates(tables, b, table, y, dydt, out, moves, raised, phi):
    """Rates on a mesh, from a table of its waves or, without table, under laws linear and log.

    moves, phi : as in `liquid_rates`; raised : None, or densities to use instead of the states
    """
    basin = tables.basins[b]
    (r, mx, my), (rate_r, rate_x, rate_y) = states_of(tables, basin, y), rates_of(tables, basin, dydt)
    reflect, through, work = boundary_arrays(tables, basin)
    if raised is not None:
        r = raised
    rate = liquid_mesh.liquid_rates(
        tables.settings[0]["law"], basin["speed"], basin["density"], table, basin["scheme"], basin["wide"],
        tables.plane[basin["mesh"] :], tables.integers[basin["links"] :], reflect, r, mx, my, through, work,
        rate_r, rate_x, rate_y, moves, phi,
    )  # fmt: skip
    finish_liquid(tables, b, rate, out)


@njit
def rates_on_meshes(t, y, dydt, out, handle):
    """Rates on meshes of any cells, under laws linear and log."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_mesh(tables.basins[b]) and needs_rates(tables.basins[b], dydt):
            mesh_rates(tables, b, None, y, dydt, out, None, None, None)
