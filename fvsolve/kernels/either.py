"""Which of two rules holds, as a pair of event functions. Knows flags; knows no law."""

from fvsolve.jit import njit

LEAST = 1e-300


@njit(forceinline=True)
def either(tables, g, at, left):
    """g[at], g[at + 1] <- left, -left, of which just one is below zero: at zero itself it is the other rule's turn.

    left : what is left of the rule that holds, below zero while armed[at]; it must leave zero where the rule changes.
    """
    if left == 0.0:
        left = LEAST if tables.armed[at] > 0.0 else -LEAST
    g[at], g[at + 1] = left, -left
