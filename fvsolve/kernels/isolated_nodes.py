"""Detection and pressure of isolated nodes, which only closed valves join to the rest of the network.

No flow passes there, so any pressure would satisfy the balance. The pressure chosen is that at which equal small leaks
would balance: sum of sqrt|dP| over the closed valves, each with the sign of its drop dP, is zero. P = p + rho g z.
A demand there is not supplied: it becomes zero, and its nodes drain to ambient pressure at the lowest demand. If a node
beyond a closed valve has a lower potential, they drain to `OPENING` below it, so that a self-acting valve from there
opens.

Arguments common to these functions: `cluster`, row of a cluster (nodes that are solved together); g : conductances of
its valves [kg2/s2/Pa], 0 if closed, -1 if open at isolated nodes; connected : 0 for its isolated nodes; group : group
number of each of its nodes.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import JUNCTION, LAW_LINEAR, NO_SOLUTION, STATUS, WHERE

DEMAND_ROUNDING = 1e-9  # relative demand that an isolated node may have: rounding
OPENING = 100.0  # potential below a neighbour at which self-acting valves open, above their margins [Pa]
# Codes of nodes in `out`: joined to a pipe or to a known pressure; isolated without demand, so that nothing determines
# the pressure; isolated beside nodes with demand; isolated with a demand, which is not supplied.
JOINED, UNDETERMINED, DRAINED, UNSUPPLIED = 0.0, 1.0, 2.0, 3.0


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
def find_connected(cluster, tables, g, connected):
    """Set connected[i] to 1 if open valves join node i of a cluster to a pipe or to a known pressure, else to 0."""
    nodes, valves, integers = tables.nodes, tables.valves, tables.integers
    for i in range(connected.size):
        connected[i] = 1.0 if nodes[integers[cluster["first_node"] + i]]["admittance"] > 0.0 else 0.0
    for _ in range(connected.size):
        changed = False
        for e in range(g.size):
            if g[e] > 0.0:
                valve = valves[integers[cluster["first_valve"] + e]]
                i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
                from_connected = i < 0 or connected[i] > 0.0
                to_connected = j < 0 or connected[j] > 0.0
                if from_connected != to_connected:
                    connected[j if from_connected else i] = 1.0
                    changed = True
        if not changed:
            return


@njit
def total_pressure(tables, out, i):
    """Potential P = p + rho g z of node i [Pa]."""
    node, settings = tables.nodes[i], tables.settings[0]
    lift = settings["rho"] * settings["gravity"] * node["elevation"]
    return node["pressure"] + out[tables.layout[0]["pressure"] + i] + lift


@njit
def leak_balance(cluster, tables, out, g, group, number, level):
    """(sum of sqrt|dP| of the leaks into a group of isolated nodes, least, greatest potential outside the group [Pa]).

    The group has the potential `level` [Pa]. dP is the drop of a closed valve between the group and another node;
    outflow counts as negative. The potentials are those of the nodes behind these valves.
    """
    nodes, valves, integers = tables.nodes, tables.valves, tables.integers
    total, low, high = 0.0, 1e300, -1e300
    for e in range(g.size):
        valve = valves[integers[cluster["first_valve"] + e]]
        i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
        from_inside = i >= 0 and group[i] == number
        to_inside = j >= 0 and group[j] == number
        if g[e] == 0.0 and from_inside != to_inside:
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
    for _ in range(group.size):
        changed = False
        for e in range(g.size):
            if g[e] < 0.0:  # open, but isolated
                valve = valves[integers[cluster["first_valve"] + e]]
                i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
                if i >= 0 and j >= 0 and group[i] != group[j]:
                    group[i] = group[j] = min(group[i], group[j])
                    changed = True
        if not changed:
            return


@njit
def isolated_pressures(cluster, tables, out, g, connected, group):
    """Set the pressures of isolated nodes of a cluster by bisection, group by group until no pressure changes.

    Groups with a demand are left as `drain` has set them.
    """
    layout, integers = tables.layout[0], tables.integers
    for _ in range(200):
        greatest = 0.0
        for number in range(group.size):
            at = layout["isolated"] + integers[cluster["first_node"] + number]
            if connected[number] > 0.0 or group[number] != number or out[at] > UNDETERMINED:
                continue
            _, low, high = leak_balance(cluster, tables, out, g, group, number, 0.0)
            if low > high:
                continue
            for _ in range(100):
                level = 0.5 * (low + high)
                if level <= low or level >= high:
                    break
                if leak_balance(cluster, tables, out, g, group, number, level)[0] > 0.0:
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
def mark_isolated(cluster, tables, out, g, c, connected, group, scale):
    """Write the codes of the nodes of a cluster to out[isolated], and drain groups of isolated nodes with a demand.

    STATUS becomes NO_SOLUTION for a group with another given flow, such as an inflow or that of a rigid column, and for
    one with a demand under density laws other than `linear`.
    c : given inflow of the nodes [kg/s]; scale : flow relative to which a demand counts as rounding [kg/s]
    """
    layout, integers = tables.layout[0], tables.integers
    for i in range(group.size):
        out[layout["isolated"] + integers[cluster["first_node"] + i]] = UNDETERMINED if connected[i] == 0.0 else JOINED
    for number in range(group.size):
        if connected[number] > 0.0 or group[number] != number:
            continue
        total, drawn = 0.0, tables.settings[0]["law"] == LAW_LINEAR
        for i in range(group.size):
            if group[i] == number:
                total += c[i]
                drawn = drawn and c[i] <= 0.0 and c[i] == out[layout["supply"] + integers[cluster["first_node"] + i]]
        if abs(total) <= DEMAND_ROUNDING * scale:
            continue
        if drawn:
            drain(cluster, tables, out, g, connected, group, number)
        else:
            out[STATUS], out[WHERE] = NO_SOLUTION, integers[cluster["first_node"] + number]


@njit
def drain(cluster, tables, out, g, connected, group, number):
    """Set the demands of a group of isolated nodes to zero, and their pressures to those of the drained group."""
    layout, nodes, valves, integers = tables.layout[0], tables.nodes, tables.valves, tables.integers
    weight, level = tables.settings[0]["rho"] * tables.settings[0]["gravity"], 1e300
    for i in range(group.size):
        node = integers[cluster["first_node"] + i]
        if group[i] == number and out[layout["supply"] + node] < 0.0:
            level = min(level, tables.settings[0]["ambient"] + weight * nodes[node]["elevation"])
    for e in range(g.size):
        valve = valves[integers[cluster["first_valve"] + e]]
        i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
        from_inside = i >= 0 and group[i] == number
        to_inside = j >= 0 and group[j] == number
        if from_inside != to_inside and (i < 0 or j < 0 or connected[j if from_inside else i] > 0.0):
            other = valve["to_node"] if from_inside else valve["from_node"]
            level = min(level, total_pressure(tables, out, other) - OPENING)
    for i in range(group.size):
        if group[i] == number:
            node = integers[cluster["first_node"] + i]
            out[layout["pressure"] + node] += level - total_pressure(tables, out, node)
            out[layout["isolated"] + node] = UNSUPPLIED if out[layout["supply"] + node] < 0.0 else DRAINED
            if out[layout["supply"] + node] < 0.0:
                out[layout["supply"] + node] = 0.0
