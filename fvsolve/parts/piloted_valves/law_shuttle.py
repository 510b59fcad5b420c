"""A shuttle valve: two restrictions, A to out and B to out, of which that at the higher pressure is open.

Its position x is (p_B - p_A) / BAND between 0, where A alone is open, and 1, where B alone is open. Between them both
share the opening, 1 - x and x, so that it does not switch without end where its own flow lowers the higher pressure.
Where a junction is at A or B, the nodes depend on x at once, and A alone is open until x reaches 1. Flags:
armed[event], A alone; armed[event + 2], B alone. They change on accepted states only.
"""

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import LAW_LINEAR
from fvsolve.kernels.restrictions import valve_driving_pressure
from fvsolve.kernels.self_acting_valves import event_pair, sensed_pressure

BAND = 1e-2  # difference of pressures over which it switches; no more than 1e-9 of usual pressures [Pa]
DIFFERENCE, SHARES = 0, 1  # numbers: pressure at B minus that at A at the start [Pa]; 1 if both may share the opening
FLOW_A, FLOW_B, FLOW_OUT, POSITION = 0, 1, 2, 3  # quantities
RELUCTANCE = 1e-3  # margin of position at events, so that rounding does not move it


@njit
def shuttle_position(tables, out, device):
    """Position x of the shuttle, not limited to 0 to 1 [-]."""
    return (tables.floats[device["data"] + DIFFERENCE] + sensed_pressure(tables, out, device)) / BAND


@njit
def set(t, y, out, tables, device):
    """Write to `out` the conductances of both restrictions [kg2/s2/Pa] with A alone open, or B alone."""
    k, at_b = device["valve"], tables.armed[device["event"] + 2] > 0.0
    at = tables.layout[0]["conductance"] + k
    out[at] = 0.0 if at_b else tables.valves[k]["conductance"]
    out[at + 1] = tables.valves[k + 1]["conductance"] if at_b else 0.0


@njit
def adjust(t, y, out, tables, device):
    """Write to `out` the conductances of both restrictions [kg2/s2/Pa] while they share the opening."""
    armed, at, k = tables.armed, device["event"], device["valve"]
    if armed[at] > 0.0 or armed[at + 2] > 0.0 or tables.floats[device["data"] + SHARES] == 0.0:
        return
    x, place = min(max(shuttle_position(tables, out, device), 0.0), 1.0), tables.layout[0]["conductance"] + k
    out[place] = tables.valves[k]["conductance"] * (1.0 - x) ** 2
    out[place + 1] = tables.valves[k + 1]["conductance"] * x * x


@njit
def events(t, y, out, tables, device, g):
    """Write two event functions to g, each followed by its negative: the distances of the position from A and from B.

    At A or B a margin keeps the shuttle there. It never changes from A to B without a position between them.
    """
    armed, at, x = tables.armed, device["event"], shuttle_position(tables, out, device)
    left, missing = x, 1.0 - x
    if armed[at] > 0.0:
        left, missing = x - RELUCTANCE, 1.0
    elif armed[at + 2] > 0.0:
        left, missing = 1.0, 1.0 - RELUCTANCE - x
    event_pair(tables, g, at, left)
    event_pair(tables, g, at + 2, missing)


@njit
def volume_flow(out, tables, k):
    """Volume flow of restriction k at the upstream density [m3/s]."""
    st, flow = tables.settings[0], out[tables.layout[0]["valve"] + k]
    if st["law"] == LAW_LINEAR:
        return flow / st["rho"]
    return flow / (st["rho"] * valve_driving_pressure(tables, out, k)[1])


@njit
def value(t, y, out, tables, device, quantity):
    """Flow into the valve at A, B or out [m3/s], or its position: 0 if A is open, 1 if B is open."""
    k = device["valve"]
    if quantity == POSITION:
        return min(max(shuttle_position(tables, out, device), 0.0), 1.0)
    if quantity == FLOW_OUT:
        return -volume_flow(out, tables, k) - volume_flow(out, tables, k + 1)
    return volume_flow(out, tables, k + (1 if quantity == FLOW_B else 0))
