"""Jumps of delay lines at nodes: each at its own time, in their order, with the values on both sides of it.

A node that p' = sum / Y closes answers at once. Where a valve decides, nodes are closed again with the jump: so a jump
travels exactly through what is linear, and by its own secant through what is not. Lines shorter than a step stand as
all others in the tables that are closed here (`sharp`), for what is a jump takes its own time in them too.
Where something acts at once, a step ends as a jump arrives: its left limit is recorded, then it is let in and events
act (`let_arrive`).
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
COARSE = 4.0  # of the least jump that is kept: so `numerics.accuracy` of the greatest jump, and of the greatest wave
MANY_JUMPS = 1e6  # on their way at once: of so many only the greatest wave ends a step, of fewer a share of it


@njit(forceinline=True)
def is_plain(tables, i):
    """True if a node answers a wave by itself: p' is given, or the sum of what arrives over Y."""
    node = tables.nodes[i]
    return node["kind"] != JUNCTION or node["solve"] == ALONE


@njit(forceinline=True)
def end_of(line, side):
    """The stretch at an end of a line."""
    return line["stretch"] + (line["stretches"] - 1 if side == 1 else 0)


@njit(forceinline=True)
def ends_step(past, tables, line, pipe, q, wave, size):
    """True if a jump of a wave of stretch q, or what friction turns back of it, ends a step as it arrives.

    So it does where something acts at once. A small one, which could as well be smoothed, lets such a device act when
    the step has been taken. The bound never falls in a run: a jump that was to be passed on within a step would stay.
    """
    acts = line["acts"]
    if acts == 0:
        return False
    among_many = past[MOST_LIVE] / MANY_JUMPS * max(past[GREATEST], past[SWING]) * pipe["admittance"]
    if abs(size) <= max(COARSE * enough(past, tables, pipe), among_many):
        return False
    first, last = q == 0 and acts % 2 == 1, q + 1 == line["stretches"] and acts >= 2
    return (first and (wave == 1 or rubs(pipe))) or (last and (wave == 0 or rubs(pipe)))


@njit
def next_arrival(past, places, tables, t):
    """Time of the next jump behind t that ends a step [s]."""
    found, queue, behind = INFINITE, int(past[QUEUE]), t + same_time(past)
    for which in range(tables.delays.size):
        line, pipe = tables.delays[which], tables.pipes[tables.delays[which]["pipe"]]
        if line["acts"] == 0:
            continue
        for q in range(0, line["stretches"], max(1, line["stretches"] - 1)):
            for wave in range(2):
                at = jumps_at(places, line["stretch"] + q, wave)
                times, first = queue_at(places, queue, at), int(past[at + FIRST])
                for i in range(int(past[at + ARRIVED]), int(past[at + MANY])):
                    place = times + turn(first + i, queue)
                    when, size = past[place] + line["tau"], past[place + queue]
                    if when > behind and ends_step(past, tables, line, pipe, q, wave, size):
                        found = min(found, when)
                        break
    return found


@njit
def let_arrive(past, places, tables, t):
    """Let all jumps that end a step at t arrive; what they change at nodes is found by `note_jumps`."""
    queue = int(past[QUEUE])
    for which in range(tables.delays.size):
        line, pipe = tables.delays[which], tables.pipes[tables.delays[which]["pipe"]]
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
    """(line, stretch, wave, place) of the jump at the ends of lines that arrives first, by t; line -1 without one."""
    best, found = t + same_time(past), (-1, 0, 0, -1)
    for which in range(tables.delays.size):
        line = tables.delays[which]
        for q in range(0, line["stretches"], max(1, line["stretches"] - 1)):
            for wave in range(2):
                place = first_left(past, places, line["stretch"] + q, wave)
                if place >= 0 and past[place] + line["tau"] <= best:
                    size = past[place + int(past[QUEUE])]
                    if not ends_step(past, tables, line, tables.pipes[line["pipe"]], q, wave, size):
                        best, found = past[place] + line["tau"], (which, q, wave, place)
    return found


