"""Outflow as a power of the drop, none backwards: leaks, and demands that follow the pressure. Knows one outlet.

M = sqrt(G span) min(most, x^n), x = (drop - least) / span. Below LEAST_DROP a cubic leads from no flow with no slope
to the power, so that the slope is bounded and has no jump; n, least, span and most are four numbers in `floats`.
"""

from math import sqrt

from fvsolve.jit import njit

LEAST_DROP = 10.0  # drop above `least` below which the cubic holds [Pa]


@njit
def emitter_flow(floats, at, g, drop):
    """Mass flow [kg/s] at a drop [Pa]; g : conductance now, (flow at x = 1)^2 / span [kg2/s2/Pa]."""
    n, span, most = floats[at], floats[at + 2], floats[at + 3]
    above = drop - floats[at + 1]
    if above <= 0.0 or g <= 0.0:
        return 0.0
    full = sqrt(g * span)
    if above < LEAST_DROP:
        s = above / LEAST_DROP
        return full * (LEAST_DROP / span) ** n * s * s * ((3.0 - n) + (n - 2.0) * s)
    return full * min(most, (above / span) ** n)


@njit
def emitter_slope(floats, at, g, drop):
    """d flow / d drop [kg/s/Pa]."""
    n, span, most = floats[at], floats[at + 2], floats[at + 3]
    above = drop - floats[at + 1]
    if above <= 0.0 or g <= 0.0:
        return 0.0
    full = sqrt(g * span)
    if above < LEAST_DROP:
        s = above / LEAST_DROP
        return full * (LEAST_DROP / span) ** n * s * (2.0 * (3.0 - n) + 3.0 * (n - 2.0) * s) / LEAST_DROP
    share = (above / span) ** n
    return full * n * share / above if share < most else 0.0


@njit
def emitter_drop(floats, at, g, flow):
    """Drop [Pa] at which it carries a flow [kg/s] by the power alone; that from which on it is none for none."""
    n, span = floats[at], floats[at + 2]
    if flow <= 0.0 or g <= 0.0:
        return floats[at + 1]
    return floats[at + 1] + span * min(floats[at + 3], flow / sqrt(g * span)) ** (1.0 / n)


@njit
def emitter_step(floats, at, g, m, drop):
    """a, s with dM = a + s d(drop) for the next Newton step of an emitter that carries m [kg/s] at a drop [Pa].

    s is the chord between what it carries and what the drop asks for: for n = 1/2 Newton's own slope in M^2.
    """
    target, asked = emitter_flow(floats, at, g, drop), emitter_drop(floats, at, g, m)
    near = abs(drop - asked) <= 1e-6 * abs(drop - floats[at + 1])
    if near or (drop - floats[at + 1] < LEAST_DROP and asked - floats[at + 1] < LEAST_DROP):
        return target - m, emitter_slope(floats, at, g, drop)
    return target - m, max(0.0, (target - m) / (drop - asked))
