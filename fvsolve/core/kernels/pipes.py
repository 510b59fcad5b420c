"""Rates of a pipe under the linear density law: two waves, each reconstructed from the side from which it comes.

State, for each cell: forward wave r = (c m' + M') / 2 and backward wave l = (c m' - M') / 2 [kg/s], from the changes of
mass per length m = rho A and mass flow M since the initial steady state, with wave speed c. r_t + c r_x = -drag' / 2,
l_t - c l_x = drag' / 2, with the change drag' of wall friction [kg/s2].

Arguments common to these functions:
r, l : float64[cells]  forward and backward wave [kg/s]
dr, dl : float64[cells]  their rates [kg/s2]
fr, fl : float64[cells + 1]  their values at faces [kg/s]
r_in, l_in : waves that enter from the nodes at the `from` and the `to` end [kg/s]
r_out, l_out : waves that leave at the `to` and the `from` end, extrapolated from cells [kg/s]
k : wave speed over cell length [1/s]
flow, base : initial steady mass flow [kg/s], half of the initial steady drag [kg/s2]
loss : coefficient of |M| M [1/kg]
family, backward : scheme family; 1 for the backward wave
small : square of a negligible value
"""

from fvsolve.core.kernels.dtypes import (
    FRICTION_HAZEN,
    FRICTION_ROUGH,
    LINEAR,
    MUSCL,
    SHORT,
    UPWIND,
    WENO5,
)
from fvsolve.core.kernels.ghost_cells import edge_cells, end_value, entering_ghosts, leaving_ghosts
from fvsolve.core.kernels.reconstruction import faces
from fvsolve.core.kernels.steady_friction import EXPONENT, drag, power_of_square
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.jit import njit

# 1 / sqrt(12): two Gauss points of a cell, in cell widths from its centre
GAUSS = 0.28867513459481287


@njit
def scheme_family(settings, n):
    """Scheme family for a pipe of n cells.

    Below five cells a shorter scheme replaces schemes of fifth order, whose stencils would be unstable or would not
    fit.
    """
    family = settings["scheme"]
    if n < 5 and family == LINEAR and settings["degree"] > 2:
        return SHORT
    return MUSCL if family == WENO5 and n < 5 else family


@njit
def wave_faces(settings, family, small, backward, c, left, right, scratch, f):
    """Write the values of a wave at all faces to f, from its cells c and three ghost cells beyond each end.

    left, right : float64[3]  ghost cells, nearest first
    """
    n = c.size
    # The stencils of both ends overlap in so short a pipe: all its faces are computed from a single padded array.
    if n <= 5:
        pad = scratch[: n + 6]
        for k in range(n):
            pad[k + 3] = c[k]
        for g in range(3):
            pad[2 - g], pad[n + 3 + g] = left[g], right[g]
        faces(settings, family, small, backward, pad, f)
        return
    # Inner faces read the cells in place. Only the three faces at each end need ghost cells and a copy.
    faces(settings, family, small, backward, c, f[3 : n - 2])
    for side in range(2):
        pad, target = scratch[:8], f[:3]
        for k in range(5):
            pad[k + 3 - 3 * side] = c[k + side * (n - 5)]
        for g in range(3):
            pad[5 + g if side == 1 else 2 - g] = right[g] if side == 1 else left[g]
        target = f[n - 2 :] if side == 1 else f[:3]
        faces(settings, family, small, backward, pad, target)


@njit
def both_faces(settings, pipe, r, l, r_in, l_out, r_out, l_in, scratch, fr, fl):
    """Write the face values of forward wave (fr) and backward wave (fl), all [kg/s]."""
    n, small = r.size, pipe["noise"]
    family = scheme_family(settings, n)
    degree = settings["degree"]
    limiter = settings["limiter"]
    edge = scratch[16:21]
    ghosts = scratch[21:24]
    beyond = scratch[24:27]
    for backward in range(2):
        c = l if backward == 1 else r
        # Edge cells are listed from the end inwards, so a backward wave is computed as the mirror image.
        edge_cells(c, backward, edge)
        entering_ghosts(edge, n, family, degree, l_in if backward == 1 else r_in, small, ghosts)
        edge_cells(c, 1 - backward, edge)
        leaving_ghosts(edge, n, family, degree, limiter, small, beyond)
        left, right = (beyond, ghosts) if backward == 1 else (ghosts, beyond)
        wave_faces(
            settings, family, small, backward, c, left, right, scratch, fl if backward == 1 else fr
        )
    # The end faces keep the waves of the solved nodes: what leaves a pipe is what enters its node.
    fr[0], fr[n] = r_in, r_out
    fl[0], fl[n] = l_out, l_in


