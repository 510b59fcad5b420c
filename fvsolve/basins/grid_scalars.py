"""Rates of scalars in basins on grids by advection and diffusion; `basin_scalars` adds the other terms."""

from fvsolve.basins.advection import add_fifth_order, grid_advection, grid_fastest
from fvsolve.basins.basin_scalars import depth_count, flow_factor, prepare_scalars
from fvsolve.basins.boundary_cells import has_given_flows
from fvsolve.basins.cell_stretching import deviations_of
from fvsolve.basins.diffusion import grid_diffusion
from fvsolve.basins.second_order import second_order_rates
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import MUSCL, RATE, UPWIND
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


@njit(forceinline=True)
def on_grid(basin):
    """True if the basin contains scalars and its mesh is a grid."""
    return basin["carried"] >= 0 and basin["nx"] > 0


@njit(forceinline=True)
def grid_arrays(tables, basin):
    """(1 / widths, 1 / heights, flows along x, flows along y, depths, work array) of a grid with scalars.

    For the depths see `prepare_scalars`.
    """
    plane, work = tables.plane, tables.work
    flows = plane if has_given_flows(basin) else work
    nx, ny, k, f, toil = basin["nx"], basin["ny"], basin["spacing"], basin["flows"], basin["scalar_work"]
    across = f + ny * (nx + 1)
    return (
        plane[k : k + nx], plane[k + nx : k + nx + ny], flows[f:across], flows[across : across + (ny + 1) * nx],
        work[toil : toil + depth_count(basin)], work[toil + basin["n"] :],
    )  # fmt: skip


@njit
def advect_on_grids(t, y, dydt, out, handle):
    """Write the rates of the amounts of all scalars in grids by muscl, or by upwind under all other schemes.

    out[RATE], which limits the step, is raised. Requested stage sums are formed too.
    """
    tables = open_tables(handle)
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if not on_grid(basin):
            continue
        prepare_scalars(t, tables, b, y)
        begin, stop = tables.bands[2 * b], tables.bands[2 * b + 1]
        kx, ky, flow_x, flow_y, depth, work = grid_arrays(tables, basin)
        seen = deviations_of(basin, tables.seen, y)
        quick = basin["unsplit"] * basin["fastest"]  # at full speed: a periodic velocity may grow within a step
        for q in range(tables.scalars.size):
            out[RATE] = max(out[RATE], quick + tables.scalars[q]["decay"])
            n, ring = basin["n"], basin["outside"] + q * basin["outer"]
            at, outside = basin["carried"] + q * n, tables.work[ring : ring + basin["outer"]]
            if requested_mode(tables, b) != OFF:
                by_blocks(
                    tables.sums,
                    at,
                    basin["scheme"],
                    basin["limiter"],
                    begin,
                    stop,
                    kx,
                    ky,
                    flow_factor(t, basin),
                    flow_x,
                    flow_y,
                    outside,
                    y,
                    work,
                    dydt[at : at + n],
                )
                continue
            grid_advection(
                basin["scheme"], basin["limiter"], kx.size, ky.size, begin, stop, kx, ky, flow_factor(t, basin), flow_x,
                flow_y, depth, outside, seen[at : at + n], work, dydt[at : at + n],
            )  # fmt: skip
    if tables.sums.size > 0 and tables.sums[MODE] == STAGE_AND_END:
        form_checked_runs(tables.sums)


@njit
def by_blocks(sums, at, scheme, limiter, begin, stop, kx, ky, factor, flow_x, flow_y, outside, y, work, rate):
    """Write rates of a scalar as `grid_advection` does for depth 1, block by block, and form the requested stage sums.

    Both happen in the same pass. sums : see `kernels.stage_sums`; at : index in the states y of the first amount
    Other arguments as for `advection.grid_advection`
    """
    nx, ny, n, formed_ahead, formed_end = kx.size, ky.size, rate.size, begin, begin
    rows = max(sums[CELLS] // nx, 1)
    for row in range(begin, stop, rows):
        block_stop = min(row + rows, stop)
        ahead = min(block_stop + 2, stop)
        if sums[MODE] != CHECK:
            form_rows(sums, False, at, nx, formed_ahead, ahead, 0, nx)
        formed_ahead = ahead
        second_order_rates(
            scheme if scheme == MUSCL else UPWIND, limiter, nx, ny, row, block_stop, stop, row == begin, kx, ky, factor,
            flow_x, flow_y, outside, y[at : at + n], work[n:], rate,
        )  # fmt: skip
        if sums[MODE] == CHECK:
            check_rows(sums, y, at, nx, row, block_stop, 0, nx)
        elif sums[MODE] == STAGE_AND_END:  # rates of the next row read the last of these rows
            form_rows(sums, True, at, nx, formed_end, block_stop if block_stop == stop else block_stop - 1, 0, nx)
            formed_end = block_stop - 1


@njit
def add_fifth_order_on_grids(t, y, dydt, out, handle):
    """Add the difference of upwind5 or weno5 from upwind to the rates of all scalars in grids.

    The fluxes of weno5 are limited to keep the bounds of the scalars, see `advection.add_fifth_order`.
    """
    tables = open_tables(handle)
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if not on_grid(basin):
            continue
        kx, ky, flow_x, flow_y, depth, work = grid_arrays(tables, basin)
        seen = deviations_of(basin, tables.seen, y)
        fastest = basin["fastest"]
        if depth.size > 0:
            fastest = grid_fastest(kx.size, ky.size, kx, ky, flow_x, flow_y, depth, work)
        for q in range(tables.scalars.size):
            n, ring, scalar = basin["n"], basin["outside"] + q * basin["outer"], tables.scalars[q]
            at = basin["carried"] + q * n
            add_fifth_order(
                basin["scheme"], kx.size, ky.size, kx, ky, flow_factor(t, basin), flow_x, flow_y, depth,
                tables.work[ring : ring + basin["outer"]], scalar["least"], scalar["greatest"], fastest,
                seen[at : at + n], work, dydt[at : at + n],
            )  # fmt: skip


@njit
def diffuse_on_grids(t, y, dydt, out, handle):
    """Add diffusion to the rates of the amounts of all scalars in grids; raise out[RATE], which limits the step."""
    tables = open_tables(handle)
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if not on_grid(basin):
            continue
        kx, ky, flow_x, flow_y, depth, work = grid_arrays(tables, basin)
        begin, stop = tables.bands[2 * b], tables.bands[2 * b + 1]
        seen = deviations_of(basin, tables.seen, y)
        for q in range(tables.scalars.size):
            n, ring, diffusivity = basin["n"], basin["outside"] + q * basin["outer"], tables.scalars[q]["diffusivity"]
            at = basin["carried"] + q * n
            if diffusivity > 0.0:
                diffusion_rate = grid_diffusion(
                    kx.size, ky.size, begin, stop, kx, ky, diffusivity, flow_factor(t, basin), flow_x, flow_y, depth,
                    tables.work[ring : ring + basin["outer"]], seen[at : at + n], work, dydt[at : at + n],
                )  # fmt: skip
                other_rates = basin["unsplit"] * basin["fastest"] + tables.scalars[q]["decay"]
                out[RATE] = max(out[RATE], other_rates + diffusion_rate)
