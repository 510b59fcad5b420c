"""Rigid columns, each with a single flow, which valves (`column_valve_control`) or junctions may control.

The flows and pressures at junctions of columns are computed in `column_junctions`.
"""

from fvsolve.jit import njit
from fvsolve.kernels.column_junctions import (
    add_column_rates,
    assemble_with_given,
    balance_junction_flows,
    body_drive,
    column_drag,
    gate_area,
    junction_work,
    number_junctions,
    solve_junctions,
)
from fvsolve.kernels.column_valve_control import (
    control_end,
    controlled_flow,
    controlled_rate,
    find_controlled_columns,
    seating_valve,
)
from fvsolve.kernels.dtypes import CLOSING, RATE
from fvsolve.kernels.restrictions import restriction_slope
from fvsolve.kernels.table_handle import open_tables


@njit
def column_inflows(t, y, dydt, out, handle):
    """Write the flows of rigid columns [kg/s] to out[column]; add their changes since the start to out[net]."""
    tables = open_tables(handle)
    layout, columns = tables.layout[0], tables.columns
    find_controlled_columns(tables, out)
    for k in range(columns.size):
        column, end = columns[k], control_end(tables, out, k)
        change = y[column["y"]]
        if end != 0:
            change = end * controlled_flow(t, y, tables, out, k, end, False)[0] - column["flow"]
        out[layout["column"] + k] = column["flow"] + change
        out[layout["net"] + column["from_node"]] -= change
        out[layout["net"] + column["to_node"]] += change
    balance_junction_flows(tables, out)


@njit
def add_controlled_rates(t, y, tables, out, n):
    """Write d/dt of the flow that valve-controlled columns bring into each of n column junctions [kg/s2] to `given`.

    A column junction joins rigid columns and otherwise only closed valves.
    `given` is a work array, see `column_junctions.junction_work`.
    """
    rows, _, _, _, _, given = junction_work(tables, n)
    given[:] = 0.0
    for k in range(tables.columns.size):
        end = control_end(tables, out, k)
        if end != 0:
            i = tables.columns[k]["from_node"] if end == 1 else tables.columns[k]["to_node"]
            if rows[i] >= 0.0:
                given[int(rows[i])] -= controlled_flow(t, y, tables, out, k, end, True)[1]


@njit
def junction_pressures(t, y, tables, out):
    """Write the pressures of column junctions, at which the sum of flows into each stays zero, to `out`.

    A column junction joins rigid columns, and otherwise only closed valves.
    """
    n = number_junctions(tables, out)
    if n == 0:
        return
    add_controlled_rates(t, y, tables, out, n)
    assemble_with_given(tables, out, n)
    rows, _, _, right, _, _ = junction_work(tables, n)
    add_column_rates(y, tables, out, n, -1, True)
    solve_junctions(tables, out, n)
    for i in range(rows.size):
        if rows[i] >= 0.0:
            out[tables.layout[0]["pressure"] + i] = right[int(rows[i])]


@njit
def column_pressures(t, y, dydt, out, handle):
    """Write the pressures of column junctions, and of the column ends at which nearly closed valves control the flow.

    At the controlled end of a stationary column, the pressure is that of the far end plus the weight between them. A
    flow through a vanishing area would not determine it.
    """
    tables = open_tables(handle)
    pressure = tables.layout[0]["pressure"]
    junction_pressures(t, y, tables, out)
    for k in range(tables.columns.size):
        end = control_end(tables, out, k)
        if end != 0:
            controlled = tables.columns[k]["to_node"] if end == 1 else tables.columns[k]["from_node"]
            out[pressure + controlled] = controlled_flow(t, y, tables, out, k, end, True)[2]


@njit
def column_rates(t, y, dydt, out, handle):
    """Write d/dt of the flow in rigid columns [kg/s2] to `dydt`, under the density law `linear`."""
    tables = open_tables(handle)
    columns, pressure = tables.columns, tables.layout[0]["pressure"]
    for k in range(columns.size if dydt.size > 0 else 0):
        column = columns[k]
        change = out[pressure + column["from_node"]] - out[pressure + column["to_node"]]
        change += tables.settings[0]["rho"] * body_drive(tables, out, column)
        dydt[column["y"]] = column_rate(t, y, tables, out, k, change)


@njit
def column_rate(t, y, tables, out, k, change):
    """d/dt of the flow of column k [kg/s2]: (A / L) (change of driving pressure) - (drag - initial steady drag).

    A, L : area and length of the column
    change : change of the pressure difference and of the body force along it since the start [Pa]
    If valves control the column, the rate follows from them. For a valve near its seat the general formula holds,
    because the pressure of the node beside the valve already contains its effect.
    """
    column, end = tables.columns[k], control_end(tables, out, k)
    node = column["to_node"] if end == 1 else column["from_node"]
    if end != 0 and (seating_valve(tables, node) < 0 or gate_area(tables, out, node)[0] == 0.0):
        return end * controlled_rate(t, y, tables, out, k, end)
    friction = column_drag(column, out[tables.layout[0]["column"] + k])
    return column["area"] / column["length"] * (change + column["offset"]) - (friction - column["drag"])


@njit
def column_rate_limit(t, y, dydt, out, handle):
    """Raise out[RATE] to the greatest rate [1/s] at which valves alone brake a column, (A / L) dp / dM.

    A, L : area and length of the column; dp / dM : slope of the drop of its valves over their flow
    Columns that valves control are left out. Clears out[CLOSING]; discs, which are evaluated later, write there how
    fast they close on a column.
    """
    tables = open_tables(handle)
    out[CLOSING] = 0.0
    layout, nodes, valves = tables.layout[0], tables.nodes, tables.valves
    for k in range(tables.columns.size):
        column = tables.columns[k]
        for side in range(2):
            i = column["to_node"] if side == 1 else column["from_node"]
            slope = 0.0
            for e in range(nodes[i]["gate_count"]):
                valve = tables.integers[nodes[i]["gates"] + e]
                drop = valves[valve]["drop"] + out[layout["pressure"] + valves[valve]["from_node"]]
                drop -= out[layout["pressure"] + valves[valve]["to_node"]]
                slope += restriction_slope(tables, out, valve, drop)
            if slope > 0.0 and control_end(tables, out, k) == 0:
                out[RATE] = max(out[RATE], column["area"] / column["length"] / slope)
