"""A rupture disc. Knows one disc; knows no network.

armed[event] says that it has burst, for good: it changes on accepted states alone. To ambient, an outlet's numbers and
flags stand before its own: `mode` says how many.
"""

from fvsolve.jit import njit
from fvsolve.kernels.restrictions import head_drop

BURST = 0  # number: drop at which it bursts [Pa]


@njit
def has_burst(tables, device):
    """Whether it has burst."""
    return tables.armed[device["event"] + device["mode"]] > 0.0


@njit
def set(t, y, out, tables, device):
    """Its conductance: none, or whole once it has burst."""
    k = device["valve"]
    out[tables.layout[0]["conductance"] + k] = tables.valves[k]["conductance"] if has_burst(tables, device) else 0.0


@njit
def events(t, y, out, tables, device, g):
    """g: drop that it still bears [Pa]; below zero once it has burst."""
    left = tables.floats[device["data"] + device["mode"] + BURST] - head_drop(tables, out, device["valve"])[1]
    g[device["event"] + device["mode"]] = -1.0 if has_burst(tables, device) else left


@njit
def value(t, y, out, tables, device, which):
    """1 once it has burst."""
    return 1.0 if has_burst(tables, device) else 0.0
