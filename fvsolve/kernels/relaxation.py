"""Unsteady friction and viscoelastic pipe walls, by relaxation variables.

A relaxation variable z follows an input w of its cell, dz/dt = n (w - z), and adds g (w - z) to a loss of the waves,
with rate n and gain g [1/s]. All values are changes since the initial steady state. Per length a variable stores g z^2
/ (2 n) and dissipates g (w - z)^2, both divided by rho A (density times area): a model without negative g is passive.

Unsteady friction: w is the mass flow M [kg/s], and the loss is a drag on M. The weighting function of the flow history
is W(tau) = sum of m_k exp(-n_k tau), tau = nu t / R^2, with kinematic viscosity nu and pipe radius R. In addition to
the quasi-steady drag (Zielke 1968) the wall exerts the drag sum over k of (4 nu / R^2) m_k (M - z_k) per length, so g =
4 nu m_k / R^2 and n = n_k nu / R^2. The equations are linear in cell averages, so they are exact for them. Under the
density laws `log`, `table` and `mixture` the variables follow u = (rho A)_ref M / m, the velocity M / m times the
reference mass per length, with mass per length m. Then velocity times drag is a rate of storage plus a dissipation.

Viscoelastic wall (Kelvin-Voigt elements): an element of compliance J [1/Pa] and time constant tau [s] has the strain
eps, d eps/dt = (J sigma - eps) / tau. The hoop stress is sigma = c D p / (2 e), with restraint factor c, diameter D and
wall thickness e. The bore grows by 2 eps A (Covas et al. 2005), A : area. w = r + l is the sum of both waves, which is
the pressure times A / a with wave speed a, and z = 2 rho a eps A / G with G = c D K J / e and K = rho a^2; so n = 1 /
tau and g = G / tau. The mass flow into the additional bore per length is G dz/dt / a; so G dz/dt is subtracted in equal
halves from the rates of both waves. The initial steady pressure is in equilibrium with its strain. Under the density
laws `log`, `table` and `mixture` w = (A / a) (p - p0), with pressure p, initial steady pressure p0, and area A and wave
speed a at the reference state. The additional bore holds liquid of the reference density; its mass is subtracted from
the mass of the same cell only.

Arguments of the functions that write an input : `st`, settings; `floats`, numbers of the model; `profile`, values of
the initial steady state; `pipe`, row of the pipe; `r`, `l` : float64[cells]  forward and backward wave [kg/s]; `w` :
float64[cells]  receives the input [kg/s].
"""

from fvsolve.jit import njit, specialise
from fvsolve.kernels.cavitating_pipes import DRY
from fvsolve.kernels.density import pressure_of_mass
from fvsolve.kernels.pipes import GAUSS
from fvsolve.kernels.table_handle import open_tables


@njit
def wave_difference(st, floats, profile, pipe, r, l, w):
    """Write the change of the mass flow in cells, r - l [kg/s], to w."""
    for i in range(r.size):
        w[i] = r[i] - l[i]


@njit
def wave_sum(st, floats, profile, pipe, r, l, w):
    """Write the sum of both waves r + l [kg/s], a measure of pressure, to w."""
    for i in range(r.size):
        w[i] = r[i] + l[i]


@njit
def velocity_change(st, floats, profile, pipe, r, l, w):
    """Write the reference mass per length times the change of M / m [kg/s] to w.

    The values are cell averages by two Gauss points; M : mass flow, m : mass per length
    """
    n, c, flow, reference = r.size, pipe["speed"], pipe["flow"], st["rho"] * pipe["area"]
    for i in range(n):
        low, high = max(i - 1, 0), min(i + 1, n - 1)
        gauss = GAUSS / max(high - low, 1)
        m0, dm, dflow = profile[pipe["center"] + i], (r[i] + l[i]) / c, r[i] - l[i]
        a = gauss * ((r[high] - l[high]) - (r[low] - l[low]))
        b = gauss * ((r[high] + l[high]) - (r[low] + l[low])) / c
        u = (flow + (dflow + a)) / (m0 + (dm + b)) + (flow + (dflow - a)) / (m0 + (dm - b))
        w[i] = reference * (0.5 * u - flow / m0)


