"""A check valve that shuts at a reverse velocity given by its manufacturer's curve.

It is OPEN, or REVERSED (the flow has reversed and the valve is still open), or SHUT. The flags armed[event] to
armed[event + 2] mark the mode and change on accepted states only. While it is REVERSED, two states store the reverse
velocity at which the valve shuts [m/s] and the deceleration of the flow at the reversal [m/s2]; otherwise they are 0.
"""

from fvsolve.core.kernels.restrictions import head_drop
from fvsolve.jit import njit
from fvsolve.parts.self_acting.law_check_valve import PRESSURE_MARGIN, joins_junction

# flags; the last: the deceleration exceeds the curve
REVERSED, SHUT, OPEN, BEYOND_CURVE = 0, 1, 2, 3
# Numbers: cracking pressure [Pa], mass flow at 1 m/s [kg/s], last rate of the curve [m/s2]
CRACKING_PRESSURE, UNIT_FLOW, LAST_RATE = 0, 1, 2
UNKNOWN = -1
FORWARD_VELOCITY = 1e-6  # velocity from which a reversed flow counts as forward again [m/s]
SMALLEST = 1e-300


@njit
def valve_mode(y, tables, device):
    """Mode of the valve by its flags: REVERSED (the flow has reversed, the valve is open), SHUT or OPEN.

    If no flag is set, it is REVERSED if the states contain a slam velocity, otherwise UNKNOWN.
    """
    for mode in range(BEYOND_CURVE):
        if tables.armed[device["event"] + mode] > 0.0:
            return mode
    return REVERSED if y[device["y"]] > 0.0 else UNKNOWN


@njit
def set(t, y, out, tables, device):
    """Write to `out` the conductance of the valve [kg2/s2/Pa], 0 while it is shut."""
    k, shut = device["valve"], tables.armed[device["event"] + SHUT] > 0.0
    out[tables.layout[0]["conductance"] + k] = 0.0 if shut else tables.valves[k]["conductance"]


@njit
def move(t, y, dydt, out, tables, device):
    """Write zero rates to `dydt`: the states of the valve change by events only."""
    dydt[device["y"]] = dydt[device["y"] + 1] = 0.0


@njit
def events(t, y, out, tables, device, g):
    """Write four event functions to g: of the modes REVERSED, SHUT and OPEN, and of the range of the curve.

    The function of the present mode is minus the margin left in this mode; that of a mode that may follow is the
    margin.
    The margin is the velocity left until the flow reverses, is forward again, or the valve shuts [m/s].
    Of a shut valve it is the drop left until it opens [Pa]; of an open valve at a junction without flow, it is the drop
    plus PRESSURE_MARGIN [Pa].
    The last function is the last deceleration of the curve minus that at the reversal [m/s2].
    """
    k = device["valve"]
    at = device["event"]
    data = device["data"]
    o = device["y"]
    present = valve_mode(y, tables, device)
    flow = out[tables.layout[0]["valve"] + k]
    v = flow / tables.floats[data + UNIT_FLOW]
    for mode in range(BEYOND_CURVE):
        g[at + mode] = 1.0
    if present == SHUT:
        set_mode_events(
            g,
            at,
            SHUT,
            OPEN,
            tables.floats[data + CRACKING_PRESSURE]
            + PRESSURE_MARGIN
            - head_drop(tables, out, k)[1],
        )
    elif present == REVERSED:
        if v < FORWARD_VELOCITY:
            set_mode_events(g, at, REVERSED, SHUT, v + y[o] if y[o] > 0.0 else 1.0)
            g[at + OPEN] = FORWARD_VELOCITY - v
        else:
            set_mode_events(g, at, REVERSED, OPEN, FORWARD_VELOCITY - v)
    else:
        margin = (
            head_drop(tables, out, k)[1] + PRESSURE_MARGIN
            if flow == 0.0 and joins_junction(tables, device)
            else v
        )
        set_mode_events(g, at, OPEN, REVERSED if present == OPEN else SHUT, margin)
    g[at + BEYOND_CURVE] = tables.floats[data + LAST_RATE] - y[o + 1]


@njit
def set_mode_events(g, at, mode, later, margin):
    """Write to g the event functions of a mode, -`margin`, and of the mode `later` that follows it, `margin`.

    The mode lasts while the margin is positive. at : index of the first event function of the valve
    """
    margin = -SMALLEST if margin == 0.0 else margin
    g[at + mode], g[at + later] = -margin, margin


@njit
def value(t, y, out, tables, device, quantity):
    """Opening of the valve: 1 if open, 0 if shut."""
    return 1.0 if out[tables.layout[0]["conductance"] + device["valve"]] > 0.0 else 0.0
