"""A check valve that a pilot pressure opens against its flow.

While open, it is a restriction in both directions. It shuts when its flow is reversed and the pilot does not hold it
open. While shut, it opens when its drop exceeds the cracking pressure, or when the pilot opens it. The flag
armed[event] is above 0 while it is shut; it changes on accepted states only.
"""

from math import sqrt

from fvsolve.core.kernels.restrictions import head_drop
from fvsolve.core.kernels.self_acting_valves import event_pair
from fvsolve.jit import njit
from fvsolve.parts.self_acting.law_check_valve import joins_junction

# numbers; the last two at the start
CRACKING_PRESSURE, PILOT_RATIO, DROP, PILOT_EXCESS = 0, 1, 2, 3
PRESSURE_MARGIN = 1e-3  # excess at which it opens, so that rounding does not [Pa]
TYPICAL_DROP = 1e5  # drop whose flow scales the excess of the pilot [Pa]


@njit
def set(t, y, out, tables, device):
    """Write to `out` the conductance of the valve [kg2/s2/Pa], 0 while it is shut."""
    k, shut = device["valve"], tables.armed[device["event"]] > 0.0
    out[tables.layout[0]["conductance"] + k] = 0.0 if shut else tables.valves[k]["conductance"]


@njit
def excesses(out, tables, device):
    """(drop minus cracking pressure, excess of the pilot) [Pa]; the valve opens where one of them is positive.

    The excess of the pilot is ratio (p_pilot - p_from) - (p_to - p_from + cracking pressure).
    """
    floats = tables.floats
    data = device["data"]
    valve = tables.valves[device["valve"]]
    at = tables.layout[0]["pressure"]
    before, behind = out[at + valve["from_node"]], out[at + valve["to_node"]]
    drop = floats[data + DROP] + (before - behind)
    pilot = floats[data + PILOT_RATIO] * (out[at + device["node"]] - before) + (before - behind)
    return drop - floats[data + CRACKING_PRESSURE], floats[data + PILOT_EXCESS] + pilot


@njit
def events(t, y, out, tables, device, g):
    """Write an event function and its negative to g.

    While the valve is shut, it is the greater excess minus PRESSURE_MARGIN [Pa]. While it is open, it is the flow or
    the excess of the pilot times a typical slope, whichever is greater [kg/s]. For an open valve at a junction without
    flow, the drop plus PRESSURE_MARGIN replaces the flow.
    """
    k, at = device["valve"], device["event"]
    forward, pilot = excesses(out, tables, device)
    if tables.armed[at] > 0.0:
        event_pair(tables, g, at, max(forward, pilot) - PRESSURE_MARGIN)
        return
    slope = sqrt(tables.valves[k]["conductance"] / TYPICAL_DROP)
    flow = out[tables.layout[0]["valve"] + k]
    if flow == 0.0 and joins_junction(tables, device):
        flow = slope * (head_drop(tables, out, k)[1] + PRESSURE_MARGIN)
    event_pair(tables, g, at, max(flow, slope * pilot))


@njit
def value(t, y, out, tables, device, quantity):
    """Opening of the valve: 1 if open, 0 if shut."""
    return 1.0 if out[tables.layout[0]["conductance"] + device["valve"]] > 0.0 else 0.0
