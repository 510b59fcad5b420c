"""Rigid columns, each with a single flow, which valves that are nearly closed or junctions may control.

Control by valves: if a column ends at a node without storage, only the valves of that node control its flow I [kg/s].
Where they are nearly closed (below a thousandth of their full area), the time constant of the column goes to zero with
their area F (square root of the conductance G = 2 rho (Cd A_valve)^2). The flow then follows them: I = sum of F
sqrt(dP), with the decelerating pressure (L / A) dI/dt = (L / A) sum of dF/dt sqrt(dP). dP is the drop of a valve, L and
A are length and area of the column. When the last valve closes, no flow is possible: the column is stationary, and the
node has the pressure of its far end.

A column whose only outlet is a self-acting valve follows its disc that leaves the seat, or the stem of a regulating
valve near its seat. Lift x and flow M start as powers of time, and dP = M^2 / (G x^2), there 0 / 0, would relax at an
infinite rate. Until x has grown, dP drives both: (L / A) sqrt(G dP) dx/dt(dP) + dP = the stationary drop. The momentum
of the column is conserved.

Arguments common to these functions: k : number of a rigid column; index : number of a valve; x : node at the end of the
column that valves control; end : 1 if this is the `to` end, -1 if it is the `from` end; solved : True if the pressures
of nodes are solved, False if they are estimates; stationary : pressure change of x since the start, as if the column
were at rest [Pa]; inertia : pressure per d/dt of the flow, L / A of the column or more [Pa s2/kg].

The pressures at junctions of columns follow from `column_junctions`. Under the density law `linear` a column is driven
by the pressures at its ends, under the laws `log` and `table` by the difference of enthalpies times a mean density.
"""

from math import sqrt

from fvsolve.core.kernels import column_junctions as junctions
from fvsolve.core.kernels.calls import call_lead
from fvsolve.core.kernels.devices import LEAD
from fvsolve.core.kernels.dtypes import CLOSING, NOT_CONVERGED, RATE, RATE_UNWANTED, STATUS
from fvsolve.core.kernels.isolated_columns import pressure_across, settle_isolated_columns
from fvsolve.core.kernels.node_clusters import has_converged
from fvsolve.core.kernels.restrictions import (
    conductance,
    conductance_at,
    driving_pressure,
    head_drop,
    mean_density,
    restriction_slope,
)
from fvsolve.core.kernels.self_acting_valves import controls_column
from fvsolve.core.kernels.steady_friction import column_drag
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.jit import njit, specialise

NEARLY_CLOSED = 1e-3  # fraction of their full area below which valves control their column
# fraction of the flow at the switch to valve control; larger than the error made there
SWITCH_LOSS = 0.05
PRESSURE_TOLERANCE = 1e-13  # relative tolerance of a pressure in Newton
RATE_INTERVAL = 1e-7  # interval over which the rate of an area is measured [s]


@njit
def is_controlled(tables, out, i):
    """True if the valves at node i control the flow of the rigid column there.

    The node joins a single column and valves. All valves are closed, or they are nearly closed and the rates of their
    areas are known, or the only valve is near its seat.
    """
    node = tables.nodes[i]
    # With two columns and closed valves the node is a column junction, see `column_junctions`.
    if node["gates"] < 0 or node["columns"] > 1:
        return False
    if node["gate_count"] == 1 and seating_valve(tables, i) >= 0:
        return True
    area, full = junctions.gate_area(tables, out, i)
    return area == 0.0 or (area < NEARLY_CLOSED * full and area_rate_known(tables, out, i))


@njit
def area_rate_known(tables, out, i):
    """True if d/dt of the flow area of each valve at node i is known.

    It is known from a schedule, near the seat, or as zero until an event opens the valve.
    """
    node = tables.nodes[i]
    # The decelerating pressure follows from these rates, so all of them must be known.
    for e in range(node["gate_count"]):
        k = tables.integers[node["gates"] + e]
        if (
            tables.valves[k]["device"] >= 0
            and not controls_column(tables, k)
            and not junctions.opens_by_event(tables, out, k)
        ):
            return False
    return True


