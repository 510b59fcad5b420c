"""Bands of basins: rows that one thread steps, and what passes the boundary, to which all add. Knows the tables."""

from fvsolve.basins.patches import book_open
from fvsolve.jit import njit
from fvsolve.kernels import joint
from fvsolve.kernels.handle import open_tables

REACH = 5  # rows beyond a band that rates look at: three, and as many as a side of a liquid is closed by


@njit(forceinline=True)
def cells_of(tables, b):
    """(first, one beyond the last) of the cells of a basin that are stepped here."""
    wide = max(tables.basins[b]["nx"], 1)
    return wide * tables.bands[2 * b], wide * tables.bands[2 * b + 1]


@njit(forceinline=True)
def cells_near(tables, b):
    """The same with the rows beside them that rates look at."""
    basin = tables.basins[b]
    begin, stop = max(tables.bands[2 * b] - REACH, 0), min(tables.bands[2 * b + 1] + REACH, basin["ny"])
    return (basin["nx"] * begin, basin["nx"] * stop) if basin["nx"] > 0 else (0, basin["n"])


@njit
def book_together(t, y, dydt, out, handle):
    """Book what passes the open boundaries of all basins once more, now that rates of all bands are there."""
    tables = open_tables(handle)
    joint.fetch(tables.joint, joint.OF_FLOWS, tables.work)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["given"] == 0 and basin["through"] >= 0:
            book_open(tables, b, tables.settings[0]["rho"] if basin["deep"] == 1 else basin["thickness"], out)
