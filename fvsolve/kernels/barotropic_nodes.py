"""Pressures and flows at nodes under the density laws `log` and `table`.

Stagnation enthalpy is conserved from pipe ends to nodes, and flows through valves have the upstream density. A simple
wave leads from the state extrapolated from the cells to the state at the pipe end, where h(p_end) + v^2 / 2 =
h(p_node), with specific enthalpy h and velocity v. A jet into any node except a junction loses its v^2 / 2.
"""

import numpy as np

from fvsolve.jit import njit
from fvsolve.kernels.density import (
    density,
    enthalpy,
    impedance,
    log_density,
    mass_of_pressure,
    pressure_of_enthalpy,
    pressure_of_log,
    pressure_of_mass,
    velocity_change,
)
from fvsolve.kernels.dtypes import (
    CHAMBER,
    CLUSTER,
    FIXED,
    JUNCTION,
    NO_SOLUTION,
    STATUS,
    TANK,
    WHERE,
)
from fvsolve.kernels.ghost_cells import end_value
from fvsolve.kernels.isolated_nodes import find_connected, inner_row
from fvsolve.kernels.node_clusters import (
    add_valve,
    apply_step,
    close_unstable,
    has_backflow,
    has_converged,
    prepare_cluster,
    solve_dense,
    total_inflows,
    write_cluster,
    zero_isolated,
)
from fvsolve.kernels.pipes import scheme_family
from fvsolve.kernels.restrictions import conductance, restriction_lift, restriction_step
from fvsolve.kernels.schedule_pieces import schedule_value
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.tank_levels import tank_level
from fvsolve.kernels.valves import flow_at_drop, transition_of

# Errors of valve flows against their laws up to this fraction of the node's imbalance cannot reverse a Newton step.
FLOW_ERROR = 0.01


@njit
def head_pressure(st, floats, head):
    """Pressure [Pa] under a column of `head` [m] open to ambient: h(p) = h(ambient) + g head, h : specific enthalpy."""
    return pressure_of_enthalpy(st, floats, enthalpy(st, floats, st["ambient"]) + st["gravity"] * head)


@njit
def known_pressures_barotropic(t, y, dydt, out, handle):
    """Write the pressure changes since the start [Pa] of fixed nodes, tanks and chambers to `out`.

    For chambers that contain gas, also write their stiffness dp/dm [Pa/kg], the pressure rise per stored mass.
    """
    tables = open_tables(handle)
    st, layout, nodes, floats = tables.settings[0], tables.layout[0], tables.nodes, tables.floats
    for i in range(nodes.size):
        node = nodes[i]
        at, kind = layout["pressure"] + i, node["kind"]
        if kind == FIXED:
            value = schedule_value(tables, node["schedule"], t)
            p = head_pressure(st, floats, value - node["elevation"]) if node["head_given"] == 1 else value
            out[at] = p - node["pressure"]
        elif kind == TANK:
            level = tank_level(node, floats, node["density"], y[node["y"]])
            out[at] = head_pressure(st, floats, level) - head_pressure(st, floats, node["level"])
        elif kind == CHAMBER:
            mass = node["mass"] + y[node["y"]]
            p = pressure_of_log(st, floats, 0.0, np.log(mass / (st["rho"] * node["volume"])))
            q0 = np.log(node["mass"] / (st["rho"] * node["volume"]))
            out[at] = p - pressure_of_log(st, floats, 0.0, q0)
            if node["row"] >= 0:
                out[layout["stiffness"] + node["row"]] = 1.0 / (log_density(st, floats, p)[1] * mass)


