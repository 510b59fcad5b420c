"""Power and stored energy of viscoelastic walls under the density laws `log`, `table` and `mixture`.

Mass that leaves a cell carries h(p) - h(p_ambient) + g z - v^2 / 2 [J/kg], with specific enthalpy h, elevation z and
velocity v. In the additional volume of the bore it is liquid of the reference density and carries P / rho, P = p -
p_ambient + rho g z. The elements dissipate and store their share of P (`wall_energy.py`). The difference is a property
of the density law, at most a fraction p / K (K : bulk modulus) of the energy that passes. It has its own entry in
`power`, the residual of the density law.
"""

from fvsolve.jit import njit
from fvsolve.kernels.barotropic_energy import mass_at_point, profile_mass, relative_enthalpy
from fvsolve.kernels.density import pressure_of_mass
from fvsolve.kernels.density.steady_profile import rise_at
from fvsolve.kernels.linear_energy import CREEP, GAUSS_POINTS, GAUSS_WEIGHTS, NODE, PIPE, at_point, polynomial_width
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.viscoelastic_wall.kelvin_voigt_barotropic import wall_pressure
from fvsolve.kernels.viscoelastic_wall.wall_energy import bore_growth, creep_energy, creep_power


@njit(forceinline=True)
def gravity_potential(st, profile, pipe, z, i, g):
    """Gravity potential [J/kg] at Gauss point g of cell i of a pipe; z : elevation of its `from` end over datum [m]."""
    return st["gravity"] * (z + rise_at(profile, pipe, (i + 0.5 + GAUSS_POINTS[g]) * pipe["dx"]))


@njit(forceinline=True)
def profile_pressure(st, floats, profile, pipe, z, i, g):
    """Initial steady potential P = p - p_ambient + rho g z [Pa] at Gauss point g of cell i of a pipe.

    In this formula z is the elevation of the point; the argument z is that of the `from` end of the pipe, both above
    datum [m].
    """
    p = pressure_of_mass(st, floats, pipe, profile_mass(profile, pipe, i, g))
    return p - st["ambient"] + st["rho"] * gravity_potential(st, profile, pipe, z, i, g)


@njit
def work_against_profile_barotropic(st, floats, profile, pipe, z, y):
    """Energy stored in wall elements as work against initial steady potential P [J], or its rate [W] if y are rates.

    P : see `profile_pressure`; z : elevation of the `from` end of the pipe above datum [m]
    """
    sum_ = 0.0
    for i in range(pipe["cells"]):
        for g in range(3):
            sum_ += (
                GAUSS_WEIGHTS[g]
                * profile_pressure(st, floats, profile, pipe, z, i, g)
                * bore_growth(st, floats, pipe, i, g, y)
            )
    return sum_ * pipe["dx"] / (st["rho"] * pipe["speed"])


@njit
def density_law_power(st, floats, profile, pipe, z, w, y, dydt):
    """Energy flow of the mass that leaves the cells of a pipe into the additional bore, minus its energy there [W].

    z : elevation of the `from` end of the pipe above datum [m]
    w : float64[cells]  pressure change times area over wave speed [kg/s]
    """
    n, o, width, sum_ = w.size, pipe["y"], polynomial_width(st, w.size), 0.0
    r, l = y[o : o + n], y[o + n : o + 2 * n]
    for i in range(n):
        for g in range(3):
            a, b = at_point(r, width, i, g), at_point(l, width, i, g)
            m = mass_at_point(st, profile, pipe, i, g, (a + b) / pipe["speed"])
            v = (pipe["flow"] + (a - b)) / m
            carried = relative_enthalpy(st, floats, pressure_of_mass(st, floats, pipe, m)) - 0.5 * v * v
            carried += gravity_potential(st, profile, pipe, z, i, g)
            P = profile_pressure(st, floats, profile, pipe, z, i, g) + at_point(w, width, i, g) / pipe["admittance"]
            sum_ += GAUSS_WEIGHTS[g] * (carried - P / st["rho"]) * bore_growth(st, floats, pipe, i, g, dydt)
    return sum_ * pipe["dx"] / pipe["speed"]


@njit
def add_power_barotropic(t, y, dydt, out, handle, power):
    """Add the power of viscoelastic walls to the entries of their pipes in `power` [W].

    It consists of dissipation, rate of stored energy, and the residual of the density law (`density_law_power`).
    """
    tables = open_tables(handle)
    st, pipes, nodes, at = tables.settings[0], tables.pipes, tables.nodes, NODE * tables.nodes.size
    floats, profile = tables.floats, tables.profile
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["elements"] > 0:
            n, o, z = pipe["cells"], pipe["y"], nodes[pipe["from_node"]]["elevation"] - st["datum"]
            w = tables.scratch[:n]
            wall_pressure(st, floats, profile, pipe, y[o : o + n], y[o + n : o + 2 * n], w)
            taken, rate = creep_power(st, floats, pipe, w, y, dydt)
            power[at + CREEP] += taken
            power[at + CREEP + 1] += density_law_power(st, floats, profile, pipe, z, w, y, dydt)
            power[at + 3] += rate + work_against_profile_barotropic(st, floats, profile, pipe, z, dydt)
        at += PIPE


@njit
def add_stored_barotropic(t, y, dydt, out, handle, stored):
    """Add the change of energy stored in viscoelastic walls since the start to the entries of pipes in `stored` [J]."""
    tables = open_tables(handle)
    st, floats, pipes, nodes = tables.settings[0], tables.floats, tables.pipes, tables.nodes
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["elements"] > 0:
            z = nodes[pipe["from_node"]]["elevation"] - st["datum"]
            more = work_against_profile_barotropic(st, floats, tables.profile, pipe, z, y)
            stored[nodes.size + 2 * i + 1] += creep_energy(st, floats, pipe, y) + more
