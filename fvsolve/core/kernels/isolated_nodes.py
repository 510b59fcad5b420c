"""Detection and pressure of isolated nodes, which only closed or outward valves join to the rest of the network.

No flow passes there, so any pressure would satisfy the balance. The pressure chosen is that at which equal small leaks
would balance: sum of sqrt|dP| over the closed valves, each with the sign of its drop dP, is zero. P = p + rho g z.
A demand there is not supplied: it becomes zero, and its nodes drain to ambient pressure at the lowest demand. If a node
beyond a closed valve has a lower potential, they drain to `OPENING` below it, so that a self-acting valve from there
opens. An inflow drives them above the nodes beyond the closed valves; if no valve opens, it finds no way out.
Outward valves only let fluid out (leaks, demands that depend on pressure), so they supply nothing. Nodes without an
inflow drain through open outward valves to the lowest potential at which the flow of one begins.

Arguments common to these functions: `cluster`, row of a cluster (nodes that are solved together); g : conductances of
its valves [kg2/s2/Pa], 0 if closed, -1 if open at isolated nodes; connected : 0 for its isolated nodes; group : group
number of each of its nodes.
"""

from math import sqrt

from fvsolve.core.kernels.dtypes import (
    BOTH_WAYS,
    JUNCTION,
    LAW_LINEAR,
    NO_SOLUTION,
    OUTWARD_DEMAND,
    STATUS,
    WHERE,
)
from fvsolve.jit import njit

DEMAND_ROUNDING = 1e-9  # relative demand that an isolated node may have: rounding
# potential below a neighbour at which self-acting valves open, above their margins [Pa]
OPENING = 100.0
# potential of an inflow without a way out above the nodes beyond closed valves: check valves open [Pa]
RISE = 1e6
# Codes of nodes in `out`: joined to a pipe or to a known pressure; isolated without demand, so that nothing determines
# the pressure; isolated beside nodes with demand or inflow; isolated with a demand, which is not supplied.
JOINED, UNDETERMINED, DRAINED, UNSUPPLIED = 0.0, 1.0, 2.0, 3.0
# in place of a potential: no node lies beyond the closed valves, and no outward valve is open [Pa]
NO_LEVEL = 1e299
# in place of `connected`: fluid flows into a group, so outward valves join it to ambient
FED = -1.0


@njit(forceinline=True)
def marks_of_islands(tables):
    """Index of the marks of valves that shut off demands.

    Marks of nodes follow, three times: first and last time without supply, first time without a determined pressure.
    """
    return tables.marks.size - 3 * tables.nodes.size - tables.valves.size


@njit(forceinline=True)
def inner_row(nodes, i):
    """Number of node i within its cluster (nodes solved together), -1 if its pressure is known."""
    return nodes[i]["row"] if nodes[i]["kind"] == JUNCTION else -1


@njit
def root_of(group, i):
    """Number of the first node of the group of node i; each entry of `group` is a node nearer to it, or the node."""
    while group[i] != i:
        # Each search shortens the path, so that later searches take fewer steps.
        group[i] = group[int(group[i])]
        i = int(group[i])
    return i


@njit
def join(group, i, j):
    """Join the groups of the nodes i and j; a group has the number of its first node."""
    i, j = root_of(group, i), root_of(group, j)
    group[max(i, j)] = min(i, j)


@njit
def find_connected(cluster, tables, c, g, connected, group):
    """Set connected[i] to 1 if open valves join node i of a cluster to a pipe or to a known pressure, else to 0.

    An outward valve joins nodes to a known pressure only where fluid flows in: it cannot supply them.
    c : given inflow of the nodes [kg/s]; group : float64[nodes]  work array
    """
    nodes = tables.nodes
    valves = tables.valves
    integers = tables.integers
    for i in range(group.size):
        group[i] = i
    for e in range(g.size):
        if g[e] > 0.0:
            valve = valves[integers[cluster["first_valve"] + e]]
            i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
            if i >= 0 and j >= 0:
                join(group, i, j)
    # Groups are complete now: a single node with a pipe connects its whole group.
    for i in range(connected.size):
        connected[i] = 0.0
    for i in range(connected.size):
        if nodes[integers[cluster["first_node"] + i]]["admittance"] > 0.0:
            connected[root_of(group, i)] = 1.0
    outward = False
    for e in range(g.size):
        if g[e] > 0.0:
            valve = valves[integers[cluster["first_valve"] + e]]
            i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
            # A valve with exactly one end outside the cluster joins its group to a known pressure.
            if (i < 0) != (j < 0) and valve["one_way"] == BOTH_WAYS:
                connected[root_of(group, max(i, j))] = 1.0
            outward = outward or valve["one_way"] != BOTH_WAYS
    # Last, because outward valves only matter for groups that nothing else connects.
    if outward:
        connect_outward(cluster, tables, c, g, connected, group)
    for i in range(connected.size):
        connected[i] = connected[root_of(group, i)]


