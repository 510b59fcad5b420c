"""What the wall of a pipe gives way by in time, under the linear law. Knows pipes and their elements; knows no node.

A Kelvin-Voigt element of compliance J and time tau strains as d eps/dt = (J sigma - eps) / tau, sigma = c D p / (2 e)
at the hoop, and the bore grows by 2 eps A (Covas et al. 2005). With w = r + l, which is the pressure times A / a, and
u = 2 rho a eps A / G, G = c D K J / e, K = rho a^2: du/dt = (w - u) / tau, and what the bore takes up, G du/dt, comes
half off the rate of each wave. All are deviations from the profile, with whose pressure the strain is in balance.
Storage G u^2 / 2, dissipation G (w - u)^2 / tau, both over rho A: passive, for no J is negative.
"""

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.unsteady.memory import follow


@njit
def total(r, l, w):
    """w = r + l."""
    for i in range(r.size):
        w[i] = r[i] + l[i]


@njit
def give_way(pipe, floats, w, y, dydt, taken):
    """Elements of a pipe follow w, and what they take comes half off the rate of each wave."""
    n, o, at = w.size, pipe["y"], pipe["strain"]
    for i in range(n):
        taken[i] = 0.0
    for k in range(pipe["elements"]):
        gain, rate = floats[pipe["element"] + 2 * k], floats[pipe["element"] + 2 * k + 1]
        follow(gain, rate, w, y[at : at + n], dydt[at : at + n], taken)
        at += n
    for i in range(n):
        dydt[o + i] -= 0.5 * taken[i]
        dydt[o + n + i] -= 0.5 * taken[i]


@njit
def creep_walls(t, y, dydt, out, handle):
    """Creep of the walls of all pipes, taken off rates, where there are any."""
    tables = open_tables(handle)
    pipes, floats, scratch = tables.pipes, tables.floats, tables.scratch
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["elements"] > 0 and dydt.size > 0:
            n, o = pipe["cells"], pipe["y"]
            w = scratch[:n]
            total(y[o : o + n], y[o + n : o + 2 * n], w)
            give_way(pipe, floats, w, y, dydt, scratch[n : 2 * n])
