"""A surge-anticipating valve. Knows one valve; knows no network.

It is SHUT, OPENING, OPEN or CLOSING: armed[at], at = event + mode, armed[at + 1], armed[at + 2], armed[at + 3]; without
memory its states say which. armed[at + 4]: a high pressure opened it; armed[at + 5]: shut, it has seen a pressure above
low_set, so that one below opens it; armed[at + 6]: its trip is past. These change on accepted states alone. Its
opening and how long it has been open are states of even rates, which every method follows to rounding. To ambient, an
outlet's numbers and flags stand before its own: `mode` says how many.
"""

from fvsolve.jit import njit

OPENING_TIME, HOLD, CLOSING_TIME, LOW, HIGH, TRIP, PLACE = 0, 1, 2, 3, 4, 5, 6  # numbers; PLACE: node that it senses
SHUT, OPENING, OPEN, CLOSING, BY_HIGH, READY, TRIPPED = 0, 1, 2, 3, 4, 5, 6  # flags
FLAGS = 7
NEVER = 1e300  # as a setting that there is none [Pa], [s]
RELUCTANCE = 10.0  # pressure beyond a setting by which it is ready, or opens anew while it shuts [Pa]
LEAST = 1e-300


@njit
def stands(y, tables, device):
    """Stage of the valve: SHUT, OPENING, OPEN or CLOSING."""
    armed, at, o = tables.armed, device["event"] + device["mode"], device["y"]
    for which in range(BY_HIGH):
        if armed[at + which] > 0.0:
            return which
    if y[o] <= 0.0:
        return SHUT
    return OPEN if y[o] >= 1.0 else CLOSING if y[o + 1] > 0.0 else OPENING


@njit
def set(t, y, out, tables, device):
    """Write the conductance G x^2."""
    k, x = device["valve"], min(max(y[device["y"]], 0.0), 1.0)
    out[tables.layout[0]["conductance"] + k] = tables.valves[k]["conductance"] * x * x


@njit
def move(t, y, dydt, out, tables, device):
    """Write the rates of the opening and of the time spent open."""
    if dydt.size == 0:
        return
    floats, at, o, stage = tables.floats, device["data"] + device["mode"], device["y"], stands(y, tables, device)
    rise = 1.0 / floats[at + OPENING_TIME] if stage == OPENING else 0.0
    dydt[o] = -1.0 / floats[at + CLOSING_TIME] if stage == CLOSING else rise
    dydt[o + 1] = 1.0 if stage == OPEN else 0.0


@njit
def pilots(t, y, out, tables, device):
    """Margins to opening by low pressure, by high pressure [Pa] and by trip [s]; and the sensed pressure [Pa]."""
    floats, armed, layout = tables.floats, tables.armed, tables.layout[0]
    at, flags = device["data"] + device["mode"], device["event"] + device["mode"]
    i = int(floats[at + PLACE])
    p = tables.nodes[i]["pressure"] + out[layout["pressure"] + i]
    low = p - floats[at + LOW] if armed[flags + READY] > 0.0 else 1.0
    high = floats[at + HIGH] - p
    if armed[flags + CLOSING] > 0.0:
        high += RELUCTANCE
    return low, high, 1.0 if armed[flags + TRIPPED] > 0.0 else floats[at + TRIP] - t, p


@njit
def events(t, y, out, tables, device, g):
    """g: what is left until it does something else; and what these pilots remember."""
    floats, armed, o = tables.floats, tables.armed, device["y"]
    at, flags, stage = device["data"] + device["mode"], device["event"] + device["mode"], stands(y, tables, device)
    low, high, trip, p = pilots(t, y, out, tables, device)
    opens = min(low, high, trip)
    by_high, ready = armed[flags + BY_HIGH] > 0.0, armed[flags + READY] > 0.0
    for which in range(FLAGS):
        g[flags + which] = 1.0
    g[flags + BY_HIGH] = -1.0 if by_high else 1.0
    if stage == OPENING:
        follow(g, flags, stage, OPEN, 1.0 - y[o])
    elif stage == OPEN:
        timed = -1.0 if by_high else floats[at + HOLD] - y[o + 1]
        follow(g, flags, stage, CLOSING, max(timed, p - floats[at + HIGH]))
    else:
        g[flags + BY_HIGH] = -1.0 if by_high else high
        if opens <= 0.0:
            g[flags + BY_HIGH] = 1.0 if low <= 0.0 or trip <= 0.0 else -1.0
        if stage == CLOSING and opens > 0.0:
            follow(g, flags, stage, SHUT, y[o])
            g[flags + OPENING] = opens
        else:
            follow(g, flags, stage, OPENING, opens)
    if stage == SHUT:
        g[flags + READY] = -1.0 if ready else floats[at + LOW] + RELUCTANCE - p
    g[flags + TRIPPED] = floats[at + TRIP] - t


@njit
def follow(g, flags, stage, later, left):
    """It stands as it does while something is left, and then as `later`."""
    left = -LEAST if left == 0.0 else left
    g[flags + stage], g[flags + later] = -left, left


@njit
def value(t, y, out, tables, device, quantity):
    """Opening, 0 to 1."""
    return min(max(y[device["y"]], 0.0), 1.0)
