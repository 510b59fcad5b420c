"""Surge-anticipating valve: opening, hold and closing by pressure or trip.

Flags, with at = event + mode: armed[at] to armed[at + 3] for the stages SHUT, OPENING, OPEN and CLOSING; if all are 0,
the states give the stage. armed[at + 4]: opened by high pressure; armed[at + 5]: the pressure has exceeded low_set
since the valve shut, so that a pressure below low_set opens it; armed[at + 6]: after the trip. Flags change on accepted
states only.
The states are the opening and the time spent fully open; their rates are constant in a stage, so that every method
integrates them to rounding.
For a valve to ambient, `mode` is the count of the parameters, and of the event flags, of an outlet that precede those
of the valve.
"""

from fvsolve.jit import njit

# numbers; PLACE: sensed node
OPENING_TIME, HOLD, CLOSING_TIME, LOW, HIGH, TRIP, PLACE = 0, 1, 2, 3, 4, 5, 6
SHUT, OPENING, OPEN, CLOSING, BY_HIGH, ARMED_LOW, TRIPPED = 0, 1, 2, 3, 4, 5, 6  # flags
FLAGS = 7
NEVER = 1e300  # setting left out [Pa], [s]
# pressure beyond a setting that arms the low-pressure opening, or reopens a closing valve [Pa]
PRESSURE_MARGIN = 10.0
LEAST = 1e-300


@njit
def valve_stage(y, tables, device):
    """Stage of the valve: SHUT, OPENING, OPEN or CLOSING."""
    armed = tables.armed
    at = device["event"] + device["mode"]
    o = device["y"]
    for stage in range(BY_HIGH):
        if armed[at + stage] > 0.0:
            return stage
    if y[o] <= 0.0:
        return SHUT
    return OPEN if y[o] >= 1.0 else CLOSING if y[o + 1] > 0.0 else OPENING


@njit
def set(t, y, out, tables, device):
    """Write to `out` the conductance G x^2 of the valve [kg2/s2/Pa]; G : conductance at full opening, x : opening"""
    k, x = device["valve"], min(max(y[device["y"]], 0.0), 1.0)
    out[tables.layout[0]["conductance"] + k] = tables.valves[k]["conductance"] * x * x


@njit
def move(t, y, dydt, out, tables, device):
    """Write the rates of the opening and of the time spent fully open to `dydt`."""
    floats = tables.floats
    at = device["data"] + device["mode"]
    o = device["y"]
    stage = valve_stage(y, tables, device)
    rise = 1.0 / floats[at + OPENING_TIME] if stage == OPENING else 0.0
    dydt[o] = -1.0 / floats[at + CLOSING_TIME] if stage == CLOSING else rise
    dydt[o + 1] = 1.0 if stage == OPEN else 0.0


@njit
def pilot_margins(t, y, out, tables, device):
    """(low [Pa], high [Pa], trip [s], pressure [Pa]): margins until the valve opens, and the sensed pressure.

    low, high, trip : until it opens by low pressure, by high pressure and at the trip
    """
    floats = tables.floats
    armed = tables.armed
    layout = tables.layout[0]
    at, flags = device["data"] + device["mode"], device["event"] + device["mode"]
    i = int(floats[at + PLACE])
    p = tables.nodes[i]["pressure"] + out[layout["pressure"] + i]
    low = p - floats[at + LOW] if armed[flags + ARMED_LOW] > 0.0 else 1.0
    high = floats[at + HIGH] - p
    if armed[flags + CLOSING] > 0.0:
        high += PRESSURE_MARGIN
    return low, high, 1.0 if armed[flags + TRIPPED] > 0.0 else floats[at + TRIP] - t, p


@njit
def events(t, y, out, tables, device, g):
    """Write seven event functions to g: of the four stages, of opening by high pressure, of arming, and of the trip.

    The function of the present stage is minus the margin left in this stage; that of a stage that may follow is the
    margin.
    Arming is the moment after the valve shut at which the pressure exceeds the low setting: from then on, a pressure
    below this setting opens the valve.
    """
    floats = tables.floats
    armed = tables.armed
    o = device["y"]
    at = device["data"] + device["mode"]
    flags = device["event"] + device["mode"]
    stage = valve_stage(y, tables, device)
    low, high, trip, p = pilot_margins(t, y, out, tables, device)
    opening_margin = min(low, high, trip)
    by_high, ready = armed[flags + BY_HIGH] > 0.0, armed[flags + ARMED_LOW] > 0.0
    for flag in range(FLAGS):
        g[flags + flag] = 1.0
    g[flags + BY_HIGH] = -1.0 if by_high else 1.0
    if stage == OPENING:
        set_stage_event(g, flags, stage, OPEN, 1.0 - y[o])
    elif stage == OPEN:
        hold_left = -1.0 if by_high else floats[at + HOLD] - y[o + 1]
        set_stage_event(g, flags, stage, CLOSING, max(hold_left, p - floats[at + HIGH]))
    else:
        g[flags + BY_HIGH] = -1.0 if by_high else high
        if opening_margin <= 0.0:
            g[flags + BY_HIGH] = 1.0 if low <= 0.0 or trip <= 0.0 else -1.0
        if stage == CLOSING and opening_margin > 0.0:
            set_stage_event(g, flags, stage, SHUT, y[o])
            g[flags + OPENING] = opening_margin
        else:
            set_stage_event(g, flags, stage, OPENING, opening_margin)
    if stage == SHUT:
        g[flags + ARMED_LOW] = -1.0 if ready else floats[at + LOW] + PRESSURE_MARGIN - p
    g[flags + TRIPPED] = floats[at + TRIP] - t


@njit
def set_stage_event(g, flags, stage, next_stage, margin):
    """Write to g -`margin` for the present stage, which lasts while the margin is positive, and `margin` for the next.

    flags : index of the event function of the first stage
    """
    margin = -LEAST if margin == 0.0 else margin
    g[flags + stage], g[flags + next_stage] = -margin, margin


@njit
def value(t, y, out, tables, device, quantity):
    """Opening of the valve, 0 to 1."""
    return min(max(y[device["y"]], 0.0), 1.0)
