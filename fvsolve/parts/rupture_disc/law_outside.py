"""A rupture disc to ambient. Knows one disc; knows no network.

Burst, M = sqrt(G (p - ambient)) as of an outlet of exponent 1/2, whose numbers and flags stand before its own: nothing
comes back, and below 10 Pa a cubic leads to no flow. armed[event + EVENTS] says that it has burst, for good.
"""

from fvsolve.jit import njit
from fvsolve.kernels.restrictions import head_drop
from fvsolve.parts.outlet.law import EVENTS, bends, emitter_slope, emitter_step, rule_of

__all__ = ["bends"]

BURST = 4  # number: drop at which it bursts [Pa], behind those of an outlet


@njit
def set(t, y, out, tables, device):
    """Its conductance: none, or whole once it has burst."""
    k, burst = device["valve"], tables.armed[device["event"] + EVENTS] > 0.0
    out[tables.layout[0]["conductance"] + k] = tables.valves[k]["conductance"] if burst else 0.0


@njit
def events(t, y, out, tables, device, g):
    """g: drop that it still bears [Pa]; below zero from then on."""
    at = device["event"] + EVENTS
    g[at] = tables.floats[device["data"] + BURST] - head_drop(tables, out, device["valve"])[1]
    if tables.armed[at] > 0.0:
        g[at] = -1.0


@njit
def value(t, y, out, tables, device, which):
    """1 once it has burst."""
    return 1.0 if tables.armed[device["event"] + EVENTS] > 0.0 else 0.0


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """a, s of its flow under the rule that holds."""
    return emitter_step(tables.floats, tables.valves[k]["data"], g * denser, m, drop, rule_of(tables, k))


@njit
def slope(out, tables, k, g, drop):
    """d flow / d drop [kg/s/Pa]."""
    return emitter_slope(tables.floats, tables.valves[k]["data"], g, drop, rule_of(tables, k))
