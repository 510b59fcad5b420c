"""Power and stored energy of walls that creep, added to those of their pipe. Knows the tables.

An element of gain g and rate n whose u follows w stores g u^2 / (2 n) and takes g (w - u)^2, both over rho A and per
length; together they are w times what comes off it, and P times what the bore takes up, P = p - p_ambient + rho g z as
in `energy.py`. Rows of a pipe: `jets`, of which there are none under the linear law, and `rate`; its elastic energy.
"""

from fvsolve.jit import njit
from fvsolve.kernels.creep.wall import total
from fvsolve.kernels.energy import NODE, PIPE, PLACES, SHARES, at_point, height_pressure, width_of
from fvsolve.kernels.handle import open_tables


@njit
def creep_power(st, floats, pipe, start, w, y, dydt):
    """(power taken, rate of storage) of all elements of a pipe [W]; start : P of the profile at its `from` end [Pa]."""
    n, width = w.size, width_of(st, w.size)
    fall, taken, rate = pipe["drag"] / pipe["area"], 0.0, 0.0
    for k in range(pipe["elements"]):
        gain, at = floats[pipe["element"] + 2 * k], pipe["strain"] + k * n
        share = gain / floats[pipe["element"] + 2 * k + 1]
        u, du = y[at : at + n], dydt[at : at + n]
        for i in range(n):
            for g in range(3):
                before = pipe["admittance"] * (start - fall * (i + 0.5 + PLACES[g]) * pipe["dx"])
                here = at_point(u, width, i, g)
                lag = at_point(w, width, i, g) - here
                taken += SHARES[g] * gain * lag * lag
                rate += SHARES[g] * share * (before + here) * at_point(du, width, i, g)
    per = pipe["dx"] / (st["rho"] * pipe["area"])
    return per * taken, per * rate


@njit
def creep_energy(st, floats, pipe, start, y):
    """Change of what all elements of a pipe store since the profile [J]."""
    n, width, sum_ = pipe["cells"], width_of(st, pipe["cells"]), 0.0
    fall = pipe["drag"] / pipe["area"]
    for k in range(pipe["elements"]):
        at = pipe["strain"] + k * n
        share = floats[pipe["element"] + 2 * k] / floats[pipe["element"] + 2 * k + 1]
        for i in range(n):
            for g in range(3):
                before = pipe["admittance"] * (start - fall * (i + 0.5 + PLACES[g]) * pipe["dx"])
                u = at_point(y[at : at + n], width, i, g)
                sum_ += SHARES[g] * share * u * (2.0 * before + u)
    return 0.5 * sum_ * pipe["dx"] / (st["rho"] * pipe["area"])


@njit(forceinline=True)
def beginning(st, node):
    """P of the profile at a node [Pa]."""
    return (node["pressure"] - st["ambient"]) + height_pressure(st, node)


@njit
def add_power(t, y, dydt, out, handle, power):
    """What the walls of all pipes take, into their rows of power."""
    tables = open_tables(handle)
    st, pipes, at = tables.settings[0], tables.pipes, NODE * tables.nodes.size
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["elements"] > 0:
            n, o = pipe["cells"], pipe["y"]
            w = tables.scratch[:n]
            total(y[o : o + n], y[o + n : o + 2 * n], w)
            start = beginning(st, tables.nodes[pipe["from_node"]])
            taken, rate = creep_power(st, tables.floats, pipe, start, w, y, dydt)
            power[at + 2] += taken
            power[at + 3] += rate
        at += PIPE


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """What the walls of all pipes hold, into their rows of stored energy."""
    tables = open_tables(handle)
    st, pipes, nodes = tables.settings[0], tables.pipes, tables.nodes
    for i in range(pipes.size):
        if pipes[i]["elements"] > 0:
            start = beginning(st, nodes[pipes[i]["from_node"]])
            stored[nodes.size + 2 * i + 1] += creep_energy(st, tables.floats, pipes[i], start, y)