@njit
def end_flow(st, floats, pipe, m_inside, into_inside, p_node, still):
    """Flow from a pipe end into its node under the density laws `log` and `table`, by Newton.

    Returns the flow into the node [kg/s], its derivative with respect to p_node [kg/s per Pa], and the mass per length
    at the end [kg/m]. A simple wave leads from the extrapolated state to the end: v + integral of dp / (rho c) is
    constant, with velocity v, density rho and wave speed c.

    m_inside, into_inside : mass per length [kg/m] and mass flow towards the node [kg/s], extrapolated from the cells
    p_node : pressure of the node [Pa]
    still : True for any node except a junction, because a jet into such a node loses its v^2 / 2
    """
    p_inside = pressure_of_mass(st, floats, pipe, m_inside)
    v_inside = into_inside / m_inside
    target = enthalpy(st, floats, p_node)
    p = p_node
    m, dm = mass_of_pressure(st, floats, pipe, p)
    v = v_inside - velocity_change(st, floats, pipe, p_inside, p)
    slope = v * dm - m / impedance(st, floats, pipe, p)
    if still and v >= 0.0:
        return m * v, slope, m
    rise = 1.0
    for _ in range(30):
        rise = 1.0 / density(st, floats, p) - v / impedance(st, floats, pipe, p)
        step = (enthalpy(st, floats, p) + 0.5 * v * v - target) / rise
        p -= step
        m, dm = mass_of_pressure(st, floats, pipe, p)
        v = v_inside - velocity_change(st, floats, pipe, p_inside, p)
        if abs(step) <= 1e-15 * abs(p) + 1e-12:
            break
    slope = v * dm - m / impedance(st, floats, pipe, p)
    return m * v, slope / (rise * density(st, floats, p_node)), m


@njit
def end_inflows_barotropic(out, tables, slope, final):
    """Write for every node the change of the flow from its pipes since the start [kg/s] to out[net].

    The flows are those at the present pressures.
    slope : float64[nodes]  receives the derivative of this flow with respect to the pressure of the node [kg/s per Pa]
    On entry out[ends] holds the forward and the backward wave at each pipe end, extrapolated from the cells [kg/s]. If
    `final` is True, they are replaced with the waves of the solved end states.
    """
    st, layout, nodes, floats = tables.settings[0], tables.layout[0], tables.nodes, tables.floats
    pipes, profile = tables.pipes, tables.profile
    for i in range(nodes.size):
        out[layout["net"] + i], slope[i] = 0.0, 0.0
    for k in range(pipes.size):
        pipe = pipes[k]
        c = pipe["speed"]
        for side in range(2):
            at = layout["ends"] + 4 * k + 2 * side
            i = pipe["to_node"] if side == 1 else pipe["from_node"]
            m0 = profile[pipe["face"] + pipe["cells"] * side]
            sign = 2.0 * side - 1.0
            base = pipe["to_base"] if side == 1 else pipe["from_base"]
            base_mass = pipe["to_mass"] if side == 1 else pipe["from_mass"]
            p = nodes[i]["pressure"] + out[layout["pressure"] + i]
            inside = m0 + (out[at] + out[at + 1]) / c
            flow = sign * (pipe["flow"] + (out[at] - out[at + 1]))
            into, rise, m = end_flow(st, floats, pipe, inside, flow, p, nodes[i]["kind"] != JUNCTION)
            change = into - base
            out[layout["net"] + i] += change
            slope[i] += rise
            if final:
                dm = c * (m - base_mass)
                out[at] = 0.5 * (dm + sign * change)
                out[at + 1] = 0.5 * (dm - sign * change)


@njit
def outgoing_waves_barotropic(t, y, dydt, out, handle):
    """Extrapolate forward and backward wave [kg/s] from the cells to both ends of every pipe, into out[ends]."""
    tables = open_tables(handle)
    st, layout, pipes, work = tables.settings[0], tables.layout[0], tables.pipes, tables.scratch
    for i in range(pipes.size):
        pipe = pipes[i]
        n, o = pipe["cells"], pipe["y"]
        family = scheme_family(st, n)
        for side in range(2):
            for wave in range(2):
                cells = y[o + n * wave : o + n * (wave + 1)]
                value = end_value(cells, side, family, st["degree"], st["limiter"], pipe["noise"], work)
                out[layout["ends"] + 4 * i + 2 * side + wave] = value


@njit
def mean_density(st, floats, p_i, p_j):
    """Mean density dp / dh between the pressures p_i and p_j [kg/m3], h : specific enthalpy."""
    dp = p_i - p_j
    if abs(dp) > 1e-3:
        return dp / (enthalpy(st, floats, p_i) - enthalpy(st, floats, p_j))
    return density(st, floats, p_i)


@njit
def driving_pressure(st, floats, p_i, z_i, p_j, z_j):
    """(driving pressure of a link from node i to node j [Pa], upstream density [kg/m3]).

    The driving pressure is rho_mean (h_i - h_j + g (z_i - z_j)), with specific enthalpy h and elevation z [m]. At equal
    elevations it is p_i - p_j.
    """
    dp = p_i - p_j
    if z_i != z_j:
        dh = enthalpy(st, floats, p_i) - enthalpy(st, floats, p_j)
        dp = mean_density(st, floats, p_i, p_j) * (dh + st["gravity"] * (z_i - z_j))
    return dp, density(st, floats, p_i if dp >= 0.0 else p_j)


