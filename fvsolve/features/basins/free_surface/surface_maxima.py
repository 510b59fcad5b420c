"""Greatest values of cells of water over all accepted steps of a run, times of arrival and durations of wetting.

A cell is wet where its depth exceeds `wet_depth` of its basin; other states of the cell do not count. Array `maxima` of
a basin, for each row of cells (all cells of a mesh are one row), zero at the start of a run : for each cell

    - greatest depth [m]; then greatest square of the speed [m2/s2]; greatest square of depth times speed [m4/s2]
    - 1 if the last recorded state is wet, else 0
    - time of the first wet state [s]
    - sum of the times at which it became dry, minus the sum of the times at which it became wet [s]

So a step from a wet state counts as wet. A state that is recorded again changes nothing. Threads write the rows of
their bands into one array.
"""

from fvsolve.core.kernels.band_exchange import BAND
from fvsolve.features.basins.basin_patches import physics_code
from fvsolve.features.basins.boundary_cells import band_cells
from fvsolve.features.basins.tables import open_basins
from fvsolve.jit import njit

OWN_CODE = physics_code(__package__)
QUANTITIES = 6  # of each cell
TINY = 1e-300


@njit
def update_row(t, least, depths, dh, qx, qy, row, n):
    """Update the values of a row of cells, or of the first cells of a row, at time t [s], without a branch.

    least : depth above which cells are wet [m]; depths : depths at rest [m]
    dh, qx, qy : deviations of depth [m], unit flows [m2/s]
    row : numbers of the cells in `maxima`; n : number of all cells of the row
    """
    depth = row[:n]
    speed = row[n : 2 * n]
    hazard = row[2 * n : 3 * n]
    wet = row[3 * n : 4 * n]
    arrival = row[4 * n : 5 * n]
    duration = row[5 * n : 6 * n]
    for i in range(dh.size):
        h, square = depths[i] + dh[i], qx[i] * qx[i] + qy[i] * qy[i]
        now = 1.0 if h > least else 0.0
        h, square = (h if h > least else 0.0), (square if h > least else 0.0)
        rate = square / max(h * h, TINY)
        arrival[i] = t if (h > 0.0) & (depth[i] == 0.0) else arrival[i]
        duration[i] += t * (wet[i] - now)
        wet[i] = now
        depth[i] = h if h > depth[i] else depth[i]
        speed[i] = rate if rate > speed[i] else speed[i]
        hazard[i] = square if square > hazard[i] else hazard[i]


@njit
def record_maxima(t, y, out, handle, values):
    """Update the values of all basins of water that record them, after an accepted step.

    y : states, of basins with moving walls the deviations `seen`. Only the first band updates an undivided basin.
    """
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] != OWN_CODE or basin["maxima"] < 0:
            continue
        n = basin["n"]
        o = basin["y"]
        size = basin["maxima_row"]
        wide, (first, end) = size // QUANTITIES, band_cells(tables, b)
        if end - first == n and tables.joint.size > 0 and tables.joint[BAND] > 0:
            continue
        for j in range(first // wide, (end + wide - 1) // wide):
            a, z = max(j * wide, first), min((j + 1) * wide, end)
            at = basin["maxima"] + j * size
            depths = tables.plane[basin["plan"] + a : basin["plan"] + z]
            row = tables.maxima[at : at + size]
            dh = y[o + a : o + z]
            qx = y[o + n + a : o + n + z]
            qy = y[o + 2 * n + a : o + 2 * n + z]
            update_row(t, basin["wet_depth"], depths, dh, qx, qy, row[a - j * wide :], wide)
