"""Density law `log`: p = p_ref + beta ln(rho / rho_ref), the integral of (80)."""

from math import expm1, log, log1p

from fvsolve.jit import inline, njit
from fvsolve.kernels.density import elastic_wall


@njit
def log_density(st, floats, p):
    """(ln(rho / rho_ref), d ln rho / dp [1/Pa]) at a pressure."""
    return (p - st["reference"]) / st["beta"], 1.0 / st["beta"]


@inline
def density(st, floats, p):
    """rho [kg/m3] at a pressure."""
    return elastic_wall.density(st, log_density(st, floats, p)[0])


@njit
def enthalpy(st, floats, p):
    """h = integral of dp / rho from the reference pressure [J/kg]."""
    return -st["beta"] / st["rho"] * expm1(-(p - st["reference"]) / st["beta"])


@njit
def pressure_of_enthalpy(st, floats, h):
    """Pressure [Pa] at which `enthalpy` is h."""
    return st["reference"] - st["beta"] * log1p(-h * st["rho"] / st["beta"])


@njit
def pressure_of_log(st, floats, compliance, q):
    """Pressure [Pa] at which ln(rho / rho_ref) + compliance (p - p_ref) is q."""
    return st["reference"] + q / (1.0 / st["beta"] + compliance)


@inline
def pressure_of_mass(st, floats, pipe, m):
    """Pressure [Pa] of a pipe that contains m [kg/m]."""
    return pressure_of_log(st, floats, pipe["compliance"], log(elastic_wall.mass_ratio(st, pipe, m)))


@inline
def mass_of_pressure(st, floats, pipe, p):
    """Mass per length m = rho A [kg/m] and dm/dp of a pipe at a pressure."""
    value, slope = log_density(st, floats, p)
    return elastic_wall.mass(st, pipe, p, value, slope)


@inline
def wall_area(st, floats, pipe, p):
    """Area of a pipe at a pressure [m2]."""
    return elastic_wall.area(st, pipe, p)


@inline
def thrust(st, floats, pipe, p):
    """Integral of A dp from the reference pressure [N]."""
    return elastic_wall.thrust(st, pipe, p)


@inline
def force_of_mass(st, floats, pipe, m):
    """`thrust` at the pressure of a pipe that contains m [kg/m] [N]: momentum flux by pressure."""
    return thrust(st, floats, pipe, pressure_of_mass(st, floats, pipe, m))


@inline
def impedance(st, floats, pipe, p):
    """rho c of a pipe at a pressure [kg/m2/s]."""
    value, slope = log_density(st, floats, p)
    return elastic_wall.impedance(st, pipe, value, slope)


@njit
def velocity_change(st, floats, pipe, p_from, p_to):
    """Integral of dp / (rho c) [m/s] by three Gauss points."""
    middle, half = 0.5 * (p_from + p_to), 0.5 * (p_to - p_from)
    low, high = middle - elastic_wall.GAUSS_POINT * half, middle + elastic_wall.GAUSS_POINT * half
    here, there = impedance(st, floats, pipe, low), impedance(st, floats, pipe, high)
    return elastic_wall.gauss_integral(half, impedance(st, floats, pipe, middle), here, there)


@inline
def local_speed(st, floats, pipe, p):
    """Wave speed c of a pipe at a pressure [m/s]."""
    value, slope = log_density(st, floats, p)
    return elastic_wall.speed(st, pipe, value, slope)
