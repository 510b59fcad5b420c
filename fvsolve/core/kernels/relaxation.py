"""Unsteady friction and viscoelastic pipe walls, by relaxation variables: rates, power and stored energy.

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

Power and stored energy are added to the entries of the pipes, which are those of `network_energy.py`.

Unsteady friction: the sum of dissipation and rate of storage is w times the drag, divided by rho A. They belong to
friction, rate of stored energy and kinetic energy. z is a change; the variable itself starts at the steady input.

Viscoelastic wall: the sum is w g (w - z) / (rho A); g (w - z) is the mass flow into the element per length, times the
wave speed. The work against the initial steady potential P = p - p_ambient + rho g z (z : elevation above datum) is
stored too, with the reference density. They belong to creep, rate of stored energy and elastic energy.

Under the density laws `log`, `table` and `mixture` mass that leaves a cell carries h(p) - h(p_ambient) + g z - v^2 / 2
[J/kg], with specific enthalpy h and velocity v. In the additional volume of the bore it is liquid of the reference
density and carries P / rho. The difference is a property of the density law, at most a fraction p / K (K : bulk
modulus) of the energy that passes. It has its own entry in `power`, the residual of the density law.

Arguments common to these functions: `st`, settings; `floats`, numbers of the model; `profile`, values of the initial
steady state; `pipe`, row of the pipe; `node`, row of the node at its `from` end; `w` : float64[cells]  input [kg/s];
`i`, `g` : number of a cell and of a Gauss point in it.
"""

from fvsolve.core.kernels.cavitating_pipes import DRY
from fvsolve.core.kernels.density import pressure_of_mass
from fvsolve.core.kernels.density.steady_profile import rise_at
from fvsolve.core.kernels.dtypes import LAW_LINEAR
from fvsolve.core.kernels.network_energy import CREEP, NODE, PIPE, relative_enthalpy
from fvsolve.core.kernels.pipe_energy import (
    GAUSS_POINTS,
    GAUSS_WEIGHTS,
    at_point,
    mass_at_point,
    polynomial_width,
    profile_mass,
    steady_potential,
)
from fvsolve.core.kernels.pipes import GAUSS
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.jit import njit, specialise


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
    n = r.size
    c = pipe["speed"]
    flow = pipe["flow"]
    reference = st["rho"] * pipe["area"]
    for i in range(n):
        # Central slopes, one-sided in the end cells.
        low, high = max(i - 1, 0), min(i + 1, n - 1)
        gauss = GAUSS / max(high - low, 1)
        m0 = profile[pipe["center"] + i]
        dm = (r[i] + l[i]) / c
        dflow = r[i] - l[i]
        a = gauss * ((r[high] - l[high]) - (r[low] - l[low]))
        b = gauss * ((r[high] + l[high]) - (r[low] + l[low])) / c
        # M / m at both Gauss points: a quotient of averages would be of second order only.
        u = (flow + (dflow + a)) / (m0 + (dm + b)) + (flow + (dflow - a)) / (m0 + (dm - b))
        # Minus the value of the profile, so that the variables start at zero.
        w[i] = reference * (0.5 * u - flow / m0)


@njit
def wall_pressure(st, floats, profile, pipe, r, l, w):
    """Write (A / a) (p - p0) [kg/s] to w, averaged over each cell by two Gauss points.

    A, a : reference area and wave speed; p, p0 : present and initial steady pressure
    """
    n = r.size
    c = pipe["speed"]
    least = DRY * st["rho"] * pipe["area"]
    for i in range(n):
        low, high = max(i - 1, 0), min(i + 1, n - 1)
        dm_gauss = GAUSS / max(high - low, 1) * ((r[high] + l[high]) - (r[low] + l[low])) / c
        m0, dm = profile[pipe["center"] + i], (r[i] + l[i]) / c
        # A cell may be nearly empty while a cavity is open; its pressure must stay defined.
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
    st = tables.settings[0]
    floats = tables.floats
    profile = tables.profile
    pipes = tables.pipes
    scratch = tables.scratch
    for i in range(pipes.size if dydt.size > 0 else 0):
        pipe = pipes[i]
        if pipe[COUNT] > 0:
            n = pipe["cells"]
            o = pipe["y"]
            at = pipe[VARIABLES]
            # The terms of all exponentials are summed first, so the waves are changed in a single pass.
            w, loss = scratch[:n], scratch[n : 2 * n]
            INPUT(st, floats, profile, pipe, y[o : o + n], y[o + n : o + 2 * n], w)
            for j in range(n):
                loss[j] = 0.0
            for k in range(pipe[COUNT]):
                gain, rate = floats[pipe[TERMS] + 2 * k], floats[pipe[TERMS] + 2 * k + 1]
                relaxation_rate(gain, rate, w, y[at : at + n], dydt[at : at + n], loss)
                at += n
            SUBTRACT(loss, dydt[o : o + n], dydt[o + n : o + 2 * n])


