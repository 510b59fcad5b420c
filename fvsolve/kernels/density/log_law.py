"""Density law `log`: p = p_ref + beta ln(rho / rho_ref), constant bulk modulus beta, from (80) of docs/course.md."""

from math import expm1, log, log1p

from fvsolve.jit import inline, njit
from fvsolve.kernels.density import elastic_wall


@njit
def log_density(st, floats, p):
    """(ln(rho / rho_ref), d ln rho / dp [1/Pa]) at the pressure p [Pa], with density rho."""
    return (p - st["reference"]) / st["beta"], 1.0 / st["beta"]


@inline
def density(st, floats, p):
    """Density rho [kg/m3] at the pressure p [Pa]."""
    return elastic_wall.density(st, log_density(st, floats, p)[0])


@njit
def enthalpy(st, floats, p):
    """Specific enthalpy h at the pressure p: integral of dp / rho from the reference pressure [J/kg]."""
    return -st["beta"] / st["rho"] * expm1(-(p - st["reference"]) / st["beta"])


@njit
def pressure_of_enthalpy(st, floats, h):
    """Pressure [Pa] at which the specific enthalpy is h [J/kg]."""
    return st["reference"] - st["beta"] * log1p(-h * st["rho"] / st["beta"])


@njit
def pressure_of_log(st, floats, compliance, q):
    """Pressure p [Pa] at which ln(rho / rho_ref) + compliance (p - p_ref) is q, with density rho.

    compliance : relative area change of the wall per pressure [1/Pa]
    """
    return st["reference"] + q / (1.0 / st["beta"] + compliance)


@inline
def pressure_of_mass(st, floats, pipe, m):
    """Pressure [Pa] of a pipe that contains the mass per length m [kg/m]."""
    return pressure_of_log(st, floats, pipe["compliance"], log(elastic_wall.mass_ratio(st, pipe, m)))


@inline
def mass_of_pressure(st, floats, pipe, p):
    """Mass per length m = rho A [kg/m] and dm/dp [kg/m/Pa] of a pipe at the pressure p, with density rho and area A."""
    value, slope = log_density(st, floats, p)
    return elastic_wall.mass(st, pipe, p, value, slope)


@inline
def wall_area(st, floats, pipe, p):
    """Area of a pipe at the pressure p [m2]."""
    return elastic_wall.area(st, pipe, p)


@inline
def thrust(st, floats, pipe, p):
    """Pressure force in a pipe: integral of A dp from the reference pressure to p [N], A : area of the pipe."""
    return elastic_wall.thrust(st, pipe, p)


@inline
def force_of_mass(st, floats, pipe, m):
    """Pressure force (`thrust`) [N] in a pipe that contains the mass per length m [kg/m]."""
    return thrust(st, floats, pipe, pressure_of_mass(st, floats, pipe, m))


@inline
def impedance(st, floats, pipe, p):
    """Impedance rho c of a pipe at the pressure p [kg/m2/s]: density times wave speed."""
    value, slope = log_density(st, floats, p)
    return elastic_wall.impedance(st, pipe, value, slope)


@njit
def velocity_change(st, floats, pipe, p_from, p_to):
    """Integral of dp / (rho c) in a pipe from p_from to p_to [m/s] by three Gauss points; rho c as in `impedance`."""
    middle, half = 0.5 * (p_from + p_to), 0.5 * (p_to - p_from)
    low, high = middle - elastic_wall.GAUSS_POINT * half, middle + elastic_wall.GAUSS_POINT * half
    here, there = impedance(st, floats, pipe, low), impedance(st, floats, pipe, high)
    return elastic_wall.gauss_integral(half, impedance(st, floats, pipe, middle), here, there)


@inline
def local_speed(st, floats, pipe, p):
    """Wave speed of a pipe at the pressure p [m/s]."""
    value, slope = log_density(st, floats, p)
    return elastic_wall.speed(st, pipe, value, slope)
