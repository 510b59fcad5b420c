"""Pressures of isolated rigid columns: groups of columns that only closed valves join to the rest of the network.

No flow passes there, so any pressure would satisfy the momentum of the columns. The pressure chosen is that of isolated
nodes (`isolated_nodes`), at which equal small leaks would balance: the sum of sign(dP) sqrt|dP| over the closed valves
of a group is zero, with the drop dP of a valve. It depends on the network alone, not on the order of its parts.

Arguments common to these functions: levels : float64[nodes]  pressure change of each node of a group since the start
[Pa], NaN at other nodes; barotropic : False under the density law `linear`, True under the others
"""

from math import nan, sqrt

from fvsolve.core.kernels import column_junctions as junctions
from fvsolve.core.kernels.density import enthalpy, pressure_of_enthalpy
from fvsolve.core.kernels.isolated_nodes import JOINED, UNDETERMINED
from fvsolve.jit import njit

SWEEPS = 200  # most sweeps over groups that lie behind each other's closed valves
PRESSURE_TOLERANCE = 1e-14  # relative change of a pressure at which the sweeps end
BISECTIONS = 100  # more than the digits of a number


@njit
def pressure_across(tables, out, k, end, p, barotropic):
    """Pressure change at an end of column k at rest [Pa]; p : pressure change at its opposite end [Pa].

    end : 1 for the pressure at the `to` end, -1 for that at the `from` end
    """
    column, nodes, settings = tables.columns[k], tables.nodes, tables.settings[0]
    if not barotropic:
        # At rest there is no friction: the pressure loss of the profile is added back.
        inertia = column["length"] / column["area"]
        return p + end * (junctions.driving_offset(tables, out, column) + column["drag"] * inertia)
    near, far = column["to_node"], column["from_node"]
    if end < 0:
        near, far = far, near
    rise = settings["gravity"] * (nodes[near]["elevation"] - nodes[far]["elevation"])
    rise -= end * junctions.forcing_of(tables, out, column)
    h = enthalpy(settings, tables.floats, nodes[far]["pressure"] + p) - rise
    return pressure_of_enthalpy(settings, tables.floats, h) - nodes[near]["pressure"]


@njit
def find_group(tables, out, i, level, levels, barotropic):
    """Write the pressure changes of the group of node i at rest to `levels`; return True if the group is isolated.

    level : pressure change of node i [Pa]
    """
    columns = tables.columns
    levels[:] = nan
    levels[i], changed = level, True
    while changed:
        changed = False
        for k in range(columns.size):
            a, b = columns[k]["from_node"], columns[k]["to_node"]
            # A column with both ends known, or both unknown, leads to no new node.
            if (levels[a] == levels[a]) == (levels[b] == levels[b]):
                continue
            end = 1 if levels[a] == levels[a] else -1
            other, known = (b, a) if end == 1 else (a, b)
            if not junctions.is_shut(tables, out, other):
                return False
            levels[other] = pressure_across(tables, out, k, end, levels[known], barotropic)
            changed = True
    return True


@njit
def leaks_into_group(tables, out, levels):
    """(sum of sqrt|dP| of the leaks into a group, least, greatest drop dP from outside into the group [Pa]).

    Outflow counts as negative in the sum.
    """
    valves = tables.valves
    total, low, high = 0.0, 1e300, -1e300
    for i in range(levels.size):
        # NaN differs from itself: this node is outside the group.
        if levels[i] != levels[i]:
            continue
        for e in range(tables.nodes[i]["gate_count"]):
            index = tables.integers[tables.nodes[i]["gates"] + e]
            valve = valves[index]
            other = valve["to_node"] if valve["from_node"] == i else valve["from_node"]
            # A valve within the group lets nothing into it.
            if levels[other] == levels[other]:
                continue
            drop = junctions.zero_flow_pressure(tables, out, i, index, True) - levels[i]
            low, high = min(low, drop), max(high, drop)
            total += sqrt(drop) if drop > 0.0 else -sqrt(-drop)
    return total, low, high


@njit
def settle_group(tables, out, i, levels, barotropic):
    """Write the pressure changes of the isolated group of node i to out[pressure]; return the greatest change [Pa]."""
    at = tables.layout[0]["pressure"]
    _, low, high = leaks_into_group(tables, out, levels)
    # Without a closed valve to another node nothing determines this pressure.
    if low > high:
        return 0.0
    low, high = levels[i] + low, levels[i] + high
    # The sum falls with the level, with infinite slopes: bisection finds its root, Newton might not.
    for _ in range(BISECTIONS):
        level = 0.5 * (low + high)
        if level <= low or level >= high:
            break
        find_group(tables, out, i, level, levels, barotropic)
        if leaks_into_group(tables, out, levels)[0] > 0.0:
            low = level
        else:
            high = level
    find_group(tables, out, i, 0.5 * (low + high), levels, barotropic)
    change = 0.0
    for j in range(levels.size):
        if levels[j] == levels[j]:
            change = max(change, abs(out[at + j] - levels[j]))
            out[at + j] = levels[j]
    return change


@njit
def settle_isolated_columns(tables, out, barotropic):
    """Write pressures and codes of the nodes of all isolated groups of columns to `out`, see `isolated_nodes`."""
    layout, nodes = tables.layout[0], tables.nodes
    levels = tables.scratch[: nodes.size]
    isolated = 0
    for i in range(nodes.size):
        if nodes[i]["gates"] < 0:
            continue
        # The code of an earlier evaluation holds no longer.
        if out[layout["isolated"] + i] == UNDETERMINED:
            out[layout["isolated"] + i] = JOINED
        if junctions.is_shut(tables, out, i) and find_group(
            tables, out, i, 0.0, levels, barotropic
        ):
            out[layout["isolated"] + i] = UNDETERMINED
            # The sweeps start here, so that their result depends on (t, y) alone.
            out[layout["pressure"] + i] = 0.0
            isolated += 1
    if isolated == 0:
        return
    # Groups may lie behind each other's closed valves, so each depends on the pressure of the next.
    for _ in range(SWEEPS):
        greatest = 0.0
        for i in range(nodes.size):
            if not junctions.is_shut(tables, out, i):
                continue
            own = out[layout["pressure"] + i]
            if find_group(tables, out, i, own, levels, barotropic) and is_first(levels, i):
                change = settle_group(tables, out, i, levels, barotropic)
                greatest = max(greatest, change / (1e5 + abs(own)))
        if greatest <= PRESSURE_TOLERANCE:
            return


@njit
def is_first(levels, i):
    """True if node i has the least number of its group."""
    for j in range(i):
        if levels[j] == levels[j]:
            return False
    return True
