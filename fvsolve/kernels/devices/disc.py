"""A disc on a spring that opens a restriction, M |M| = G x^2 dP. Knows one disc; knows no network.

T dx/dt = target - x, or x'' = w^2 (target - x) - 2 zeta w x', between its seat at 0 and its stop at 1, where it comes
to rest: armed[event] says that it is against its stop, armed[event + 2] that it is on its seat. target =
(what is felt - what begins to open it) / span, of the pressure before a relief valve, of the drop across a check valve.

Where it alone holds a rigid column, it leads that from its seat (armed[event + 4]) until its lift is above LEADS, and
a given step resolves what the two exchange: `kernels.columns`.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.devices.codes import CHECK_DISC, RELIEF_DISC
from fvsolve.kernels.devices.either import either
from fvsolve.kernels.devices.feedback import loop_rate
from fvsolve.kernels.records import (
    CLOSING,
    I_ARMED,
    I_COLUMNS,
    I_DEVICES,
    I_FLOATS,
    I_LAYOUT,
    I_NODES,
    I_SETTINGS,
    I_VALVES,
    RATE,
)
from fvsolve.kernels.restrictions import head_drop

LIFT, TARGET, FELT, SPAN, TIME, SWING, DAMPING = 0, 1, 2, 3, 4, 5, 6  # numbers: three of the start, then its keys
AT_REST = 1e-10  # share of its span that does not lift it off a stop: rounding must not
SETTLED = 0.5 * AT_REST  # by which it comes to rest sooner than it leaves
EARLY = 1e-6  # share of 1 / w by which it is asked which way it moves
SLAM = 1e-9  # share of T or 1 / w in which a disc that is about to reach its seat has done so
LEADS, AT_MOST = 1e-4, 0.03  # lift up to which it leads its column, and at most where a given step asks for more


@njit
def disc_lift(y, tables, device):
    """Lift x, beyond its stops by rounding at most."""
    return tables[I_FLOATS][device["data"] + LIFT] + y[device["y"]]


@njit
def set_disc(y, out, tables, device):
    """Its conductance G x^2."""
    k, x = device["valve"], min(max(disc_lift(y, tables, device), 0.0), 1.0)
    out[tables[I_LAYOUT][0]["conductance"] + k] = tables[I_VALVES][k]["conductance"] * x * x


@njit
def disc_drive(y, out, tables, device):
    """target - x."""
    k = device["valve"]
    before = out[tables[I_LAYOUT][0]["pressure"] + tables[I_VALVES][k]["from_node"]]
    return disc_push(y, tables, device, before, head_drop(tables, out, k)[1])


@njit
def disc_push(y, tables, device, before, drop):
    """target - x, at p' before it and a drop across it."""
    floats, data = tables[I_FLOATS], device["data"]
    felt = before if device["kind"] == RELIEF_DISC else drop - floats[data + FELT]
    return (floats[data + TARGET] - floats[data + LIFT]) + felt / floats[data + SPAN] - y[device["y"]]


@njit
def disc_speed(y, tables, device, before, drop):
    """dx/dt at p' before it and a drop across it, and d(dx/dt) / d(what it feels)."""
    floats, armed, at, data = tables[I_FLOATS], tables[I_ARMED], device["event"], device["data"]
    if armed[at] > 0.0 or armed[at + 2] > 0.0:
        return 0.0, 0.0
    if device["states"] == 2:
        return y[device["y"] + 1], 0.0
    return disc_push(y, tables, device, before, drop) / floats[data + TIME], 1.0 / floats[data + TIME] / floats[
        data + SPAN
    ]


@njit
def leads(tables, k):
    """Whether restriction k is a disc that leads the rigid column which it alone holds."""
    if tables[I_VALVES][k]["device"] < 0:
        return False
    device = tables[I_DEVICES][tables[I_VALVES][k]["device"]]
    return (device["kind"] == CHECK_DISC or device["kind"] == RELIEF_DISC) and tables[I_ARMED][
        device["event"] + 4
    ] > 0.0


