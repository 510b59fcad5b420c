"""Pressures and flows at nodes under the density law `mixture`, where a pipe end may hold a cavity.

Differences from `barotropic_nodes.py`: a shock or a rarefaction (`riemann.py`) leads from the state in the cells to the
state at the end. A node has no effect on an end where the flow out of the pipe is supersonic. No pressure falls below
the floor pressure of the law.
"""

from fvsolve.core.kernels.barotropic_nodes import (
    add_end_inflow,
    clear_inflows,
    given_flows,
    node_beyond,
    write_end_waves,
)
from fvsolve.core.kernels.density import pressure_of_mass
from fvsolve.core.kernels.density.mixture_law import enthalpy, relative_volume
from fvsolve.core.kernels.dtypes import JUNCTION, NO_LIQUID, NOT_CONVERGED, STATUS, WHERE
from fvsolve.core.kernels.node_clusters import (
    BAR,
    MAX_SWEEPS,
    begin_clusters,
    check_clusters,
    cluster_work,
    node_work,
    step_clusters,
    write_clusters,
)
from fvsolve.core.kernels.riemann import (
    FALL,
    UNBOUNDED,
    intermediate_pressure,
    sample_wave,
    state_at,
    wave_jump,
)
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.jit import njit

ROUNDING = 1e-12  # least gas pressure of a node, relative to its pressure
# greatest imbalance by rounding, relative to the flow that the whole pressure of the node drives
BALANCE_ERROR = 1e-7
# relative width of bounds: if they are narrower and Newton steps out of them, they have lost the root
NARROW = 1e-9
SHORTAGE = 0.01  # part of a demand that may be drawn from any state of the pipe ends
EMPTY = 0.3  # fraction of liquid at a pipe end below which nothing can be drawn from it
BISECTION_START = 30  # sweeps after which Newton steps are replaced by bisection or halved


@njit
def end_side(st, floats, pipe, inside, v_in, p_node, still):
    """State at a pipe end, where h(p) + v^2 / 2 = h(p_node), with specific enthalpy h and velocity v.

    Returns the state (see `riemann.state_at`), its velocity towards the node [m/s], and the derivative of this velocity
    with respect to p_node [m/s/Pa].
    inside, v_in : state extrapolated from the cells, and its velocity towards the node [m/s]
    p_node : pressure of the node [Pa]
    still : True for any node except a junction
    Where the flow runs into the node at more than half the speed of sound, or into a node with `still` True, the
    pressure of the end is that of the node: v^2 / 2 is lost.
    """
    floor = st["floor"]
    target = enthalpy(st, floats, p_node)
    side = state_at(st, floats, pipe, p_node)
    change, rise = wave_jump(st, floats, pipe, inside, side)
    v = v_in - change
    if (still and v >= 0.0) or 2.0 * v * side[1] > side[3]:
        return side, v, -rise
    # A part of the enthalpy of the node is kinetic energy at the end, so its pressure is not above p_node.
    slope = 1.0
    rho = 1.0
    low = floor
    high = p_node
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
        # The gas pressure may change by orders of magnitude, so bounds are halved in its logarithm.
        side = state_at(
            st,
            floats,
            pipe,
            p if low < p < high else intermediate_pressure(floor, low, high, side[0]),
        )
        change, rise = wave_jump(st, floats, pipe, inside, side)
        v = v_in - change
    return side, v, -rise * rho * relative_volume(st, p_node)[0] / (slope * st["rho"])


@njit
def end_flow_of_state(st, floats, pipe, p_in, v_in, p_node, still):
    """Flow from a pipe end into its node under the density law `mixture`.

    Returns the flow into the node [kg/s], its derivative with respect to p_node [kg/s per Pa], and the mass per length
    at the end [kg/m].
    p_in, v_in : pressure [Pa] and velocity towards the node [m/s], extrapolated from the cells
    p_node : pressure of the node [Pa]
    still : True for any node except a junction, because a jet into such a node loses its kinetic energy
    """
    inside = state_at(st, floats, pipe, p_in)
    side, v, slope = end_side(st, floats, pipe, inside, v_in, p_node, still)
    # A flow into the node may be supersonic: the face then lies within the wave, or before it.
    if v >= 0.0:
        m, at, _ = sample_wave(st, floats, pipe, inside, v_in, side, v)
        return m * at, side[1] * slope, m
    return side[1] * v, side[1] * slope, side[1]


