"""Rates of the cells of a liquid under the density laws `linear` and `log`."""

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
    """True for a basin of liquid that has a rectangular grid and no moving walls, and that is not on a body."""
    return basin["kind"] == OWN_CODE and basin["nx"] > 0 and basin["walls"] == 0 and basin["frame"] < 0


@njit(forceinline=True)
def on_mesh(basin):
    """True for a basin of liquid that has a mesh other than a grid and no moving walls, and that is not on a body."""
    return basin["kind"] == OWN_CODE and basin["nx"] == 0 and basin["walls"] == 0 and basin["frame"] < 0


@njit(forceinline=True)
def states_of(tables, basin, y):
    """(deviations of density [kg/m3], mass-flow densities along x, along y [kg/(m2 s)]) of the cells of a basin."""
    n, o, seen = basin["n"], basin["y"], deviations_of(basin, tables.seen, y)
    return seen[o : o + n], seen[o + n : o + 2 * n], seen[o + 2 * n : o + 3 * n]


@njit(forceinline=True)
def rates_of(tables, basin, dydt):
    """Arrays to which the rates of the three states of cells are written.

    If `dydt` is empty, they are work arrays, which only `frame_forces.add_frame_forces` reads. If walls move, the rates
    are those of the states of `basins.cell_stretching`.
    """
    n, (to, first) = basin["n"], (dydt, basin["y"]) if dydt.size > 0 else (tables.work, basin["boundary_rates"])
    return to[first : first + n], to[first + n : first + 2 * n], to[first + 2 * n : first + 3 * n]


@njit(forceinline=True)
def boundary_arrays(tables, basin):
    """(reflection coefficients of boundary faces, flows through them, work array) of a basin: three arrays."""
    plane, work, outer, through = tables.plane, tables.work, basin["outer_given"], basin["through"]
    reflect = plane[basin["reflect"] : basin["reflect"] + outer]
    return reflect, work[through : through + outer], work[basin["work"] :]


@njit(forceinline=True)
def spacing_of(plane, basin):
    """(1 / widths of the columns, 1 / heights of the rows) of a grid [1/m]: two arrays."""
    k, nx, ny = basin["spacing"], basin["nx"], basin["ny"]
    return plane[k : k + nx], plane[k + nx : k + nx + ny]


@njit
def finish_liquid(tables, b, rate, out):
    """Write the flows of basin b through open patches to `out`, and raise out[RATE], which limits the step, to `rate`.

    rate : greatest rate of the cells [1/s]
    """
    put_open_flows(tables, b, tables.basins[b]["thickness"], out)
    out[RATE] = max(out[RATE], rate)


@njit
def by_blocks(tables, b, kx, ky, reflect, r, mx, my, through, work, y, rate_r, rate_x, rate_y):
    """Write the rates of `grid_linear.grid_rates` in blocks of rows, and return its result.

    The sums of Runge-Kutta stages requested in `tables.sums` are formed in the same pass, while the rows are in the
    cache.
    b : number of the basin; y : states of the model; other arguments as for `grid_linear.grid_rates`
    """
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
    """Write the rates of basin b, whose mesh is a grid, under the density law `linear`.

    moves : as in `grid_linear.grid_rates`; raised : None, or deviations of density to use instead of those in y
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
    """Write the rates of all liquids for which `on_grid` is True, under the density law `linear`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_grid(tables.basins[b]) and needs_rates(tables.basins[b], dydt):
            linear_grid_rates(tables, b, y, dydt, out, None, None)


@njit
def nonlinear_grid_rates(tables, b, table, y, dydt, out, moves, phi):
    """Write the rates of basin b, whose mesh is a grid, with the full momentum flux.

    table : table of `riemann_invariants`, or None for the density law `log`
    moves, phi : as in `grid_nonlinear.grid_rates`
    """
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
    """Write the rates of all liquids for which `on_grid` is True, under the density law `log`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_grid(tables.basins[b]) and needs_rates(tables.basins[b], dydt):
            nonlinear_grid_rates(tables, b, None, y, dydt, out, None, None)


@njit
def mesh_rates(tables, b, table, y, dydt, out, moves, raised, phi):
    """Write the rates of basin b on a mesh of any cells.

    table : table of `riemann_invariants`, or None for the density laws `linear` and `log`
    moves, phi : as in `liquid_rates`; raised : None, or deviations of density to use instead of those in y
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
    """Write the rates of all liquids for which `on_mesh` is True, under the density laws `linear` and `log`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_mesh(tables.basins[b]) and needs_rates(tables.basins[b], dydt):
            mesh_rates(tables, b, None, y, dydt, out, None, None, None)