FRICTION_COLUMNS = {"COUNT": "terms", "TERMS": "term", "VARIABLES": "memory"}  # columns of pipes
CREEP_COLUMNS = {"COUNT": "elements", "TERMS": "element", "VARIABLES": "strain"}
add_unsteady_friction = specialise(
    _add_relaxation,
    "add_unsteady_friction",
    **FRICTION_COLUMNS,
    INPUT=wave_difference,
    SUBTRACT=subtract_drag,
)
add_unsteady_friction_barotropic = specialise(
    _add_relaxation,
    "add_unsteady_friction_barotropic",
    **FRICTION_COLUMNS,
    INPUT=velocity_change,
    SUBTRACT=subtract_drag,
)
add_wall_creep = specialise(
    _add_relaxation, "add_wall_creep", **CREEP_COLUMNS, INPUT=wave_sum, SUBTRACT=subtract_storage
)
add_wall_creep_barotropic = specialise(
    _add_relaxation,
    "add_wall_creep_barotropic",
    **CREEP_COLUMNS,
    INPUT=wall_pressure,
    SUBTRACT=subtract_storage,
)


# rows of friction and of stored energy among the rows of a pipe in `power`
FRICTION, STORAGE = 1, 3
KINETIC, ELASTIC = 0, 1  # rows of a pipe in `stored`
# Constants of the templates:
START = PRESSURE = POWER = ENERGY = WORK = RESIDUAL = ROW = KIND = None


@njit
def input_flow(st, floats, profile, pipe, r, l, w):
    """Write the input of unsteady friction to w [kg/s], under any density law.

    r, l : float64[cells]  forward and backward wave [kg/s]
    """
    if st["law"] == LAW_LINEAR:
        wave_difference(st, floats, profile, pipe, r, l, w)
    else:
        velocity_change(st, floats, profile, pipe, r, l, w)


@njit(forceinline=True)
def steady_flow(st, profile, pipe, i):
    """Initial steady input of unsteady friction in cell i [kg/s].

    It is the mass flow; under other density laws than `linear` the velocity times the reference mass per length.
    """
    if st["law"] == LAW_LINEAR:
        return pipe["flow"]
    return pipe["flow"] * (st["rho"] * pipe["area"] / profile[pipe["center"] + i])


@njit(forceinline=True)
def no_flow(st, profile, pipe, i):
    """Initial steady input of wall elements in cell i: zero, because the steady pressure is counted apart [kg/s]."""
    return 0.0


@njit(forceinline=True)
def no_power(*arguments):
    """Zero, in place of a work or a residual."""
    return 0.0


def _relaxation_power(st, floats, profile, pipe, w, y, dydt):
    """(dissipation, rate of stored energy) of the relaxation variables of a pipe [W]."""
    n = w.size
    width = polynomial_width(st, w.size)
    taken = 0.0
    rate = 0.0
    for k in range(pipe[COUNT]):
        gain, at = floats[pipe[TERMS] + 2 * k], pipe[VARIABLES] + k * n
        # A variable stores g z^2 / (2 n), which changes at the rate (g / n) z dz/dt.
        share = gain / floats[pipe[TERMS] + 2 * k + 1]
        z, dz = y[at : at + n], dydt[at : at + n]
        for i in range(n):
            start = START(st, profile, pipe, i)
            for g in range(3):
                here = at_point(z, width, i, g)
                lag = at_point(w, width, i, g) - here
                taken += GAUSS_WEIGHTS[g] * gain * lag * lag
                rate += GAUSS_WEIGHTS[g] * share * (start + here) * at_point(dz, width, i, g)
    per = pipe["dx"] / (st["rho"] * pipe["area"])
    return per * taken, per * rate


