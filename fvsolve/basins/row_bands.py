"""Bands of basins (rows of cells that one thread steps), and flows through the boundary, from all bands."""

from fvsolve.basins.basin_patches import put_open_flows
from fvsolve.jit import njit
from fvsolve.kernels import band_exchange
from fvsolve.kernels.table_handle import open_tables

BAND_MARGIN = 5  # rows beyond a band that its rates read: three, or the five of the boundary closure of a liquid


@njit(forceinline=True)
def band_cells(tables, b):
    """(first, last + 1) of the cells of basin b in the band of this thread."""
    wide = max(tables.basins[b]["nx"], 1)
    return wide * tables.bands[2 * b], wide * tables.bands[2 * b + 1]


@njit(forceinline=True)
def stencil_cells(tables, b):
    """(first, last + 1) of the cells of basin b whose values the rates in the band of this thread read."""
    basin = tables.basins[b]
    begin, stop = max(tables.bands[2 * b] - BAND_MARGIN, 0), min(tables.bands[2 * b + 1] + BAND_MARGIN, basin["ny"])
    return (basin["nx"] * begin, basin["nx"] * stop) if basin["nx"] > 0 else (0, basin["n"])


@njit
def put_boundary_flows(t, y, dydt, out, handle):
    """Write the flows through open patches again, after all bands have computed their fluxes.

    Basins with a given velocity are left out, as their flows are not computed.
    """
    tables = open_tables(handle)
    band_exchange.get_runs(tables.joint, band_exchange.SEND_FLOWS, tables.work)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["given"] == 0 and basin["through"] >= 0:
            put_open_flows(tables, b, tables.settings[0]["rho"] if basin["deep"] == 1 else basin["thickness"], out)
