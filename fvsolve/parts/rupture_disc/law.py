"""Rupture disc.

armed[event] : the disc has burst; it changes on accepted states only, and only once. For a disc to ambient, `mode` is
the count of numbers and flags of an outlet that precede its own.
"""

from fvsolve.jit import njit
from fvsolve.kernels.restrictions import head_drop

BURST = 0  # number: drop at which it bursts [Pa]


@njit
def has_burst(tables, device):
    """True if the disc has burst."""
    return tables.armed[device["event"] + device["mode"]] > 0.0


@njit
def set(t, y, out, tables, device):
    """Write the conductance: 0 until the disc has burst."""
    k = device["valve"]
    out[tables.layout[0]["conductance"] + k] = tables.valves[k]["conductance"] if has_burst(tables, device) else 0.0


@njit
def events(t, y, out, tables, device, g):
    """g: burst pressure minus drop [Pa]; negative after the burst."""
    left = tables.floats[device["data"] + device["mode"] + BURST] - head_drop(tables, out, device["valve"])[1]
    g[device["event"] + device["mode"]] = -1.0 if has_burst(tables, device) else left


@njit
def value(t, y, out, tables, device, quantity):
    """1 if the disc has burst, else 0."""
    return 1.0 if has_burst(tables, device) else 0.0
