"""Linear advection in a ring of cells, with the face values of the schemes for pipes."""

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import OK, RATE, STATUS, WHERE
from fvsolve.kernels.reconstruction import faces
from fvsolve.kernels.table_handle import open_tables


@njit
def rhs_periodic(t, y, dydt, out, handle):
    """Write du_j/dt = F[j] - F[j+1] for values u of cells in a ring, with face values F of a forward wave.

    The wave passes a cell per unit of time. `noise` of the pipe record is the small number of WENO.
    scratch : float64[2 n + 7]  window of values, then face values
    """
    tables = open_tables(handle)
    settings, scratch, n = tables.settings[0], tables.scratch, y.size
    out[RATE], out[STATUS], out[WHERE] = 1.0, OK, -1.0
    if dydt.size == 0:
        return
    p, f = scratch[: n + 6], scratch[n + 6 :]
    for j in range(n):
        p[j + 3] = y[j]
    for g in range(3):
        p[g], p[n + 3 + g] = y[n - 3 + g], y[g]
    faces(settings, settings["scheme"], tables.pipes[0]["noise"], 0, p, f)
    for j in range(n):
        dydt[j] = f[j] - f[j + 1]
