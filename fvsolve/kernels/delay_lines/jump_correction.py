"""Correction of states for a jump that arrives within a step, applied after the step.

The rates of a state change when a jump arrives. The weights of the Runge-Kutta method count the new rate for too short
or too long a time. The missing part is added, so that a jump is correct to second order. The supply through
nodes of given pressure is not corrected, nor is the mass in delay lines, except for the mass that they give to nodes
with storage.
"""

from math import exp, expm1

from fvsolve.jit import njit
from fvsolve.kernels.delay_lines.wave_history import CORRECTED_TIME, COUNT, time_of, time_tolerance
from fvsolve.kernels.dtypes import FIXED, JUNCTION, PATCH, TANK
from fvsolve.kernels.network_balance import stiffness_of
from fvsolve.kernels.tanks import BOTTOM, EVENTS, RIM

NAN = float("nan")


@njit(forceinline=True)
def change_times(past, tables, t, time, sent):
    """(time for which a change within a step acts, time for which the weights of the method count it) [s].

    Stages before the change do not include it. Stages after it include it as if it had always been there. No stage
    includes a jump that was sent since the last entry.
    t, time : end of the step, and time of the change; sent : time at which the jump was sent
    """
    if sent > time_of(past, int(past[COUNT]) - 1) + time_tolerance(past):
        return t - time, 0.0
    before, settings = time_of(past, int(past[COUNT]) - 1), tables.settings[0]
    h, booked, at, stages = t - before, 0.0, settings["weights"], settings["stages"]
    for i in range(stages):
        if before + tables.floats[at + stages + i] * h >= time - time_tolerance(past):
            booked += tables.floats[at + i]
    return t - time, h * booked


@njit(forceinline=True)
def missing_time(times, rate):
    """Time for which a change acts but the weights of the step do not count it [s]; negative if they count it too long.

    It is reduced, because a node with storage soon balances the inflow. Without the reduction, a jump at a node that
    fills within a step would be corrected by more than it brings.
    times : result of `change_times`; rate : rate at which the node adopts the new pressure [1/s]
    """
    since, booked = times
    late = since - booked
    return late if rate * abs(late) < 1e-12 else -exp(-rate * booked) * expm1(-rate * late) / rate


@njit(forceinline=True)
def stores_inflow(tables, i):
    """True if node i has storage and stores its inflow now; patches, and tanks held at bottom or rim, do not."""
    node = tables.nodes[i]
    if node["kind"] == FIXED or node["kind"] == JUNCTION or node["kind"] == PATCH:
        return False
    k = EVENTS * node["row"]
    return node["kind"] != TANK or (tables.armed[k + BOTTOM] <= 0.0 and tables.armed[k + RIM] <= 0.0)


@njit(forceinline=True)
def filling_rate(tables, out, i, j):
    """Rate at which the pressure of node i, which has storage, adopts the pressure of the waves at node j [1/s]."""
    return stiffness_of(tables.nodes, tables.layout[0], out, i) * tables.nodes[j]["admittance"]


@njit(forceinline=True)
def correct_store(past, tables, y, out, pipe, i, flow, times):
    """Add the uncounted mass of a flow out of a delay line to node i, and subtract it from the line.

    The flow [kg/s] began within the step, so the weights of the step have not counted a part of it. Nothing is changed
    if the node does not store its inflow (`stores_inflow`). A
    change marks the step as corrected (past[CORRECTED_TIME] = NaN). pipe : row of the line's pipe
    out : values of the right-hand side after the jump; times : result of `change_times`
    """
    if flow != 0.0 and stores_inflow(tables, i):
        mass = flow * missing_time(times, filling_rate(tables, out, i, i))
        y[tables.nodes[i]["y"]] += mass
        y[pipe["y"]] -= mass
        past[CORRECTED_TIME] = NAN


@njit
def correct_columns(past, tables, y, i, change, times):
    """Correct the flow of each rigid column at node i for a pressure jump there within the step.

    The part of its effect that the weights of the step have not counted is added.
    change : jump of the pressure [Pa]; times : result of `change_times`. A correction marks the step as
    corrected (past[CORRECTED_TIME] = NaN).
    """
    columns = tables.columns
    for k in range(columns.size):
        side = (columns[k]["from_node"] == i) - (columns[k]["to_node"] == i)
        if side != 0 and change != 0.0:
            share, admittance = columns[k]["area"] / columns[k]["length"], tables.nodes[i]["admittance"]
            rate = share / admittance if admittance > 0.0 else 0.0
            y[columns[k]["y"]] += side * change * share * missing_time(times, rate)
            past[CORRECTED_TIME] = NAN


@njit
def correct_behind_valves(past, tables, y, spare, out, times):
    """Correct nodes with storage behind valves, and rigid columns, for a jump at nodes that are solved with valves.

    The mass added to these nodes is subtracted from all delay lines whose outflow into junctions the jump has changed,
    in proportion to the change.
    spare, out : values of the right-hand side before and after the jump; times : result of `change_times`
    """
    layout, valves, nodes = tables.layout[0], tables.valves, tables.nodes
    pressure, given, fed = layout["pressure"], 0.0, 0.0
    if tables.columns.size > 0:
        for i in range(nodes.size):
            correct_columns(past, tables, y, i, out[pressure + i] - spare[pressure + i], times)
    for k in range(valves.size):
        flow = out[layout["valve"] + k] - spare[layout["valve"] + k]
        for side in range(2):
            i, j = valves[k]["from_node"], valves[k]["to_node"]
            if side == 1:
                i, j, flow = j, i, -flow
            if flow != 0.0 and stores_inflow(tables, i):
                gain = -flow * missing_time(times, filling_rate(tables, out, i, j))
                y[nodes[i]["y"]] += gain
                given += gain
                past[CORRECTED_TIME] = NAN
    if given == 0.0:
        return
    for stage in range(2):  # sum of the flows out of lines; then each line's share
        for k in range(tables.delays.size):
            pipe = tables.pipes[tables.delays[k]["pipe"]]
            at = layout["ends"] + 4 * tables.delays[k]["pipe"]
            for side in range(2):
                if nodes[pipe["to_node"] if side == 1 else pipe["from_node"]]["kind"] != JUNCTION:
                    continue
                come = out[at + 1 + side] - spare[at + 1 + side]
                leaves = come - (out[at + 3 * side] - spare[at + 3 * side])
                if stage == 0:
                    fed += leaves
                elif fed != 0.0:
                    y[pipe["y"]] -= given * leaves / fed
