"""Rigid columns: one flow each, led by valves (`led`) or by one another (`rigid`). Solves no other node."""

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.led import lead_columns, led_end, led_flow, led_rate, lone_lead
from fvsolve.kernels.records import CLOSING, RATE
from fvsolve.kernels.restrictions import restriction_slope
from fvsolve.kernels.rigid import (
    add_pushes,
    body_drive,
    column_drag,
    gate_area,
    join_given,
    meet,
    number_rigid,
    rigid_space,
    settle_rigid,
)


@njit
def column_inflows(t, y, dydt, out, handle):
    """Add what rigid columns carry more than in the profile to out[net]; their flows go to out[column]."""
    tables = open_tables(handle)
    layout, columns = tables.layout[0], tables.columns
    lead_columns(tables, out)
    for k in range(columns.size):
        column, end = columns[k], led_end(tables, out, k)
        change = y[column["y"]]
        if end != 0:
            change = end * led_flow(t, y, tables, out, k, end, False)[0] - column["flow"]
        out[layout["column"] + k] = column["flow"] + change
        out[layout["net"] + column["from_node"]] -= change
        out[layout["net"] + column["to_node"]] += change
    meet(tables, out)


@njit
def add_led(t, y, tables, out, n):
    """given <- d/dt of what led columns bring into each of n rigid nodes [kg/s2]."""
    rows, _, _, _, _, given = rigid_space(tables, n)
    given[:] = 0.0
    for k in range(tables.columns.size):
        end = led_end(tables, out, k)
        if end != 0:
            i = tables.columns[k]["from_node"] if end == 1 else tables.columns[k]["to_node"]
            if rows[i] >= 0.0:
                given[int(rows[i])] -= led_flow(t, y, tables, out, k, end, True)[1]


@njit
def hold_rigid(t, y, tables, out):
    """Give rigid nodes the pressures at which what flows into each keeps adding up to zero."""
    n = number_rigid(tables, out)
    if n == 0:
        return
    add_led(t, y, tables, out, n)
    join_given(tables, out, n)
    rows, _, _, right, _, _ = rigid_space(tables, n)
    add_pushes(y, tables, out, n, -1, True)
    settle_rigid(tables, out, n)
    for i in range(rows.size):
        if rows[i] >= 0.0:
            out[tables.layout[0]["pressure"] + i] = right[int(rows[i])]


@njit
def hold_columns(t, y, dydt, out, handle):
    """Give rigid nodes their pressures, and the led end of a column that at which it does as its valves have it.

    One that stands has that of its far end and the weight between; a flow over next to no area would say nothing of it.
    """
    tables = open_tables(handle)
    pressure = tables.layout[0]["pressure"]
    hold_rigid(t, y, tables, out)
    for k in range(tables.columns.size):
        end = led_end(tables, out, k)
        if end != 0:
            x = tables.columns[k]["to_node"] if end == 1 else tables.columns[k]["from_node"]
            out[pressure + x] = led_flow(t, y, tables, out, k, end, True)[2]


@njit
def column_rates(t, y, dydt, out, handle):
    """d/dt of the flow in rigid columns under the linear law."""
    tables = open_tables(handle)
    columns, pressure = tables.columns, tables.layout[0]["pressure"]
    for k in range(columns.size if dydt.size > 0 else 0):
        column = columns[k]
        change = out[pressure + column["from_node"]] - out[pressure + column["to_node"]]
        change += tables.settings[0]["rho"] * body_drive(tables, out, column)
        dydt[column["y"]] = column_rate(t, y, tables, out, k, change)


@njit
def column_rate(t, y, tables, out, k, change):
    """d/dt of one column's flow, (A / L) (change of what drives it) - drag'; one that stands or is led, by its valves.

    Where one leads it from its seat, the pressure beside that tells.
    """
    column, end = tables.columns[k], led_end(tables, out, k)
    x = column["to_node"] if end == 1 else column["from_node"]
    if end != 0 and (lone_lead(tables, x) < 0 or gate_area(tables, out, x)[0] == 0.0):
        return end * led_rate(t, y, tables, out, k, end)
    pull = column_drag(column, out[tables.layout[0]["column"] + k])
    return column["area"] / column["length"] * (change + column["offset"]) - (pull - column["drag"])


@njit
def quickest_column(t, y, dydt, out, handle):
    """Greatest rate [1/s] at which valves alone brake a column, (A / L) dp / dM, into out[RATE].

    Discs, which come after, say in out[CLOSING] how they close on one.
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
                which = tables.integers[nodes[i]["gates"] + e]
                drop = valves[which]["drop"] + out[layout["pressure"] + valves[which]["from_node"]]
                drop -= out[layout["pressure"] + valves[which]["to_node"]]
                slope += restriction_slope(tables, out, which, drop)
            if slope > 0.0 and led_end(tables, out, k) == 0:
                out[RATE] = max(out[RATE], column["area"] / column["length"] / slope)