@njit
def find_control_end(tables, out, k):
    """End of rigid column k at which valves control its flow: 1 for `to`, -1 for `from`, 0 for none.

    Closed valves always control it: the flow is zero. If valves are only nearly closed and the far end is a column
    junction, this must have a pressure reference besides the column (`has_pressure_reference`).
    """
    column, marks = tables.columns[k], tables.scratch[: tables.nodes.size]
    # A closed end is taken first: valves at the other end cannot make a flow.
    for side in (1, -1):
        near = column["to_node"] if side > 0 else column["from_node"]
        # With two columns and closed valves the node is a column junction, see `is_controlled`.
        if tables.nodes[near]["columns"] == 1 and junctions.is_shut(tables, out, near):
            return side
    for side in (1, -1):
        near, far = column["to_node"], column["from_node"]
        if side < 0:
            near, far = far, near
        if is_controlled(tables, out, near) and (
            not junctions.is_column_junction(tables, out, far)
            or junctions.has_pressure_reference(tables, out, far, k, marks)
        ):
            return side
    return 0


@njit
def find_controlled_columns(tables, out):
    """Write for each rigid column the end at which valves control its flow to `out`: results of `find_control_end`."""
    at, n = tables.layout[0]["valve_controlled"], tables.columns.size
    # Cleared first, because `has_pressure_reference` reads the results of all columns.
    out[at : at + n] = 0.0
    for k in range(n):
        out[at + k] = find_control_end(tables, out, k)


@njit
def control_end(tables, out, k):
    """End of rigid column k at which valves control its flow, read from `out`: 1 `to`, -1 `from`, 0 for none."""
    return int(out[tables.layout[0]["valve_controlled"] + k])


@njit
def stationary_pressure(y, tables, out, k, end, solved):
    """Pressure change since the start at the controlled end of column k, as if the column were at rest [Pa].

    The second result is the fall of this pressure per d/dt of the flow [Pa s2/kg].
    """
    column = tables.columns[k]
    p, softness = junctions.far_end_pressure(y, tables, out, k, end, solved)
    inertia = column["length"] / column["area"]
    return pressure_across(tables, out, k, end, p, False), inertia + softness


@njit
def lift_drop(drop, still, slope, heavy):
    """(drop across a valve disc that controls a column [Pa], rate dx/dt of its lift x [1/s]), by Newton.

    The drop is r^2, with the root r of r^2 + heavy r dx/dt(r^2) = drop.
    drop : drop with the column at rest [Pa]; still : dx/dt at this drop [1/s]
    slope : derivative of dx/dt with respect to the drop [1/s/Pa]
    heavy : (L / A) sqrt(G), with length L and area A of the column, and conductance G of the valve at full lift
    Newton starts above the root, because the cubic is convex from its greatest root on.
    """
    if drop <= 0.0 or still == 0.0:
        return drop, still
    r, speed = sqrt(drop), still
    while r * r - drop + heavy * r * (still + slope * (r * r - drop)) < 0.0:
        r *= 2.0
    for _ in range(100):
        speed = still + slope * (r * r - drop)
        step = (r * r - drop + heavy * r * speed) / (
            2.0 * r + heavy * (speed + 2.0 * slope * r * r)
        )
        r -= step
        if abs(step) <= 1e-14 * r:
            break
    return r * r, still + slope * (r * r - drop)


@njit
def seating_valve(tables, i):
    """Number of the valve near its seat that is the only outlet of the column at node i and controls it; else -1."""
    k = tables.integers[tables.nodes[i]["gates"]]
    return k if controls_column(tables, k) else -1


