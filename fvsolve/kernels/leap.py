"""A step of upwind and Euler at once, under the linear density law. Knows both: that is what makes it fast.

The loop of `steppers.march` passes over all cells again for the rates, the sum, the envelope and the search for
NaN. Here a block of cells moves and is compared with the envelope while it lies in the cache. The operations
are the same in the same order, so the bits are too.
"""

from fvsolve.jit import njit
from fvsolve.kernels.calls import RHS, run
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.observer import note, observe_linear, record_nodes
from fvsolve.kernels.records import NOT_FINITE, STATUS

BLOCK = 512


@njit
def leap_cells(h, k, flow, half, base, r, l, r_new, l_new, least, greatest):
    """Move cells by h; r starts one cell before them and l ends one behind. Returns how many leave their envelope.

    They are counted below and above; what is not a number lies on both sides, so it is found for nothing.
    """
    here, beyond, low, high = r[1:], l[1:], 0, 0
    for i in range(r_new.size):
        m = flow + (here[i] - l[i])
        s = half * (abs(m) * m) - base
        a = here[i] + h * (-k * (here[i] - r[i]) - s)
        b = l[i] + h * (k * (beyond[i] - l[i]) + s)
        r_new[i], l_new[i] = a, b
        low += not a + b >= least[i]
        high += not a + b <= greatest[i]
    return low, high


@njit
def leap_block(t, h, pipe, which, at, r, l, r_new, l_new, tables):
    """`leap_cells` from cell `at` of a pipe, and its envelope at t; returns zero where all cells are finite."""
    e, a, b = tables.envelope, pipe["cell"] + at, pipe["cell"] + at + r_new.size
    k, half, base = pipe["speed"] / pipe["dx"], 0.5 * pipe["loss"], 0.5 * pipe["drag"]
    low, high = leap_cells(h, k, pipe["flow"], half, base, r, l, r_new, l_new, e[0, a:b], e[2, a:b])
    return note(t, r_new, l_new, a, low, high, which, tables) if low + high > 0 else 0


@njit
def leap_linear(t, h, y, y_new, out, handle, values):
    """y_new at t from y a step h earlier and its closed nodes in `out`; then `out` of y_new, and all that is recorded.

    For scenes whose states are pipes alone, without friction or with a given factor. STATUS tells what is not finite.
    """
    tables = open_tables(handle)
    pipes, pad, bad = tables.pipes, tables.scratch[:4], 0
    for which in range(pipes.size):
        pipe = pipes[which]
        n, o, ends = pipe["cells"], pipe["y"], tables.layout[0]["ends"] + 4 * which
        r, l, r_new, l_new = y[o : o + n], y[o + n : o + 2 * n], y_new[o : o + n], y_new[o + n : o + 2 * n]
        for side in range(2):  # the cells at the ends, whose neighbours are nodes
            i = side * (n - 1)
            pad[0], pad[1] = out[ends] if i == 0 else r[i - 1], r[i]
            pad[2], pad[3] = l[i], out[ends + 3] if i == n - 1 else l[i + 1]
            bad += leap_block(t, h, pipe, which, i, pad[:2], pad[2:], r_new[i : i + 1], l_new[i : i + 1], tables)
        for i in range(1, n - 1, BLOCK):
            j = min(i + BLOCK, n - 1)
            bad += leap_block(t, h, pipe, which, i, r[i - 1 : j], l[i : j + 1], r_new[i:j], l_new[i:j], tables)
    run(RHS, t, y_new, y_new[:0], out, handle)
    observe_linear(t, y_new, out, handle, values)
    record_nodes(t, y_new, out, handle, values)
    if bad > 0:
        out[STATUS] = NOT_FINITE
