"""Rates of the cells of water with a free surface."""

from math import inf

from fvsolve.core.kernels import stage_sums as sums_of
from fvsolve.core.kernels.dtypes import RATE
from fvsolve.features.basins import mesh_blocks
from fvsolve.features.basins.basin_patches import (
    needs_rates,
    normal_gravity,
    physics_code,
    put_open_flows,
)
from fvsolve.features.basins.boundary_cells import band_cells
from fvsolve.features.basins.cell_sides import BLOCK, deviations_of
from fvsolve.features.basins.free_surface import surface_grid, surface_mesh
from fvsolve.features.basins.free_surface.bed_friction import (
    add_capped_friction,
    add_friction,
    damp_flows,
)
from fvsolve.features.basins.free_surface.marked_faces import marked_faces, no_marks
from fvsolve.features.basins.free_surface.patch_closures import driven_faces
from fvsolve.features.basins.free_surface.surface_rows import GHOSTS, MAX_COLUMNS
from fvsolve.features.basins.free_surface.water_sources import (
    DRAIN_TIME,
    add_sources,
    begin_sources,
    has_condensed_times,
    has_sources,
)
from fvsolve.features.basins.moving_meshes import mesh_motion
from fvsolve.features.basins.moving_walls import grid_motion
from fvsolve.features.basins.tables import NO_DRAG, NO_SOIL, open_basins
from fvsolve.jit import njit, specialise

OWN_CODE = physics_code(__package__)

water_mesh_rates = specialise(
    mesh_blocks.mesh_rates, "water_mesh_rates", EQUATION=surface_mesh, __name__=__name__
)


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


@njit(forceinline=True)
def flows_of(values, first, n, a, z):
    """Values of both unit flows in cells `a` to `z` - 1: two arrays. first, n : first state and number of cells"""
    return values[first + n + a : first + n + z], values[first + 2 * n + a : first + 2 * n + z]


@njit
def add_bed_friction(tables, b, a, z, y, rates, out):
    """Add bed friction to the rates of cells `a` to `z` - 1 of basin b; capped friction also limits the time step.

    rates : rates of the three states of all cells of the basin, and of its soil, see `rates_of`
    """
    basin = tables.basins[b]
    n = basin["n"]
    o = basin["y"]
    seen = deviations_of(basin, tables.seen, y)
    law = basin["friction"]
    g = tables.settings[0]["gravity"]
    values = tables.plane[basin["roughness"] + a :]
    depths, dh = tables.plane[basin["plan"] + a :], seen[o + a : o + z]
    flows = flows_of(seen, o, n, a, z)
    contents = flows_of(y, o, n, a, z)
    added = (rates[1][a:z], rates[2][a:z])
    if basin["held"] == inf:
        add_friction(law, g, values, depths, dh, flows, contents, added)
    else:
        rate = add_capped_friction(
            law, g, values, basin["held"], depths, dh, flows, contents, added
        )
        out[RATE] = max(out[RATE], rate)


@njit
def damp_stages(h, y, rates, quick, handle):
    """Divide the rates of unit flows of a stage by 1 + h R for bed friction, in all basins for which it is needed.

    h : time step [s]; quick : h R of each unit flow is written here; for R see `bed_friction.damp_flows`
    """
    tables = open_basins(handle)
    g = tables.settings[0]["gravity"]
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] == OWN_CODE and basin["damped"] == 1:
            (a, z), n, o, seen = (
                band_cells(tables, b),
                basin["n"],
                basin["y"],
                deviations_of(basin, tables.seen, y),
            )
            depths = tables.plane[basin["plan"] + a :]
            values = tables.plane[basin["roughness"] + a :]
            flows = flows_of(seen, o, n, a, z)
            contents = flows_of(y, o, n, a, z)
            damped = flows_of(rates, o, n, a, z)
            damp_flows(
                basin["friction"],
                g,
                values,
                h,
                depths,
                seen[o + a : o + z],
                flows,
                contents,
                damped,
                flows_of(quick, o, n, a, z),
            )


