"""Density law `mixture`: liquid with free gas, and vapour if the law has a floor, as a single barotropic law.

x = p - floor > 0 is the pressure of the gas; the floor is the vapour pressure or 0. Volumes are divided by the volume
of liquid at the reference pressure. beta is the bulk modulus of the liquid, `gas` the amount of gas, `saturation` the
gas pressure at which all gas is dissolved:

    rho_ref / rho = 1 - (p - p_ref) / beta + gas (x^-k - x^(1-k) / saturation),   k = 1 / (gas exponent)

There is free gas while x < saturation (it dissolves by Henry's law; an infinite saturation means no dissolution). The
area is linear in pressure, A = A_ref (1 + compliance (p - p_ref)). So with k = 1 the pressure of a given mass is the
root of a quadratic.
"""

from math import exp, log, sqrt

from fvsolve.core.kernels.calls import law_njit, prevent_inlining
from fvsolve.jit import inline


@law_njit
def free_gas(st, x):
    """(volume of free gas over volume of liquid [-], its decrease with pressure [1/Pa]) at a gas pressure x [Pa].

    The volume of liquid is that at the reference pressure.
    """
    # All gas is dissolved at this pressure.
    if x >= st["saturation"]:
        return 0.0, 0.0
    k, share = st["gas_power"], x / st["saturation"]
    size = st["gas"] / x if k == 1.0 else st["gas"] * x**-k
    return size * (1.0 - share), size / x * (k + (1.0 - k) * share)


@law_njit
def relative_volume(st, p):
    """(rho_ref / rho, its decrease with pressure [1/Pa]) of the mixture at the pressure p [Pa], with density rho."""
    prevent_inlining()
    size, fall = free_gas(st, p - st["floor"])
    return 1.0 - (p - st["reference"]) / st["beta"] + size, 1.0 / st["beta"] + fall


@law_njit
def gas_integral(st, x):
    """Integral of the volume of free gas by `free_gas` over the gas pressure up to x [Pa], except for a constant."""
    k = st["gas_power"]
    at = min(x, st["saturation"])
    s = st["saturation"]
    # Integral of x^-k (1 - x / s), of which the first term is a logarithm for k = 1.
    if k == 1.0:
        return st["gas"] * (log(at) - at / s)
    return st["gas"] * at ** (1.0 - k) * (1.0 / (1.0 - k) - at / s / (2.0 - k))


@inline
def log_density(st, floats, p):
    """(ln(rho / rho_ref), d ln rho / dp [1/Pa]) at the pressure p [Pa], with density rho."""
    size, fall = relative_volume(st, p)
    return -log(size), fall / size


@inline
def density(st, floats, p):
    """Density rho [kg/m3] at the pressure p [Pa]."""
    return st["rho"] / relative_volume(st, p)[0]


@law_njit
def enthalpy(st, floats, p):
    """Specific enthalpy h at the pressure p: integral of dp / rho from the reference pressure [J/kg]."""
    prevent_inlining()
    dp, floor = p - st["reference"], st["floor"]
    gas = gas_integral(st, p - floor) - gas_integral(st, st["reference"] - floor)
    return (dp * (1.0 - 0.5 * dp / st["beta"]) + gas) / st["rho"]


@law_njit
def pressure_of_enthalpy(st, floats, h):
    """Pressure p [Pa] at which the specific enthalpy is h [J/kg], by Newton.

    Newton's method is applied to p, or to the logarithm of the gas pressure where a step would reduce the gas pressure
    to a fifth or less.
    """
    prevent_inlining()
    floor, beta = st["floor"], st["beta"]
    lift = h * st["rho"]
    x = st["reference"] - floor
    # Newton starts from liquid without gas: h rho_ref = dp - dp^2 / (2 beta), solved for dp.
    if lift > 0.0:
        x += 2.0 * lift / (1.0 + sqrt(max(0.0, 1.0 - 2.0 * lift / beta)))
    for _ in range(100):
        p = x + floor
        # dh/dp = 1 / rho
        step = (enthalpy(st, floats, p) - h) * st["rho"] / relative_volume(st, p)[0]
        x = x - step if step < 0.8 * x else x * exp(max(-step / x, -700.0))
        if abs(step) <= 1e-15 * abs(p) or abs(step) <= 1e-14 * x:
            break
    return x + floor


@inline
def gas_root(st, compliance, share, slope, rest):
    """Gas pressure x [Pa] with share (1 - dp / beta + slope / x + rest) = 1 + compliance dp, dp = x + floor - p_ref.

    It is the positive root of a quadratic, for a relative volume of gas slope / x + rest; at least 0 for slope = 0.
    share : mass over that of liquid at the reference state; compliance : of the wall [1/Pa]; beta : bulk modulus
    """
    low = st["reference"] - st["floor"]
    a = compliance + share / st["beta"]
    b = 1.0 - compliance * low - share * (1.0 + low / st["beta"] + rest)
    # Both forms of the root are equal; the one used adds numbers of the same sign.
    root = sqrt(b * b + 4.0 * a * share * slope)
    return 0.5 * (root - b) / a if b < 0.0 else 2.0 * share * slope / (b + root)


