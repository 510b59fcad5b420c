"""Junctions of rigid columns whose valves are all closed: balance of flows, pressures, impulses.

No flow leaves such a junction, so the flows of its columns into it add up to zero. Its pressure P keeps them so: sum of
(A / L) (P_far - P) = sum of friction terms, with area A, length L and pressure P_far at the far end of each column.
Flows M that do not add up are equalised by an impulse J [Pa s] of pressure, dM = (A / L) J away from the junction:
momentum is conserved (an inelastic impact). The rounding of the sum is removed in the same way. Columns controlled by
valves have a given flow here.

A column junction joins at least two rigid columns, and otherwise only closed valves. Arguments common to these
functions: n : number of column junctions; k : number of a column, -1 for none; seen : float64[nodes]  work array;
rows, right : see `junction_work`; solved : True if the pressures of nodes are solved, False if they are estimates.
"""

from math import sqrt

from fvsolve.core.kernels.dtypes import JUNCTION, NO_SOLUTION, STATUS, WHERE
from fvsolve.core.kernels.node_clusters import solve_dense
from fvsolve.core.kernels.restrictions import conductance
from fvsolve.core.kernels.steady_friction import column_drag
from fvsolve.jit import njit


@njit
def is_air_gate(tables, k):
    """True if valve k leads into the chamber of an air valve."""
    device = tables.valves[k]["device"]
    return device >= 0 and tables.devices[device]["row"] >= 0


@njit
def opens_by_event(tables, out, k):
    """True if valve k is closed and only an event opens it, as for air valves and ideal check valves."""
    if conductance(tables, out, k) > 0.0:
        return False
    device = tables.valves[k]["device"]
    return device >= 0 and tables.devices[device]["opens_by_event"] == 1


@njit
def gate_area(tables, out, i):
    """(present, full) flow area of the valves at node i, as sums of square roots of conductances [kg/s/Pa^0.5].

    The second sum leaves out air valves, and closed valves that only an event opens.
    """
    node = tables.nodes[i]
    area = 0.0
    full = 0.0
    for e in range(node["gate_count"]):
        k = tables.integers[node["gates"] + e]
        area += sqrt(conductance(tables, out, k))
        if not (is_air_gate(tables, k) or opens_by_event(tables, out, k)):
            full += sqrt(tables.valves[k]["conductance"])
    return area, full


@njit
def is_column_junction(tables, out, i):
    """True if node i joins at least two rigid columns, and otherwise only closed valves."""
    node = tables.nodes[i]
    return node["gates"] >= 0 and node["columns"] > 1 and gate_area(tables, out, i)[0] == 0.0


@njit
def is_shut(tables, out, i):
    """True if node i joins rigid columns, and otherwise only closed valves."""
    node = tables.nodes[i]
    if node["gates"] < 0 or node["columns"] == 0:
        return False
    for e in range(node["gate_count"]):
        if conductance(tables, out, tables.integers[node["gates"] + e]) > 0.0:
            return False
    return True


@njit(forceinline=True)
def forcing_of(tables, out, column):
    """Forcing of a column, the change since the start of the work that a feature does on it [J/kg].

    It is 0 for a column without it.
    """
    total, at = 0.0, tables.layout[0]["forcing"] + column["forcing"]
    for k in range(column["forcings"]):
        total += out[at + k]
    return total


@njit(forceinline=True)
def driving_offset(tables, out, column):
    """Driving pressure of a column in addition to the pressure changes of its ends [Pa].

    It contains the initial driving pressure not balanced by friction, and the forcing of the column.
    """
    return column["offset"] + tables.settings[0]["rho"] * forcing_of(tables, out, column)


@njit
def pressure_at(tables, out, i, extra, solved):
    """Pressure change of node i since the start [Pa].

    If nodes are not `solved` yet, the value of a junction is an estimate: the change of its inflow at unchanged
    pressure plus `extra` [kg/s], over the admittance of its pipes; 0 without pipes.
    """
    layout, node = tables.layout[0], tables.nodes[i]
    if node["kind"] != JUNCTION or solved:
        return out[layout["pressure"] + i]
    return (
        (out[layout["net"] + i] + extra) / node["admittance"] if node["admittance"] > 0.0 else 0.0
    )


@njit
def zero_flow_pressure(tables, out, x, index, solved):
    """Pressure change of node x since the start [Pa] at which there is no flow through its valve `index`."""
    valve = tables.valves[index]
    side = 1.0 if valve["from_node"] == x else -1.0
    other = pressure_at(
        tables, out, valve["to_node"] if side > 0.0 else valve["from_node"], 0.0, solved
    )
    return other - side * valve["drop"]


