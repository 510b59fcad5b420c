"""A rupture disc between two places. Knows one disc; knows no network.

armed[event] says that it has burst, for good: it changes on accepted states alone. Then it is a root both ways.
"""

from fvsolve.jit import njit
from fvsolve.kernels.restrictions import head_drop

BURST = 0  # number: drop at which it bursts [Pa]


@njit
def set(t, y, out, tables, device):
    """Its conductance: none, or whole once it has burst."""
    k, burst = device["valve"], tables.armed[device["event"]] > 0.0
    out[tables.layout[0]["conductance"] + k] = tables.valves[k]["conductance"] if burst else 0.0


@njit
def events(t, y, out, tables, device, g):
    """g: drop that it still bears [Pa]; below zero from then on."""
    at = device["event"]
    g[at] = tables.floats[device["data"] + BURST] - head_drop(tables, out, device["valve"])[1]
    if tables.armed[at] > 0.0:
        g[at] = -1.0


@njit
def value(t, y, out, tables, device, which):
    """1 once it has burst."""
    return 1.0 if tables.armed[device["event"]] > 0.0 else 0.0
