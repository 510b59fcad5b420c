"""Power and stored energy of viscoelastic walls under the density laws log, table and mixture.

Mass that leaves a cell carries h(p) - h(p_ambient) + g z - v^2 / 2 [J/kg], with the enthalpy h. In the additional
volume of the bore it is liquid of the reference density and carries P / rho. The elements dissipate and store their
share of P (`wall_energy.py`). The difference is a property of the density law, at most a fraction p / K of the
energy that passes. It has its own row.
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
    """Gravity potential g z at a Gauss point of cell i [J/kg]; z : height of the `from` end of the pipe [m]."""
    return st["gravity"] * (z + rise_at(profile, pipe, (i + 0.5 + GAUSS_POINTS[g]) * pipe["dx"]))


@njit(forceinline=True)
def profile_pressure(st, floats, profile, pipe, z, i, g):
    """P of the profile at a Gauss point of cell i [Pa]."""
    p = pressure_of_mass(st, floats, pipe, profile_mass(profile, pipe, i, g))
    return p - st["ambient"] + st["rho"] * gravity_potential(st, profile, pipe, z, i, g)


@njit
def work_against_profile_barotropic(st, floats, profile, pipe, z, y):
    """Energy stored in elements as work against P of the profile [J], or its rate [W] where y are rates."""
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
    """Energy flow of the mass that leaves the cells into the bore, minus its energy there [W]."""
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
    """Add the power of the walls of all pipes, and the difference of the density law, to the power rows."""
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
    """Add the energy stored in the walls of all pipes to the storage rows of the pipes."""
    tables = open_tables(handle)
    st, floats, pipes, nodes = tables.settings[0], tables.floats, tables.pipes, tables.nodes
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["elements"] > 0:
            z = nodes[pipe["from_node"]]["elevation"] - st["datum"]
            more = work_against_profile_barotropic(st, floats, tables.profile, pipe, z, y)
            stored[nodes.size + 2 * i + 1] += creep_energy(st, floats, pipe, y) + more