@njit
def has_pressure_reference(tables, out, i, k, seen):
    """True if rigid columns other than k join junction i, also through column junctions, to a node of another kind.

    Columns that valves control are left out, and ends with closed valves set no pressure.
    seen : receives 1 for the nodes that these columns join
    """
    columns, controlled = tables.columns, tables.layout[0]["valve_controlled"]
    # Junctions reached so far are marked; each turn adds those behind a further column.
    seen[:] = 0.0
    seen[i], changed = 1.0, True
    while changed:
        changed = False
        for j in range(columns.size):
            a, b = columns[j]["from_node"], columns[j]["to_node"]
            # A column with both ends seen, or both unseen, leads to no new node.
            if j == k or out[controlled + j] != 0.0 or seen[a] == seen[b]:
                continue
            other = b if seen[a] > 0.0 else a
            if not is_shut(tables, out, other):
                return True
            seen[other], changed = 1.0, True
    return False


@njit
def is_pinned(tables, out, i, seen):
    """True if column junction i is the first of a connected group in which no node sets the level of pressure.

    The pressure of the first one of such a group is held.
    """
    if has_pressure_reference(tables, out, i, -1, seen):
        return False
    # A junction with a lower number in this group is held instead.
    for j in range(i):
        if seen[j] > 0.0:
            return False
    return True


@njit
def junction_work(tables, n):
    """Work arrays for n column junctions, as parts of `tables.scratch`.

    rows : float64[nodes]  number of each node as a column junction, -1 for other nodes
    marks : float64[nodes]  marks of nodes
    matrix : float64[n * n]  matrix of the equations for the pressures [m]
    right : float64[n]  right-hand side, then solution
    pinned : float64[n]  1 for a junction whose pressure is held
    given : float64[n]  flow rates of columns that valves control [kg/s2]
    """
    n_nodes, work = tables.nodes.size, tables.scratch
    at = 2 * n_nodes + n * n
    right = work[at : at + n]
    pinned = work[at + n : at + 2 * n]
    given = work[at + 2 * n : at + 3 * n]
    return work[:n_nodes], work[n_nodes : 2 * n_nodes], work[2 * n_nodes : at], right, pinned, given


@njit
def number_junctions(tables, out):
    """Number the column junctions in node order, in scratch (-1 for other nodes); return their count."""
    rows, n = tables.scratch, 0
    for i in range(tables.nodes.size):
        rows[i] = -1.0
        if is_column_junction(tables, out, i):
            rows[i] = n
            n += 1
    return n


@njit
def assemble_junctions(tables, out, n, k):
    """Assemble the matrix for the pressures of n column junctions: sums of A / L of their columns [m].

    A, L : area and length of a column. Columns that valves control and column k (-1: none) are left out. The right-hand
    side is cleared, and junctions whose pressure is held (`is_pinned`) are marked; arrays : see `junction_work`.
    """
    rows, seen, matrix, right, pinned, _ = junction_work(tables, n)
    columns, controlled = tables.columns, tables.layout[0]["valve_controlled"]
    matrix[:], right[:] = 0.0, 0.0
    for j in range(columns.size):
        if j == k or out[controlled + j] != 0.0:
            continue
        # A column between two junctions couples them by (A / L) (P_a - P_b).
        a, b = int(rows[columns[j]["from_node"]]), int(rows[columns[j]["to_node"]])
        mobility = columns[j]["area"] / columns[j]["length"]
        if a >= 0:
            matrix[n * a + a] += mobility
        if b >= 0:
            matrix[n * b + b] += mobility
        if a >= 0 and b >= 0:
            matrix[n * a + b] -= mobility
            matrix[n * b + a] -= mobility
    for i in range(rows.size):
        if rows[i] >= 0.0:
            pinned[int(rows[i])] = 1.0 if is_pinned(tables, out, i, seen) else 0.0


@njit
def assemble_with_given(tables, out, n):
    """Call `assemble_junctions`, and copy the flow rates of valve-controlled columns [kg/s2] to the right-hand side."""
    assemble_junctions(tables, out, n, -1)
    _, _, _, right, _, given = junction_work(tables, n)
    for r in range(n):
        right[r] = given[r]


@njit
def solve_junctions(tables, out, n):
    """Solve the linear equations of n column junctions; the solution replaces the right-hand side in scratch.

    The solution of a junction with held pressure (`is_pinned`) is its value on the right-hand side. STATUS is set to
    NO_SOLUTION for a singular matrix.
    """
    _, _, matrix, right, pinned, _ = junction_work(tables, n)
    # Without a reference only differences of pressures are determined: the matrix would be singular.
    for r in range(n):
        if pinned[r] > 0.0:
            # The row becomes the identity, so that the held value stays as it is.
            matrix[n * r : n * r + n] = 0.0
            matrix[n * r + r] = 1.0
    if solve_dense(matrix, right, n) == 0.0:
        out[STATUS], out[WHERE] = NO_SOLUTION, -1.0


@njit
def value_at(rows, right, i):
    """Entry of `right` for node i, 0 if the node is not a column junction."""
    return right[int(rows[i])] if rows[i] >= 0.0 else 0.0


