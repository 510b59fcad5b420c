"""Jumps of delay lines at nodes: each at its own time, in order of arrival, with the values on both sides of it.

At a junction of pipes only, the pressure is twice the sum of the arriving waves over the sum of the admittances, so a
jump is reflected and passed on at once. At a valve the nodes are solved again with the jump. So a jump passes linear
elements exactly, and nonlinear elements by the secant over the jump. The tables `sharp` serve this purpose: there,
lines shorter than a step are treated like longer lines, so that a jump needs its travel time in them too. At nodes with
instantaneous devices a step ends when a large jump arrives (`ends_step`). The state just before is recorded, then the
jump is admitted (`admit_jumps`) and events act.

q : stretch within its line; wave : 0 forward, 1 backward; side : 0 end at `from`, 1 end at `to`; line, pipe : row of a
delay line and of its pipe; places : result of `offsets_of`; state : values of the right-hand side at the end of the
step, with the jumps that have arrived so far.
"""

from fvsolve.jit import njit
from fvsolve.kernels.calls import CLOSE, run_job
from fvsolve.kernels.delay_lines.extremes_at_jumps import extremes_at_jump, store_smooth_values
from fvsolve.kernels.delay_lines.jump_correction import (
    change_times,
    correct_behind_valves,
    correct_columns,
    correct_store,
)
from fvsolve.kernels.delay_lines.jumps import (
    first_waiting_jump,
    least_jump,
    reflected_part,
    store_jump,
    store_large_jump,
)
from fvsolve.kernels.delay_lines.line_rates import has_friction
from fvsolve.kernels.delay_lines.wave_history import (
    ARRIVALS_COUNT,
    ARRIVALS_SIZE,
    ARRIVALS_TIME,
    ARRIVED_COUNT,
    COUNT,
    FIRST_JUMP,
    GREATEST_JUMP,
    GREATEST_WAVE,
    INFINITE,
    JUMP_CAPACITY,
    JUMP_COUNT,
    MOST_JUMPS_TRAVELLING,
    NEXT_ARRIVAL,
    ONLY_PASSED_JUMPS,
    jump_head,
    jump_list,
    time_tolerance,
    wrap_index,
)
from fvsolve.kernels.dtypes import ALONE, JUNCTION
from fvsolve.kernels.table_handle import open_tables

NAN = float("nan")
STEP_END_FACTOR = (
    4.0  # multiple of the least jump above which a jump ends a step: about `numerics.delay_tolerance` of the greatest
)
CROWDED_COUNT = 1e6  # jumps travelling at one time; with so many, only a jump as large as the greatest wave ends a step


@njit(forceinline=True)
def solved_alone(tables, i):
    """True if node i is solved without other nodes.

    Its pressure is then given by a state or schedule, or follows from arriving waves, known flows and its admittance.
    """
    node = tables.nodes[i]
    return node["kind"] != JUNCTION or node["solve"] == ALONE


@njit(forceinline=True)
def end_stretch(line, side):
    """Stretch at an end of a delay line, counted over all lines; side : 0 `from`, 1 `to`."""
    return line["stretch"] + (line["stretches"] - 1 if side == 1 else 0)


@njit(forceinline=True)
def ends_step(past, tables, line, pipe, q, wave, size):
    """True if a step ends when a jump of stretch q, or the part of it that friction reflects, leaves the stretch.

    The step ends if the jump arrives at a node with an instantaneous device and is large; after a small jump the device
    acts at the end of the step. The least size of a large jump never decreases in a run: otherwise a jump to be passed
    on within a step would stay in the list.
    q : stretch within the line; wave : 0 forward, 1 backward; size : change of the wave [kg/s]
    """
    acts = line["acts"]
    if acts == 0:
        return False
    least_in_crowd = (
        past[MOST_JUMPS_TRAVELLING] / CROWDED_COUNT * max(past[GREATEST_JUMP], past[GREATEST_WAVE]) * pipe["admittance"]
    )
    if abs(size) <= max(STEP_END_FACTOR * least_jump(past, tables, pipe), least_in_crowd):
        return False
    first, last = q == 0 and acts % 2 == 1, q + 1 == line["stretches"] and acts >= 2
    return (first and (wave == 1 or has_friction(pipe))) or (last and (wave == 0 or has_friction(pipe)))