@njit
def pass_at_ends(past, places, own, t, y, out, handle):
    """Pass on the jumps that arrive at the ends of lines by t, in order; True if there is one."""
    which, q, wave, place = earliest(past, places, own, t)
    if which < 0:
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
    together = False  # with the jump before: what lies between both is never seen
    while which >= 0:
        line, sent, jump = tables.delays[which], past[place], past[place + queue]
        when = min(sent + line["tau"], t)
        share = turned_back(past, places, tables, line, tables.pipes[line["pipe"]], q, wave, jump, t)
        past[jumps_at(places, line["stretch"] + q, wave) + ARRIVED] += 1.0
        missed = missed_by(past, tables, t, when, sent)
        if not together:
            note_side(t, when, y, state, handle)
        closed = leave(past, places, tables, y, state, which, q, wave, when, jump - share, missed)
        closed = leave(past, places, tables, y, state, which, q, 1 - wave, when, share, missed) and closed
        if not closed:
            close_again(past, places, tables, t, y, state, sharp, when, missed)
        which, q, wave, place = earliest(past, places, own, t)
        together = which >= 0 and past[place] + tables.delays[which]["tau"] <= when + same_time(past)
        if not together:
            note_side(t, when, y, state, handle)
    past[KNOWN_TIME] = NAN
    return True


@njit
def leave(past, places, tables, y, state, which, q, wave, when, size, missed):
    """A jump leaves stretch q of a line in the way of a wave; False if nodes are to be closed for it."""
    line, pipe = tables.delays[which], tables.pipes[tables.delays[which]["pipe"]]
    onward, side = q + 1 if wave == 0 else q - 1, 1 if wave == 0 else 0
    if size == 0.0:
        return True
    if 0 <= onward < line["stretches"]:
        send(past, places, tables, line["stretch"] + onward, wave, when, size, pipe)
        return True
    past[places[0] + ARRIVALS * end_of(line, side) + side] += size
    if not is_plain(tables, pipe["to_node"] if side == 1 else pipe["from_node"]):
        return False
    answer(past, places, tables, y, state, which, side, when, size, missed)
    return True


@njit
def answer(past, places, tables, y, state, which, side, when, size, missed):
    """A jump arrives at the plain node at an end of a line; missed : see `missed_by`."""
    line, pipe, layout = tables.delays[which], tables.pipes[tables.delays[which]["pipe"]], tables.layout[0]
    i = pipe["to_node"] if side == 1 else pipe["from_node"]
    node, at = tables.nodes[i], layout["ends"] + 4 * line["pipe"]
    state[at + 1 + side] += size
    if node["kind"] != JUNCTION:
        state[at + 3 * side] -= size
        send(past, places, tables, end_of(line, side), side, when, -size, pipe)
        mend(past, tables, y, state, pipe, i, 2.0 * size, missed)
        return
    change = 2.0 * size / node["admittance"]
    state[layout["pressure"] + i] += change
    mend_columns(past, tables, y, i, change, missed)
    for k in range(node["line_count"]):
        end = tables.integers[node["lines"] + k]
        other, right = tables.delays[end // 2], end % 2
        pipe = tables.pipes[other["pipe"]]
        part = pipe["admittance"] * change - (size if end == 2 * which + side else 0.0)
        state[layout["ends"] + 4 * other["pipe"] + 3 * right] += part
        send(past, places, tables, end_of(other, right), right, when, part, pipe)


@njit
def close_again(past, places, tables, t, y, state, sharp, when, missed):
    """Close the nodes with what arrives now; what all lines are sent differs by the jump that is passed on."""
    layout, size = tables.layout[0], state.size
    found = tables.spare[size : 2 * size]
    run(CLOSE, t, y, y[:0], found, sharp)
    for i in range(tables.delays.size):
        line = tables.delays[i]
        pipe, at = tables.pipes[line["pipe"]], layout["ends"] + 4 * line["pipe"]
        for side in range(2):
            come = found[at + 1 + side] - state[at + 1 + side]
            change = found[at + 3 * side] - state[at + 3 * side]
            end = pipe["to_node"] if side == 1 else pipe["from_node"]
            mend(past, tables, y, found, pipe, end, come - change, missed)
            if abs(change) > enough(past, tables, pipe):
                keep(past, places, end_of(line, side), side, when, change, pipe)
    mend_behind(past, tables, y, state, found, missed)
    for i in range(size):
        state[i] = found[i]
