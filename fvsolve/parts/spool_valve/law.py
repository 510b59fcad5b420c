"""A spool that follows a command, and the openings of its metering edges.

x'' = w^2 e - 2 zeta w x', |x'| <= fastest, with position x, angular frequency w, damping ratio zeta and
e = command - x; hysteresis takes half its width off |e|, and a dead band acts on the command. An edge has the opening
max(0, a x + b). Without states x is the command, or the position of the lower stop if that is greater.

The state is the deviation of x from its start, and x'. Flags, which change on accepted states only: the spool rests at
its stop (UPPER, LOWER) or moves at its greatest speed (FORWARD, BACKWARD); the error does not exceed the half width
(RISE, FALL); the command does not exceed the dead band (ABOVE, BELOW); x is below the position of an edge (EDGE).
"""

from fvsolve.core.kernels.dtypes import RATE, RATE_UNWANTED
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.core.kernels.self_acting_valves import event_pair
from fvsolve.jit import njit

# indices into its numbers; each edge has a, b and the flag of its position, then follow these positions
(
    START,
    LEAST,
    ANGULAR_FREQUENCY,
    DAMPING,
    FASTEST,
    HALF_WIDTH,
    DEAD_BAND,
    EDGES,
    POSITIONS,
    FIRST_EDGE,
) = range(10)
UPPER, LOWER, FORWARD, BACKWARD, RISE, FALL, ABOVE, BELOW, EDGE = range(0, 18, 2)  # flags
# drive away from a stop or from the greatest speed at which the spool leaves it; above rounding
STOP_MARGIN = 1e-10
DIRECTION_TIME = 1e-6  # time over 1 / w that the speed is extrapolated for the direction of motion
# distance beyond a kink at which its flag changes, so that rounding does not change it
MARGIN = 1e-12


@njit
def spool_command(t, tables, device):
    """Position that the command asks for, after the dead band."""
    floats = tables.floats
    armed = tables.armed
    at = device["event"]
    u, d = schedule_value(tables, device["schedule"], t), floats[device["data"] + DEAD_BAND]
    if d == 0.0:
        return u
    if armed[at + ABOVE] == 0.0:
        return (u - d) / (1.0 - d)
    return (u + d) / (1.0 - d) if armed[at + BELOW] == 0.0 else 0.0


@njit
def spool_position(t, y, tables, device):
    """Position x of the spool [-]."""
    if device["states"] == 0:
        at_stop = tables.armed[device["event"] + LOWER] > 0.0
        return (
            tables.floats[device["data"] + LEAST] if at_stop else spool_command(t, tables, device)
        )
    return tables.floats[device["data"] + START] + y[device["y"]]


@njit
def set(t, y, out, tables, device):
    """Write to `out` the conductances G o^2 of all edges [kg2/s2/Pa]; G : conductance at full opening, o : opening"""
    floats = tables.floats
    at = device["data"]
    k = device["valve"]
    x = spool_position(t, y, tables, device)
    for e in range(int(floats[at + EDGES])):
        line = at + FIRST_EDGE + 3 * e
        is_below = tables.armed[device["event"] + int(floats[line + 2])] > 0.0
        opening = (
            max(floats[line] * x + floats[line + 1], 0.0)
            if (floats[line] > 0.0) != is_below
            else 0.0
        )
        out[tables.layout[0]["conductance"] + k + e] = (
            tables.valves[k + e]["conductance"] * opening * opening
        )


@njit
def spool_error(t, y, tables, device):
    """Command less position, beyond the half width of the hysteresis [-]."""
    floats = tables.floats
    armed = tables.armed
    at = device["event"]
    e = (spool_command(t, tables, device) - floats[device["data"] + START]) - y[device["y"]]
    half = floats[device["data"] + HALF_WIDTH]
    if half == 0.0:
        return e
    if armed[at + RISE] == 0.0:
        return e - half
    return e + half if armed[at + FALL] == 0.0 else 0.0