@njit
def next_arrival(past, places, tables, t):
    """Arrival time of the next jump after t that ends a step (`ends_step`) [s]; INFINITE for none."""
    first_time, queue, after = INFINITE, int(past[JUMP_CAPACITY]), t + time_tolerance(past)
    for number in range(tables.delays.size):
        line, pipe = tables.delays[number], tables.pipes[tables.delays[number]["pipe"]]
        if line["acts"] == 0:
            continue
        for q in range(0, line["stretches"], max(1, line["stretches"] - 1)):
            for wave in range(2):
                at = jump_head(places, line["stretch"] + q, wave)
                times_at, first = jump_list(places, queue, at), int(past[at + FIRST_JUMP])
                for i in range(int(past[at + ARRIVED_COUNT]), int(past[at + JUMP_COUNT])):
                    place = times_at + wrap_index(first + i, queue)
                    arrival, size = past[place] + line["tau"], past[place + queue]
                    if arrival > after and ends_step(past, tables, line, pipe, q, wave, size):
                        first_time = min(first_time, arrival)
                        break
    return first_time


@njit
def admit_jumps(past, places, tables, t):
    """Let the jumps that end a step at t arrive; `detect_jumps` then computes the changes at nodes.

    Their parts that stay in the line, transmitted or reflected, enter the neighbouring stretches. past[NEXT_ARRIVAL]
    receives the time of the following such jump.
    """
    queue = int(past[JUMP_CAPACITY])
    for number in range(tables.delays.size):
        line, pipe = tables.delays[number], tables.pipes[tables.delays[number]["pipe"]]
        if line["acts"] == 0:
            continue
        for q in range(0, line["stretches"], max(1, line["stretches"] - 1)):
            for wave in range(2):
                s, place = line["stretch"] + q, first_waiting_jump(past, places, line["stretch"] + q, wave)
                while place >= 0 and past[place] + line["tau"] <= t + time_tolerance(past):
                    size = past[place + queue]
                    share = reflected_part(past, places, tables, line, pipe, q, wave, size, t)
                    past[jump_head(places, s, wave) + ARRIVED_COUNT] += 1.0
                    for to in range(2):
                        onward = q + 1 if to == 0 else q - 1
                        if 0 <= onward < line["stretches"]:
                            part = size - share if to == wave else share
                            store_large_jump(past, places, tables, line["stretch"] + onward, to, t, part, pipe)
                    place = first_waiting_jump(past, places, s, wave)
    past[NEXT_ARRIVAL], past[ARRIVALS_TIME] = next_arrival(past, places, tables, t), NAN


@njit
def earliest_jump(past, places, tables, t):
    """Jump that is the first to leave a first or last stretch of a delay line by t.

    Returns (line, stretch within the line, wave, offset of its time in `past`); the line is -1 without a jump. Jumps
    that end a step (`ends_step`) are left out.
    """
    best, result = t + time_tolerance(past), (-1, 0, 0, -1)
    for number in range(tables.delays.size):
        line = tables.delays[number]
        for q in range(0, line["stretches"], max(1, line["stretches"] - 1)):
            for wave in range(2):
                place = first_waiting_jump(past, places, line["stretch"] + q, wave)
                if place >= 0 and past[place] + line["tau"] <= best:
                    size = past[place + int(past[JUMP_CAPACITY])]
                    if not ends_step(past, tables, line, tables.pipes[line["pipe"]], q, wave, size):
                        best, result = past[place] + line["tau"], (number, q, wave, place)
    return result


@njit
def pass_jumps_at_ends(past, places, own, t, y, out, handle):
    """Pass on the jumps that leave first and last stretches of delay lines up to t, in order; return True if any do.

    Extremes are updated by the values beside each jump. Masses of storing nodes and lines and flows of columns in y are
    corrected (`jump_correction`). Jumps that end a step are left out.
    own : tables of the run, in which short lines couple their ends at once
    past, places : wave history, and result of `offsets_of`
    """
    number, q, wave, place = earliest_jump(past, places, own, t)
    if number < 0:
        return False
    sharp = own.sharp
    tables, size = open_tables(sharp), own.layout[0]["size"]
    state, queue = own.spare[:size], int(past[JUMP_CAPACITY])
    past[ONLY_PASSED_JUMPS], past[ARRIVALS_TIME] = 1.0, NAN
    run_job(CLOSE, t, y, y[:0], state, handle)
    past[ONLY_PASSED_JUMPS], past[ARRIVALS_TIME], past[ARRIVALS_COUNT] = 0.0, t, past[COUNT]
    for i in range(tables.delays.size):
        line, at = tables.delays[i], tables.layout[0]["ends"] + 4 * tables.delays[i]["pipe"]
        past[places[0] + ARRIVALS_SIZE * end_stretch(line, 0)] = state[at + 1]
        past[places[0] + ARRIVALS_SIZE * end_stretch(line, 1) + 1] = state[at + 2]
    store_smooth_values(t, y, state, handle)
    together = False  # True if a jump arrives with the jump before: the state between both never occurs
    while number >= 0:
        line, sent, jump = tables.delays[number], past[place], past[place + queue]
        time = min(sent + line["tau"], t)
        share = reflected_part(past, places, tables, line, tables.pipes[line["pipe"]], q, wave, jump, t)
        past[jump_head(places, line["stretch"] + q, wave) + ARRIVED_COUNT] += 1.0
        times = change_times(past, tables, t, time, sent)
        if not together:
            extremes_at_jump(t, time, y, state, handle)
        closed = leave_stretch(past, places, tables, y, state, number, q, wave, time, jump - share, times)
        closed = leave_stretch(past, places, tables, y, state, number, q, 1 - wave, time, share, times) and closed
        if not closed:
            solve_nodes_again(past, places, tables, t, y, state, sharp, time, times)
        number, q, wave, place = earliest_jump(past, places, own, t)
        together = number >= 0 and past[place] + tables.delays[number]["tau"] <= time + time_tolerance(past)
        if not together:
            extremes_at_jump(t, time, y, state, handle)
    past[ARRIVALS_TIME] = NAN
    return True


