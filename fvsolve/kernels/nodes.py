"""Nodes under the linear density law: from the waves that arrive to pressures and flows. Knows no cells.

A pipe end offers its outgoing wave w; with node deviation p' it carries 2 w - Y p' [kg/s] into the node,
Y = area / speed. A node without storage makes these and the flows of its other links add up to zero.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.columns import column_inflows, hold_columns
from fvsolve.kernels.records import (
    ALONE,
    CHAMBER,
    CLUSTER,
    FIXED,
    I_CLUSTERS,
    I_FLOATS,
    I_INTEGERS,
    I_LAYOUT,
    I_NODES,
    I_SCRATCH,
    I_SETTINGS,
    I_VALVES,
    JUNCTION,
    NO_SOLUTION,
    NOT_CONVERGED,
    STATUS,
    TANK,
    WHERE,
)
from fvsolve.kernels.schedules import schedule_value
from fvsolve.kernels.tanks import tank_level
from fvsolve.kernels.valves import (
    flow_at_drop,
    flow_change,
    flow_change_laminar,
    valve_conductance,
)

LEAST = 1e-4  # chords are no steeper than at a drop of LEAST squared [Pa], the rounding of pressures
BAR = 1e5
UNSETTLED = 1e-5  # change of flow, relative, at which Newton has failed and has not only met rounding
MOST = 1e14  # a pressure drop that only a flow nobody can bring would need [Pa]


@njit(forceinline=True)
def stored_pressures(t, y, out, tables):
    """Deviations [Pa] of given pressures, tanks and chambers."""
    settings, layout, nodes = tables[I_SETTINGS][0], tables[I_LAYOUT][0], tables[I_NODES]
    for i in range(nodes.size):
        node = nodes[i]
        at = layout["pressure"] + i
        if node["kind"] == FIXED:
            out[at] = schedule_value(tables, node["schedule"], t) - node["pressure"]
        elif node["kind"] == TANK:
            level = tank_level(node, tables[I_FLOATS], settings["rho"], y[node["y"]])
            out[at] = settings["rho"] * settings["gravity"] * (level - node["level"])
        elif node["kind"] == CHAMBER:
            out[at] = node["stiffness"] * y[node["y"]]


@njit(forceinline=True)
def junction_flows(t, y, out, tables):
    """Change of flow into each node without storage at p' = 0, less its demand; kept in out[net]."""
    layout, nodes = tables[I_LAYOUT][0], tables[I_NODES]
    for i in range(nodes.size):
        if nodes[i]["kind"] == JUNCTION:
            demand = schedule_value(tables, nodes[i]["schedule"], t)
            out[layout["supply"] + i] = -demand
            out[layout["net"] + i] += nodes[i]["inflow"] - (demand - nodes[i]["demand"])
    column_inflows(t, y, out, tables)


@njit(forceinline=True)
def close_alone(out, tables):
    """Nodes that no valve touches: p' = (sum of what arrives) / Y."""
    layout, nodes = tables[I_LAYOUT][0], tables[I_NODES]
    for i in range(nodes.size):
        if nodes[i]["kind"] == JUNCTION and nodes[i]["solve"] == ALONE:
            out[layout["pressure"] + i] = out[layout["net"] + i] / nodes[i]["admittance"]


@njit(forceinline=True)
def side_of(out, layout, nodes, i):
    """Pressure deviation of a node at no change of valve flow, and how much a unit of outflow lowers it."""
    if nodes[i]["kind"] != JUNCTION:
        return out[layout["pressure"] + i], 0.0
    return out[layout["net"] + i] / nodes[i]["admittance"], 1.0 / nodes[i]["admittance"]


