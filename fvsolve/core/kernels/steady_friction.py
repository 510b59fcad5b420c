"""Steady wall friction of pipe flow: Darcy factor and momentum loss."""

from math import log

import numpy as np

from fvsolve.core.kernels.dtypes import FRICTION_HAZEN, FRICTION_ROUGH
from fvsolve.jit import njit

TWO_OVER_LN10 = 2.0 / log(10.0)
EXPONENT = 0.852  # Hazen-Williams: drop as flow to 1.852
# bits of a float64: the mantissa, the number 1
MANTISSA, BITS_OF_ONE = 0x000FFFFFFFFFFFFF, 0x3FF0000000000000
# 0.426 e for every exponent e of a float64
QUOTIENT, REMAINDER = np.divmod(213 * (np.arange(2048) - 1023), 500)
SCALES = np.ldexp(2.0 ** (REMAINDER / 500.0), QUOTIENT)  # 2^(0.426 e)
SCALES[2047] = np.nan  # exponent of inf and NaN
# Chebyshev interpolation polynomial of m^0.426 for a mantissa m = 1.5 + u in [1, 2), in powers of u
C0, C1, C2, C3 = 1.1885429391841094, 0.33754619472829295, -0.06458383859594458, 0.02258999154267194
C4 = -0.009691106002097438
C5 = 0.004618135156910341
C6 = -0.002347050217323954
C7 = 0.0012459456986562145
C8 = -0.0006824009481078974
C9 = 0.0003828835870081093
C10 = -0.00022023842211638112
C11 = 0.00012760184472426772
C12 = -6.871804362162948e-05
C13 = 4.135631024837494e-05
C14 = -3.944523632526398e-05
C15 = 2.3126602172851562e-05
SMOOTHEST = 1e-12  # relative roughness of a smooth wall with a sign
LAMINAR, TURBULENT = 2000.0, 4000.0  # Reynolds numbers; both laws are blended between them


@njit
def factor_turbulent(reynolds, roughness):
    """Darcy factor of Colebrook, 1/sqrt(f) = -2 log10(e/3.7 + 2.51/(Re sqrt(f))), by two steps of Halley's method.

    They start from Haaland's approximation.
    reynolds : Reynolds number Re [-]; roughness : roughness e relative to the diameter [-]
    """
    a, b = roughness / 3.7, 2.51 / reynolds
    x = -0.9 * TWO_OVER_LN10 * log(a**1.11 + 6.9 / reynolds)
    for _ in range(2):
        inner = a + b * x
        t = b / inner
        g, slope = x + TWO_OVER_LN10 * log(inner), 1.0 + TWO_OVER_LN10 * t
        x -= 2.0 * g * slope / (2.0 * slope * slope + g * TWO_OVER_LN10 * t * t)
    return 1.0 / (x * x)


def signed_roughness(roughness: float, model: str) -> float:
    """Relative roughness [-] as the tables of pipes store it: below zero for the friction model swamee-jain."""
    return -max(roughness, SMOOTHEST) if model == "swamee-jain" else roughness


@njit
def factor_swamee_jain(reynolds, roughness):
    """Darcy factor of Swamee and Jain (1976) above Re 4000, by the cubic of Dunlop (1991) from Re 2000 to 4000.

    EPANET computes it so (Rossman et al. 2020, EPANET 2.2 User Manual, chapter 12).
    reynolds : Reynolds number above 2000 [-]; roughness : relative to the diameter [-]
    """
    # Below Re 4000 the cubic needs factor and slope at Re 4000.
    inner = roughness / 3.7 + 5.74 / max(reynolds, TURBULENT) ** 0.9
    root = -TWO_OVER_LN10 * log(inner)
    factor = 1.0 / (root * root)
    if reynolds >= TURBULENT:
        return factor
    slope = factor * (2.0 - 1.8 * TWO_OVER_LN10 * 5.74 / TURBULENT**0.9 / (inner * root))
    x = reynolds / LAMINAR
    second, third = 0.128 - 17.0 * factor + 2.5 * slope, -0.128 + 13.0 * factor - 2.0 * slope
    fourth = 0.032 - 3.0 * factor + 0.5 * slope
    return 7.0 * factor - slope + x * (second + x * (third + x * fourth))


