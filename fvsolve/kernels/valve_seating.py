"""Valves near their seat that control the single rigid column connected to them.

A disc controls its column from the time at which it leaves its seat; the stem of a regulating valve also before it
reaches its seat. The flag is armed[event + 4], that of a stem armed[event + 6]. Control ends when the lift exceeds
CONTROL_LIFT and a given step resolves the exchange between lift and flow: `kernels.column_valve_control`. A disc that
moves to its seat may slam.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.event_pair import event_pair
from fvsolve.kernels.restrictions import head_drop

CONTROL_LIFT = 1e-4  # lift up to which a valve controls its column, at least


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
    valve, columns, limit = tables.valves[device["valve"]], tables.columns, 0.0
    for k in range(columns.size):
        for i in (columns[k]["from_node"], columns[k]["to_node"]):
            at_end, node = i == valve["from_node"] or i == valve["to_node"], tables.nodes[i]
            if at_end and node["gates"] >= 0 and node["gate_count"] == 1 and node["columns"] == 1:
                limit = max(
                    limit, column_control_limit(out, tables, device, columns[k]["area"] / columns[k]["length"], speed)
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
    rate = 2.0 * root * (root * speed + mobility / sqrt(tables.valves[device["valve"]]["conductance"]))
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