@njit
def rates_from_faces(k, fr, fl, dr, dl):
    """Write d/dt of forward and backward wave (dr, dl) without friction, from their face values fr and fl."""
    # A cell gains what its neighbour loses through a face, so that mass and momentum are conserved.
    for i in range(dr.size):
        dr[i] = -k * (fr[i + 1] - fr[i])
        dl[i] = k * (fl[i + 1] - fl[i])


@njit
def convolve(e0, e1, e2, e3, e4, e5, c, d):
    """Write the sums d[i] = sum over j of e_j c[i+j].

    Terms are added in pairs from the outside in, so that mirrored arguments give the mirrored result to the bit.
    """
    c1 = c[1:]
    c2 = c[2:]
    c3 = c[3:]
    c4 = c[4:]
    c5 = c[5:]
    for i in range(d.size):
        d[i] = (e0 * c[i] + e5 * c5[i]) + ((e1 * c1[i] + e4 * c4[i]) + (e2 * c2[i] + e3 * c3[i]))


@njit
def rates_linear(settings, k, backward, c, datum, edge, d):
    """Write k (F[i] - F[i+1]) along a wave to d, by a linear scheme with face values F, from its cells c.

    c must have at least five cells.
    datum : value of the wave at the end where it enters [kg/s]; edge : float64[5]  work array
    """
    n = c.size
    inside = settings["inside"]
    enter = settings["enter"]
    leave = settings["leave"]
    # The factor k enters six weights once instead of every cell.
    e0 = k * inside[0]
    e1 = k * inside[1]
    e2 = k * inside[2]
    e3 = k * inside[3]
    e4 = k * inside[4]
    e5 = k * inside[5]
    # A forward wave reads cells i-3 .. i+2, a backward wave i-2 .. i+3: their first full stencils differ by a cell.
    if backward == 1:
        convolve(e5, e4, e3, e2, e1, e0, c, d[2 : n - 3])
    else:
        convolve(e0, e1, e2, e3, e4, e5, c, d[3 : n - 2])
    edge_cells(c, backward, edge)
    # At the ends the weights contain the ghost cells, as sums of the datum and of five cells.
    for j in range(3):
        total = enter[j, 0] * datum
        for m in range(5):
            total += enter[j, m + 1] * edge[m]
        d[n - 1 - j if backward == 1 else j] = k * total
    edge_cells(c, 1 - backward, edge)
    for j in range(2):
        total = 0.0
        for m in range(5):
            total += leave[j, m] * edge[m]
        d[j if backward == 1 else n - 1 - j] = k * total


@njit
def subtract_friction(k, flow, loss, base, r, l, dr, dl):
    """Subtract half of the friction from the rate of the forward wave; add half to the rate of the backward wave.

    The friction is loss |M| M minus the initial steady drag [kg/s2], M : mass flow. On entry dr and dl are -k and k
    times the differences of face values.
    The friction is averaged over two Gauss points of a cell: fourth order, and no kink of the law is missed.
    """
    # A quarter: half of the friction for each wave, as the mean of two points.
    half, spread = 0.25 * loss, GAUSS / k
    for i in range(r.size):
        m = flow + (r[i] - l[i])
        # dr + dl is -k times the difference of M over the cell, so m + d and m - d are M at the Gauss points.
        d = spread * (dr[i] + dl[i])
        hi, lo = m + d, m - d
        s = half * (abs(hi) * hi + abs(lo) * lo) - base
        dr[i] -= s
        dl[i] += s


@njit
def subtract_friction_rough(k, pipe, base, r, l, dr, dl):
    """Subtract friction as `subtract_friction` does, with a friction factor that follows from the wall roughness."""
    loss, rough = pipe["loss"], pipe["rough"]
    e = pipe["roughness"]
    reynolds = pipe["reynolds"]
    flow = pipe["flow"]
    spread = GAUSS / k
    for i in range(r.size):
        m = flow + (r[i] - l[i])
        d = spread * (dr[i] + dl[i])
        high = drag(FRICTION_ROUGH, loss, rough, e, reynolds, m + d)
        both = high + drag(FRICTION_ROUGH, loss, rough, e, reynolds, m - d)
        s = 0.25 * both - base
        dr[i] -= s
        dl[i] += s