@njit
def factor_times_reynolds(reynolds, roughness):
    """Darcy factor times Reynolds number: 64 below Re 2000, Colebrook above 4000, a smooth blend between.

    This makes the drop a monotone function of the flow. A roughness below zero stands for the factor of Swamee and
    Jain, see `signed_roughness`. roughness : relative to the diameter [-]
    """
    # The product with Re is finite at rest, where the factor itself is infinite.
    if reynolds <= LAMINAR:
        return 64.0
    if roughness < 0.0:
        return factor_swamee_jain(reynolds, -roughness) * reynolds
    turbulent = factor_turbulent(reynolds, roughness) * reynolds
    if reynolds >= TURBULENT:
        return turbulent
    # A blend of fifth degree has continuous slope and curvature at both ends.
    s = (reynolds - LAMINAR) / (TURBULENT - LAMINAR)
    weight = s * s * s * (10.0 + s * (6.0 * s - 15.0))
    return 64.0 + weight * (turbulent - 64.0)


@njit(fastmath={"contract"})
def power_of_square(square):
    """|M|^0.852 = (M^2)^0.426 from `square` = M^2 >= 0, relative error 2e-14 for 1e-150 <= |M| <= 1e150.

    The power of the mantissa in [1, 2) is a Chebyshev interpolation polynomial; that of the exponent is in a table.
    Without branches and calls, a loop over cells is vectorised by four, and a product and its sum are one instruction.
    """
    bits = np.float64(square).view(np.int64)
    u = np.int64((bits & MANTISSA) | BITS_OF_ONE).view(np.float64) - 1.5
    # Two short chains of products, which a processor computes at the same time.
    high = C8 + u * (C9 + u * (C10 + u * (C11 + u * (C12 + u * (C13 + u * (C14 + u * C15))))))
    low = C0 + u * (C1 + u * (C2 + u * (C3 + u * (C4 + u * (C5 + u * (C6 + u * C7))))))
    u *= u
    u *= u
    return (low + high * (u * u)) * SCALES[bits >> 52]


@njit
def drag_hazen(loss, rough, flow):
    """Hazen-Williams friction loss |M| M + rough |M|^0.852 M per length and time [kg/s2] of the mass flow M [kg/s]."""
    return loss * (abs(flow) * flow) + rough * (power_of_square(flow * flow) * flow)


@njit
def drag(kind, loss, rough, roughness, reynolds, flow):
    """Momentum loss by wall and fittings per length and time [kg/s2] of a mass flow M [kg/s].

    It is loss |M| M + rough f(Re) |M| M with the Darcy factor f, or for Hazen-Williams loss |M| M + rough |M|^0.852 M.
    kind : FRICTION_FACTOR (without the second term), FRICTION_ROUGH or FRICTION_HAZEN; flow : M
    roughness : relative to the diameter [-]; reynolds : Reynolds number per mass flow [s/kg]
    """
    if kind == FRICTION_HAZEN:
        return drag_hazen(loss, rough, flow)
    size = abs(flow)
    force = loss * (size * flow)
    if kind == FRICTION_ROUGH:
        # f |M| as (f Re) over Re per mass flow, which is finite at rest.
        force += rough * factor_times_reynolds(reynolds * size, roughness) / reynolds * flow
    return force


@njit
def drag_slope(kind, loss, rough, roughness, reynolds, flow):
    """Derivative of `drag` with respect to the mass flow [1/s], for a positive or negative flow.

    It is a difference quotient where the friction factor depends on roughness, otherwise exact.
    Arguments as for `drag`.
    """
    size = abs(flow)
    slope = 2.0 * loss * size
    if kind == FRICTION_ROUGH:
        # The second term, a Reynolds number of 1e-9, keeps the increment above zero at rest.
        step = 1e-6 * size + 1e-9 / reynolds
        high = drag(kind, 0.0, rough, roughness, reynolds, size + step)
        slope += (high - drag(kind, 0.0, rough, roughness, reynolds, size)) / step
    elif kind == FRICTION_HAZEN:
        slope += (1.0 + EXPONENT) * rough * power_of_square(size * size)
    return slope


@njit
def column_drag(column, flow):
    """Friction term of a rigid column [kg/s2] at a mass flow [kg/s]."""
    kind = column["friction"]
    loss = column["loss"]
    rough = column["rough"]
    return drag(kind, loss, rough, column["roughness"], column["reynolds"], flow)
