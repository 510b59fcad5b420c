"""Clusters: nodes without storage that several valves join, solved together by Newton on pressures and flows.

Under the density law `linear` only nodes with several valves belong to a cluster; the others have a closed root
(`linear_nodes.py`). Under the other laws every node without storage does, and the flows from pipe ends depend on
pressure.

Valve from node i to node j: M |M| = G (dp0 + p_i' - p_j'), with flow M [kg/s], conductance G and initial drop dp0.
Node: c_i - Y_i p_i' = flow that leaves it through valves, with the other inflow c_i at p_i' = 0 and the admittance Y_i
of its pipes. p' is the pressure change since the initial steady state. Both are solved together (gradient method of
Todini and Pilati 1988). The unknown flows are total flows, not changes: where a valve is nearly closed, a change would
lose all but its rounding. A cluster in which nothing has changed is not solved. Each cluster stops by its own change,
so its result does not depend on other clusters.

Arguments common to these functions: `cluster`, row of the cluster; arrays with an entry for each of its valves or each
of its n nodes:
g, m : conductance [kg2/s2/Pa], and flow of valves [kg/s]
c : inflow of nodes except through valves, less the demand [kg/s]
connected : 1 if open valves join a node to a pipe or to a known pressure, 0 for an isolated node
slope : float64[nodes]  derivative of the flow from pipes into a node with respect to its pressure [kg/s per Pa]; not
    used under the density law `linear`
wide : True while valves that a pressure lifts are held wide open, see `restrictions.restriction_step`
space : work arrays of `node_work`
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import NOT_CONVERGED, STATUS, WHERE
from fvsolve.kernels.isolated_nodes import check_demand, find_connected, inner_row, isolated_pressures
from fvsolve.kernels.node_newton import (
    FAILED_CHANGE,
    ROUNDING,
    has_converged,
    newton_step_barotropic,
    newton_step_linear,
)
from fvsolve.kernels.restrictions import conductance, has_lifted_backflow
from fvsolve.kernels.table_handle import open_tables

MAX_SWEEPS = 100


@njit
def node_work(tables):
    """Work arrays for solving all clusters, as parts of `tables.scratch`.

    Four arrays float64[nodes]: derivative of the pipe flow into a node with respect to its pressure [kg/s per Pa];
    inflow c from all links except valves, with the initial flows of pipes [kg/s]; 1 if open valves join a node to a
    pipe or to a known pressure, else 0; group number of isolated nodes.
    Two arrays float64[valves]: conductance [kg2/s2/Pa]; flow [kg/s]. Last, the remaining scratch array.
    """
    n, v, work = tables.nodes.size, tables.valves.size, tables.scratch
    g, m, rest = work[4 * n : 4 * n + v], work[4 * n + v : 4 * n + 2 * v], work[4 * n + 2 * v :]
    rest = rest[5 * tables.clusters.size :]
    return work[:n], work[n : 2 * n], work[2 * n : 3 * n], work[3 * n : 4 * n], g, m, rest


@njit
def cluster_work(tables):
    """State of the Newton iteration of each cluster: five arrays float64[clusters].

    done : 1 if the cluster has converged
    change, last_change : greatest relative change in the last step, and in the step before
    wide : 1 while valves that a pressure lifts are held wide open
    sure : 1 if the last step points to the root; it may point away until the flows of valves have reversed
    """
    n, work = tables.clusters.size, tables.scratch[4 * tables.nodes.size + 2 * tables.valves.size :]
    return work[:n], work[n : 2 * n], work[2 * n : 3 * n], work[3 * n : 4 * n], work[4 * n : 5 * n]


@njit
def total_inflows(cluster, tables, out, c):
    """Write the inflow of each node of a cluster except through its valves, at unchanged pressure, to c [kg/s].

    The demand of a node is subtracted. Returns True if these inflows have not changed since the start.
    """
    layout, nodes, valves = tables.layout[0], tables.nodes, tables.valves
    integers, unchanged = tables.integers, True
    for i in range(c.size):
        node = integers[cluster["first_node"] + i]
        unchanged = unchanged and out[layout["net"] + node] == 0.0
        c[i] = out[layout["supply"] + node]  # exact where only valves and columns join
        if nodes[node]["admittance"] > 0.0:
            c[i] = out[layout["net"] + node]
    for k in range(tables.columns.size):
        column = tables.columns[k]
        i, j = row_in_cluster(cluster, tables, column["from_node"]), row_in_cluster(cluster, tables, column["to_node"])
        if i >= 0 and nodes[column["from_node"]]["admittance"] == 0.0:
            c[i] -= out[layout["column"] + k]
        if j >= 0 and nodes[column["to_node"]]["admittance"] == 0.0:
            c[j] += out[layout["column"] + k]
    for e in range(cluster["valves"]):
        valve = valves[integers[cluster["first_valve"] + e]]
        i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
        if i >= 0 and nodes[valve["from_node"]]["admittance"] > 0.0:
            c[i] += valve["flow"]
        if j >= 0 and nodes[valve["to_node"]]["admittance"] > 0.0:
            c[j] -= valve["flow"]
    return unchanged


@njit
def row_in_cluster(cluster, tables, i):
    """Number of node i within a cluster, -1 if it does not belong to it."""
    row = inner_row(tables.nodes, i)
    if row < 0 or row >= cluster["nodes"] or tables.integers[cluster["first_node"] + row] != i:
        return -1
    return row


@njit
def prepare_cluster(cluster, tables, out, g, m):
    """Write conductances g and start flows m of the valves of a cluster; reset its pressures.

    Returns True if all conductances, pump speeds and pressures at the valves are those of the initial steady state.
    """
    layout, valves = tables.layout[0], tables.valves
    integers, unchanged = tables.integers, True
    for i in range(cluster["nodes"]):
        out[layout["pressure"] + integers[cluster["first_node"] + i]] = 0.0
    for e in range(g.size):
        k = integers[cluster["first_valve"] + e]
        valve = valves[k]
        g[e], m[e] = conductance(tables, out, k), valve["flow"]
        if valve["hooks"] < 0 and 0.0 < g[e] < valve["open"]:
            m[e] *= sqrt(g[e] / valve["open"])  # flow at the drop of the profile: its own flow needs a huge drop
        unchanged = unchanged and g[e] == valve["open"] and out[layout["drive"] + k] == valve["drive"]
        for i in (valve["from_node"], valve["to_node"]):
            unchanged = unchanged and out[layout["pressure"] + i] == 0.0
    for k in range(cluster["couples"]):
        pipe = tables.pipes[tables.delays[integers[cluster["first_couple"] + k]]["pipe"]]
        for i in (pipe["from_node"], pipe["to_node"]):
            unchanged = unchanged and out[layout["pressure"] + i] == 0.0
    return unchanged


@njit
def has_backflow(cluster, tables, m):
    """True if a lifted valve of a cluster, opened by its upstream pressure, has a negative flow."""
    for e in range(m.size):
        if has_lifted_backflow(tables, tables.integers[cluster["first_valve"] + e], m[e]):
            return True
    return False


@njit
def zero_isolated(cluster, tables, g, m, connected):
    """Set the flow m of valves at isolated nodes to zero, and their conductance g to -1 if they are open, else 0.

    connected : 0 for the isolated nodes of the cluster
    """
    for e in range(g.size):
        if not is_connected(cluster, tables, e, connected):
            m[e] = 0.0
            g[e] = -1.0 if g[e] > 0.0 else 0.0


@njit
def is_connected(cluster, tables, e, connected):
    """True if valve e of a cluster lies between connected nodes or known pressures."""
    valve = tables.valves[tables.integers[cluster["first_valve"] + e]]
    i, j = inner_row(tables.nodes, valve["from_node"]), inner_row(tables.nodes, valve["to_node"])
    return (i < 0 or connected[i] > 0.0) and (j < 0 or connected[j] > 0.0)


@njit
def begin_clusters(out, tables, space):
    """Set flows and conductances of the valves of all clusters before the first Newton step.

    A cluster counts as converged if all its values are those of the initial steady state; `step_clusters` checks the
    flows from pipe ends later.
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
def is_undisturbed(cluster, tables, out):
    """True if pipes bring exactly their initial steady flow into every node of a cluster."""
    for i in range(cluster["nodes"]):
        node = tables.integers[cluster["first_node"] + i]
        if out[tables.layout[0]["net"] + node] != 0.0:
            return False
    return True


