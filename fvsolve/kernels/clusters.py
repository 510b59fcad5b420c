"""Nodes without storage that several valves join: Newton on pressures and flows together. Linear density law.

Valve: M |M| = G (dp0 + p_i' - p_j'); node: c_i - Y_i p_i' = flow that leaves it through valves (the gradient
method of Todini and Pilati 1988). Flows are whole, not deviations: far from the profile, where a valve all but
shuts, a deviation would keep nothing but its rounding. Where nothing has changed, nothing is solved.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.isolated import check_unserved, find_held, float_shut, inner_row
from fvsolve.kernels.records import NO_SOLUTION, NOT_CONVERGED, STATUS, WHERE
from fvsolve.kernels.restrictions import conductance, restriction_lift, restriction_step, runs_back

BAR = 1e5
ROUNDING = 1e-15  # of pressures, relative; and of a flow, of that at 1 Pa
UNSETTLED = 1e-5  # change of flow, relative, at which Newton has failed and has not only met rounding


@njit
def solve_dense(a, b, n):
    """b <- a^-1 b by elimination with partial pivoting; returns the sign of det a, 0 where singular. Overwrites both.

    a : float64[n * n]  row by row
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
def settled(moved, before):
    """Whether Newton's last relative change is rounding: below 1e-14, or small and no longer falling."""
    return moved <= 1e-14 or (moved <= 1e-9 and moved >= 0.5 * before)


@njit
def whole_inflows(cluster, tables, out, c):
    """c: flow into every node of a cluster from all but its valves at p' = 0; True where nothing has changed."""
    layout, nodes, valves = tables.layout[0], tables.nodes, tables.valves
    integers, quiet = tables.integers, True
    for i in range(c.size):
        node = integers[cluster["first_node"] + i]
        quiet = quiet and out[layout["net"] + node] == 0.0
        c[i] = out[layout["supply"] + node]  # exact where only valves and columns join
        if nodes[node]["admittance"] > 0.0:
            c[i] = out[layout["net"] + node]
    for k in range(tables.columns.size):
        column = tables.columns[k]
        i, j = inner_of(cluster, tables, column["from_node"]), inner_of(cluster, tables, column["to_node"])
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
    return quiet


@njit
def inner_of(cluster, tables, i):
    """Row of node i where it belongs to this cluster, else -1."""
    row = inner_row(tables.nodes, i)
    if row < 0 or row >= cluster["nodes"] or tables.integers[cluster["first_node"] + row] != i:
        return -1
    return row


@njit
def put_valve(i, j, m, a, s, lift, n, matrix, right):
    """Add a valve from row i to row j (-1: a known pressure) to the balances; lift: dM / dp_i beside the drop's."""
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
def assemble(cluster, tables, out, g, m, c, held, a, s, lift, matrix, right, wide):
    """Linear system for the change of the pressures, with the valves' changes put in."""
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
        put_valve(i, j, m[e], a[e], s[e], lift[e], n, matrix, right)
    put_couples(cluster, tables, out, n, matrix, right)
    for i in range(n):
        if held[i] == 0.0:
            right[i], matrix[n * i + i] = 0.0, 1.0


@njit
def put_couples(cluster, tables, out, n, matrix, right):
    """Add what flows between the ends of short delay lines at once."""
    layout, nodes, integers = tables.layout[0], tables.nodes, tables.integers
    for k in range(cluster["couples"]):
        line = tables.delays[integers[cluster["first_couple"] + k]]
        pipe, g = tables.pipes[line["pipe"]], line["couple"]
        i, j = inner_row(nodes, pipe["from_node"]), inner_row(nodes, pipe["to_node"])
        p, q = out[layout["pressure"] + pipe["from_node"]], out[layout["pressure"] + pipe["to_node"]]
        put_valve(i, j, g * (p - q), 0.0, g, 0.0, n, matrix, right)


@njit
def move(cluster, tables, out, m, a, s, lift, right):
    """Put a Newton step in; returns its greatest change, relative, of flows and of pressures together.

    What the rounding of pressures does to a flow is no change, and no flow counts as less than that at 1 Pa.
    """
    layout, nodes, valves = tables.layout[0], tables.nodes, tables.valves
    integers, scale, vague, moved, most = tables.integers, 1e-300, 0.0, 0.0, 0.0
    for i in range(right.size):
        node = integers[cluster["first_node"] + i]
        out[layout["pressure"] + node] += right[i]
        most = max(most, abs(right[i]) / (BAR + abs(nodes[node]["pressure"] + out[layout["pressure"] + node])))
    for e in range(m.size):
        valve = valves[integers[cluster["first_valve"] + e]]
        i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
        before = right[i] if i >= 0 else 0.0
        step = a[e] + s[e] * (before - (right[j] if j >= 0 else 0.0)) + lift[e] * before
        m[e] += step
        scale = max(scale, abs(m[e]), sqrt(valve["conductance"]))
        p = nodes[valve["from_node"]]["pressure"] + out[layout["pressure"] + valve["from_node"]]
        rounding = s[e] * ROUNDING * (BAR + abs(p))
        moved, vague = max(moved, max(abs(step), abs(a[e])) - rounding), max(vague, rounding)
    relative = moved / scale
    if relative > UNSETTLED and moved <= vague:  # it may be rounding, so no failure; but it goes on
        relative = UNSETTLED
    return max(relative, most)


