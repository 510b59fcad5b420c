"""What delay lines remember of an accepted state, and how jumps are passed on. Knows the tables; closes no node itself.

A jump that arrives within a step is passed on at its own time, without ending the step. A node that p' = sum / Y closes
answers at once; where a valve, a cluster or a short line decides, nodes are closed a second time without the jump, and
what differs was passed on. So a jump travels exactly through what is linear, and by its own secant through what is not.
"""

from fvsolve.jit import njit
from fvsolve.kernels.calls import CLOSE, run
from fvsolve.kernels.delay.along import sketch
from fvsolve.kernels.delay.history import (
    ARRIVALS,
    ARRIVED,
    COUNT,
    CROWDED,
    FIRST,
    GREATEST,
    HEADS,
    KNOWN_TIME,
    LIVE,
    MANY,
    MENDED,
    QUEUE,
    begin_entry,
    clock_of,
    forget_jumps,
    jumps_at,
    jumps_until,
    newest_before,
    places_of,
    push_jump,
    queue_at,
    read_both,
    ring_of,
    same_time,
    time_of,
)
from fvsolve.kernels.delay.lines import arrive, arrive_all, drag_and_slope, rubbed
from fvsolve.kernels.delay.mend import mend, mend_behind, mend_columns, missed_by
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.observer import note
from fvsolve.kernels.records import ALONE, AMENDED, JUNCTION, STATUS

INFINITE, NAN = 1e300, float("nan")
NOISE = 1e-13  # of half a bar's wave: a jump that is rounding


@njit(forceinline=True)
def enough(past, tables, pipe):
    """The least jump of a wave that is kept as one [kg/s]."""
    return max(tables.settings[0]["jumps"] * past[GREATEST], NOISE * 0.5e5) * pipe["admittance"]


@njit
def keep(past, places, s, wave, t, size, pipe):
    """A jump that enters stretch s is kept as one, if there is room for it."""
    if not push_jump(past, places, jumps_at(places, s, wave), t, size):
        past[CROWDED] = max(past[CROWDED], abs(size) / pipe["admittance"])


@njit
def send(past, places, tables, s, wave, t, size, pipe):
    """A jump enters stretch s; a small one joins the smooth part."""
    if abs(size) > enough(past, tables, pipe):
        keep(past, places, s, wave, t, size, pipe)


@njit(forceinline=True)
def is_plain(tables, i):
    """Whether a node answers a wave by itself: p' is given, or the sum of what arrives over Y."""
    node = tables.nodes[i]
    return node["kind"] != JUNCTION or node["solve"] == ALONE


@njit(forceinline=True)
def end_of(line, side):
    """The stretch at an end of a line."""
    return line["stretch"] + (line["stretches"] - 1 if side == 1 else 0)