@njit
def step_clusters(sweep, out, tables, space):
    """Make a Newton step in every cluster that is disturbed and has not converged.

    sweep : number of the step, from 1
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
            step, near = newton_step_barotropic(
                cluster, tables, out, g[b:j], m[b:j], c[a:i], connected[a:i], slope, wide[k] == 1.0, rest
            )
            change[k] = max(0.0, step)  # 0 for NaN: the iteration ends, the rates show the fault
            sure[k] = 1.0 if near else 0.0
        a, b = i, j


@njit
def check_clusters(out, tables, space):
    """Mark clusters as converged, each by its own last change.

    Returns True if any cluster has not converged.
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
def write_cluster(cluster, tables, out, g, m, c, connected, group, change):
    """Write the valve flows of a cluster, the pressures of its isolated nodes, and STATUS if Newton has failed.

    g, m : conductances and flows [kg/s] of valves; c : inflow of nodes except through valves, less the demand [kg/s]
    connected, group : 0 for isolated nodes; work array for their groups
    change : last relative change of Newton
    Flows that are rounding (dead ends) become zero: their sign does not depend on the pressures.
    """
    scale = 1e-300
    for e in range(m.size):
        k = tables.integers[cluster["first_valve"] + e]
        if abs(m[e]) <= ROUNDING * sqrt(tables.valves[k]["conductance"]):  # of its flow at 1 Pa
            m[e] = 0.0
        out[tables.layout[0]["valve"] + k] = m[e]
        scale = max(scale, abs(tables.valves[k]["flow"]), sqrt(tables.valves[k]["conductance"]))
    if change > FAILED_CHANGE:
        out[STATUS], out[WHERE] = NOT_CONVERGED, tables.integers[cluster["first_node"]]
    for i in range(connected.size):
        if connected[i] == 0.0:
            isolated_pressures(cluster, tables, out, g, connected, group)
            check_demand(cluster, tables, out, c, connected, group, scale)
            return


