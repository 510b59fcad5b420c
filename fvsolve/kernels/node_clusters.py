"""Clusters, nodes without storage that several valves join: Newton on pressures and flows, density law `linear`.

Valve from node i to node j: M |M| = G (dp0 + p_i' - p_j'), with flow M [kg/s], conductance G and initial drop dp0.
Node: c_i - Y_i p_i' = flow that leaves it through valves, with the other inflow c_i at p_i' = 0 and the admittance Y_i
of its pipes. p' is the pressure change since the initial steady state. Both are solved together (gradient method of
Todini and Pilati 1988). The unknown flows are total flows, not changes: where a valve is nearly closed, a change would
lose all but its rounding. A cluster in which nothing has changed is not solved.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import NO_SOLUTION, NOT_CONVERGED, STATUS, WHERE
from fvsolve.kernels.isolated_nodes import check_demand, find_connected, inner_row, isolated_pressures
from fvsolve.kernels.restrictions import conductance, has_lifted_backflow, restriction_lift, restriction_step
from fvsolve.kernels.table_handle import open_tables

BAR = 1e5
ROUNDING = 1e-15  # relative rounding of pressures; of a flow, relative to the flow at 1 Pa
FAILED_CHANGE = 1e-5  # relative change of flow above which Newton has failed; smaller changes may be rounding


@njit
def solve_dense(a, b, n):
    """Solve a x = b by elimination with partial pivoting; x replaces b. Returns the sign of det a, 0 if a is singular.

    a : float64[n * n]  matrix row by row, overwritten
    """
    sign = 1.0
    for i in range(n):
        pivot, row = i, n * i
        for k in range(i + 1, n):
            if abs(a[n * k + i]) > abs(a[n * pivot + i]):
                pivot = k
        if a[n * pivot + i] == 0.0:
            return 0.0
        if (pivot != i) != (a[n * pivot + i] < 0.0):
            sign = -sign
        if pivot != i:
            for k in range(n):
                a[row + k], a[n * pivot + k] = a[n * pivot + k], a[row + k]
            b[i], b[pivot] = b[pivot], b[i]
        for k in range(i + 1, n):
            f = a[n * k + i] / a[row + i]
            if f != 0.0:
                for m in range(i, n):
                    a[n * k + m] -= f * a[row + m]
                b[k] -= f * b[i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= a[n * i + k] * b[k]
        b[i] /= a[n * i + i]
    return sign


@njit(forceinline=True)
def has_converged(change, last_change):
    """True if the last relative change of Newton is rounding: below 1e-14, or below 1e-9 and no longer falling."""
    return change <= 1e-14 or (change <= 1e-9 and change >= 0.5 * last_change)


@njit
def total_inflows(cluster, tables, out, c):
    """Write the inflow of each node of a cluster except through its valves, at unchanged pressure, to c [kg/s].

    The demand of a node is subtracted. Returns True if these inflows have not changed since the start.
    cluster : nodes that are solved together
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
    """Number of node i within a cluster (nodes solved together), -1 if it does not belong to it."""
    row = inner_row(tables.nodes, i)
    if row < 0 or row >= cluster["nodes"] or tables.integers[cluster["first_node"] + row] != i:
        return -1
    return row


@njit
def add_valve(i, j, m, a, s, lift, n, matrix, right):
    """Add a valve from node i to node j to the linear equations for the pressure steps of n nodes.

    i, j : numbers in the cluster (nodes solved together), -1 for a known pressure
    m : flow [kg/s]
    a, s : terms of the change of this flow, dM = a + s d(drop) [kg/s, kg/s/Pa]
    lift : derivative of the flow with respect to the upstream pressure at constant drop [kg/s/Pa]
    matrix, right : float64[n * n], float64[n]  equations, to which the terms of the valve are added
    """
    if i >= 0:
        right[i] -= m + a
        matrix[n * i + i] += s + lift
    if j >= 0:
        right[j] += m + a
        matrix[n * j + j] += s
    if i >= 0 and j >= 0:
        matrix[n * i + j] -= s
        matrix[n * j + i] -= s + lift


