"""Power and stored energy of walls that creep, added to those of their pipe. Knows elements; knows no density law.

An element of gain g and rate n whose u follows w stores g u^2 / (2 n) and takes g (w - u)^2, both over rho A and per
length; together they are w times what comes off it. What it does against P of the profile, P = p - p_ambient + rho g z
as in `energy.py`, rho that of the reference, is stored too. Rows of a pipe: `creep` and `rate`; its elastic energy.
"""

from fvsolve.jit import njit
from fvsolve.kernels.creep.wall import total
from fvsolve.kernels.energy import CREEP, NODE, PIPE, PLACES, SHARES, at_point, height_pressure, width_of
from fvsolve.kernels.handle import open_tables


@njit
def creep_power(st, floats, pipe, w, y, dydt):
    """(power taken, rate of storage) of all elements of a pipe [W], but what they do against the profile."""
    n, width, taken, rate = w.size, width_of(st, w.size), 0.0, 0.0
    for k in range(pipe["elements"]):
        gain, at = floats[pipe["element"] + 2 * k], pipe["strain"] + k * n
        share = gain / floats[pipe["element"] + 2 * k + 1]
        u, du = y[at : at + n], dydt[at : at + n]
        for i in range(n):
            for g in range(3):
                here = at_point(u, width, i, g)
                lag = at_point(w, width, i, g) - here
                taken += SHARES[g] * gain * lag * lag
                rate += SHARES[g] * share * here * at_point(du, width, i, g)
    per = pipe["dx"] / (st["rho"] * pipe["area"])
    return per * taken, per * rate


@njit
def creep_energy(st, floats, pipe, y):
    """Change of what all elements of a pipe store since the profile, but what they do against it [J]."""
    n, width, sum_ = pipe["cells"], width_of(st, pipe["cells"]), 0.0
    for k in range(pipe["elements"]):
        at = pipe["strain"] + k * n
        share = floats[pipe["element"] + 2 * k] / floats[pipe["element"] + 2 * k + 1]
        for i in range(n):
            for g in range(3):
                sum_ += SHARES[g] * share * at_point(y[at : at + n], width, i, g) ** 2
    return 0.5 * sum_ * pipe["dx"] / (st["rho"] * pipe["area"])


@njit(forceinline=True)
def grown(st, floats, pipe, i, g, y):
    """What all elements have taken, or take, at a Gauss point of cell i, over w [kg/s] of a pressure."""
    n, width, sum_ = pipe["cells"], width_of(st, pipe["cells"]), 0.0
    for k in range(pipe["elements"]):
        at = pipe["strain"] + k * n
        share = floats[pipe["element"] + 2 * k] / floats[pipe["element"] + 2 * k + 1]
        sum_ += share * at_point(y[at : at + n], width, i, g)
    return sum_


@njit
def against(st, floats, pipe, node, y):
    """What elements store against P of the profile [J], or its rate [W] of rates; node : at the pipe's `from` end."""
    start, fall = (node["pressure"] - st["ambient"]) + height_pressure(st, node), pipe["drag"] / pipe["area"]
    sum_ = 0.0
    for i in range(pipe["cells"]):
        for g in range(3):
            before = start - fall * (i + 0.5 + PLACES[g]) * pipe["dx"]
            sum_ += SHARES[g] * before * grown(st, floats, pipe, i, g, y)
    return sum_ * pipe["dx"] / (st["rho"] * pipe["speed"])


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
            taken, rate = creep_power(st, tables.floats, pipe, w, y, dydt)
            power[at + CREEP] += taken
            power[at + 3] += rate + against(st, tables.floats, pipe, tables.nodes[pipe["from_node"]], dydt)
        at += PIPE


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """What the walls of all pipes hold, into their rows of stored energy."""
    tables = open_tables(handle)
    st, floats, pipes, nodes = tables.settings[0], tables.floats, tables.pipes, tables.nodes
    for i in range(pipes.size):
        if pipes[i]["elements"] > 0:
            more = against(st, floats, pipes[i], nodes[pipes[i]["from_node"]], y)
            stored[nodes.size + 2 * i + 1] += creep_energy(st, floats, pipes[i], y) + more
