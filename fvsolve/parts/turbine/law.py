"""Turbine: guide vanes, speed and shaft torque.

While the generator holds the speed, the speed follows a schedule. After load rejection, or with given torques from the
start, J d(omega)/dt = torque of the water + given torques, with inertia J and angular velocity omega. The parameters
of a turbine are those of a pump with a rated speed of 1.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.devices import TEMPORARY
from fvsolve.kernels.dtypes import JUNCTION, RATE, RATE_UNWANTED
from fvsolve.kernels.restrictions import head_drop, valve_conductance
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
from fvsolve.parts.turbine.law_chart import chart_at, chart_head, chart_step, chart_torque, is_outside

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
    return opening, out[layout["drive"] + k], out[layout["valve"] + k] / rho, rho / tables.settings[0]["rho"]


@njit
def turbine_torque(out, tables, device):
    """Torque of the water on the shaft [N m], positive in forward rotation."""
    opening, omega, q, density_ratio = operating_point(out, tables, device)
    return density_ratio * chart_torque(tables.floats, tables.valves[device["valve"]]["data"], opening, omega, q)


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
        if dydt.size > 0:
            dydt[device["y"]] = 0.0
        return
    if out[RATE] != RATE_UNWANTED:
        out[RATE] = max(out[RATE], shaft_rate(out, tables, device))
    if dydt.size == 0:
        return
    torque = turbine_torque(out, tables, device)
    if floats[at + MODE] == TORQUE_DRIVEN:
        torque = floats[at + OFFSET] + (torque + floats[at + TORQUE]) + given_torque(t, tables, device, True)
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
    given = given_torque(t, tables, device, False) * omega if floats[at + TORQUE_COUNT] > 0.0 else 0.0
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
    return turbine_step(tables, out, k, tables.settings[0]["rho"], g, m, drop)[1] if g > 0.0 else 0.0


@njit
def turbine_step(tables, out, k, rho, g, m, drop):
    """(a, s) of `chart_step` for turbine k at its present speed, with fluid of density rho [kg/m3].

    g, m, drop : as for `chart_step`
    """
    weight, omega = rho * tables.settings[0]["gravity"], out[tables.layout[0]["drive"] + k]
    opening, stiff = vane_opening(tables, k, g), stiffness(tables, k)
    return chart_step(tables.floats, tables.valves[k]["data"], opening, omega, rho, weight, stiff, g, m, drop, m / rho)
