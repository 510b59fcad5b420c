"""Common functions of self-acting valves and other switching parts: event functions, feedback of the pressure, seat.

A disc controls the single rigid column connected to it from the time at which it leaves its seat; the stem of a
regulating valve also before it reaches its seat. The flag is armed[event + 4], that of a stem armed[event + 6]. Control
ends when the lift exceeds CONTROL_LIFT and a given step resolves the exchange between lift and flow:
`kernels.rigid_columns`. A disc that moves to its seat may slam.
"""

from math import sqrt

from fvsolve.core.kernels.dtypes import JUNCTION
from fvsolve.core.kernels.network_balance import node_impedance, stiffness_of
from fvsolve.core.kernels.restrictions import head_drop, restriction_slope
from fvsolve.jit import njit

CONTROL_LIFT = 1e-4  # lift up to which a valve controls its column, at least
TINY = 1e-300  # in place of a zero of an event function


@njit(forceinline=True)
def event_pair(tables, g, at, left):
    """Write `left` and -`left` to g[at] and g[at + 1], the event functions of the switch between two rules.

    left : distance to the end of the first rule, negative while it holds (armed[at] > 0) and positive while the second
        rule holds. Zero becomes a tiny number beyond the end of the present rule, so that the switch takes place.
    """
    if left == 0.0:
        left = TINY if tables.armed[at] > 0.0 else -TINY
    g[at], g[at + 1] = left, -left


@njit
def loop_rate(out, tables, k, i, speed):
    """Rate of the feedback loop [1/s] of restriction k, whose opening x follows the pressure at node i.

    speed : rate dx/dt per fall of the pressure, dx/dt = -speed p' [1/s/Pa], p' : pressure change
    The pressure follows the flow M: dM/dx = sqrt(G dP), with conductance G and drop dP, reduced because the drop falls
    as the flow rises. The pressure of the node responds by its pipes or by its stored mass.
    """
    layout, valve = tables.layout[0], tables.valves[k]
    drop = head_drop(tables, out, k)[1]
    # Fall of the drop per flow, by the pressures of both nodes.
    soft = node_impedance(tables, valve["from_node"]) + node_impedance(tables, valve["to_node"])
    gain = (
        speed
        * sqrt(valve["conductance"] * abs(drop))
        / (1.0 + soft * restriction_slope(tables, out, k, drop))
    )
    # A stored mass adds an integration to the loop, which then oscillates: its rate is a square root.
    stiff = (
        stiffness_of(tables.nodes, layout, out, i) if tables.nodes[i]["kind"] != JUNCTION else 0.0
    )
    return max(gain * node_impedance(tables, i), sqrt(gain * stiff))


@njit
def sensed_pressure(tables, out, device):
    """Weighted sum of the pressure changes since the start at the nodes that a device senses [Pa]."""
    at = tables.layout[0]["pressure"]
    total = device["node_weight"] * out[at + device["node"]]
    return total + (
        device["second_weight"] * out[at + device["second"]] if device["second"] >= 0 else 0.0
    )


@njit
def sensed_rate(out, tables, device, speed):
    """Sum of `loop_rate` [1/s] of the valve of a device over the nodes that it senses, by their weights."""
    k = device["valve"]
    rate = abs(device["node_weight"]) * loop_rate(out, tables, k, device["node"], speed)
    if device["second"] >= 0:
        rate += abs(device["second_weight"]) * loop_rate(out, tables, k, device["second"], speed)
    return rate


@njit
def controls_column(tables, k):
    """True if restriction k is near its seat and controls the rigid column of which it is the only outlet."""
    if tables.valves[k]["device"] < 0:
        return False
    device = tables.devices[tables.valves[k]["device"]]
    return device["controls_column"] >= 0 and tables.armed[device["controls_column"]] > 0.0


@njit
def control_limit(out, tables, device, speed):
    """Lift above which the valve of a device does not control its column; 0 if it is not the only outlet of a column.

    speed : derivative of dx/dt with respect to the drop [1/s/Pa], x : lift
    """
    valve = tables.valves[device["valve"]]
    columns = tables.columns
    limit = 0.0
    for k in range(columns.size):
        for i in (columns[k]["from_node"], columns[k]["to_node"]):
            at_end, node = i == valve["from_node"] or i == valve["to_node"], tables.nodes[i]
            # Only the sole valve at the end of a single column can control it.
            if at_end and node["gates"] >= 0 and node["gate_count"] == 1 and node["columns"] == 1:
                limit = max(
                    limit,
                    column_control_limit(
                        out, tables, device, columns[k]["area"] / columns[k]["length"], speed
                    ),
                )
    return limit


@njit
def column_control_limit(out, tables, device, mobility, speed):
    """Lift above which a valve does not control a column with A / L = `mobility` [m], area over length.

    It is CONTROL_LIFT, or more until a given step resolves the exchange between lift x and flow. The rate of this
    exchange is (2 dP / x) (speed + (A / L) / sqrt(G dP)), with drop dP and conductance G.
    device : row of the device of the valve; speed : derivative of dx/dt with respect to the drop [1/s/Pa]
    """
    root = sqrt(abs(head_drop(tables, out, device["valve"])[1]))
    rate = (
        2.0 * root * (root * speed + mobility / sqrt(tables.valves[device["valve"]]["conductance"]))
    )
    return max(CONTROL_LIFT, 2.0 * tables.clock[0]["step"] * rate)


@njit
def control_events(out, tables, device, g, x, share, speed):
    """Write two event functions of the lift x to g: for the end of the control of a column, and for its beginning.

    Control ends at the lift of `control_limit`, and begins at the fraction `share` of it; never if `share` is 0.
    device : row of the device of the valve; speed : derivative of dx/dt with respect to the drop [1/s/Pa]
    """
    at, most = device["controls_column"], control_limit(out, tables, device, speed)
    if tables.armed[at] > 0.0:
        event_pair(tables, g, at, x - most)
    else:
        event_pair(tables, g, at, x - share * most if share * most > 0.0 else 1.0)
