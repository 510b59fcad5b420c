"""Viscoelastic pipe walls (Kelvin-Voigt elements) under the linear density law.

An element of compliance J [1/Pa] and time constant tau [s] has the strain eps, d eps/dt = (J sigma - eps) / tau. The
hoop stress is sigma = c D p / (2 e), with restraint factor c, diameter D and wall thickness e. The bore grows by 2 eps
A (Covas et al. 2005), A : area. Let w = r + l, the sum of both waves, which is the pressure times A / a with wave speed
a, and u = 2 rho a eps A / G with G = c D K J / e and K = rho a^2. Then du/dt = (w - u) / tau. The mass flow into the
additional bore per length is G du/dt / a; so G du/dt is subtracted in equal halves from the rates of both waves. All
values are changes since the initial steady state, whose pressure is in equilibrium with its strain. Per length an
element stores G u^2 / 2 and dissipates G (w - u)^2 / tau, both divided by rho A: the wall is passive, for no J is
negative.
"""

from fvsolve.jit import njit
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.unsteady_friction.relaxation_terms import relaxation_rate


@njit
def wave_sum(r, l, w):
    """Write the sum of forward and backward wave r + l [kg/s], a measure of pressure, to w."""
    for i in range(r.size):
        w[i] = r[i] + l[i]


@njit
def wall_rates(pipe, floats, w, y, dydt, taken):
    """Write the rates of the wall elements of a pipe; subtract half of the storage in them from the rate of each wave.

    The storage is the sum of gain (w - u) over the elements [kg/s2], u : state of an element, gain [1/s].
    w : float64[cells]  pressure change times area over wave speed [kg/s]; under the linear law the sum of both waves
    taken : float64[cells]  work array
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
    """Subtract the wall creep of all pipes from the rates of both waves, and write the rates of the wall elements.

    For the density law `linear`; nothing is done if `dydt` is empty.
    """
    tables = open_tables(handle)
    pipes, floats, scratch = tables.pipes, tables.floats, tables.scratch
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["elements"] > 0 and dydt.size > 0:
            n, o = pipe["cells"], pipe["y"]
            w = scratch[:n]
            wave_sum(y[o : o + n], y[o + n : o + 2 * n], w)
            wall_rates(pipe, floats, w, y, dydt, scratch[n : 2 * n])
