"""Riemann problem of a pipe under the density law `mixture`: two states, and a wave to either side.

Across a shock [v]^2 = [F] [-1 / m], with brackets for the differences of velocity v, pressure integral F (of A dp) and
1 over mass per length m (Rankine-Hugoniot for mass and momentum); across a rarefaction dv = dp / (rho c). The law is
convex (1 / m falls ever less steeply with F), so there are no other waves. The pressure between the waves stays above
the floor pressure of the law however fast the states part: a cavity opens there. A state is a tuple of pressure p [Pa],
mass per length m [kg/m], F [N], m c [kg/s] with sound speed c, and the integral of dp / (rho c) up to p [m/s].
"""

from math import exp, log, sqrt

from fvsolve.core.kernels.density.mixture_law import (
    area_ratio,
    impedance,
    mass_of_pressure,
    velocity_change,
)
from fvsolve.jit import njit

# fraction of the gas pressure; smaller jumps use the mean of 1 / (m c), because differences would cancel
NEAR = 1e-3
LEAST = 1e-10  # gas pressure of a vacuum [Pa]
FALL = 0.03  # factor on the gas pressure for a step of Newton that would pass the floor
UNBOUNDED = 1e300


@njit(forceinline=True)
def isothermal_integral(st, compliance, x):
    """Integral of dp / (rho c) up to the gas pressure x [m/s], for isothermal gas and without the stretch of the wall.

    It is the integral of sqrt((a + b / x + gas / x^2) / rho_ref) dx, with a = 1 / beta + compliance, b = compliance
    gas, wall compliance [1/Pa] and `gas` of the settings. The closed form contains sqrt(a x^2 + b x + gas).
    """
    a, gas = 1.0 / st["beta"] + compliance, st["gas"]
    b = compliance * gas
    root = sqrt((a * x + b) * x + gas)
    side = sqrt(a)
    base = sqrt(gas)
    value = root + 0.5 * b / side * log(2.0 * (side * root + a * x) + b)
    return (value - base * log((2.0 * (gas + base * root) + b * x) / x)) / sqrt(st["rho"])


@njit
def state_at(st, floats, pipe, p):
    """State of a pipe at the pressure p [Pa], under the density law `mixture`.

    It is the tuple (pressure [Pa], mass per length m [kg/m], integral of A dp [N], m c [kg/s], integral of dp / (rho c)
    [m/s]), with the wave speed c. The last integral is 0 if the gas dissolves or is not isothermal.
    """
    m, dm = mass_of_pressure(st, floats, pipe, p)
    over = p - st["reference"]
    force = pipe["area"] * over * (1.0 + 0.5 * pipe["compliance"] * over)
    area = pipe["area"] * area_ratio(st, pipe["compliance"], p)
    integral = (
        isothermal_integral(st, pipe["compliance"], p - st["floor"]) if is_isothermal(st) else 0.0
    )
    return p, m, force, m * sqrt(area / dm), integral


@njit(forceinline=True)
def is_isothermal(st):
    """True if the gas is isothermal and does not dissolve."""
    return st["gas_power"] == 1.0 and st["saturation"] > UNBOUNDED


@njit
def stretch_factor(st, floats, pipe, p):
    """Ratio of 1 / (rho c) to the integrand of `isothermal_integral` at the pressure p [Pa]; 1 for a rigid wall.

    rho : density; c : wave speed
    """
    x = p - st["floor"]
    plain = 1.0 / st["beta"] + pipe["compliance"] + st["gas"] / x * (pipe["compliance"] + 1.0 / x)
    return sqrt(st["rho"] / plain) / impedance(st, floats, pipe, p)


@njit
def rarefaction_change(st, floats, pipe, low, high):
    """Integral of dp / (rho c) between two states [m/s], the velocity change in a rarefaction.

    rho : density; c : wave speed; low, high : states of `state_at`
    """
    if not is_isothermal(st):
        return velocity_change(st, floats, pipe, low[0], high[0])
    return (
        (high[4] - low[4])
        * 0.5
        * (stretch_factor(st, floats, pipe, low[0]) + stretch_factor(st, floats, pipe, high[0]))
    )


@njit
def wave_jump(st, floats, pipe, side, to):
    """(velocity that a wave subtracts on its way from state `side` to state `to` [m/s], its slope [m/s/Pa]).

    The slope is the derivative with respect to the pressure of `to`. side, to : states of `state_at`
    """
    area = pipe["area"] * area_ratio(st, pipe["compliance"], to[0])
    if abs(to[0] - side[0]) <= NEAR * (to[0] - st["floor"]):
        return (to[2] - side[2]) * 0.5 * (1.0 / side[3] + 1.0 / to[3]), area / to[3]
    # The pressure falls: a rarefaction, with the Riemann integral; otherwise a shock.
    if to[0] < side[0]:
        return -rarefaction_change(st, floats, pipe, to, side), area / to[3]
    force, contraction = to[2] - side[2], 1.0 / side[1] - 1.0 / to[1]
    change = sqrt(force * contraction)
    return change, 0.5 * area * (contraction + force / (to[3] * to[3])) / change


