"""What the past of a flow adds to the friction of the present one. Knows pipes and their terms; knows no density law.

With a weighting function W(tau) = sum of m_k exp(-n_k tau), tau = nu t / R^2, the wall takes beside the quasi-steady
drag (Zielke 1968) the sum over k of (4 nu / R^2) m_k (M - z_k) per length, and each z_k follows the flow,
dz_k/dt = (n_k nu / R^2) (M - z_k). Linear in averages of cells, so exact for them. Storage (4 nu / R^2) m_k z_k^2 /
(2 n_k nu / R^2), dissipation (4 nu / R^2) m_k (M - z_k)^2, both over rho A: passive where no m_k is negative.
"""

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables


@njit
def follow(gain, rate, flow, z, dz, pull):
    """One term: dz/dt = rate (flow - z), and gain (flow - z) added to `pull`."""
    for i in range(z.size):
        lag = flow[i] - z[i]
        dz[i] = rate * lag
        pull[i] += gain * lag


@njit
def follow_all(pipe, floats, flow, y, dydt, pull):
    """All terms of a pipe; `flow` and `pull` are rows of its cells, the deviation of the flow and the drag [kg/s2]."""
    n, at = flow.size, pipe["memory"]
    for i in range(n):
        pull[i] = 0.0
    for k in range(pipe["terms"]):
        gain, rate = floats[pipe["term"] + 2 * k], floats[pipe["term"] + 2 * k + 1]
        follow(gain, rate, flow, y[at : at + n], dydt[at : at + n], pull)
        at += n


@njit
def take_off(pull, dr, dl):
    """Take a drag [kg/s2] off the rates of both waves."""
    for i in range(pull.size):
        s = 0.5 * pull[i]
        dr[i] -= s
        dl[i] += s


@njit
def difference(r, l, flow):
    """flow = r - l."""
    for i in range(r.size):
        flow[i] = r[i] - l[i]


@njit
def remember_linear(t, y, dydt, out, handle):
    """Unsteady friction of all pipes under the linear law, added to rates, where there are any."""
    tables = open_tables(handle)
    pipes, floats, scratch = tables.pipes, tables.floats, tables.scratch
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["terms"] > 0 and dydt.size > 0:
            n, o = pipe["cells"], pipe["y"]
            flow, pull = scratch[:n], scratch[n : 2 * n]
            difference(y[o : o + n], y[o + n : o + 2 * n], flow)
            follow_all(pipe, floats, flow, y, dydt, pull)
            take_off(pull, dydt[o : o + n], dydt[o + n : o + 2 * n])
