"""Bands of basins: the rows that one thread steps, and flows through the boundary, to which all bands contribute."""

from fvsolve.basins.patches import book_open
from fvsolve.jit import njit
from fvsolve.kernels import band_exchange
from fvsolve.kernels.table_handle import open_tables

REACH = 5  # rows beyond a band that its rates read: three, or the five of the boundary closure of a liquid


@njit(forceinline=True)
def cells_of(tables, b):
    """(first, last + 1) of the cells of a basin in the band of this thread."""
    wide = max(tables.basins[b]["nx"], 1)
    return wide * tables.bands[2 * b], wide * tables.bands[2 * b + 1]


@njit(forceinline=True)
def cells_near(tables, b):
    """(first, last + 1) of the cells of the band and of the rows next to it that its rates read."""
    basin = tables.basins[b]
    begin, stop = max(tables.bands[2 * b] - REACH, 0), min(tables.bands[2 * b + 1] + REACH, basin["ny"])
    return (basin["nx"] * begin, basin["nx"] * stop) if basin["nx"] > 0 else (0, basin["n"])


@njit
def book_together(t, y, dydt, out, handle):
    """Compute the flows through open boundaries of all basins again, after all bands have computed their fluxes."""
    tables = open_tables(handle)
    band_exchange.get_runs(tables.joint, band_exchange.SEND_FLOWS, tables.work)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["given"] == 0 and basin["through"] >= 0:
            book_open(tables, b, tables.settings[0]["rho"] if basin["deep"] == 1 else basin["thickness"], out)
