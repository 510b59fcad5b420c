"""Power and stored energy of unsteady friction, added to the entries of its pipe.

An exponential term of gain g [1/s] and rate n [1/s] has a state z that follows the mass flow M [kg/s]. It stores g z^2
/ (2 n) and dissipates g (M - z)^2, both divided by rho A (density times area) and per length. The sum of dissipation
and rate of storage is M times the drag of the term, divided by rho A. The entries of a pipe are those of
`linear_energy.py`: friction and rate of stored energy in `power`, kinetic energy in `stored`. Under the density laws
`log`, `table` and `mixture` M is rho A times the velocity, with the reference values of density and area.
"""

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import LAW_LINEAR
from fvsolve.kernels.linear_energy import GAUSS_WEIGHTS, NODE, PIPE, at_point, polynomial_width
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.unsteady_friction.relaxation_terms import wave_difference
from fvsolve.kernels.unsteady_friction.relaxation_terms_barotropic import velocity_change


@njit
def input_flow(y, pipe, tables, change):
    """Write the flow that the states of unsteady friction follow in each cell to `change` [kg/s].

    It is the change of the mass flow since the initial steady state; under the density laws `log`, `table` and
    `mixture` the change of velocity times the reference mass per length.
    """
    st, n, o = tables.settings[0], pipe["cells"], pipe["y"]
    r, l = y[o : o + n], y[o + n : o + 2 * n]
    if st["law"] == LAW_LINEAR:
        wave_difference(r, l, change)
    else:
        velocity_change(pipe, tables.profile, st["rho"] * pipe["area"], r, l, change)


@njit(forceinline=True)
def profile_input(st, profile, pipe, i):
    """Initial steady value, in cell i, of the flow that the states of unsteady friction follow [kg/s].

    It is the mass flow; under other density laws than `linear` the velocity times the reference mass per length.
    """
    if st["law"] == LAW_LINEAR:
        return pipe["flow"]
    return pipe["flow"] * (st["rho"] * pipe["area"] / profile[pipe["center"] + i])


@njit
def relaxation_power(st, floats, profile, pipe, change, y, dydt):
    """(dissipation, rate of stored energy) of all exponential terms of unsteady friction in a pipe [W].

    change : float64[cells]  flow that the states of the terms follow, see `input_flow`
    """
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
    """Change since the start of the energy stored in all exponential terms of unsteady friction in a pipe [J]."""
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
    """Add dissipation and rate of stored energy of unsteady friction to the entries of all pipes in `power` [W]."""
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
    """Add the change of energy stored by unsteady friction since the start to the entries of pipes in `stored` [J]."""
    tables = open_tables(handle)
    st, pipes, nodes = tables.settings[0], tables.pipes, tables.nodes
    for i in range(pipes.size):
        if pipes[i]["terms"] > 0:
            stored[nodes.size + 2 * i] += relaxation_energy(st, tables.floats, tables.profile, pipes[i], y)
