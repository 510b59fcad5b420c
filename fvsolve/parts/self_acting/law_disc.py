"""A disc on a spring that opens a restriction, M |M| = G x^2 dP.

M is the mass flow, G the conductance at full opening, dP the drop, x the lift: 0 on the seat, 1 at the stop. The lift
follows T dx/dt = target - x or x'' = w^2 (target - x) - 2 zeta w x', with time constant T, or angular frequency w and
damping ratio zeta. target = (lifting pressure - opening pressure) / span; the lifting pressure is the upstream pressure
of a relief valve, the drop across a check valve, or a weighted sum of two sensed pressures. The disc rests at its stop
(flag armed[event]) and on its seat (armed[event + 2]). In mode FREE_BACK reverse flow (armed[event + 6]) passes the
full opening, independent of the lift.

A disc that alone joins a rigid column controls its flow near the seat (armed[event + 4]): `kernels.self_acting_valves`.
"""

from math import sqrt

from fvsolve.core.kernels.dtypes import CLOSING, RATE, RATE_UNWANTED
from fvsolve.core.kernels.restrictions import head_drop
from fvsolve.core.kernels.self_acting_valves import (
    control_events,
    controls_column,
    event_pair,
    loop_rate,
    sensed_pressure,
    sensed_rate,
)
from fvsolve.jit import njit

RELIEF, CHECK, SENSED, FREE_BACK = 0, 1, 2, 3  # modes
# indices into its numbers: lift, target and lifting pressure at the start, then the keys
LIFT = 0
TARGET = 1
LIFTING_PRESSURE = 2
SPAN = 3
TIME_CONSTANT = 4
ANGULAR_FREQUENCY = 5
DAMPING = 6
# drive away from a stop, over the span, at which the disc leaves it; above rounding
STOP_MARGIN = 1e-10
# share of the span by which it comes to rest earlier than it leaves
SETTLE_MARGIN = 0.5 * STOP_MARGIN
DIRECTION_TIME = 1e-6  # time over 1 / w that its speed is extrapolated for the direction of motion
ALMOST_SHUT = 1e-6  # lift below which its flow may be rounding
BACK_MARGIN = 1e-3  # reverse drop that starts reverse flow through a seated disc [Pa]
# flow over that at a drop of the span from which a reversed flow is forward again
FORWARD_MARGIN = 1e-10
SLAM_TIME = 1e-9  # time over T or 1 / w before the seat at which a closing disc counts as seated


@njit
def disc_lift(y, tables, device):
    """Lift x of the disc [-], between 0 and 1 except for rounding."""
    return tables.floats[device["data"] + LIFT] + y[device["y"]]


@njit
def set(t, y, out, tables, device):
    """Write to `out` the conductance G x^2 of the restriction [kg2/s2/Pa]; G : conductance at full opening, x : lift"""
    k, x = device["valve"], min(max(disc_lift(y, tables, device), 0.0), 1.0)
    if device["mode"] == FREE_BACK and tables.armed[device["event"] + 6] > 0.0:
        x = 1.0
    out[tables.layout[0]["conductance"] + k] = tables.valves[k]["conductance"] * x * x


@njit
def disc_drive(y, out, tables, device):
    """Target lift minus lift of the disc at the present pressures [-]."""
    k = device["valve"]
    before = out[tables.layout[0]["pressure"] + tables.valves[k]["from_node"]]
    if device["mode"] >= SENSED:
        before = sensed_pressure(tables, out, device)
    return disc_drive_at(y, tables, device, before, head_drop(tables, out, k)[1])


@njit
def disc_drive_at(y, tables, device, before, drop):
    """Target lift minus lift of the disc [-] at given pressures.

    before : upstream pressure minus that at the start, or weighted sum of sensed pressures [Pa]
    drop : pressure drop across the disc [Pa]
    y : state vector; device : row of the disc in the table of devices
    """
    floats, data = tables.floats, device["data"]
    lifting = before if device["mode"] != CHECK else drop - floats[data + LIFTING_PRESSURE]
    return (
        (floats[data + TARGET] - floats[data + LIFT])
        + lifting / floats[data + SPAN]
        - y[device["y"]]
    )


@njit
def lead(t, y, tables, device, before, behind, drop, ahead):
    """(rate of the lift dx/dt [1/s], its derivative by the drop [1/s/Pa]) of the disc at given pressures.

    before, behind : pressures at the ends minus those at the start [Pa]; drop : drop across the valve [Pa]
    ahead : True if the upstream pressure causes the change of the drop, False if the downstream pressure does
    """
    floats = tables.floats
    armed = tables.armed
    at = device["event"]
    data = device["data"]
    if armed[at] > 0.0 or armed[at + 2] > 0.0:
        return 0.0, 0.0
    if device["states"] == 2:
        return y[device["y"] + 1], 0.0
    by_drop = device["mode"] == CHECK or ahead
    slope = lift_rate_slope(tables, device) if by_drop else 0.0
    return disc_drive_at(y, tables, device, before, drop) / floats[data + TIME_CONSTANT], slope


@njit
def lift_rate_slope(tables, device):
    """Derivative [1/s/Pa] of the rate of the lift dx/dt by the lifting pressure; 0 unless the disc has a lag."""
    floats, data = tables.floats, device["data"]
    return (
        1.0 / (floats[data + TIME_CONSTANT] * floats[data + SPAN]) if device["states"] == 1 else 0.0
    )


