"""Trees of jointed bodies: degrees of freedom that move a body."""

from fvsolve.jit import njit


@njit
def nearest_free_body(tables, i):
    """First body with degrees of freedom on the way from body i, itself included, to the root of its tree; else -1."""
    while i >= 0 and tables.bodies[i]["freedoms"] == 0:
        i = tables.bodies[i]["parent"]
    return i


@njit(forceinline=True)
def freedom_path(tables, i):
    """List of the degrees of freedom that move body i, from the root on: (its offset in `integers`, its length).

    Body i must have degrees of freedom.
    """
    last = tables.freedoms[tables.bodies[i]["freedom"] + tables.bodies[i]["freedoms"] - 1]
    return last["path"], last["depth"] + 1