@njit
def valve_driving_pressure(tables, out, k):
    """(driving pressure of valve k [Pa], upstream density over reference density [-]), from the present pressures."""
    st, layout, nodes, floats = tables.settings[0], tables.layout[0], tables.nodes, tables.floats
    valve = tables.valves[k]
    i, j = valve["from_node"], valve["to_node"]
    p_i = nodes[i]["pressure"] + out[layout["pressure"] + i]
    p_j = nodes[j]["pressure"] + out[layout["pressure"] + j]
    drop, rho = driving_pressure(st, floats, p_i, nodes[i]["elevation"], p_j, nodes[j]["elevation"])
    return drop, rho / st["rho"]


@njit
def valve_target(tables, out, k, g):
    """(flow by the law of valve k at the present pressures, its conductance at the upstream density [kg2/s2/Pa]).

    The first result is M |M| [kg2/s2] under the square-root law M |M| = G dp. If the law has a laminar part, it is the
    flow M [kg/s].
    g : conductance G at the reference density [kg2/s2/Pa]
    """
    valve = tables.valves[k]
    drop, denser = valve_driving_pressure(tables, out, k)
    dense = g * denser
    if drop < 0.0:
        dense *= valve["back"]
    if valve["transition"] > 0.0:
        return flow_at_drop(dense, transition_of(valve, dense), drop), dense
    return dense * drop, dense


@njit
def assemble_barotropic(cluster, out, tables, g, m, c, connected, slope, wide, a, s, lift, matrix, right):
    """Assemble Newton's linear system for the node pressures of a cluster (nodes that are solved together).

    Arguments and results are those of `node_clusters.assemble`, but the flows from pipe ends depend on pressure.
    slope : derivative of these flows into each node with respect to its pressure [kg/s per Pa]
    """
    layout, nodes, valves = tables.layout[0], tables.nodes, tables.valves
    integers, n = tables.integers, c.size
    matrix[:] = 0.0
    for r in range(n):
        i = integers[cluster["first_node"] + r]
        right[r] = out[layout["net"] + i] + c[r]
        matrix[n * r + r] = -slope[i]
    for e in range(g.size):
        k = integers[cluster["first_valve"] + e]
        i, j = inner_row(nodes, valves[k]["from_node"]), inner_row(nodes, valves[k]["to_node"])
        a[e], s[e], lift[e] = -m[e], 0.0, 0.0
        if g[e] > 0.0:
            drop, denser = valve_driving_pressure(tables, out, k)
            a[e], s[e] = restriction_step(tables, out, k, g[e], m[e], drop, denser, wide)
            lift[e] = restriction_lift(tables, out, k, g[e], drop, denser, wide)
        add_valve(i, j, m[e], a[e], s[e], lift[e], n, matrix, right)
    for r in range(n):
        if connected[r] == 0.0:
            right[r], matrix[n * r + r] = 0.0, 1.0


@njit
def newton_step(cluster, out, tables, g, m, c, connected, slope, wide, work):
    """Make a Newton step for the pressures and valve flows of a cluster (nodes that are solved together).

    Returns the greatest relative change, and True if the step points to the root. This is so if the errors of valve
    flows against their laws are below the fraction FLOW_ERROR of the imbalance of the nodes: then the second-order
    error of Newton cannot reverse this imbalance.
    work : work array; other arguments as for `assemble_barotropic` and `node_clusters.assemble`
    """
    n, k = c.size, g.size
    matrix, right = work[: n * n], work[n * n : n * n + n]
    at = n * n + n
    a, s, lift = work[at : at + k], work[at + k : at + 2 * k], work[at + 2 * k : at + 3 * k]
    assemble_barotropic(cluster, out, tables, g, m, c, connected, slope, wide, a, s, lift, matrix, right)
    imbalance = largest_magnitude(right)
    sign = solve_dense(matrix, right, n)
    if sign <= 0.0 and not wide and close_unstable(cluster, tables, g, m):
        assemble_barotropic(cluster, out, tables, g, m, c, connected, slope, wide, a, s, lift, matrix, right)
        imbalance = largest_magnitude(right)
        sign = solve_dense(matrix, right, n)
    if sign == 0.0:
        out[STATUS], out[WHERE] = NO_SOLUTION, tables.integers[cluster["first_node"]]
        return 0.0, True
    flow_error = 0.0
    for e in range(k):
        flow_error += a[e] * a[e] / max(abs(m[e] + a[e]), 1e-300)
    limit_step(tables.settings[0]["beta"], a, right)
    return apply_step(cluster, tables, out, m, a, s, lift, right), flow_error <= FLOW_ERROR * imbalance