@njit
def leave_stretch(past, places, tables, y, state, number, q, wave, time, size, times):
    """Pass a jump on from stretch q of a delay line, in the direction of a wave; False if nodes must be solved for it.

    At an end of the line it is added to the arriving wave in `past`; a node that is solved alone then responds, see
    `enter_plain_node`, which defines the other arguments. wave : 0 forward, 1 backward
    """
    line, pipe = tables.delays[number], tables.pipes[tables.delays[number]["pipe"]]
    onward, side = q + 1 if wave == 0 else q - 1, 1 if wave == 0 else 0
    if size == 0.0:
        return True
    if 0 <= onward < line["stretches"]:
        store_large_jump(past, places, tables, line["stretch"] + onward, wave, time, size, pipe)
        return True
    past[places[0] + ARRIVALS_SIZE * end_stretch(line, side) + side] += size
    if not solved_alone(tables, pipe["to_node"] if side == 1 else pipe["from_node"]):
        return False
    enter_plain_node(past, places, tables, y, state, number, side, time, size, times)
    return True


@njit
def enter_plain_node(past, places, tables, y, state, number, side, time, size, times):
    """Let a jump arrive at an end of a delay line, at a node that is solved alone: the node sends jumps at once.

    y : states, corrected; state : values of the right-hand side at the end of the step, updated
    number : number of the line; side : 0 end at `from`, 1 at `to`; size : change of the wave [kg/s]
    time : arrival time [s]; times : result of `change_times`; past, places : wave history, result of `offsets_of`
    """
    line, pipe, layout = tables.delays[number], tables.pipes[tables.delays[number]["pipe"]], tables.layout[0]
    i = pipe["to_node"] if side == 1 else pipe["from_node"]
    node, at = tables.nodes[i], layout["ends"] + 4 * line["pipe"]
    state[at + 1 + side] += size
    if node["kind"] != JUNCTION:
        state[at + 3 * side] -= size
        store_large_jump(past, places, tables, end_stretch(line, side), side, time, -size, pipe)
        correct_store(past, tables, y, state, pipe, i, 2.0 * size, times)
        return
    change = 2.0 * size / node["admittance"]
    state[layout["pressure"] + i] += change
    correct_columns(past, tables, y, i, change, times)
    for k in range(node["line_count"]):
        end = tables.integers[node["lines"] + k]
        other, right = tables.delays[end // 2], end % 2
        pipe = tables.pipes[other["pipe"]]
        part = pipe["admittance"] * change - (size if end == 2 * number + side else 0.0)
        state[layout["ends"] + 4 * other["pipe"] + 3 * right] += part
        store_large_jump(past, places, tables, end_stretch(other, right), right, time, part, pipe)


@njit
def solve_nodes_again(past, places, tables, t, y, state, sharp, time, times):
    """Solve the nodes with the waves that arrive now; store large changes of the waves that they send as jumps.

    y : states, corrected; state : values of the right-hand side before the jump, replaced by the solution
    sharp : handle, see the module; time : arrival time of the jump [s]; times : result of `change_times`
    past, places : wave history, and result of `offsets_of`
    """
    layout, size = tables.layout[0], state.size
    solved = tables.spare[size : 2 * size]
    run_job(CLOSE, t, y, y[:0], solved, sharp)
    for i in range(tables.delays.size):
        line = tables.delays[i]
        pipe, at = tables.pipes[line["pipe"]], layout["ends"] + 4 * line["pipe"]
        for side in range(2):
            come = solved[at + 1 + side] - state[at + 1 + side]
            change = solved[at + 3 * side] - state[at + 3 * side]
            end = pipe["to_node"] if side == 1 else pipe["from_node"]
            correct_store(past, tables, y, solved, pipe, end, come - change, times)
            if abs(change) > least_jump(past, tables, pipe):
                store_jump(past, places, end_stretch(line, side), side, time, change, pipe)
    correct_behind_valves(past, tables, y, state, solved, times)
    for i in range(size):
        state[i] = solved[i]
