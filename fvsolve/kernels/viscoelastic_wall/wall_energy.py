"""Power and stored energy of viscoelastic walls, added to the entries of their pipes.

A wall element of gain g and rate n [1/s] has a state u that follows w, the pressure change times area over wave speed
[kg/s]. It stores g u^2 / (2 n) and dissipates g (w - u)^2, both divided by rho A (density times area) and per length.
The sum of dissipation and rate of storage is w g (w - u) / (rho A); g (w - u) is the mass flow into the element per
length, times the wave speed. The work against the initial steady potential P = p - p_ambient + rho g z is stored too,
with the reference density. The entries of a pipe are those of `linear_energy.py`: creep and rate of stored energy in
`power`, elastic energy in `stored`.
"""

from fvsolve.jit import njit
from fvsolve.kernels.linear_energy import (
    CREEP,
    GAUSS_POINTS,
    GAUSS_WEIGHTS,
    NODE,
    PIPE,
    at_point,
    height_pressure,
    polynomial_width,
)
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.viscoelastic_wall.kelvin_voigt import wave_sum


@njit
def creep_power(st, floats, pipe, w, y, dydt):
    """(dissipation, rate of stored energy) of all wall elements of a pipe [W], without `work_against_profile`.

    w : float64[cells]  pressure change times area over wave speed [kg/s]
    """
    n, width, taken, rate = w.size, polynomial_width(st, w.size), 0.0, 0.0
    for k in range(pipe["elements"]):
        gain, at = floats[pipe["element"] + 2 * k], pipe["strain"] + k * n
        share = gain / floats[pipe["element"] + 2 * k + 1]
        u, du = y[at : at + n], dydt[at : at + n]
        for i in range(n):
            for g in range(3):
                here = at_point(u, width, i, g)
                lag = at_point(w, width, i, g) - here
                taken += GAUSS_WEIGHTS[g] * gain * lag * lag
                rate += GAUSS_WEIGHTS[g] * share * here * at_point(du, width, i, g)
    per = pipe["dx"] / (st["rho"] * pipe["area"])
    return per * taken, per * rate


@njit
def creep_energy(st, floats, pipe, y):
    """Change of the energy in all wall elements of a pipe since the start [J], without `work_against_profile`."""
    n, width, sum_ = pipe["cells"], polynomial_width(st, pipe["cells"]), 0.0
    for k in range(pipe["elements"]):
        at = pipe["strain"] + k * n
        share = floats[pipe["element"] + 2 * k] / floats[pipe["element"] + 2 * k + 1]
        for i in range(n):
            for g in range(3):
                sum_ += GAUSS_WEIGHTS[g] * share * at_point(y[at : at + n], width, i, g) ** 2
    return 0.5 * sum_ * pipe["dx"] / (st["rho"] * pipe["area"])


@njit(forceinline=True)
def bore_growth(st, floats, pipe, i, g, y):
    """Sum over all wall elements of gain times state over rate, at Gauss point g of cell i [kg/s].

    Multiplied by dx / speed it is the mass of reference density in the additional volume of the bore of a cell. With
    rates of states in place of y the result is its time derivative.
    """
    n, width, sum_ = pipe["cells"], polynomial_width(st, pipe["cells"]), 0.0
    for k in range(pipe["elements"]):
        at = pipe["strain"] + k * n
        share = floats[pipe["element"] + 2 * k] / floats[pipe["element"] + 2 * k + 1]
        sum_ += share * at_point(y[at : at + n], width, i, g)
    return sum_


@njit
def work_against_profile(st, floats, pipe, node, y):
    """Energy [J] stored in wall elements as work against the initial steady potential P; its rate [W] if y are rates.

    P = p - p_ambient + rho g z [Pa]; node : node at the `from` end of the pipe
    """
    start, fall = (node["pressure"] - st["ambient"]) + height_pressure(st, node), pipe["drag"] / pipe["area"]
    sum_ = 0.0
    for i in range(pipe["cells"]):
        for g in range(3):
            before = start - fall * (i + 0.5 + GAUSS_POINTS[g]) * pipe["dx"]
            sum_ += GAUSS_WEIGHTS[g] * before * bore_growth(st, floats, pipe, i, g, y)
    return sum_ * pipe["dx"] / (st["rho"] * pipe["speed"])


@njit
def add_power(t, y, dydt, out, handle, power):
    """Add dissipation and rate of stored energy of viscoelastic walls to the entries of their pipes in `power` [W]."""
    tables = open_tables(handle)
    st, pipes, at = tables.settings[0], tables.pipes, NODE * tables.nodes.size
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["elements"] > 0:
            n, o = pipe["cells"], pipe["y"]
            w = tables.scratch[:n]
            wave_sum(y[o : o + n], y[o + n : o + 2 * n], w)
            taken, rate = creep_power(st, tables.floats, pipe, w, y, dydt)
            power[at + CREEP] += taken
            power[at + 3] += rate + work_against_profile(st, tables.floats, pipe, tables.nodes[pipe["from_node"]], dydt)
        at += PIPE


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Add the change of energy stored in viscoelastic walls since the start to the entries of pipes in `stored` [J]."""
    tables = open_tables(handle)
    st, floats, pipes, nodes = tables.settings[0], tables.floats, tables.pipes, tables.nodes
    for i in range(pipes.size):
        if pipes[i]["elements"] > 0:
            more = work_against_profile(st, floats, pipes[i], nodes[pipes[i]["from_node"]], y)
            stored[nodes.size + 2 * i + 1] += creep_energy(st, floats, pipes[i], y) + more
