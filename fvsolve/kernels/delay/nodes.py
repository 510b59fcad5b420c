"""Jumps of delay lines at nodes: each at its own time, in order of arrival, with the values on both sides of it.

At a node with p' = sum / Y a jump is reflected and passed on at once. At a valve the nodes are solved again with the
jump. So a jump passes linear elements exactly, and nonlinear elements by the secant over the jump. In the tables used
for this (`sharp`) lines shorter than a step are treated like longer lines: a jump needs its travel time there too.
At nodes with instantaneous devices a step ends when a jump arrives. The left limit is recorded, then the jump is
admitted and events act (`admit_jumps`).
"""

from fvsolve.jit import njit
from fvsolve.kernels.calls import CLOSE, run
from fvsolve.kernels.delay.history import (
    ARRIVALS,
    ARRIVED,
    COUNT,
    FIRST,
    GREATEST,
    HELD,
    INFINITE,
    KNOWN_COUNT,
    KNOWN_TIME,
    MANY,
    MOST_LIVE,
    NEXT,
    QUEUE,
    SWING,
    jumps_at,
    queue_at,
    same_time,
    turn,
)
from fvsolve.kernels.delay.jumps import enough, first_left, keep, send, turned_back
from fvsolve.kernels.delay.lines import rubs
from fvsolve.kernels.delay.mend import mend, mend_behind, mend_columns, missed_by
from fvsolve.kernels.delay.passing import base_values, note_side
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import ALONE, JUNCTION

NAN = float("nan")
COARSE = (
    4.0  # multiple of the least jump above which a jump ends a step: about `numerics.delay_tolerance` of the greatest
)
MANY_JUMPS = 1e6  # jumps travelling at one time; with so many, only a jump as large as the greatest wave ends a step


@njit(forceinline=True)
def is_plain(tables, i):
    """True if a node is solved without others: p' is given, or it is the sum of the arriving waves over Y."""
    node = tables.nodes[i]
    return node["kind"] != JUNCTION or node["solve"] == ALONE


@njit(forceinline=True)
def end_of(line, side):
    """Number of the stretch at an end of a line; side : 0 `from`, 1 `to`."""
    return line["stretch"] + (line["stretches"] - 1 if side == 1 else 0)


@njit(forceinline=True)
def ends_step(past, tables, line, pipe, q, wave, size):
    """True if a jump of a wave of stretch q, or the part that friction reflects, ends a step when it arrives.

    It does so at nodes with instantaneous devices. After a small jump the device acts at the end of the step. The
    bound never decreases in a run: otherwise a jump to be passed on within a step would stay in the list.
    """
    acts = line["acts"]
    if acts == 0:
        return False
    least_in_crowd = past[MOST_LIVE] / MANY_JUMPS * max(past[GREATEST], past[SWING]) * pipe["admittance"]
    if abs(size) <= max(COARSE * enough(past, tables, pipe), least_in_crowd):
        return False
    first, last = q == 0 and acts % 2 == 1, q + 1 == line["stretches"] and acts >= 2
    return (first and (wave == 1 or rubs(pipe))) or (last and (wave == 0 or rubs(pipe)))


@njit
def next_arrival(past, places, tables, t):
    """Time of the next jump after t that ends a step [s]."""
    first_time, queue, after = INFINITE, int(past[QUEUE]), t + same_time(past)
    for number in range(tables.delays.size):
        line, pipe = tables.delays[number], tables.pipes[tables.delays[number]["pipe"]]
        if line["acts"] == 0:
            continue
        for q in range(0, line["stretches"], max(1, line["stretches"] - 1)):
            for wave in range(2):
                at = jumps_at(places, line["stretch"] + q, wave)
                times_at, first = queue_at(places, queue, at), int(past[at + FIRST])
                for i in range(int(past[at + ARRIVED]), int(past[at + MANY])):
                    place = times_at + turn(first + i, queue)
                    arrival, size = past[place] + line["tau"], past[place + queue]
                    if arrival > after and ends_step(past, tables, line, pipe, q, wave, size):
                        first_time = min(first_time, arrival)
                        break
    return first_time


@njit
def let_arrive(past, places, tables, t):
    """Let all jumps that end a step at t arrive; `detect_jumps` then computes the changes at nodes."""
    queue = int(past[QUEUE])
    for number in range(tables.delays.size):
        line, pipe = tables.delays[number], tables.pipes[tables.delays[number]["pipe"]]
        if line["acts"] == 0:
            continue
        for q in range(0, line["stretches"], max(1, line["stretches"] - 1)):
            for wave in range(2):
                s, place = line["stretch"] + q, first_left(past, places, line["stretch"] + q, wave)
                while place >= 0 and past[place] + line["tau"] <= t + same_time(past):
                    size = past[place + queue]
                    share = turned_back(past, places, tables, line, pipe, q, wave, size, t)
                    past[jumps_at(places, s, wave) + ARRIVED] += 1.0
                    for to in range(2):
                        onward = q + 1 if to == 0 else q - 1
                        if 0 <= onward < line["stretches"]:
                            part = size - share if to == wave else share
                            send(past, places, tables, line["stretch"] + onward, to, t, part, pipe)
                    place = first_left(past, places, s, wave)
    past[NEXT], past[KNOWN_TIME] = next_arrival(past, places, tables, t), NAN


