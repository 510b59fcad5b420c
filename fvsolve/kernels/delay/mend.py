"""States that a jump changes within a step, put right when it has been taken. Knows the tables; passes nothing on.

The rates of a state change when a jump arrives, and the step's weights book that too briefly or too long: what they
miss is added, so that a jump is right to second order. A lake's supply is the method's, and so is what a line holds but
for what is given to stores.
"""

from math import exp, expm1

from fvsolve.jit import njit
from fvsolve.kernels.delay.history import COUNT, MENDED, same_time, time_of
from fvsolve.kernels.limits import BOTTOM, EVENTS, RIM
from fvsolve.kernels.network import stiffness_of
from fvsolve.kernels.records import FIXED, JUNCTION, PATCH, TANK

NAN = float("nan")


@njit(forceinline=True)
def missed_by(past, tables, t, when, sent):
    """How long what begins within the step that ends at t has been there, and how long its weights book it [s].

    Stages before it know nothing of it, those behind it that it was always there; none knows what was sent since.
    """
    if sent > time_of(past, int(past[COUNT]) - 1) + same_time(past):
        return t - when, 0.0
    before, settings = time_of(past, int(past[COUNT]) - 1), tables.settings[0]
    h, booked, at, many = t - before, 0.0, settings["weights"], settings["stages"]
    for i in range(many):
        if before + tables.floats[at + many + i] * h >= when - same_time(past):
            booked += tables.floats[at + i]
    return t - when, h * booked


@njit(forceinline=True)
def brought(missed, rate):
    """Time that is missed [s], of what gives way at a rate [1/s]: a store soon pushes back what comes.

    Else a jump into one that fills in less than a step would be mended by more than it brings.
    """
    since, booked = missed
    late = since - booked
    return late if rate * abs(late) < 1e-12 else -exp(-rate * booked) * expm1(-rate * late) / rate


@njit(forceinline=True)
def stores(tables, i):
    """Whether node i stores what flows into it, now."""
    node = tables.nodes[i]
    if node["kind"] == FIXED or node["kind"] == JUNCTION or node["kind"] == PATCH:
        return False
    k = EVENTS * node["row"]
    return node["kind"] != TANK or (tables.armed[k + BOTTOM] <= 0.0 and tables.armed[k + RIM] <= 0.0)


@njit(forceinline=True)
def quickness(tables, out, i, j):
    """Rate at which store i takes the pressure of the waves at node j [1/s]."""
    return stiffness_of(tables.nodes, tables.layout[0], out, i) * tables.nodes[j]["admittance"]


@njit(forceinline=True)
def mend(past, tables, y, out, pipe, i, flow, missed):
    """Give a store what a flow out of a line that began within the step has brought, and take it from the line."""
    if flow != 0.0 and stores(tables, i):
        mass = flow * brought(missed, quickness(tables, out, i, i))
        y[tables.nodes[i]["y"]] += mass
        y[pipe["y"]] -= mass
        past[MENDED] = NAN


@njit
def mend_columns(past, tables, y, i, change, missed):
    """Give rigid columns at node i the speed that a jump of its pressure [Pa] has brought them."""
    columns = tables.columns
    for k in range(columns.size):
        side = (columns[k]["from_node"] == i) - (columns[k]["to_node"] == i)
        if side != 0 and change != 0.0:
            share, admittance = columns[k]["area"] / columns[k]["length"], tables.nodes[i]["admittance"]
            rate = share / admittance if admittance > 0.0 else 0.0
            y[columns[k]["y"]] += side * change * share * brought(missed, rate)
            past[MENDED] = NAN


@njit
def mend_behind(past, tables, y, spare, out, missed):
    """Give stores behind valves, and rigid columns, what a jump at nodes closed by valves has brought them.

    What stores get is taken from the lines that feed them.

    spare, out : before and behind the jump
    """
    layout, valves, nodes = tables.layout[0], tables.valves, tables.nodes
    pressure, given, fed = layout["pressure"], 0.0, 0.0
    if tables.columns.size > 0:
        for i in range(nodes.size):
            mend_columns(past, tables, y, i, out[pressure + i] - spare[pressure + i], missed)
    for k in range(valves.size):
        flow = out[layout["valve"] + k] - spare[layout["valve"] + k]
        for side in range(2):
            i, j = valves[k]["from_node"], valves[k]["to_node"]
            if side == 1:
                i, j, flow = j, i, -flow
            if flow != 0.0 and stores(tables, i):
                gain = -flow * brought(missed, quickness(tables, out, i, j))
                y[nodes[i]["y"]] += gain
                given += gain
                past[MENDED] = NAN
    if given == 0.0:
        return
    for turn in range(2):  # from every line as it feeds them
        for k in range(tables.delays.size):
            pipe = tables.pipes[tables.delays[k]["pipe"]]
            at = layout["ends"] + 4 * tables.delays[k]["pipe"]
            for side in range(2):
                if nodes[pipe["to_node"] if side == 1 else pipe["from_node"]]["kind"] != JUNCTION:
                    continue
                come = out[at + 1 + side] - spare[at + 1 + side]
                leaves = come - (out[at + 3 * side] - spare[at + 3 * side])
                if turn == 0:
                    fed += leaves
                elif fed != 0.0:
                    y[pipe["y"]] -= given * leaves / fed
