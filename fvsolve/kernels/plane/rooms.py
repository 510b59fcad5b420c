"""Basins as rooms of a scene, one for each kind: rates of their cells. Knows the tables; knows no flux."""

from fvsolve.basins.free_surface import faces as shallow_faces
from fvsolve.basins.free_surface import grid as shallow
from fvsolve.basins.free_surface.friction import FASTEST, add_friction
from fvsolve.basins.liquid import faces as liquid_faces
from fvsolve.basins.liquid import grid as liquid
from fvsolve.basins.liquid import grid_full as liquid_log
from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.plane.patches import book_open
from fvsolve.kernels.records import ACOUSTIC_GRID, LIQUID_FACES, LIQUID_GRID, NO_DRAG, RATE, SHALLOW_FACES, SHALLOW_GRID


@njit
def through_faces(kx, ky, flow_x, flow_y):
    """Make flows per width of faces, row by row, flows through them."""
    nx = kx.size
    for j in range(ky.size):
        high = 1.0 / ky[j]
        for i in range(nx + 1):
            flow_x[j * (nx + 1) + i] *= high
    for i in range(nx):
        wide = 1.0 / kx[i]
        for j in range(ky.size + 1):
            flow_y[j * nx + i] *= wide


@njit(forceinline=True)
def wanted(basin, dydt):
    """Whether its rates are asked for, or what they say of flows through open patches."""
    return dydt.size > 0 or basin["through"] >= 0


@njit
def finish_water(tables, b, rate, depth, dh, qx, qy, rate_x, rate_y, out):
    """Add friction to rates of water, book what passes an open boundary, and let steps follow both and the waves."""
    st, basin = tables.settings[0], tables.basins[b]
    if basin["friction"] != NO_DRAG:
        roughness = tables.basins["roughness"][b : b + 1]
        fades = add_friction(
            basin["friction"], st["gravity"], roughness, FASTEST, depth, dh, qx, qy, rate_x, rate_y
        )  # fmt: skip
        out[RATE] = max(out[RATE], fades)
    book_open(tables, b, st["rho"], out)
    out[RATE] = max(out[RATE], basin["unsplit"] * rate)


@njit
def shallow_grids(t, y, dydt, out, handle):
    """Rates of water on grids."""
    tables = open_tables(handle)
    st, plane, work = tables.settings[0], tables.plane, tables.work
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] != SHALLOW_GRID or not wanted(basin, dydt):
            continue
        n, o, at, k, f = basin["n"], basin["y"], basin["plan"], basin["spacing"], basin["flows"]
        nx, ny, through = basin["nx"], basin["ny"], basin["through"]
        plan, many = plane[at : at + shallow.PLANS * n].reshape((shallow.PLANS, n)), ny * (nx + 1)
        flow_x, flow_y = work[:0], work[:0]
        if f >= 0:  # scalars are carried by them
            flow_x, flow_y = work[f : f + many], work[f + many : f + many + (ny + 1) * nx]
        dh, qx, qy = y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n]
        to, first = (dydt, o) if dydt.size > 0 else (work, basin["unused"])
        rates = to[first : first + 3 * n]
        rate_x, rate_y = rates[n : 2 * n], rates[2 * n :]
        rate = shallow.grid_rates(
            st["gravity"], basin["scheme"], basin["limiter"], nx, ny, plane[k : k + nx], plane[k + nx : k + nx + ny],
            plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]], plan, dh, qx, qy, flow_x, flow_y,
            work[through : through + basin["outer_given"]], work[basin["work"] :], rates[:n], rate_x, rate_y,
        )  # fmt: skip
        if f >= 0:
            through_faces(plane[k : k + nx], plane[k + nx : k + nx + ny], flow_x, flow_y)
        finish_water(tables, b, rate, plan[0], dh, qx, qy, rate_x, rate_y, out)


@njit
def acoustic_grids(t, y, dydt, out, handle):
    """Rates of a liquid under law linear on grids."""
    tables = open_tables(handle)
    plane, work = tables.plane, tables.work
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] != ACOUSTIC_GRID or not wanted(basin, dydt):
            continue
        n, o, k, nx, ny = basin["n"], basin["y"], basin["spacing"], basin["nx"], basin["ny"]
        through = basin["through"]
        to, first = (dydt, o) if dydt.size > 0 else (work, basin["unused"])
        rates = to[first : first + 3 * n]
        rate = liquid.grid_rates(
            basin["speed"], basin["small"], basin["scheme"], basin["limiter"], nx, ny, plane[k : k + nx],
            plane[k + nx : k + nx + ny], plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]],
            y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n],
            work[through : through + basin["outer_given"]], work[basin["work"] :],
            rates[:n], rates[n : 2 * n], rates[2 * n :],
        )  # fmt: skip
        book_open(tables, b, basin["thickness"], out)
        out[RATE] = max(out[RATE], rate)