@njit
def balance_junction_flows(tables, out):
    """Make the flows into each column junction add up to zero, by pressure impulses (inelastic impact of the columns).

    Changes out[column], the flows of columns, and out[net], the changes of net inflow of nodes since the start [kg/s].
    """
    n = number_junctions(tables, out)
    if n == 0:
        return
    assemble_junctions(tables, out, n, -1)
    rows, _, _, right, pinned, _ = junction_work(tables, n)
    layout, columns = tables.layout[0], tables.columns
    # Impulses must remove the flow that does not add up, which is the right-hand side.
    add_flow_sums(tables, out, rows, right)
    for r in range(n):
        # Only differences of impulses act, so the impulse of one held junction may be 0.
        right[r] *= 1.0 - pinned[r]
    solve_junctions(tables, out, n)
    for k in range(columns.size):
        a, b = columns[k]["from_node"], columns[k]["to_node"]
        if out[layout["valve_controlled"] + k] == 0.0:
            # dM = (A / L) times the difference of the impulses at both ends
            impulse = value_at(rows, right, b) - value_at(rows, right, a)
            change = columns[k]["area"] / columns[k]["length"] * impulse
            out[layout["column"] + k] -= change
            out[layout["net"] + a] += change
            out[layout["net"] + b] -= change


@njit
def gate_inflow(tables, i):
    """Flow into node i through its valves in the initial steady state [kg/s]."""
    node = tables.nodes[i]
    valves = tables.valves
    total = 0.0
    for e in range(node["gate_count"]):
        k = tables.integers[node["gates"] + e]
        total += valves[k]["flow"] if valves[k]["to_node"] == i else -valves[k]["flow"]
    return total


@njit
def add_flow_sums(tables, out, rows, right):
    """Add the sum of the flows of columns into each column junction [kg/s] to `right`; it is exactly 0 at the start."""
    nodes = tables.nodes
    columns = tables.columns
    at = tables.layout[0]["column"]
    # The valves are closed now, so their flow in the profile is taken out of `inflow`.
    for i in range(rows.size):
        if rows[i] >= 0.0:
            right[int(rows[i])] += nodes[i]["inflow"] - gate_inflow(tables, i)
    for k in range(columns.size):
        change = out[at + k] - columns[k]["flow"]
        a, b = int(rows[columns[k]["from_node"]]), int(rows[columns[k]["to_node"]])
        if a >= 0:
            right[a] -= change
        if b >= 0:
            right[b] += change


@njit
def add_column_rates(y, tables, out, n, skip, solved):
    """Add d/dt of the flows of columns into n column junctions [kg/s2] to the right-hand side of their equations.

    The rates are those at unchanged junction pressures. Valve-controlled columns and column `skip` (-1: none) are left
    out. Before nodes are `solved`, flows follow from the state and pressures are estimates. The entry of a junction
    with held pressure (`is_pinned`) becomes its pressure change since the start [Pa].
    """
    rows, _, _, right, pinned, _ = junction_work(tables, n)
    layout, columns = tables.layout[0], tables.columns
    for k in range(columns.size):
        column = columns[k]
        i, j = column["from_node"], column["to_node"]
        if (
            k == skip
            or out[layout["valve_controlled"] + k] != 0.0
            or (rows[i] < 0.0 and rows[j] < 0.0)
        ):
            continue
        flow = out[layout["column"] + k] if solved else column["flow"] + y[column["y"]]
        # The pressures of the junctions are the unknowns, so here they count as unchanged.
        p_i = 0.0 if rows[i] >= 0.0 else pressure_at(tables, out, i, -flow, solved)
        p_j = 0.0 if rows[j] >= 0.0 else pressure_at(tables, out, j, flow, solved)
        rate = column["area"] / column["length"] * (p_i - p_j + driving_offset(tables, out, column))
        rate -= column_drag(column, flow) - column["drag"]
        if rows[i] >= 0.0:
            right[int(rows[i])] -= rate
        if rows[j] >= 0.0:
            right[int(rows[j])] += rate
    for i in range(rows.size):
        if rows[i] >= 0.0 and pinned[int(rows[i])] > 0.0:
            right[int(rows[i])] = out[layout["pressure"] + i]


@njit
def far_end_pressure(y, tables, out, k, end, solved):
    """(pressure change at the far end of column k at constant flow [Pa], its fall per d/dt of this flow [Pa s2/kg]).

    The pressure change is that since the start of the run.
    end : 1 if the near end is the `to` end, -1 if it is the `from` end
    """
    column = tables.columns[k]
    i = column["from_node"] if end == 1 else column["to_node"]
    if not is_column_junction(tables, out, i):
        return pressure_at(tables, out, i, end * column["flow"], solved), 0.0
    # The far end has no given pressure: it follows from the other columns there.
    n = number_junctions(tables, out)
    assemble_junctions(tables, out, n, k)
    rows, _, _, right, _, _ = junction_work(tables, n)
    add_column_rates(y, tables, out, n, k, solved)
    solve_junctions(tables, out, n)
    p = right[int(rows[i])]
    # Again, because the elimination has overwritten the matrix: now the response to a unit flow rate.
    assemble_junctions(tables, out, n, k)
    right[int(rows[i])] = 1.0
    solve_junctions(tables, out, n)
    return p, right[int(rows[i])]
