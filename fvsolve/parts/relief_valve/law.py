"""A relief valve that follows the pressure before it at once. Knows one valve; knows no network.

Lifting, M |M| = G x^2 dP with x = (p - set) / span, which is solved with the nodes; armed[event] says that it is shut,
armed[event + 2] that it is fully open: these change on accepted states alone, so that each has a smooth law.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.either import either
from fvsolve.kernels.restrictions import lifts, root_slope, root_step
from fvsolve.kernels.valves import LEAST, flow_at_drop, flow_slope, transition_of

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


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """a, s of the flow x `full`; of the root where it does not lift."""
    if not lifts(tables, k):
        return root_step(tables, k, g, m, drop, denser)
    dense = g * denser
    full = flow_at_drop(dense, transition_of(tables.valves[k], dense), drop)
    return lifting_step(tables, out, k, full, dense, m, wide)


@njit
def slope(out, tables, k, g, drop):
    """d flow / d drop [kg/s/Pa], with what lifts it."""
    if not lifts(tables, k):
        return root_slope(tables, k, g, drop)
    transition = transition_of(tables.valves[k], g)
    x, full = max(pressure_lift(tables, out, k), 0.0), flow_at_drop(g, transition, drop)
    return x * flow_slope(g, transition, drop) + max(full, 0.0) * lift_rise(tables, k)


@njit
def lift(out, tables, k, g, drop, denser, wide):
    """What the pressure before it adds to its flow by its lift [kg/s/Pa]."""
    dense = g * denser
    return lifting_slope(tables, out, k, flow_at_drop(dense, transition_of(tables.valves[k], dense), drop), wide)


@njit
def pressure_lift(tables, out, k):
    """Lift x of such a valve, linear in the pressure before it and not held between 0 and 1."""
    floats, valve = tables.floats, tables.valves[k]
    change = out[tables.layout[0]["pressure"] + valve["from_node"]]
    return floats[valve["data"]] + change / floats[valve["data"] + 1]


@njit
def lift_rise(tables, k):
    """Lift of such a valve over the pressure before it [1/Pa]."""
    return 1.0 / tables.floats[tables.valves[k]["data"] + 1]


@njit
def lift_of(tables, out, k, full, wide):
    """Lift that counts in the nodes; `full` is the flow at full opening [kg/s].

    Flow that comes back raises the pressure that lifts, so a lift is held between 0 and 1, and there may be two: the
    greater one is stable. Newton comes to it from above, from where all of these are `wide` open.
    """
    x = pressure_lift(tables, out, k)
    if full >= 0.0:
        return x
    return 1.0 if wide else min(max(x, 0.0), 1.0)


@njit
def lifting_step(tables, out, k, full, g, m, wide):
    """a, s of the flow x `full` of a lifting valve: of the root the chord as in `valve_step`, backwards its slope."""
    x, transition = lift_of(tables, out, k, full, wide), transition_of(tables.valves[k], g)
    if x <= 0.0:
        return x * full - m, 0.0
    near = x * abs(full) if full < 0.0 and not wide else abs(m)
    s = x * x * g / max(x * abs(full) + near, x * LEAST * sqrt(g))
    if transition > 0.0:
        s = min(s, 45.0 / 32.0 * x * g / transition)
    return x * full - m, s


@njit
def lifting_slope(tables, out, k, full, wide):
    """What the pressure before a lifting valve adds to its flow by its lift [kg/s/Pa]; backwards it takes."""
    if full < 0.0 and (wide or not 0.0 < pressure_lift(tables, out, k) < 1.0):
        return 0.0
    return full * lift_rise(tables, k)
