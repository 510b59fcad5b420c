"""Displacement pump or motor, M = rho (x D w + L dP), with the torque T = x D dP of the fluid on its shaft.

M is the mass flow, rho the density at the inlet, D the displacement, w the angular velocity, L the leakage, dP the
drop from `from` to `to` (negative for a pump), and x the setting. The speed follows a schedule, or is that of a place
of a network, which stores and schedules determine. x follows a schedule, or time_constant dx/dt = setting share - x,
with the share (set - p_to) / range of a compensator, between 0 and 1. Flags: armed[event], the share is 1;
armed[event + 2], it is 0; armed[event + 4], the set pressure is that of the schedule, not that of the sensed place plus
margin.
"""

from math import copysign, sqrt

from fvsolve.core.kernels.density import density
from fvsolve.core.kernels.dtypes import LAW_LINEAR, RATE, RATE_UNWANTED
from fvsolve.core.kernels.network_balance import node_impedance, stiffness_of
from fvsolve.core.kernels.restrictions import head_drop, valve_driving_pressure
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.core.kernels.self_acting_valves import event_pair
from fvsolve.jit import njit

# Numbers: displacement [m3/rad], leakage [m3/s/Pa], viscous friction [N m s/rad], dry friction [N m]; number of the
# shaft in `out`, -1 for a scheduled speed; rate of the shaft per torque [1/kg/m2]; lag of the setting [s], 0 for none;
# setting at the start; range of a compensator [Pa], 0 without one; shares that the set pressure and the sensed pressure
# give at the start; schedule of the set pressure, -1 for none, and its value at the start [Pa]; sensed node, or -1
(
    DISPLACEMENT,
    LEAKAGE,
    VISCOUS,
    DRY,
    SHAFT,
    LIGHTNESS,
    LAG,
    SETTING,
    RANGE,
    SHARE,
    SENSED_SHARE,
    SET_SCHEDULE,
    SET_PRESSURE,
    SENSED,
    COUNT,
) = range(15)
FULL, NONE, LIMITED = 0, 2, 4  # event flags of a compensator, beside `event`
RELUCTANCE = 1e-10  # margin of the share at events, so that rounding does not change the mode
TORQUE, SETTING_VALUE, TAKEN = 0, 1, 2  # quantities


@njit
def machine_speed(t, out, tables, device):
    """Angular velocity of the shaft [rad/s]."""
    shaft = int(tables.floats[device["data"] + SHAFT])
    if shaft < 0:
        return schedule_value(tables, device["schedule"], t)
    return out[tables.layout[0]["shaft"] + shaft]


@njit
def machine_setting(t, y, tables, device):
    """Present setting x [-]."""
    if device["y"] < 0:
        return schedule_value(tables, tables.valves[device["valve"]]["schedule"], t)
    return tables.floats[device["data"] + SETTING] + y[device["y"]]


@njit
def set(t, y, out, tables, device):
    """Write to `out` the speed times the setting [rad/s], as drive, and the conductance that marks it as open."""
    layout, k = tables.layout[0], device["valve"]
    out[layout["drive"] + k] = machine_setting(t, y, tables, device) * machine_speed(
        t, out, tables, device
    )
    out[layout["conductance"] + k] = tables.valves[k]["conductance"]


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """(a [kg/s], s [kg/s/Pa]) of the change a + s d(drop) of the mass flow in a Newton step: the law is linear.

    Arguments as for `restriction_step`.
    """
    floats = tables.floats
    at = tables.valves[k]["data"]
    rho = tables.settings[0]["rho"]
    leakage = denser * rho * floats[at + LEAKAGE]
    swept = floats[at + DISPLACEMENT] * out[tables.layout[0]["drive"] + k]
    return inlet_density(out, tables, k) * swept + leakage * drop - m, leakage


@njit
def inlet_density(out, tables, k):
    """Density of the fluid that machine k takes in [kg/m3]."""
    st = tables.settings[0]
    valve = tables.valves[k]
    nodes = tables.nodes
    if st["law"] == LAW_LINEAR:
        return st["rho"]
    i = valve["from_node"] if out[tables.layout[0]["drive"] + k] >= 0.0 else valve["to_node"]
    return density(st, tables.floats, nodes[i]["pressure"] + out[tables.layout[0]["pressure"] + i])


@njit
def slope(out, tables, k, g, drop):
    """Derivative [kg/s/Pa] of the mass flow by the drop [Pa]."""
    return tables.settings[0]["rho"] * tables.floats[tables.valves[k]["data"] + LEAKAGE]


@njit
def fluid_torque(t, y, out, tables, device):
    """Torque of the fluid on the shaft [N m], positive in the direction of the flow from `from` to `to`."""
    drop = pressure_drop(out, tables, device["valve"])
    return (
        machine_setting(t, y, tables, device) * tables.floats[device["data"] + DISPLACEMENT] * drop
    )


@njit
def pressure_drop(out, tables, k):
    """Pressure drop that acts on the displacement [Pa], between equal elevations."""
    if tables.settings[0]["law"] == LAW_LINEAR:
        return head_drop(tables, out, k)[1]
    return valve_driving_pressure(tables, out, k)[0]


@njit
def shaft_torque(t, y, out, tables, device):
    """Torque on the shaft with all losses [N m]; at rest without dry friction."""
    floats, at = tables.floats, device["data"]
    w = machine_speed(t, out, tables, device)
    dry = copysign(floats[at + DRY], w) if w != 0.0 else 0.0
    return fluid_torque(t, y, out, tables, device) - floats[at + VISCOUS] * w - dry


