"""Rigid columns under the laws log and table. Knows columns and the valves at their ends; solves no node."""

from fvsolve.jit import njit
from fvsolve.kernels.barotropic_nodes import drive
from fvsolve.kernels.columns import column_rate, gate_area, led_by_disc, led_end, lone_disc
from fvsolve.kernels.density import enthalpy, pressure_of_enthalpy
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import I_COLUMNS, I_FLOATS, I_LAYOUT, I_NODES, I_SETTINGS, I_VALVES
from fvsolve.kernels.restrictions import head_drop


@njit
def hold_columns_barotropic(t, y, dydt, out, handle):
    """Give the node at the shut end of a standing column the enthalpy of its other end, less the height."""
    tables = open_tables(handle)
    st, nodes, floats = tables[I_SETTINGS][0], tables[I_NODES], tables[I_FLOATS]
    pressure = tables[I_LAYOUT][0]["pressure"]
    for k in range(tables[I_COLUMNS].size):
        column, end = tables[I_COLUMNS][k], led_end(tables, out, k)
        x = column["to_node"] if end == 1 else column["from_node"]
        if end != 0 and (gate_area(tables, out, x)[0] == 0.0 or lone_disc(tables, x) >= 0):
            i, j = column["from_node"], column["to_node"]
            if end == -1:
                i, j = j, i
            rise = st["gravity"] * (nodes[j]["elevation"] - nodes[i]["elevation"])
            h = enthalpy(st, floats, nodes[i]["pressure"] + out[pressure + i])
            out[pressure + j] = pressure_of_enthalpy(st, floats, h - rise) - nodes[j]["pressure"]
            if lone_disc(tables, x) >= 0:
                drive_with_disc(y, tables, out, k, x, lone_disc(tables, x))


@njit
def drive_with_disc(y, tables, out, k, x, which):
    """Take off the standing pressure of node x what moves column k and the disc that leads it."""
    valve, pressure = tables[I_VALVES][which], tables[I_LAYOUT][0]["pressure"]
    still, ahead = head_drop(tables, out, which)[1], valve["from_node"] == x
    other = out[pressure + (valve["to_node"] if ahead else valve["from_node"])]
    drop = led_by_disc(y, tables, out, k, which, out[pressure + x], other, still)[0]
    out[pressure + x] += drop - still if ahead else still - drop


@njit
def column_rates_barotropic(t, y, dydt, out, handle):
    """d/dt of the flow in rigid columns: (A / L) (change of what drives them) - drag'."""
    tables = open_tables(handle)
    st, layout, nodes, columns = (
        tables[I_SETTINGS][0],
        tables[I_LAYOUT][0],
        tables[I_NODES],
        tables[I_COLUMNS],
    )
    for k in range(columns.size):
        column = columns[k]
        i, j = column["from_node"], column["to_node"]
        p_i = nodes[i]["pressure"] + out[layout["pressure"] + i]
        p_j = nodes[j]["pressure"] + out[layout["pressure"] + j]
        now = drive(st, tables[I_FLOATS], p_i, nodes[i]["elevation"], p_j, nodes[j]["elevation"])[0]
        dydt[column["y"]] = column_rate(t, y, tables, out, k, now - column["base"])