@njit
def prepare(cluster, tables, out, g, m):
    """Conductances and first flows of a cluster's valves; True where none has changed and no pressure beside it."""
    layout, valves = tables.layout[0], tables.valves
    integers, quiet = tables.integers, True
    for i in range(cluster["nodes"]):
        out[layout["pressure"] + integers[cluster["first_node"] + i]] = 0.0
    for e in range(g.size):
        k = integers[cluster["first_valve"] + e]
        valve = valves[k]
        g[e], m[e] = conductance(tables, out, k), valve["flow"]
        if valve["hooks"] < 0 and 0.0 < g[e] < valve["open"]:
            m[e] *= sqrt(g[e] / valve["open"])  # at the profile's drop: all but shut, its flow would ask for any
        quiet = quiet and g[e] == valve["open"] and out[layout["drive"] + k] == valve["drive"]
        for i in (valve["from_node"], valve["to_node"]):
            quiet = quiet and out[layout["pressure"] + i] == 0.0
    for k in range(cluster["couples"]):
        pipe = tables.pipes[tables.delays[integers[cluster["first_couple"] + k]]["pipe"]]
        for i in (pipe["from_node"], pipe["to_node"]):
            quiet = quiet and out[layout["pressure"] + i] == 0.0
    return quiet


@njit
def close_cluster(out, tables, which):
    """Pressures of one cluster's nodes and flows of its valves; it starts from the profile, so the rhs stays pure."""
    integers, cluster = tables.integers, tables.clusters[which]
    n, k, work = cluster["nodes"], cluster["valves"], tables.scratch
    at = n * n + 4 * n
    matrix, right, c = work[: n * n], work[n * n : n * n + n], work[n * n + n : n * n + 2 * n]
    held, group = work[n * n + 2 * n : n * n + 3 * n], work[n * n + 3 * n : at]
    g, m = work[at : at + k], work[at + k : at + 2 * k]
    a, s, lift = work[at + 2 * k : at + 3 * k], work[at + 3 * k : at + 4 * k], work[at + 4 * k : at + 5 * k]
    unchanged = prepare(cluster, tables, out, g, m)
    quiet = whole_inflows(cluster, tables, out, c) and unchanged
    find_held(cluster, tables, g, held)
    shut_out(cluster, tables, g, m, held)
    moved, wide = 1e300, True
    for _ in range(100):
        if quiet:
            moved = 0.0
            break
        assemble(cluster, tables, out, g, m, c, held, a, s, lift, matrix, right, wide)
        side = solve_dense(matrix, right, n)
        if side <= 0.0 and not wide and let_fall(cluster, tables, g, m):
            continue
        if side == 0.0:
            out[STATUS], out[WHERE] = NO_SOLUTION, integers[cluster["first_node"]]
            return
        before, moved = moved, move(cluster, tables, out, m, a, s, lift, right)
        if settled(moved, before):
            if not (wide and any_back(cluster, tables, m)):
                break
            moved, wide = 1e300, False
    finish(cluster, tables, out, g, m, c, held, group, moved)


@njit
def any_back(cluster, tables, m):
    """Whether a valve of a cluster that the pressure before it lifts carries its flow backwards."""
    for e in range(m.size):
        if runs_back(tables, tables.integers[cluster["first_valve"] + e], m[e]):
            return True
    return False


@njit
def let_fall(cluster, tables, g, m):
    """Shut what would stay lifted by its own backward flow and cannot; whether there is any. Newton, coming down, has
    met a system that is no longer positive: lower lifts would lack even more."""
    some = False
    for e in range(m.size):
        if g[e] > 0.0 and runs_back(tables, tables.integers[cluster["first_valve"] + e], m[e]):
            g[e], some = 0.0, True
    return some


@njit
def shut_out(cluster, tables, g, m, held):
    """Nothing flows through valves that touch a node which is not held; open ones are marked by -1."""
    for e in range(g.size):
        if not is_held(cluster, tables, e, held):
            m[e] = 0.0
            g[e] = -1.0 if g[e] > 0.0 else 0.0


@njit
def is_held(cluster, tables, e, held):
    """Whether valve e of a cluster lies between held nodes or known pressures."""
    valve = tables.valves[tables.integers[cluster["first_valve"] + e]]
    i, j = inner_row(tables.nodes, valve["from_node"]), inner_row(tables.nodes, valve["to_node"])
    return (i < 0 or held[i] > 0.0) and (j < 0 or held[j] > 0.0)


@njit
def finish(cluster, tables, out, g, m, c, held, group, moved):
    """Write the flows; give nodes that only shut valves reach their pressures; status where it failed.

    What Newton's rounding leaves of a flow into a dead end is none: which way it points says nothing of the pressures.
    """
    scale = 1e-300
    for e in range(m.size):
        k = tables.integers[cluster["first_valve"] + e]
        if abs(m[e]) <= ROUNDING * sqrt(tables.valves[k]["conductance"]):  # of its flow at 1 Pa
            m[e] = 0.0
        out[tables.layout[0]["valve"] + k] = m[e]
        scale = max(scale, abs(tables.valves[k]["flow"]), sqrt(tables.valves[k]["conductance"]))
    if moved > UNSETTLED:
        out[STATUS], out[WHERE] = NOT_CONVERGED, tables.integers[cluster["first_node"]]
    for i in range(held.size):
        if held[i] == 0.0:
            float_shut(cluster, tables, out, g, held, group)
            check_unserved(cluster, tables, out, c, held, group, scale)
            return


@njit
def close_clusters(t, y, dydt, out, handle):
    """Pressures of the nodes of all clusters and flows of their valves."""
    tables = open_tables(handle)
    for which in range(tables.clusters.size):
        if tables.clusters[which]["inverse"] < 0:
            close_cluster(out, tables, which)
