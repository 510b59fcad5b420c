"""The right-hand side of a scene under the linear density law. Knows the tables; solves no steps.

out = [rate, status, where, -, p' of nodes, supply into nodes from outside [kg/s], net flow into nodes
[kg/s], four wave values a pipe (r and l at `from`, r and l at `to`), valve flows, column flows].
"""

from fvsolve.jit import njit
from fvsolve.kernels.calls import BRAKE, MOVE, run
from fvsolve.kernels.ends import end_value
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.limits import BOTTOM, EVENTS, RIM
from fvsolve.kernels.nodes import close_nodes
from fvsolve.kernels.pipes import family_of, pipe_rates
from fvsolve.kernels.records import CHAMBER, FIXED, JUNCTION, MOVING, OK, PATCH, RATE, STATUS, TANK, WHERE
from fvsolve.kernels.restrictions import conductance, head_drop, open_scheduled, restriction_slope


@njit(forceinline=True)
def clear_net(out, tables):
    """Zero in out[net], to which links then add what they carry into their nodes."""
    net = tables.layout[0]["net"]
    for i in range(tables.nodes.size):
        out[net + i] = 0.0


@njit(forceinline=True)
def waves_out(y, out, tables):
    """Outgoing waves of all pipes into out[ends], and what they carry into their nodes into out[net]."""
    settings, layout, pipes = tables.settings[0], tables.layout[0], tables.pipes
    scratch = tables.scratch
    clear_net(out, tables)
    for i in range(pipes.size):
        pipe = pipes[i]
        n, at = pipe["cells"], layout["ends"] + 4 * i
        r, l = y[pipe["y"] : pipe["y"] + n], y[pipe["y"] + n : pipe["y"] + 2 * n]
        family = family_of(settings, n)
        degree, limiter, small = settings["degree"], settings["limiter"], pipe["noise"]
        for right in range(2):
            wave = end_value(r if right == 1 else l, right, family, degree, limiter, small, scratch)
            out[at + 1 + right] = wave
            node = pipe["to_node"] if right == 1 else pipe["from_node"]
            out[layout["net"] + node] += 2.0 * wave


@njit(forceinline=True)
def waves_in(out, tables):
    """Waves that the nodes send back: incoming = Y p' - outgoing."""
    layout, pipes = tables.layout[0], tables.pipes
    for i in range(pipes.size):
        pipe = pipes[i]
        at = layout["ends"] + 4 * i
        p_from = out[layout["pressure"] + pipe["from_node"]]
        p_to = out[layout["pressure"] + pipe["to_node"]]
        out[at] = pipe["admittance"] * p_from - out[at + 1]
        out[at + 3] = pipe["admittance"] * p_to - out[at + 2]


@njit(forceinline=True)
def net_flows(out, tables):
    """Net flow into every node from its links [kg/s], total, profile included."""
    layout, pipes, nodes = tables.layout[0], tables.pipes, tables.nodes
    valves, columns = tables.valves, tables.columns
    net = layout["net"]
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
    for k in range(tables.pistons.size):
        for i in (tables.pistons[k]["a"], tables.pistons[k]["b"]):
            out[net + i] -= out[layout["swept"] + nodes[i]["row"]]


@njit(forceinline=True)
def stiffness_of(nodes, layout, out, i):
    """Pressure per stored mass [Pa/kg] of node i now, 0 where it stores none."""
    kind = nodes[i]["kind"]
    if kind >= MOVING or (kind == CHAMBER and nodes[i]["row"] >= 0):  # a chamber that gas softens
        return out[layout["stiffness"] + nodes[i]["row"]]
    return nodes[i]["stiffness"]


@njit(forceinline=True)
def stored_rates(y, dydt, out, tables):
    """d/dt of stored masses; what reservoirs give, full tanks spill, dry ones are asked for is supply."""
    layout, nodes, armed = tables.layout[0], tables.nodes, tables.armed
    for i in range(nodes.size):
        kind, net = nodes[i]["kind"], out[layout["net"] + i]
        if kind == JUNCTION or kind == PATCH:
            continue
        supply = 0.0
        if kind == FIXED:
            supply = -net
        elif kind == TANK:
            k = EVENTS * nodes[i]["row"]
            if armed[k + BOTTOM] > 0.0 or armed[k + RIM] > 0.0:
                supply = -net
        if kind != FIXED and dydt.size > 0:
            dydt[nodes[i]["y"]] = net + supply
        out[layout["supply"] + i] = supply


