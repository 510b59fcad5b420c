"""A shuttle valve: two restrictions, A to out and B to out, of which that at the higher pressure is open.

The flag armed[event] is above 0 while B is open; it changes on accepted states only.
"""

from fvsolve.core.kernels.dtypes import LAW_LINEAR
from fvsolve.core.kernels.restrictions import valve_driving_pressure
from fvsolve.core.kernels.self_acting_valves import event_pair
from fvsolve.jit import njit

DIFFERENCE = 0  # its number: pressure at A minus that at B at the start [Pa]
FLOW_A, FLOW_B, FLOW_OUT, POSITION = 0, 1, 2, 3  # quantities
# difference of pressures at which it switches, so that rounding does not [Pa]
PRESSURE_MARGIN = 1e-3


@njit
def set(t, y, out, tables, device):
    """Write to `out` the conductances of both restrictions [kg2/s2/Pa], 0 for the one that is shut."""
    k, at_b = device["valve"], tables.armed[device["event"]] > 0.0
    at = tables.layout[0]["conductance"] + k
    out[at] = 0.0 if at_b else tables.valves[k]["conductance"]
    out[at + 1] = tables.valves[k + 1]["conductance"] if at_b else 0.0


@njit
def events(t, y, out, tables, device, g):
    """Write an event function and its negative to g: pressure at A minus that at B, plus or minus PRESSURE_MARGIN [Pa].

    The sign of the margin is that of the port that is open.
    """
    k = device["valve"]
    at = device["event"]
    pressure = tables.layout[0]["pressure"]
    a, b = tables.valves[k]["from_node"], tables.valves[k + 1]["from_node"]
    difference = tables.floats[device["data"] + DIFFERENCE] + (
        out[pressure + a] - out[pressure + b]
    )
    event_pair(
        tables,
        g,
        at,
        difference + (-PRESSURE_MARGIN if tables.armed[at] > 0.0 else PRESSURE_MARGIN),
    )


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
        return 1.0 if tables.armed[device["event"]] > 0.0 else 0.0
    if quantity == FLOW_OUT:
        return -volume_flow(out, tables, k) - volume_flow(out, tables, k + 1)
    return volume_flow(out, tables, k + (1 if quantity == FLOW_B else 0))
