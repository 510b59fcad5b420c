"""The Riemann problem of a pipe under the law `mixture`: two states meet, a wave runs to either side. Knows no cells.

Across a shock [v]^2 = [F] [-1 / m], F the integral of A dp (Rankine-Hugoniot for mass and momentum); across a
rarefaction dv = dp / (rho c). The law is convex (1 / m falls ever less steeply with F), so there are no other waves.
The pressure between the waves stays above the law's floor however fast the sides part: there a cavity opens.
A side is (pressure p [Pa], mass per length m [kg/m], F [N], m c [kg/s], the integral of dp / (rho c) up to p [m/s]).
"""

from math import exp, log, sqrt

from fvsolve.jit import njit
from fvsolve.kernels.density.mixture import impedance, mass_of_pressure, velocity_change, wall_stretch

NEAR = 1e-3  # of the gas pressure: smaller jumps are taken by the mean of 1 / (m c), lest differences cancel
LEAST = 1e-10  # gas pressure that is a vacuum [Pa]
FALL = 0.03  # of the gas pressure, where Newton would pass the floor
UNBOUNDED = 1e300


@njit(forceinline=True)
def plain_integral(st, compliance, x):
    """Integral of sqrt((a + b / x + gas / x^2) / rho_ref) dx [m/s], dp / (rho c) but for the wall's own stretch.

    a = 1 / beta + compliance, b = compliance gas; closed form by sqrt(R), R = a x^2 + b x + gas.
    """
    a, gas = 1.0 / st["beta"] + compliance, st["gas"]
    b = compliance * gas
    root, side, base = sqrt((a * x + b) * x + gas), sqrt(a), sqrt(gas)
    found = root + 0.5 * b / side * log(2.0 * (side * root + a * x) + b)
    return (found - base * log((2.0 * (gas + base * root) + b * x) / x)) / sqrt(st["rho"])


@njit
def side_at(st, floats, pipe, p):
    """The side of a pipe at a pressure."""
    m, dm = mass_of_pressure(st, floats, pipe, p)
    over = p - st["reference"]
    force = pipe["area"] * over * (1.0 + 0.5 * pipe["compliance"] * over)
    area = pipe["area"] * wall_stretch(st, pipe["compliance"], p)
    integral = plain_integral(st, pipe["compliance"], p - st["floor"]) if is_plain(st) else 0.0
    return p, m, force, m * sqrt(area / dm), integral


@njit(forceinline=True)
def is_plain(st):
    """Whether the gas is isothermal and does not dissolve."""
    return st["gas_power"] == 1.0 and st["saturation"] > UNBOUNDED


@njit
def lead(st, floats, pipe, p):
    """The integrand of dp / (rho c) over that of `plain_integral` at a pressure: one, but for the wall's stretch."""
    x = p - st["floor"]
    plain = 1.0 / st["beta"] + pipe["compliance"] + st["gas"] / x * (pipe["compliance"] + 1.0 / x)
    return sqrt(st["rho"] / plain) / impedance(st, floats, pipe, p)


@njit
def thinned(st, floats, pipe, low, high):
    """Integral of dp / (rho c) between two sides [m/s]."""
    if not is_plain(st):
        return velocity_change(st, floats, pipe, low[0], high[0])
    return (high[4] - low[4]) * 0.5 * (lead(st, floats, pipe, low[0]) + lead(st, floats, pipe, high[0]))


@njit
def jump(st, floats, pipe, side, to):
    """(velocity [m/s] that a wave takes off on its way from one side to another, its slope over the pressure there)."""
    area = pipe["area"] * wall_stretch(st, pipe["compliance"], to[0])
    if abs(to[0] - side[0]) <= NEAR * (to[0] - st["floor"]):
        return (to[2] - side[2]) * 0.5 * (1.0 / side[3] + 1.0 / to[3]), area / to[3]
    if to[0] < side[0]:
        return -thinned(st, floats, pipe, to, side), area / to[3]
    force, thin = to[2] - side[2], 1.0 / side[1] - 1.0 / to[1]
    change = sqrt(force * thin)
    return change, 0.5 * area * (thin + force / (to[3] * to[3])) / change


@njit
def star(st, floats, pipe, left, v_l, right, v_r):
    """(the side between the waves of two states, its velocity after the left and after the right wave), by Newton.

    Both velocities are one, but where the sides part so fast that nothing is left between them.
    """
    floor, low, high = st["floor"], st["floor"], UNBOUNDED
    both = right[3] * left[0] + left[3] * right[0] + left[3] * right[3] * (v_l - v_r) / pipe["area"]
    p = both / (left[3] + right[3])
    if p <= floor:
        p = floor + LEAST
    for _ in range(100):
        middle = side_at(st, floats, pipe, p)
        take, rise_l = jump(st, floats, pipe, left, middle)
        give, rise_r = jump(st, floats, pipe, right, middle)
        gap, before = (v_l - take) - (v_r + give), p
        if gap > 0.0:
            low = p
        else:
            high = p
        p += gap / (rise_l + rise_r)
        if abs(p - before) <= 1e-11 * (before - floor) + 1e-16 * before or (gap <= 0.0 and before - floor <= LEAST):
            return middle, v_l - take, v_r + give
        if p <= low or p >= high:
            p = between(floor, low, high, before)
    return middle, v_l - take, v_r + give


@njit(forceinline=True)
def between(floor, low, high, p):
    """A pressure between two bounds, one of which may not be known yet, by ratio of the gas pressures."""
    if low <= floor:
        return floor + max(FALL * (p - floor), LEAST)
    if high >= UNBOUNDED:
        return floor + (p - floor) / FALL
    return floor + sqrt((low - floor) * (high - floor))


@njit
def sonic(st, floats, pipe, side, v0, end):
    """(side, velocity) in the rarefaction from a side to `end` where the velocity is that of sound, by bisection."""
    floor = st["floor"]
    low, high = log(end[0] - floor), log(side[0] - floor)
    found, v = side, v0
    for _ in range(50):
        middle = 0.5 * (low + high)
        found = side_at(st, floats, pipe, floor + exp(middle))
        v = v0 - jump(st, floats, pipe, side, found)[0]
        if v > found[3] / found[1]:
            low = middle
        else:
            high = middle
        if high - low < 1e-12:
            break
    return found, v


@njit
def beside(st, floats, pipe, side, v0, end, v):
    """(m, v, F) at a face which the wave from a side to `end` is near; it runs left and leaves v >= 0 behind it."""
    if end[0] > side[0]:
        if end[1] * v >= side[1] * v0 and end[1] > side[1]:
            return side[1], v0, side[2]
        return end[1], v, end[2]
    if v0 * side[1] >= side[3]:
        return side[1], v0, side[2]
    if v * end[1] > end[3]:
        end, v = sonic(st, floats, pipe, side, v0, end)
    return end[1], v, end[2]


@njit
def face_flux(st, floats, pipe, p_l, v_l, p_r, v_r):
    """Flux of mass [kg/s] and of momentum M^2 / m + F [N] between two states, pressure [Pa] and velocity [m/s]."""
    left, right = side_at(st, floats, pipe, p_l), side_at(st, floats, pipe, p_r)
    middle, after, ahead = star(st, floats, pipe, left, v_l, right, v_r)
    m, v, force = middle[1], 0.5 * (after + ahead), middle[2]
    if after >= 0.0 and v >= 0.0:
        m, v, force = beside(st, floats, pipe, left, v_l, middle, after)
    elif ahead <= 0.0 and v <= 0.0:
        m, v, force = beside(st, floats, pipe, right, -v_r, middle, -ahead)
        v = -v
    return m * v, m * v * v + force