@njit
def write_clusters(out, tables, space):
    """Write the valve flows of all clusters to `out`, and pressures of isolated nodes."""
    clusters, (_, c, connected, group, g, m, _), change = tables.clusters, space, cluster_work(tables)[1]
    a, b = 0, 0
    for k in range(clusters.size):
        i, j = a + clusters[k]["nodes"], b + clusters[k]["valves"]
        write_cluster(clusters[k], tables, out, g[b:j], m[b:j], c[a:i], connected[a:i], group[a:i], change[k])
        a, b = i, j


@njit
def solve_cluster(out, tables, index):
    """Solve the pressures of cluster number `index` and the flows of its valves under the density law `linear`.

    The iteration starts from the initial steady state, so the result depends on (t, y) alone.
    """
    cluster, work = tables.clusters[index], tables.scratch
    n, k = cluster["nodes"], cluster["valves"]
    c, connected, group, at = work[:n], work[n : 2 * n], work[2 * n : 3 * n], 3 * n
    g, m, rest = work[at : at + k], work[at + k : at + 2 * k], work[at + 2 * k :]
    unchanged = prepare_cluster(cluster, tables, out, g, m)
    undisturbed = total_inflows(cluster, tables, out, c) and unchanged
    find_connected(cluster, tables, g, connected)
    zero_isolated(cluster, tables, g, m, connected)
    change, wide = 1e300, True
    for _ in range(MAX_SWEEPS):
        if undisturbed:
            change = 0.0
            break
        last_change = change
        slope = c  # not used under this law
        change = newton_step_linear(cluster, tables, out, g, m, c, connected, slope, wide, rest)[0]
        if has_converged(change, last_change):
            if not (wide and has_backflow(cluster, tables, m)):
                break
            change, wide = 1e300, False
    write_cluster(cluster, tables, out, g, m, c, connected, group, change)


@njit
def solve_clusters(t, y, dydt, out, handle):
    """Solve the pressures of clusters and their valve flows under the density law `linear`.

    Clusters with a stored inverse matrix are left to `delay_lines.line_rates`.
    """
    tables = open_tables(handle)
    for k in range(tables.clusters.size):
        if tables.clusters[k]["inverse"] < 0:
            solve_cluster(out, tables, k)