@njit
def connect_outward(cluster, tables, c, g, connected, group):
    """Set connected[i] to 1 for the first node i of each group from which a given inflow leaves by outward valves.

    The flow of a rigid column is such an inflow: it may change its sign. Arguments as for `find_connected`.
    """
    nodes = tables.nodes
    valves = tables.valves
    integers = tables.integers
    for i in range(connected.size):
        first = root_of(group, i)
        fed = c[i] > 0.0 or nodes[integers[cluster["first_node"] + i]]["gates"] >= 0
        if fed and connected[first] == 0.0:
            connected[first] = FED
    for e in range(g.size):
        valve = valves[integers[cluster["first_valve"] + e]]
        if g[e] > 0.0 and valve["one_way"] != BOTH_WAYS:
            i = inner_row(nodes, valve["from_node"])
            if i >= 0 and connected[root_of(group, i)] == FED:
                connected[root_of(group, i)] = 1.0
    for i in range(connected.size):
        # A group that is fed, but has no open outward valve, remains isolated.
        connected[i] = 1.0 if connected[i] == 1.0 else 0.0


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
    nodes = tables.nodes
    valves = tables.valves
    integers = tables.integers
    total, low, high = 0.0, 1e300, -1e300
    for k in range(leaks.size):
        valve = valves[integers[cluster["first_valve"] + int(leaks[k])]]
        i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
        from_inside = i >= 0 and group[i] == number
        to_inside = j >= 0 and group[j] == number
        # A valve within the group, or between two other groups, lets nothing into this group.
        if from_inside != to_inside:
            other = total_pressure(
                tables, out, valve["to_node"] if from_inside else valve["from_node"]
            )
            low, high = min(low, other), max(high, other)
            leak = sqrt(abs(other - level))
            total += leak if other > level else -leak
    return total, low, high


@njit
def group_by_open_valves(cluster, tables, g, group):
    """Write the same number to group[i] for all isolated nodes i that open valves join to each other."""
    nodes = tables.nodes
    valves = tables.valves
    integers = tables.integers
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
    nodes = tables.nodes
    valves = tables.valves
    integers = tables.integers
    count = 0
    for e in range(g.size):
        if g[e] == 0.0:
            valve = valves[integers[cluster["first_valve"] + e]]
            i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
            if (i >= 0 and connected[i] == 0.0) or (j >= 0 and connected[j] == 0.0):
                work[count] = e
                count += 1
    return count


@njit
def isolated_pressures(cluster, tables, out, g, connected, group, work):
    """Set the pressures of isolated nodes of a cluster by bisection, group by group until no pressure changes.

    Groups with a flow are left as `drain` has set them.
    work : float64[valves]  work array
    """
    layout, integers = tables.layout[0], tables.integers
    leaks = work[: closed_at_isolated(cluster, tables, g, connected, work)]
    # Groups may lie behind each other's closed valves, so each depends on the pressure of the next.
    for _ in range(200):
        greatest = 0.0
        for number in range(group.size):
            at = layout["isolated"] + integers[cluster["first_node"] + number]
            if connected[number] > 0.0 or group[number] != number or out[at] > UNDETERMINED:
                continue
            _, low, high = leak_balance(cluster, tables, out, leaks, group, number, 0.0)
            # No closed valve leads to another node, so nothing determines this pressure.
            if low > high:
                continue
            # The balance falls with the level, with infinite slopes: bisection finds the root, Newton might not.
            for _ in range(100):
                level = 0.5 * (low + high)
                if level <= low or level >= high:
                    break
                if leak_balance(cluster, tables, out, leaks, group, number, level)[0] > 0.0:
                    low = level
                else:
                    high = level
            for i in range(group.size):
                if group[i] == number:
                    node = integers[cluster["first_node"] + i]
                    change = 0.5 * (low + high) - total_pressure(tables, out, node)
                    out[layout["pressure"] + node] += change
                    greatest = max(greatest, abs(change) / (1e5 + abs(low)))
        if greatest <= 1e-14:
            return


