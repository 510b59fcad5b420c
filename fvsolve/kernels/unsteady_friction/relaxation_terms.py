"""Unsteady friction by relaxation variables, under the linear density law.

The weighting function of the flow history is W(tau) = sum of m_k exp(-n_k tau), tau = nu t / R^2, with kinematic
viscosity nu and pipe radius R. In addition to the quasi-steady drag (Zielke 1968) the wall exerts the drag sum over k
of (4 nu / R^2) m_k (M - z_k) per length, M : mass flow. Each state z_k follows the flow, dz_k/dt = (n_k nu / R^2) (M -
z_k). The equations are linear in cell averages, so they are exact for them. Per length each term stores (4 nu / R^2)
m_k z_k^2 / (2 n_k nu / R^2) and dissipates (4 nu / R^2) m_k (M - z_k)^2, both divided by rho A (density times area):
the friction is passive where no m_k is negative.
"""

from fvsolve.jit import njit
from fvsolve.kernels.table_handle import open_tables


@njit
def relaxation_rate(gain, rate, flow, z, dz, pull):
    """Write dz/dt = rate (flow - z) of the states z of a single exponential term, and add gain (flow - z) to `pull`.

    flow, z, dz, pull : float64[cells]; rate, gain [1/s]
    """
    for i in range(z.size):
        lag = flow[i] - z[i]
        dz[i] = rate * lag
        pull[i] += gain * lag


@njit
def relaxation_rates(pipe, floats, flow, y, dydt, pull):
    """Write the rates of all exponential terms of unsteady friction in a pipe to `dydt`, and their drag to `pull`.

    flow : float64[cells]  change since the start of the flow that the states follow [kg/s]: under the density law
        `linear` the mass flow, otherwise the result of `relaxation_terms_barotropic.velocity_change`
    pull : float64[cells]  receives the change of the drag per length [kg/s2]
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
    """Subtract half of a drag `pull` [kg/s2] from the rate of the forward wave; add half to that of the backward wave.

    dr, dl : float64[cells]  rates of both waves [kg/s2]
    """
    for i in range(pull.size):
        s = 0.5 * pull[i]
        dr[i] -= s
        dl[i] += s


@njit
def wave_difference(r, l, flow):
    """Write the change of the mass flow in cells, forward wave minus backward wave, r - l [kg/s], to `flow`."""
    for i in range(r.size):
        flow[i] = r[i] - l[i]


@njit
def add_unsteady_friction(t, y, dydt, out, handle):
    """Add the unsteady friction of all pipes to the rates of their waves, and write the rates of its states.

    For the density law `linear`; nothing is done if `dydt` is empty.
    """
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
