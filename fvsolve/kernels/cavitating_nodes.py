"""Nodes where a pipe end may hold a cavity: the law `mixture`. Knows ends and nodes; knows no cells.

As in `barotropic_nodes.py`, but the wave from the cells to the end's own state is the jump of `riemann.py`, an end
that lets go more than the speed of sound hears nothing of its node, and no pressure passes the law's floor.
"""

from fvsolve.jit import njit
from fvsolve.kernels.barotropic_nodes import (
    begin_clusters,
    cluster_space,
    finish_clusters,
    given_flows,
    node_space,
    settle_clusters,
    step_clusters,
)
from fvsolve.kernels.clusters import BAR
from fvsolve.kernels.density import pressure_of_mass
from fvsolve.kernels.density.mixture import enthalpy, relative_volume
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import JUNCTION, NOT_CONVERGED, STATUS, WHERE
from fvsolve.kernels.riemann import FALL, UNBOUNDED, beside, between, jump, side_at

ROUNDING = 1e-12  # of a node's pressure: the least that its gas has
LEFT = 1e-7  # of what a pressure as high as that of the node brings: the most that rounding leaves of a balance
NARROW = 1e-9  # of a pressure: bounds that are nearer to each other, and Newton wants beyond, have lost the root
LONG = 30  # sweeps after which Newton is helped along


@njit
def end_side(st, floats, pipe, inside, v_in, p_node, still):
    """(side of an end, its velocity, slope of that over p_node): h(p) + v^2 / 2 = h(p_node), v towards the node.

    An end that runs into its node at more than half the speed of sound, or into a vessel at rest, has the node's
    pressure: its v^2 / 2 is lost.
    """
    floor, target, side = st["floor"], enthalpy(st, floats, p_node), side_at(st, floats, pipe, p_node)
    change, rise = jump(st, floats, pipe, inside, side)
    v = v_in - change
    if (still and v >= 0.0) or 2.0 * v * side[1] > side[3]:
        return side, v, -rise
    slope, rho, low, high = 1.0, 1.0, floor, p_node
    for _ in range(60):
        p, rho = side[0], st["rho"] / relative_volume(st, side[0])[0]
        slope, over = 1.0 - v * rise * rho, enthalpy(st, floats, p) + 0.5 * v * v - target
        if over > 0.0 and not (v > 0.0 and slope < 0.5):
            high = p
        else:
            low = p
        step = over * rho / slope
        if abs(step) <= 1e-15 * abs(p) + 1e-12 * (p - floor):
            break
        p -= step
        side = side_at(st, floats, pipe, p if low < p < high else between(floor, low, high, side[0]))
        change, rise = jump(st, floats, pipe, inside, side)
        v = v_in - change
    return side, v, -rise * rho * relative_volume(st, p_node)[0] / (slope * st["rho"])


@njit
def end_of_state(st, floats, pipe, p_in, v_in, p_node, still):
    """(flow into the node [kg/s], its slope over p_node, mass per length [kg/m]) of a pipe end.

    p_in, v_in : what the cells say of the end, velocity towards the node.
    """
    inside = side_at(st, floats, pipe, p_in)
    side, v, slope = end_side(st, floats, pipe, inside, v_in, p_node, still)
    if v >= 0.0:
        m, at, _ = beside(st, floats, pipe, inside, v_in, side, v)
        return m * at, side[1] * slope, m
    return side[1] * v, side[1] * slope, side[1]


@njit
def end_flow_cavitating(st, floats, pipe, m_inside, into_inside, p_node, still):
    """`end_of_state` from what the cells say as mass per length and mass flow."""
    p = pressure_of_mass(st, floats, pipe, m_inside)
    return end_of_state(st, floats, pipe, p, into_inside / m_inside, p_node, still)


@njit
def cavitating_ends(out, tables, slope, final):
    """Change of flow from pipes into every node at the present pressures, in out[net], and its slope.

    out[ends] holds pressure and velocity [Pa, m/s] that the cells say of each end; `final` puts the ends' own waves
    in their place.
    """
    st, layout, nodes, floats = tables.settings[0], tables.layout[0], tables.nodes, tables.floats
    pipes = tables.pipes
    for i in range(nodes.size):
        out[layout["net"] + i], slope[i] = 0.0, 0.0
    for k in range(pipes.size):
        pipe = pipes[k]
        for side in range(2):
            at = layout["ends"] + 4 * k + 2 * side
            i = pipe["to_node"] if side == 1 else pipe["from_node"]
            sign = 2.0 * side - 1.0
            base = pipe["to_base"] if side == 1 else pipe["from_base"]
            base_mass = pipe["to_mass"] if side == 1 else pipe["from_mass"]
            p = nodes[i]["pressure"] + out[layout["pressure"] + i]
            still = nodes[i]["kind"] != JUNCTION
            into, rise, m = end_of_state(st, floats, pipe, out[at], sign * out[at + 1], p, still)
            change = into - base
            out[layout["net"] + i] += change
            slope[i] += rise
            if final:
                dm = pipe["speed"] * (m - base_mass)
                out[at] = 0.5 * (dm + sign * change)
                out[at + 1] = 0.5 * (dm - sign * change)


