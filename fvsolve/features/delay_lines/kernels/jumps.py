"""Jumps in delay lines: detection, storage, passage through friction and joints, and the states that they correct.

A jump is an instantaneous change of a wave by a schedule, a valve or an event. A jump below the size of `least_jump`
joins the smooth part of the wave. Friction in the middle of a stretch reflects the difference of the friction losses
with and without the jump.

The rates of a state change when a jump arrives within a step. The weights of the Runge-Kutta method count the new rate
for too short or too long a time. The missing part is added after the step, so that a jump is correct to second order;
it marks the step as corrected (past[CORRECTED_TIME] = NaN). The supply through nodes of given pressure is not
corrected, nor is the mass in delay lines, except for the mass that they give to nodes with storage. times : result of
`change_times`; other arguments are those of `wave_history`.
"""

from math import exp, expm1

from fvsolve.core.kernels.calls import CLOSE, run_job
from fvsolve.core.kernels.dtypes import AMENDED, FIXED, JUNCTION, PATCH, STATUS, TANK
from fvsolve.core.kernels.network_balance import stiffness_of
from fvsolve.core.kernels.tanks import BOTTOM, EVENTS, RIM
from fvsolve.features.delay_lines.kernels import wave_history as history
from fvsolve.features.delay_lines.kernels.line_rates import (
    friction_loss,
    has_friction,
    write_all_arrivals,
    write_arrivals,
)
from fvsolve.jit import njit

NOISE = 1e-13  # fraction of a wave of half a bar below which a change is rounding


@njit(forceinline=True)
def has_short_lines(tables):
    """True if the travel time of any delay line is shorter than the longest step."""
    for i in range(tables.delays.size):
        if tables.delays[i]["now"] > 0.0:
            return True
    return False


@njit(forceinline=True)
def least_jump(past, tables, pipe):
    """Size up to which a jump joins the smooth part of a wave of a pipe [kg/s].

    A quarter of `numerics.delay_tolerance` times the greatest jump or wave so far, and at least rounding.
    """
    least = tables.line_settings[0]["jumps"] * max(
        past[history.GREATEST_JUMP], past[history.GREATEST_WAVE]
    )
    return max(least, NOISE * 0.5e5) * pipe["admittance"]


@njit
def store_jump(past, places, s, wave, t, size, pipe):
    """Store a jump of a wave that enters stretch s at t; if the list is full, only update the greatest unstored jump.

    past[GREATEST_UNSTORED_JUMP] is the greatest pressure of the jumps that could not be stored [Pa].
    size : change of the wave [kg/s]
    """
    if not history.insert_jump(past, places, history.jump_head(places, s, wave), t, size):
        past[history.GREATEST_UNSTORED_JUMP] = max(
            past[history.GREATEST_UNSTORED_JUMP], abs(size) / pipe["admittance"]
        )


@njit
def store_large_jump(past, places, tables, s, wave, t, size, pipe):
    """Store a jump of a wave that enters stretch s at t, unless it is small.

    A jump up to the size of `least_jump` joins the smooth part of the wave.
    """
    if abs(size) > least_jump(past, tables, pipe):
        store_jump(past, places, s, wave, t, size, pipe)


@njit
def clear_changes(changes):
    """Prepare an array that collects the jumps of waves by jumps that arrive together, before they are stored.

    Four places for each line: the waves sent at its `from` end and its `to` end, the forward wave sent into its second
    stretch, the backward wave sent into its last but one. A place is INFINITE until something is added.
    changes : float64[8 lines + 1]  sums [kg/s], numbers of the places with sums, and their count
    """
    n = changes.size // 2
    for k in range(n):
        changes[k] = history.INFINITE
    changes[2 * n] = 0.0


@njit(forceinline=True)
def add_change(changes, place, size):
    """Add a change of a wave [kg/s] to a place of the array of `clear_changes`."""
    n = changes.size // 2
    if changes[place] == history.INFINITE:
        count = int(changes[2 * n])
        changes[n + count], changes[2 * n], changes[place] = place, count + 1.0, 0.0
    changes[place] += size


