"""Rupture disc between two places, or between a place and ambient.

Flag armed[event]: the disc has burst; it changes on accepted states only, and only once. For a disc to ambient, `mode`
is the count of the parameters, and of the event flags, of an outlet that precede those of the disc.
"""

from fvsolve.core.kernels.restrictions import head_drop
from fvsolve.jit import njit

BURST = 0  # number: drop at which it bursts [Pa]


@njit
def has_burst(tables, device):
    """True if the disc has burst."""
    return tables.armed[device["event"] + device["mode"]] > 0.0


@njit
def set(t, y, out, tables, device):
    """Write to `out` the conductance of the disc [kg2/s2/Pa], 0 until it has burst."""
    k = device["valve"]
    out[tables.layout[0]["conductance"] + k] = (
        tables.valves[k]["conductance"] if has_burst(tables, device) else 0.0
    )


@njit
def events(t, y, out, tables, device, g):
    """Write the event function to g: burst pressure minus drop [Pa], or -1 after the burst."""
    left = (
        tables.floats[device["data"] + device["mode"] + BURST]
        - head_drop(tables, out, device["valve"])[1]
    )
    g[device["event"] + device["mode"]] = -1.0 if has_burst(tables, device) else left


@njit
def value(t, y, out, tables, device, quantity):
    """Opening of the disc: 1 if it has burst, otherwise 0."""
    return 1.0 if has_burst(tables, device) else 0.0
