"""Valves that lead the rigid column which they alone hold, near their seat. Knows one valve and the columns beside it.

A disc leads from its seat, a stem to its seat too (armed[event + 4], of a stem + 6), until its lift is above LEADS and
a given step resolves what the two exchange: `kernels.led`. A disc that goes to its seat may slam.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.either import either
from fvsolve.kernels.restrictions import head_drop

LEADS = 1e-4  # lift up to which it leads its column, at least


@njit
def leads(tables, k):
    """Whether restriction k leads the rigid column which it alone holds."""
    if tables.valves[k]["device"] < 0:
        return False
    device = tables.devices[tables.valves[k]["device"]]
    return device["leads"] >= 0 and tables.armed[device["leads"]] > 0.0


@njit
def led_until(out, tables, device, speed):
    """Lift above which it does not lead its column; 0 where it holds none alone.

    speed : d(dx/dt) / d(drop) [1/Pa/s].
    """
    valve, columns, most = tables.valves[device["valve"]], tables.columns, 0.0
    for k in range(columns.size):
        for i in (columns[k]["from_node"], columns[k]["to_node"]):
            joined, node = i == valve["from_node"] or i == valve["to_node"], tables.nodes[i]
            if joined and node["gates"] >= 0 and node["gate_count"] == 1 and node["columns"] == 1:
                most = max(most, led_beside(out, tables, device, columns[k]["area"] / columns[k]["length"], speed))
    return most


@njit
def led_beside(out, tables, device, yielding, speed):
    """The same, beside a column of area over length `yielding`: LEADS, or where a given step resolves their exchange.

    Its rate is (2 dP / x) (speed + (A / L) / sqrt(G dP)).
    """
    root = sqrt(abs(head_drop(tables, out, device["valve"])[1]))
    rate = 2.0 * root * (root * speed + yielding / sqrt(tables.valves[device["valve"]]["conductance"]))
    return max(LEADS, 2.0 * tables.clock[0]["step"] * rate)


@njit
def lead_events(out, tables, device, g, x, share, speed):
    """g: way to a lift x at which it leads no column any more; to this share of it, where it takes the lead, if any."""
    at, most = device["leads"], led_until(out, tables, device, speed)
    if tables.armed[at] > 0.0:
        either(tables, g, at, x - most)
    else:
        either(tables, g, at, x - share * most if share * most > 0.0 else 1.0)
