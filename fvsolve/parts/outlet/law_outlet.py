"""Outflow to ambient as a power of the pressure drop, without backflow: leaks, and demands that depend on pressure.

M = sqrt(G span) min(most, x^n), x = (drop - least) / span; M is the mass flow, sqrt(G span) the flow at x = 1. Below
LEAST_DROP a cubic joins the power law to zero flow with zero slope, so that the slope is bounded and continuous.
`floats` holds n, least, span and most of an outlet; `event` of its row of restrictions is the index of its flags. The
flags change on accepted states only, so that no time step crosses a kink. Under the rule SHUT no fluid passes. While
the outlet supplies a part of its demand (PART), the power law also holds above `most`. While it supplies the full
demand (FULL), the flow stays at its limit until x is half of its value at full demand.
"""

from math import sqrt

from fvsolve.core.kernels.self_acting_valves import event_pair
from fvsolve.jit import njit

LEAST_DROP = 10.0  # drop above `least` below which the cubic applies [Pa]
EVENT_COUNT = 4  # of an outlet: it shuts, opens, supplies all of its demand, or less
FREE, SHUT, PART, FULL = 0, 1, 2, 3  # rules; FREE: by the drop alone
# drop beyond `least` at which it opens or shuts, so that rounding does not [Pa]
EVENT_MARGIN = 1e-3
FULL_MARGIN = 1e-9  # such a margin at full demand, over span
NO_LIMIT = 1e300  # value of `most` without a limit


@njit(forceinline=True)
def rule_of(tables, k):
    """Rule of restriction k until its next event: SHUT (no flow), PART or FULL (part of its demand or all), or FREE.

    Under FREE the drop alone determines the flow.
    """
    armed, at = tables.armed, tables.valves[k]["event"]
    if armed[at] > 0.0:
        return SHUT
    return FULL if armed[at + 2] > 0.0 else PART if armed[at + 3] > 0.0 else FREE


@njit(forceinline=True)
def drop_under_rule(floats, at, drop, rule):
    """(drop above `least` in the power law [Pa], limit `most` of the relative flow [-]) of an outlet under a rule.

    floats[at:] : parameters of the outlet: exponent, least, span and most; drop : drop across the outlet [Pa]
    rule : SHUT, PART, FULL or FREE, see `rule_of`
    """
    above, most = drop - floats[at + 1], floats[at + 3]
    if rule == PART:
        return above, NO_LIMIT
    return (0.0 if rule == SHUT else 2.0 * above if rule == FULL else above), most


@njit
def emitter_flow(floats, at, g, drop, rule):
    """Mass flow of an outlet [kg/s] at a drop [Pa]; 0 below the drop at which flow begins.

    g : present conductance, (flow at nominal drop)^2 / span [kg2/s2/Pa]; floats, at, rule : as for `drop_under_rule`
    """
    n, span = floats[at], floats[at + 2]
    above, most = drop_under_rule(floats, at, drop, rule)
    if above <= 0.0 or g <= 0.0:
        return 0.0
    full = sqrt(g * span)
    if above < LEAST_DROP:
        s = above / LEAST_DROP
        return full * (LEAST_DROP / span) ** n * s * s * ((3.0 - n) + (n - 2.0) * s)
    return full * min(most, (above / span) ** n)


@njit
def emitter_slope(floats, at, g, drop, rule):
    """Derivative of the mass flow of an outlet by its drop [kg/s/Pa]; arguments as for `emitter_flow`."""
    n, span = floats[at], floats[at + 2]
    above, most = drop_under_rule(floats, at, drop, rule)
    if above <= 0.0 or g <= 0.0:
        return 0.0
    full = sqrt(g * span)
    if above < LEAST_DROP:
        s = above / LEAST_DROP
        slope = (
            full
            * (LEAST_DROP / span) ** n
            * s
            * (2.0 * (3.0 - n) + 3.0 * (n - 2.0) * s)
            / LEAST_DROP
        )
    else:
        share = (above / span) ** n
        slope = full * n * share / above if share < most else 0.0
    return 2.0 * slope if rule == FULL else slope