@njit(forceinline=True)
def largest_magnitude(a):
    """Greatest magnitude of the entries of an array."""
    most = 0.0
    for i in range(a.size):
        most = max(most, abs(a[i]))
    return most


@njit
def limit_step(most, a, right):
    """Scale a Newton step so that no pressure rises by more than `most` [Pa].

    most : bulk modulus, because a rise by it multiplies the density by about e
    a : changes of valve flows at constant drop [kg/s]; right : changes of node pressures [Pa]; both are scaled
    """
    greatest = 0.0
    for r in range(right.size):
        greatest = max(greatest, right[r])
    if greatest > most:
        for r in range(right.size):
            right[r] *= most / greatest
        for e in range(a.size):
            a[e] *= most / greatest


@njit
def given_flows(t, y, out, tables):
    """Write the demands of junctions, and flows of valves between two nodes of known pressure, to `out`.

    A demand is written to out[supply] as a negative number. The change since the start of the given inflow of a
    junction
    is added to out[net]. Pressures of junctions are reset to the initial steady state.
    """
    layout, nodes, valves = tables.layout[0], tables.nodes, tables.valves
    for i in range(nodes.size):
        if nodes[i]["kind"] == JUNCTION:
            demand = schedule_value(tables, nodes[i]["schedule"], t)
            out[layout["supply"] + i] = -demand
            out[layout["net"] + i] += nodes[i]["inflow"] - (demand - nodes[i]["demand"])
            out[layout["pressure"] + i] = 0.0
    for k in range(valves.size):
        i, j = valves[k]["from_node"], valves[k]["to_node"]
        if nodes[i]["kind"] != JUNCTION and nodes[j]["kind"] != JUNCTION and valves[k]["solve"] != CLUSTER:
            g = conductance(tables, out, k)
            out[layout["valve"] + k] = valve_target(tables, out, k, g)[0] if g > 0.0 else 0.0


@njit
def is_undisturbed(cluster, tables, out):
    """True if pipes bring exactly their initial steady flow into every node of a cluster (nodes solved together)."""
    for i in range(cluster["nodes"]):
        node = tables.integers[cluster["first_node"] + i]
        if out[tables.layout[0]["net"] + node] != 0.0:
            return False
    return True


@njit
def node_work(tables):
    """Work arrays for solving all clusters (nodes solved together), as parts of `tables.scratch`.

    Four arrays float64[nodes]: derivative of the pipe flow into a node with respect to its pressure [kg/s per Pa];
    inflow c from all links except valves, with the initial flows of pipes [kg/s]; 1 if open valves join a node to a
    pipe or to a known pressure, else 0; group number of isolated nodes.
    Two arrays float64[valves]: conductance [kg2/s2/Pa]; flow [kg/s]. Last, the remaining scratch array.
    """
    n, v, work = tables.nodes.size, tables.valves.size, tables.scratch
    g, m, rest = work[4 * n : 4 * n + v], work[4 * n + v : 4 * n + 2 * v], work[4 * n + 2 * v :]
    return (
        work[:n],
        work[n : 2 * n],
        work[2 * n : 3 * n],
        work[3 * n : 4 * n],
        g,
        m,
        rest[5 * tables.clusters.size :],
    )


@njit
def cluster_work(tables):
    """State of the Newton iteration of each cluster (nodes solved together): five arrays float64[clusters].

    done : 1 if the cluster has converged
    change, last_change : greatest relative change in the last step, and in the step before
    wide : 1 while valves that a pressure lifts are held wide open
    sure : 1 if the last step points to the root; it may point away until the flows of valves have reversed
    """
    n, v, n_clusters = tables.nodes.size, tables.valves.size, tables.clusters.size
    work = tables.scratch[4 * n + 2 * v :]
    return (
        work[:n_clusters],
        work[n_clusters : 2 * n_clusters],
        work[2 * n_clusters : 3 * n_clusters],
        work[3 * n_clusters : 4 * n_clusters],
        work[4 * n_clusters : 5 * n_clusters],
    )


