"""A disc on a spring that opens a restriction, M |M| = G x^2 dP. Knows one disc; knows no network.

T dx/dt = target - x, or x'' = w^2 (target - x) - 2 zeta w x', between its seat at 0 and its stop at 1, where it comes
to rest: armed[event] says that it is against its stop, armed[event + 2] that it is on its seat. target =
(what is felt - what begins to open it) / span, of the pressure before a relief valve, of the drop across a check valve.

Where it alone holds a rigid column, it leads that from its seat (armed[event + 4]): `devices.lead`.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.either import either
from fvsolve.kernels.feedback import loop_rate
from fvsolve.kernels.lead import lead_events, leads
from fvsolve.kernels.records import CLOSING, RATE
from fvsolve.kernels.restrictions import head_drop

RELIEF, CHECK = 0, 1  # modes
LIFT, TARGET, FELT, SPAN, TIME, SWING, DAMPING = 0, 1, 2, 3, 4, 5, 6  # numbers: three of the start, then its keys
AT_REST = 1e-10  # share of its span that does not lift it off a stop: rounding must not
SETTLED = 0.5 * AT_REST  # by which it comes to rest sooner than it leaves
EARLY = 1e-6  # share of 1 / w by which it is asked which way it moves
SLAM = 1e-9  # share of T or 1 / w in which a disc that is about to reach its seat has done so


@njit
def disc_lift(y, tables, device):
    """Lift x, beyond its stops by rounding at most."""
    return tables.floats[device["data"] + LIFT] + y[device["y"]]


@njit
def set(t, y, out, tables, device):
    """Its conductance G x^2."""
    k, x = device["valve"], min(max(disc_lift(y, tables, device), 0.0), 1.0)
    out[tables.layout[0]["conductance"] + k] = tables.valves[k]["conductance"] * x * x


@njit
def disc_drive(y, out, tables, device):
    """target - x."""
    k = device["valve"]
    before = out[tables.layout[0]["pressure"] + tables.valves[k]["from_node"]]
    return disc_push(y, tables, device, before, head_drop(tables, out, k)[1])


@njit
def disc_push(y, tables, device, before, drop):
    """target - x, at p' before it and a drop across it."""
    floats, data = tables.floats, device["data"]
    felt = before if device["mode"] == RELIEF else drop - floats[data + FELT]
    return (floats[data + TARGET] - floats[data + LIFT]) + felt / floats[data + SPAN] - y[device["y"]]


@njit
def lead(t, y, tables, device, before, behind, drop, ahead):
    """dx/dt at p' before it and a drop across it, and what of it rises with the drop [1/Pa/s]."""
    floats, armed, at, data = tables.floats, tables.armed, device["event"], device["data"]
    if armed[at] > 0.0 or armed[at + 2] > 0.0:
        return 0.0, 0.0
    if device["states"] == 2:
        return y[device["y"] + 1], 0.0
    felt = device["mode"] == CHECK or ahead
    slope = disc_slope(tables, device) if felt else 0.0
    return disc_push(y, tables, device, before, drop) / floats[data + TIME], slope


@njit
def disc_slope(tables, device):
    """d(dx/dt) / d(what it feels) [1/Pa/s]; none of a disc with inertia."""
    floats, data = tables.floats, device["data"]
    return 1.0 / (floats[data + TIME] * floats[data + SPAN]) if device["states"] == 1 else 0.0


@njit
def move(t, y, dydt, out, tables, device):
    """Rates of its lift and of its speed, none against a stop; its greatest rate.

    And -x'/x where it closes on a column into out[CLOSING]: one that flows back slams it, x ~ (time left)^(1/3), which
    no step leads across.
    """
    floats, armed, at, o = tables.floats, tables.armed, device["event"], device["y"]
    drive, held = disc_drive(y, out, tables, device), armed[at] > 0.0 or armed[at + 2] > 0.0
    time, swing = floats[device["data"] + TIME], floats[device["data"] + SWING]
    own = 1.0 / time if device["states"] == 1 else swing * max(1.0, 2.0 * floats[device["data"] + DAMPING])
    out[RATE] = max(out[RATE], own if held else disc_loop(y, out, tables, device, own))
    if dydt.size == 0:
        return
    if device["states"] == 1:
        dydt[o] = 0.0 if held else drive / time
    else:
        dydt[o] = 0.0 if held else y[o + 1]
        dydt[o + 1] = 0.0 if held else swing * (swing * drive - 2.0 * floats[device["data"] + DAMPING] * y[o + 1])
    valve, nodes = tables.valves[device["valve"]], tables.nodes
    brakes = nodes[valve["from_node"]]["gates"] >= 0 or nodes[valve["to_node"]]["gates"] >= 0
    if brakes and dydt[o] < 0.0 and not leads(tables, device["valve"]):
        out[CLOSING] = max(out[CLOSING], -dydt[o] / max(disc_lift(y, tables, device), 1e-300))


@njit
def disc_loop(y, out, tables, device, own):
    """Its rate with that of the places at its ends in the loop; where a column sets its flow, d dP / dx = -2 dP / x."""
    k, speed, nodes = device["valve"], own / tables.floats[device["data"] + SPAN], tables.nodes
    before, behind = tables.valves[k]["from_node"], tables.valves[k]["to_node"]
    if leads(tables, k):
        return own
    rate = own + loop_rate(out, tables, k, before, speed)
    if device["mode"] != RELIEF:
        rate += loop_rate(out, tables, k, behind, speed)
    if nodes[before]["gates"] >= 0 or (nodes[behind]["gates"] >= 0 and device["mode"] != RELIEF):
        rate += 2.0 * speed * abs(head_drop(tables, out, k)[1]) / max(disc_lift(y, tables, device), 1e-300)
    return rate if device["states"] == 1 else sqrt(own * rate)


@njit
def events(t, y, out, tables, device, g):
    """g: way to its stop, to its seat, to where it leads no column any more; each both ways."""
    armed, at, o = tables.armed, device["event"], device["y"]
    x, drive = disc_lift(y, tables, device), disc_drive(y, out, tables, device)
    stop, seat = -drive - AT_REST, drive - AT_REST
    if device["states"] == 1:
        down = AT_REST if armed[at + 4] > 0.0 else -SETTLED  # its column holds it back, as it did not on its seat
        onward, speed = (drive + down, drive + SETTLED), drive
    else:
        speed = y[o + 1] / tables.floats[device["data"] + SWING] + EARLY * drive
        onward = speed, speed
    if armed[at] == 0.0:
        stop = max(1.0 - x, -onward[1])
    if armed[at + 2] == 0.0:
        seat = max(x + SLAM * min(speed, 0.0), onward[0])
    either(tables, g, at, stop)
    either(tables, g, at + 2, seat)
    lead_events(out, tables, device, g, x, 1.0 if armed[at + 2] > 0.0 else 0.0, disc_slope(tables, device))


@njit
def value(t, y, out, tables, device, which):
    """Its lift, 0 to 1."""
    return min(max(disc_lift(y, tables, device), 0.0), 1.0)
