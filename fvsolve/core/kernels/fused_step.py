"""Fused step of the upwind scheme and the Euler method under the linear density law.

The loop of `steppers.time_loop` passes over all cells separately for rates, sums, envelope and the search for NaN. Here
a block of cells is advanced and compared with the envelope while it lies in the cache. The operations and their order
are equal, so the results agree to the bit.
"""

from fvsolve.core.kernels.calls import RHS, run_job
from fvsolve.core.kernels.dtypes import NOT_FINITE, STATUS
from fvsolve.core.kernels.observation import observe_linear, record_nodes, update_envelope
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.jit import njit

BLOCK = 512


@njit
def fused_cells(h, k, flow, half, base, r, l, r_new, l_new, least, greatest):
    """Advance a block of n pipe cells by the step h [s]; return the numbers of cells below and above their envelope.

    k : wave speed over cell length [1/s]
    flow : initial steady mass flow [kg/s]
    half : half of the friction coefficient of |M| M [1/kg]; base : half of the initial steady drag [kg/s2]
    r, l : float64[n + 1]  waves [kg/s]; r starts with the cell before the block, l ends with the cell behind it
    r_new, l_new : float64[n]  receive the new waves [kg/s]
    least, greatest : float64[n]  envelope of r + l [kg/s]
    NaN counts as below and above, so the search for it costs nothing.
    """
    here = r[1:]
    beyond = l[1:]
    low = 0
    high = 0
    for i in range(r_new.size):
        m = flow + (r[i] - beyond[i])
        s = half * (abs(m) * m) - base
        a = here[i] + h * (-k * (here[i] - r[i]) - s)
        b = l[i] + h * (k * (beyond[i] - l[i]) + s)
        r_new[i], l_new[i] = a, b
        low += not a + b >= least[i]
        high += not a + b <= greatest[i]
    return low, high


@njit(forceinline=True)
def fused_cell(t, h, terms, index, at, i, outer_waves, r, l, r_new, l_new, tables):
    """Advance cell i of pipe number `index` and update its envelope; return 0 if its waves are finite.

    outer_waves : forward wave before the cell, and backward wave behind it [kg/s]; other arguments: `fused_block`
    """
    (k, flow, half, base), (before, behind), e = terms, outer_waves, tables.envelope
    m = flow + (before - behind)
    s = half * (abs(m) * m) - base
    a, b = r[i] + h * (-k * (r[i] - before) - s), l[i] + h * (k * (behind - l[i]) + s)
    r_new[i], l_new[i] = a, b
    low, high = not a + b >= e[0, at + i], not a + b <= e[2, at + i]
    if not (low or high):
        return 0
    return update_envelope(
        t, r_new[i : i + 1], l_new[i : i + 1], at + i, int(low), int(high), index, tables
    )


@njit(forceinline=True)
def fused_block(t, h, terms, index, at, i, j, r, l, r_new, l_new, tables):
    """Advance the inner cells i .. j - 1 of pipe number `index` and update their envelope; return 0 if all are finite.

    t : time after the step [s]; h : step [s]; terms : k, flow, half, base of `fused_cells`
    at : first cell of the pipe in per-cell arrays; r, l, r_new, l_new : waves in its cells before and after the step
    """
    (k, flow, half, base), e = terms, tables.envelope
    ahead = r[i - 1 : j]
    behind = l[i : j + 1]
    r_new = r_new[i:j]
    l_new = l_new[i:j]
    least, greatest = e[0, at + i : at + j], e[2, at + i : at + j]
    low, high = fused_cells(h, k, flow, half, base, ahead, behind, r_new, l_new, least, greatest)
    return (
        update_envelope(t, r_new, l_new, at + i, low, high, index, tables) if low + high > 0 else 0
    )


@njit
def fused_step_linear(t, h, y, y_new, out, handle, values):
    """Advance y by the step h to y_new at time t, by the upwind scheme and Euler; update `out`, probes and records.

    On entry `out` holds the solved nodes of y. The function is valid for models whose states are only those of pipes,
    without friction or with a given friction factor. `values` receives the values of probes. STATUS is set to
    NOT_FINITE if a value is not finite.
    """
    tables = open_tables(handle)
    pipes, bad = tables.pipes, 0
    for index in range(pipes.size):
        pipe = pipes[index]
        n = pipe["cells"]
        o = pipe["y"]
        at = pipe["cell"]
        ends = tables.layout[0]["ends"] + 4 * index
        r = y[o : o + n]
        l = y[o + n : o + 2 * n]
        r_new = y_new[o : o + n]
        l_new = y_new[o + n : o + 2 * n]
        terms = pipe["speed"] / pipe["dx"], pipe["flow"], 0.5 * pipe["loss"], 0.5 * pipe["drag"]
        for side in range(2):  # the cells at the ends, whose neighbours are nodes
            i = side * (n - 1)
            outer_waves = (
                out[ends] if i == 0 else r[i - 1],
                out[ends + 3] if i == n - 1 else l[i + 1],
            )
            bad += fused_cell(t, h, terms, index, at, i, outer_waves, r, l, r_new, l_new, tables)
        for i in range(1, n - 1, BLOCK):
            bad += fused_block(
                t, h, terms, index, at, i, min(i + BLOCK, n - 1), r, l, r_new, l_new, tables
            )
    # With an empty dydt only nodes are solved: the loops above have computed the rates.
    run_job(RHS, t, y_new, y_new[:0], out, handle)
    observe_linear(t, y_new, out, handle, values)
    record_nodes(t, y_new, out, handle, values)
    if bad > 0:
        out[STATUS] = NOT_FINITE
