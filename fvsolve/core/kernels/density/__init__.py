"""Density laws `log`, `table`, `mixture`: density, enthalpy, mass per length, pressure force, wave speed of a pipe.

Each law has its own file, with the functions `log_density`, `enthalpy` and their inverses. Under `log` and `table` a
pipe wall obeys d ln(area) = compliance dp, and all functions of a pipe follow from ln(rho / rho_ref) and its slope;
they are written once here. Under `mixture` the area is linear in pressure, and the file of the law has these functions.
An unknown code of a law gives NaN. The law `linear` is not among them: its kernels need no density, because the sum of
both waves is proportional to the pressure change, and are 20 times as fast.

Arguments common to these functions: `st`, record of settings; `floats`, numbers of the model; `pipe`, record of a pipe;
`p`, pressure [Pa].
"""

from math import exp, expm1, log, nan, sqrt

from fvsolve.core.kernels.density import log_law, mixture_law, table_law
from fvsolve.core.kernels.dtypes import LAW_LOG, LAW_MIXTURE, LAW_TABLE
from fvsolve.jit import inline, njit

GAUSS_POINT = 0.7745966692414834  # sqrt(3/5), outer abscissa of three Gauss points in [-1, 1]


@inline
def log_density(st, floats, p):
    """(ln(rho / rho_ref), d ln rho / dp [1/Pa]) at the pressure p [Pa], with density rho."""
    if st["law"] == LAW_LOG:
        return log_law.log_density(st, floats, p)
    if st["law"] == LAW_TABLE:
        return table_law.log_density(st, floats, p)
    if st["law"] == LAW_MIXTURE:
        return mixture_law.log_density(st, floats, p)
    return nan, nan


@njit
def density(st, floats, p):
    """Density rho [kg/m3] at the pressure p [Pa]."""
    if st["law"] == LAW_MIXTURE:
        return mixture_law.density(st, floats, p)
    return st["rho"] * exp(log_density(st, floats, p)[0])


@njit
def enthalpy(st, floats, p):
    """Specific enthalpy h at the pressure p: integral of dp / rho from the reference pressure [J/kg]."""
    if st["law"] == LAW_LOG:
        return log_law.enthalpy(st, floats, p)
    if st["law"] == LAW_TABLE:
        return table_law.enthalpy(st, floats, p)
    if st["law"] == LAW_MIXTURE:
        return mixture_law.enthalpy(st, floats, p)
    return nan


@njit
def pressure_of_enthalpy(st, floats, h):
    """Pressure [Pa] at which the specific enthalpy is h [J/kg]."""
    if st["law"] == LAW_LOG:
        return log_law.pressure_of_enthalpy(st, floats, h)
    if st["law"] == LAW_TABLE:
        return table_law.pressure_of_enthalpy(st, floats, h)
    if st["law"] == LAW_MIXTURE:
        return mixture_law.pressure_of_enthalpy(st, floats, h)
    return nan


@inline
def pressure_of_log(st, floats, compliance, q):
    """Pressure [Pa] at which ln(rho / rho_ref) + ln(A / A_ref) is q, with density rho and area A.

    compliance : relative area change of the wall per pressure [1/Pa], 0 for a vessel
    """
    if st["law"] == LAW_LOG:
        return log_law.pressure_of_log(st, floats, compliance, q)
    if st["law"] == LAW_TABLE:
        return table_law.pressure_of_log(st, floats, compliance, q)
    if st["law"] == LAW_MIXTURE:
        return mixture_law.pressure_of_log(st, floats, compliance, q)
    return nan


@njit
def pressure_of_mass(st, floats, pipe, m):
    """Pressure [Pa] of a pipe that contains the mass per length m [kg/m]."""
    if st["law"] == LAW_MIXTURE:
        return mixture_law.pressure_of_mass(st, floats, pipe, m)
    # m / (rho_ref A_ref) = (rho / rho_ref) (A / A_ref), whose logarithm the laws invert.
    return pressure_of_log(st, floats, pipe["compliance"], log(m / (st["rho"] * pipe["area"])))