@njit(forceinline=True)
def close_single(t, out, tables):
    """Valves with at most one node without storage at each end, that no other valve touches: closed roots."""
    layout, nodes, valves = tables[I_LAYOUT][0], tables[I_NODES], tables[I_VALVES]
    for k in range(valves.size):
        valve = valves[k]
        if valve["solve"] == CLUSTER:
            continue
        i, j = valve["from_node"], valve["to_node"]
        pi, zi = side_of(out, layout, nodes, i)
        pj, zj = side_of(out, layout, nodes, j)
        g = valve_conductance(tables, k, t)
        if valve["transition"] > 0.0:
            base = flow_at_drop(valve["open"], valve["transition"], valve["drop"]) - valve["flow"]
            x = flow_change_laminar(g, valve["transition"], zi + zj, valve["flow"], base, valve["drop"] + (pi - pj))
        else:
            surplus = (g - valve["open"]) * valve["drop"] + g * (pi - pj)
            x = flow_change(g, zi + zj, valve["flow"], surplus, g * (valve["drop"] + (pi - pj)))
        out[layout["valve"] + k] = valve["flow"] + x
        if nodes[i]["kind"] == JUNCTION:
            out[layout["pressure"] + i] = pi - zi * x
        if nodes[j]["kind"] == JUNCTION:
            out[layout["pressure"] + j] = pj + zj * x


@njit
def solve_dense(a, b, n):
    """b <- a^-1 b by elimination with partial pivoting; False where a is singular. Overwrites both.

    a : float64[n * n]  row by row
    """
    for i in range(n):
        pivot, row = i, n * i
        for k in range(i + 1, n):
            if abs(a[n * k + i]) > abs(a[n * pivot + i]):
                pivot = k
        if a[n * pivot + i] == 0.0:
            return False
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
    return True


@njit(forceinline=True)
def chord_slope(g, transition, target, flow):
    """Slope of the chord of M |M| = G dp between two flows, at most that of the laminar part at zero."""
    steepest = 45.0 / 32.0 * g / transition
    return min(steepest, g / max(abs(target) + abs(flow), 1e-300))


@njit(forceinline=True)
def valve_step(valve, g, x, change):
    """a, s with dx = a + s d(p_i' - p_j') for the next Newton step of one valve in a cluster.

    g : conductance now; x : change of flow; change : p_i' - p_j' [Pa]. The chord of the square root stands
    for its slope: between the flow now and the flow the drop asks for, it is finite and never too steep.
    """
    flow, opened = valve["flow"], valve["open"]
    if valve["transition"] > 0.0:
        drop = valve["drop"] + change
        base = flow_at_drop(opened, valve["transition"], valve["drop"])
        target = flow_at_drop(g, valve["transition"], drop)
        return target - base - x, chord_slope(g, valve["transition"], target, flow + x)
    if opened <= 0.0 and valve["leak"] == g:
        opened = g
        flow = flow_at_drop(g, 0.0, valve["drop"])
    total = g * (valve["drop"] + change)
    if abs(x) > 0.5 * abs(flow):  # far from the profile its own numbers would only bring their rounding
        rest = total - abs(flow + x) * (flow + x)
    else:
        rest = ((g - opened) * valve["drop"] + g * change) - (abs(flow + x) * (flow + x) - abs(flow) * flow)
    chord = abs(flow + x) + sqrt(abs(total))
    chord = max(chord, LEAST * sqrt(g))
    return rest / chord, g / chord


@njit(forceinline=True)
def asked_at(nodes, valve):
    """The end of a shut valve that cannot be served: the one that nothing else holds."""
    i, j = valve["from_node"], valve["to_node"]
    return i if nodes[i]["kind"] == JUNCTION and nodes[i]["admittance"] == 0.0 else j


@njit(forceinline=True)
def settled(moved, before, scale):
    """Whether Newton's last change of flow is rounding: below 1e-14, or small and no longer falling."""
    return moved <= 1e-14 * scale or (moved <= 1e-9 * scale and moved >= 0.5 * before)


@njit(forceinline=True)
def inner_row(nodes, i):
    """Row of a node in its cluster, -1 where its pressure is known."""
    return nodes[i]["row"] if nodes[i]["kind"] == JUNCTION else -1


