"""Nodes that only shut valves reach: what holds them, and the pressure they take. Knows one cluster of nodes.

Nothing flows there, so any pressure would do; it is that at which equal small leaks would balance,
sum of sqrt|dP| over the shut valves, each with the sign of its drop. P = p + rho g z.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.records import JUNCTION, NO_SOLUTION, STATUS, WHERE

ASKED = 1e-9  # flow, relative, that a node which nothing can serve may ask for: rounding


@njit(forceinline=True)
def inner_row(nodes, i):
    """Row of a node in its cluster, -1 where its pressure is known."""
    return nodes[i]["row"] if nodes[i]["kind"] == JUNCTION else -1


@njit
def find_held(cluster, tables, g, held):
    """held[i] = 1 where open valves lead from node i of a cluster to a pipe or to a known pressure, else 0."""
    nodes, valves, integers = tables.nodes, tables.valves, tables.integers
    for i in range(held.size):
        held[i] = 1.0 if nodes[integers[cluster["first_node"] + i]]["admittance"] > 0.0 else 0.0
    for _ in range(held.size):
        changed = False
        for e in range(g.size):
            if g[e] > 0.0:
                valve = valves[integers[cluster["first_valve"] + e]]
                i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
                one = i < 0 or held[i] > 0.0
                two = j < 0 or held[j] > 0.0
                if one != two:
                    held[j if one else i] = 1.0
                    changed = True
        if not changed:
            return


@njit
def potential(tables, out, i):
    """P = p + rho g z of a node [Pa]."""
    node, settings = tables.nodes[i], tables.settings[0]
    lift = settings["rho"] * settings["gravity"] * node["elevation"]
    return node["pressure"] + out[tables.layout[0]["pressure"] + i] + lift


@njit
def leak_balance(cluster, tables, out, g, group, which, level):
    """(sum of sqrt|dP| into a group of nodes at potential `level`, least and greatest potential around it)."""
    nodes, valves, integers = tables.nodes, tables.valves, tables.integers
    total, low, high = 0.0, 1e300, -1e300
    for e in range(g.size):
        valve = valves[integers[cluster["first_valve"] + e]]
        i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
        one = i >= 0 and group[i] == which
        two = j >= 0 and group[j] == which
        if g[e] == 0.0 and one != two:
            other = potential(tables, out, valve["to_node"] if one else valve["from_node"])
            low, high = min(low, other), max(high, other)
            root = sqrt(abs(other - level))
            total += root if other > level else -root
    return total, low, high


@njit
def group_open(cluster, tables, g, group):
    """Number the nodes that open valves join alike."""
    nodes, valves, integers = tables.nodes, tables.valves, tables.integers
    for i in range(group.size):
        group[i] = i
    for _ in range(group.size):
        for e in range(g.size):
            valve = valves[integers[cluster["first_valve"] + e]]
            i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
            if g[e] < 0.0 and i >= 0 and j >= 0:  # open, but out of reach
                group[i] = group[j] = min(group[i], group[j])


@njit
def float_shut(cluster, tables, out, g, held, group):
    """Pressures of the nodes of a cluster that are not held, by bisection, group by group until none moves."""
    layout, integers = tables.layout[0], tables.integers
    group_open(cluster, tables, g, group)
    for _ in range(200):
        moved = 0.0
        for which in range(group.size):
            if held[which] > 0.0 or group[which] != which:
                continue
            _, low, high = leak_balance(cluster, tables, out, g, group, which, 0.0)
            if low > high:
                continue
            for _ in range(100):
                level = 0.5 * (low + high)
                if level <= low or level >= high:
                    break
                if leak_balance(cluster, tables, out, g, group, which, level)[0] > 0.0:
                    low = level
                else:
                    high = level
            for i in range(group.size):
                if group[i] == which:
                    node = integers[cluster["first_node"] + i]
                    change = 0.5 * (low + high) - potential(tables, out, node)
                    out[layout["pressure"] + node] += change
                    moved = max(moved, abs(change) / (1e5 + abs(low)))
        if moved <= 1e-14:
            return


@njit
def check_unserved(cluster, tables, out, c, held, group, scale):
    """Status where a group that nothing can serve asks for flow, c [kg/s] into its nodes."""
    for which in range(group.size):
        total = 0.0
        for i in range(group.size):
            if group[i] == which:
                total += c[i]
        if held[which] == 0.0 and group[which] == which and abs(total) > ASKED * scale:
            out[STATUS], out[WHERE] = NO_SOLUTION, tables.integers[cluster["first_node"] + which]
