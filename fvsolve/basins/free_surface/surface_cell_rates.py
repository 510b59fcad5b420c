"""Rates of the cells of water with a free surface."""

from math import inf

from fvsolve.basins.basin_patches import needs_rates, normal_gravity, put_open_flows
from fvsolve.basins.boundary_cells import band_cells
from fvsolve.basins.cell_stretching import deviations_of
from fvsolve.basins.free_surface import surface_grid, surface_mesh
from fvsolve.basins.free_surface.bed_friction import add_capped_friction, add_friction, damp_flows
from fvsolve.basins.physics_codes import physics_code
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import NO_DRAG, RATE
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


@njit
def through_faces(begin, stop, kx, ky, flow_x, flow_y):
    """Convert flows per width [m2/s] to flows through faces [m3/s] of rows `begin` to `stop` - 1 of a grid, in place.

    kx, ky : 1 / widths of columns, 1 / heights of rows [1/m]
    flow_x, flow_y : flows through the faces normal to x and to y
    """
    nx = kx.size
    for j in range(begin, stop):
        high = 1.0 / ky[j]
        for i in range(nx + 1):
            flow_x[j * (nx + 1) + i] *= high
    for i in range(nx):
        wide = 1.0 / kx[i]
        for j in range(begin, stop + 1):
            flow_y[j * nx + i] *= wide


@njit
def add_bed_friction(tables, b, a, z, y, rates, out):
    """Add bed friction to the rates of cells `a` to `z` - 1 of basin b; capped friction also limits the time step.

    rates : rates of the three states of all cells of the basin
    """
    basin = tables.basins[b]
    n, o, seen, roughness = (
        basin["n"],
        basin["y"],
        deviations_of(basin, tables.seen, y),
        tables.basins["roughness"][b : b + 1],
    )
    east, north = o + n, o + 2 * n
    law, g, depths = basin["friction"], tables.settings[0]["gravity"], tables.plane[basin["plan"] + a :]
    dh, qx, qy = seen[o + a : o + z], seen[east + a : east + z], seen[north + a : north + z]
    content_x, content_y = y[east + a : east + z], y[north + a : north + z]
    rate_x, rate_y = rates[n + a : n + z], rates[2 * n + a : 2 * n + z]
    if basin["held"] == inf:
        add_friction(law, g, roughness, depths, dh, qx, qy, content_x, content_y, rate_x, rate_y)
    else:
        friction_rate = add_capped_friction(
            law, g, roughness, basin["held"], depths, dh, qx, qy, content_x, content_y, rate_x, rate_y
        )
        out[RATE] = max(out[RATE], friction_rate)


@njit
def damp_stages(h, y, rates, quick, handle):
    """Divide the rates of unit flows of a stage by 1 + h R for bed friction, in all basins for which it is needed.

    h : time step [s]; quick : h R of each unit flow is written here; for R see `bed_friction.damp_flows`
    """
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] == OWN_CODE and basin["damped"] == 1:
            (a, z), n, o = band_cells(tables, b), basin["n"], basin["y"]
            east, north, seen = o + n, o + 2 * n, deviations_of(basin, tables.seen, y)
            damp_flows(
                basin["friction"], tables.settings[0]["gravity"], tables.basins["roughness"][b : b + 1], h,
                tables.plane[basin["plan"] + a :], seen[o + a : o + z], seen[east + a : east + z],
                seen[north + a : north + z], y[east + a : east + z], y[north + a : north + z],
                rates[east + a : east + z], rates[north + a : north + z], quick[east + a : east + z],
                quick[north + a : north + z],
            )  # fmt: skip


@njit
def finish_water(tables, b, rate, out):
    """Write the flows of basin b through open patches to `out`, and raise out[RATE], which limits the step.

    rate : greatest rate of the cells [1/s]
    """
    put_open_flows(tables, b, tables.settings[0]["rho"], out)
    out[RATE] = max(out[RATE], tables.basins[b]["unsplit"] * rate)


