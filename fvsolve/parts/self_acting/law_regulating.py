"""Control valve that moves until the sensed pressure or flow has its set value.

dx/dt = error / (band T), 0 <= x <= 1, M |M| = G x^2 dP, with opening x, time constant T, mass flow M, conductance G at
full opening and drop dP. Flags: armed[event], shut against reverse flow; armed[event + 2], fully open;
armed[event + 4], on its seat. They change on accepted states only. If the valve is the only one at a rigid column, it
controls the flow of the column near its seat (armed[event + 6]).
"""

from math import sqrt

from fvsolve.core.kernels.dtypes import RATE, RATE_UNWANTED
from fvsolve.core.kernels.restrictions import head_drop
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.core.kernels.self_acting_valves import (
    control_events,
    controls_column,
    event_pair,
    loop_rate,
)
from fvsolve.jit import njit

REDUCING, SUSTAINING, FLOW_CONTROL = 0, 1, 2  # modes
# numbers of a device: three at the start, then its keys
OPENING, ERROR, SET, BAND, TIME = 0, 1, 2, 3, 4
# error over the band below which it stays at a stop, so that rounding does not move it
STOP_MARGIN = 1e-10
SETTLE_MARGIN = 0.5 * STOP_MARGIN  # margin by which it reaches a stop earlier than it leaves it
ALMOST_SHUT = 1e-6  # opening below which its flow may be rounding
RETURN_LIFT = 0.5  # fraction of the control lift below which it controls its column again
PRESSURE_MARGIN = 1e-3  # drop below which it stays shut against reverse flow [Pa]


@njit
def regulator_opening(y, tables, device):
    """Opening x of the valve [-], between 0 and 1 except for rounding."""
    return tables.floats[device["data"] + OPENING] + y[device["y"]]


@njit
def set(t, y, out, tables, device):
    """Write to `out` the conductance G x^2 of the valve [kg2/s2/Pa], 0 while it is shut against reverse flow.

    G : conductance at full opening, x : opening
    """
    k, x = device["valve"], min(max(regulator_opening(y, tables, device), 0.0), 1.0)
    back = tables.armed[device["event"]] > 0.0
    out[tables.layout[0]["conductance"] + k] = (
        0.0 if back else tables.valves[k]["conductance"] * x * x
    )


@njit
def lead(t, y, tables, device, before, behind, drop, ahead):
    """(rate of the opening dx/dt [1/s], its derivative by the drop [1/s/Pa]) of a pressure-controlled valve.

    before, behind : pressures at the ends minus those at the start [Pa]; drop : drop across the valve [Pa]
    ahead : True if the upstream pressure causes the change of the drop, False if the downstream pressure does; the
    derivative is 0 if the valve senses the other pressure
    """
    floats = tables.floats
    armed = tables.armed
    at = device["event"]
    data = device["data"]
    if armed[at + 2] > 0.0 or armed[at + 4] > 0.0:
        return 0.0, 0.0
    change = schedule_value(tables, device["schedule"], t) - floats[data + SET]
    slope = 1.0 / stroke(tables, device)
    reduces = device["mode"] == REDUCING
    error = change - behind if reduces else before - change
    return (floats[data + ERROR] + error) * slope, slope if ahead != reduces else 0.0


@njit
def stroke(tables, device):
    """Product of proportional band and time constant, so that dx/dt = error / stroke for the opening x."""
    return tables.floats[device["data"] + BAND] * tables.floats[device["data"] + TIME]


@njit
def regulator_error(t, out, tables, device):
    """Control error over the proportional band [-], positive if the valve must open.

    The error is the set value minus the sensed value, with the opposite sign for a pressure-sustaining valve.
    """
    layout = tables.layout[0]
    floats = tables.floats
    data = device["data"]
    valve = tables.valves[device["valve"]]
    change = schedule_value(tables, device["schedule"], t) - floats[data + SET]
    if device["mode"] == FLOW_CONTROL:
        change -= out[layout["valve"] + device["valve"]] - valve["flow"]
    elif device["mode"] == REDUCING:
        change -= out[layout["pressure"] + valve["to_node"]]
    else:
        change = out[layout["pressure"] + valve["from_node"]] - change
    return (floats[data + ERROR] + change) / floats[data + BAND]


