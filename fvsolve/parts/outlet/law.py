"""Outflow as a power of the drop, none backwards: leaks, and demands that follow the pressure. Knows one outlet.

M = sqrt(G span) min(most, x^n), x = (drop - least) / span. Below LEAST_DROP a cubic leads from no flow with no slope
to the power, so that the slope is bounded and has no jump; n, least, span and most are four numbers in `floats`, the
fifth says where its flags stand. These change on accepted states alone, so that no step meets a bend: shut, it lets
nothing out; short of all that is asked it goes on beyond it; with all of it, it falls short at half of x alone.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.either import either

LEAST_DROP = 10.0  # drop above `least` below which the cubic holds [Pa]
EVENTS = 4  # of an outlet: it shuts, it opens; it gives all that is asked, or less
FREE, SHUT, PART, FULL = 0, 1, 2, 3  # rules; FREE as the drop says
SLIGHT = 1e-3  # drop by which it must pass `least` before it opens or shuts: rounding must not [Pa]
NEAR = 1e-9  # the same of what gives all, of span
NO_END = 1e300  # as the most that is asked


@njit(forceinline=True)
def rule_of(tables, k):
    """The rule that restriction k follows until its next event."""
    armed, at = tables.armed, tables.valves[k]["event"]
    if armed[at] > 0.0:
        return SHUT
    return FULL if armed[at + 2] > 0.0 else PART if armed[at + 3] > 0.0 else FREE


@njit(forceinline=True)
def bent(floats, at, drop, rule):
    """(drop above `least` as the power sees it, most) under a rule."""
    above, most = drop - floats[at + 1], floats[at + 3]
    if rule == PART:
        return above, NO_END
    return (0.0 if rule == SHUT else 2.0 * above if rule == FULL else above), most


@njit
def emitter_flow(floats, at, g, drop, rule):
    """Mass flow [kg/s] at a drop [Pa]; g : conductance now, (flow at x = 1)^2 / span [kg2/s2/Pa]."""
    n, span = floats[at], floats[at + 2]
    above, most = bent(floats, at, drop, rule)
    if above <= 0.0 or g <= 0.0:
        return 0.0
    full = sqrt(g * span)
    if above < LEAST_DROP:
        s = above / LEAST_DROP
        return full * (LEAST_DROP / span) ** n * s * s * ((3.0 - n) + (n - 2.0) * s)
    return full * min(most, (above / span) ** n)


@njit
def emitter_slope(floats, at, g, drop, rule):
    """d flow / d drop [kg/s/Pa]."""
    n, span = floats[at], floats[at + 2]
    above, most = bent(floats, at, drop, rule)
    if above <= 0.0 or g <= 0.0:
        return 0.0
    full = sqrt(g * span)
    if above < LEAST_DROP:
        s = above / LEAST_DROP
        slope = full * (LEAST_DROP / span) ** n * s * (2.0 * (3.0 - n) + 3.0 * (n - 2.0) * s) / LEAST_DROP
    else:
        share = (above / span) ** n
        slope = full * n * share / above if share < most else 0.0
    return 2.0 * slope if rule == FULL else slope


@njit
def cubic_root(n, share):
    """s in [0, 1] with s^2 ((3 - n) + (n - 2) s) = share, by Newton between bounds."""
    low, high, s = 0.0, 1.0, sqrt(share)
    for _ in range(60):
        miss = s * s * ((3.0 - n) + (n - 2.0) * s) - share
        if miss > 0.0:
            high = s
        else:
            low = s
        slope = s * (2.0 * (3.0 - n) + 3.0 * (n - 2.0) * s)
        new = s - miss / slope if slope > 0.0 else low
        new = new if low < new < high else 0.5 * (low + high)
        if abs(new - s) <= 1e-12 * s:
            break
        s = new
    return s


@njit
def emitter_drop(floats, at, g, flow, rule):
    """Drop [Pa] at which it carries a flow [kg/s]; that from which on it is none for none."""
    n, span = floats[at], floats[at + 2]
    if flow <= 0.0 or g <= 0.0:
        return floats[at + 1]
    most, least = NO_END if rule == PART else floats[at + 3], (LEAST_DROP / span) ** n
    share = min(most, flow / sqrt(g * span))
    above = LEAST_DROP * cubic_root(n, share / least) if share < least else span * share ** (1.0 / n)
    return floats[at + 1] + (0.5 * above if rule == FULL else above)


@njit
def emitter_step(floats, at, g, m, drop, rule):
    """a, s with dM = a + s d(drop) for the next Newton step of an emitter that carries m [kg/s] at a drop [Pa].

    s is the chord between what it carries and what the drop asks for: for n = 1/2 Newton's own slope in M^2. As the
    flow grows with the drop, and what is left of it for the outlet falls, the root lies between the two: every chord is
    within that of the iterate before, and Newton cannot go round in circles at a bend.
    """
    target, asked = emitter_flow(floats, at, g, drop, rule), emitter_drop(floats, at, g, m, rule)
    if rule == SHUT:
        return -m, 0.0
    if abs(drop - asked) <= 1e-6 * abs(drop - floats[at + 1]):
        return target - m, emitter_slope(floats, at, g, drop, rule)
    return target - m, max(0.0, (target - max(m, 0.0)) / (drop - asked))


@njit
def bends(tables, k, drop, g):
    """g: until it shuts, or opens; until it gives all that is asked, or less [Pa]."""
    valve, floats, armed = tables.valves[k], tables.floats, tables.armed
    at, event = valve["data"], valve["event"]
    above, span, most, missing = drop - floats[at + 1], floats[at + 2], floats[at + 3], 1.0
    if most < NO_END:
        missing = span * (most ** (1.0 / floats[at]) + (-NEAR if armed[event + 2] > 0.0 else NEAR)) - above
    either(tables, g, event, above - SLIGHT if armed[event] > 0.0 else above + SLIGHT)
    either(tables, g, event + 2, missing)


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """a, s under the rule that holds; it is its volume that follows the drop."""
    return emitter_step(tables.floats, tables.valves[k]["data"], g * denser * denser, m, drop, rule_of(tables, k))


@njit
def slope(out, tables, k, g, drop):
    """d flow / d drop [kg/s/Pa]."""
    return emitter_slope(tables.floats, tables.valves[k]["data"], g, drop, rule_of(tables, k))