@njit
def finish_block(tables, b, row, block_stop, first, last, y, rates, out):
    """Add bed friction to the rates of a block: columns `first` to `last` - 1 of rows `row` to `block_stop` - 1.

    Then form the state at the end of the step in these cells, or check that it is finite, as `tables.sums` requests.
    b : number of the basin; rates : as for `add_bed_friction`
    """
    basin, sums, nx = tables.basins[b], tables.sums, tables.basins[b]["nx"]
    if basin["friction"] != NO_DRAG:
        if first == 0 and last == nx:
            add_bed_friction(tables, b, nx * row, nx * block_stop, y, rates, out)
        for j in range(row, block_stop if last - first < nx else row):
            add_bed_friction(tables, b, nx * j + first, nx * j + last, y, rates, out)
    for q in range(3):
        at = basin["y"] + q * basin["n"]
        if sums[MODE] == CHECK:
            check_rows(sums, y, at, nx, row, block_stop, first, last)
        elif sums[MODE] == STAGE_AND_END:  # ghosts of the previous columns were read from the stage
            form_rows(sums, True, at, nx, row, block_stop, max(first - surface_grid.GHOSTS, 0), last)


@njit
def by_blocks(tables, b, g, kx, ky, reflect, plan, dh, qx, qy, through, work, y, rates, out):
    """Write the rates of `surface_grid.grid_rates` and friction block by block, and return the greatest rate [1/s].

    The sums of Runge-Kutta stages requested in `tables.sums` are formed in the same pass.
    b : number of the basin; y : states of the model; rates : as for `add_bed_friction`
    Other arguments as for `surface_grid.grid_rates`
    """
    basin, empty, most = tables.basins[b], tables.work[:0], 0.0
    nx, ny, n, begin, stop = basin["nx"], basin["ny"], basin["n"], tables.bands[2 * b], tables.bands[2 * b + 1]
    for first in range(0, nx, surface_grid.MAX_COLUMNS):
        last = min(first + surface_grid.MAX_COLUMNS, nx)
        left, right, formed_ahead = max(first - surface_grid.GHOSTS, 0), min(last + surface_grid.GHOSTS, nx), begin
        rows = max(tables.sums[CELLS] // (last - first), 1)
        for row in range(begin, stop, rows):
            block_stop = min(row + rows, stop)
            ahead = min(block_stop + surface_grid.REACH, stop)
            for q in range(3 if tables.sums[MODE] != CHECK else 0):
                form_rows(tables.sums, False, basin["y"] + q * n, nx, formed_ahead, ahead, left, right)
            formed_ahead = ahead
            rate = surface_grid.column_rates(
                g, basin["scheme"], basin["limiter"], nx, ny, row, block_stop, row == begin, first, last, kx, ky,
                reflect, plan, dh, qx, qy, empty, empty, through, work, rates[:n], rates[n : 2 * n], rates[2 * n :],
                None,
            )  # fmt: skip
            most = max(most, rate)
            finish_block(tables, b, row, block_stop, first, last, y, rates, out)
    if tables.sums[MODE] == STAGE_AND_END:
        form_checked_runs(tables.sums)
    return most


@njit
def on_grid(tables, b, y, dydt, out, moves):
    """Write the rates of the cells of basin b, whose mesh is a grid. moves : None, or as in `surface_grid.grid_rates`

    If walls move, the states are those of `basins.cell_stretching`. If `dydt` is empty, the rates are written to
    `tables.work`. Flows through faces (for scalars) and open patches, and out[RATE], are written too.
    """
    st, plane, work, basin = tables.settings[0], tables.plane, tables.work, tables.basins[b]
    n, o, at, k, f = basin["n"], basin["y"], basin["plan"], basin["spacing"], basin["flows"]
    nx, ny, through, g = basin["nx"], basin["ny"], basin["through"], normal_gravity(st, plane, basin)
    plan, count = plane[at : at + surface_grid.PLANS * n].reshape((surface_grid.PLANS, n)), ny * (nx + 1)
    flow_x, flow_y = work[:0], work[:0]
    if f >= 0:  # needed for scalars
        flow_x, flow_y = work[f : f + count], work[f + count : f + count + (ny + 1) * nx]
    dh, qx, qy = y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n]
    to, first = (dydt, o) if dydt.size > 0 else (work, basin["boundary_rates"])
    rates = to[first : first + 3 * n]
    kx, ky, passing = plane[k : k + nx], plane[k + nx : k + nx + ny], work[through : through + basin["outer_given"]]
    reflect, scratch = plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]], work[basin["work"] :]
    if moves is None and requested_mode(tables, b) != OFF:
        rate = by_blocks(tables, b, g, kx, ky, reflect, plan, dh, qx, qy, passing, scratch, y, rates, out)
        finish_water(tables, b, rate, out)
        return
    rate = surface_grid.grid_rates(
        g, basin["scheme"], basin["limiter"], nx, ny, tables.bands[2 * b], tables.bands[2 * b + 1], kx, ky, reflect,
        plan, dh, qx, qy, flow_x, flow_y, passing, scratch, rates[:n], rates[n : 2 * n], rates[2 * n :], moves,
    )  # fmt: skip
    if f >= 0:
        through_faces(
            tables.bands[2 * b], tables.bands[2 * b + 1], plane[k : k + nx], plane[k + nx : k + nx + ny], flow_x, flow_y
        )
    if basin["friction"] != NO_DRAG:
        a, z = band_cells(tables, b)
        add_bed_friction(tables, b, a, z, y, rates, out)
    finish_water(tables, b, rate, out)


