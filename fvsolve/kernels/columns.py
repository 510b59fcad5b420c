"""Rigid columns: one flow each, and what stops it. Knows columns and the valves at their ends; solves no node.

A column that leads to a node without storage is held by that node's valves alone. When the last of them shuts,
nothing can flow: the column stands, and the node has the pressure of its other end.
"""

from fvsolve.jit import njit
from fvsolve.kernels.friction import drag
from fvsolve.kernels.records import I_COLUMNS, I_INTEGERS, I_LAYOUT, I_NODES, I_VALVES
from fvsolve.kernels.valves import flow_slope, valve_conductance


@njit
def is_shut(t, tables, i):
    """Whether node i is the end of one column whose every valve is shut, and asks for nothing."""
    node = tables[I_NODES][i]
    if node["gates"] < 0:
        return False
    for e in range(node["gate_count"]):
        if valve_conductance(tables, tables[I_INTEGERS][node["gates"] + e], t) > 0.0:
            return False
    return True


@njit
def shut_end(t, tables, k):
    """1 or -1 where column k is shut at its `to` or `from` end, else 0."""
    column = tables[I_COLUMNS][k]
    if is_shut(t, tables, column["to_node"]):
        return 1
    return -1 if is_shut(t, tables, column["from_node"]) else 0


@njit
def column_inflows(t, y, out, tables):
    """Add what rigid columns carry more than in the profile to out[net]; their flows go to out[column]."""
    layout, columns = tables[I_LAYOUT][0], tables[I_COLUMNS]
    for k in range(columns.size):
        column = columns[k]
        change = -column["flow"] if shut_end(t, tables, k) != 0 else y[column["y"]]
        out[layout["column"] + k] = column["flow"] + change
        out[layout["net"] + column["from_node"]] -= change
        out[layout["net"] + column["to_node"]] += change


@njit
def hold_columns(t, out, tables):
    """Give the node at the shut end of a standing column the pressure that drives no flow through it."""
    columns, pressure = tables[I_COLUMNS], tables[I_LAYOUT][0]["pressure"]
    for k in range(columns.size):
        column, end = columns[k], shut_end(t, tables, k)
        lost = column["offset"] + column["drag"] * column["length"] / column["area"]
        if end == 1:
            out[pressure + column["to_node"]] = out[pressure + column["from_node"]] + lost
        elif end == -1:
            out[pressure + column["from_node"]] = out[pressure + column["to_node"]] - lost


@njit
def column_rates(t, dydt, out, tables):
    """d/dt of the flow in rigid columns: (A / L) (drop') - drag'; a standing one stands."""
    layout, columns, pressure = tables[I_LAYOUT][0], tables[I_COLUMNS], tables[I_LAYOUT][0]["pressure"]
    for k in range(columns.size):
        column = columns[k]
        dydt[column["y"]] = 0.0
        if shut_end(t, tables, k) == 0:
            change = out[pressure + column["from_node"]] - out[pressure + column["to_node"]] + column["offset"]
            pull = column_drag(column, out[layout["column"] + k])
            dydt[column["y"]] = column["area"] / column["length"] * change - (pull - column["drag"])


@njit
def column_drag(column, flow):
    """Friction of a column [kg/s2] at a flow [kg/s]."""
    kind, loss, rough = column["friction"], column["loss"], column["rough"]
    return drag(kind, loss, rough, column["roughness"], column["reynolds"], flow)


@njit
def quickest_column(t, out, tables):
    """Greatest rate [1/s] at which valves alone brake a column: (A / L) dp / dM."""
    layout, nodes, valves = tables[I_LAYOUT][0], tables[I_NODES], tables[I_VALVES]
    rate = 0.0
    for k in range(tables[I_COLUMNS].size):
        column = tables[I_COLUMNS][k]
        for side in range(2):
            i = column["to_node"] if side == 1 else column["from_node"]
            slope = 0.0
            for e in range(nodes[i]["gate_count"]):
                which = tables[I_INTEGERS][nodes[i]["gates"] + e]
                drop = valves[which]["drop"] + out[layout["pressure"] + valves[which]["from_node"]]
                drop -= out[layout["pressure"] + valves[which]["to_node"]]
                slope += flow_slope(valve_conductance(tables, which, t), valves[which]["transition"], drop)
            if slope > 0.0:
                rate = max(rate, column["area"] / column["length"] / slope)
    return rate