@njit
def begin_clusters(out, tables, space):
    """Set flows and conductances of the valves of all clusters (nodes solved together) before the first Newton step.

    A cluster counts as converged if all its values are those of the initial steady state; `step_clusters` checks the
    flows from pipe ends later.
    space : work arrays of `node_work`
    """
    clusters, (_, c, connected, _, g, m, _), (done, change, _, wide, _) = tables.clusters, space, cluster_work(tables)
    a, b = 0, 0
    for k in range(clusters.size):
        cluster = clusters[k]
        i, j = a + cluster["nodes"], b + cluster["valves"]
        unchanged = prepare_cluster(cluster, tables, out, g[b:j], m[b:j])
        done[k] = 1.0 if total_inflows(cluster, tables, out, c[a:i]) and unchanged else 0.0
        change[k], wide[k] = 1e300, 1.0
        find_connected(cluster, tables, g[b:j], connected[a:i])
        zero_isolated(cluster, tables, g[b:j], m[b:j], connected[a:i])
        a, b = i, j


@njit
def step_clusters(sweep, out, tables, space):
    """Make a Newton step in every cluster (nodes solved together) that is disturbed and has not converged.

    sweep : number of the step, from 1; space : work arrays of `node_work`
    """
    clusters, (slope, c, connected, _, g, m, rest), (done, change, last_change, wide, sure) = (
        tables.clusters, space, cluster_work(tables),
    )  # fmt: skip
    a, b = 0, 0
    for k in range(clusters.size):
        cluster = clusters[k]
        i, j = a + cluster["nodes"], b + cluster["valves"]
        if sweep == 1 and done[k] == 1.0:
            if is_undisturbed(cluster, tables, out):
                change[k] = 0.0
            else:
                done[k] = 0.0
        if done[k] == 0.0:
            last_change[k] = change[k]
            step, near = newton_step(
                cluster, out, tables, g[b:j], m[b:j], c[a:i], connected[a:i], slope, wide[k] == 1.0, rest
            )
            change[k] = max(0.0, step)  # 0 for NaN: the iteration ends, the rates show the fault
            sure[k] = 1.0 if near else 0.0
        a, b = i, j


@njit
def check_clusters(out, tables, space):
    """Mark clusters (nodes solved together) as converged, each by its own last change.

    Returns True if any cluster has not converged. space : work arrays of `node_work`
    """
    clusters, m, (done, change, last_change, wide, _), b, active = (
        tables.clusters, space[5], cluster_work(tables), 0, False,
    )  # fmt: skip
    for k in range(clusters.size):
        j = b + clusters[k]["valves"]
        if done[k] == 0.0 and has_converged(change[k], last_change[k]):
            if wide[k] == 1.0 and has_backflow(clusters[k], tables, m[b:j]):
                change[k], wide[k] = 1e300, 0.0
            else:
                done[k] = 1.0
        active = active or done[k] == 0.0
        b = j
    return active


@njit
def write_clusters(out, tables, space):
    """Write the valve flows of all clusters (nodes solved together) to `out`, and pressures of isolated nodes.

    space : work arrays of `node_work`
    """
    clusters, (_, c, connected, group, g, m, _), change = tables.clusters, space, cluster_work(tables)[1]
    a, b = 0, 0
    for k in range(clusters.size):
        i, j = a + clusters[k]["nodes"], b + clusters[k]["valves"]
        write_cluster(clusters[k], tables, out, g[b:j], m[b:j], c[a:i], connected[a:i], group[a:i], change[k])
        a, b = i, j


@njit
def solve_nodes_barotropic(t, y, dydt, out, handle):
    """Solve all nodes under the density laws `log` and `table`: node pressures, valve flows, waves at every pipe end.

    In each Newton sweep, every cluster (nodes solved together) that has not converged makes a step; then all pipe ends
    are evaluated again. Each cluster stops by its own change, so its result does not depend on other clusters. An
    undisturbed cluster is left as it is.
    """
    tables = open_tables(handle)
    space = node_work(tables)
    given_flows(t, y, out, tables)
    begin_clusters(out, tables, space)
    for sweep in range(1, 101):
        end_inflows_barotropic(out, tables, space[0], False)
        step_clusters(sweep, out, tables, space)
        if not check_clusters(out, tables, space):
            break
    write_clusters(out, tables, space)
    end_inflows_barotropic(out, tables, space[0], True)