@njit(forceinline=True)
def quickest_node(out, tables):
    """Greatest rate of waves over cells, and of stored masses against the pipes that touch them [1/s]."""
    layout, nodes = tables.layout[0], tables.nodes
    rate = tables.settings[0]["rate"]
    for i in range(nodes.size):
        if nodes[i]["kind"] != FIXED and nodes[i]["kind"] != JUNCTION:
            rate = max(rate, stiffness_of(nodes, layout, out, i) * nodes[i]["admittance"])
    return rate


@njit
def quickest_valve(t, y, dydt, out, handle):
    """Let steps see how quickly stored masses answer through valves."""
    tables = open_tables(handle)
    layout, nodes, valves = tables.layout[0], tables.nodes, tables.valves
    rate = out[RATE]
    for k in range(valves.size):
        valve = valves[k]
        i, j = valve["from_node"], valve["to_node"]
        stiff_i, stiff_j = stiffness_of(nodes, layout, out, i), stiffness_of(nodes, layout, out, j)
        drop = head_drop(tables, out, k)[1]
        if nodes[i]["kind"] == PATCH and drop >= 0.0:  # what there is no water for cannot answer
            stiff_i *= out[layout["had"] + nodes[i]["row"]]
        if nodes[j]["kind"] == PATCH and drop <= 0.0:
            stiff_j *= out[layout["had"] + nodes[j]["row"]]
        stiff = stiff_i + stiff_j
        if valve["device"] >= 0 and tables.devices[valve["device"]]["row"] >= 0:
            continue  # the gate of a vessel, which says itself how quick it is
        if stiff > 0.0:
            g = conductance(tables, out, k)
            slope = restriction_slope(tables, out, k, drop)
            soft = 0.0
            if nodes[i]["kind"] == JUNCTION and nodes[i]["admittance"] > 0.0:
                soft += 1.0 / nodes[i]["admittance"]
            if nodes[j]["kind"] == JUNCTION and nodes[j]["admittance"] > 0.0:
                soft += 1.0 / nodes[j]["admittance"]
            rate = max(rate, stiff * slope / (1.0 + soft * slope))
            if valve["transition"] > 0.0 and g > 0.0:
                change = stiff_i * out[layout["net"] + i]
                change -= stiff_j * out[layout["net"] + j]
                width = max(valve["transition"] ** 2 / g, valve["unseen"])
                if change * drop < 0.0:  # two steps at least to a drop of zero: a longer one would leap over it
                    rate = max(rate, 2.5 * abs(change) / max(abs(drop), width))
    out[RATE] = rate


@njit
def rhs_linear(t, y, dydt, out, handle):
    """dydt = f(t, y) of the whole scene, and `out`; pure, but for scratch. An empty dydt asks for `out` alone."""
    tables = open_tables(handle)
    settings, layout, pipes = tables.settings[0], tables.layout[0], tables.pipes
    out[STATUS], out[WHERE] = OK, -1.0
    open_scheduled(t, out, tables)
    waves_out(y, out, tables)
    close_nodes(t, y, dydt, out, handle)
    waves_in(out, tables)
    net_flows(out, tables)
    stored_rates(y, dydt, out, tables)
    out[RATE] = quickest_node(out, tables)
    run(BRAKE, t, y, dydt, out, handle)
    if dydt.size == 0:
        return
    run(MOVE, t, y, dydt, out, handle)
    for i in range(pipes.size):
        pipe = pipes[i]
        n, o, at = pipe["cells"], pipe["y"], layout["ends"] + 4 * i
        pipe_rates(
            settings,
            pipe,
            y[o : o + n],
            y[o + n : o + 2 * n],
            out[at],
            out[at + 1],
            out[at + 2],
            out[at + 3],
            tables.scratch,
            dydt[o : o + n],
            dydt[o + n : o + 2 * n],
        )