@njit
def move(t, y, dydt, out, tables, device):
    """Write the rate of the opening to `dydt`, 0 at full opening and on the seat; raise out[RATE] to the rate limit."""
    if out[RATE] != RATE_UNWANTED:
        out[RATE] = max(out[RATE], regulator_rate(y, out, tables, device))
    armed, at = tables.armed, device["event"]
    rate = regulator_error(t, out, tables, device) / tables.floats[device["data"] + TIME]
    dydt[device["y"]] = 0.0 if armed[at + 2] > 0.0 or armed[at + 4] > 0.0 else rate


@njit
def regulator_rate(y, out, tables, device):
    """Rate of the control loop of the valve [1/s]; 0 while a pressure-controlled valve controls its rigid column.

    Where a rigid column sets the flow, the derivative of the drop dP by the opening x is -2 dP / x.
    """
    k, speed = device["valve"], 1.0 / stroke(tables, device)
    drop = abs(head_drop(tables, out, k)[1])
    if device["mode"] == FLOW_CONTROL:
        return speed * sqrt(tables.valves[k]["conductance"] * drop)
    end = (
        tables.valves[k]["to_node"] if device["mode"] == REDUCING else tables.valves[k]["from_node"]
    )
    if tables.nodes[end]["gates"] < 0:
        return loop_rate(out, tables, k, end, speed)
    return (
        0.0
        if controls_column(tables, k)
        else 2.0 * speed * drop / max(regulator_opening(y, tables, device), 1e-300)
    )


@njit
def events(t, y, out, tables, device, g):
    """Write four event functions to g, each followed by its negative.

    They are the flow [kg/s], or while the valve is shut against reverse flow the drop minus a margin [Pa]; the distance
    of the opening from full opening; its distance from the seat; and its distance from the opening at which the valve
    stops controlling a rigid column, or begins to.
    The first is the drop plus the margin for a valve that is almost shut or without flow, and 1 for flow control. While
    the valve rests fully open or on its seat, the error over the band that moves it away, minus STOP_MARGIN, replaces
    the distance.
    """
    layout, armed = tables.layout[0], tables.armed
    at = device["event"]
    x = regulator_opening(y, tables, device)
    error = regulator_error(t, out, tables, device)
    drop, back = head_drop(tables, out, device["valve"])[1], 1.0
    if device["mode"] != FLOW_CONTROL:
        back = out[layout["valve"] + device["valve"]]
        if x <= ALMOST_SHUT or back == 0.0:
            back = drop + PRESSURE_MARGIN
        if armed[at] > 0.0:
            back = drop - PRESSURE_MARGIN
    full, seat = -error - STOP_MARGIN, error - STOP_MARGIN
    if armed[at + 2] == 0.0:
        full = max(full + SETTLE_MARGIN, 1.0 - x)
    if armed[at + 4] == 0.0:  # a controlled column delays it, unlike on the seat
        seat = max(
            error + (STOP_MARGIN if controls_column(tables, device["valve"]) else -SETTLE_MARGIN), x
        )
    event_pair(tables, g, at, back)
    event_pair(tables, g, at + 2, full)
    event_pair(tables, g, at + 4, seat)
    control_events(
        out,
        tables,
        device,
        g,
        x,
        RETURN_LIFT if device["mode"] != FLOW_CONTROL else 0.0,
        1.0 / stroke(tables, device),
    )


@njit
def value(t, y, out, tables, device, quantity):
    """Opening of the valve, 0 to 1."""
    return min(max(regulator_opening(y, tables, device), 0.0), 1.0)
