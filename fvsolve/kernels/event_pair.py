"""Pair of complementary event functions for a switch between two rules."""

from fvsolve.jit import njit

LEAST = 1e-300


@njit(forceinline=True)
def event_pair(tables, g, at, left):
    """g[at], g[at + 1] <- left, -left, of which exactly one is below zero; at zero the other rule is due.

    left : distance to the end of the present rule, below zero while armed[at]; it must leave zero when the rule changes
    """
    if left == 0.0:
        left = LEAST if tables.armed[at] > 0.0 else -LEAST
    g[at], g[at + 1] = left, -left