@njit
def seating_drop(t, y, tables, out, k, index, stationary, inertia, other, drop):
    """(drop across valve `index`, which controls column k near its seat [Pa], rate dx/dt of its lift x [1/s]).

    other : pressure change since the start at the opposite end of the valve [Pa]
    drop : drop across the valve for the column at rest [Pa]
    """
    valve, column = tables.valves[index], tables.columns[k]
    device, heavy = tables.devices[valve["device"]], inertia * sqrt(valve["conductance"])
    # True if the column lies at the `from` end of the valve.
    ahead = valve["from_node"] == column["from_node"] or valve["from_node"] == column["to_node"]
    before, behind = (stationary, other) if ahead else (other, stationary)
    still, slope = call_lead(
        tables.hooks[device["hooks"], LEAD], t, y, tables, device, before, behind, drop, ahead
    )
    driving, speed = lift_drop(drop, still, slope, heavy)
    # Steps under error control (step 0) resolve the exchange of lift and flow, so need no correction.
    if driving <= 0.0 or conductance(tables, out, index) == 0.0 or tables.clock[0]["step"] == 0.0:
        return driving, speed
    way = (
        1.0
        if valve["from_node"] == column["to_node"] or valve["to_node"] == column["from_node"]
        else -1.0
    )
    root = relaxed_root(y, tables, out, k, index, way, sqrt(driving), slope, heavy)
    return root * abs(root), still + slope * (root * abs(root) - drop)


@njit
def relaxed_root(y, tables, out, k, index, way, root, slope, heavy):
    """Square root r of the valve drop for a fixed time step that does not resolve the exchange of lift and flow.

    r = r0 + (M / sqrt(G) - x r0) / max(x, x1), x1 = 4 h r0 (1 / heavy + r0 slope), with `root` r0, flow M, lift x,
    conductance G at full lift and step h. M relaxes to x sqrt(G) r0 over at least two steps, and not faster than
    without this correction. The sum x / slope + (L / A) M, with length L and area A of column k, is not changed by it.

    slope, heavy : see `lift_drop`
    way : 1 if the flow of the column from `from` to `to` passes the valve in the valve's own direction, else -1
    """
    dense, column = tables.valves[index]["conductance"], tables.columns[k]
    x = sqrt(conductance(tables, out, index) / dense)
    own = way * (column["flow"] + y[column["y"]]) / sqrt(dense)
    least_lift = 4.0 * tables.clock[0]["step"] * root * (1.0 / heavy + root * slope)
    return root + (own - x * root) / max(x, least_lift)


@njit
def seating_flow(t, y, tables, out, k, end, index, solved):
    """Results of `controlled_flow` for column k, which valve `index` controls near its seat."""
    valve, column = tables.valves[index], tables.columns[k]
    # 1 if the column lies at the `from` end of the valve, so that outflow is positive.
    side = (
        1.0
        if valve["from_node"] == (column["to_node"] if end == 1 else column["from_node"])
        else -1.0
    )
    stationary, inertia = stationary_pressure(y, tables, out, k, end, solved)
    other = junctions.pressure_at(
        tables, out, valve["to_node"] if side > 0.0 else valve["from_node"], 0.0, solved
    )
    still = valve["drop"] + side * (stationary - other)
    drop, speed = seating_drop(t, y, tables, out, k, index, stationary, inertia, other, still)
    # Orifice law: flow = sqrt(G) x sign(dP) sqrt(|dP|), and its rate by dx/dt.
    root = side * (sqrt(drop) if drop >= 0.0 else -sqrt(-drop))
    rate = speed * sqrt(valve["conductance"]) * root if drop > 0.0 else 0.0
    return sqrt(conductance(tables, out, index)) * root, rate, stationary + side * (drop - still)


@njit
def gate_flow(t, tables, out, x, p, solved):
    """(flow out of node x through its valves [kg/s], its rate from changes of their areas [kg/s2], slope of this rate).

    The slope is the derivative of the rate with respect to the pressure of the node [kg/s2/Pa].
    p : pressure change of the node since the start [Pa]
    """
    flow, rate, rise = 0.0, 0.0, 0.0
    for e in range(tables.nodes[x]["gate_count"]):
        k = tables.integers[tables.nodes[x]["gates"] + e]
        drop = p - junctions.zero_flow_pressure(tables, out, x, k, solved)
        root = sqrt(drop) if drop >= 0.0 else -sqrt(-drop)
        # Near a kink t is not the present time, to which conductances in `out` belong: both are evaluated.
        later = sqrt(conductance_at(t + RATE_INTERVAL, tables, out, k))
        widening = (later - sqrt(conductance_at(t, tables, out, k))) / RATE_INTERVAL
        flow += sqrt(conductance(tables, out, k)) * root
        rate += widening * root
        # Bounded, because sqrt(dP) has an infinite slope without a drop.
        rise += 0.5 * widening / max(abs(root), 1e-300)
    return flow, rate, rise