friction_power = specialise(
    _relaxation_power, "friction_power", **FRICTION_COLUMNS, START=steady_flow
)
creep_power = specialise(_relaxation_power, "creep_power", **CREEP_COLUMNS, START=no_flow)


@njit
def friction_energy(st, floats, profile, pipe, y):
    """Change since the start of the energy stored in all exponential terms of unsteady friction in a pipe [J]."""
    n = pipe["cells"]
    width = polynomial_width(st, pipe["cells"])
    total = 0.0
    for k in range(pipe["terms"]):
        at = pipe["memory"] + k * n
        share = floats[pipe["term"] + 2 * k] / floats[pipe["term"] + 2 * k + 1]
        for i in range(n):
            start = steady_flow(st, profile, pipe, i)
            for g in range(3):
                z = at_point(y[at : at + n], width, i, g)
                # A product of change and sum: no difference of large squares.
                total += GAUSS_WEIGHTS[g] * share * z * (2.0 * start + z)
    return 0.5 * total * pipe["dx"] / (st["rho"] * pipe["area"])


@njit
def creep_energy(st, floats, profile, pipe, y):
    """Change of the energy in all wall elements of a pipe since the start [J], without `work_against_profile`."""
    n = pipe["cells"]
    width = polynomial_width(st, pipe["cells"])
    total = 0.0
    for k in range(pipe["elements"]):
        at = pipe["strain"] + k * n
        share = floats[pipe["element"] + 2 * k] / floats[pipe["element"] + 2 * k + 1]
        for i in range(n):
            for g in range(3):
                total += GAUSS_WEIGHTS[g] * share * at_point(y[at : at + n], width, i, g) ** 2
    return 0.5 * total * pipe["dx"] / (st["rho"] * pipe["area"])


@njit(forceinline=True)
def bore_growth(st, floats, pipe, i, g, y):
    """Sum over all wall elements of gain times state over rate, at Gauss point g of cell i [kg/s].

    Multiplied by dx / speed it is the mass of reference density in the additional volume of the bore of a cell. With
    rates of states in place of y the result is its time derivative.
    """
    n = pipe["cells"]
    width = polynomial_width(st, pipe["cells"])
    total = 0.0
    for k in range(pipe["elements"]):
        at = pipe["strain"] + k * n
        share = floats[pipe["element"] + 2 * k] / floats[pipe["element"] + 2 * k + 1]
        total += share * at_point(y[at : at + n], width, i, g)
    return total


@njit(forceinline=True)
def potential_along(st, floats, profile, pipe, node, i, g):
    """Initial steady potential P = p - p_ambient + rho g z [Pa] at a Gauss point, under the density law `linear`."""
    start, fall = steady_potential(st, node), pipe["drag"] / pipe["area"]
    return start - fall * (i + 0.5 + GAUSS_POINTS[g]) * pipe["dx"]


@njit(forceinline=True)
def gravity_potential(st, profile, pipe, node, i, g):
    """Gravity potential at a Gauss point, relative to the datum [J/kg]."""
    z = node["elevation"] - st["datum"]
    return st["gravity"] * (z + rise_at(profile, pipe, (i + 0.5 + GAUSS_POINTS[g]) * pipe["dx"]))


@njit(forceinline=True)
def potential_along_barotropic(st, floats, profile, pipe, node, i, g):
    """Initial steady potential P = p - p_ambient + rho g z [Pa] at a Gauss point, under the other density laws."""
    p = pressure_of_mass(st, floats, pipe, profile_mass(profile, pipe, i, g))
    return p - st["ambient"] + st["rho"] * gravity_potential(st, profile, pipe, node, i, g)


def _work_against_profile(st, floats, profile, pipe, node, y):
    """Energy in wall elements as work against the initial steady potential [J], or its rate [W] if y are rates."""
    total = 0.0
    for i in range(pipe["cells"]):
        for g in range(3):
            before = PRESSURE(st, floats, profile, pipe, node, i, g)
            total += GAUSS_WEIGHTS[g] * before * bore_growth(st, floats, pipe, i, g, y)
    return total * pipe["dx"] / (st["rho"] * pipe["speed"])


work_against_profile = specialise(
    _work_against_profile, "work_against_profile", PRESSURE=potential_along
)
work_against_profile_barotropic = specialise(
    _work_against_profile, "work_against_profile_barotropic", PRESSURE=potential_along_barotropic
)