@njit
def move(t, y, dydt, out, tables, device):
    """Write the rates of lift and speed of the disc to `dydt`, 0 at stop and seat; raise out[RATE] to its rate limit.

    While the disc closes on a rigid column, out[CLOSING] is raised to -x'/x, with the lift x. A column that flows back
    slams the disc, with x ~ (time left)^(1/3), and a time step must not pass that instant.
    """
    floats = tables.floats
    armed = tables.armed
    at = device["event"]
    o = device["y"]
    drive, stopped = disc_drive(y, out, tables, device), armed[at] > 0.0 or armed[at + 2] > 0.0
    time, swing = floats[device["data"] + TIME_CONSTANT], floats[device["data"] + ANGULAR_FREQUENCY]
    own = (
        1.0 / time
        if device["states"] == 1
        else swing * max(1.0, 2.0 * floats[device["data"] + DAMPING])
    )
    if out[RATE] != RATE_UNWANTED:
        out[RATE] = max(out[RATE], own if stopped else disc_rate_limit(y, out, tables, device, own))
    if device["states"] == 1:
        dydt[o] = 0.0 if stopped else drive / time
    else:
        dydt[o] = 0.0 if stopped else y[o + 1]
        dydt[o + 1] = (
            0.0
            if stopped
            else swing * (swing * drive - 2.0 * floats[device["data"] + DAMPING] * y[o + 1])
        )
    valve, nodes = tables.valves[device["valve"]], tables.nodes
    on_column = nodes[valve["from_node"]]["gates"] >= 0 or nodes[valve["to_node"]]["gates"] >= 0
    if on_column and dydt[o] < 0.0 and not controls_column(tables, device["valve"]):
        out[CLOSING] = max(out[CLOSING], -dydt[o] / max(disc_lift(y, tables, device), 1e-300))


@njit
def disc_rate_limit(y, out, tables, device, own):
    """Rate limit [1/s] of the disc together with the nodes at its ends; own : rate of the disc alone [1/s]

    Where a rigid column sets the flow, the derivative of the drop dP by the lift x is -2 dP / x.
    """
    k = device["valve"]
    speed = own / tables.floats[device["data"] + SPAN]
    nodes = tables.nodes
    before, behind = tables.valves[k]["from_node"], tables.valves[k]["to_node"]
    if controls_column(tables, k):
        return own
    if device["mode"] >= SENSED:
        rate = own + sensed_rate(out, tables, device, speed)
    else:
        rate = own + loop_rate(out, tables, k, before, speed)
    if device["mode"] == CHECK:
        rate += loop_rate(out, tables, k, behind, speed)
    if nodes[before]["gates"] >= 0 or (nodes[behind]["gates"] >= 0 and device["mode"] != RELIEF):
        rate += (
            2.0
            * speed
            * abs(head_drop(tables, out, k)[1])
            / max(disc_lift(y, tables, device), 1e-300)
        )
    return rate if device["states"] == 1 else sqrt(own * rate)


@njit
def events(t, y, out, tables, device, g):
    """Write three event functions to g, each followed by its negative.

    They are the distances of the lift from the stop and from the seat, and from the lift at which the disc stops
    controlling a rigid column, or begins to.
    While the disc rests there, the distance from stop or seat is replaced by the drive away from it, minus STOP_MARGIN.
    The drive is the target minus the lift on the seat, and its negative at the stop. In mode FREE_BACK a fourth event
    function is the flow [kg/s], less a margin while it is reversed, or for a disc on its seat the drop plus BACK_MARGIN
    [Pa].
    """
    armed = tables.armed
    at = device["event"]
    o = device["y"]
    x, drive = disc_lift(y, tables, device), disc_drive(y, out, tables, device)
    stop, seat = -drive - STOP_MARGIN, drive - STOP_MARGIN
    if device["states"] == 1:
        # the column delays it, unlike on the seat
        down = STOP_MARGIN if armed[at + 4] > 0.0 else -SETTLE_MARGIN
        onward, speed = (drive + down, drive + SETTLE_MARGIN), drive
    else:
        speed = (
            y[o + 1] / tables.floats[device["data"] + ANGULAR_FREQUENCY] + DIRECTION_TIME * drive
        )
        onward = speed, speed
    if armed[at] == 0.0:
        stop = max(1.0 - x, -onward[1])
    if armed[at + 2] == 0.0:
        seat = max(x + SLAM_TIME * min(speed, 0.0), onward[0])
    event_pair(tables, g, at, stop)
    event_pair(tables, g, at + 2, seat)
    if device["controls_column"] >= 0:
        control_events(
            out,
            tables,
            device,
            g,
            x,
            1.0 if armed[at + 2] > 0.0 else 0.0,
            lift_rate_slope(tables, device),
        )
    else:
        event_pair(tables, g, at + 4, 1.0)
    if device["mode"] == FREE_BACK:
        flow = out[tables.layout[0]["valve"] + device["valve"]]
        if armed[at + 6] == 0.0 and (x <= ALMOST_SHUT or flow == 0.0):
            flow = head_drop(tables, out, device["valve"])[1] + BACK_MARGIN
        elif armed[at + 6] > 0.0:
            span = tables.floats[device["data"] + SPAN]
            flow -= FORWARD_MARGIN * sqrt(tables.valves[device["valve"]]["conductance"] * span)
        event_pair(tables, g, at + 6, flow)


@njit
def value(t, y, out, tables, device, quantity):
    """Lift of the disc, 0 to 1; 1 while a reversed flow passes the full opening."""
    if device["mode"] == FREE_BACK and tables.armed[device["event"] + 6] > 0.0:
        return 1.0
    return min(max(disc_lift(y, tables, device), 0.0), 1.0)
