"""Viscoelastic pipe walls (Kelvin-Voigt elements) under the linear density law.

An element of compliance J and time constant tau has the strain d eps/dt = (J sigma - eps) / tau. The hoop stress is
sigma = c D p / (2 e), and the bore grows by 2 eps A (Covas et al. 2005). Let w = r + l, the pressure times A / a, and
u = 2 rho a eps A / G with G = c D K J / e and K = rho a^2. Then du/dt = (w - u) / tau. The mass flow into the bore,
G du/dt, is subtracted in equal halves from the rates of both waves. All values are deviations from the profile, whose
pressure is in equilibrium with its strain. Storage G u^2 / 2, dissipation G (w - u)^2 / tau, both divided by rho A:
the wall is passive, for no J is negative.
"""

from fvsolve.jit import njit
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.unsteady_friction.relaxation_terms import relaxation_rate


@njit
def wave_sum(r, l, w):
    """w = r + l."""
    for i in range(r.size):
        w[i] = r[i] + l[i]


@njit
def wall_rates(pipe, floats, w, y, dydt, taken):
    """Write the rates of the elements of a pipe; subtract half of the mass flow into them from the rate of each wave.

    w : float64[cells]  sum of both waves [kg/s]; taken : float64[cells]  work array
    """
    n, o, at = w.size, pipe["y"], pipe["strain"]
    for i in range(n):
        taken[i] = 0.0
    for k in range(pipe["elements"]):
        gain, rate = floats[pipe["element"] + 2 * k], floats[pipe["element"] + 2 * k + 1]
        relaxation_rate(gain, rate, w, y[at : at + n], dydt[at : at + n], taken)
        at += n
    for i in range(n):
        dydt[o + i] -= 0.5 * taken[i]
        dydt[o + n + i] -= 0.5 * taken[i]


@njit
def add_wall_creep(t, y, dydt, out, handle):
    """Subtract the wall creep of all pipes from the rates of both waves; write the rates of the elements."""
    tables = open_tables(handle)
    pipes, floats, scratch = tables.pipes, tables.floats, tables.scratch
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["elements"] > 0 and dydt.size > 0:
            n, o = pipe["cells"], pipe["y"]
            w = scratch[:n]
            wave_sum(y[o : o + n], y[o + n : o + 2 * n], w)
            wall_rates(pipe, floats, w, y, dydt, scratch[n : 2 * n])
