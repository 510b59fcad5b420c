"""Hill charts of turbines at any speed, flow and opening.

n = omega / speed and u = flow / (flow scale capacity) are speed and flow over their values at a head of 1 m. The chart
holds values on rays from the origin of the plane (n, u). The root of head S(n, u) gives the head H = S |S| [m]. Between
two rays S is linear in n and u, so that at a head of 1 m a curve is a straight line between its points. The torque is
H T, with T linear along this line. Between two openings, S and T on a ray and the capacity are linear in the opening.
Below the least opening the curve in n and u stays the same and its capacity is proportional to the opening; the torque
tends to the torque behind shut vanes.
"""

from math import atan2, copysign, pi, sqrt

from fvsolve.jit import njit
from fvsolve.kernels.restrictions import LEAST

LEAST_ROOT = 0.1  # least root in the weight of the torque of a ray; given points have greater roots
CHORD_CHANGE = 1e-9  # relative change of flow below which the tangent replaces the chord

# Numbers of a chart: counts of curves and rays, speed [rad/s] and flow [m3/s] at 1 m, torque behind shut vanes over
# omega |omega| [N m s2]; then arrays: openings, capacities, least and greatest given angles of all curves; angles of
# all rays, their cosines and sines; roots, then T [N], of each curve on all rays.
CURVES, RAYS, SPEED, FLOW, SHUT_VANES, OWN = 0, 1, 2, 3, 4, 5


@njit
def torque_between_rays(share_1, share_2, root_1, root_2, torque_1, torque_2):
    """Torque over head T at a point between two rays; at a head of 1 m it is linear on the line between their points.

    share_1, share_2 : weights with which the directions of both rays add up to the point (n, u)
    root_1, root_2, torque_1, torque_2 : root of head and torque over head on both rays
    """
    weight_1, weight_2 = share_1 * max(root_1, LEAST_ROOT), share_2 * max(root_2, LEAST_ROOT)
    return (weight_1 * torque_1 + weight_2 * torque_2) / (weight_1 + weight_2)


@njit
def opening_share(floats, at, opening):
    """(curve, share, factor) of an opening, for the interpolation between the curves of a chart.

    curve : number of the curve at or below the opening; share : weight of the next curve
    factor : factor of flow and torque: the opening over the least opening of the chart, or 1 if the opening is above it
    floats[at:] : parameters of the chart
    """
    count = int(floats[at + CURVES])
    if opening <= floats[at + OWN]:
        return 0, 0.0, opening / floats[at + OWN]
    for k in range(1, count):
        low, high = floats[at + OWN + k - 1], floats[at + OWN + k]
        if opening <= high:
            return k - 1, (opening - low) / (high - low), 1.0
    return count - 1, 0.0, 1.0


@njit
def interpolate_curves(floats, first, stride, k, share):
    """Value between those of curve k, floats[first + k stride], and of the next curve, which has the weight `share`."""
    value = floats[first + k * stride]
    if share > 0.0:
        value += share * (floats[first + (k + 1) * stride] - value)
    return value


@njit
def capacity(floats, at, opening):
    """Capacity at an opening [-]: greatest flow of its curve at a head of 1 m, over the flow scale of the chart.

    floats[at:] : parameters of the chart
    """
    k, share, least = opening_share(floats, at, opening)
    return least * interpolate_curves(floats, at + OWN + int(floats[at + CURVES]), 1, k, share)


@njit
def ray_below(floats, first, count, angle):
    """Number of the last ray whose angle is at or below `angle`, from 0 to count - 2.

    floats[first:] : `count` ascending angles [rad]
    """
    low, high = 0, count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if floats[first + middle] <= angle:
            low = middle
        else:
            high = middle
    return low


@njit
def operating_angle(n, u):
    """Angle of the point (n, u) about the origin [rad], from -pi / 2 to 3 pi / 2.

    n : relative speed; u : relative flow
    """
    angle = atan2(u, n)
    return angle + 2.0 * pi if angle < -0.5 * pi else angle


@njit
def chart_at(floats, at, opening, omega, flow):
    """(root of head, its derivatives by omega and by flow, torque [N m], its derivative by omega) of a turbine.

    The head is root |root| [m]. floats[at:] : parameters of the hill chart
    opening : above 0; omega : angular velocity [rad/s]; flow : [m3/s]
    """
    curves, rays = int(floats[at + CURVES]), int(floats[at + RAYS])
    k, share, least = opening_share(floats, at, opening)
    flow_scale = floats[at + FLOW] * least * interpolate_curves(floats, at + OWN + curves, 1, k, share)
    n, u = omega / floats[at + SPEED], flow / flow_scale
    first = at + OWN + 4 * curves
    i = ray_below(floats, first, rays, operating_angle(n, u))
    a, b, c, d = floats[first + rays + i], floats[first + 2 * rays + i], 0.0, 0.0
    c, d = floats[first + rays + i + 1], floats[first + 2 * rays + i + 1]
    turn = a * d - b * c
    share_1, share_2 = (n * d - u * c) / turn, (a * u - b * n) / turn
    roots = first + 3 * rays + i
    torques = roots + curves * rays
    root_1, root_2 = (
        interpolate_curves(floats, roots, rays, k, share),
        interpolate_curves(floats, roots + 1, rays, k, share),
    )
    t_1, t_2 = (
        interpolate_curves(floats, torques, rays, k, share),
        interpolate_curves(floats, torques + 1, rays, k, share),
    )
    root = share_1 * root_1 + share_2 * root_2
    by_n, by_u = (root_1 * d - root_2 * b) / turn, (root_2 * a - root_1 * c) / turn
    torque, torque_slope = 0.0, 0.0
    if root > 0.0:
        t = torque_between_rays(share_1, share_2, root_1, root_2, t_1, t_2)
        first, weight_2 = max(root_1, LEAST_ROOT), max(root_2, LEAST_ROOT)
        t_slope = (first * d * (t_1 - t) - weight_2 * b * (t_2 - t)) / (turn * (first * share_1 + weight_2 * share_2))
        torque, torque_slope = root * root * t, 2.0 * root * by_n * t + root * root * t_slope
    speed, shut_torque = floats[at + SPEED], floats[at + SHUT_VANES]
    torque = least * torque + (1.0 - least) * shut_torque * abs(omega) * omega
    torque_slope = least * torque_slope / speed + 2.0 * (1.0 - least) * shut_torque * abs(omega)
    return root, by_n / speed, by_u / flow_scale, torque, torque_slope