@njit
def zero_flow_range(tables, out, x, solved):
    """(least, greatest) result of `zero_flow_pressure` for all valves of node x [Pa]."""
    least, most = 1e300, -1e300
    for e in range(tables.nodes[x]["gate_count"]):
        level = junctions.zero_flow_pressure(
            tables, out, x, tables.integers[tables.nodes[x]["gates"] + e], solved
        )
        least, most = min(least, level), max(most, level)
    return least, most


@njit
def opening_pressure(t, tables, out, x, stationary, inertia, solved):
    """Pressure change of node x since the start [Pa] while its opening valves control a column, by bounded Newton.

    It is the only root p of p - stationary + inertia rate(p) = 0, with the rate of flow in the results of `gate_flow`.
    """
    # An opening valve moves the pressure from its stationary value towards that without flow.
    low, high = zero_flow_range(tables, out, x, solved)
    low = min(low, stationary)
    high = max(high, stationary)
    p = stationary
    for _ in range(200):
        _, rate, rise = gate_flow(t, tables, out, x, p, solved)
        residual = p - stationary + inertia * rate
        low, high = (low, p) if residual > 0.0 else (p, high)
        new = p - residual / (1.0 + inertia * rise)
        if not low < new < high:
            # The slope is infinite where a valve has no drop; there Newton may leave the bounds.
            new = 0.5 * (low + high)
        if abs(new - p) <= PRESSURE_TOLERANCE * (1e5 + abs(new)):
            return new
        p = new
    return p


@njit
def closing_pressure(t, tables, out, x, way, start, stationary, inertia, solved):
    """(pressure change of node x since the start while its closing valves control a column [Pa], True if it exists).

    It is a root p of p - stationary + inertia rate(p) = 0 with the flow direction `way`, as in `opening_pressure`. The
    left side is convex there, and flows tend to the outermost root.
    way : direction of the flow, 1 out of the node, -1 into it
    start : pressure at which Newton starts, outside all roots [Pa]
    """
    p = start
    for _ in range(200):
        flow, rate, rise = gate_flow(t, tables, out, x, p, solved)
        slope = 1.0 + inertia * rise
        # Past the minimum of the convex function: it has no root with this direction of flow.
        if slope <= 0.0 or flow * way <= 0.0:
            return p, False
        step = (p - stationary + inertia * rate) / slope
        p -= step
        if abs(step) <= PRESSURE_TOLERANCE * (1e5 + abs(p)):
            break
    return p, True


@njit
def controlled_pressure(t, tables, out, x, own, stationary, inertia, solved):
    """Pressure change of node x since the start [Pa] while its valves control the flow of a column.

    own : flow of the column into the node by its state [kg/s]
    Closing valves may allow a flow in either direction: the direction of the present flow is tried first.
    """
    flow, rate, _ = gate_flow(t, tables, out, x, stationary, solved)
    # No flow and no moving valve: nothing decelerates the column.
    if flow == 0.0 and rate == 0.0:
        return stationary
    # Opening valves: the residual rises with the pressure and has a single root.
    if rate * flow >= 0.0:
        return opening_pressure(t, tables, out, x, stationary, inertia, solved)
    # With r = sqrt(dP), all roots satisfy r^2 <= brake r + the greatest stationary drop.
    brake = -inertia * rate / flow * junctions.gate_area(tables, out, x)[0]
    way = 1.0 if own > 0.0 or (own == 0.0 and flow > 0.0) else -1.0
    least, most = zero_flow_range(tables, out, x, solved)
    reach = brake + sqrt(max(abs(stationary - least), abs(stationary - most)))
    # Where the present direction has no root, the flow has the opposite direction.
    for _ in range(2):
        start = most + reach * reach if way > 0.0 else least - reach * reach
        p, exists = closing_pressure(t, tables, out, x, way, start, stationary, inertia, solved)
        if exists:
            return p
        way = -way
    return stationary