@njit(forceinline=True)
def quantities_of(basin):
    """Number of states of a cell: three, and those of a soil, which follow them."""
    return 3 + (basin["soil"] != NO_SOIL) + has_condensed_times(basin)


@njit
def finish_block(tables, b, row, block_stop, first, last, y, rates, out):
    """Add bed friction, rain and infiltration to the rates of a block, and finish the sums of stages there.

    It is columns `first` to `last` - 1 of rows `row` to `block_stop` - 1. The sums are the state at the end of the step
    in these cells, or check that it is finite, as `tables.sums` requests.
    b : number of the basin; rates : as for `add_bed_friction`
    """
    basin = tables.basins[b]
    sums = tables.sums
    nx = tables.basins[b]["nx"]
    if basin["friction"] != NO_DRAG:
        if first == 0 and last == nx:
            add_bed_friction(tables, b, nx * row, nx * block_stop, y, rates, out)
        for j in range(row, block_stop if last - first < nx else row):
            add_bed_friction(tables, b, nx * j + first, nx * j + last, y, rates, out)
    if has_sources(basin):
        if first == 0 and last == nx:
            add_sources(tables, b, nx * row, nx * block_stop, y, rates)
        for j in range(row, block_stop if last - first < nx else row):
            add_sources(tables, b, nx * j + first, nx * j + last, y, rates)
    for q in range(quantities_of(basin)):
        at = basin["y"] + q * basin["n"]
        if sums[sums_of.MODE] == sums_of.CHECK:
            sums_of.check_rows(sums, y, at, nx, row, block_stop, first, last)
        elif sums[sums_of.MODE] == sums_of.STAGE_AND_END:
            # ghosts of the previous columns were read from the stage
            sums_of.form_rows(sums, True, at, nx, row, block_stop, max(first - GHOSTS, 0), last)


@njit
def by_blocks(tables, b, grid, states, flows, work, y, rates, out, faces):
    """Write the rates of `surface_grid.grid_rates` and friction block by block, and return the greatest rate [1/s].

    The sums of Runge-Kutta stages requested in `tables.sums` are formed in the same pass.
    b : number of the basin; y : states of the model; rates : as for `add_bed_friction`
    Other arguments as for `surface_grid.grid_rates`
    """
    basin = tables.basins[b]
    sums = tables.sums
    nx = grid.nx
    n = tables.basins[b]["n"]
    most = 0.0
    begin, stop = tables.bands[2 * b], tables.bands[2 * b + 1]
    for first in range(0, nx, MAX_COLUMNS):
        last = min(first + MAX_COLUMNS, nx)
        left = max(first - GHOSTS, 0)
        right = min(last + GHOSTS, nx)
        formed_ahead = begin
        rows = max(sums[sums_of.CELLS] // (last - first), 1)
        for row in range(begin, stop, rows):
            block_stop = min(row + rows, stop)
            ahead = min(block_stop + surface_grid.REACH, stop)
            for q in range(quantities_of(basin) if sums[sums_of.MODE] != sums_of.CHECK else 0):
                sums_of.form_rows(
                    sums, False, basin["y"] + q * n, nx, formed_ahead, ahead, left, right
                )
            formed_ahead = ahead
            fresh = row == begin
            rate = surface_grid.column_rates(
                grid, row, block_stop, fresh, first, last, states, flows, work, rates, None, faces
            )
            most = max(most, rate)
            finish_block(tables, b, row, block_stop, first, last, y, rates, out)
    if sums[sums_of.MODE] == sums_of.STAGE_AND_END:
        sums_of.form_checked_runs(sums)
    return most


@njit(forceinline=True)
def grid_of(tables, basin, marks):
    """`surface_grid.WaterGrid` of a basin. marks : None, or its `MarkedFaces`"""
    plane = tables.plane
    n = basin["n"]
    at = basin["plan"]
    k = basin["spacing"]
    nx = basin["nx"]
    ny = basin["ny"]
    plan = plane[at : at + surface_grid.PLANS * n].reshape((surface_grid.PLANS, n))
    reflect = plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]]
    g = normal_gravity(tables.settings[0], plane, basin)
    kx = plane[k : k + nx]
    ky = plane[k + nx : k + nx + ny]
    kerbs = plane[basin["kerbs"] : basin["kerbs"] + 2 * ny]
    return surface_grid.WaterGrid(
        g, basin["scheme"], basin["limiter"], nx, ny, kx, ky, reflect, plan, kerbs, marks
    )


