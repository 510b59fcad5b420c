"""Density law `log`: p = p_ref + beta ln(rho / rho_ref), constant bulk modulus beta, from (80) of docs/course.md."""

from math import expm1, log1p

from fvsolve.jit import njit


@njit
def log_density(st, floats, p):
    """(ln(rho / rho_ref), d ln rho / dp [1/Pa]) at the pressure p [Pa], with density rho."""
    return (p - st["reference"]) / st["beta"], 1.0 / st["beta"]


@njit
def enthalpy(st, floats, p):
    """Specific enthalpy h at the pressure p: integral of dp / rho from the reference pressure [J/kg]."""
    # expm1 keeps the digits where the pressure is near its reference.
    return -st["beta"] / st["rho"] * expm1(-(p - st["reference"]) / st["beta"])


@njit
def pressure_of_enthalpy(st, floats, h):
    """Pressure [Pa] at which the specific enthalpy is h [J/kg]."""
    # log1p keeps the digits where the enthalpy is small.
    return st["reference"] - st["beta"] * log1p(-h * st["rho"] / st["beta"])


@njit
def pressure_of_log(st, floats, compliance, q):
    """Pressure p [Pa] at which ln(rho / rho_ref) + compliance (p - p_ref) is q, with density rho.

    compliance : relative area change of the wall per pressure [1/Pa]
    """
    return st["reference"] + q / (1.0 / st["beta"] + compliance)