@njit
def end_flow_cavitating(st, floats, pipe, m_inside, into_inside, p_node, still):
    """Results of `end_flow_of_state`, from mass per length and mass flow in the cells instead of pressure and velocity.

    m_inside, into_inside : mass per length [kg/m] and mass flow towards the node [kg/s], extrapolated from the cells
    p_node, still : as for `end_flow_of_state`
    """
    p = pressure_of_mass(st, floats, pipe, m_inside)
    return end_flow_of_state(st, floats, pipe, p, into_inside / m_inside, p_node, still)


@njit
def end_inflows_cavitating(out, tables, slope, final):
    """Write for every node the change of the flow from its pipes since the start [kg/s] to out[net].

    The flows are those at the present pressures.
    slope : float64[nodes]  receives the derivative of this flow with respect to the pressure of the node [kg/s per Pa]
    On entry out[ends] holds pressure [Pa] and velocity [m/s] at each pipe end, extrapolated from the cells. If `final`
    is True, they are replaced with the waves of the solved end states [kg/s].
    """
    layout, pipes = tables.layout[0], tables.pipes
    clear_inflows(out, tables, slope)
    for k in range(pipes.size):
        for side in range(2):
            at, sign = layout["ends"] + 4 * k + 2 * side, 2.0 * side - 1.0
            p, still = node_beyond(out, tables, pipes[k], side)
            into, rise, m = end_flow_of_state(
                tables.settings[0], tables.floats, pipes[k], out[at], sign * out[at + 1], p, still
            )
            add_end_inflow(out, tables, slope, k, side, into, rise)
            if final:
                write_end_waves(out, tables, k, side, into, m)


@njit
def bound_steps(sweep, out, tables, before, low, high):
    """Keep the Newton step of every node within bounds of its root; write the relative change of each cluster.

    A cluster is a set of nodes that are solved together. The inflow of a node that is alone in its cluster falls as its
    pressure rises. So each step with a sure direction bounds the root on one side. After BISECTION_START sweeps the
    interval between the bounds is halved. Nodes of larger clusters are kept above the floor pressure, and take half
    steps after BISECTION_START sweeps.

    sweep : number of the Newton step, from 1
    before : float64[nodes]  pressure changes since the start, before the step [Pa]
    low, high : float64[nodes]  bounds of the pressures [Pa]
    """
    st = tables.settings[0]
    nodes = tables.nodes
    clusters = tables.clusters
    pressure, floor, (done, change, _, _, sure) = (
        tables.layout[0]["pressure"],
        st["floor"],
        cluster_work(tables),
    )
    for c in range(clusters.size):
        if done[c] == 1.0 or clusters[c]["nodes"] == 0:
            continue
        change[c] = 0.0
        for k in range(clusters[c]["nodes"]):
            i = tables.integers[clusters[c]["first_node"] + k]
            base = nodes[i]["pressure"]
            p = base + before[i]
            q = base + out[pressure + i]
            least = floor + ROUNDING * (1e5 + base)
            if clusters[c]["nodes"] > 1:
                q = max(
                    p + 0.5 * (q - p) if sweep > BISECTION_START else q,
                    floor + FALL * (p - floor),
                    least,
                )
            elif q != p:
                if sure[c] == 1.0 or sweep > BISECTION_START:
                    low[i], high[i] = (p, high[i]) if q > p else (low[i], p)
                # a bound was wrong, or there is a kink
                if sweep <= BISECTION_START and high[i] - low[i] <= NARROW * (BAR + p):
                    low[i], high[i] = floor, UNBOUNDED
                # at a kink Newton can alternate between two points
                if sweep > BISECTION_START or not low[i] < q < high[i]:
                    lower, upper = (p, high[i]) if q > p else (low[i], p)
                    q = max(intermediate_pressure(floor, lower, upper, p), least)
            out[pressure + i] = q - base
            change[c] = max(change[c], abs(q - p) / (1e5 + abs(p)))


