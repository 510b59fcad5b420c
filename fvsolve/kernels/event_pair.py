"""Pair of event functions of opposite sign for a switch between two rules."""

from fvsolve.jit import njit

LEAST = 1e-300


@njit(forceinline=True)
def event_pair(tables, g, at, left):
    """Write `left` and -`left` to g[at] and g[at + 1], the event functions of the switch between two rules.

    left : distance to the end of the first rule, negative while it holds (armed[at] > 0) and positive while the second
        rule holds. Zero becomes a tiny number beyond the end of the present rule, so that the switch takes place.
    """
    if left == 0.0:
        left = LEAST if tables.armed[at] > 0.0 else -LEAST
    g[at], g[at + 1] = left, -left