@njit
def earliest(past, places, tables, t):
    """(line, stretch, wave, offset) of the jump that arrives first at an end of a line by t; line -1 without a jump."""
    best, result = t + same_time(past), (-1, 0, 0, -1)
    for number in range(tables.delays.size):
        line = tables.delays[number]
        for q in range(0, line["stretches"], max(1, line["stretches"] - 1)):
            for wave in range(2):
                place = first_left(past, places, line["stretch"] + q, wave)
                if place >= 0 and past[place] + line["tau"] <= best:
                    size = past[place + int(past[QUEUE])]
                    if not ends_step(past, tables, line, tables.pipes[line["pipe"]], q, wave, size):
                        best, result = past[place] + line["tau"], (number, q, wave, place)
    return result


@njit
def pass_at_ends(past, places, own, t, y, out, handle):
    """Pass on the jumps that arrive at the ends of lines up to t, in order; return True if there is a jump."""
    number, q, wave, place = earliest(past, places, own, t)
    if number < 0:
        return False
    sharp = own.sharp
    tables, size = open_tables(sharp), own.layout[0]["size"]
    state, queue = own.spare[:size], int(past[QUEUE])
    past[HELD], past[KNOWN_TIME] = 1.0, NAN
    run(CLOSE, t, y, y[:0], state, handle)
    past[HELD], past[KNOWN_TIME], past[KNOWN_COUNT] = 0.0, t, past[COUNT]
    for i in range(tables.delays.size):
        line, at = tables.delays[i], tables.layout[0]["ends"] + 4 * tables.delays[i]["pipe"]
        past[places[0] + ARRIVALS * end_of(line, 0)] = state[at + 1]
        past[places[0] + ARRIVALS * end_of(line, 1) + 1] = state[at + 2]
    base_values(t, y, state, handle)
    together = False  # True if a jump arrives with the jump before: the state between both never occurs
    while number >= 0:
        line, sent, jump = tables.delays[number], past[place], past[place + queue]
        time = min(sent + line["tau"], t)
        share = turned_back(past, places, tables, line, tables.pipes[line["pipe"]], q, wave, jump, t)
        past[jumps_at(places, line["stretch"] + q, wave) + ARRIVED] += 1.0
        times = missed_by(past, tables, t, time, sent)
        if not together:
            note_side(t, time, y, state, handle)
        closed = leave(past, places, tables, y, state, number, q, wave, time, jump - share, times)
        closed = leave(past, places, tables, y, state, number, q, 1 - wave, time, share, times) and closed
        if not closed:
            close_again(past, places, tables, t, y, state, sharp, time, times)
        number, q, wave, place = earliest(past, places, own, t)
        together = number >= 0 and past[place] + tables.delays[number]["tau"] <= time + same_time(past)
        if not together:
            note_side(t, time, y, state, handle)
    past[KNOWN_TIME] = NAN
    return True


@njit
def leave(past, places, tables, y, state, number, q, wave, time, size, times):
    """Pass a jump on from stretch q of a line, in the direction of a wave; False if nodes must be solved for it."""
    line, pipe = tables.delays[number], tables.pipes[tables.delays[number]["pipe"]]
    onward, side = q + 1 if wave == 0 else q - 1, 1 if wave == 0 else 0
    if size == 0.0:
        return True
    if 0 <= onward < line["stretches"]:
        send(past, places, tables, line["stretch"] + onward, wave, time, size, pipe)
        return True
    past[places[0] + ARRIVALS * end_of(line, side) + side] += size
    if not is_plain(tables, pipe["to_node"] if side == 1 else pipe["from_node"]):
        return False
    answer(past, places, tables, y, state, number, side, time, size, times)
    return True


@njit
def answer(past, places, tables, y, state, number, side, time, size, times):
    """Let a jump arrive at a node at an end of a line that is solved alone; times : see `change_times`."""
    line, pipe, layout = tables.delays[number], tables.pipes[tables.delays[number]["pipe"]], tables.layout[0]
    i = pipe["to_node"] if side == 1 else pipe["from_node"]
    node, at = tables.nodes[i], layout["ends"] + 4 * line["pipe"]
    state[at + 1 + side] += size
    if node["kind"] != JUNCTION:
        state[at + 3 * side] -= size
        send(past, places, tables, end_of(line, side), side, time, -size, pipe)
        mend(past, tables, y, state, pipe, i, 2.0 * size, times)
        return
    change = 2.0 * size / node["admittance"]
    state[layout["pressure"] + i] += change
    mend_columns(past, tables, y, i, change, times)
    for k in range(node["line_count"]):
        end = tables.integers[node["lines"] + k]
        other, right = tables.delays[end // 2], end % 2
        pipe = tables.pipes[other["pipe"]]
        part = pipe["admittance"] * change - (size if end == 2 * number + side else 0.0)
        state[layout["ends"] + 4 * other["pipe"] + 3 * right] += part
        send(past, places, tables, end_of(other, right), right, time, part, pipe)


@njit
def close_again(past, places, tables, t, y, state, sharp, time, times):
    """Solve the nodes with the waves that arrive now; store the differences of the sent waves as jumps."""
    layout, size = tables.layout[0], state.size
    solved = tables.spare[size : 2 * size]
    run(CLOSE, t, y, y[:0], solved, sharp)
    for i in range(tables.delays.size):
        line = tables.delays[i]
        pipe, at = tables.pipes[line["pipe"]], layout["ends"] + 4 * line["pipe"]
        for side in range(2):
            come = solved[at + 1 + side] - state[at + 1 + side]
            change = solved[at + 3 * side] - state[at + 3 * side]
            end = pipe["to_node"] if side == 1 else pipe["from_node"]
            mend(past, tables, y, solved, pipe, end, come - change, times)
            if abs(change) > enough(past, tables, pipe):
                keep(past, places, end_of(line, side), side, time, change, pipe)
    mend_behind(past, tables, y, state, solved, times)
    for i in range(size):
        state[i] = solved[i]