@njit
def star_state(st, floats, pipe, left, v_l, right, v_r):
    """(state between the two waves of a Riemann problem, its velocity behind the left wave, and behind the right wave).

    left, right : states of `state_at`; v_l, v_r : their velocities [m/s]
    The solution is found by Newton. Both resulting velocities [m/s] are equal, except where the states part so fast
    that a vacuum remains between them.
    """
    floor = st["floor"]
    low = st["floor"]
    high = UNBOUNDED
    # The acoustic solution, with constant impedances, is the first value.
    both = right[3] * left[0] + left[3] * right[0] + left[3] * right[3] * (v_l - v_r) / pipe["area"]
    p = both / (left[3] + right[3])
    if p <= floor:
        p = floor + LEAST
    for _ in range(100):
        middle = state_at(st, floats, pipe, p)
        change_l, rise_l = wave_jump(st, floats, pipe, left, middle)
        change_r, rise_r = wave_jump(st, floats, pipe, right, middle)
        gap, before = (v_l - change_l) - (v_r + change_r), p
        # The gap of velocities falls as p rises, so its sign bounds the root.
        if gap > 0.0:
            low = p
        else:
            high = p
        p += gap / (rise_l + rise_r)
        if abs(p - before) <= 1e-11 * (before - floor) + 1e-16 * before or (
            gap <= 0.0 and before - floor <= LEAST
        ):
            return middle, v_l - change_l, v_r + change_r
        if p <= low or p >= high:
            p = intermediate_pressure(floor, low, high, before)
    return middle, v_l - change_l, v_r + change_r


@njit(forceinline=True)
def intermediate_pressure(floor, low, high, p):
    """Pressure between the bounds `low` and `high` [Pa]: geometric mean of their distances from the floor pressure.

    One of the bounds may be unknown; then p - floor is multiplied or divided by the factor FALL.
    floor : floor pressure of the density law; p : present pressure [Pa]
    """
    if low <= floor:
        return floor + max(FALL * (p - floor), LEAST)
    if high >= UNBOUNDED:
        return floor + (p - floor) / FALL
    return floor + sqrt((low - floor) * (high - floor))


@njit
def sonic_state(st, floats, pipe, side, v0, end):
    """(state, velocity [m/s]) inside a rarefaction, where the flow has the speed of sound, by bisection.

    side, v0 : state of `state_at` before the rarefaction, and its velocity [m/s]; end : state behind it
    """
    floor = st["floor"]
    # Bisection of the logarithm: the gas pressure may fall by orders of magnitude in a rarefaction.
    low, high = log(end[0] - floor), log(side[0] - floor)
    state, v = side, v0
    for _ in range(50):
        middle = 0.5 * (low + high)
        state = state_at(st, floats, pipe, floor + exp(middle))
        v = v0 - wave_jump(st, floats, pipe, side, state)[0]
        if v > state[3] / state[1]:
            low = middle
        else:
            high = middle
        if high - low < 1e-12:
            break
    return state, v


@njit
def sample_wave(st, floats, pipe, side, v0, end, v):
    """(mass per length m [kg/m], velocity [m/s], pressure integral F [N]) at a face from the wave between two states.

    side, v0 : state of `state_at` before the wave, and its velocity; end, v : state and velocity behind the wave
    The wave travels to the left; the velocity v behind it is not negative. F : integral of A dp
    """
    if end[0] > side[0]:
        # From a shock speed of zero on (jump of mass flow over jump of mass), the face lies before the shock.
        if end[1] * v >= side[1] * v0 and end[1] > side[1]:
            return side[1], v0, side[2]
        return end[1], v, end[2]
    # The flow before the wave is supersonic, so the whole rarefaction is swept past the face.
    if v0 * side[1] >= side[3]:
        return side[1], v0, side[2]
    # The rarefaction contains the face, where the flow has exactly the speed of sound.
    if v * end[1] > end[3]:
        end, v = sonic_state(st, floats, pipe, side, v0, end)
    return end[1], v, end[2]


@njit
def face_flux(st, floats, pipe, p_l, v_l, p_r, v_r):
    """(flux of mass M [kg/s], flux of momentum M^2 / m + F [N]) at the face between a left and a right state.

    p_l, v_l, p_r, v_r : pressures [Pa] and velocities [m/s] of both states
    m : mass per length [kg/m]; F : integral of A dp [N]
    """
    left, right = state_at(st, floats, pipe, p_l), state_at(st, floats, pipe, p_r)
    middle, after, ahead = star_state(st, floats, pipe, left, v_l, right, v_r)
    # Both velocities agree but for the error of Newton, except at a vacuum.
    m = middle[1]
    v = 0.5 * (after + ahead)
    force = middle[2]
    if after >= 0.0 and v >= 0.0:
        m, v, force = sample_wave(st, floats, pipe, left, v_l, middle, after)
    elif ahead <= 0.0 and v <= 0.0:
        m, v, force = sample_wave(st, floats, pipe, right, -v_r, middle, -ahead)
        # The right wave was sampled as its mirror image, a wave to the left.
        v = -v
    return m * v, m * v * v + force