@njit
def reset_bounds(tables, low, high, first):
    """Reset the pressure bounds of the nodes in clusters whose Newton iteration begins.

    A cluster is a set of nodes that are solved together. Its iteration begins at the first sweep (`first` is True), and
    again after the search in which lifted valves are held wide open.
    low, high : float64[nodes]  bounds of the pressures [Pa]
    """
    clusters, (_, change, _, _, _) = tables.clusters, cluster_work(tables)
    for c in range(clusters.size):
        if first or change[c] == 1e300:
            for k in range(clusters[c]["nodes"]):
                i = tables.integers[clusters[c]["first_node"] + k]
                low[i], high[i] = tables.settings[0]["floor"], UNBOUNDED


@njit
def solve_nodes_cavitating(t, y, dydt, out, handle):
    """Solve all nodes under the density law `mixture`, with pressures above its floor pressure.

    The values written are those of `solve_nodes_barotropic`. The iteration of a cluster (nodes solved together) ends
    when its pressures do not change.
    """
    tables = open_tables(handle)
    space = node_work(tables)
    n = tables.nodes.size
    work = tables.scratch
    pressure, last_pressure = tables.layout[0]["pressure"], space[3]
    low, high = work[work.size - 2 * n : work.size - n], work[work.size - n :]
    given_flows(t, y, out, tables)
    begin_clusters(out, tables, space)
    for sweep in range(1, MAX_SWEEPS + 1):
        # Bounds found with wide open valves do not hold for their real lifts.
        reset_bounds(tables, low, high, sweep == 1)
        end_inflows_cavitating(out, tables, space[0], False)
        for i in range(n):
            # Newton's step starts here; `bound_steps` compares its end with these pressures.
            last_pressure[i] = out[pressure + i]
        step_clusters(sweep, out, tables, space)
        bound_steps(sweep, out, tables, last_pressure, low, high)
        if not check_clusters(out, tables, space):
            break
    write_clusters(out, tables, space)
    end_inflows_cavitating(out, tables, space[0], True)


@njit
def balance_junctions(t, y, dydt, out, handle):
    """Distribute the flow imbalance of each junction over its pipe ends in proportion to their mass: mass is conserved.

    The waves at the ends, in `out`, are changed. An imbalance above rounding is a failure at a junction full of liquid.
    Where a cavity lies, the demand may exceed the inflow, because no flow towards the junction can be faster than
    sound. The difference is drawn from the ends. If they hold too little liquid, the run ends: its velocity would grow
    without bound.
    """
    tables = open_tables(handle)
    layout = tables.layout[0]
    nodes = tables.nodes
    pipes = tables.pipes
    profile = tables.profile
    imbalance = tables.scratch[: nodes.size]
    content = tables.scratch[nodes.size : 2 * nodes.size]
    unbalanced = False
    floor = tables.settings[0]["floor"]
    for i in range(nodes.size):
        imbalance[i], content[i] = 0.0, 0.0
        if nodes[i]["kind"] == JUNCTION and nodes[i]["admittance"] > 0.0:
            imbalance[i] = out[layout["net"] + i] + (out[layout["supply"] + i] + nodes[i]["demand"])
            out[layout["net"] + i] -= imbalance[i]
            unbalanced = unbalanced or imbalance[i] != 0.0
            p = nodes[i]["pressure"] + out[layout["pressure"] + i]
            if p - floor > BAR and abs(imbalance[i]) > BALANCE_ERROR * nodes[i]["admittance"] * (
                BAR + abs(p)
            ):
                out[STATUS], out[WHERE] = NOT_CONVERGED, i
    # The first sweep sums the mass at the ends, by which the second distributes the imbalance.
    for sweep in range(2 if unbalanced else 0):
        for k in range(pipes.size):
            for side in range(2):
                i = pipes[k]["to_node"] if side == 1 else pipes[k]["from_node"]
                at = layout["ends"] + 4 * k + 2 * side
                m = profile[pipes[k]["face"] + side * pipes[k]["cells"]]
                m += (out[at] + out[at + 1]) / pipes[k]["speed"]
                if sweep == 0:
                    content[i] += m
                elif imbalance[i] != 0.0:
                    short = -imbalance[i] > SHORTAGE * -out[layout["supply"] + i] > 0.0
                    if short and content[i] < EMPTY * tables.settings[0]["rho"] * pipes[k]["area"]:
                        out[STATUS], out[WHERE] = NO_LIQUID, i
                    change = (0.5 - side) * imbalance[i] * (m / content[i])
                    out[at] += change
                    out[at + 1] -= change