@njit
def chart_torque(floats, at, opening, omega, flow):
    """Torque of the water on the shaft [N m], positive in forward rotation; with shut vanes, the drag of the water.

    Arguments as for `chart_at`, but the opening may be 0.
    """
    if opening <= 0.0:
        return floats[at + SHUT_VANES] * abs(omega) * omega
    return chart_at(floats, at, opening, omega, flow)[3]


@njit
def chart_head(floats, at, opening, omega, flow):
    """(head that the turbine takes [m], its slope over the flow [s/m2]); arguments as for `chart_at`."""
    root, _, by_flow, _, _ = chart_at(floats, at, opening, omega, flow)
    return root * abs(root), 2.0 * abs(root) * by_flow


@njit
def is_outside(floats, at, opening, omega, flow):
    """True if the operating point is outside the angles of the given points of the chart; False with shut vanes.

    Arguments as for `chart_at`, but the opening may be 0.
    """
    curves = int(floats[at + CURVES])
    if opening <= 0.0:
        return False
    k, share, _ = opening_share(floats, at, opening)
    flow_scale = floats[at + FLOW] * capacity(floats, at, opening)
    angle, own = operating_angle(omega / floats[at + SPEED], flow / flow_scale), at + OWN + 2 * curves
    return (
        not interpolate_curves(floats, own, 1, k, share)
        <= angle
        <= interpolate_curves(floats, own + curves, 1, k, share)
    )


@njit
def flow_bound(floats, at, opening, weight, drop):
    """Upper bound of the flow [m3/s] at a pressure drop [Pa] and a usual speed.

    floats[at:] : parameters of the chart; weight : rho g [N/m3]
    """
    return floats[at + FLOW] * capacity(floats, at, opening) * (1.0 + sqrt(abs(drop) / weight))


@njit
def chart_flow(floats, at, opening, omega, weight, stiff, drop, start, flow):
    """Flow [m3/s] at which weight H + stiff (flow - start) = drop [Pa], by Newton's method with bounds.

    H : head that the turbine takes [m]; weight : rho g [N/m3]; start : flow at the given drop [m3/s]
    stiff : decrease of the drop per flow, caused by the adjacent pipes [Pa s/m3]; flow : start value of the search
    Other arguments as for `chart_at`.
    """
    low, high, scale = -1e300, 1e300, flow_bound(floats, at, opening, weight, drop)
    for _ in range(200):
        head, slope = chart_head(floats, at, opening, omega, flow)
        residual = weight * head + stiff * (flow - start) - drop
        if abs(residual) <= 4e-16 * (weight * abs(head) + abs(drop)):
            return flow
        if residual > 0.0:
            high = flow
        else:
            low = flow
        total_slope, reach = weight * slope + stiff, abs(flow) + scale
        step = -copysign(reach, residual)
        if total_slope > 0.0:
            step = max(-reach, min(reach, -residual / total_slope))
        new = flow + step
        if min(abs(step), high - low) <= 2e-16 * (abs(flow) + 1e-6 * scale):
            return new
        if not low < new < high:
            new = 0.5 * (low + high)
        flow = new
    return flow


@njit
def chart_step(floats, at, opening, omega, rho, weight, stiff, g, m, drop, first):
    """(a [kg/s], s [kg/s/Pa]) of the next Newton step dM = a + s d(drop) of a turbine, M the mass flow.

    s is the slope of the chord between the present flow and the flow at which turbine and adjacent pipes have the same
    drop. It is negative where the head falls with rising flow.
    m : mass flow before the step [kg/s]; drop : drop across the turbine [Pa]
    rho, weight : density [kg/m3] and rho g [N/m3] of the fluid
    stiff : decrease of the drop per mass flow, caused by the adjacent pipes [Pa s/kg]
    g : conductance, which limits abs(s); first : start of the search for the second flow [m3/s]
    Other arguments as for `chart_at`.
    """
    q = m / rho
    head, slope = chart_head(floats, at, opening, omega, q)
    rest = drop - weight * head
    chord = slope * weight / rho
    new = chart_flow(floats, at, opening, omega, weight, stiff * rho, drop, q, first)
    if abs(new - q) > CHORD_CHANGE * (abs(q) + floats[at + FLOW] * capacity(floats, at, opening)):
        chord = weight * (chart_head(floats, at, opening, omega, new)[0] - head) / (rho * (new - q))
    least = LEAST / sqrt(g)
    if abs(chord) < least:
        chord = copysign(least, chord)
    return rest / chord, 1.0 / chord
