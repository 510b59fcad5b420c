"""Hill charts of turbines at any speed, flow and opening.

With n = omega / speed, u = flow / capacity: root = S(n, u), H = S |S| [m], straight lines of n and u between rays, so
that at 1 m a curve is straight lines between its points; torque = H T, T straight along these lines at 1 m. Between
openings S and T of a ray, and the capacity, are straight in the opening. Below the least the curve in n and u stays and
its capacity goes to 0 with the opening, and so does the torque, to that of a runner behind shut vanes.
"""

from math import atan2, copysign, pi, sqrt

from fvsolve.jit import njit
from fvsolve.kernels.valves import LEAST

LEAST_ROOT = 0.1  # of what weighs a ray's torque; greater wherever a chart gives points
NEAR = 1e-9  # change of flow, relative, over which a chord is a tangent

# Numbers of a chart: how many curves and rays, speed [rad/s] and flow [m3/s] at 1 m, torque behind shut vanes over
# omega |omega| [N m s2]; then of each curve opening, capacity, least and greatest angle given; of each ray angle, its
# cosine and sine; of each curve and ray the root, then T [N].
CURVES, RAYS, SPEED, FLOW, STILL, OWN = 0, 1, 2, 3, 4, 5


@njit
def shared(one, two, root_one, root_two, torque_one, torque_two):
    """T at shares of two rays, straight along the line between their points at 1 m."""
    first, second = one * max(root_one, LEAST_ROOT), two * max(root_two, LEAST_ROOT)
    return (first * torque_one + second * torque_two) / (first + second)


@njit
def between(floats, at, opening):
    """(curve at or below an opening, share of the next, share of the curve itself: below 1 under the least)."""
    many = int(floats[at + CURVES])
    if opening <= floats[at + OWN]:
        return 0, 0.0, opening / floats[at + OWN]
    for k in range(1, many):
        low, high = floats[at + OWN + k - 1], floats[at + OWN + k]
        if opening <= high:
            return k - 1, (opening - low) / (high - low), 1.0
    return many - 1, 0.0, 1.0


@njit
def mixed(floats, first, stride, k, share):
    """What stands at `first`, of curve k and, by its share, of the next."""
    value = floats[first + k * stride]
    if share > 0.0:
        value += share * (floats[first + (k + 1) * stride] - value)
    return value


@njit
def capacity(floats, at, opening):
    """Flow of u = 1 at a head of 1 m, over `flow`."""
    k, share, least = between(floats, at, opening)
    return least * mixed(floats, at + OWN + int(floats[at + CURVES]), 1, k, share)


@njit
def ray_below(floats, first, many, angle):
    """Index of the last of ascending angles at or below `angle`."""
    low, high = 0, many - 1
    while high - low > 1:
        middle = (low + high) // 2
        if floats[first + middle] <= angle:
            low = middle
        else:
            high = middle
    return low


@njit
def turned(n, u):
    """Angle of (n, u), from -pi / 2 to 3 pi / 2."""
    angle = atan2(u, n)
    return angle + 2.0 * pi if angle < -0.5 * pi else angle


@njit
def chart_at(floats, at, opening, omega, flow):
    """(root of head, its slopes over omega and flow, torque [N m], its slope over omega) at an opening above 0."""
    curves, rays = int(floats[at + CURVES]), int(floats[at + RAYS])
    k, share, least = between(floats, at, opening)
    wide = floats[at + FLOW] * least * mixed(floats, at + OWN + curves, 1, k, share)
    n, u = omega / floats[at + SPEED], flow / wide
    first = at + OWN + 4 * curves
    i = ray_below(floats, first, rays, turned(n, u))
    a, b, c, d = floats[first + rays + i], floats[first + 2 * rays + i], 0.0, 0.0
    c, d = floats[first + rays + i + 1], floats[first + 2 * rays + i + 1]
    turn = a * d - b * c
    one, two = (n * d - u * c) / turn, (a * u - b * n) / turn
    roots = first + 3 * rays + i
    torques = roots + curves * rays
    root_one, root_two = mixed(floats, roots, rays, k, share), mixed(floats, roots + 1, rays, k, share)
    t_one, t_two = mixed(floats, torques, rays, k, share), mixed(floats, torques + 1, rays, k, share)
    root = one * root_one + two * root_two
    by_n, by_u = (root_one * d - root_two * b) / turn, (root_two * a - root_one * c) / turn
    torque, steep = 0.0, 0.0
    if root > 0.0:
        t = shared(one, two, root_one, root_two, t_one, t_two)
        first, second = max(root_one, LEAST_ROOT), max(root_two, LEAST_ROOT)
        bends = (first * d * (t_one - t) - second * b * (t_two - t)) / (turn * (first * one + second * two))
        torque, steep = root * root * t, 2.0 * root * by_n * t + root * root * bends
    speed, still = floats[at + SPEED], floats[at + STILL]
    torque = least * torque + (1.0 - least) * still * abs(omega) * omega
    steep = least * steep / speed + 2.0 * (1.0 - least) * still * abs(omega)
    return root, by_n / speed, by_u / wide, torque, steep


