"""What delay lines remember of an accepted state, and how jumps are passed on. Knows the tables; closes no node itself.

A jump that arrives within a step is passed on at its own time, without ending the step. A node that p' = sum / Y closes
answers at once; where a valve, a cluster or a short line decides, nodes are closed a second time without the jump, and
what differs was passed on. So a jump travels exactly through what is linear, and by its own secant through what is not.
"""

from fvsolve.jit import njit
from fvsolve.kernels.calls import CLOSE, run
from fvsolve.kernels.delay.along import sketch_line
from fvsolve.kernels.delay.history import (
    ARRIVED,
    CAPACITY,
    COUNT,
    DROPPED,
    FIRST,
    GREATEST,
    HEAD,
    KNOWN_TIME,
    MANY,
    PASSED,
    QUEUE,
    TIMES,
    arrivals_at,
    begin_entry,
    clock_of,
    forget_jumps,
    jumps_at,
    jumps_until,
    newest_before,
    push_jump,
    read_both,
    same_time,
    stretch_at,
    time_of,
)
from fvsolve.kernels.delay.lines import arrive, arrive_all, drag_and_slope, rubbed
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.observer import record_pipe
from fvsolve.kernels.records import ALONE, JUNCTION

INFINITE, NAN = 1e300, float("nan")
NOISE = 1e-13  # of half a bar's wave: a jump that is rounding


@njit(forceinline=True)
def enough(past, tables, pipe):
    """The least jump of a wave that is kept as one [kg/s]."""
    return max(tables.settings[0]["jumps"] * past[GREATEST], NOISE * 0.5e5) * pipe["admittance"]


@njit
def send(past, tables, s, wave, t, size, pipe):
    """A jump enters stretch s."""
    if abs(size) > enough(past, tables, pipe):
        push_jump(past, jumps_at(past, s, wave), t, size)
    else:
        past[DROPPED] = max(past[DROPPED], abs(size) / pipe["admittance"])


@njit(forceinline=True)
def is_plain(tables, i):
    """Whether a node answers a wave by itself: p' is given, or the sum of what arrives over Y."""
    node = tables.nodes[i]
    return node["kind"] != JUNCTION or node["solve"] == ALONE