@njit
def move(t, y, dydt, out, tables, device):
    """Write the rates of position and speed to `dydt`; raise out[RATE] to the rate of the spool."""
    if device["states"] == 0:
        return
    floats = tables.floats
    armed = tables.armed
    at = device["event"]
    o = device["y"]
    data = device["data"]
    w, damping = floats[data + ANGULAR_FREQUENCY], floats[data + DAMPING]
    if out[RATE] != RATE_UNWANTED:
        out[RATE] = max(out[RATE], w * max(1.0, 2.0 * damping))
    if armed[at + UPPER] > 0.0 or armed[at + LOWER] > 0.0:
        dydt[o], dydt[o + 1] = 0.0, 0.0
        return
    dydt[o], dydt[o + 1] = y[o + 1], 0.0
    if armed[at + FORWARD] == 0.0 and armed[at + BACKWARD] == 0.0:
        dydt[o + 1] = w * (w * spool_error(t, y, tables, device) - 2.0 * damping * y[o + 1])


@njit
def events(t, y, out, tables, device, g):
    """Write the event functions of all flags to g, each followed by its negative.

    They are distances from stops, from the greatest speed and from kinks. At a stop and at the greatest speed they are
    the acceleration away from it, over w^2.
    """
    floats = tables.floats
    at = device["event"]
    data = device["data"]
    for flag in range(UPPER, EDGE, 2):
        event_pair(tables, g, at + flag, 1.0)
    if floats[data + DEAD_BAND] > 0.0:
        u = schedule_value(tables, device["schedule"], t)
        kink_event(tables, g, at + ABOVE, u - floats[data + DEAD_BAND])
        kink_event(tables, g, at + BELOW, -u - floats[data + DEAD_BAND])
    x = spool_position(t, y, tables, device)
    positions = data + int(floats[data + POSITIONS])
    for i in range(int(floats[positions])):
        kink_event(tables, g, at + EDGE + 2 * i, x - floats[positions + 1 + i])
    if device["states"] > 0:
        motion_events(t, y, tables, device, g, x)
    else:
        kink_event(tables, g, at + LOWER, spool_command(t, tables, device) - floats[data + LEAST])


@njit
def kink_event(tables, g, at, left):
    """Write the event functions of a kink at which `left` is zero to g, with a margin beyond it."""
    event_pair(tables, g, at, left - MARGIN if tables.armed[at] > 0.0 else left + MARGIN)


@njit
def motion_events(t, y, tables, device, g, x):
    """Write the event functions of stops, greatest speed and hysteresis to g; x : position [-]"""
    floats = tables.floats
    armed = tables.armed
    at = device["event"]
    data = device["data"]
    v = y[device["y"] + 1]
    w = floats[data + ANGULAR_FREQUENCY]
    half = floats[data + HALF_WIDTH]
    fastest = floats[data + FASTEST]
    if half > 0.0:
        e = (spool_command(t, tables, device) - floats[data + START]) - y[device["y"]]
        kink_event(tables, g, at + RISE, e - half)
        kink_event(tables, g, at + FALL, -e - half)
    error = spool_error(t, y, tables, device)
    onward = v / w + DIRECTION_TIME * error
    upper, lower = -error - STOP_MARGIN, error - STOP_MARGIN
    if armed[at + UPPER] == 0.0:
        upper = max(1.0 - x, -onward)
    if armed[at + LOWER] == 0.0:
        lower = max(x - floats[data + LEAST], onward)
    event_pair(tables, g, at + UPPER, upper)
    event_pair(tables, g, at + LOWER, lower)
    if fastest > 0.0 and armed[at + UPPER] == 0.0 and armed[at + LOWER] == 0.0:
        push = error - 2.0 * floats[data + DAMPING] * v / w
        forward, backward = -push - STOP_MARGIN, push - STOP_MARGIN
        if armed[at + FORWARD] == 0.0:
            forward = max(1.0 - v / fastest, -push)
        if armed[at + BACKWARD] == 0.0:
            backward = max(1.0 + v / fastest, push)
        event_pair(tables, g, at + FORWARD, forward)
        event_pair(tables, g, at + BACKWARD, backward)


@njit
def value(t, y, out, tables, device, quantity):
    """Position of the spool, -1 to 1."""
    return spool_position(t, y, tables, device)
