"""A check valve that shuts at the reverse velocity which its maker's curve says. Knows one valve; knows no network.

It is OPEN, or its flow has TURNED and it is still open, or it is SHUT; armed[event] and on say which, on accepted
states alone. What it shuts at, and the deceleration that says so, stand among its states from when its flow turns.
"""

from fvsolve.jit import njit
from fvsolve.kernels.restrictions import head_drop
from fvsolve.parts.check_valve.law import RELUCTANCE, leads_on

TURNED, SHUT, OPEN, BEYOND = 0, 1, 2, 3  # flags; the last: its flow turned quicker than its curve goes
CRACKING, FULL, LAST = 0, 1, 2  # numbers: drop that opens it [Pa], mass flow at 1 m/s [kg/s], last rate [m/s2]
UNKNOWN = -1
AHEAD = 1e-6  # velocity from which on a flow that had turned runs forward again [m/s]
LEAST = 1e-300


@njit
def stands(y, tables, device):
    """TURNED, SHUT or OPEN."""
    for which in range(BEYOND):
        if tables.armed[device["event"] + which] > 0.0:
            return which
    return TURNED if y[device["y"]] > 0.0 else UNKNOWN


@njit
def set(t, y, out, tables, device):
    """Its conductance: whole, or none."""
    k, shut = device["valve"], tables.armed[device["event"] + SHUT] > 0.0
    out[tables.layout[0]["conductance"] + k] = 0.0 if shut else tables.valves[k]["conductance"]


@njit
def move(t, y, dydt, out, tables, device):
    """What it shuts at changes by events alone."""
    if dydt.size > 0:
        dydt[device["y"]] = dydt[device["y"] + 1] = 0.0


@njit
def events(t, y, out, tables, device, g):
    """g: velocity that is left until its flow turns, until it shuts [m/s], drop until it opens [Pa]."""
    k, at, data, o, stage = device["valve"], device["event"], device["data"], device["y"], stands(y, tables, device)
    flow = out[tables.layout[0]["valve"] + k]
    v = flow / tables.floats[data + FULL]
    for which in range(BEYOND):
        g[at + which] = 1.0
    if stage == SHUT:
        follow(g, at, SHUT, OPEN, tables.floats[data + CRACKING] + RELUCTANCE - head_drop(tables, out, k)[1])
    elif stage == TURNED:
        if v < AHEAD:
            follow(g, at, TURNED, SHUT, v + y[o] if y[o] > 0.0 else 1.0)
            g[at + OPEN] = AHEAD - v
        else:
            follow(g, at, TURNED, OPEN, AHEAD - v)
    else:
        left = head_drop(tables, out, k)[1] + RELUCTANCE if flow == 0.0 and leads_on(tables, device) else v
        follow(g, at, OPEN, TURNED if stage == OPEN else SHUT, left)
    g[at + BEYOND] = tables.floats[data + LAST] - y[o + 1]


@njit
def follow(g, at, stage, later, left):
    """It stands as it does while something is left, and then as `later`."""
    left = -LEAST if left == 0.0 else left
    g[at + stage], g[at + later] = -left, left


@njit
def value(t, y, out, tables, device, which):
    """1 while it is open, 0 while it is shut."""
    return 1.0 if out[tables.layout[0]["conductance"] + device["valve"]] > 0.0 else 0.0