@njit(forceinline=True)
def rates_of(tables, basin, dydt):
    """Arrays for the rates of the three states of a basin: in `dydt` or, if that is empty, in `tables.work`.

    The fourth array is for the rates of infiltrated heights in `dydt`, the fifth for those of condensed times; they are
    empty without a soil that has them.
    """
    n, (to, first) = (
        basin["n"],
        (dydt, basin["y"]) if dydt.size > 0 else (tables.work, basin["boundary_rates"]),
    )
    soaks = n if basin["soil"] != NO_SOIL and dydt.size > 0 else 0
    taken = to[first + 3 * n : first + 3 * n + soaks]
    aging = to[first + 4 * n : first + 4 * n + (soaks if has_condensed_times(basin) else 0)]
    return (
        to[first : first + n],
        to[first + n : first + 2 * n],
        to[first + 2 * n : first + 3 * n],
        taken,
        aging,
    )


@njit
def grid_rates(tables, b, y, rates, out, moves, faces, marks):
    """Write the rates of basin b, whose mesh is a grid; return the greatest rate of its cells [1/s].

    rates : as for `add_bed_friction`; moves : None, or the `GridMotion` of moving walls
    faces, marks : None, or `DrivenFaces` and `MarkedFaces`
    If walls move, the states are those of `basins.cell_sides`. Flows through faces (for scalars) and boundary
    faces are written too.
    """
    basin = tables.basins[b]
    work = tables.work
    bands = tables.bands
    n = basin["n"]
    o = basin["y"]
    f = basin["flows"]
    through = basin["through"]
    grid = grid_of(tables, basin, marks)
    flow_x = work[:0]
    flow_y = work[:0]
    count = grid.ny * (grid.nx + 1)
    passing = work[max(through, 0) :][: basin["outer_given"] if through >= 0 else 0]
    scratch = work[basin["work"] :]
    states = y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n]
    if moves is None and sums_of.requested_mode(tables, b) != sums_of.OFF:
        flows = surface_grid.FaceFlows(flow_x, flow_y, passing)
        return by_blocks(tables, b, grid, states, flows, scratch, y, rates, out, faces)
    if f >= 0:  # needed for scalars
        flow_x, flow_y = work[f : f + count], work[f + count : f + count + (grid.ny + 1) * grid.nx]
    flows = surface_grid.FaceFlows(flow_x, flow_y, passing)
    begin = bands[2 * b]
    stop = bands[2 * b + 1]
    rate = surface_grid.grid_rates(grid, begin, stop, states, flows, scratch, rates, moves, faces)
    if f >= 0:
        through_faces(begin, stop, grid.kx, grid.ky, flow_x, flow_y)
    a, z = band_cells(tables, b)
    if basin["friction"] != NO_DRAG:
        add_bed_friction(tables, b, a, z, y, rates, out)
    if has_sources(basin):
        add_sources(tables, b, a, z, y, rates)
    return rate


