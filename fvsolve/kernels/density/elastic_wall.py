"""Mass, area and wave speed of a pipe with elastic wall, d ln(area) = compliance dp, from ln(rho / rho_ref).

value, slope : ln(rho / rho_ref) and d ln rho / dp [1/Pa] at the pressure, by any density law
"""

from math import exp, expm1, sqrt

from fvsolve.jit import inline

GAUSS_POINT = 0.7745966692414834  # sqrt(3/5), outer abscissa of three Gauss points in [-1, 1]


@inline
def density(st, value):
    """rho [kg/m3]."""
    return st["rho"] * exp(value)


@inline
def mass_ratio(st, pipe, m):
    """Mass per length m [kg/m] over that at the reference pressure."""
    return m / (st["rho"] * pipe["area"])


@inline
def mass(st, pipe, p, value, slope):
    """Mass per length m = rho A [kg/m] and dm/dp of a pipe."""
    m = st["rho"] * pipe["area"] * exp(value + pipe["compliance"] * (p - st["reference"]))
    return m, m * (slope + pipe["compliance"])


@inline
def area(st, pipe, p):
    """Area of a pipe [m2]."""
    return pipe["area"] * exp(pipe["compliance"] * (p - st["reference"]))


@inline
def thrust(st, pipe, p):
    """Integral of A dp from the reference pressure [N]."""
    x = pipe["compliance"] * (p - st["reference"])
    if abs(x) < 1e-14:
        return pipe["area"] * (p - st["reference"])
    return pipe["area"] * expm1(x) / pipe["compliance"]


@inline
def impedance(st, pipe, value, slope):
    """rho c = sqrt(K rho) [kg/m2/s]."""
    return sqrt(st["rho"] * exp(value) / (slope + pipe["compliance"]))


@inline
def gauss_integral(half, middle, low, high):
    """Integral of 1 / (rho c) over a pressure interval of width 2 `half`, from rho c at three Gauss points [m/s]."""
    total = 8.0 / middle
    total += 5.0 / low + 5.0 / high
    return half * total / 9.0


@inline
def speed(st, pipe, value, slope):
    """Wave speed sqrt(K / rho), 1/K = d ln rho / dp + compliance [m/s]."""
    return sqrt(1.0 / ((slope + pipe["compliance"]) * st["rho"] * exp(value)))
