"""Flow through a link whose loss is linear between points over its flow.

With the upstream density r relative to the reference density, the drop is r F(M / r) for the mass flow M: F is the loss
of the reference density, odd in the flow. `floats` holds the number of points, their flows [kg/s] and their losses [Pa]
at the reference density; both rise strictly from 0.
"""

from fvsolve.jit import njit

COUNT, FLOWS = 0, 1  # indices of its numbers; the losses follow the flows


@njit
def section(floats, at, count, size):
    """Number of the section of rising abscissas, floats[at:] of `count` points, that contains `size`, or is nearest."""
    low, high = 0, count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if floats[at + middle] > size:
            high = middle
        else:
            low = middle
    return low


@njit
def odd_line(floats, at, other, k, x):
    """(value, slope) at x of an odd function in its section k; floats[at:] : abscissas, floats[other:] : values"""
    slope = (floats[other + k + 1] - floats[other + k]) / (floats[at + k + 1] - floats[at + k])
    value = floats[other + k] + slope * (abs(x) - floats[at + k])
    return (value if x >= 0.0 else -value), slope


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """(a, s) of the next Newton step dM = a + s d(drop) [kg/s, kg/s/Pa]; arguments as for `restriction_step`.

    The chord between the present flow and the flow at the drop replaces the slope, where both are in other sections.
    """
    floats, at = tables.floats, tables.valves[k]["data"]
    count, flows = int(floats[at + COUNT]), at + FLOWS
    losses = flows + count
    here = section(floats, flows, count, abs(m) / denser)
    there = section(floats, losses, count, abs(drop) / denser)
    lost, slope = odd_line(floats, flows, losses, here, m / denser)
    rest = drop - denser * lost
    if here != there or (here > 0 and m * drop < 0.0):
        change = denser * odd_line(floats, losses, flows, there, drop / denser)[0] - m
        if change * rest > 0.0:
            return change, change / rest
    return rest / slope, 1.0 / slope


@njit
def slope(out, tables, k, g, drop):
    """d flow / d drop [kg/s/Pa] at the present flow."""
    floats, at = tables.floats, tables.valves[k]["data"]
    flow = out[tables.layout[0]["valve"] + k]
    count = int(floats[at + COUNT])
    flows = at + FLOWS
    return (
        1.0
        / odd_line(floats, flows, flows + count, section(floats, flows, count, abs(flow)), flow)[1]
    )
