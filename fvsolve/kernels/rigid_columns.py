"""Rigid columns, each with a single flow, which valves (`column_valve_control`) or junctions may control.

The pressures at junctions of columns follow from `column_junctions`. Under the density law `linear` a column is driven
by the pressures at its ends, under the laws `log` and `table` by the difference of enthalpies times a mean density.
"""

from fvsolve.jit import njit, specialise
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
    seating_drop,
    seating_valve,
)
from fvsolve.kernels.density import enthalpy, pressure_of_enthalpy
from fvsolve.kernels.dtypes import CLOSING, NOT_CONVERGED, RATE, RATE_UNWANTED, STATUS
from fvsolve.kernels.node_newton import has_converged
from fvsolve.kernels.restrictions import driving_pressure, head_drop, mean_density, restriction_slope
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
    """Write the pressures of column junctions, at which the sum of flows into each stays zero, to `out`."""
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
def driving_pressure_change_linear(tables, out, k):
    """Result of `driving_pressure_change` under the density law `linear` [Pa]."""
    column, pressure = tables.columns[k], tables.layout[0]["pressure"]
    change = out[pressure + column["from_node"]] - out[pressure + column["to_node"]]
    return change + tables.settings[0]["rho"] * body_drive(tables, out, column)


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


CHANGE = None  # constant of the template


def _column_rates(t, y, dydt, out, handle):
    """Write d/dt of the flow in rigid columns [kg/s2] to `dydt`, unless it is empty; see `column_rate`."""
    tables = open_tables(handle)
    for k in range(tables.columns.size if dydt.size > 0 else 0):
        at = tables.columns[k]["y"]
        dydt[at] = column_rate(t, y, tables, out, k, CHANGE(tables, out, k))


column_rates = specialise(_column_rates, "column_rates", CHANGE=driving_pressure_change_linear)
column_rates_barotropic = specialise(_column_rates, "column_rates_barotropic", CHANGE=driving_pressure_change)


@njit
def add_column_rates_barotropic(t, y, tables, out, n):
    """Add d/dt of the flow of rigid columns into n column junctions [kg/s2] to the right-hand side of their equations.

    The right-hand side is `right` of `column_junctions.junction_work`. Columns whose flow valves control are left out.
    The entry of a junction with held pressure is set to zero.
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
    """Solve the pressures of column junctions.

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
        rise = st["gravity"] * (nodes[controlled]["elevation"] - nodes[i]["elevation"])
        rise -= end * body_drive(tables, out, column)
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
def column_rate_limit(t, y, dydt, out, handle):
    """Raise out[RATE] to the greatest rate [1/s] at which valves alone brake a column, (A / L) dp / dM.

    A, L : area and length of the column; dp / dM : slope of the drop of its valves over their flow
    Columns that valves control are left out. Clears out[CLOSING]; discs, which are evaluated later, write there how
    fast they close on a column.
    """
    tables = open_tables(handle)
    out[CLOSING] = 0.0
    if out[RATE] == RATE_UNWANTED:
        return
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