@njit
def assemble(cluster, tables, out, g, m, c, connected, a, s, lift, matrix, right, wide):
    """Assemble the linear equations for the pressure steps of a cluster (nodes solved together).

    The changes of valve flows are eliminated. Arrays with an entry for each valve or each of n nodes:
    g, m : conductance [kg2/s2/Pa] and flow [kg/s] of valves
    c : inflow of nodes except through valves, less the demand [kg/s]; connected : 0 for isolated nodes
    a, s, lift : receive the terms of each change of flow, see `add_valve`
    matrix, right : float64[n * n], float64[n]  receive the equations
    wide : see `restrictions.restriction_step`
    """
    layout, nodes, valves = tables.layout[0], tables.nodes, tables.valves
    integers, n = tables.integers, c.size
    for i in range(matrix.size):
        matrix[i] = 0.0
    for i in range(n):
        node = integers[cluster["first_node"] + i]
        right[i] = c[i] - nodes[node]["admittance"] * out[layout["pressure"] + node]
        matrix[n * i + i] = nodes[node]["admittance"]
    for e in range(m.size):
        valve = valves[integers[cluster["first_valve"] + e]]
        i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
        a[e], s[e], lift[e] = -m[e], 0.0, 0.0
        if g[e] > 0.0:
            drop = out[layout["pressure"] + valve["from_node"]] - out[layout["pressure"] + valve["to_node"]]
            k = integers[cluster["first_valve"] + e]
            a[e], s[e] = restriction_step(tables, out, k, g[e], m[e], valve["drop"] + drop, 1.0, wide)
            lift[e] = restriction_lift(tables, out, k, g[e], valve["drop"] + drop, 1.0, wide)
        add_valve(i, j, m[e], a[e], s[e], lift[e], n, matrix, right)
    add_couplings(cluster, tables, out, n, matrix, right)
    for i in range(n):
        if connected[i] == 0.0:
            right[i], matrix[n * i + i] = 0.0, 1.0


@njit
def add_couplings(cluster, tables, out, n, matrix, right):
    """Add the instantaneous flow between the ends of short delay lines to the equations of a cluster of n nodes.

    cluster : nodes that are solved together; matrix, right : equations, as for `add_valve`
    """
    layout, nodes, integers = tables.layout[0], tables.nodes, tables.integers
    for k in range(cluster["couples"]):
        line = tables.delays[integers[cluster["first_couple"] + k]]
        pipe, g = tables.pipes[line["pipe"]], line["couple"]
        i, j = inner_row(nodes, pipe["from_node"]), inner_row(nodes, pipe["to_node"])
        p, q = out[layout["pressure"] + pipe["from_node"]], out[layout["pressure"] + pipe["to_node"]]
        add_valve(i, j, g * (p - q), 0.0, g, 0.0, n, matrix, right)


@njit
def apply_step(cluster, tables, out, m, a, s, lift, right):
    """Apply a Newton step to pressures and valve flows; return the greatest relative change of both.

    cluster : nodes that are solved together
    m : flows of valves [kg/s], updated; right : pressure steps of nodes [Pa]
    a, s, lift : terms of the changes of flow, see `add_valve`
    A change of flow by the rounding of pressures does not count. Flows are compared with at least the flow at 1 Pa.
    """
    layout, nodes, valves = tables.layout[0], tables.nodes, tables.valves
    integers, scale, rounded, change, most = tables.integers, 1e-300, 0.0, 0.0, 0.0
    for i in range(right.size):
        node = integers[cluster["first_node"] + i]
        out[layout["pressure"] + node] += right[i]
        most = max(most, abs(right[i]) / (BAR + abs(nodes[node]["pressure"] + out[layout["pressure"] + node])))
    for e in range(m.size):
        valve = valves[integers[cluster["first_valve"] + e]]
        i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
        rise = right[i] if i >= 0 else 0.0
        step = a[e] + s[e] * (rise - (right[j] if j >= 0 else 0.0)) + lift[e] * rise
        m[e] += step
        scale = max(scale, abs(m[e]), sqrt(valve["conductance"]))
        p = nodes[valve["from_node"]]["pressure"] + out[layout["pressure"] + valve["from_node"]]
        rounding = s[e] * ROUNDING * (BAR + abs(p))
        change, rounded = max(change, max(abs(step), abs(a[e])) - rounding), max(rounded, rounding)
    relative = change / scale
    if relative > FAILED_CHANGE and change <= rounded:  # perhaps rounding: no failure, but iterate further
        relative = FAILED_CHANGE
    return max(relative, most)


