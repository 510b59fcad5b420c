"""Rigid columns under the density laws `log` and `table`: driving pressures, node pressures and rates of flow."""

from fvsolve.jit import njit
from fvsolve.kernels.barotropic_nodes import driving_pressure, mean_density
from fvsolve.kernels.column_junctions import (
    assemble_with_given,
    body_drive,
    gate_area,
    junction_work,
    number_junctions,
    solve_junctions,
)
from fvsolve.kernels.column_valve_control import control_end, controlled_flow, seating_drop, seating_valve
from fvsolve.kernels.density import enthalpy, pressure_of_enthalpy
from fvsolve.kernels.dtypes import NOT_CONVERGED, STATUS
from fvsolve.kernels.node_clusters import has_converged
from fvsolve.kernels.restrictions import head_drop
from fvsolve.kernels.rigid_columns import add_controlled_rates, column_rate
from fvsolve.kernels.table_handle import open_tables


@njit
def driving_pressure_change(tables, out, k):
    """Change of the driving pressure of rigid column k since the initial steady state [Pa].

    The driving pressure contains the pressures at both ends, gravity and the motion of a body that carries the column.
    """
    st, nodes, column = tables.settings[0], tables.nodes, tables.columns[k]
    i, j, at = column["from_node"], column["to_node"], tables.layout[0]["pressure"]
    p_i, p_j = nodes[i]["pressure"] + out[at + i], nodes[j]["pressure"] + out[at + j]
    now = driving_pressure(st, tables.floats, p_i, nodes[i]["elevation"], p_j, nodes[j]["elevation"])[0]
    if column["moving_segment"] >= 0:
        now += mean_density(st, tables.floats, p_i, p_j) * body_drive(tables, out, column)
    return now - column["base"]


@njit
def add_column_rates_barotropic(t, y, tables, out, n):
    """Add d/dt of the flow of rigid columns into n column junctions [kg/s2] to the right-hand side of their equations.

    A column junction joins rigid columns and otherwise only closed valves. The right-hand side is `right` of
    `column_junctions.junction_work`. Columns whose flow valves control are left out. The entry of a junction with held
    pressure is set to zero.
    """
    rows, _, _, right, pinned, _ = junction_work(tables, n)
    for k in range(tables.columns.size):
        a, b = int(rows[tables.columns[k]["from_node"]]), int(rows[tables.columns[k]["to_node"]])
        if control_end(tables, out, k) == 0 and (a >= 0 or b >= 0):
            rate = column_rate(t, y, tables, out, k, driving_pressure_change(tables, out, k))
            if a >= 0:
                right[a] -= rate
            if b >= 0:
                right[b] += rate
    for r in range(n):
        right[r] *= 1.0 - pinned[r]


@njit
def junction_pressures_barotropic(t, y, tables, out):
    """Solve the pressures of column junctions, which join rigid columns and otherwise only closed valves.

    The equations are iterated with the matrix of the density law `linear`, because driving pressures are nearly linear
    in the end pressures. Writes pressure changes since the start [Pa] to `out`, or sets STATUS to NOT_CONVERGED.
    """
    n = number_junctions(tables, out)
    if n == 0:
        return
    pressure, change = tables.layout[0]["pressure"], 1e300
    add_controlled_rates(t, y, tables, out, n)
    assemble_with_given(tables, out, n)
    rows, _, _, right, pinned, _ = junction_work(tables, n)
    for i in range(rows.size):
        if rows[i] >= 0.0 and pinned[int(rows[i])] == 0.0:
            out[pressure + i] = 0.0
    for _ in range(100):
        assemble_with_given(tables, out, n)
        add_column_rates_barotropic(t, y, tables, out, n)
        solve_junctions(tables, out, n)
        last_change, change = change, 0.0
        for i in range(rows.size):
            if rows[i] >= 0.0:
                step = right[int(rows[i])]
                out[pressure + i] += step
                change = max(change, abs(step) / (1e5 + abs(out[pressure + i])))
        if has_converged(change, last_change):
            return
    out[STATUS] = NOT_CONVERGED


@njit
def column_pressures_barotropic(t, y, dydt, out, handle):
    """Write the pressures of column junctions, and of the column ends at which nearly closed valves control the flow.

    The enthalpy at a controlled end is that at the opposite end, minus g times the rise in elevation, plus the energy
    per mass from the motion of a body (`body_drive`). The pressure (L / A) dM/dt, which accelerates a column of length
    L, area A and flow M, is then subtracted; for a valve near its seat `apply_seating_drop` subtracts it.
    """
    tables = open_tables(handle)
    st, nodes, floats = tables.settings[0], tables.nodes, tables.floats
    pressure = tables.layout[0]["pressure"]
    junction_pressures_barotropic(t, y, tables, out)
    for k in range(tables.columns.size):
        column, end = tables.columns[k], control_end(tables, out, k)
        if end == 0:
            continue
        i, controlled = column["from_node"], column["to_node"]
        if end == -1:
            i, controlled = controlled, i
        rise = st["gravity"] * (nodes[controlled]["elevation"] - nodes[i]["elevation"]) - end * body_drive(
            tables, out, column
        )
        h = enthalpy(st, floats, nodes[i]["pressure"] + out[pressure + i])
        out[pressure + controlled] = pressure_of_enthalpy(st, floats, h - rise) - nodes[controlled]["pressure"]
        if seating_valve(tables, controlled) >= 0:
            apply_seating_drop(t, y, tables, out, k, controlled, seating_valve(tables, controlled))
        elif gate_area(tables, out, controlled)[0] > 0.0:
            rate = controlled_flow(t, y, tables, out, k, end, True)[1]
            out[pressure + controlled] -= column["length"] / column["area"] * rate


@njit
def apply_seating_drop(t, y, tables, out, k, x, index):
    """Replace the pressure change p' of node x for a column at rest with that for a moving column and valve disc.

    p' : pressure change since the start [Pa], read from `out` and replaced there
    k, index : number of the column, and number of the valve near its seat that controls the column
    """
    valve, pressure = tables.valves[index], tables.layout[0]["pressure"]
    still, ahead = head_drop(tables, out, index)[1], valve["from_node"] == x
    other = out[pressure + (valve["to_node"] if ahead else valve["from_node"])]
    inertia = tables.columns[k]["length"] / tables.columns[k]["area"]
    drop = seating_drop(t, y, tables, out, k, index, out[pressure + x], inertia, other, still)[0]
    out[pressure + x] += drop - still if ahead else still - drop


@njit
def column_rates_barotropic(t, y, dydt, out, handle):
    """Write d/dt of the flow in rigid columns [kg/s2] to `dydt`, from the changes of driving pressure and friction.

    The rate is (A / L) (change of the driving pressure) - (drag - initial steady drag), with area A and length L.
    """
    tables = open_tables(handle)
    for k in range(tables.columns.size if dydt.size > 0 else 0):
        at = tables.columns[k]["y"]
        dydt[at] = column_rate(t, y, tables, out, k, driving_pressure_change(tables, out, k))
