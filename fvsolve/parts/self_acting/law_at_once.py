"""Control valve that keeps the sensed pressure or flow at its set value at every moment.

It is shut, fully open, or holds its set value: then the network is solved with this value, and the flow of the valve
follows from the balance of its node (`node_clusters.hold_pressures`). Flags: armed[event + SHUT], against reverse flow
or because the pressure at its end is given; armed[event + FULL], fully open. They change on accepted states only.
"""

from fvsolve.core.kernels.dtypes import NOT_HELD
from fvsolve.core.kernels.restrictions import flow_at_drop, head_drop, transition_of
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.core.kernels.self_acting_valves import event_pair
from fvsolve.jit import njit

REDUCING, SUSTAINING, FLOW_CONTROL = 0, 1, 2  # modes
OPENING, ERROR, SET = 0, 1, 2  # numbers of a device at the start
SHUT, FULL = 0, 2  # offsets of event flags
MARGIN = 1e-3  # pressure beyond which it changes its state, so that rounding does not [Pa]
FLOW_MARGIN = 1e-9  # flow beyond which it begins to control, over its set flow


@njit
def held_value(t, tables, device):
    """Value that the valve holds: change since the start of the sensed pressure [Pa], or its flow [kg/s]."""
    floats, data = tables.floats, device["data"]
    change = schedule_value(tables, device["schedule"], t) - floats[data + SET]
    if device["mode"] == FLOW_CONTROL:
        return floats[data + SET] + change
    return change + (floats[data + ERROR] if device["mode"] == REDUCING else -floats[data + ERROR])


@njit
def set(t, y, out, tables, device):
    """Write the conductance of the open valve to `out`, 0 while it is shut, and the value that it holds, if any."""
    k = device["valve"]
    armed = tables.armed
    layout = tables.layout[0]
    shut, full = armed[device["event"] + SHUT] > 0.0, armed[device["event"] + FULL] > 0.0
    out[layout["conductance"] + k] = 0.0 if shut else tables.valves[k]["conductance"]
    holds = not shut and not full and tables.valves[k]["hold"] >= 0
    out[layout["drive"] + k] = held_value(t, tables, device) if holds else NOT_HELD


@njit
def control_error(t, out, tables, device):
    """Control error [Pa] or [kg/s], positive if the valve must open."""
    valve = tables.valves[device["valve"]]
    layout = tables.layout[0]
    value = held_value(t, tables, device)
    if device["mode"] == FLOW_CONTROL:
        return value - out[layout["valve"] + device["valve"]]
    if device["mode"] == REDUCING:
        return value - out[layout["pressure"] + valve["to_node"]]
    return out[layout["pressure"] + valve["from_node"]] - value


@njit
def spare_flow(out, tables, k, margin):
    """Flow of the fully open valve k at its present drop plus `margin` [Pa], minus its present flow [kg/s]."""
    valve, drop = tables.valves[k], head_drop(tables, out, k)[1] + margin
    g = valve["conductance"]
    return flow_at_drop(g, transition_of(valve, g), drop) - out[tables.layout[0]["valve"] + k]


@njit
def events(t, y, out, tables, device, g):
    """Write two event functions to g, each followed by its negative.

    The first is the flow [kg/s], or the drop plus MARGIN where there is none; while the valve is shut the lesser of the
    drop and the control error, less MARGIN [Pa]. The second is the flow that the valve could pass in addition [kg/s];
    while it is fully open, the control error with the opposite sign, less a margin.
    """
    k = device["valve"]
    at = device["event"]
    armed = tables.armed
    error, drop = control_error(t, out, tables, device), head_drop(tables, out, k)[1]
    margin = (
        FLOW_MARGIN * abs(error + out[tables.layout[0]["valve"] + k])
        if device["mode"] == FLOW_CONTROL
        else MARGIN
    )
    back, full = out[tables.layout[0]["valve"] + k], spare_flow(out, tables, k, MARGIN)
    if back == 0.0:
        back = drop + MARGIN
    if device["mode"] == FLOW_CONTROL:
        back = 1.0
    elif tables.valves[k]["hold"] < 0:  # the sensed pressure is given: the valve cannot change it
        back = min(back, error + MARGIN)
    if armed[at + SHUT] > 0.0:  # it opens again as it was
        back, full = min(drop, error) - MARGIN, -1.0 if armed[at + FULL] > 0.0 else 1.0
    elif armed[at + FULL] > 0.0:
        full = -error - margin
    if tables.valves[k]["hold"] < 0:
        full = -1.0
    event_pair(tables, g, at + SHUT, back)
    event_pair(tables, g, at + FULL, full)


@njit
def value(t, y, out, tables, device, quantity):
    """Opening of the valve, 0 to 1: that at which its law gives its flow."""
    k, layout = device["valve"], tables.layout[0]
    if out[layout["conductance"] + k] == 0.0:
        return 0.0
    flow = out[layout["valve"] + k]
    most = flow + spare_flow(out, tables, k, 0.0)
    return (
        min(max(flow / most, 0.0), 1.0)
        if out[layout["drive"] + k] < NOT_HELD and most > 0.0
        else 1.0
    )
