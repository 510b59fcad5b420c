"""Unsteady friction under the density laws log and table.

The terms follow the velocity, u = (rho A)_ref M / m. Then v times the drag is a rate of storage plus a dissipation.
"""

from fvsolve.jit import njit
from fvsolve.kernels.pipes import GAUSS
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.unsteady_friction.relaxation_terms import relaxation_rates, subtract_drag


@njit
def velocity_change(pipe, profile, reference, r, l, change):
    """Write change = deviation of reference M / m from the profile [kg/s], cell averages by two Gauss points."""
    n, c, flow = r.size, pipe["speed"], pipe["flow"]
    for i in range(n):
        low, high = max(i - 1, 0), min(i + 1, n - 1)
        gauss = GAUSS / max(high - low, 1)
        m0, dm, dflow = profile[pipe["center"] + i], (r[i] + l[i]) / c, r[i] - l[i]
        a = gauss * ((r[high] - l[high]) - (r[low] - l[low]))
        b = gauss * ((r[high] + l[high]) - (r[low] + l[low])) / c
        u = (flow + (dflow + a)) / (m0 + (dm + b)) + (flow + (dflow - a)) / (m0 + (dm - b))
        change[i] = reference * (0.5 * u - flow / m0)


@njit
def add_unsteady_friction_barotropic(t, y, dydt, out, handle):
    """Add the unsteady friction of all pipes to the rates."""
    tables = open_tables(handle)
    pipes, floats, scratch = tables.pipes, tables.floats, tables.scratch
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["terms"] > 0 and dydt.size > 0:
            n, o, reference = pipe["cells"], pipe["y"], tables.settings[0]["rho"] * pipe["area"]
            change, pull = scratch[:n], scratch[n : 2 * n]
            velocity_change(pipe, tables.profile, reference, y[o : o + n], y[o + n : o + 2 * n], change)
            relaxation_rates(pipe, floats, change, y, dydt, pull)
            subtract_drag(pull, dydt[o : o + n], dydt[o + n : o + 2 * n])