@njit
def controlled_rate(t, y, tables, out, k, end):
    """d/dt of the flow of column k out of the end at which valves control it [kg/s2]; the flow keeps its direction.

    At the switch to valve control the state has an error of about 1 %. Below the fraction SWITCH_LOSS of the flow at
    the switch, the flow is relaxed to zero instead of changing its sign.
    """
    flow, rate, _ = controlled_flow(t, y, tables, out, k, end, True)
    column = tables.columns[k]
    # A flow that grows does not change its sign.
    if rate * flow >= 0.0:
        return rate
    area, full = junctions.gate_area(
        tables, out, column["to_node"] if end == 1 else column["from_node"]
    )
    least = (
        -SWITCH_LOSS * NEARLY_CLOSED * full * column["length"] / column["area"] * rate / flow * area
    )
    return rate * min(1.0, abs(column["flow"] + y[column["y"]]) / least)


@njit
def controlled_flow(t, y, tables, out, k, end, solved):
    """(flow of column k out of its controlled end [kg/s], d/dt of this flow [kg/s2], pressure change of the end [Pa]).

    The pressure change is that since the start.
    """
    column, limit = tables.columns[k], tables.clock[0]["limit"]
    x = column["to_node"] if end == 1 else column["from_node"]
    if seating_valve(tables, x) >= 0:
        return seating_flow(t, y, tables, out, k, end, seating_valve(tables, x), solved)
    # the rate before a kink at `limit`
    early = t if t + 2.0 * RATE_INTERVAL <= limit else t - RATE_INTERVAL
    stationary, inertia = stationary_pressure(y, tables, out, k, end, solved)
    own = end * (column["flow"] + y[column["y"]])
    p = controlled_pressure(early, tables, out, x, own, stationary, inertia, solved)
    flow, rate, _ = gate_flow(early, tables, out, x, p, solved)
    return flow, rate, p


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
    junctions.balance_junction_flows(tables, out)


@njit
def add_controlled_rates(t, y, tables, out, n):
    """Write d/dt of the flow that valve-controlled columns bring into each of n column junctions [kg/s2] to `given`.

    `given` is a work array, see `column_junctions.junction_work`.
    """
    rows, _, _, _, _, given = junctions.junction_work(tables, n)
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
    n = junctions.number_junctions(tables, out)
    if n == 0:
        return
    add_controlled_rates(t, y, tables, out, n)
    junctions.assemble_with_given(tables, out, n)
    rows, _, _, right, _, _ = junctions.junction_work(tables, n)
    junctions.add_column_rates(y, tables, out, n, -1, True)
    junctions.solve_junctions(tables, out, n)
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
    settle_isolated_columns(tables, out, False)
    junction_pressures(t, y, tables, out)
    for k in range(tables.columns.size):
        end = control_end(tables, out, k)
        if end != 0:
            controlled = (
                tables.columns[k]["to_node"] if end == 1 else tables.columns[k]["from_node"]
            )
            out[pressure + controlled] = controlled_flow(t, y, tables, out, k, end, True)[2]


@njit
def driving_pressure_change(tables, out, k):
    """Change of the driving pressure of rigid column k since the initial steady state [Pa].

    The driving pressure contains the pressures at both ends, gravity and the forcing of the column.
    """
    st = tables.settings[0]
    nodes = tables.nodes
    column = tables.columns[k]
    i = column["from_node"]
    j = column["to_node"]
    at = tables.layout[0]["pressure"]
    p_i, p_j = nodes[i]["pressure"] + out[at + i], nodes[j]["pressure"] + out[at + j]
    now = driving_pressure(
        st, tables.floats, p_i, nodes[i]["elevation"], p_j, nodes[j]["elevation"]
    )[0]
    if column["forcing"] >= 0:
        now += mean_density(st, tables.floats, p_i, p_j) * junctions.forcing_of(tables, out, column)
    return now - column["base"]