@njit
def subtract_friction_hazen(k, flow, loss, rough, base, r, l, dr, dl):
    """Subtract Hazen-Williams friction as `subtract_friction` does, with one evaluation of the power for two points.

    M (M^2 + 1.852 d^2)^0.426 is the mean of |M|^0.852 M over M - d and M + d with a relative error of 0.43 (d/M)^4. M
    is the mass flow at the centre of a cell, M - d and M + d are its values at the Gauss points.
    rough : coefficient of |M|^0.852 M
    """
    spread = GAUSS / k
    half = 0.5 * rough
    quarter = 0.25 * loss
    for i in range(r.size):
        m = flow + (r[i] - l[i])
        d = spread * (dr[i] + dl[i])
        hi, lo = m + d, m - d
        s = (
            quarter * (abs(hi) * hi + abs(lo) * lo)
            + half * (power_of_square(m * m + (1.0 + EXPONENT) * (d * d)) * m)
            - base
        )
        dr[i] -= s
        dl[i] += s


@njit
def rates_upwind(k, flow, loss, base, r, l, r_in, l_in, dr, dl):
    """Write d/dt of both waves by the first-order upwind scheme with friction, in a single loop without face arrays."""
    # Cells that read a datum stand outside the loops, which then have no branch and are vectorised.
    n = r.size
    half = 0.5 * loss
    m = flow + (r[0] - l[0])
    dr[0] = -k * (r[0] - r_in) - (half * (abs(m) * m) - base)
    head = r[: n - 1]
    body = r[1:]
    out = dr[1:]
    opposite = l[1:]
    for i in range(n - 1):
        m = flow + (body[i] - opposite[i])
        out[i] = -k * (body[i] - head[i]) - (half * (abs(m) * m) - base)
    head = l[1:]
    body = l[: n - 1]
    out = dl[: n - 1]
    opposite = r[: n - 1]
    for i in range(n - 1):
        m = flow + (opposite[i] - body[i])
        out[i] = k * (head[i] - body[i]) + (half * (abs(m) * m) - base)
    m = flow + (r[n - 1] - l[n - 1])
    dl[n - 1] = k * (l_in - l[n - 1]) + (half * (abs(m) * m) - base)


@njit(forceinline=True)
def arriving_cell(k, flow, loss, base, before, behind, r, l):
    """Rates of both waves in a cell, as in `rates_arriving`; before, behind : waves that enter it [kg/s]."""
    # Both waves that enter meet in this cell after the step, and friction acts on their difference.
    m = flow + (before - behind)
    s = 0.5 * loss * (abs(m) * m) - base
    return -k * (r - before) - s, k * (behind - l) + s


@njit
def rates_arriving(k, flow, loss, base, r, l, r_in, l_in, dr, dl):
    """Write d/dt of both waves by the upwind scheme, with the friction of the waves that enter a cell.

    A step of the length 1 / k by the Euler method is then that of the method of characteristics: waves move by a cell,
    and friction acts at their new place. With the friction of the old waves of a cell, the first cell behind a front
    would have none.
    """
    n = r.size
    half = 0.5 * loss
    # In a pipe of a single cell both waves enter from nodes.
    dr[0], dl[0] = arriving_cell(k, flow, loss, base, r_in, l[1] if n > 1 else l_in, r[0], l[0])
    if n > 1:
        dr[n - 1], dl[n - 1] = arriving_cell(
            k, flow, loss, base, r[n - 2], l_in, r[n - 1], l[n - 1]
        )
    before = r[: n - 1]
    behind = l[2:]
    here = r[1:]
    own = l[1:]
    forward, backward = dr[1:], dl[1:]
    for i in range(n - 2):
        m = flow + (before[i] - behind[i])
        s = half * (abs(m) * m) - base
        forward[i] = -k * (here[i] - before[i]) - s
        backward[i] = k * (behind[i] - own[i]) + s


@njit
def subtract_friction_arriving(pipe, base, r, l, r_in, l_in, dr, dl):
    """Subtract friction as `subtract_friction` does, that of the waves that enter a cell, see `rates_arriving`."""
    kind = pipe["friction"]
    loss = pipe["loss"]
    rough = pipe["rough"]
    n = r.size
    e = pipe["roughness"]
    reynolds = pipe["reynolds"]
    flow = pipe["flow"]
    for i in range(n):
        before, behind = r[i - 1] if i > 0 else r_in, l[i + 1] if i < n - 1 else l_in
        s = 0.5 * drag(kind, loss, rough, e, reynolds, flow + (before - behind)) - base
        dr[i] -= s
        dl[i] += s


