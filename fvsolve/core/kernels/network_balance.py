"""Network balances common to all density laws: net flows, rates of storage, rate limits of nodes and valves.

`out` holds: wave rate, status, number of a faulty node and two more (`dtypes.OUT_HEAD`); pressure changes of nodes
since the start [Pa]; supply into nodes from outside [kg/s]; net flow into nodes [kg/s]; four wave values of each pipe
(forward and backward at `from`, then at `to`) [kg/s]; valve flows, column flows [kg/s]; further values of
`dtypes.LAYOUT`.
"""

from fvsolve.core.kernels.dtypes import (
    CHAMBER,
    FIXED,
    JUNCTION,
    MOVING,
    OK,
    PATCH,
    RATE,
    RATE_UNWANTED,
    STATUS,
    TANK,
    WHERE,
)
from fvsolve.core.kernels.restrictions import (
    conductance,
    head_drop,
    open_scheduled,
    restriction_slope,
)
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.core.kernels.tanks import BOTTOM, EVENTS, RIM
from fvsolve.jit import njit

NO_WAY_OUT = 1e300  # impedance of a junction without an open link [Pa s/kg]


@njit(forceinline=True)
def clear_outputs(out, tables):
    """Clear the status and out[net], to which links then add their flows into nodes."""
    net = tables.layout[0]["net"]
    out[STATUS], out[WHERE] = OK, -1.0
    for i in range(tables.nodes.size):
        out[net + i] = 0.0


@njit
def begin_network(t, y, dydt, out, handle):
    """Clear outputs and write the conductances of restrictions that follow schedules."""
    tables = open_tables(handle)
    clear_outputs(out, tables)
    open_scheduled(t, out, tables)


@njit
def begin_basins(t, y, dydt, out, handle):
    """Clear the outputs of a model that has basins but no links, and so no flow between nodes.

    out[RATE] is set to the greatest constant wave rate of the model [1/s].
    """
    tables = open_tables(handle)
    clear_outputs(out, tables)
    out[RATE] = tables.settings[0]["rate"]


@njit(forceinline=True)
def net_flows(out, tables):
    """Write the net flow into every node from its links [kg/s] to out[net]: total flow, not change since the start."""
    layout = tables.layout[0]
    pipes = tables.pipes
    nodes = tables.nodes
    valves, columns = tables.valves, tables.columns
    net = layout["net"]
    # The flows of the profile enter once, with `inflow`; below, each link adds the change of its flow.
    for i in range(nodes.size):
        out[net + i] = nodes[i]["inflow"]
    for i in range(pipes.size):
        at = layout["ends"] + 4 * i
        out[net + pipes[i]["from_node"]] -= out[at] - out[at + 1]
        out[net + pipes[i]["to_node"]] += out[at + 2] - out[at + 3]
    for k in range(valves.size):
        change = out[layout["valve"] + k] - valves[k]["flow"]
        out[net + valves[k]["from_node"]] -= change
        out[net + valves[k]["to_node"]] += change
    for k in range(columns.size):
        change = out[layout["column"] + k] - columns[k]["flow"]
        out[net + columns[k]["from_node"]] -= change
        out[net + columns[k]["to_node"]] += change
    # The state of a moving chamber is its excess mass, so a growing volume counts as an outflow. A model without such
    # nodes skips the loop.
    for i in range(nodes.size if tables.settings[0]["swept"] == 1 else 0):
        if nodes[i]["kind"] == MOVING:
            out[net + i] -= out[layout["swept"] + nodes[i]["row"]]


@njit(forceinline=True)
def stiffness_of(nodes, layout, out, i):
    """Present pressure rise per stored mass [Pa/kg] of node i, 0 for a node without storage."""
    kind = nodes[i]["kind"]
    if kind >= MOVING or (kind == CHAMBER and nodes[i]["row"] >= 0):  # a chamber softened by gas
        return out[layout["stiffness"] + nodes[i]["row"]]
    return nodes[i]["stiffness"]


@njit(forceinline=True)
def node_impedance(tables, i):
    """Pressure rise at junction i per flow into it [Pa s/kg], 1 / admittance of its pipes; 0 for other nodes."""
    node = tables.nodes[i]
    return (
        1.0 / node["admittance"] if node["kind"] == JUNCTION and node["admittance"] > 0.0 else 0.0
    )


@njit
def chain_impedance(tables, out, i, k):
    """Pressure rise at junction i per flow that enters through restriction k [Pa s/kg]; 0 for other nodes.

    The flow leaves through pipes and the other restrictions, whose other ends keep their pressures. Where a single
    restriction leaves a junction, it is followed to its other end.
    """
    valves = tables.valves
    nodes = tables.nodes
    impedance = 0.0
    # A chain visits each node at most once; the bound ends the loop where restrictions form a ring.
    for _ in range(nodes.size):
        if nodes[i]["kind"] != JUNCTION:
            return impedance
        total = nodes[i]["admittance"]
        count = 0
        last = k
        for e in range(valves.size):
            valve = valves[e]
            if (
                e != k
                and (valve["from_node"] == i or valve["to_node"] == i)
                and conductance(tables, out, e) > 0.0
            ):
                total += restriction_slope(tables, out, e, head_drop(tables, out, e)[1])
                count, last = count + 1, e
        impedance += 1.0 / total if total > 0.0 else NO_WAY_OUT
        # Behind a branch or a pipe only a part of the flow goes on, so further impedances are not in series.
        if count != 1 or nodes[i]["admittance"] > 0.0:
            break
        # The sum of both node numbers minus this node is the opposite end.
        i, k = valves[last]["from_node"] + valves[last]["to_node"] - i, last
    return impedance


