"""A check valve that shuts when its flow reverses.

While open, it is a restriction in both directions, and its event function is the flow. While shut, no fluid passes; it
opens when the pressure drop exceeds its cracking pressure. The flag armed[event] is above 0 while it is shut; it
changes on accepted states only.
"""

from fvsolve.core.kernels.dtypes import JUNCTION
from fvsolve.core.kernels.restrictions import head_drop
from fvsolve.core.kernels.self_acting_valves import event_pair
from fvsolve.jit import njit

# excess over the cracking pressure at which it opens, so that rounding does not [Pa]
PRESSURE_MARGIN = 1.0


@njit
def set(t, y, out, tables, device):
    """Write to `out` the conductance of the valve [kg2/s2/Pa], 0 while it is shut."""
    k, shut = device["valve"], tables.armed[device["event"]] > 0.0
    out[tables.layout[0]["conductance"] + k] = 0.0 if shut else tables.valves[k]["conductance"]


@njit
def joins_junction(tables, device):
    """True if a junction lies at one end of the valve: other parts may then stop the flow while the valve is open."""
    valve, nodes = tables.valves[device["valve"]], tables.nodes
    return (
        nodes[valve["from_node"]]["kind"] == JUNCTION or nodes[valve["to_node"]]["kind"] == JUNCTION
    )


@njit
def events(t, y, out, tables, device, g):
    """Write an event function and its negative to g.

    It is the flow [kg/s] while the valve is open. While it is shut, it is the drop minus the cracking pressure and
    PRESSURE_MARGIN [Pa]. For an open valve at a junction without flow, it is the drop plus PRESSURE_MARGIN [Pa].
    """
    k, at = device["valve"], device["event"]
    margin = out[tables.layout[0]["valve"] + k]
    if margin == 0.0 and tables.armed[at] == 0.0 and joins_junction(tables, device):
        margin = head_drop(tables, out, k)[1] + PRESSURE_MARGIN
    if tables.armed[at] > 0.0:
        margin = head_drop(tables, out, k)[1] - tables.floats[device["data"]] - PRESSURE_MARGIN
    event_pair(tables, g, at, margin)


@njit
def value(t, y, out, tables, device, quantity):
    """Opening of the valve: 1 if open, 0 if shut."""
    return 1.0 if out[tables.layout[0]["conductance"] + device["valve"]] > 0.0 else 0.0