@njit
def density_law_power(st, floats, profile, pipe, node, w, y, dydt):
    """Energy flow of the mass that leaves the cells of a pipe into the additional bore, minus its energy there [W]."""
    n = w.size
    o = pipe["y"]
    width = polynomial_width(st, w.size)
    total = 0.0
    r, l = y[o : o + n], y[o + n : o + 2 * n]
    for i in range(n):
        for g in range(3):
            a, b = at_point(r, width, i, g), at_point(l, width, i, g)
            m = mass_at_point(st, profile, pipe, i, g, (a + b) / pipe["speed"])
            v = (pipe["flow"] + (a - b)) / m
            carried = (
                relative_enthalpy(st, floats, pressure_of_mass(st, floats, pipe, m)) - 0.5 * v * v
            )
            carried += gravity_potential(st, profile, pipe, node, i, g)
            P = potential_along_barotropic(st, floats, profile, pipe, node, i, g)
            # w is the change of pressure in units of the admittance: this gives the present potential.
            P += at_point(w, width, i, g) / pipe["admittance"]
            total += (
                GAUSS_WEIGHTS[g]
                * (carried - P / st["rho"])
                * bore_growth(st, floats, pipe, i, g, dydt)
            )
    return total * pipe["dx"] / pipe["speed"]


def _add_power(t, y, dydt, out, handle, power):
    """Add the power of relaxation variables to the entries of their pipes in `power` [W].

    It consists of dissipation, rate of stored energy, and the residual of the density law.
    """
    tables = open_tables(handle)
    st = tables.settings[0]
    floats = tables.floats
    profile = tables.profile
    pipes = tables.pipes
    at = NODE * tables.nodes.size
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe[COUNT] > 0:
            n = pipe["cells"]
            o = pipe["y"]
            node = tables.nodes[pipe["from_node"]]
            w = tables.scratch[:n]
            INPUT(st, floats, profile, pipe, y[o : o + n], y[o + n : o + 2 * n], w)
            taken, rate = POWER(st, floats, profile, pipe, w, y, dydt)
            power[at + ROW] += taken
            # The row after creep is the residual of the density law.
            power[at + CREEP + 1] += RESIDUAL(st, floats, profile, pipe, node, w, y, dydt)
            power[at + STORAGE] += rate + WORK(st, floats, profile, pipe, node, dydt)
        at += PIPE


def _add_stored(t, y, dydt, out, handle, stored):
    """Add the change of energy in relaxation variables since the start to the entries of pipes in `stored` [J]."""
    tables = open_tables(handle)
    st = tables.settings[0]
    floats = tables.floats
    profile = tables.profile
    pipes = tables.pipes
    nodes = tables.nodes
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe[COUNT] > 0:
            more = WORK(st, floats, profile, pipe, nodes[pipe["from_node"]], y)
            stored[nodes.size + 2 * i + KIND] += ENERGY(st, floats, profile, pipe, y) + more


UNSTEADY_FRICTION = FRICTION_COLUMNS | {
    "INPUT": input_flow,
    "POWER": friction_power,
    "ENERGY": friction_energy,
    "WORK": no_power,
    "RESIDUAL": no_power,
    "ROW": FRICTION,
    "KIND": KINETIC,
}
WALL_CREEP = CREEP_COLUMNS | {
    "INPUT": wave_sum,
    "POWER": creep_power,
    "ENERGY": creep_energy,
    "WORK": work_against_profile,
    "RESIDUAL": no_power,
    "ROW": CREEP,
    "KIND": ELASTIC,
}
WALL_CREEP_BAROTROPIC = WALL_CREEP | {
    "INPUT": wall_pressure,
    "WORK": work_against_profile_barotropic,
    "RESIDUAL": density_law_power,
}
add_friction_power = specialise(_add_power, "add_friction_power", **UNSTEADY_FRICTION)
add_friction_stored = specialise(_add_stored, "add_friction_stored", **UNSTEADY_FRICTION)
add_creep_power = specialise(_add_power, "add_creep_power", **WALL_CREEP)
add_creep_stored = specialise(_add_stored, "add_creep_stored", **WALL_CREEP)
add_creep_power_barotropic = specialise(
    _add_power, "add_creep_power_barotropic", **WALL_CREEP_BAROTROPIC
)
add_creep_stored_barotropic = specialise(
    _add_stored, "add_creep_stored_barotropic", **WALL_CREEP_BAROTROPIC
)