@njit
def meet(past, places, tables, y, which, side, t, size, missed):
    """A jump of a line arrives at the plain node at one of its ends; missed : see `missed_by`."""
    line, pipe = tables.delays[which], tables.pipes[tables.delays[which]["pipe"]]
    i = pipe["to_node"] if side == 1 else pipe["from_node"]
    node = tables.nodes[i]
    if node["kind"] != JUNCTION:
        send(past, places, tables, end_of(line, side), side, t, -size, pipe)
        mend(past, tables, y, pipe, i, 2.0 * size, missed)
        return
    change = 2.0 * size / node["admittance"]
    mend_columns(past, tables, y, i, change, missed)
    for k in range(node["line_count"]):
        end = tables.integers[node["lines"] + k]
        other, right = tables.delays[end // 2], end % 2
        pipe = tables.pipes[other["pipe"]]
        own = size if end == 2 * which + side else 0.0
        send(past, places, tables, end_of(other, right), right, t, pipe["admittance"] * change - own, pipe)


@njit
def enter(past, places, tables, y, which, q, wave, t, size, missed):
    """A jump of a wave leaves stretch q of a line: into the next one, or to the node there."""
    line = tables.delays[which]
    onward = q + 1 if wave == 0 else q - 1
    if 0 <= onward < line["stretches"]:
        send(past, places, tables, line["stretch"] + onward, wave, t, size, tables.pipes[line["pipe"]])
    elif abs(size) > 0.0:
        meet(past, places, tables, y, which, 1 if wave == 0 else 0, t, size, missed)


@njit
def pass_by_closing(past, places, tables, t, y, out, handle, place, when, missed):
    """Close the nodes without the jump at a place of the list; what all lines are sent differs by what it passes on."""
    queue, spare, layout = int(past[QUEUE]), tables.spare, tables.layout[0]
    size = past[place + queue]
    past[place + queue], past[KNOWN_TIME] = 0.0, NAN
    run(CLOSE, t, y, y[:0], spare, handle)
    past[place + queue], past[KNOWN_TIME] = size, NAN
    for i in range(tables.delays.size):
        line = tables.delays[i]
        pipe, at = tables.pipes[line["pipe"]], layout["ends"] + 4 * line["pipe"]
        for side in range(2):
            come = out[at + 1 + side] - spare[at + 1 + side]
            change = out[at + 3 * side] - spare[at + 3 * side]
            mend(past, tables, y, pipe, pipe["to_node"] if side == 1 else pipe["from_node"], come - change, missed)
            if abs(change) > enough(past, tables, pipe):
                keep(past, places, end_of(line, side), side, when, change, pipe)
    mend_behind(past, tables, y, out, missed)


@njit
def pass_jumps(past, places, tables, t, y, out, handle):
    """All jumps that arrive at the ends of their stretches by t."""
    for which in range(tables.delays.size):
        for q in range(tables.delays[which]["stretches"]):
            for wave in range(2):
                at = jumps_at(places, tables.delays[which]["stretch"] + q, wave)
                while past[at + ARRIVED] < past[at + MANY]:
                    if not passed(past, places, tables, which, q, wave, at, t, y, out, handle):
                        break


@njit
def passed(past, places, tables, which, q, wave, at, t, y, out, handle):
    """Pass on the first jump of a wave that has not arrived, if it does by t; whether it did. at : their head."""
    line, queue = tables.delays[which], int(past[QUEUE])
    pipe = tables.pipes[line["pipe"]]
    place = queue_at(places, queue, at) + (int(past[at + FIRST]) + int(past[at + ARRIVED])) % queue
    if past[place] > t - line["hold"] + same_time(past):
        return False
    past[at + ARRIVED] += 1.0
    when, size = min(past[place] + line["hold"], t), past[place + queue]
    ahead, back = q + 1 == line["stretches"], q == 0
    far = pipe["to_node"] if wave == 0 else pipe["from_node"]
    near = pipe["from_node"] if wave == 0 else pipe["to_node"]
    leaves, returns = (ahead, back) if wave == 0 else (back, ahead)
    plain = not (leaves and not is_plain(tables, far)) and not (returns and not is_plain(tables, near))
    share, missed = size * rubs(past, places, tables, line, pipe, q, t), missed_by(past, tables, t, when)
    if line["now"] == 0.0 and plain:
        enter(past, places, tables, y, which, q, wave, when, size - share, missed)
        enter(past, places, tables, y, which, q, 1 - wave, when, share, missed)
        return True
    pass_by_closing(past, places, tables, t, y, out, handle, place, when, missed)
    if not (leaves and returns):  # within the line
        for side in range(2):
            to, part = (wave, size - share) if side == 0 else (1 - wave, share)
            onward = q + 1 if to == 0 else q - 1
            if 0 <= onward < line["stretches"]:
                send(past, places, tables, line["stretch"] + onward, to, when, part, pipe)
    return True


@njit
def rubs(past, places, tables, line, pipe, q, t):
    """Share of a jump that friction in the middle of stretch q turns back."""
    r, l = read_both(past, places, clock_of(past, newest_before(past, t)), line, q, t - line["hold"])
    flow = pipe["flow"] + (r - l) - rubbed(pipe, line, r, l)
    k = 0.5 * line["tau"] * drag_and_slope(pipe, flow)[1]
    return k / (1.0 + k)


@njit(forceinline=True)
def write(past, places, line, q, k, wave, value):
    """Keep the smooth part of a wave as entry k."""
    at, mask = ring_of(places, line, q)
    jumps = jumps_until(past, places, jumps_at(places, line["stretch"] + q, wave), INFINITE)
    past[at + 2 * (k & mask) + wave] = value - jumps


@njit
def arrive_at_joints(past, places, tables, t):
    """What arrives at the joints of stretches at t, beside what does at the ends of lines."""
    arrive_all(past, tables, t)
    clock = clock_of(past, newest_before(past, t))
    for i in range(tables.delays.size):
        line = tables.delays[i]
        for q in range(1, line["stretches"] - 1):
            arrive(past, places, clock, line, tables.pipes[line["pipe"]], q, t)


@njit
def note_jumps(past, places, tables, t, out):
    """At the time of the last entry: what differs from it is a jump, where it is large enough, else the entry."""
    k, ends = int(past[COUNT]) - 1, tables.layout[0]["ends"]
    for notes in range(2):  # the greatest first
        for i in range(tables.delays.size):
            line = tables.delays[i]
            pipe, at = tables.pipes[line["pipe"]], ends + 4 * line["pipe"]
            for side in range(2):
                q, new = line["stretches"] - 1 if side == 1 else 0, out[at + 3 * side]
                ring, mask = ring_of(places, line, q)
                jumps = jumps_at(places, line["stretch"] + q, side)
                old = past[ring + 2 * (k & mask) + side] + jumps_until(past, places, jumps, INFINITE)
                if notes == 0:
                    past[GREATEST] = max(past[GREATEST], abs(new - old) / pipe["admittance"])
                    continue
                if abs(new - old) > enough(past, tables, pipe):
                    keep(past, places, line["stretch"] + q, side, t, new - old, pipe)
                write(past, places, line, q, k, side, new)


@njit
def record_lines(t, y, out, handle, values):
    """After an accepted step: keep what was sent into all lines, pass on jumps that have arrived, widen envelopes."""
    tables = open_tables(handle)
    past, k, places, delays = tables.past, int(tables.past[COUNT]), places_of(tables.past), tables.delays
    if k > 0:
        last = time_of(past, k - 1)
        if t <= last + same_time(past):
            if past[MENDED] == last:
                write_ends(past, places, tables, k - 1, out)
            elif t >= last - same_time(past):
                note_jumps(past, places, tables, last, out)
            widen_all(t, places, tables)
            return
    if k == 0:  # what is sent from the start on, as from rest, is a jump: nothing was before
        begin_entry(past, t)
        note_jumps(past, places, tables, t, out)
        widen_all(t, places, tables)
        return
    arrive_at_joints(past, places, tables, t)
    if past[LIVE] > 0.0:
        forget_all(past, places, delays, time_of(past, k - 1))
        pass_jumps(past, places, tables, t, y, out, handle)
        arrive_at_joints(past, places, tables, t)  # again, where nodes were closed without a jump
    entry, ends = begin_entry(past, t), tables.layout[0]["ends"]
    clock = clock_of(past, entry)
    if past[MENDED] != past[MENDED]:
        past[MENDED], out[STATUS] = t, AMENDED
    for i in range(delays.size):
        line = delays[i]
        at, last = ends + 4 * line["pipe"], line["stretches"] - 1
        write(past, places, line, 0, entry, 0, out[at])
        write(past, places, line, last, entry, 1, out[at + 3])
        for q in range(last):
            joint = places[0] + ARRIVALS * (line["stretch"] + q)
            write(past, places, line, q + 1, entry, 0, past[joint + 1])
            write(past, places, line, q, entry, 1, past[joint + ARRIVALS])
        widen_line(t, places, clock, tables, i)


@njit(forceinline=True)
def widen_line(t, places, clock, tables, which):
    """Envelopes along a line at the time of the last entry, and when it first falls below vapour pressure."""
    line, envelope = tables.delays[which], tables.envelope
    n, cell = line["places"], tables.pipes[line["pipe"]]["cell"]
    r, l, low, high = tables.scratch[:n], tables.scratch[n : 2 * n], 0, 0
    for j in range(n):
        r[j], l[j] = sketch(t, tables.past, places, clock, line, (j + 0.5) / n)
        s = r[j] + l[j]
        low += not s >= envelope[0, cell + j]
        high += not s <= envelope[2, cell + j]
    if low + high > 0:
        note(t, r, l, cell, low, high, line["pipe"], tables)


@njit
def widen_all(t, places, tables):
    """Envelopes along all lines."""
    clock = clock_of(tables.past, int(tables.past[COUNT]) - 1)
    for i in range(tables.delays.size):
        widen_line(t, places, clock, tables, i)


@njit
def write_ends(past, places, tables, entry, out):
    """Keep what nodes send once more."""
    for i in range(tables.delays.size):
        line, at = tables.delays[i], tables.layout[0]["ends"] + 4 * tables.delays[i]["pipe"]
        write(past, places, line, 0, entry, 0, out[at])
        write(past, places, line, line["stretches"] - 1, entry, 1, out[at + 3])


@njit
def forget_all(past, places, delays, before):
    """Take out of all lists what had arrived before a time, and is not asked for any more."""
    for i in range(delays.size):
        line = delays[i]
        for s in range(line["stretch"], line["stretch"] + line["stretches"]):
            for at in range(jumps_at(places, s, 0), jumps_at(places, s + 1, 0), HEADS):
                if past[at + ARRIVED] > 0.0:
                    forget_jumps(past, places, at, before - line["hold"] - same_time(past))