@njit(forceinline=True)
def stored_rates(y, dydt, out, tables):
    """Write d/dt of the stored mass of every node to `dydt`, and the supply from outside to `out` [kg/s].

    A supply is the outflow of a reservoir, the spill of a full tank (negative), or the missing outflow of a dry tank.
    """
    layout = tables.layout[0]
    nodes = tables.nodes
    armed = tables.armed
    for i in range(nodes.size):
        kind, net = nodes[i]["kind"], out[layout["net"] + i]
        # The supply of a junction is its demand, written before. A patch gives its flow to its basin.
        if kind == JUNCTION or kind == PATCH:
            continue
        supply = 0.0
        if kind == FIXED:
            supply = -net
        elif kind == TANK:
            k = EVENTS * nodes[i]["row"]
            # A tank held at its bottom or rim keeps its level: the supply takes up the whole net flow.
            if armed[k + BOTTOM] > 0.0 or armed[k + RIM] > 0.0:
                supply = -net
        if kind != FIXED and dydt.size > 0:
            dydt[nodes[i]["y"]] = net + supply
        out[layout["supply"] + i] = supply


@njit(forceinline=True)
def node_rate_limit(out, tables):
    """Greatest rate that limits the step [1/s]: of waves through cells, or of stored masses at the ends of pipes.

    The rate of a stored mass is its stiffness times the admittance of the pipes at its node.
    """
    layout, nodes = tables.layout[0], tables.nodes
    rate = tables.settings[0]["rate"]
    for i in range(nodes.size):
        if nodes[i]["kind"] != FIXED and nodes[i]["kind"] != JUNCTION:
            rate = max(rate, stiffness_of(nodes, layout, out, i) * nodes[i]["admittance"])
    return rate


@njit
def balance_network(t, y, dydt, out, handle):
    """Write net flows into nodes and rates of storage; set out[RATE] to the greatest rate of cells and nodes [1/s]."""
    tables = open_tables(handle)
    net_flows(out, tables)
    stored_rates(y, dydt, out, tables)
    if out[RATE] != RATE_UNWANTED:
        out[RATE] = node_rate_limit(out, tables)


@njit
def valve_rate_limit(t, y, dydt, out, handle):
    """Raise out[RATE] to the greatest rate [1/s] at which the flow through a valve equalises the pressures at its ends.

    The rate is also high enough that a step does not pass a drop of zero. Valves of vessels are left out, because their
    devices set a rate, and valves with a given flow, which no pressure changes.
    """
    tables = open_tables(handle)
    layout = tables.layout[0]
    nodes = tables.nodes
    valves = tables.valves
    rate = out[RATE]
    if rate == RATE_UNWANTED:
        return
    for k in range(valves.size):
        valve = valves[k]
        i, j = valve["from_node"], valve["to_node"]
        stiff_i, stiff_j = stiffness_of(nodes, layout, out, i), stiffness_of(nodes, layout, out, j)
        drop = head_drop(tables, out, k)[1]
        if nodes[i]["kind"] == PATCH and drop >= 0.0:  # without water a patch cannot respond
            stiff_i *= out[layout["outflow_fraction"] + nodes[i]["row"]]
        if nodes[j]["kind"] == PATCH and drop <= 0.0:
            stiff_j *= out[layout["outflow_fraction"] + nodes[j]["row"]]
        # A flow lowers the pressure upstream and raises it downstream, so both stiffnesses add.
        stiff = stiff_i + stiff_j
        if valve["flow_given"] == 1 or (
            valve["device"] >= 0 and tables.devices[valve["device"]]["row"] >= 0
        ):
            continue  # the device of a vessel sets its own rate
        if stiff > 0.0:
            g = conductance(tables, out, k)
            slope = restriction_slope(tables, out, k, drop)
            # Pressures of junctions respond at once and limit the flow, however steep the law of the valve is.
            soft = node_impedance(tables, i) + node_impedance(tables, j)
            if valve["chained"] == 1:
                soft = chain_impedance(tables, out, i, k) + chain_impedance(tables, out, j, k)
            rate = max(rate, stiff * slope / (1.0 + soft * slope))
            if valve["transition"] > 0.0 and g > 0.0 and valve["chained"] == 0:
                change = stiff_i * out[layout["net"] + i]
                change -= stiff_j * out[layout["net"] + j]
                # Below this drop the law is nearly linear: a smaller distance to zero needs no shorter step.
                width = max(valve["transition"] ** 2 / g, valve["rounding_drop"])
                # at least two steps to a drop of zero: a longer step would pass it
                if change * drop < 0.0:
                    rate = max(rate, 2.5 * abs(change) / max(abs(drop), width))
    out[RATE] = rate
