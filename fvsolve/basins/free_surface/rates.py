"""Rates of the cells of water with a free surface. Knows the tables; knows no flux."""

from fvsolve.basins.bands import cells_of
from fvsolve.basins.free_surface import faces, grid
from fvsolve.basins.free_surface.friction import FASTEST, add_friction
from fvsolve.basins.kinds import kind_of
from fvsolve.basins.patches import book_open, wanted, weight_of
from fvsolve.basins.stretch import seen_of
from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import NO_DRAG, RATE

MINE = kind_of(__package__)


@njit
def through_faces(begin, stop, kx, ky, flow_x, flow_y):
    """Make flows per width of faces of rows `begin` to `stop` flows through them."""
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
def finish_water(tables, b, rate, y, rates, out):
    """Add friction to rates of water, book what passes an open boundary, and let steps follow both and the waves."""
    st, basin = tables.settings[0], tables.basins[b]
    if basin["friction"] != NO_DRAG:
        n, o, seen, roughness = (
            basin["n"],
            basin["y"],
            seen_of(basin, tables.seen, y),
            tables.basins["roughness"][b : b + 1],
        )
        a, z = cells_of(tables, b)
        east, north = o + n, o + 2 * n
        fades = add_friction(
            basin["friction"], st["gravity"], roughness, FASTEST, tables.plane[basin["plan"] + a :],
            seen[o + a : o + z], seen[east + a : east + z], seen[north + a : north + z],
            y[east + a : east + z], y[north + a : north + z],
            rates[n + a : n + z], rates[2 * n + a : 2 * n + z],
        )  # fmt: skip
        out[RATE] = max(out[RATE], fades)
    book_open(tables, b, st["rho"], out)
    out[RATE] = max(out[RATE], basin["unsplit"] * rate)


@njit
def on_grid(tables, b, y, dydt, out, moves):
    """Rates of cells of a rectangle, of contents where it moves; moves : None, or as `grid.grid_rates` has it."""
    st, plane, work, basin = tables.settings[0], tables.plane, tables.work, tables.basins[b]
    n, o, at, k, f = basin["n"], basin["y"], basin["plan"], basin["spacing"], basin["flows"]
    nx, ny, through, g = basin["nx"], basin["ny"], basin["through"], weight_of(st, plane, basin)
    plan, many = plane[at : at + grid.PLANS * n].reshape((grid.PLANS, n)), ny * (nx + 1)
    flow_x, flow_y = work[:0], work[:0]
    if f >= 0:  # scalars are carried by them
        flow_x, flow_y = work[f : f + many], work[f + many : f + many + (ny + 1) * nx]
    dh, qx, qy = y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n]
    to, first = (dydt, o) if dydt.size > 0 else (work, basin["unused"])
    rates = to[first : first + 3 * n]
    rate = grid.grid_rates(
        g, basin["scheme"], basin["limiter"], nx, ny, tables.bands[2 * b], tables.bands[2 * b + 1],
        plane[k : k + nx], plane[k + nx : k + nx + ny],
        plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]], plan, dh, qx, qy, flow_x, flow_y,
        work[through : through + basin["outer_given"]], work[basin["work"] :], rates[:n], rates[n : 2 * n],
        rates[2 * n :], moves,
    )  # fmt: skip
    if f >= 0:
        through_faces(
            tables.bands[2 * b], tables.bands[2 * b + 1], plane[k : k + nx], plane[k + nx : k + nx + ny], flow_x, flow_y
        )
    finish_water(tables, b, rate, y, rates, out)


@njit
def rates_on_grids(t, y, dydt, out, handle):
    """Rates of cells of rectangles that stand still."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] == MINE and basin["nx"] > 0 and basin["walls"] == 0 and wanted(basin, dydt):
            on_grid(tables, b, y, dydt, out, None)


@njit
def on_mesh(tables, b, y, dydt, out, moves):
    """Rates of cells of any mesh, of contents where it moves; moves : None, or as `faces.shallow_rates` has it."""
    st, plane, work, integers = tables.settings[0], tables.plane, tables.work, tables.integers
    basin = tables.basins[b]
    n, o, at, f, through = basin["n"], basin["y"], basin["plan"], basin["flows"], basin["through"]
    plan, seen = plane[at : at + grid.PLANS * n].reshape((grid.PLANS, n)), seen_of(basin, tables.seen, y)
    dh, qx, qy = seen[o : o + n], seen[o + n : o + 2 * n], seen[o + 2 * n : o + 3 * n]
    to, first = (dydt, o) if dydt.size > 0 else (work, basin["unused"])
    rates = to[first : first + 3 * n]
    flow = work[:0]
    if f >= 0:  # scalars are carried by them
        flow = work[f : f + basin["faces"]]
    rate = faces.shallow_rates(
        weight_of(st, plane, basin), basin["scheme"], basin["wide"], plane[basin["mesh"] :], integers[basin["links"] :],
        plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]], plan, dh, qx, qy, flow,
        work[through : through + basin["outer_given"]], work[basin["work"] :], rates[:n], rates[n : 2 * n],
        rates[2 * n :], moves,
    )  # fmt: skip
    finish_water(tables, b, rate, y, rates, out)


@njit
def rates_on_meshes(t, y, dydt, out, handle):
    """Rates of cells of any mesh that stands still."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] == MINE and basin["nx"] == 0 and basin["walls"] == 0 and wanted(basin, dydt):
            on_mesh(tables, b, y, dydt, out, None)