@njit
def wall_pressure(st, floats, profile, pipe, r, l, w):
    """Write (A / a) (p - p0) [kg/s] to w, averaged over each cell by two Gauss points.

    A, a : reference area and wave speed; p, p0 : present and initial steady pressure
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
def relaxation_rate(gain, rate, w, z, dz, loss):
    """Write dz/dt = rate (w - z) of a relaxation variable, and add gain (w - z) to `loss`.

    w, z, dz, loss : float64[cells]; rate, gain [1/s]
    """
    for i in range(z.size):
        lag = w[i] - z[i]
        dz[i] = rate * lag
        loss[i] += gain * lag


@njit
def subtract_drag(loss, dr, dl):
    """Subtract half of a drag `loss` [kg/s2] from the rate of the forward wave; add half to that of the backward wave.

    dr, dl : float64[cells]  rates of both waves [kg/s2]
    """
    for i in range(loss.size):
        s = 0.5 * loss[i]
        dr[i] -= s
        dl[i] += s


@njit
def subtract_storage(loss, dr, dl):
    """Subtract half of the storage in the wall, `loss` [kg/s2], from the rate of each wave; see `subtract_drag`."""
    for i in range(loss.size):
        dr[i] -= 0.5 * loss[i]
        dl[i] -= 0.5 * loss[i]


VARIABLES = TERMS = COUNT = INPUT = SUBTRACT = None  # constants of the template


def _add_relaxation(t, y, dydt, out, handle):
    """Write the rates of the relaxation variables of all pipes, and subtract their loss from the rates of both waves.

    Nothing is done if `dydt` is empty.
    """
    tables = open_tables(handle)
    st, floats, profile, pipes, scratch = (
        tables.settings[0], tables.floats, tables.profile, tables.pipes, tables.scratch,
    )  # fmt: skip
    for i in range(pipes.size if dydt.size > 0 else 0):
        pipe = pipes[i]
        if pipe[COUNT] > 0:
            n, o, at = pipe["cells"], pipe["y"], pipe[VARIABLES]
            w, loss = scratch[:n], scratch[n : 2 * n]
            INPUT(st, floats, profile, pipe, y[o : o + n], y[o + n : o + 2 * n], w)
            for j in range(n):
                loss[j] = 0.0
            for k in range(pipe[COUNT]):
                gain, rate = floats[pipe[TERMS] + 2 * k], floats[pipe[TERMS] + 2 * k + 1]
                relaxation_rate(gain, rate, w, y[at : at + n], dydt[at : at + n], loss)
                at += n
            SUBTRACT(loss, dydt[o : o + n], dydt[o + n : o + 2 * n])


FRICTION = {"COUNT": "terms", "TERMS": "term", "VARIABLES": "memory"}  # columns of pipes
CREEP = {"COUNT": "elements", "TERMS": "element", "VARIABLES": "strain"}
add_unsteady_friction = specialise(
    _add_relaxation, "add_unsteady_friction", **FRICTION, INPUT=wave_difference, SUBTRACT=subtract_drag
)
add_unsteady_friction_barotropic = specialise(
    _add_relaxation, "add_unsteady_friction_barotropic", **FRICTION, INPUT=velocity_change, SUBTRACT=subtract_drag
)
add_wall_creep = specialise(_add_relaxation, "add_wall_creep", **CREEP, INPUT=wave_sum, SUBTRACT=subtract_storage)
add_wall_creep_barotropic = specialise(
    _add_relaxation, "add_wall_creep_barotropic", **CREEP, INPUT=wall_pressure, SUBTRACT=subtract_storage
)
