"""Unsteady friction under the density laws `log`, `table` and `mixture`.

The states of the exponential terms follow u = (rho A)_ref M / m, the velocity M / m times the reference mass per
length, with mass flow M and mass per length m. Then velocity times drag is a rate of storage plus a dissipation.
"""

from fvsolve.jit import njit
from fvsolve.kernels.pipes import GAUSS
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.unsteady_friction.relaxation_terms import relaxation_rates, subtract_drag


@njit
def velocity_change(pipe, profile, reference, r, l, change):
    """Write the change of `reference` times M / m since the initial steady state to `change` [kg/s].

    The values are cell averages by two Gauss points; M : mass flow, m : mass per length
    reference : mass per length at the reference state [kg/m]; profile : values of the initial steady state
    r, l : float64[cells]  forward and backward wave [kg/s]
    """
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
    """Add the unsteady friction of all pipes to the rates of their waves, and write the rates of its states.

    For the density laws `log`, `table` and `mixture`; nothing is done if `dydt` is empty.
    """
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