@njit
def assemble(cluster, tables, out, g, x, p, a, s, matrix, right):
    """Linear system for the change of the cluster's pressures, with the valves' changes put in."""
    layout, nodes, valves = tables[I_LAYOUT][0], tables[I_NODES], tables[I_VALVES]
    integers, n = tables[I_INTEGERS], p.size
    for i in range(matrix.size):
        matrix[i] = 0.0
    for i in range(n):
        node = integers[cluster["first_node"] + i]
        right[i] = out[layout["net"] + node] - nodes[node]["admittance"] * p[i]
        matrix[n * i + i] = nodes[node]["admittance"]
    for e in range(x.size):
        valve = valves[integers[cluster["first_valve"] + e]]
        i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
        a[e], s[e] = -x[e] - valve["flow"], 0.0
        if g[e] > 0.0:
            pi = p[i] if i >= 0 else out[layout["pressure"] + valve["from_node"]]
            pj = p[j] if j >= 0 else out[layout["pressure"] + valve["to_node"]]
            a[e], s[e] = valve_step(valve, g[e], x[e], pi - pj)
        if i >= 0:
            right[i] -= x[e] + a[e]
            matrix[n * i + i] += s[e]
        if j >= 0:
            right[j] += x[e] + a[e]
            matrix[n * j + j] += s[e]
        if i >= 0 and j >= 0:
            matrix[n * i + j] -= s[e]
            matrix[n * j + i] -= s[e]


@njit
def close_cluster(t, out, tables, which):
    """Nodes without storage that several valves join, by Newton on pressures and flows together.

    Valve k: |M + x| (M + x) = |M| M + (G - G0) dp0 + G (p_i' - p_j'); node i: net_i - Y_i p_i' = outgoing x
    (the gradient method of Todini and Pilati 1988). It starts from no change, so the rhs stays pure.
    """
    layout, nodes, valves = tables[I_LAYOUT][0], tables[I_NODES], tables[I_VALVES]
    integers, cluster = tables[I_INTEGERS], tables[I_CLUSTERS][which]
    n, m, work = cluster["nodes"], cluster["valves"], tables[I_SCRATCH]
    at = n * n + 2 * n
    matrix, right, p = work[: n * n], work[n * n : n * n + n], work[n * n + n : at]
    g, x = work[at : at + m], work[at + m : at + 2 * m]
    a, s = work[at + 2 * m : at + 3 * m], work[at + 3 * m : at + 4 * m]
    scale = 1e-300
    for e in range(m):
        k, x[e] = integers[cluster["first_valve"] + e], 0.0
        g[e] = max(valve_conductance(tables, k, t), valves[k]["leak"])
        scale = max(scale, abs(valves[k]["flow"]), sqrt(g[e]))
    for i in range(n):
        p[i] = 0.0
        node = integers[cluster["first_node"] + i]
        scale = max(scale, abs(out[layout["net"] + node]), BAR * nodes[node]["admittance"])
    moved = 1e300
    for _ in range(100):
        assemble(cluster, tables, out, g, x, p, a, s, matrix, right)
        if not solve_dense(matrix, right, n):
            out[STATUS], out[WHERE] = NO_SOLUTION, integers[cluster["first_node"]]
            return
        before, moved = moved, 0.0
        for i in range(n):
            p[i] += right[i]
        for e in range(m):
            valve = valves[integers[cluster["first_valve"] + e]]
            i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
            step = a[e] + s[e] * ((right[i] if i >= 0 else 0.0) - (right[j] if j >= 0 else 0.0))
            x[e] += step
            scale = max(scale, abs(x[e]))
            moved = max(moved, abs(step), abs(a[e]))
        if settled(moved, before, scale):
            break
    if moved > UNSETTLED * scale:
        out[STATUS], out[WHERE] = NOT_CONVERGED, integers[cluster["first_node"]]
    for i in range(n):
        out[layout["pressure"] + integers[cluster["first_node"] + i]] = p[i]
    for e in range(m):
        k = integers[cluster["first_valve"] + e]
        if g[e] == valves[k]["leak"]:
            if (valves[k]["flow"] + x[e]) ** 2 > MOST * valves[k]["leak"]:
                out[STATUS], out[WHERE] = NO_SOLUTION, asked_at(nodes, valves[k])
            x[e] = -valves[k]["flow"]
        out[layout["valve"] + k] = valves[k]["flow"] + x[e]


@njit(forceinline=True)
def close_nodes(t, y, out, tables):
    """Pressure deviation of every node and flow of every valve, from out[net] and the stored masses."""
    stored_pressures(t, y, out, tables)
    junction_flows(t, y, out, tables)
    close_alone(out, tables)
    close_single(t, out, tables)
    for which in range(tables[I_CLUSTERS].size):
        close_cluster(t, out, tables, which)
    hold_columns(t, out, tables)
