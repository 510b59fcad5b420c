"""Creep of viscoelastic pipe walls under the density laws `log`, `table` and `mixture`.

The Kelvin-Voigt elements follow w = (A / a) (p - p0), with pressure p, initial steady pressure p0, and area A and wave
speed a at the reference state; under the linear law w is the sum of both waves. The additional volume of the bore holds
liquid of the reference density. Its mass is subtracted from the mass of the same cell only.
"""

from fvsolve.jit import njit
from fvsolve.kernels.cavitating_pipes import DRY
from fvsolve.kernels.density import pressure_of_mass
from fvsolve.kernels.pipes import GAUSS
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.viscoelastic_wall.kelvin_voigt import wall_rates


@njit
def wall_pressure(st, floats, profile, pipe, r, l, w):
    """Write w = (A / a) (p - p0) [kg/s] to w, averaged over each cell by two Gauss points.

    A, a : reference area and wave speed; p, p0 : present and initial steady pressure; profile : initial steady values
    r, l : float64[cells]  forward and backward wave [kg/s]
    """
    n, c, least = r.size, pipe["speed"], DRY * st["rho"] * pipe["area"]
    for i in range(n):
        low, high = max(i - 1, 0), min(i + 1, n - 1)
        dm_gauss = GAUSS / max(high - low, 1) * ((r[high] + l[high]) - (r[low] + l[low])) / c
        m0, dm = profile[pipe["center"] + i], (r[i] + l[i]) / c
        p = pressure_of_mass(st, floats, pipe, max(m0 + (dm + dm_gauss), least))
        p += pressure_of_mass(st, floats, pipe, max(m0 + (dm - dm_gauss), least))
        w[i] = pipe["admittance"] * (0.5 * p - pressure_of_mass(st, floats, pipe, m0))


@njit
def add_wall_creep_barotropic(t, y, dydt, out, handle):
    """Subtract the wall creep of all pipes from the rates of both waves, and write the rates of the wall elements.

    For the density laws `log`, `table` and `mixture`; nothing is done if `dydt` is empty.
    """
    tables = open_tables(handle)
    pipes, floats, scratch = tables.pipes, tables.floats, tables.scratch
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["elements"] > 0 and dydt.size > 0:
            n, o = pipe["cells"], pipe["y"]
            w = scratch[:n]
            wall_pressure(tables.settings[0], floats, tables.profile, pipe, y[o : o + n], y[o + n : o + 2 * n], w)
            wall_rates(pipe, floats, w, y, dydt, scratch[n : 2 * n])
