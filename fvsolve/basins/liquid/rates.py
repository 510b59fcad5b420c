"""Rates of the cells of a liquid under laws linear and log. Knows the tables; knows no flux."""

from fvsolve.basins.kinds import kind_of
from fvsolve.basins.liquid import faces, grid, grid_full
from fvsolve.basins.patches import book_open, wanted
from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import RATE

MINE = kind_of(__package__)


@njit(forceinline=True)
def on_grid(basin):
    """Whether it is a rectangle of liquid that stands still."""
    return basin["kind"] == MINE and basin["nx"] > 0 and basin["walls"] == 0


@njit(forceinline=True)
def on_mesh(basin):
    """Whether it is a liquid on any other mesh that stands still."""
    return basin["kind"] == MINE and basin["nx"] == 0 and basin["walls"] == 0


@njit
def linear_grid(tables, b, y, dydt, out, moves):
    """Rates under law linear on a grid; moves : as in `grid.grid_rates`."""
    plane, work, basin = tables.plane, tables.work, tables.basins[b]
    n, o, k, nx, ny = basin["n"], basin["y"], basin["spacing"], basin["nx"], basin["ny"]
    through = basin["through"]
    to, first = (dydt, o) if dydt.size > 0 else (work, basin["unused"])
    rates = to[first : first + 3 * n]
    rate = grid.grid_rates(
        basin["speed"], basin["small"], basin["scheme"], basin["limiter"], nx, ny, plane[k : k + nx],
        plane[k + nx : k + nx + ny], plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]],
        y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n],
        work[through : through + basin["outer_given"]], work[basin["work"] :],
        rates[:n], rates[n : 2 * n], rates[2 * n :], moves,
    )  # fmt: skip
    book_open(tables, b, basin["thickness"], out)
    out[RATE] = max(out[RATE], rate)


@njit
def waves_on_grids(t, y, dydt, out, handle):
    """Rates under law linear on grids."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_grid(tables.basins[b]) and wanted(tables.basins[b], dydt):
            linear_grid(tables, b, y, dydt, out, None)


@njit
def full_grid(tables, b, table, y, dydt, out, moves):
    """Rates with the full momentum flux on a grid, of its waves or, with no table, under law log."""
    plane, work, basin = tables.plane, tables.work, tables.basins[b]
    n, o, k, nx, ny = basin["n"], basin["y"], basin["spacing"], basin["nx"], basin["ny"]
    through = basin["through"]
    to, first = (dydt, o) if dydt.size > 0 else (work, basin["unused"])
    rates = to[first : first + 3 * n]
    rate = grid_full.grid_rates(
        basin["speed"], basin["density"], table, basin["small"], basin["scheme"], basin["limiter"], nx, ny,
        plane[k : k + nx], plane[k + nx : k + nx + ny],
        plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]],
        y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n],
        work[through : through + basin["outer_given"]], work[basin["work"] :],
        rates[:n], rates[n : 2 * n], rates[2 * n :], moves,
    )  # fmt: skip
    book_open(tables, b, basin["thickness"], out)
    out[RATE] = max(out[RATE], rate)


@njit
def rates_on_grids(t, y, dydt, out, handle):
    """Rates under law log on grids."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_grid(tables.basins[b]) and wanted(tables.basins[b], dydt):
            full_grid(tables, b, None, y, dydt, out, None)


@njit
def any_mesh(tables, b, table, y, dydt, out, moves):
    """Rates on a mesh, of its waves or, with no table, under laws linear and log; moves : as in `liquid_rates`."""
    plane, work, integers, basin = tables.plane, tables.work, tables.integers, tables.basins[b]
    n, o, through = basin["n"], basin["y"], basin["through"]
    to, first = (dydt, o) if dydt.size > 0 else (work, basin["unused"])
    rates = to[first : first + 3 * n]
    rate = faces.liquid_rates(
        tables.settings[0]["law"], basin["speed"], basin["density"], table, basin["scheme"], basin["wide"],
        plane[basin["mesh"] :],
        integers[basin["links"] :], plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]],
        y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n],
        work[through : through + basin["outer_given"]], work[basin["work"] :],
        rates[:n], rates[n : 2 * n], rates[2 * n :], moves,
    )  # fmt: skip
    book_open(tables, b, basin["thickness"], out)
    out[RATE] = max(out[RATE], rate)


@njit
def rates_on_meshes(t, y, dydt, out, handle):
    """Rates on meshes of any cells, under laws linear and log."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_mesh(tables.basins[b]) and wanted(tables.basins[b], dydt):
            any_mesh(tables, b, None, y, dydt, out, None)
