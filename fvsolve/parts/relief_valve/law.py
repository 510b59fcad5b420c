"""A relief valve that follows the pressure before it at once. Knows one valve; knows no network.

Lifting, M |M| = G x^2 dP with x = (p - set) / span, which is solved with the nodes; armed[event] says that it is shut,
armed[event + 2] that it is fully open: these change on accepted states alone, so that each has a smooth law.
"""

from fvsolve.jit import njit
from fvsolve.kernels.either import either
from fvsolve.kernels.restrictions import pressure_lift

RELUCTANCE = 1e-10  # of lift, beyond which it changes: rounding must not open it


@njit
def set(t, y, out, tables, device):
    """Its conductance G, of which x^2 is used; none where it is shut."""
    k, shut = device["valve"], tables.armed[device["event"]] > 0.0
    out[tables.layout[0]["conductance"] + k] = 0.0 if shut else tables.valves[k]["conductance"]


@njit
def value(t, y, out, tables, device, which):
    """Its lift between 0 and 1."""
    return min(max(pressure_lift(tables, out, device["valve"]), 0.0), 1.0)


@njit
def events(t, y, out, tables, device, g):
    """g: lift that is left, or beyond what opens it while shut; lift that is missing; each both ways.

    From shut to fully open it lifts first: a jump may ask for either end in the law of the other, and not stay there.
    """
    armed, at, x = tables.armed, device["event"], pressure_lift(tables, out, device["valve"])
    left, missing = x, 1.0 - x
    if armed[at] > 0.0:
        left, missing = x - RELUCTANCE, 1.0
    elif armed[at + 2] > 0.0:
        left, missing = 1.0, 1.0 - RELUCTANCE - x
    either(tables, g, at, left)
    either(tables, g, at + 2, missing)