@njit
def full_grid(tables, b, table, y, dydt, out):
    """Rates of a liquid with the full momentum flux on a grid, of its waves or, with no table, under law log."""
    plane, work, basin = tables.plane, tables.work, tables.basins[b]
    n, o, k, nx, ny = basin["n"], basin["y"], basin["spacing"], basin["nx"], basin["ny"]
    through = basin["through"]
    to, first = (dydt, o) if dydt.size > 0 else (work, basin["unused"])
    rates = to[first : first + 3 * n]
    rate = liquid_log.grid_rates(
        basin["speed"], basin["density"], table, basin["small"], basin["scheme"], basin["limiter"], nx, ny,
        plane[k : k + nx], plane[k + nx : k + nx + ny],
        plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]],
        y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n],
        work[through : through + basin["outer_given"]], work[basin["work"] :],
        rates[:n], rates[n : 2 * n], rates[2 * n :],
    )  # fmt: skip
    book_open(tables, b, basin["thickness"], out)
    out[RATE] = max(out[RATE], rate)


@njit
def liquid_grids(t, y, dydt, out, handle):
    """Rates of a liquid under law log on grids."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if tables.basins[b]["kind"] == LIQUID_GRID and wanted(tables.basins[b], dydt):
            full_grid(tables, b, None, y, dydt, out)


@njit
def shallow_meshes(t, y, dydt, out, handle):
    """Rates of water on meshes of any cells."""
    tables = open_tables(handle)
    st, plane, work, integers = tables.settings[0], tables.plane, tables.work, tables.integers
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] != SHALLOW_FACES or not wanted(basin, dydt):
            continue
        n, o, at, f, through = basin["n"], basin["y"], basin["plan"], basin["flows"], basin["through"]
        plan = plane[at : at + shallow.PLANS * n].reshape((shallow.PLANS, n))
        dh, qx, qy = y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n]
        to, first = (dydt, o) if dydt.size > 0 else (work, basin["unused"])
        rates = to[first : first + 3 * n]
        rate_x, rate_y = rates[n : 2 * n], rates[2 * n :]
        flow = work[:0]
        if f >= 0:  # scalars are carried by them
            flow = work[f : f + basin["faces"]]
        rate = shallow_faces.shallow_rates(
            st["gravity"], basin["scheme"], basin["wide"], plane[basin["mesh"] :], integers[basin["links"] :],
            plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]], plan, dh, qx, qy, flow,
            work[through : through + basin["outer_given"]], work[basin["work"] :], rates[:n], rate_x, rate_y,
        )  # fmt: skip
        finish_water(tables, b, rate, plan[0], dh, qx, qy, rate_x, rate_y, out)


@njit
def liquid_mesh(tables, b, table, y, dydt, out):
    """Rates of a liquid on a mesh, of its waves or, with no table, under laws linear and log."""
    plane, work, integers, basin = tables.plane, tables.work, tables.integers, tables.basins[b]
    n, o, through = basin["n"], basin["y"], basin["through"]
    to, first = (dydt, o) if dydt.size > 0 else (work, basin["unused"])
    rates = to[first : first + 3 * n]
    rate = liquid_faces.liquid_rates(
        tables.settings[0]["law"], basin["speed"], basin["density"], table, basin["scheme"], basin["wide"],
        plane[basin["mesh"] :],
        integers[basin["links"] :], plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]],
        y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n],
        work[through : through + basin["outer_given"]], work[basin["work"] :],
        rates[:n], rates[n : 2 * n], rates[2 * n :],
    )  # fmt: skip
    book_open(tables, b, basin["thickness"], out)
    out[RATE] = max(out[RATE], rate)


@njit
def liquid_meshes(t, y, dydt, out, handle):
    """Rates of a liquid on meshes of any cells, under laws linear and log."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if tables.basins[b]["kind"] == LIQUID_FACES and wanted(tables.basins[b], dydt):
            liquid_mesh(tables, b, None, y, dydt, out)