@njit
def send_changes(past, places, tables, changes, time):
    """Store the sums of `changes` as jumps sent at `time` [s], without small ones, and clear them (`clear_changes`)."""
    n = changes.size // 2
    for k in range(int(changes[2 * n])):
        place = int(changes[n + k])
        line, wave = tables.delays[place // 4], place % 2
        first = place % 4 // 2  # 0 at a node, 1 at a joint
        s = line["stretch"] + (line["stretches"] - 1 - first if wave == 1 else first)
        store_large_jump(
            past, places, tables, s, wave, time, changes[place], tables.pipes[line["pipe"]]
        )
        changes[place] = history.INFINITE
    changes[2 * n] = 0.0


@njit(forceinline=True)
def first_waiting_jump(past, places, s, wave):
    """Offset in `past` of the time of the oldest jump of a wave that has not left stretch s; -1 without such a jump."""
    at = history.jump_head(places, s, wave)
    waits = past[at + history.ARRIVED_COUNT] < past[at + history.JUMP_COUNT]
    return (
        history.jump_place(past, places, at, int(past[at + history.ARRIVED_COUNT])) if waits else -1
    )


@njit
def reflected_part(past, places, line, pipe, q, wave, size, t):
    """Part of a jump that friction in the middle of stretch q reflects [kg/s]; the jump is not yet passed on.

    size : change of the wave by the jump [kg/s]; t : end of the step in which it reaches the end of the stretch [s]
    """
    if not has_friction(pipe):
        return 0.0
    clock = history.reading_data(past, history.newest_before(past, t))
    head = history.jump_head(places, line["stretch"] + q, 0)
    # Friction acts on the waves that meet in the middle, with the jumps that passed there before.
    r, l = history.smooth_waves(past, places, clock, line, q, t - line["hold"])
    r += history.passed_jumps(past, places, head)
    l += history.passed_jumps(past, places, head + history.HEAD_SIZE)
    before = friction_loss(pipe, line, r, l)
    if wave == 0:
        return friction_loss(pipe, line, r + size, l) - before
    return before - friction_loss(pipe, line, r, l + size)


@njit(forceinline=True)
def next_to_leave(past, places, line, q, latest):
    """(arrival time of the next jump that leaves stretch q [s], its wave, its offset in `past`); INFINITE for none.

    Jumps that leave after `latest` are left out.
    """
    time = history.INFINITE
    first = 0
    at = -1
    for wave in range(2):
        place = first_waiting_jump(past, places, line["stretch"] + q, wave)
        arrival = (
            history.arrival_until(past[place], line["tau"], latest)
            if place >= 0
            else history.INFINITE
        )
        if arrival < time:
            time = arrival
            first = wave
            at = place
    return time, first, at


@njit
def pass_waiting_jumps(past, places, tables, line, q, t, latest, least):
    """Pass all jumps that leave stretch q by t on to the neighbouring stretches, in order, with their reflections.

    At an end of the line they only arrive. Jumps that leave together pass as one, whatever their wave. Small jumps join
    the smooth part (`least_jump`).
    latest : latest time of arrival [s]; least : earliest time at which a jump may enter the next stretch [s]
    """
    queue = int(past[history.JUMP_CAPACITY])
    pipe = tables.pipes[line["pipe"]]
    s = line["stretch"] + q
    time, wave, place = next_to_leave(past, places, line, q, latest)
    while time <= latest:
        when = max(min(time, t), least)
        until = min(latest, max(time, least) + history.time_tolerance(past))
        ahead, back = 0.0, 0.0
        while time <= until:
            size = past[place + queue]
            share = reflected_part(past, places, line, pipe, q, wave, size, t)
            past[history.jump_head(places, s, wave) + history.ARRIVED_COUNT] += 1.0
            # Friction reflects `share` of a forward jump; of a backward jump it is the part that goes ahead.
            ahead += share if wave == 1 else size - share
            back += share if wave == 0 else size - share
            time, wave, place = next_to_leave(past, places, line, q, latest)
        if q + 1 < line["stretches"]:
            store_large_jump(past, places, tables, s + 1, 0, when, ahead, pipe)
        if q > 0:
            store_large_jump(past, places, tables, s - 1, 1, when, back, pipe)


@njit
def pass_jumps_at_joints(past, places, tables, t):
    """Pass all jumps that leave inner stretches of delay lines by t on to the next stretches.

    Inner stretches are neither the first nor the last of their line.
    """
    latest = history.latest_arrival(past, t)
    for number in range(tables.delays.size):
        line = tables.delays[number]
        for q in range(1, line["stretches"] - 1):
            pass_waiting_jumps(past, places, tables, line, q, t, latest, -history.INFINITE)


@njit
def write_joint_arrivals(past, places, tables, t):
    """Write the waves that arrive at t at both ends of every stretch, and its friction loss, into `past`.

    See `write_arrivals`; at the ends of lines see `write_all_arrivals`.
    """
    write_all_arrivals(past, tables, t)
    clock = history.reading_data(past, history.newest_before(past, t))
    for i in range(tables.delays.size):
        line = tables.delays[i]
        for q in range(1, line["stretches"] - 1):
            write_arrivals(past, places, clock, line, tables.pipes[line["pipe"]], q, t)


@njit
def complete_short_arrivals(past, places, tables, t):
    """Write the arriving waves of delay lines shorter than a step, with the part of sent waves that arrives at once.

    They replace the waves by `write_arrivals`, which hold for zero pressure deviations at both ends. The part that
    arrives at once is computed from the waves in the last entry. t : time of that entry
    """
    newest = int(past[history.COUNT]) - 1
    clock = history.reading_data(past, newest)
    for i in range(tables.delays.size):
        line, beta = tables.delays[i], tables.delays[i]["now"]
        if beta > 0.0:
            ring, mask = history.ring_of(places, line, 0)
            u, v = history.smooth_waves(past, places, clock, line, 0, t - line["hold"])
            head = history.jump_head(places, line["stretch"], 0)
            r = history.arrived_until(past, places, clock, head, t, line["tau"])
            l = history.arrived_until(past, places, clock, head + history.HEAD_SIZE, t, line["tau"])
            delta = friction_loss(tables.pipes[line["pipe"]], line, u + r, v + l)
            at = ring + 2 * (newest & mask)
            arrivals = places[0] + history.ARRIVALS_SIZE * line["stretch"]
            past[arrivals] = v + beta * (past[at + 1] - v) + l + delta
            past[arrivals + 1] = u + beta * (past[at] - u) + r - delta


@njit(forceinline=True)
def last_sent_wave(past, places, line, q, wave, k):
    """Wave sent into stretch q of a delay line at entry k: its smooth part and all jumps so far [kg/s]."""
    ring, mask = history.ring_of(places, line, q)
    jumps = history.jump_head(places, line["stretch"] + q, wave)
    return past[ring + 2 * (k & mask) + wave] + history.jumps_until(
        past, places, jumps, history.INFINITE
    )


@njit
def waves_differ(past, places, tables, k, out):
    """True if the waves in `out` that nodes send now differ from those of entry k by more than rounding, or are NaN."""
    for i in range(tables.delays.size):
        line = tables.delays[i]
        pipe, at = tables.pipes[line["pipe"]], tables.layout[0]["ends"] + 4 * line["pipe"]
        for side in range(2):
            old = last_sent_wave(
                past, places, line, line["stretches"] - 1 if side == 1 else 0, side, k
            )
            if not abs(out[at + 3 * side] - old) <= NOISE * 0.5e5 * pipe["admittance"]:
                return True
    return False


@njit
def detect_jumps(past, places, tables, t, y, out, short):
    """Compare the waves that nodes send now with the last entry; store large differences as jumps, others in the entry.

    t : time of the last entry; out : values of the right-hand side now
    short : True to solve nodes again, with the waves of that entry in lines shorter than a step. A jump then sets
        out[STATUS] to AMENDED, because the state must be evaluated again.
    """
    k = int(past[history.COUNT]) - 1
    ends = tables.layout[0]["ends"]
    state = out
    # In short lines a part of a sent wave arrives at once, so nodes must be solved with it.
    if short:
        state = tables.spare[: tables.layout[0]["size"]]
        write_all_arrivals(past, tables, t)
        complete_short_arrivals(past, places, tables, t)
        past[history.ARRIVALS_TIME], past[history.ARRIVALS_COUNT] = t, past[history.COUNT]
        run_job(CLOSE, t, y, y[:0], state, tables.sharp)
        past[history.ARRIVALS_TIME] = history.NAN
    for stage in range(2):  # first the greatest jump, which the limit in `least_jump` needs
        for i in range(tables.delays.size):
            line = tables.delays[i]
            pipe, at = tables.pipes[line["pipe"]], ends + 4 * line["pipe"]
            for side in range(2):
                q, new = line["stretches"] - 1 if side == 1 else 0, state[at + 3 * side]
                old = last_sent_wave(past, places, line, q, side, k)
                if stage == 0:
                    past[history.GREATEST_JUMP] = max(
                        past[history.GREATEST_JUMP], abs(new - old) / pipe["admittance"]
                    )
                    continue
                if abs(new - old) > least_jump(past, tables, pipe):
                    store_jump(past, places, line["stretch"] + q, side, t, new - old, pipe)
                    if short:
                        past[history.CORRECTED_TIME], out[STATUS] = t, AMENDED
                history.write_entry(past, places, line, q, k, side, new)


# correction of states ----------


@njit(forceinline=True)
def change_times(past, tables, t, time, sent):
    """(time for which a change within a step acts, time for which the weights of the method count it) [s].

    Stages before the change do not include it. Stages after it include it as if it had always been there. No stage
    includes a jump that was sent since the last entry.
    t, time : end of the step, and time of the change; sent : time at which the jump was sent
    """
    if sent > history.time_of(past, int(past[history.COUNT]) - 1) + history.time_tolerance(past):
        return t - time, 0.0
    before, settings = history.time_of(past, int(past[history.COUNT]) - 1), tables.line_settings[0]
    h = t - before
    booked = 0.0
    at = settings["weights"]
    stages = settings["stages"]
    # A stage at or after the change has counted it with its weight for the whole step.
    for i in range(stages):
        if before + tables.floats[at + stages + i] * h >= time - history.time_tolerance(past):
            booked += tables.floats[at + i]
    return t - time, h * booked


@njit(forceinline=True)
def missing_time(times, rate):
    """Time for which a change acts but the weights of the step do not count it [s]; negative if they count it too long.

    It is reduced, because a node with storage soon balances the inflow. Without the reduction, a jump at a node that
    fills within a step would be corrected by more than it brings.
    rate : rate at which the node adopts the new pressure [1/s]
    """
    since, booked = times
    late = since - booked
    # Integral of exp(-rate t) from the counted time to the time since the change.
    return late if rate * abs(late) < 1e-12 else -exp(-rate * booked) * expm1(-rate * late) / rate


@njit(forceinline=True)
def stores_inflow(tables, i):
    """True if node i has storage and stores its inflow now; patches, and tanks held at bottom or rim, do not."""
    node = tables.nodes[i]
    if node["kind"] == FIXED or node["kind"] == JUNCTION or node["kind"] == PATCH:
        return False
    k = EVENTS * node["row"]
    return node["kind"] != TANK or (
        tables.armed[k + BOTTOM] <= 0.0 and tables.armed[k + RIM] <= 0.0
    )


@njit(forceinline=True)
def filling_rate(tables, out, i, j):
    """Rate at which the pressure of node i, which has storage, adopts the pressure of the waves at node j [1/s]."""
    return stiffness_of(tables.nodes, tables.layout[0], out, i) * tables.nodes[j]["admittance"]


@njit(forceinline=True)
def correct_store(past, tables, y, out, pipe, i, flow, times):
    """Add the uncounted mass of a flow out of a delay line to node i, and subtract it from the line.

    The flow [kg/s] began within the step, so the weights of the step have not counted a part of it. Nothing is changed
    if the node does not store its inflow (`stores_inflow`).
    out : values of the right-hand side after the jump
    """
    if flow != 0.0 and stores_inflow(tables, i):
        mass = flow * missing_time(times, filling_rate(tables, out, i, i))
        y[tables.nodes[i]["y"]] += mass
        y[pipe["y"]] -= mass
        past[history.CORRECTED_TIME] = history.NAN


@njit
def correct_columns(past, tables, y, i, change, times):
    """Correct the flow of each rigid column at node i for a pressure jump there within the step.

    The part of its effect that the weights of the step have not counted is added. change : jump of the pressure [Pa]
    """
    columns = tables.columns
    for k in range(columns.size):
        side = 1 * (columns[k]["from_node"] == i) - 1 * (columns[k]["to_node"] == i)
        if side != 0 and change != 0.0:
            share = columns[k]["area"] / columns[k]["length"]
            admittance = tables.nodes[i]["admittance"]
            # The pressure relaxes as the flow of the column changes, against the admittance of pipes.
            rate = share / admittance if admittance > 0.0 else 0.0
            y[columns[k]["y"]] += side * change * share * missing_time(times, rate)
            past[history.CORRECTED_TIME] = history.NAN


@njit
def correct_behind_valves(past, tables, y, spare, out, times):
    """Correct nodes with storage behind valves, and rigid columns, for a jump at nodes that are solved with valves.

    The mass added to these nodes is subtracted from all delay lines whose outflow into junctions the jump has changed,
    in proportion to the change.
    spare, out : values of the right-hand side before and after the jump
    """
    layout = tables.layout[0]
    valves = tables.valves
    nodes = tables.nodes
    pressure = layout["pressure"]
    given = 0.0
    fed = 0.0
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
                past[history.CORRECTED_TIME] = history.NAN
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
