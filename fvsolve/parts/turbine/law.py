"""Turbine: guide vanes, speed and shaft torque.

While the generator holds the speed, the speed follows a schedule. After load rejection, or with given torques from the
start, J d(omega)/dt = torque of the water + given torques, with inertia J and angular velocity omega. The parameters
of a turbine are those of a pump with a rated speed of 1.

Hill charts of turbines at any speed, flow and opening.
n = omega / speed and u = flow / (flow scale capacity) are speed and flow over their values at a head of 1 m. The chart
holds values on rays from the origin of the plane (n, u). The root of head S(n, u) gives the head H = S |S| [m]. Between
two rays S is linear in n and u, so that at a head of 1 m a curve is a straight line between its points. The torque is
H T, with T linear along this line. Between two openings, S and T on a ray and the capacity are linear in the opening.
Below the least opening the curve in n and u stays the same and its capacity is proportional to the opening; the torque
tends to the torque behind shut vanes.
"""

from math import atan2, copysign, pi, sqrt

from fvsolve.core.kernels.devices import TEMPORARY
from fvsolve.core.kernels.dtypes import JUNCTION, RATE, RATE_UNWANTED
from fvsolve.core.kernels.restrictions import LEAST, head_drop, valve_conductance
from fvsolve.jit import njit
from fvsolve.parts.pump.law import (
    HELD_SPEED,
    INERTIA,
    MODE,
    OFFSET,
    TORQUE,
    TORQUE_COUNT,
    TORQUE_DRIVEN,
    TRIPPING,
    given_torque,
    pump_speed,
    tripped,
)
from fvsolve.parts.pump.law import stored as stored

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
    flow_scale = (
        floats[at + FLOW] * least * interpolate_curves(floats, at + OWN + curves, 1, k, share)
    )
    n, u = omega / floats[at + SPEED], flow / flow_scale
    first = at + OWN + 4 * curves
    i = ray_below(floats, first, rays, operating_angle(n, u))
    a = floats[first + rays + i]
    b = floats[first + 2 * rays + i]
    c = 0.0
    d = 0.0
    c, d = floats[first + rays + i + 1], floats[first + 2 * rays + i + 1]
    turn = a * d - b * c
    share_1, share_2 = (n * d - u * c) / turn, (a * u - b * n) / turn
    roots = first + 3 * rays + i
    torques = roots + curves * rays
    root_1 = interpolate_curves(floats, roots, rays, k, share)
    root_2 = interpolate_curves(floats, roots + 1, rays, k, share)
    t_1 = interpolate_curves(floats, torques, rays, k, share)
    t_2 = interpolate_curves(floats, torques + 1, rays, k, share)
    root = share_1 * root_1 + share_2 * root_2
    by_n, by_u = (root_1 * d - root_2 * b) / turn, (root_2 * a - root_1 * c) / turn
    torque, torque_slope = 0.0, 0.0
    if root > 0.0:
        t = torque_between_rays(share_1, share_2, root_1, root_2, t_1, t_2)
        first, weight_2 = max(root_1, LEAST_ROOT), max(root_2, LEAST_ROOT)
        t_slope = (first * d * (t_1 - t) - weight_2 * b * (t_2 - t)) / (
            turn * (first * share_1 + weight_2 * share_2)
        )
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
    angle = operating_angle(omega / floats[at + SPEED], flow / flow_scale)
    own = at + OWN + 2 * curves
    first = interpolate_curves(floats, own, 1, k, share)
    last = interpolate_curves(floats, own + curves, 1, k, share)
    return not first <= angle <= last


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
    low = -1e300
    high = 1e300
    scale = flow_bound(floats, at, opening, weight, drop)
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


SHUT_SHARE = 1e-12  # square of an opening regarded as zero


@njit
def set(t, y, out, tables, device):
    """Write to `out` the speed of the turbine [rad/s] and its conductance at the vane opening [kg2/s2/Pa]."""
    layout, k = tables.layout[0], device["valve"]
    out[layout["drive"] + k] = pump_speed(t, y, tables, device)
    g = valve_conductance(tables, k, t)
    out[layout["conductance"] + k] = g if g >= SHUT_SHARE * tables.valves[k]["conductance"] else 0.0


@njit
def vane_opening(tables, k, g):
    """Opening of the vanes of turbine k, 0 to 1; g : its conductance [kg2/s2/Pa]"""
    return sqrt(g / tables.valves[k]["conductance"])


@njit
def operating_point(out, tables, device):
    """(opening, speed [rad/s], flow [m3/s], density over reference density) of a turbine, after nodes are solved."""
    layout, k = tables.layout[0], device["valve"]
    rho, _ = head_drop(tables, out, k)
    opening = vane_opening(tables, k, out[layout["conductance"] + k])
    return (
        opening,
        out[layout["drive"] + k],
        out[layout["valve"] + k] / rho,
        rho / tables.settings[0]["rho"],
    )


@njit
def turbine_torque(out, tables, device):
    """Torque of the water on the shaft [N m], positive in forward rotation."""
    opening, omega, q, density_ratio = operating_point(out, tables, device)
    return density_ratio * chart_torque(
        tables.floats, tables.valves[device["valve"]]["data"], opening, omega, q
    )