@njit
def rates_on_grids(t, y, dydt, out, handle):
    """Write the rates of all basins of water that have a grid and no moving walls."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] == OWN_CODE and basin["nx"] > 0 and basin["walls"] == 0 and needs_rates(basin, dydt):
            on_grid(tables, b, y, dydt, out, None)


@njit
def on_mesh(tables, b, y, dydt, out, moves):
    """Write the rates of the cells of basin b, whose mesh is not a grid.

    moves : None, or as in `surface_mesh.shallow_rates`; otherwise as for `on_grid`
    """
    st, plane, work, integers = tables.settings[0], tables.plane, tables.work, tables.integers
    basin = tables.basins[b]
    n, o, at, f, through = basin["n"], basin["y"], basin["plan"], basin["flows"], basin["through"]
    plan, seen = (
        plane[at : at + surface_grid.PLANS * n].reshape((surface_grid.PLANS, n)),
        deviations_of(basin, tables.seen, y),
    )
    dh, qx, qy = seen[o : o + n], seen[o + n : o + 2 * n], seen[o + 2 * n : o + 3 * n]
    to, first = (dydt, o) if dydt.size > 0 else (work, basin["boundary_rates"])
    rates = to[first : first + 3 * n]
    flow = work[:0]
    if f >= 0:  # needed for scalars
        flow = work[f : f + basin["faces"]]
    rate = surface_mesh.shallow_rates(
        normal_gravity(st, plane, basin),
        basin["scheme"],
        basin["wide"],
        plane[basin["mesh"] :],
        integers[basin["links"] :],
        plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]],
        plan,
        dh,
        qx,
        qy,
        flow,
        work[through : through + basin["outer_given"]],
        work[basin["work"] :],
        rates[:n],
        rates[n : 2 * n],
        rates[2 * n :],
        moves,
    )
    if basin["friction"] != NO_DRAG:
        a, z = band_cells(tables, b)
        add_bed_friction(tables, b, a, z, y, rates, out)
    finish_water(tables, b, rate, out)


@njit
def rates_on_meshes(t, y, dydt, out, handle):
    """Write the rates of all basins of water that have a mesh other than a grid and no moving walls."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] == OWN_CODE and basin["nx"] == 0 and basin["walls"] == 0 and needs_rates(basin, dydt):
            on_mesh(tables, b, y, dydt, out, None)