@njit
def chart_torque(floats, at, opening, omega, flow):
    """Torque on the shaft, positive forward [N m]; with shut vanes, the drag of the water."""
    if opening <= 0.0:
        return floats[at + STILL] * abs(omega) * omega
    return chart_at(floats, at, opening, omega, flow)[3]


@njit
def chart_head(floats, at, opening, omega, flow):
    """(head taken [m], its slope over flow [s/m2]) at an opening above 0."""
    root, _, by_flow, _, _ = chart_at(floats, at, opening, omega, flow)
    return root * abs(root), 2.0 * abs(root) * by_flow


@njit
def is_outside(floats, at, opening, omega, flow):
    """True if it works at an angle outside the chart."""
    curves = int(floats[at + CURVES])
    if opening <= 0.0:
        return False
    k, share, _ = between(floats, at, opening)
    wide = floats[at + FLOW] * capacity(floats, at, opening)
    angle, own = turned(omega / floats[at + SPEED], flow / wide), at + OWN + 2 * curves
    return not mixed(floats, own, 1, k, share) <= angle <= mixed(floats, own + curves, 1, k, share)


@njit
def greatest(floats, at, opening, weight, drop):
    """A flow beyond those at a drop and a common speed [m3/s]."""
    return floats[at + FLOW] * capacity(floats, at, opening) * (1.0 + sqrt(abs(drop) / weight))


@njit
def chart_flow(floats, at, opening, omega, weight, stiff, drop, start, flow):
    """The flow [m3/s] at which weight H + stiff (flow - start) = drop [Pa], by safeguarded Newton from `flow`.

    weight : rho g [N/m3]; stiff : what pressures beside it fall by as it takes more [Pa s/m3]
    """
    low, high, scale = -1e300, 1e300, greatest(floats, at, opening, weight, drop)
    for _ in range(200):
        head, slope = chart_head(floats, at, opening, omega, flow)
        left = weight * head + stiff * (flow - start) - drop
        if abs(left) <= 4e-16 * (weight * abs(head) + abs(drop)):
            return flow
        if left > 0.0:
            high = flow
        else:
            low = flow
        steep, reach = weight * slope + stiff, abs(flow) + scale
        step = -copysign(reach, left)
        if steep > 0.0:
            step = max(-reach, min(reach, -left / steep))
        new = flow + step
        if min(abs(step), high - low) <= 2e-16 * (abs(flow) + 1e-6 * scale):
            return new
        if not low < new < high:
            new = 0.5 * (low + high)
        flow = new
    return flow


@njit
def chart_step(floats, at, opening, omega, rho, weight, stiff, g, m, drop, first):
    """a, s with dM = a + s d(drop) for the next Newton step of a turbine that carries m [kg/s] at a drop [Pa].

    The chord of its curve between the flow now and the flow at which it and what lies beside it agree stands for its
    slope; where the curve falls as the flow rises, so may the chord.
    g : its conductance, of which one is no flatter; first : flow from which that other is looked for [m3/s]
    """
    q = m / rho
    head, slope = chart_head(floats, at, opening, omega, q)
    rest = drop - weight * head
    chord = slope * weight / rho
    new = chart_flow(floats, at, opening, omega, weight, stiff * rho, drop, q, first)
    if abs(new - q) > NEAR * (abs(q) + floats[at + FLOW] * capacity(floats, at, opening)):
        chord = weight * (chart_head(floats, at, opening, omega, new)[0] - head) / (rho * (new - q))
    least = LEAST / sqrt(g)
    if abs(chord) < least:
        chord = copysign(least, chord)
    return rest / chord, 1.0 / chord