@njit
def compensator_shares(t, out, tables, device):
    """(share that the set pressure of the schedule gives, share that the sensed pressure gives), not limited to 0 to 1.

    A large number stands for a share that does not exist.
    """
    floats = tables.floats
    at = device["data"]
    pressure = tables.layout[0]["pressure"]
    behind = out[pressure + tables.valves[device["valve"]]["to_node"]]
    own = sensed = 1e300
    schedule, node = int(floats[at + SET_SCHEDULE]), int(floats[at + SENSED])
    if schedule >= 0:
        rise = schedule_value(tables, schedule, t) - floats[at + SET_PRESSURE]
        own = floats[at + SHARE] + (rise - behind) / floats[at + RANGE]
    if node >= 0:
        sensed = floats[at + SENSED_SHARE] + (out[pressure + node] - behind) / floats[at + RANGE]
    return own, sensed


@njit
def compensator_share(t, out, tables, device):
    """Share of the displacement that the compensator allows, in the mode that the flags give."""
    armed, at = tables.armed, device["event"]
    own, sensed = compensator_shares(t, out, tables, device)
    if armed[at + FULL] > 0.0:
        return 1.0
    if armed[at + NONE] > 0.0:
        return 0.0
    return own if armed[at + LIMITED] > 0.0 else sensed


@njit
def move(t, y, dydt, out, tables, device):
    """Write the rate of the setting to `dydt`, and raise out[RATE] to the rate limit of setting and shaft."""
    floats = tables.floats
    at = device["data"]
    k = device["valve"]
    if out[RATE] != RATE_UNWANTED:
        out[RATE] = max(out[RATE], machine_rate(t, y, out, tables, device))
    if device["y"] < 0:
        return
    target = schedule_value(tables, tables.valves[k]["schedule"], t)
    if floats[at + RANGE] > 0.0:
        target *= compensator_share(t, out, tables, device)
    dydt[device["y"]] = (target - floats[at + SETTING] - y[device["y"]]) / floats[at + LAG]


@njit
def machine_rate(t, y, out, tables, device):
    """Rate limit [1/s]: of the setting with its lag and compensator, and of the shaft against the pressures."""
    floats = tables.floats
    at = device["data"]
    nodes = tables.nodes
    layout = tables.layout[0]
    valve, rate = tables.valves[device["valve"]], 0.0
    i = valve["from_node"]
    j = valve["to_node"]
    rho = tables.settings[0]["rho"]
    behind = stiffness_of(nodes, layout, out, j)
    if device["y"] >= 0:
        rate = 1.0 / floats[at + LAG]
        if floats[at + RANGE] > 0.0:
            w = machine_speed(t, out, tables, device)
            gain = rho * floats[at + DISPLACEMENT] * abs(w) * rate / floats[at + RANGE]
            rate += max(gain * node_impedance(tables, j), sqrt(gain * behind))
    gain = (
        rho
        * floats[at + LIGHTNESS]
        * (machine_setting(t, y, tables, device) * floats[at + DISPLACEMENT]) ** 2
    )
    impedance = node_impedance(tables, i) + node_impedance(tables, j)
    return max(rate, gain * impedance, sqrt(gain * (stiffness_of(nodes, layout, out, i) + behind)))


@njit
def events(t, y, out, tables, device, g):
    """Write three event functions of a compensator to g, each followed by its negative.

    They are the distance of the share from 1, the share, and the excess of the share of the schedule over that of the
    sensed place. Without a compensator there are none.
    """
    armed, at = tables.armed, device["event"]
    if tables.floats[device["data"] + RANGE] == 0.0:
        return
    own, sensed = compensator_shares(t, out, tables, device)
    share = min(own, sensed)
    full, none = 1.0 - share, share
    if armed[at + FULL] > 0.0:
        full -= RELUCTANCE
    if armed[at + NONE] > 0.0:
        none -= RELUCTANCE
    event_pair(tables, g, at + FULL, full)
    event_pair(tables, g, at + NONE, none)
    event_pair(
        tables, g, at + LIMITED, own - sensed + (-RELUCTANCE if armed[at + LIMITED] > 0.0 else 0.0)
    )


@njit
def value(t, y, out, tables, device, quantity):
    """Torque on the shaft [N m] (quantity TORQUE) or that it takes from the shaft (TAKEN), or the setting.

    If a network turns the shaft, the torque is that of the fluid alone, without friction.
    """
    if quantity == SETTING_VALUE:
        return machine_setting(t, y, tables, device)
    by_network = tables.floats[device["data"] + SHAFT] >= 0.0
    torque = (
        fluid_torque(t, y, out, tables, device)
        if by_network
        else shaft_torque(t, y, out, tables, device)
    )
    return torque if quantity == TORQUE else 0.0 - torque


@njit
def power(t, y, dydt, out, tables, device):
    """(power supplied to the shaft, 0, power that the fluid and losses take from it) [W].

    A network that turns the shaft has its own account of the supplied power and of friction.
    """
    w = machine_speed(t, out, tables, device)
    if tables.floats[device["data"] + SHAFT] >= 0.0:
        return 0.0, 0.0, -fluid_torque(t, y, out, tables, device) * w
    taken = -shaft_torque(t, y, out, tables, device) * w
    return taken, 0.0, taken


@njit
def heat(t, y, out, tables, device):
    """Power that the fluid and all losses take from the shaft [W]."""
    return -shaft_torque(t, y, out, tables, device) * machine_speed(t, out, tables, device)