@njit
def driving_pressure_change_linear(tables, out, k):
    """Result of `driving_pressure_change` under the density law `linear` [Pa]."""
    column, pressure = tables.columns[k], tables.layout[0]["pressure"]
    change = out[pressure + column["from_node"]] - out[pressure + column["to_node"]]
    return change + tables.settings[0]["rho"] * junctions.forcing_of(tables, out, column)


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
    # At a seat that is closed the general formula would accelerate a column that cannot move.
    if end != 0 and (
        seating_valve(tables, node) < 0 or junctions.gate_area(tables, out, node)[0] == 0.0
    ):
        return end * controlled_rate(t, y, tables, out, k, end)
    friction = column_drag(column, out[tables.layout[0]["column"] + k])
    return column["area"] / column["length"] * (change + column["offset"]) - (
        friction - column["drag"]
    )


CHANGE = None  # constant of the template


def _column_rates(t, y, dydt, out, handle):
    """Write d/dt of the flow in rigid columns [kg/s2] to `dydt`, unless it is empty; see `column_rate`."""
    tables = open_tables(handle)
    for k in range(tables.columns.size if dydt.size > 0 else 0):
        at = tables.columns[k]["y"]
        dydt[at] = column_rate(t, y, tables, out, k, CHANGE(tables, out, k))


column_rates = specialise(_column_rates, "column_rates", CHANGE=driving_pressure_change_linear)
column_rates_barotropic = specialise(
    _column_rates, "column_rates_barotropic", CHANGE=driving_pressure_change
)


@njit
def add_column_rates_barotropic(t, y, tables, out, n):
    """Add d/dt of the flow of rigid columns into n column junctions [kg/s2] to the right-hand side of their equations.

    The right-hand side is `right` of `column_junctions.junction_work`. Columns whose flow valves control are left out.
    The entry of a junction with held pressure is set to zero.
    """
    rows, _, _, right, pinned, _ = junctions.junction_work(tables, n)
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
    n = junctions.number_junctions(tables, out)
    if n == 0:
        return
    pressure, change = tables.layout[0]["pressure"], 1e300
    add_controlled_rates(t, y, tables, out, n)
    # Here to mark junctions with held pressure; each sweep assembles again, because elimination overwrites.
    junctions.assemble_with_given(tables, out, n)
    rows, _, _, right, pinned, _ = junctions.junction_work(tables, n)
    # The iteration starts from the profile, so its result depends on (t, y) alone.
    for i in range(rows.size):
        if rows[i] >= 0.0 and pinned[int(rows[i])] == 0.0:
            out[pressure + i] = 0.0
    for _ in range(100):
        junctions.assemble_with_given(tables, out, n)
        add_column_rates_barotropic(t, y, tables, out, n)
        junctions.solve_junctions(tables, out, n)
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
    pressure = tables.layout[0]["pressure"]
    settle_isolated_columns(tables, out, True)
    junction_pressures_barotropic(t, y, tables, out)
    for k in range(tables.columns.size):
        column, end = tables.columns[k], control_end(tables, out, k)
        if end == 0:
            continue
        i, controlled = column["from_node"], column["to_node"]
        if end == -1:
            i, controlled = controlled, i
        out[pressure + controlled] = pressure_across(tables, out, k, end, out[pressure + i], True)
        if seating_valve(tables, controlled) >= 0:
            apply_seating_drop(t, y, tables, out, k, controlled, seating_valve(tables, controlled))
        elif junctions.gate_area(tables, out, controlled)[0] > 0.0:
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
    layout = tables.layout[0]
    nodes = tables.nodes
    valves = tables.valves
    for k in range(tables.columns.size):
        column = tables.columns[k]
        for side in range(2):
            i = column["to_node"] if side == 1 else column["from_node"]
            slope = 0.0
            for e in range(nodes[i]["gate_count"]):
                valve = tables.integers[nodes[i]["gates"] + e]
                # Drop at the start plus the changes of the pressures at both ends.
                drop = valves[valve]["drop"] + out[layout["pressure"] + valves[valve]["from_node"]]
                drop -= out[layout["pressure"] + valves[valve]["to_node"]]
                # Valves in parallel: their slopes dM / dp add up.
                slope += restriction_slope(tables, out, valve, drop)
            if slope > 0.0 and control_end(tables, out, k) == 0:
                out[RATE] = max(out[RATE], column["area"] / column["length"] / slope)
