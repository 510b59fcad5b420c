"""Walls that creep under the density laws log, table and mixture. Knows what pressure a mass per length makes.

What elements follow is w = (A / a) (p - p0), p0 of the profile, a the speed at the reference: r + l under the linear
law. The bore that has grown holds liquid of the reference density, which it takes off the mass of its cell alone.
"""

from fvsolve.jit import njit
from fvsolve.kernels.cavitating import DRY
from fvsolve.kernels.creep.wall import give_way
from fvsolve.kernels.density import pressure_of_mass
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.pipes import GAUSS


@njit
def pressed(st, floats, profile, pipe, r, l, w):
    """w = (A / a) (p - p0) [kg/s], averaged over cells by two Gauss points."""
    n, c, least = r.size, pipe["speed"], DRY * st["rho"] * pipe["area"]
    for i in range(n):
        low, high = max(i - 1, 0), min(i + 1, n - 1)
        lean = GAUSS / max(high - low, 1) * ((r[high] + l[high]) - (r[low] + l[low])) / c
        m0, dm = profile[pipe["center"] + i], (r[i] + l[i]) / c
        p = pressure_of_mass(st, floats, pipe, max(m0 + (dm + lean), least))
        p += pressure_of_mass(st, floats, pipe, max(m0 + (dm - lean), least))
        w[i] = pipe["admittance"] * (0.5 * p - pressure_of_mass(st, floats, pipe, m0))


@njit
def creep_walls_barotropic(t, y, dydt, out, handle):
    """Creep of the walls of all pipes, taken off rates, where there are any."""
    tables = open_tables(handle)
    pipes, floats, scratch = tables.pipes, tables.floats, tables.scratch
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["elements"] > 0 and dydt.size > 0:
            n, o = pipe["cells"], pipe["y"]
            w = scratch[:n]
            pressed(tables.settings[0], floats, tables.profile, pipe, y[o : o + n], y[o + n : o + 2 * n], w)
            give_way(pipe, floats, w, y, dydt, scratch[n : 2 * n])
