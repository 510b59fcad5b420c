"""Unsteady friction by relaxation variables, under the linear density law.

The weighting function is W(tau) = sum of m_k exp(-n_k tau), tau = nu t / R^2. In addition to the quasi-steady drag
(Zielke 1968) the wall exerts the sum over k of (4 nu / R^2) m_k (M - z_k) per length. Each z_k follows the flow,
dz_k/dt = (n_k nu / R^2) (M - z_k). The equations are linear in cell averages, so they are exact for them. Storage
(4 nu / R^2) m_k z_k^2 / (2 n_k nu / R^2), dissipation (4 nu / R^2) m_k (M - z_k)^2, both divided by rho A: the friction
is passive where no m_k is negative.
"""

from fvsolve.jit import njit
from fvsolve.kernels.table_handle import open_tables


@njit
def relaxation_rate(gain, rate, flow, z, dz, pull):
    """Write dz/dt = rate (flow - z) of a single term and add gain (flow - z) to `pull`."""
    for i in range(z.size):
        lag = flow[i] - z[i]
        dz[i] = rate * lag
        pull[i] += gain * lag


@njit
def relaxation_rates(pipe, floats, flow, y, dydt, pull):
    """Write the rates of all terms of a pipe and their drag.

    flow, pull : float64[cells]  deviation of the flow [kg/s], and drag [kg/s2]
    """
    n, at = flow.size, pipe["memory"]
    for i in range(n):
        pull[i] = 0.0
    for k in range(pipe["terms"]):
        gain, rate = floats[pipe["term"] + 2 * k], floats[pipe["term"] + 2 * k + 1]
        relaxation_rate(gain, rate, flow, y[at : at + n], dydt[at : at + n], pull)
        at += n


@njit
def subtract_drag(pull, dr, dl):
    """Subtract a drag [kg/s2] from the rates of both waves."""
    for i in range(pull.size):
        s = 0.5 * pull[i]
        dr[i] -= s
        dl[i] += s


@njit
def wave_difference(r, l, flow):
    """flow = r - l."""
    for i in range(r.size):
        flow[i] = r[i] - l[i]


@njit
def add_unsteady_friction(t, y, dydt, out, handle):
    """Add the unsteady friction of all pipes to the rates, under the linear law."""
    tables = open_tables(handle)
    pipes, floats, scratch = tables.pipes, tables.floats, tables.scratch
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["terms"] > 0 and dydt.size > 0:
            n, o = pipe["cells"], pipe["y"]
            flow, pull = scratch[:n], scratch[n : 2 * n]
            wave_difference(y[o : o + n], y[o + n : o + 2 * n], flow)
            relaxation_rates(pipe, floats, flow, y, dydt, pull)
            subtract_drag(pull, dydt[o : o + n], dydt[o + n : o + 2 * n])