@njit
def prepare_cluster(cluster, tables, out, g, m):
    """Write conductances g and start flows m of the valves of a cluster (nodes solved together); reset its pressures.

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
            m[e] *= sqrt(
                g[e] / valve["open"]
            )  # flow at the drop of the profile; the flow of the profile would need a huge drop
        unchanged = unchanged and g[e] == valve["open"] and out[layout["drive"] + k] == valve["drive"]
        for i in (valve["from_node"], valve["to_node"]):
            unchanged = unchanged and out[layout["pressure"] + i] == 0.0
    for k in range(cluster["couples"]):
        pipe = tables.pipes[tables.delays[integers[cluster["first_couple"] + k]]["pipe"]]
        for i in (pipe["from_node"], pipe["to_node"]):
            unchanged = unchanged and out[layout["pressure"] + i] == 0.0
    return unchanged


@njit
def solve_cluster(out, tables, index):
    """Solve the pressures of cluster number `index` (nodes solved together) and the flows of its valves.

    The iteration starts from the initial steady state, so the result depends on (t, y) alone.
    """
    integers, cluster = tables.integers, tables.clusters[index]
    n, k, work = cluster["nodes"], cluster["valves"], tables.scratch
    at = n * n + 4 * n
    matrix, right, c = work[: n * n], work[n * n : n * n + n], work[n * n + n : n * n + 2 * n]
    connected, group = work[n * n + 2 * n : n * n + 3 * n], work[n * n + 3 * n : at]
    g, m = work[at : at + k], work[at + k : at + 2 * k]
    a, s, lift = work[at + 2 * k : at + 3 * k], work[at + 3 * k : at + 4 * k], work[at + 4 * k : at + 5 * k]
    unchanged = prepare_cluster(cluster, tables, out, g, m)
    undisturbed = total_inflows(cluster, tables, out, c) and unchanged
    find_connected(cluster, tables, g, connected)
    zero_isolated(cluster, tables, g, m, connected)
    change, wide = 1e300, True
    for _ in range(100):
        if undisturbed:
            change = 0.0
            break
        assemble(cluster, tables, out, g, m, c, connected, a, s, lift, matrix, right, wide)
        sign = solve_dense(matrix, right, n)
        if sign <= 0.0 and not wide and close_unstable(cluster, tables, g, m):
            continue
        if sign == 0.0:
            out[STATUS], out[WHERE] = NO_SOLUTION, integers[cluster["first_node"]]
            return
        last_change, change = change, apply_step(cluster, tables, out, m, a, s, lift, right)
        if has_converged(change, last_change):
            if not (wide and has_backflow(cluster, tables, m)):
                break
            change, wide = 1e300, False
    write_cluster(cluster, tables, out, g, m, c, connected, group, change)


@njit
def has_backflow(cluster, tables, m):
    """True if a lifted valve of a cluster, opened by its upstream pressure, has a negative flow.

    cluster : nodes that are solved together; m : flows of its valves [kg/s]
    """
    for e in range(m.size):
        if has_lifted_backflow(tables, tables.integers[cluster["first_valve"] + e], m[e]):
            return True
    return False


@njit
def close_unstable(cluster, tables, g, m):
    """Close lifted valves with negative flow, which cannot stay open (g = 0); returns True if there are such valves.

    g, m : conductances and flows of the valves of a cluster (nodes solved together)
    Newton, which starts from wide open valves, has reached a matrix with a negative determinant: at smaller lifts the
    imbalance would be even greater.
    """
    closed = False
    for e in range(m.size):
        if g[e] > 0.0 and has_lifted_backflow(tables, tables.integers[cluster["first_valve"] + e], m[e]):
            g[e], closed = 0.0, True
    return closed


@njit
def zero_isolated(cluster, tables, g, m, connected):
    """Set the flow m of valves at isolated nodes to zero, and their conductance g to -1 if they are open, else 0.

    connected : 0 for the isolated nodes of the cluster (nodes solved together)
    """
    for e in range(g.size):
        if not is_connected(cluster, tables, e, connected):
            m[e] = 0.0
            g[e] = -1.0 if g[e] > 0.0 else 0.0


@njit
def is_connected(cluster, tables, e, connected):
    """True if valve e of a cluster (nodes solved together) lies between connected nodes or known pressures."""
    valve = tables.valves[tables.integers[cluster["first_valve"] + e]]
    i, j = inner_row(tables.nodes, valve["from_node"]), inner_row(tables.nodes, valve["to_node"])
    return (i < 0 or connected[i] > 0.0) and (j < 0 or connected[j] > 0.0)


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
def solve_clusters(t, y, dydt, out, handle):
    """Solve the pressures of clusters (nodes without storage that several valves join) and their valve flows.

    Clusters with a stored inverse matrix are left to `delay_lines.line_rates`.
    """
    tables = open_tables(handle)
    for k in range(tables.clusters.size):
        if tables.clusters[k]["inverse"] < 0:
            solve_cluster(out, tables, k)