@njit
def generator_holds_speed(t, tables, device):
    """True if the generator holds the speed at time t."""
    mode = tables.floats[device["data"] + MODE]
    return mode == HELD_SPEED or (mode == TRIPPING and not tripped(t, tables, device))


@njit
def move(t, y, dydt, out, tables, device):
    """Write the rate of the speed of a free shaft to `dydt`, and raise out[RATE] to its rate limit."""
    floats, at = tables.floats, device["data"]
    if floats[at + MODE] == HELD_SPEED:
        return
    if generator_holds_speed(t, tables, device):
        dydt[device["y"]] = 0.0
        return
    if out[RATE] != RATE_UNWANTED:
        out[RATE] = max(out[RATE], shaft_rate(out, tables, device))
    torque = turbine_torque(out, tables, device)
    if floats[at + MODE] == TORQUE_DRIVEN:
        torque = (
            floats[at + OFFSET]
            + (torque + floats[at + TORQUE])
            + given_torque(t, tables, device, True)
        )
    dydt[device["y"]] = torque / floats[at + INERTIA]


@njit
def shaft_rate(out, tables, device):
    """Rate [1/s] at which the water brakes a free shaft."""
    floats = tables.floats
    opening, omega, q, density_ratio = operating_point(out, tables, device)
    if opening <= 0.0:
        return 0.0
    torque_slope = chart_at(floats, tables.valves[device["valve"]]["data"], opening, omega, q)[4]
    return density_ratio * abs(torque_slope) / floats[device["data"] + INERTIA]


@njit
def power(t, y, dydt, out, tables, device):
    """(power supplied to the shaft, rate of its kinetic energy, minus the power that it takes from the water) [W]."""
    floats, at = tables.floats, device["data"]
    omega = out[tables.layout[0]["drive"] + device["valve"]]
    taken = -turbine_torque(out, tables, device) * omega
    if generator_holds_speed(t, tables, device):
        return taken, 0.0, taken
    given = (
        given_torque(t, tables, device, False) * omega if floats[at + TORQUE_COUNT] > 0.0 else 0.0
    )
    return given, floats[at + INERTIA] * omega * dydt[device["y"]], taken


@njit
def value(t, y, out, tables, device, quantity):
    """Head [m] (quantity 0), speed [rad/s] (1), torque [N m] (2), power at the shaft [W] (3), or opening (4)."""
    st, k = tables.settings[0], device["valve"]
    opening, omega, q, _ = operating_point(out, tables, device)
    if quantity == 0:
        if opening > 0.0:
            return chart_head(tables.floats, tables.valves[k]["data"], opening, omega, q)[0]
        rho, drop = head_drop(tables, out, k)
        return drop / (rho * st["gravity"])
    if quantity == 1:
        return omega
    if quantity == 4:
        return opening
    torque = turbine_torque(out, tables, device)
    return torque if quantity == 2 else torque * omega


@njit
def outside(out, tables, device):
    """TEMPORARY if the operating point is outside the angles of the hill chart, otherwise 0."""
    opening, omega, q, _ = operating_point(out, tables, device)
    beyond = is_outside(tables.floats, tables.valves[device["valve"]]["data"], opening, omega, q)
    return TEMPORARY if beyond else 0


@njit
def stiffness(tables, k):
    """Decrease of the drop across turbine k per increase of its mass flow [Pa s/kg], caused by the adjacent pipes."""
    nodes, total = tables.nodes, 0.0
    for i in (tables.valves[k]["from_node"], tables.valves[k]["to_node"]):
        if nodes[i]["kind"] == JUNCTION and nodes[i]["admittance"] > 0.0:
            total += 1.0 / nodes[i]["admittance"]
    return total


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """(a [kg/s], s [kg/s/Pa]) of `chart_step` for turbine k; arguments as for `restriction_step`.

    The drop of head, times rho g with the upstream density, replaces `drop`.
    """
    rho, fall = head_drop(tables, out, k)
    return turbine_step(tables, out, k, rho, g, m, fall)


@njit
def slope(out, tables, k, g, drop):
    """Derivative [kg/s/Pa] of the mass flow of turbine k by its drop; 0 with shut vanes.

    g : conductance [kg2/s2/Pa]; drop : [Pa]
    """
    m = out[tables.layout[0]["valve"] + k]
    return (
        turbine_step(tables, out, k, tables.settings[0]["rho"], g, m, drop)[1] if g > 0.0 else 0.0
    )


@njit
def turbine_step(tables, out, k, rho, g, m, drop):
    """(a, s) of `chart_step` for turbine k at its present speed, with fluid of density rho [kg/m3].

    g, m, drop : as for `chart_step`
    """
    weight, omega = rho * tables.settings[0]["gravity"], out[tables.layout[0]["drive"] + k]
    opening, stiff = vane_opening(tables, k, g), stiffness(tables, k)
    return chart_step(
        tables.floats,
        tables.valves[k]["data"],
        opening,
        omega,
        rho,
        weight,
        stiff,
        g,
        m,
        drop,
        m / rho,
    )
