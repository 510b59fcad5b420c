"""Nodes under the linear density law: pressures and flows from the waves that arrive.

With the outgoing wave w at a pipe end and node deviation p' the pipe brings 2 w - Y p' [kg/s] into the node,
Y = area / speed. At a node without storage these flows and those of its other links add up to zero.
"""

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import ALONE, CHAMBER, CLUSTER, FIXED, JUNCTION, TANK
from fvsolve.kernels.restrictions import conductance
from fvsolve.kernels.schedule_pieces import schedule_value
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.tank_levels import tank_level
from fvsolve.kernels.valves import (
    flow_at_drop,
    flow_change,
    flow_change_laminar,
    transition_of,
)


@njit(forceinline=True)
def stored_pressures(t, y, out, tables):
    """Write the pressure deviations [Pa] of fixed nodes, tanks and chambers."""
    settings, layout, nodes = tables.settings[0], tables.layout[0], tables.nodes
    for i in range(nodes.size):
        node = nodes[i]
        at = layout["pressure"] + i
        if node["kind"] == FIXED:
            out[at] = schedule_value(tables, node["schedule"], t) - node["pressure"]
        elif node["kind"] == TANK:
            level = tank_level(node, tables.floats, settings["rho"], y[node["y"]])
            out[at] = settings["rho"] * settings["gravity"] * (level - node["level"])
        elif node["kind"] == CHAMBER:
            out[at] = node["stiffness"] * y[node["y"]]


@njit(forceinline=True)
def junction_flows(t, out, tables):
    """Change of flow into each node without storage at p' = 0, minus its demand, in out[net]."""
    layout, nodes = tables.layout[0], tables.nodes
    for i in range(nodes.size):
        if nodes[i]["kind"] == JUNCTION:
            demand = schedule_value(tables, nodes[i]["schedule"], t)
            out[layout["supply"] + i] = -demand
            out[layout["net"] + i] += nodes[i]["inflow"] - (demand - nodes[i]["demand"])


@njit
def known_pressures_linear(t, y, dydt, out, handle):
    """Write pressure deviations of nodes with storage or given pressure, and flows from outside into other nodes."""
    tables = open_tables(handle)
    stored_pressures(t, y, out, tables)
    junction_flows(t, out, tables)


@njit(forceinline=True)
def solve_free_nodes(out, tables):
    """Pressures of nodes without valves: p' = (sum of inflows) / Y."""
    layout, nodes = tables.layout[0], tables.nodes
    for i in range(nodes.size):
        if nodes[i]["kind"] == JUNCTION and nodes[i]["solve"] == ALONE:
            out[layout["pressure"] + i] = out[layout["net"] + i] / nodes[i]["admittance"]


@njit(forceinline=True)
def valve_side(out, layout, nodes, i):
    """Pressure deviation of a node at unchanged valve flow, and its fall per unit of outflow."""
    if nodes[i]["kind"] != JUNCTION:
        return out[layout["pressure"] + i], 0.0
    return out[layout["net"] + i] / nodes[i]["admittance"], 1.0 / nodes[i]["admittance"]


@njit(forceinline=True)
def solve_single_valves(out, tables):
    """Solve valves that join at most a node without storage at each end, and no other valve: closed roots."""
    layout, nodes, valves = tables.layout[0], tables.nodes, tables.valves
    for k in range(valves.size):
        valve = valves[k]
        if valve["solve"] == CLUSTER:
            continue
        i, j = valve["from_node"], valve["to_node"]
        pi, zi = valve_side(out, layout, nodes, i)
        pj, zj = valve_side(out, layout, nodes, j)
        g = conductance(tables, out, k)
        if valve["transition"] > 0.0:
            base = flow_at_drop(valve["open"], transition_of(valve, valve["open"]), valve["drop"]) - valve["flow"]
            x = flow_change_laminar(g, transition_of(valve, g), zi + zj, valve["flow"], base, valve["drop"] + (pi - pj))
        else:
            surplus = (g - valve["open"]) * valve["drop"] + g * (pi - pj)
            x = flow_change(g, zi + zj, valve["flow"], surplus, g * (valve["drop"] + (pi - pj)))
        out[layout["valve"] + k] = valve["flow"] + x
        if nodes[i]["kind"] == JUNCTION:
            out[layout["pressure"] + i] = pi - zi * x
        if nodes[j]["kind"] == JUNCTION:
            out[layout["pressure"] + j] = pj + zj * x


@njit
def solve_nodes_linear(t, y, dydt, out, handle):
    """Pressures of nodes without storage and flows of valves, except clusters, where several valves join."""
    tables = open_tables(handle)
    solve_free_nodes(out, tables)
    solve_single_valves(out, tables)