@njit
def hold_back(sweep, out, tables, before, low, high):
    """Keep Newton's step of every node inside what is known of its root; note how far each cluster moved, relative.

    A node alone in its cluster takes in less the higher its pressure is, so each step that is sure of its direction
    bounds its root on one side; after a while the bounds are halved. Others keep above the floor, and then take half
    steps.
    """
    st, nodes, clusters = tables.settings[0], tables.nodes, tables.clusters
    pressure, floor, (done, moved, _, _, sure) = tables.layout[0]["pressure"], st["floor"], cluster_space(tables)
    for which in range(clusters.size):
        if done[which] == 1.0 or clusters[which]["nodes"] == 0:
            continue
        moved[which] = 0.0
        for k in range(clusters[which]["nodes"]):
            i = tables.integers[clusters[which]["first_node"] + k]
            base = nodes[i]["pressure"]
            p, q, least = base + before[i], base + out[pressure + i], floor + ROUNDING * (1e5 + base)
            if clusters[which]["nodes"] > 1:
                q = max(p + 0.5 * (q - p) if sweep > LONG else q, floor + FALL * (p - floor), least)
            elif q != p:
                if sure[which] == 1.0 or sweep > LONG:
                    low[i], high[i] = (p, high[i]) if q > p else (low[i], p)
                if sweep <= LONG and high[i] - low[i] <= NARROW * (BAR + p):  # one was wrong, or there is a kink
                    low[i], high[i] = floor, UNBOUNDED
                if sweep > LONG or not low[i] < q < high[i]:  # a kink can lead Newton to and fro
                    under, above = (p, high[i]) if q > p else (low[i], p)
                    q = max(between(floor, under, above, p), least)
            out[pressure + i] = q - base
            moved[which] = max(moved[which], abs(q - p) / (1e5 + abs(p)))


@njit
def unbind(tables, low, high, first):
    """Forget the bounds of clusters that begin: at the first sweep, and where the wide look at lifts is over."""
    clusters, (_, moved, _, _, _) = tables.clusters, cluster_space(tables)
    for which in range(clusters.size):
        if first or moved[which] == 1e300:
            for k in range(clusters[which]["nodes"]):
                i = tables.integers[clusters[which]["first_node"] + k]
                low[i], high[i] = tables.settings[0]["floor"], UNBOUNDED


@njit
def close_cavitating(t, y, dydt, out, handle):
    """`close_barotropic` above the law's floor; a cluster is done when none of its pressures changes."""
    tables = open_tables(handle)
    space, n, work = node_space(tables), tables.nodes.size, tables.scratch
    pressure, last = tables.layout[0]["pressure"], space[3]
    low, high = work[work.size - 2 * n : work.size - n], work[work.size - n :]
    given_flows(t, y, out, tables)
    begin_clusters(out, tables, space)
    for sweep in range(1, 101):
        unbind(tables, low, high, sweep == 1)
        cavitating_ends(out, tables, space[0], False)
        for i in range(n):
            last[i] = out[pressure + i]
        step_clusters(sweep, out, tables, space)
        hold_back(sweep, out, tables, last, low, high)
        if not settle_clusters(out, tables, space):
            break
    finish_clusters(out, tables, space)
    cavitating_ends(out, tables, space[0], True)


@njit
def balance_junctions(t, y, dydt, out, handle):
    """What Newton has left at junctions goes to their pipe ends, by what these hold: rounding, but mass is kept.

    More than that at a junction full of liquid is a failure. Where a cavity lies, more may be asked for than comes, as
    nothing flows to a place quicker than sound.
    """
    tables = open_tables(handle)
    layout, nodes, pipes, profile = tables.layout[0], tables.nodes, tables.pipes, tables.profile
    left, held, some = tables.scratch[: nodes.size], tables.scratch[nodes.size : 2 * nodes.size], False
    floor = tables.settings[0]["floor"]
    for i in range(nodes.size):
        left[i], held[i] = 0.0, 0.0
        if nodes[i]["kind"] == JUNCTION and nodes[i]["admittance"] > 0.0:
            left[i] = out[layout["net"] + i] + (out[layout["supply"] + i] + nodes[i]["demand"])
            out[layout["net"] + i] -= left[i]
            some = some or left[i] != 0.0
            p = nodes[i]["pressure"] + out[layout["pressure"] + i]
            if p - floor > BAR and abs(left[i]) > LEFT * nodes[i]["admittance"] * (BAR + abs(p)):
                out[STATUS], out[WHERE] = NOT_CONVERGED, i
    for turn in range(2 if some else 0):
        for k in range(pipes.size):
            for side in range(2):
                i = pipes[k]["to_node"] if side == 1 else pipes[k]["from_node"]
                at = layout["ends"] + 4 * k + 2 * side
                m = profile[pipes[k]["face"] + side * pipes[k]["cells"]]
                m += (out[at] + out[at + 1]) / pipes[k]["speed"]
                if turn == 0:
                    held[i] += m
                elif left[i] != 0.0:
                    change = (0.5 - side) * left[i] * (m / held[i])
                    out[at] += change
                    out[at + 1] -= change
