"""Scalars in basins on grids as a room of a scene. Knows the tables; the rest is as in `carried`."""

from fvsolve.basins.advection import add_fifth_order, grid_advection, grid_fastest
from fvsolve.basins.behind import is_given
from fvsolve.basins.carried import deep, made_ready, turned
from fvsolve.basins.diffusion import grid_diffusion
from fvsolve.basins.second_order import second_order_rates
from fvsolve.basins.stretch import seen_of
from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import MUSCL, RATE, UPWIND
from fvsolve.kernels.sums import BOTH, CELLS, LOOK, MODE, OFF, asked, form, form_looked_at, look


@njit(forceinline=True)
def on_grid(basin):
    """Whether scalars of a basin are carried over a grid."""
    return basin["carried"] >= 0 and basin["nx"] > 0


@njit(forceinline=True)
def parts(tables, basin):
    """1 / widths and heights of a grid, flows along and across, depths that were made ready, and room to work in."""
    plane, work = tables.plane, tables.work
    flows = plane if is_given(basin) else work
    nx, ny, k, f, toil = basin["nx"], basin["ny"], basin["spacing"], basin["flows"], basin["toil"]
    across = f + ny * (nx + 1)
    return (
        plane[k : k + nx], plane[k + nx : k + nx + ny], flows[f:across], flows[across : across + (ny + 1) * nx],
        work[toil : toil + deep(basin)], work[toil + basin["n"] :],
    )  # fmt: skip


@njit
def carry_on_grids(t, y, dydt, out, handle):
    """Rates of all amounts by upwind or muscl."""
    tables = open_tables(handle)
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if not on_grid(basin):
            continue
        made_ready(t, tables, b, y)
        begin, stop = tables.bands[2 * b], tables.bands[2 * b + 1]
        kx, ky, flow_x, flow_y, depth, work = parts(tables, basin)
        seen = seen_of(basin, tables.seen, y)
        quick = basin["unsplit"] * basin["fastest"]  # at full speed: while it turns back it gets quicker in a step
        for q in range(tables.scalars.size):
            out[RATE] = max(out[RATE], quick + tables.scalars[q]["decay"])
            n, ring = basin["n"], basin["outside"] + q * basin["outer"]
            at, outside = basin["carried"] + q * n, tables.work[ring : ring + basin["outer"]]
            if asked(tables, b) != OFF:
                by_blocks(
                    tables.sums, at, basin["scheme"], basin["limiter"], begin, stop, kx, ky, turned(t, basin), flow_x,
                    flow_y, outside, y, work, dydt[at : at + n],
                )  # fmt: skip
                continue
            grid_advection(
                basin["scheme"], basin["limiter"], kx.size, ky.size, begin, stop, kx, ky, turned(t, basin), flow_x,
                flow_y, depth, outside, seen[at : at + n], work, dydt[at : at + n],
            )  # fmt: skip
    if tables.sums.size > 0 and tables.sums[MODE] == BOTH:
        form_looked_at(tables.sums)


@njit
def by_blocks(sums, at, scheme, limiter, begin, stop, kx, ky, factor, flow_x, flow_y, outside, y, work, rate):
    """`grid_advection` of values themselves, block by block, and the stages that are asked for formed beside them."""
    nx, ny, n, known, done = kx.size, ky.size, rate.size, begin, begin
    rows = max(sums[CELLS] // nx, 1)
    for row in range(begin, stop, rows):
        until = min(row + rows, stop)
        ahead = min(until + 2, stop)
        if sums[MODE] != LOOK:
            form(sums, False, at, nx, known, ahead, 0, nx)
        known = ahead
        second_order_rates(
            scheme if scheme == MUSCL else UPWIND, limiter, nx, ny, row, until, stop, row == begin, kx, ky, factor,
            flow_x, flow_y, outside, y[at : at + n], work[n:], rate,
        )  # fmt: skip
        if sums[MODE] == LOOK:
            look(sums, y, at, nx, row, until, 0, nx)
        elif sums[MODE] == BOTH:  # the last of these rows is looked at by the next one's rates
            form(sums, True, at, nx, done, until if until == stop else until - 1, 0, nx)
            done = until - 1


@njit
def add_on_grids(t, y, dydt, out, handle):
    """Add to the rates of all amounts what upwind5 has more, or weno5, which keeps the bounds of what there can be."""
    tables = open_tables(handle)
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if not on_grid(basin):
            continue
        kx, ky, flow_x, flow_y, depth, work = parts(tables, basin)
        seen = seen_of(basin, tables.seen, y)
        fastest = basin["fastest"]
        if depth.size > 0:
            fastest = grid_fastest(kx.size, ky.size, kx, ky, flow_x, flow_y, depth, work)
        for q in range(tables.scalars.size):
            n, ring, scalar = basin["n"], basin["outside"] + q * basin["outer"], tables.scalars[q]
            at = basin["carried"] + q * n
            add_fifth_order(
                basin["scheme"], kx.size, ky.size, kx, ky, turned(t, basin), flow_x, flow_y, depth,
                tables.work[ring : ring + basin["outer"]], scalar["least"], scalar["greatest"], fastest,
                seen[at : at + n], work, dydt[at : at + n],
            )  # fmt: skip


@njit
def spread_on_grids(t, y, dydt, out, handle):
    """Add to the rates of all amounts what spreads."""
    tables = open_tables(handle)
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if not on_grid(basin):
            continue
        kx, ky, flow_x, flow_y, depth, work = parts(tables, basin)
        begin, stop = tables.bands[2 * b], tables.bands[2 * b + 1]
        seen = seen_of(basin, tables.seen, y)
        for q in range(tables.scalars.size):
            n, ring, spreads = basin["n"], basin["outside"] + q * basin["outer"], tables.scalars[q]["diffusivity"]
            at = basin["carried"] + q * n
            if spreads > 0.0:
                quick = grid_diffusion(
                    kx.size, ky.size, begin, stop, kx, ky, spreads, turned(t, basin), flow_x, flow_y, depth,
                    tables.work[ring : ring + basin["outer"]], seen[at : at + n], work, dydt[at : at + n],
                )  # fmt: skip
                still = basin["unsplit"] * basin["fastest"] + tables.scalars[q]["decay"]
                out[RATE] = max(out[RATE], still + quick)