@njit
def mass_of_pressure(st, floats, pipe, p):
    """Mass per length m = rho A [kg/m] and dm/dp [kg/m/Pa] of a pipe at the pressure p, with density rho and area A."""
    if st["law"] == LAW_MIXTURE:
        return mixture_law.mass_of_pressure(st, floats, pipe, p)
    value, slope = log_density(st, floats, p)
    # Density and area are both exponentials, so their logarithms add up.
    m = st["rho"] * pipe["area"] * exp(value + pipe["compliance"] * (p - st["reference"]))
    return m, m * (slope + pipe["compliance"])


@njit
def wall_area(st, floats, pipe, p):
    """Area of a pipe with elastic wall at the pressure p [m2]."""
    if st["law"] == LAW_MIXTURE:
        return mixture_law.wall_area(st, floats, pipe, p)
    if st["law"] != LAW_LOG and st["law"] != LAW_TABLE:
        return nan
    return pipe["area"] * exp(pipe["compliance"] * (p - st["reference"]))


@njit
def thrust(st, floats, pipe, p):
    """Pressure force in a pipe: integral of A dp from the reference pressure to p [N], A : area of the pipe."""
    if st["law"] == LAW_MIXTURE:
        return mixture_law.thrust(st, floats, pipe, p)
    if st["law"] != LAW_LOG and st["law"] != LAW_TABLE:
        return nan
    x = pipe["compliance"] * (p - st["reference"])
    # A rigid wall: the general formula would divide by zero.
    if abs(x) < 1e-14:
        return pipe["area"] * (p - st["reference"])
    return pipe["area"] * expm1(x) / pipe["compliance"]


@njit
def force_of_mass(st, floats, pipe, m):
    """Pressure force (`thrust`) [N] in a pipe that contains the mass per length m [kg/m]."""
    return thrust(st, floats, pipe, pressure_of_mass(st, floats, pipe, m))


@njit
def impedance(st, floats, pipe, p):
    """Impedance rho c = sqrt(rho / (d ln m / dp)) of a pipe at the pressure p [kg/m2/s].

    rho : density, c : wave speed, m : mass per length
    """
    if st["law"] == LAW_MIXTURE:
        return mixture_law.impedance(st, floats, pipe, p)
    value, slope = log_density(st, floats, p)
    return sqrt(st["rho"] * exp(value) / (slope + pipe["compliance"]))


@njit
def velocity_change(st, floats, pipe, p_from, p_to):
    """Riemann integral of a pipe: integral of dp / (rho c) from pressure p_from to p_to [m/s], negative if p falls.

    A forward simple wave increases the velocity by it, a backward simple wave reduces the velocity by it. Three Gauss
    points are used, except under the law `mixture`. rho : density, c : wave speed
    """
    if st["law"] == LAW_MIXTURE:
        return mixture_law.velocity_change(st, floats, pipe, p_from, p_to)
    middle, half = 0.5 * (p_from + p_to), 0.5 * (p_to - p_from)
    far = GAUSS_POINT * half
    low, high = impedance(st, floats, pipe, middle - far), impedance(st, floats, pipe, middle + far)
    # Gauss-Legendre quadrature of 1 / (rho c) with the weights 5/9, 8/9, 5/9.
    total = 8.0 / impedance(st, floats, pipe, middle)
    total += 5.0 / low + 5.0 / high
    return half * total / 9.0


@njit
def local_speed(st, floats, pipe, p):
    """Wave speed sqrt(K / rho) of a pipe at the pressure p [m/s], 1/K = d ln rho / dp + compliance of the wall."""
    if st["law"] == LAW_MIXTURE:
        return mixture_law.local_speed(st, floats, pipe, p)
    value, slope = log_density(st, floats, p)
    return sqrt(1.0 / ((slope + pipe["compliance"]) * st["rho"] * exp(value)))
