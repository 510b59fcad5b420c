"""Rigid columns under the laws log and table. Knows columns and the valves at their ends; solves no node."""

from fvsolve.jit import njit
from fvsolve.kernels.barotropic_nodes import drive, mean_density
from fvsolve.kernels.clusters import settled
from fvsolve.kernels.columns import add_led, column_rate
from fvsolve.kernels.density import enthalpy, pressure_of_enthalpy
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.led import led_by_lift, led_end, led_flow, lone_lead
from fvsolve.kernels.records import NOT_CONVERGED, STATUS
from fvsolve.kernels.restrictions import head_drop
from fvsolve.kernels.rigid import body_drive, gate_area, join_given, number_rigid, rigid_space, settle_rigid


@njit
def drive_change(tables, out, k):
    """What drives column k more than in the profile [Pa]."""
    st, nodes, column = tables.settings[0], tables.nodes, tables.columns[k]
    i, j, at = column["from_node"], column["to_node"], tables.layout[0]["pressure"]
    p_i, p_j = nodes[i]["pressure"] + out[at + i], nodes[j]["pressure"] + out[at + j]
    now = drive(st, tables.floats, p_i, nodes[i]["elevation"], p_j, nodes[j]["elevation"])[0]
    if column["ride"] >= 0:
        now += mean_density(st, tables.floats, p_i, p_j) * body_drive(tables, out, column)
    return now - column["base"]


@njit
def add_rates(t, y, tables, out, n):
    """Add to the right side d/dt of what columns that nothing leads bring into each of n rigid nodes [kg/s2]."""
    rows, _, _, right, pinned, _ = rigid_space(tables, n)
    for k in range(tables.columns.size):
        a, b = int(rows[tables.columns[k]["from_node"]]), int(rows[tables.columns[k]["to_node"]])
        if led_end(tables, out, k) == 0 and (a >= 0 or b >= 0):
            rate = column_rate(t, y, tables, out, k, drive_change(tables, out, k))
            if a >= 0:
                right[a] -= rate
            if b >= 0:
                right[b] += rate
    for r in range(n):
        right[r] *= 1.0 - pinned[r]


@njit
def hold_rigid_barotropic(t, y, tables, out):
    """`hold_rigid` by iteration: what drives a column is all but linear in the pressures at its ends."""
    n = number_rigid(tables, out)
    if n == 0:
        return
    pressure, moved = tables.layout[0]["pressure"], 1e300
    add_led(t, y, tables, out, n)
    join_given(tables, out, n)
    rows, _, _, right, pinned, _ = rigid_space(tables, n)
    for i in range(rows.size):
        if rows[i] >= 0.0 and pinned[int(rows[i])] == 0.0:
            out[pressure + i] = 0.0
    for _ in range(100):
        join_given(tables, out, n)
        add_rates(t, y, tables, out, n)
        settle_rigid(tables, out, n)
        before, moved = moved, 0.0
        for i in range(rows.size):
            if rows[i] >= 0.0:
                step = right[int(rows[i])]
                out[pressure + i] += step
                moved = max(moved, abs(step) / (1e5 + abs(out[pressure + i])))
        if settled(moved, before):
            return
    out[STATUS] = NOT_CONVERGED


@njit
def hold_columns_barotropic(t, y, dydt, out, handle):
    """Give rigid nodes their pressures, and the led end of a column its far end's enthalpy less height and inertia."""
    tables = open_tables(handle)
    st, nodes, floats = tables.settings[0], tables.nodes, tables.floats
    pressure = tables.layout[0]["pressure"]
    hold_rigid_barotropic(t, y, tables, out)
    for k in range(tables.columns.size):
        column, end = tables.columns[k], led_end(tables, out, k)
        if end == 0:
            continue
        i, x = column["from_node"], column["to_node"]
        if end == -1:
            i, x = x, i
        rise = st["gravity"] * (nodes[x]["elevation"] - nodes[i]["elevation"]) - end * body_drive(tables, out, column)
        h = enthalpy(st, floats, nodes[i]["pressure"] + out[pressure + i])
        out[pressure + x] = pressure_of_enthalpy(st, floats, h - rise) - nodes[x]["pressure"]
        if lone_lead(tables, x) >= 0:
            drive_with_lift(t, y, tables, out, k, x, lone_lead(tables, x))
        elif gate_area(tables, out, x)[0] > 0.0:
            rate = led_flow(t, y, tables, out, k, end, True)[1]
            out[pressure + x] -= column["length"] / column["area"] * rate


@njit
def drive_with_lift(t, y, tables, out, k, x, which):
    """Take off the standing pressure of node x what moves column k and the valve that leads it."""
    valve, pressure = tables.valves[which], tables.layout[0]["pressure"]
    still, ahead = head_drop(tables, out, which)[1], valve["from_node"] == x
    other = out[pressure + (valve["to_node"] if ahead else valve["from_node"])]
    inertia = tables.columns[k]["length"] / tables.columns[k]["area"]
    drop = led_by_lift(t, y, tables, out, k, which, out[pressure + x], inertia, other, still)[0]
    out[pressure + x] += drop - still if ahead else still - drop


@njit
def column_rates_barotropic(t, y, dydt, out, handle):
    """d/dt of the flow in rigid columns: (A / L) (change of what drives them) - drag'."""
    tables = open_tables(handle)
    for k in range(tables.columns.size if dydt.size > 0 else 0):
        at = tables.columns[k]["y"]
        dydt[at] = column_rate(t, y, tables, out, k, drive_change(tables, out, k))