@njit(forceinline=True)
def pipe_rates(settings, pipe, r, l, r_in, l_out, r_out, l_in, scratch, dr, dl):
    """Write d/dt of forward and backward wave of a pipe to dr and dl, from its cells and four waves at its ends."""
    n = r.size
    k = pipe["speed"] / pipe["dx"]
    base = 0.5 * pipe["drag"]
    if settings["from_arriving"] == 1:
        if pipe["friction"] != FRICTION_ROUGH and pipe["friction"] != FRICTION_HAZEN:
            rates_arriving(k, pipe["flow"], pipe["loss"], base, r, l, r_in, l_in, dr, dl)
        else:
            # Without friction here: this law needs a logarithm or a power, and a loop of its own.
            rates_arriving(k, 0.0, 0.0, 0.0, r, l, r_in, l_in, dr, dl)
            subtract_friction_arriving(pipe, base, r, l, r_in, l_in, dr, dl)
        return
    if settings["scheme"] == UPWIND and pipe["friction"] != FRICTION_ROUGH:
        if pipe["friction"] != FRICTION_HAZEN:
            rates_upwind(k, pipe["flow"], pipe["loss"], base, r, l, r_in, l_in, dr, dl)
            return
        rates_upwind(k, 0.0, 0.0, 0.0, r, l, r_in, l_in, dr, dl)
    elif settings["scheme"] == LINEAR and n >= 5:
        # A linear scheme needs no face values: its weights give the differences of fluxes.
        for backward in range(2):
            c, datum, d = (l, l_in, dl) if backward == 1 else (r, r_in, dr)
            rates_linear(settings, k, backward, c, datum, scratch[:5], d)
    else:
        # The scratch numbers before 32 belong to `both_faces`.
        fr, fl = scratch[32 : 33 + n], scratch[40 + n : 41 + 2 * n]
        both_faces(settings, pipe, r, l, r_in, l_out, r_out, l_in, scratch, fr, fl)
        rates_from_faces(k, fr, fl, dr, dl)
    if pipe["friction"] == FRICTION_ROUGH:
        subtract_friction_rough(k, pipe, base, r, l, dr, dl)
    elif pipe["friction"] == FRICTION_HAZEN:
        subtract_friction_hazen(k, pipe["flow"], pipe["loss"], pipe["rough"], base, r, l, dr, dl)
    elif pipe["loss"] != 0.0 or base != 0.0:
        subtract_friction(k, pipe["flow"], pipe["loss"], base, r, l, dr, dl)


@njit
def outgoing_waves_linear(t, y, dydt, out, handle):
    """Write the outgoing waves of pipes to out[ends]; add their flow into nodes at unchanged pressure to out[net]."""
    tables = open_tables(handle)
    settings = tables.settings[0]
    layout = tables.layout[0]
    pipes = tables.pipes
    scratch = tables.scratch
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["cells"] == 0:  # a feature computes its waves
            continue
        n, at = pipe["cells"], layout["ends"] + 4 * i
        r, l = y[pipe["y"] : pipe["y"] + n], y[pipe["y"] + n : pipe["y"] + 2 * n]
        family = scheme_family(settings, n)
        degree = settings["degree"]
        limiter = settings["limiter"]
        small = pipe["noise"]
        for right in range(2):
            wave = end_value(r if right == 1 else l, right, family, degree, limiter, small, scratch)
            out[at + 1 + right] = wave
            node = pipe["to_node"] if right == 1 else pipe["from_node"]
            # From M' = r - l and Y p' = r + l: the flow into a node is 2 w - Y p', here at p' = 0.
            out[layout["net"] + node] += 2.0 * wave


@njit
def incoming_waves_linear(t, y, dydt, out, handle):
    """Write the waves from nodes into pipes to out[ends]: incoming wave = Y p' - outgoing wave [kg/s].

    p' : pressure change of the node since the start [Pa]; Y : admittance of the pipe [kg/s per Pa]
    """
    tables = open_tables(handle)
    layout, pipes = tables.layout[0], tables.pipes
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["cells"] == 0:  # a feature computes its waves
            continue
        at = layout["ends"] + 4 * i
        p_from = out[layout["pressure"] + pipe["from_node"]]
        p_to = out[layout["pressure"] + pipe["to_node"]]
        out[at] = pipe["admittance"] * p_from - out[at + 1]
        out[at + 3] = pipe["admittance"] * p_to - out[at + 2]


@njit
def wave_rates(t, y, dydt, out, handle):
    """Write d/dt of the waves in all pipe cells [kg/s2] to `dydt`, unless it is empty."""
    tables = open_tables(handle)
    settings = tables.settings[0]
    layout = tables.layout[0]
    pipes = tables.pipes
    if dydt.size == 0:
        return
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["cells"] == 0:  # a feature computes its waves
            continue
        n = pipe["cells"]
        o = pipe["y"]
        at = layout["ends"] + 4 * i
        pipe_rates(
            settings,
            pipe,
            y[o : o + n],
            y[o + n : o + 2 * n],
            out[at],
            out[at + 1],
            out[at + 2],
            out[at + 3],
            tables.scratch,
            dydt[o : o + n],
            dydt[o + n : o + 2 * n],
        )