@law_njit
def pressure_of_mass_ratio(st, compliance, share):
    """Pressure [Pa] of a pipe or a vessel, from its mass over that of liquid in the reference state, `share` [-].

    compliance : relative area change of the wall per pressure [1/Pa], 0 for a vessel
    If the gas is not isothermal, its tangent in 1 / x replaces it, x : gas pressure, and the root is iterated until it
    is constant. This converges because the volume of gas is concave in 1 / x.
    """
    prevent_inlining()
    floor = st["floor"]
    gas = st["gas"]
    saturation = st["saturation"]
    x = (
        gas_root(st, compliance, share, gas, -gas / saturation)
        if st["gas_power"] == 1.0
        else saturation
    )
    if x >= saturation and saturation < 1e300:
        # All gas may be dissolved: then the root without gas lies above the saturation pressure.
        x = gas_root(st, compliance, share, 0.0, 0.0)
        if x >= saturation:
            return x + floor
    if st["gas_power"] == 1.0:
        return x + floor
    x = min(st["reference"] - floor, saturation)
    for _ in range(60):
        size, fall = free_gas(st, min(x, saturation * (1.0 - 1e-15)))
        before, slope = x, fall * x * x
        x = min(gas_root(st, compliance, share, slope, size - slope / x), saturation)
        if abs(x - before) <= 1e-15 * (x + 1.0 / (share * (1.0 / st["beta"] + fall))):  # rounding
            break
    return x + floor


@inline
def pressure_of_log(st, floats, compliance, q):
    """Pressure [Pa] at which ln(rho / rho_ref) + ln(A / A_ref) is q, with density rho and area A of the pipe.

    compliance : relative area change of the wall per pressure [1/Pa]
    """
    return pressure_of_mass_ratio(st, compliance, exp(q))


@inline
def pressure_of_mass(st, floats, pipe, m):
    """Pressure [Pa] of a pipe that contains the mass per length m [kg/m]."""
    return pressure_of_mass_ratio(st, pipe["compliance"], m / (st["rho"] * pipe["area"]))


@inline
def area_ratio(st, compliance, p):
    """Area of a pipe at the pressure p over its area at the reference pressure [-]."""
    return 1.0 + compliance * (p - st["reference"])


@inline
def wall_area(st, floats, pipe, p):
    """Area of a pipe at the pressure p [m2], linear in p."""
    return pipe["area"] * area_ratio(st, pipe["compliance"], p)


@inline
def thrust(st, floats, pipe, p):
    """Pressure force in a pipe: integral of A dp from the reference pressure to p [N], A : area of the pipe."""
    x = pipe["compliance"] * (p - st["reference"])
    return pipe["area"] * (p - st["reference"]) * (1.0 + 0.5 * x)


@law_njit
def mass_of_pressure(st, floats, pipe, p):
    """Mass per length m = rho A [kg/m] and dm/dp [kg/m/Pa] of a pipe at the pressure p, with density rho and area A."""
    prevent_inlining()
    size, fall = relative_volume(st, p)
    stretch = area_ratio(st, pipe["compliance"], p)
    m = st["rho"] * pipe["area"] * stretch / size
    return m, m * (fall / size + pipe["compliance"] / stretch)


@law_njit
def impedance(st, floats, pipe, p):
    """Impedance rho c = sqrt(rho / (d ln rho / dp + d ln A / dp)) of a pipe at the pressure p [kg/m2/s].

    rho : density, c : wave speed, A : area
    """
    prevent_inlining()
    size, fall = relative_volume(st, p)
    return sqrt(
        st["rho"] / (fall + size * pipe["compliance"] / area_ratio(st, pipe["compliance"], p))
    )


# Abscissas in (0, 1) and weights of the upper four of eight Gauss points; the lower four are symmetric (Abramowitz and
# Stegun 25.4).
GAUSS_POINTS = (0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363)
GAUSS_WEIGHTS = (0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763)


@law_njit
def velocity_change_panel(st, floats, pipe, p_from, p_to):
    """Integral of dp / (rho c) in a pipe from p_from to p_to [m/s] by eight Gauss points; rho c as in `impedance`.

    It is accurate if the gas pressures differ by a factor of two at most, or without free gas between them.
    """
    middle = 0.5 * (p_from + p_to)
    half = 0.5 * (p_to - p_from)
    total = 0.0
    for i in range(4):
        far = GAUSS_POINTS[i] * half
        high = impedance(st, floats, pipe, middle + far)
        low = impedance(st, floats, pipe, middle - far)
        total += GAUSS_WEIGHTS[i] * (1.0 / high + 1.0 / low)
    return half * total


@law_njit
def velocity_change(st, floats, pipe, p_from, p_to):
    """Integral of dp / (rho c) in a pipe from p_from to p_to [m/s] in panels; rho c as in `impedance`.

    With free gas the gas pressure at most doubles in a panel, and a panel ends where all gas is dissolved. A single
    panel covers the pressures above.
    """
    prevent_inlining()
    low, high = min(p_from, p_to), max(p_from, p_to)
    sign = 1.0 if p_to >= p_from else -1.0
    floor, total = st["floor"], 0.0
    for _ in range(200):
        x = low - floor
        end = min(high, floor + 2.0 * x)
        # The integrand has a kink where the last gas dissolves, which a panel must not contain.
        if x < st["saturation"]:
            end = min(end, floor + st["saturation"])
        else:
            end = high
        total += velocity_change_panel(st, floats, pipe, low, end)
        low = end
        if low >= high:
            break
    return sign * total


@inline
def local_speed(st, floats, pipe, p):
    """Wave speed of a pipe at the pressure p [m/s]."""
    return impedance(st, floats, pipe, p) * relative_volume(st, p)[0] / st["rho"]
