"""Greatest values of cells of water over all accepted steps of a run, times of arrival and durations of wetting.

A cell is wet where its depth exceeds `wet_depth` of its basin; other states of the cell do not count. Array `maxima` of
a basin, for each row of cells (all cells of a mesh are one row), zero at the start of a run :

    - time of the last recorded state [s]
    - for each cell: greatest depth [m]; then greatest square of the speed [m2/s2]; greatest square of depth times speed
      [m4/s2]; time of the first wet state [s]; 1 if the last recorded state is wet, else 0; duration of wetting [s]

A step from a wet state counts as wet, so a cell that stays wet has the duration from its arrival to the end. Threads
write the rows of their bands into one array. A state that is recorded again changes nothing.
"""

from fvsolve.basins.basin_patches import physics_code
from fvsolve.jit import njit
from fvsolve.kernels.band_exchange import BAND
from fvsolve.kernels.table_handle import open_tables

OWN_CODE = physics_code(__package__)
QUANTITIES = 6  # of each cell
TINY = 1e-300
NEAR = 1e-12  # relative difference of times of the same state


@njit
def update_cells(t, past, least, depths, dh, qx, qy, greatest):
    """Update the values of a row of cells at time t [s].

    past : time since the last recorded state [s]; least : depth above which cells are wet [m]
    depths : depths at rest [m]; dh, qx, qy : deviations of depth [m], unit flows [m2/s]
    greatest : six arrays of the cells, see the docstring of the module
    """
    depth, speed, hazard, arrival, wet, duration = greatest
    for i in range(dh.size):
        h, square = depths[i] + dh[i], qx[i] * qx[i] + qy[i] * qy[i]
        now = h > least
        h, square = (h if now else 0.0), (square if now else 0.0)
        rate = square / max(h * h, TINY)
        arrival[i] = t if now and depth[i] == 0.0 else arrival[i]
        duration[i] += past * wet[i]
        wet[i] = 1.0 if now else 0.0
        depth[i] = h if h > depth[i] else depth[i]
        speed[i] = rate if rate > speed[i] else speed[i]
        hazard[i] = square if square > hazard[i] else hazard[i]


@njit
def update_basin(t, basin, begin, stop, y, tables):
    """Update the values of rows `begin` to `stop` - 1 of cells of a basin at time t [s]."""
    n, o, size, depths = basin["n"], basin["y"], basin["maxima_row"], tables.plane[basin["plan"] :]
    wide = basin["nx"] if basin["nx"] > 0 else n
    for j in range(begin, stop):
        a, z, first = j * wide, (j + 1) * wide, basin["maxima"] + j * size
        row = tables.maxima[first : first + size]
        past = t - row[0]
        past = past if past > NEAR * abs(t) else 0.0
        row[0] = t if past > 0.0 or t < row[0] else row[0]
        q = row[1:]
        greatest = (
            q[:wide], q[wide : 2 * wide], q[2 * wide : 3 * wide], q[3 * wide : 4 * wide], q[4 * wide : 5 * wide],
            q[5 * wide : 6 * wide],
        )  # fmt: skip
        dh, qx, qy = y[o + a : o + z], y[o + n + a : o + n + z], y[o + 2 * n + a : o + 2 * n + z]
        update_cells(t, past, basin["wet_depth"], depths[a:z], dh, qx, qy, greatest)


@njit
def record_maxima(t, y, out, handle, values):
    """Update the values of all basins of water that record them, after an accepted step.

    y : states, of basins with moving walls the deviations `seen`. Only the first band updates an undivided basin.
    """
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin, begin, stop = tables.basins[b], tables.bands[2 * b], tables.bands[2 * b + 1]
        if basin["kind"] != OWN_CODE or basin["maxima"] < 0:
            continue
        whole = basin["nx"] == 0 or stop - begin == basin["ny"]
        if whole and tables.joint.size > 0 and tables.joint[BAND] > 0:
            continue
        if basin["nx"] == 0:
            begin, stop = 0, 1
        update_basin(t, basin, begin, stop, y, tables)
