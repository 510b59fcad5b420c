"""Power and stored energy of unsteady friction, added to the rows of its pipe.

A term of gain g and rate n has a state z that follows the flow M. It stores g z^2 / (2 n) and dissipates g (M - z)^2,
both divided by rho A and per length. The sum of dissipation and storage rate is M times the drag of the term. The rows
are as in `linear_energy.py`: `friction` and `rate` of a pipe, and its kinetic energy. Under the laws log and table M is
rho A times the velocity, at the reference density.
"""

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import LAW_LINEAR
from fvsolve.kernels.linear_energy import GAUSS_WEIGHTS, NODE, PIPE, at_point, polynomial_width
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.unsteady_friction.relaxation_terms import wave_difference
from fvsolve.kernels.unsteady_friction.relaxation_terms_barotropic import velocity_change


@njit
def input_flow(y, pipe, tables, change):
    """Fill `change` with the flow that the terms follow in each cell: deviation from the profile's flow [kg/s]."""
    st, n, o = tables.settings[0], pipe["cells"], pipe["y"]
    r, l = y[o : o + n], y[o + n : o + 2 * n]
    if st["law"] == LAW_LINEAR:
        wave_difference(r, l, change)
    else:
        velocity_change(pipe, tables.profile, st["rho"] * pipe["area"], r, l, change)


@njit(forceinline=True)
def profile_input(st, profile, pipe, i):
    """Quantity that the terms follow, in cell i of the profile [kg/s]."""
    if st["law"] == LAW_LINEAR:
        return pipe["flow"]
    return pipe["flow"] * (st["rho"] * pipe["area"] / profile[pipe["center"] + i])


@njit
def relaxation_power(st, floats, profile, pipe, change, y, dydt):
    """Dissipation and rate of storage of all terms of a pipe [W]."""
    n, width = change.size, polynomial_width(st, change.size)
    taken, rate = 0.0, 0.0
    for k in range(pipe["terms"]):
        gain, at = floats[pipe["term"] + 2 * k], pipe["memory"] + k * n
        share = gain / floats[pipe["term"] + 2 * k + 1]
        z, dz = y[at : at + n], dydt[at : at + n]
        for i in range(n):
            start = profile_input(st, profile, pipe, i)
            for g in range(3):
                here = at_point(z, width, i, g)
                lag = at_point(change, width, i, g) - here
                taken += GAUSS_WEIGHTS[g] * gain * lag * lag
                rate += GAUSS_WEIGHTS[g] * share * (start + here) * at_point(dz, width, i, g)
    per = pipe["dx"] / (st["rho"] * pipe["area"])
    return per * taken, per * rate


@njit
def relaxation_energy(st, floats, profile, pipe, y):
    """Change of the energy stored in all terms of a pipe since the profile [J]."""
    n, width, total = pipe["cells"], polynomial_width(st, pipe["cells"]), 0.0
    for k in range(pipe["terms"]):
        at = pipe["memory"] + k * n
        share = floats[pipe["term"] + 2 * k] / floats[pipe["term"] + 2 * k + 1]
        for i in range(n):
            start = profile_input(st, profile, pipe, i)
            for g in range(3):
                z = at_point(y[at : at + n], width, i, g)
                total += GAUSS_WEIGHTS[g] * share * z * (2.0 * start + z)
    return 0.5 * total * pipe["dx"] / (st["rho"] * pipe["area"])


@njit
def add_power(t, y, dydt, out, handle, power):
    """Add the power of unsteady friction of all pipes to their power rows."""
    tables = open_tables(handle)
    st, pipes, at = tables.settings[0], tables.pipes, NODE * tables.nodes.size
    for i in range(pipes.size):
        if pipes[i]["terms"] > 0:
            change = tables.scratch[: pipes[i]["cells"]]
            input_flow(y, pipes[i], tables, change)
            taken, rate = relaxation_power(st, tables.floats, tables.profile, pipes[i], change, y, dydt)
            power[at + 1] += taken
            power[at + 3] += rate
        at += PIPE


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Add the energy stored by unsteady friction of all pipes to their storage rows."""
    tables = open_tables(handle)
    st, pipes, nodes = tables.settings[0], tables.pipes, tables.nodes
    for i in range(pipes.size):
        if pipes[i]["terms"] > 0:
            stored[nodes.size + 2 * i] += relaxation_energy(st, tables.floats, tables.profile, pipes[i], y)
