"""Wall friction of a pipe flow. Knows Reynolds numbers and factors; knows no cells."""

from math import log

from fvsolve.jit import njit
from fvsolve.kernels.records import FRICTION_HAZEN, FRICTION_ROUGH

TWO_OVER_LN10 = 2.0 / log(10.0)
LAMINAR, TURBULENT = 2000.0, 4000.0  # Reynolds numbers between which the two laws are blended


@njit
def factor_turbulent(reynolds, roughness):
    """Darcy factor of Colebrook, 1/sqrt(f) = -2 log10(e/3.7 + 2.51/(Re sqrt(f))), by two steps of Halley from Haaland.

    reynolds [-], roughness relative to the diameter [-].
    """
    a, b = roughness / 3.7, 2.51 / reynolds
    x = -0.9 * TWO_OVER_LN10 * log(a**1.11 + 6.9 / reynolds)
    for _ in range(2):
        inner = a + b * x
        t = b / inner
        g, slope = x + TWO_OVER_LN10 * log(inner), 1.0 + TWO_OVER_LN10 * t
        x -= 2.0 * g * slope / (2.0 * slope * slope + g * TWO_OVER_LN10 * t * t)
    return 1.0 / (x * x)


@njit
def factor_times_reynolds(reynolds, roughness):
    """f Re: 64 below Re 2000, Colebrook above 4000, a smooth step between, so that the drop stays monotone."""
    if reynolds <= LAMINAR:
        return 64.0
    turbulent = factor_turbulent(reynolds, roughness) * reynolds
    if reynolds >= TURBULENT:
        return turbulent
    s = (reynolds - LAMINAR) / (TURBULENT - LAMINAR)
    weight = s * s * s * (10.0 + s * (6.0 * s - 15.0))
    return 64.0 + weight * (turbulent - 64.0)


@njit
def drag(kind, loss, rough, roughness, reynolds, flow):
    """Momentum that wall and fittings take, per length and time [kg/s2], of a mass flow [kg/s].

    loss |M| M + rough f(Re) |M| M, or for Hazen-Williams loss |M| M + rough |M|^0.852 M.
    """
    size = abs(flow)
    force = loss * (size * flow)
    if kind == FRICTION_ROUGH:
        force += rough * factor_times_reynolds(reynolds * size, roughness) / reynolds * flow
    elif kind == FRICTION_HAZEN:
        force += rough * size**0.852 * flow
    return force


@njit
def drag_slope(kind, loss, rough, roughness, reynolds, flow):
    """d drag / d flow [1/s] by the law's exponent; exact but for the blend and the factor's own slope."""
    size = abs(flow)
    slope = 2.0 * loss * size
    if kind == FRICTION_ROUGH:
        step = 1e-6 * size + 1e-9 / reynolds
        high = drag(kind, 0.0, rough, roughness, reynolds, size + step)
        slope += (high - drag(kind, 0.0, rough, roughness, reynolds, size)) / step
    elif kind == FRICTION_HAZEN:
        slope += 1.852 * rough * size**0.852
    return slope