@njit
def mark_isolated(cluster, tables, out, g, c, connected, group, scale, work):
    """Write the codes of the nodes of a cluster to out[isolated], and drain groups of isolated nodes with a demand.

    STATUS becomes NO_SOLUTION for a group with another given flow, such as an inflow or that of a rigid column, and for
    one with a demand under density laws other than `linear`.
    c : given inflow of the nodes [kg/s]; scale : flow relative to which a demand counts as rounding [kg/s]
    work : float64[2 nodes + valves]  work array
    """
    layout = tables.layout[0]
    integers = tables.integers
    n = group.size
    totals, drawn = work[:n], work[n : 2 * n]  # flow of each group; 1 if demands alone draw it
    leaks = work[2 * n :][: closed_at_isolated(cluster, tables, g, connected, work[2 * n :])]
    for i in range(n):
        totals[i], drawn[i] = 0.0, 1.0 if tables.settings[0]["law"] == LAW_LINEAR else 0.0
    for i in range(n):
        node, number = integers[cluster["first_node"] + i], int(group[i])
        # a rigid column determines a pressure
        undetermined = connected[i] == 0.0 and tables.nodes[node]["gates"] < 0
        out[layout["isolated"] + node] = UNDETERMINED if undetermined else JOINED
        totals[number] += c[i]
        # Only a demand alone may be left unsupplied; any other flow has nowhere to come from or go to.
        if not (c[i] <= 0.0 and c[i] == out[layout["supply"] + node]):
            drawn[number] = 0.0
    for number in range(n):
        if connected[number] > 0.0 or group[number] != number:
            continue
        level = outlet_level(cluster, tables, out, g, group, number)
        given = abs(totals[number]) > DEMAND_ROUNDING * scale
        if given and drawn[number] == 0.0:
            low, high = potentials_beyond(cluster, tables, out, leaks, connected, group, number)
            level = low - OPENING if totals[number] < 0.0 else high + RISE
            out[STATUS], out[WHERE] = NO_SOLUTION, integers[cluster["first_node"] + number]
        elif given:
            low, _ = potentials_beyond(cluster, tables, out, leaks, connected, group, number)
            level = drain(cluster, tables, out, group, number, min(level, low - OPENING))
        for i in range(n):
            node = integers[cluster["first_node"] + i]
            if group[i] == number and abs(level) < NO_LEVEL:
                out[layout["pressure"] + node] += level - total_pressure(tables, out, node)
                # `drain` may have marked the node as UNSUPPLIED, the greater code.
                out[layout["isolated"] + node] = max(out[layout["isolated"] + node], DRAINED)


@njit
def outlet_level(cluster, tables, out, g, group, number):
    """Potential [Pa] to which the open outward valves of a group of isolated nodes drain it; NO_LEVEL without any.

    The codes of nodes with an outward demand become UNSUPPLIED.
    """
    valves = tables.valves
    integers = tables.integers
    level = NO_LEVEL
    for e in range(g.size):
        valve = valves[integers[cluster["first_valve"] + e]]
        if valve["one_way"] == BOTH_WAYS or g[e] >= 0.0:
            continue
        i = inner_row(tables.nodes, valve["from_node"])
        if i >= 0 and group[i] == number:
            level = min(level, total_pressure(tables, out, valve["to_node"]) + valve["begins"])
            if valve["one_way"] == OUTWARD_DEMAND:
                out[tables.layout[0]["isolated"] + valve["from_node"]] = UNSUPPLIED
    return level


@njit
def potentials_beyond(cluster, tables, out, leaks, connected, group, number):
    """(least, greatest potential [Pa]) of the connected nodes beyond the closed valves of a group of isolated nodes.

    leaks : as for `leak_balance`
    """
    valves = tables.valves
    integers = tables.integers
    low = 1e300
    high = -1e300
    for k in range(leaks.size):
        valve = valves[integers[cluster["first_valve"] + int(leaks[k])]]
        i = inner_row(tables.nodes, valve["from_node"])
        j = inner_row(tables.nodes, valve["to_node"])
        from_inside = i >= 0 and group[i] == number
        to_inside = j >= 0 and group[j] == number
        if from_inside != to_inside and (
            i < 0 or j < 0 or connected[j if from_inside else i] > 0.0
        ):
            other = total_pressure(
                tables, out, valve["to_node"] if from_inside else valve["from_node"]
            )
            low, high = min(low, other), max(high, other)
    return low, high


@njit
def drain(cluster, tables, out, group, number, level):
    """Set the demands of a group of isolated nodes to zero; return the potential of the drained group [Pa].

    level : greatest value of this potential [Pa]
    """
    layout = tables.layout[0]
    nodes = tables.nodes
    integers = tables.integers
    weight = tables.settings[0]["rho"] * tables.settings[0]["gravity"]
    for i in range(group.size):
        node = integers[cluster["first_node"] + i]
        if group[i] == number and out[layout["supply"] + node] < 0.0:
            # A gauge pressure of zero at the lowest demand: no flow leaves there any more.
            level = min(level, tables.settings[0]["ambient"] + weight * nodes[node]["elevation"])
            out[layout["supply"] + node], out[layout["isolated"] + node] = 0.0, UNSUPPLIED
    return level