@njit
def led_until(out, tables, device):
    """Lift above which it does not lead its column; 0 where it holds none alone."""
    valve, columns, most = tables[I_VALVES][device["valve"]], tables[I_COLUMNS], 0.0
    for k in range(columns.size):
        for i in (columns[k]["from_node"], columns[k]["to_node"]):
            joined, node = i == valve["from_node"] or i == valve["to_node"], tables[I_NODES][i]
            if joined and node["gates"] >= 0 and node["gate_count"] == 1 and node["columns"] == 1:
                most = max(most, led_beside(out, tables, device, columns[k]["area"] / columns[k]["length"]))
    return most


@njit
def led_beside(out, tables, device, yielding):
    """The same, beside a column of area over length `yielding`: LEADS, or where a given step resolves their exchange.

    Its rate is (2 dP / x) (1 / (T span) + (A / L) / sqrt(G dP)).
    """
    floats, data, step = tables[I_FLOATS], device["data"], tables[I_SETTINGS][0]["step"]
    root = sqrt(abs(head_drop(tables, out, device["valve"])[1]))
    rate = 2.0 * root * yielding / sqrt(tables[I_VALVES][device["valve"]]["conductance"])
    if device["states"] == 1:
        rate += 2.0 * root * root / floats[data + TIME] / floats[data + SPAN]
    return min(max(LEADS, 2.0 * step * rate), AT_MOST)


@njit
def move_disc(y, dydt, out, tables, device):
    """Rates of its lift and of its speed, none against a stop; its greatest rate.

    And -x'/x where it closes on a column into out[CLOSING]: one that flows back slams it, x ~ (time left)^(1/3), which
    no step leads across.
    """
    floats, armed, at, o = tables[I_FLOATS], tables[I_ARMED], device["event"], device["y"]
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
    valve, nodes = tables[I_VALVES][device["valve"]], tables[I_NODES]
    brakes = nodes[valve["from_node"]]["gates"] >= 0 or nodes[valve["to_node"]]["gates"] >= 0
    if brakes and dydt[o] < 0.0 and not leads(tables, device["valve"]):
        out[CLOSING] = max(out[CLOSING], -dydt[o] / max(disc_lift(y, tables, device), 1e-300))


@njit
def disc_loop(y, out, tables, device, own):
    """Its rate with that of the places at its ends in the loop; where a column sets its flow, d dP / dx = -2 dP / x."""
    k, speed, nodes = device["valve"], own / tables[I_FLOATS][device["data"] + SPAN], tables[I_NODES]
    before, behind = tables[I_VALVES][k]["from_node"], tables[I_VALVES][k]["to_node"]
    if leads(tables, k):
        return own
    rate = own + loop_rate(out, tables, k, before, speed)
    if device["kind"] != RELIEF_DISC:
        rate += loop_rate(out, tables, k, behind, speed)
    if nodes[before]["gates"] >= 0 or (nodes[behind]["gates"] >= 0 and device["kind"] != RELIEF_DISC):
        rate += 2.0 * speed * abs(head_drop(tables, out, k)[1]) / max(disc_lift(y, tables, device), 1e-300)
    return rate if device["states"] == 1 else sqrt(own * rate)


@njit
def disc_events(y, out, tables, device, g):
    """g: way to its stop, to its seat, to where it leads no column any more; each both ways."""
    armed, at, o = tables[I_ARMED], device["event"], device["y"]
    x, drive = disc_lift(y, tables, device), disc_drive(y, out, tables, device)
    stop, seat = -drive - AT_REST, drive - AT_REST
    if device["states"] == 1:
        down = AT_REST if armed[at + 4] > 0.0 else -SETTLED  # its column holds it back, as it did not on its seat
        onward, speed = (drive + down, drive + SETTLED), drive
    else:
        speed = y[o + 1] / tables[I_FLOATS][device["data"] + SWING] + EARLY * drive
        onward = speed, speed
    if armed[at] == 0.0:
        stop = max(1.0 - x, -onward[1])
    if armed[at + 2] == 0.0:
        seat = max(x + SLAM * min(speed, 0.0), onward[0])
    either(tables, g, at, stop)
    either(tables, g, at + 2, seat)
    most = led_until(out, tables, device)
    if armed[at + 4] > 0.0:
        either(tables, g, at + 4, x - most)
    else:
        either(tables, g, at + 4, -1.0 if armed[at + 2] > 0.0 and most > 0.0 else 1.0)


@njit
def disc_value(y, tables, device):
    """Its lift, 0 to 1."""
    return min(max(disc_lift(y, tables, device), 0.0), 1.0)