@njit
def cubic_root(n, share):
    """Root s in [0, 1] of s^2 ((3 - n) + (n - 2) s) = share, by Newton's method with bounds."""
    low = 0.0
    high = 1.0
    s = sqrt(share)
    for _ in range(60):
        residual = s * s * ((3.0 - n) + (n - 2.0) * s) - share
        if residual > 0.0:
            high = s
        else:
            low = s
        slope = s * (2.0 * (3.0 - n) + 3.0 * (n - 2.0) * s)
        next_s = s - residual / slope if slope > 0.0 else low
        next_s = next_s if low < next_s < high else 0.5 * (low + high)
        if abs(next_s - s) <= 1e-12 * s:
            break
        s = next_s
    return s


@njit
def emitter_drop(floats, at, g, flow, rule):
    """Drop [Pa] at which an outlet has the mass flow `flow` [kg/s]; the drop at which flow begins, if `flow` is 0.

    Other arguments as for `emitter_flow`.
    """
    n, span = floats[at], floats[at + 2]
    if flow <= 0.0 or g <= 0.0:
        return floats[at + 1]
    most, least = NO_LIMIT if rule == PART else floats[at + 3], (LEAST_DROP / span) ** n
    ratio = min(most, flow / sqrt(g * span))
    above = (
        LEAST_DROP * cubic_root(n, ratio / least) if ratio < least else span * ratio ** (1.0 / n)
    )
    return floats[at + 1] + (0.5 * above if rule == FULL else above)


@njit
def emitter_step(floats, at, g, m, drop, rule):
    """(a [kg/s], s [kg/s/Pa]) of the next Newton step dM = a + s d(drop) of an outlet.

    m : mass flow M before the step [kg/s]; other arguments as for `emitter_flow`
    s is the slope of the chord between the present flow and the flow at the drop; for the exponent 1/2 it is Newton's
    slope in M^2.
    The flow of the outlet rises with the drop, and the flow that the network supplies at this drop falls, so the root
    lies between both. Every chord lies within the previous one, so Newton cannot cycle at a kink.
    """
    target, own_drop = emitter_flow(floats, at, g, drop, rule), emitter_drop(floats, at, g, m, rule)
    if rule == SHUT:
        return -m, 0.0
    if abs(drop - own_drop) <= 1e-6 * abs(drop - floats[at + 1]):
        return target - m, emitter_slope(floats, at, g, drop, rule)
    return target - m, max(0.0, (target - max(m, 0.0)) / (drop - own_drop))


@njit
def bends(tables, k, drop, g):
    """Write the event functions of restriction k [Pa] to g, each followed by its negative; drop : present drop [Pa]

    They are the margins until the outlet shuts or opens, and until it supplies its full demand or less.
    """
    valve = tables.valves[k]
    floats = tables.floats
    armed = tables.armed
    at, event = valve["data"], valve["event"]
    above = drop - floats[at + 1]
    span = floats[at + 2]
    most = floats[at + 3]
    missing = 1.0
    if most < NO_LIMIT:
        missing = (
            span
            * (
                most ** (1.0 / floats[at])
                + (-FULL_MARGIN if armed[event + 2] > 0.0 else FULL_MARGIN)
            )
            - above
        )
    event_pair(
        tables, g, event, above - EVENT_MARGIN if armed[event] > 0.0 else above + EVENT_MARGIN
    )
    event_pair(tables, g, event + 2, missing)


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """(a, s) of `emitter_step` for restriction k under its present rule; arguments as for `restriction_step`.

    The volume flow follows the drop: the conductance g grows with the square of the relative density `denser`.
    """
    return emitter_step(
        tables.floats, tables.valves[k]["data"], g * denser * denser, m, drop, rule_of(tables, k)
    )


@njit
def slope(out, tables, k, g, drop):
    """Derivative [kg/s/Pa] of the mass flow of restriction k by its drop; g : conductance [kg2/s2/Pa], drop : [Pa]"""
    return emitter_slope(tables.floats, tables.valves[k]["data"], g, drop, rule_of(tables, k))
