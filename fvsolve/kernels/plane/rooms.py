"""Basins as rooms of a scene, one for each kind: rates of their cells. Knows the tables; knows no flux."""

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.plane import liquid, liquid_log, shallow
from fvsolve.kernels.plane.patches import book_open
from fvsolve.kernels.records import (
    ACOUSTIC_GRID,
    I_BASINS,
    I_PLANE,
    I_SETTINGS,
    LIQUID_GRID,
    RATE,
    SHALLOW_GRID,
    UPWIND,
)

UNSPLIT = 2.0  # Courant numbers of water count half cells, so that no depth falls below zero at one


@njit
def shallow_grids(t, y, dydt, out, handle):
    """Rates of water on grids."""
    tables = open_tables(handle)
    st, plane = tables[I_SETTINGS][0], tables[I_PLANE]
    for b in range(tables[I_BASINS].size if dydt.size > 0 else 0):
        basin = tables[I_BASINS][b]
        if basin["kind"] != SHALLOW_GRID:
            continue
        n, o, at, k = basin["n"], basin["y"], basin["plan"], basin["spacing"]
        plan = plane[at : at + shallow.PLANS * n].reshape((shallow.PLANS, n))
        limiter = shallow.NO_SLOPE if basin["scheme"] == UPWIND else basin["limiter"]
        rate = shallow.grid_rates(
            st["gravity"], limiter, basin["nx"], basin["ny"], plane[k], plane[k + basin["nx"]], plan,
            y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n], plane[basin["work"] :],
            dydt[o : o + n], dydt[o + n : o + 2 * n], dydt[o + 2 * n : o + 3 * n],
        )  # fmt: skip
        book_open(tables, basin, st["rho"], dydt, out)
        out[RATE] = max(out[RATE], UNSPLIT * rate)


@njit
def acoustic_grids(t, y, dydt, out, handle):
    """Rates of a liquid under law linear on grids."""
    tables = open_tables(handle)
    plane = tables[I_PLANE]
    for b in range(tables[I_BASINS].size if dydt.size > 0 else 0):
        basin = tables[I_BASINS][b]
        if basin["kind"] != ACOUSTIC_GRID:
            continue
        n, o, k, nx, ny = basin["n"], basin["y"], basin["spacing"], basin["nx"], basin["ny"]
        rate = liquid.grid_rates(
            basin["speed"], basin["small"], basin["scheme"], basin["limiter"], nx, ny, plane[k : k + nx],
            plane[k + nx : k + nx + ny], plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]],
            y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n], plane[basin["work"] :],
            dydt[o : o + n], dydt[o + n : o + 2 * n], dydt[o + 2 * n : o + 3 * n],
        )  # fmt: skip
        book_open(tables, basin, basin["thickness"], dydt, out)
        out[RATE] = max(out[RATE], rate)


@njit
def liquid_grids(t, y, dydt, out, handle):
    """Rates of a liquid under law log on grids."""
    tables = open_tables(handle)
    plane = tables[I_PLANE]
    for b in range(tables[I_BASINS].size if dydt.size > 0 else 0):
        basin = tables[I_BASINS][b]
        if basin["kind"] != LIQUID_GRID:
            continue
        n, o, k, nx, ny = basin["n"], basin["y"], basin["spacing"], basin["nx"], basin["ny"]
        rate = liquid_log.grid_rates(
            basin["speed"], basin["density"], basin["small"], basin["scheme"], basin["limiter"], nx, ny,
            plane[k : k + nx], plane[k + nx : k + nx + ny],
            plane[basin["reflect"] : basin["reflect"] + basin["outer_given"]],
            y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n], plane[basin["work"] :],
            dydt[o : o + n], dydt[o + n : o + 2 * n], dydt[o + 2 * n : o + 3 * n],
        )  # fmt: skip
        book_open(tables, basin, basin["thickness"], dydt, out)
        out[RATE] = max(out[RATE], rate)
