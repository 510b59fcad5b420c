"""Detection and pressure of isolated nodes, which only closed valves join to the rest of the network.

No flow passes there, so any pressure would satisfy the balance. The pressure chosen is that at which equal small leaks
would balance: sum of sqrt|dP| over the closed valves, each with the sign of its drop dP, is zero. P = p + rho g z.
A demand draws the pressure below, and an inflow drives it above, those behind all closed valves, so that check valves
open; if none opens, the demand cannot be supplied.

Arguments common to these functions: `cluster`, row of a cluster (nodes that are solved together); g : conductances of
its valves [kg2/s2/Pa], 0 if closed, -1 if open at isolated nodes; connected : 0 for its isolated nodes; group : group
number of each of its nodes.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import JUNCTION, NO_SOLUTION, STATUS, WHERE

DEMAND_ROUNDING = 1e-9  # relative demand that an isolated node may have: rounding
DRAWN = 1e4  # pressure by which a demand lowers the pressure of isolated nodes below those behind closed valves [Pa]


@njit(forceinline=True)
def inner_row(nodes, i):
    """Number of node i within its cluster (nodes solved together), -1 if its pressure is known."""
    return nodes[i]["row"] if nodes[i]["kind"] == JUNCTION else -1


@njit
def root_of(group, i):
    """Number of the first node of the group of node i; each entry of `group` is a node nearer to it, or the node."""
    while group[i] != i:
        group[i] = group[int(group[i])]
        i = int(group[i])
    return i


@njit
def join(group, i, j):
    """Join the groups of the nodes i and j; a group has the number of its first node."""
    i, j = root_of(group, i), root_of(group, j)
    group[max(i, j)] = min(i, j)


@njit
def find_connected(cluster, tables, g, connected, group):
    """Set connected[i] to 1 if open valves join node i of a cluster to a pipe or to a known pressure, else to 0.

    group : float64[nodes]  work array
    """
    nodes, valves, integers = tables.nodes, tables.valves, tables.integers
    for i in range(group.size):
        group[i] = i
    for e in range(g.size):
        if g[e] > 0.0:
            valve = valves[integers[cluster["first_valve"] + e]]
            i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
            if i >= 0 and j >= 0:
                join(group, i, j)
    for i in range(connected.size):
        connected[i] = 0.0
    for i in range(connected.size):
        if nodes[integers[cluster["first_node"] + i]]["admittance"] > 0.0:
            connected[root_of(group, i)] = 1.0
    for e in range(g.size):
        if g[e] > 0.0:
            valve = valves[integers[cluster["first_valve"] + e]]
            i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
            if (i < 0) != (j < 0):
                connected[root_of(group, max(i, j))] = 1.0
    for i in range(connected.size):
        connected[i] = connected[root_of(group, i)]


@njit
def total_pressure(tables, out, i):
    """Potential P = p + rho g z of node i [Pa]."""
    node, settings = tables.nodes[i], tables.settings[0]
    lift = settings["rho"] * settings["gravity"] * node["elevation"]
    return node["pressure"] + out[tables.layout[0]["pressure"] + i] + lift


@njit
def leak_balance(cluster, tables, out, leaks, group, number, level):
    """(sum of sqrt|dP| of the leaks into a group of isolated nodes, least, greatest potential outside the group [Pa]).

    The group has the potential `level` [Pa]. dP is the drop of a closed valve between the group and another node;
    outflow counts as negative. The potentials are those of the nodes behind these valves.
    leaks : numbers in the cluster of closed valves, all those at isolated nodes
    """
    nodes, valves, integers = tables.nodes, tables.valves, tables.integers
    total, low, high = 0.0, 1e300, -1e300
    for k in range(leaks.size):
        valve = valves[integers[cluster["first_valve"] + int(leaks[k])]]
        i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
        from_inside = i >= 0 and group[i] == number
        to_inside = j >= 0 and group[j] == number
        if from_inside != to_inside:
            other = total_pressure(tables, out, valve["to_node"] if from_inside else valve["from_node"])
            low, high = min(low, other), max(high, other)
            leak = sqrt(abs(other - level))
            total += leak if other > level else -leak
    return total, low, high


@njit
def group_by_open_valves(cluster, tables, g, group):
    """Write the same number to group[i] for all isolated nodes i that open valves join to each other."""
    nodes, valves, integers = tables.nodes, tables.valves, tables.integers
    for i in range(group.size):
        group[i] = i
    for e in range(g.size):
        if g[e] < 0.0:  # open, but isolated
            valve = valves[integers[cluster["first_valve"] + e]]
            i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
            if i >= 0 and j >= 0:
                join(group, i, j)
    for i in range(group.size):
        group[i] = root_of(group, i)


@njit
def closed_at_isolated(cluster, tables, g, connected, work):
    """Write the numbers in the cluster of the closed valves at its isolated nodes to `work`; returns their count."""
    nodes, valves, integers, count = tables.nodes, tables.valves, tables.integers, 0
    for e in range(g.size):
        if g[e] == 0.0:
            valve = valves[integers[cluster["first_valve"] + e]]
            i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
            if (i >= 0 and connected[i] == 0.0) or (j >= 0 and connected[j] == 0.0):
                work[count] = e
                count += 1
    return count


@njit
def isolated_pressures(cluster, tables, out, g, connected, group, totals, scale, work):
    """Set the pressures of isolated nodes of a cluster by bisection, group by group until no pressure changes.

    group, totals : results of `isolated_inflows`; scale : as for `check_demand`; work : float64[valves]  work array
    """
    layout, integers, least = tables.layout[0], tables.integers, DEMAND_ROUNDING * scale
    leaks = work[: closed_at_isolated(cluster, tables, g, connected, work)]
    for _ in range(200):
        greatest = 0.0
        for number in range(group.size):
            if connected[number] > 0.0 or group[number] != number:
                continue
            _, low, high = leak_balance(cluster, tables, out, leaks, group, number, 0.0)
            if low > high:
                continue
            for _ in range(100):
                level = 0.5 * (low + high)
                if level <= low or level >= high:
                    break
                if leak_balance(cluster, tables, out, leaks, group, number, level)[0] > 0.0:
                    low = level
                else:
                    high = level
            if abs(totals[number]) > least:
                _, low, high = leak_balance(cluster, tables, out, leaks, group, number, 0.0)
                low = high = low - DRAWN if totals[number] < 0.0 else high + DRAWN
            for i in range(group.size):
                if group[i] == number:
                    node = integers[cluster["first_node"] + i]
                    change = 0.5 * (low + high) - total_pressure(tables, out, node)
                    out[layout["pressure"] + node] += change
                    greatest = max(greatest, abs(change) / (1e5 + abs(low)))
        if greatest <= 1e-14:
            return


@njit
def isolated_inflows(cluster, tables, g, c, group, totals):
    """Write the numbers of groups of isolated nodes to `group`, and their given inflows [kg/s] to totals[number].

    c : given inflow of the nodes [kg/s]
    """
    group_by_open_valves(cluster, tables, g, group)
    for i in range(group.size):
        totals[i] = 0.0
    for i in range(group.size):
        totals[int(group[i])] += c[i]


@njit
def check_demand(cluster, tables, out, connected, group, totals, scale):
    """Set STATUS to NO_SOLUTION if a group of isolated nodes has a demand.

    group, totals : results of `isolated_inflows`; scale : flow relative to which a demand counts as rounding [kg/s]
    """
    for number in range(group.size):
        isolated = connected[number] == 0.0 and group[number] == number
        if isolated and abs(totals[number]) > DEMAND_ROUNDING * scale:
            out[STATUS], out[WHERE] = NO_SOLUTION, tables.integers[cluster["first_node"] + number]