@njit
def mesh_rates(tables, b, y, rates, out, moves, faces, marks):
    """Write the rates of basin b, whose mesh is not a grid; return the greatest rate of its cells [1/s].

    moves : None, or `MeshMotion`; otherwise as for `grid_rates`
    """
    work = tables.work
    basin = tables.basins[b]
    grid = grid_of(tables, tables.basins[b], marks)
    n = basin["n"]
    o = basin["y"]
    f = basin["flows"]
    through = basin["through"]
    seen = deviations_of(basin, tables.seen, y)
    flow = work[:0]
    if f >= 0:  # needed for scalars
        flow = work[f : f + basin["faces"]]
    kerbs = tables.plane[basin["kerbs"] :][: -(-n // BLOCK) * BLOCK]
    wide = min(basin["wide"], surface_mesh.MOST_OVERSHOOT)
    water = surface_mesh.MeshWater(grid.g, basin["scheme"], wide, grid.plan, kerbs, faces, marks)
    floats, integers = tables.plane[basin["mesh"] :], tables.integers[basin["links"] :]
    states = seen[o : o + n], seen[o + n : o + 2 * n], seen[o + 2 * n : o + 3 * n]
    passing = work[max(through, 0) :][: basin["outer_given"] if through >= 0 else 0]
    scratch = work[basin["work"] :]
    band, reflect = band_cells(tables, b), grid.reflect
    rate = water_mesh_rates(
        water, floats, integers, reflect, states, flow, passing, scratch, rates, band, moves, None
    )
    a, z = band
    if basin["friction"] != NO_DRAG:
        add_bed_friction(tables, b, a, z, y, rates, out)
    if has_sources(basin):
        add_sources(tables, b, a, z, y, rates)
    return rate


@njit
def no_motion(tables, basin):
    """Return None: walls do not move."""


@njit
def no_faces(tables, basin):
    """Return None: no patch is driven."""


# Constants of the template: True for grids, for moving walls, for driven patches, and for walls and sections on faces;
# functions for the rates, for the motion of walls, for the driven faces, and for the marked faces.
GRIDS, MOVING, DRIVEN, MARKED = True, False, False, False
CELLS = grid_rates
MOTION = no_motion
FACES = no_faces
MARKS = no_marks


def _rates(t, y, dydt, out, handle):
    """Write the rates of the cells of all basins of water that have one kind of mesh, and moving walls or not.

    The flows through open patches are written to `out`, and out[RATE], which limits the step, is raised.
    """
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if (
            basin["kind"] != OWN_CODE
            or (basin["nx"] > 0) != GRIDS
            or (basin["walls"] > 0) != MOVING
        ):
            continue
        if (basin["driven"] >= 0) != DRIVEN or (basin["marked"] >= 0) != MARKED:
            continue
        begin_sources(tables, basin, t, dydt, out)
        if MOVING or needs_rates(basin, dydt):
            rate = CELLS(
                tables,
                b,
                y,
                rates_of(tables, basin, dydt),
                out,
                MOTION(tables, basin),
                FACES(tables, basin),
                MARKS(tables, basin, t),
            )
            put_open_flows(tables, b, tables.settings[0]["rho"], out)
            if basin["soil"] != NO_SOIL:  # steps keep all depths above 0
                rate += 1.0 / (basin["unsplit"] * DRAIN_TIME)
            out[RATE] = max(out[RATE], basin["unsplit"] * rate)


water_grids = specialise(_rates, "water_grids")
water_meshes = specialise(_rates, "water_meshes", GRIDS=False, CELLS=mesh_rates)
water_moving_grids = specialise(_rates, "water_moving_grids", MOVING=True, MOTION=grid_motion)
water_moving_meshes = specialise(
    _rates, "water_moving_meshes", GRIDS=False, MOVING=True, CELLS=mesh_rates, MOTION=mesh_motion
)
water_driven_grids = specialise(_rates, "water_driven_grids", DRIVEN=True, FACES=driven_faces)
water_driven_meshes = specialise(
    _rates, "water_driven_meshes", GRIDS=False, DRIVEN=True, CELLS=mesh_rates, FACES=driven_faces
)
water_driven_moving_grids = specialise(
    _rates,
    "water_driven_moving_grids",
    MOVING=True,
    DRIVEN=True,
    MOTION=grid_motion,
    FACES=driven_faces,
)
water_driven_moving_meshes = specialise(
    _rates,
    "water_driven_moving_meshes",
    GRIDS=False,
    MOVING=True,
    DRIVEN=True,
    CELLS=mesh_rates,
    MOTION=mesh_motion,
    FACES=driven_faces,
)
water_marked_grids = specialise(
    _rates, "water_marked_grids", DRIVEN=True, MARKED=True, FACES=driven_faces, MARKS=marked_faces
)
water_marked_meshes = specialise(
    _rates,
    "water_marked_meshes",
    GRIDS=False,
    DRIVEN=True,
    MARKED=True,
    CELLS=mesh_rates,
    FACES=driven_faces,
    MARKS=marked_faces,
)
