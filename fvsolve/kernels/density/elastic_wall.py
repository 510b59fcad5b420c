"""Mass, area and wave speed of a pipe with elastic wall, d ln(area) = compliance dp, from its density.

Used by the density laws `log` and `table`. value, slope : ln(rho / rho_ref) and d ln rho / dp [1/Pa] at the pressure
"""

from math import exp, expm1, sqrt

from fvsolve.jit import inline

GAUSS_POINT = 0.7745966692414834  # sqrt(3/5), outer abscissa of three Gauss points in [-1, 1]


@inline
def density(st, value):
    """Density rho [kg/m3] from `value` = ln(rho / rho_ref)."""
    return st["rho"] * exp(value)


@inline
def mass_ratio(st, pipe, m):
    """Mass per length m [kg/m] over its value at the reference pressure [-]."""
    return m / (st["rho"] * pipe["area"])


@inline
def mass(st, pipe, p, value, slope):
    """Mass per length m = rho A [kg/m] and dm/dp [kg/m/Pa] of a pipe at the pressure p, with density rho and area A.

    value, slope : ln(rho / rho_ref) and d ln rho / dp [1/Pa] at this pressure
    """
    m = st["rho"] * pipe["area"] * exp(value + pipe["compliance"] * (p - st["reference"]))
    return m, m * (slope + pipe["compliance"])


@inline
def area(st, pipe, p):
    """Area of a pipe at the pressure p [m2]."""
    return pipe["area"] * exp(pipe["compliance"] * (p - st["reference"]))


@inline
def thrust(st, pipe, p):
    """Pressure force in a pipe: integral of A dp from the reference pressure to p [N], A : area of the pipe."""
    x = pipe["compliance"] * (p - st["reference"])
    if abs(x) < 1e-14:
        return pipe["area"] * (p - st["reference"])
    return pipe["area"] * expm1(x) / pipe["compliance"]


@inline
def impedance(st, pipe, value, slope):
    """Impedance rho c = sqrt(K rho) of a pipe [kg/m2/s], 1/K = d ln rho / dp + compliance of the wall.

    value, slope : ln(rho / rho_ref) and d ln rho / dp [1/Pa]
    """
    return sqrt(st["rho"] * exp(value) / (slope + pipe["compliance"]))


@inline
def gauss_integral(half, middle, low, high):
    """Integral of 1 / (rho c) over a pressure interval [m/s], from rho c at three Gauss points.

    half : half of the width of the interval, negative for a fall of pressure [Pa]
    middle, low, high : rho c (density times wave speed) at the three points [kg/m2/s]
    """
    total = 8.0 / middle
    total += 5.0 / low + 5.0 / high
    return half * total / 9.0


@inline
def speed(st, pipe, value, slope):
    """Wave speed sqrt(K / rho) of a pipe [m/s], 1/K = d ln rho / dp + compliance of the wall.

    value, slope : ln(rho / rho_ref) and d ln rho / dp [1/Pa]
    """
    return sqrt(1.0 / ((slope + pipe["compliance"]) * st["rho"] * exp(value)))