@njit
def meet(past, tables, which, side, t, size):
    """A jump of a line arrives at the plain node at one of its ends."""
    line, pipe = tables.delays[which], tables.pipes[tables.delays[which]["pipe"]]
    i = pipe["to_node"] if side == 1 else pipe["from_node"]
    node = tables.nodes[i]
    if node["kind"] != JUNCTION:
        s = line["stretch"] + (line["stretches"] - 1 if side == 1 else 0)
        send(past, tables, s, side, t, -size, pipe)
        return
    change = 2.0 * size / node["admittance"]
    for k in range(node["line_count"]):
        end = tables.integers[node["lines"] + k]
        other, right = tables.delays[end // 2], end % 2
        pipe = tables.pipes[other["pipe"]]
        own = size if end == 2 * which + side else 0.0
        s = other["stretch"] + (other["stretches"] - 1 if right == 1 else 0)
        send(past, tables, s, right, t, pipe["admittance"] * change - own, pipe)


@njit
def enter(past, tables, which, q, wave, t, size):
    """A jump of a wave leaves stretch q of a line: into the next one, or to the node there."""
    line = tables.delays[which]
    onward = q + 1 if wave == 0 else q - 1
    if 0 <= onward < line["stretches"]:
        send(past, tables, line["stretch"] + onward, wave, t, size, tables.pipes[line["pipe"]])
    elif abs(size) > 0.0:
        meet(past, tables, which, 1 if wave == 0 else 0, t, size)


@njit
def pass_by_closing(past, tables, t, y, out, handle, place, when):
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
            change = out[at + 3 * side] - spare[at + 3 * side]
            if abs(change) > enough(past, tables, pipe):
                s = line["stretch"] + (line["stretches"] - 1 if side == 1 else 0)
                push_jump(past, jumps_at(past, s, side), when, change)


@njit
def pass_jumps(past, tables, t, y, out, handle):
    """All jumps that arrive at the ends of their stretches by t."""
    queue = int(past[QUEUE])
    for which in range(tables.delays.size):
        line = tables.delays[which]
        pipe = tables.pipes[line["pipe"]]
        for q in range(line["stretches"]):
            for wave in range(2):
                at = jumps_at(past, line["stretch"] + q, wave)
                while past[at + ARRIVED] < past[at + MANY]:
                    place = at + TIMES + (int(past[at + FIRST]) + int(past[at + ARRIVED])) % queue
                    if past[place] > t - line["hold"] + same_time(past):
                        break
                    past[at + ARRIVED] += 1.0
                    past[PASSED] += 1.0
                    when, size = min(past[place] + line["hold"], t), past[place + queue]
                    ahead, back = q + 1 == line["stretches"], q == 0
                    far = pipe["to_node"] if wave == 0 else pipe["from_node"]
                    near = pipe["from_node"] if wave == 0 else pipe["to_node"]
                    leaves, returns = (ahead, back) if wave == 0 else (back, ahead)
                    plain = not (leaves and not is_plain(tables, far)) and not (returns and not is_plain(tables, near))
                    if line["now"] > 0.0 or not plain:
                        pass_by_closing(past, tables, t, y, out, handle, place, when)
                        if not (leaves and returns):
                            inner(past, tables, which, q, wave, when, size, t)
                        continue
                    share = size * rubs(past, tables, line, pipe, line["stretch"] + q, t)
                    enter(past, tables, which, q, wave, when, size - share)
                    enter(past, tables, which, q, 1 - wave, when, share)


@njit
def inner(past, tables, which, q, wave, when, size, t):
    """Of a jump whose stretch has one end at a node that was closed: what goes on within the line."""
    line = tables.delays[which]
    pipe = tables.pipes[line["pipe"]]
    share = size * rubs(past, tables, line, pipe, line["stretch"] + q, t)
    for side in range(2):
        to, part = (wave, size - share) if side == 0 else (1 - wave, share)
        onward = q + 1 if to == 0 else q - 1
        if 0 <= onward < line["stretches"]:
            send(past, tables, line["stretch"] + onward, to, when, part, pipe)


@njit
def rubs(past, tables, line, pipe, s, t):
    """Share of a jump that friction in the middle of stretch s turns back."""
    r, l = read_both(past, clock_of(past, newest_before(past, t)), s, t - line["hold"])
    flow = pipe["flow"] + (r - l) - rubbed(pipe, line, r, l)
    k = 0.5 * line["tau"] * drag_and_slope(pipe, flow)[1]
    return k / (1.0 + k)


@njit(forceinline=True)
def write(past, sizes, s, k, wave, value):
    """Keep the smooth part of a wave as entry k; sizes : as `clock_of` has them."""
    capacity, stride, jumps = sizes
    at = HEAD + capacity + s * stride
    own = jumps_until(past, at + 2 * capacity + wave * jumps, INFINITE)
    past[at + 2 * (k & (capacity - 1)) + wave] = value - own


@njit
def arrive_at_joints(past, tables, t):
    """What arrives at the joints of stretches at t, beside what does at the ends of lines."""
    arrive_all(past, tables, t)
    place, clock = arrivals_at(past), clock_of(past, newest_before(past, t))
    for i in range(tables.delays.size):
        line = tables.delays[i]
        for q in range(1, line["stretches"] - 1):
            at = place + 3 * (line["stretch"] + q)
            arrive(past, clock, line, tables.pipes[line["pipe"]], q, t, at)


@njit
def note_jumps(past, tables, t, out):
    """At the time of the last entry: what differs from it is a jump, where it is large enough, else the entry."""
    layout, k = tables.layout[0], int(past[COUNT]) - 1
    sizes = clock_of(past, k)[4]
    mask = int(past[CAPACITY]) - 1
    greatest = past[GREATEST]
    for i in range(tables.delays.size):
        line = tables.delays[i]
        pipe, at = tables.pipes[line["pipe"]], layout["ends"] + 4 * line["pipe"]
        for side in range(2):
            s = line["stretch"] + (line["stretches"] - 1 if side == 1 else 0)
            old = past[stretch_at(past, s) + 2 * (k & mask) + side] + jumps_until(
                past, jumps_at(past, s, side), INFINITE
            )
            greatest = max(greatest, abs(out[at + 3 * side] - old) / pipe["admittance"])
    past[GREATEST] = greatest
    for i in range(tables.delays.size):
        line = tables.delays[i]
        pipe, at = tables.pipes[line["pipe"]], layout["ends"] + 4 * line["pipe"]
        for side in range(2):
            s = line["stretch"] + (line["stretches"] - 1 if side == 1 else 0)
            new, where = out[at + 3 * side], jumps_at(past, s, side)
            old = past[stretch_at(past, s) + 2 * (k & mask) + side] + jumps_until(past, where, INFINITE)
            if abs(new - old) > enough(past, tables, pipe):
                push_jump(past, where, t, new - old)
            write(past, sizes, s, k, side, new)


@njit
def record_lines(t, y, out, handle, values):
    """Keep what was sent into all delay lines, and pass on the jumps that have arrived, after every accepted step."""
    tables = open_tables(handle)
    past, layout = tables.past, tables.layout[0]
    k = int(past[COUNT])
    if k > 0:
        last = time_of(past, k - 1)
        if t <= last + same_time(past):
            if t >= last - same_time(past):
                note_jumps(past, tables, last, out)
            return
    if k == 0:  # what is sent from the start on, as from rest, is a jump: nothing was before
        begin_entry(past, t)
        note_jumps(past, tables, t, out)
        return
    before, place = time_of(past, k - 1), arrivals_at(past)
    arrive_at_joints(past, tables, t)
    for i in range(tables.delays.size):
        for s in range(tables.delays[i]["stretch"], tables.delays[i]["stretch"] + tables.delays[i]["stretches"]):
            for wave in range(2):
                where = jumps_at(past, s, wave)
                if past[where + ARRIVED] > 0.0:
                    forget_jumps(past, where, before - tables.delays[i]["hold"] - same_time(past))
    pass_jumps(past, tables, t, y, out, handle)
    entry, delays, ends = begin_entry(past, t), tables.delays, layout["ends"]
    sizes = clock_of(past, entry)[4]
    for i in range(delays.size):
        line = delays[i]
        at, first, last = ends + 4 * line["pipe"], line["stretch"], line["stretch"] + line["stretches"] - 1
        write(past, sizes, first, entry, 0, out[at])
        write(past, sizes, last, entry, 1, out[at + 3])
        for q in range(line["stretches"] - 1):
            joint = place + 3 * (first + q)
            write(past, sizes, first + q + 1, entry, 0, past[joint + 1])
            write(past, sizes, first + q, entry, 1, past[joint + 3])


@njit
def record_places(t, y, out, handle, values):
    """Envelopes along delay lines, and when they first fall below vapour pressure, after every accepted step."""
    tables = open_tables(handle)
    for i in range(tables.delays.size):
        line = tables.delays[i]
        n = line["places"]
        r, l = tables.scratch[:n], tables.scratch[n : 2 * n]
        sketch_line(t, tables, i, r, l)
        record_pipe(t, r, l, tables.pipes[line["pipe"]], line["pipe"], tables)
