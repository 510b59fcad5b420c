"""Jumps in delay lines: detection, storage, and passage through friction and the joints of stretches.

An instantaneous change by a schedule, a valve or an event is a jump. A jump below `numerics.delay_tolerance` joins the
smooth part. Friction in the middle of a stretch reflects the difference of the friction losses with and without
the jump.
"""

from fvsolve.jit import njit
from fvsolve.kernels.calls import CLOSE, run
from fvsolve.kernels.delay.history import (
    ARRIVALS,
    ARRIVED,
    COUNT,
    CROWDED,
    FIRST,
    GREATEST,
    HEADS,
    INFINITE,
    KNOWN_COUNT,
    KNOWN_TIME,
    MANY,
    MENDED,
    QUEUE,
    SWING,
    arrived_until,
    both_waves,
    clock_of,
    jumps_at,
    jumps_until,
    newest_before,
    passed_jumps,
    push_jump,
    queue_at,
    ring_of,
    same_time,
    stencil,
    turn,
    write,
)
from fvsolve.kernels.delay.lines import arrive, arrive_all, rubbed, rubs
from fvsolve.kernels.records import AMENDED, STATUS

NAN = float("nan")
NOISE = 1e-13  # fraction of a wave of half a bar below which a change is rounding


@njit(forceinline=True)
def shorter_lines(tables):
    """True if a line is shorter than a step."""
    for i in range(tables.delays.size):
        if tables.delays[i]["now"] > 0.0:
            return True
    return False


@njit(forceinline=True)
def enough(past, tables, pipe):
    """Size below which a jump joins the smooth part: a share of the greatest jump or greatest wave [kg/s]."""
    least = tables.settings[0]["jumps"] * max(past[GREATEST], past[SWING])
    return max(least, NOISE * 0.5e5) * pipe["admittance"]


@njit
def keep(past, places, s, wave, t, size, pipe):
    """Store a jump that enters stretch s; where its list is full, record the size that did not fit."""
    if not push_jump(past, places, jumps_at(places, s, wave), t, size):
        past[CROWDED] = max(past[CROWDED], abs(size) / pipe["admittance"])


@njit
def send(past, places, tables, s, wave, t, size, pipe):
    """Store a jump that enters stretch s, unless it is small: then it joins the smooth part."""
    if abs(size) > enough(past, tables, pipe):
        keep(past, places, s, wave, t, size, pipe)


@njit(forceinline=True)
def first_left(past, places, s, wave):
    """Offset of the first jump of a wave of stretch s that has not been passed on; -1 where there is none."""
    at, queue = jumps_at(places, s, wave), int(past[QUEUE])
    if not past[at + ARRIVED] < past[at + MANY]:
        return -1
    return queue_at(places, queue, at) + turn(int(past[at + FIRST]) + int(past[at + ARRIVED]), queue)


@njit
def turned_back(past, places, tables, line, pipe, q, wave, size, t):
    """Part of a jump, not yet passed on, that friction in the middle of stretch q reflects [kg/s]."""
    if not rubs(pipe):
        return 0.0
    ring, mask = ring_of(places, line, q)
    k, w = stencil(past, clock_of(past, newest_before(past, t)), t - line["hold"])
    r, l = both_waves(past, ring, mask, k, w)
    head = jumps_at(places, line["stretch"] + q, 0)
    r, l = r + passed_jumps(past, places, head), l + passed_jumps(past, places, head + HEADS)
    before = rubbed(pipe, line, r, l)
    if wave == 0:
        return rubbed(pipe, line, r + size, l) - before
    return before - rubbed(pipe, line, r, l + size)


@njit
def pass_at_joints(past, places, tables, t):
    """Pass on all jumps that leave stretches within lines by t."""
    queue = int(past[QUEUE])
    for number in range(tables.delays.size):
        line, pipe = tables.delays[number], tables.pipes[tables.delays[number]["pipe"]]
        for q in range(1, line["stretches"] - 1):
            for wave in range(2):
                s = line["stretch"] + q
                place = first_left(past, places, s, wave)
                while place >= 0 and past[place] + line["tau"] <= t + same_time(past):
                    when, size = min(past[place] + line["tau"], t), past[place + queue]
                    share = turned_back(past, places, tables, line, pipe, q, wave, size, t)
                    past[jumps_at(places, s, wave) + ARRIVED] += 1.0
                    onward = 1 if wave == 0 else -1
                    send(past, places, tables, s + onward, wave, when, size - share, pipe)
                    send(past, places, tables, s - onward, 1 - wave, when, share, pipe)
                    place = first_left(past, places, s, wave)


@njit
def arrive_at_joints(past, places, tables, t):
    """Write the waves that arrive at t at the joints of stretches and at the ends of lines into `past`."""
    arrive_all(past, tables, t)
    clock = clock_of(past, newest_before(past, t))
    for i in range(tables.delays.size):
        line = tables.delays[i]
        for q in range(1, line["stretches"] - 1):
            arrive(past, places, clock, line, tables.pipes[line["pipe"]], q, t)


@njit
def meet_short_lines(past, places, tables, t):
    """Complete the arriving waves of lines shorter than a step, which so far hold for p' = 0 at their ends.

    t : time of the last entry, whose waves give the part that arrives at once
    """
    newest = int(past[COUNT]) - 1
    clock = clock_of(past, newest)
    for i in range(tables.delays.size):
        line, beta = tables.delays[i], tables.delays[i]["now"]
        if beta > 0.0:
            ring, mask = ring_of(places, line, 0)
            k, w = stencil(past, clock, t - line["hold"])
            u, v = both_waves(past, ring, mask, k, w)
            head = jumps_at(places, line["stretch"], 0)
            r = arrived_until(past, places, clock, head, t, line["tau"])
            l = arrived_until(past, places, clock, head + HEADS, t, line["tau"])
            delta, at = rubbed(tables.pipes[line["pipe"]], line, u + r, v + l), ring + 2 * (newest & mask)
            arrivals = places[0] + ARRIVALS * line["stretch"]
            past[arrivals] = v + beta * (past[at + 1] - v) + l + delta
            past[arrivals + 1] = u + beta * (past[at] - u) + r - delta


@njit(forceinline=True)
def sent_so_far(past, places, line, q, side, k):
    """Wave sent into stretch q of a line by entry k, with its jumps [kg/s]."""
    ring, mask = ring_of(places, line, q)
    jumps = jumps_at(places, line["stretch"] + q, side)
    return past[ring + 2 * (k & mask) + side] + jumps_until(past, places, jumps, INFINITE)


@njit
def changes(past, places, tables, k, out):
    """True if the waves that nodes send differ from those of entry k by more than rounding."""
    for i in range(tables.delays.size):
        line = tables.delays[i]
        pipe, at = tables.pipes[line["pipe"]], tables.layout[0]["ends"] + 4 * line["pipe"]
        for side in range(2):
            old = sent_so_far(past, places, line, line["stretches"] - 1 if side == 1 else 0, side, k)
            if not abs(out[at + 3 * side] - old) <= NOISE * 0.5e5 * pipe["admittance"]:
                return True
    return False


@njit
def note_jumps(past, places, tables, t, y, out, short):
    """Store the differences between the present waves and the last entry: large ones as jumps, small ones in the entry.

    short : True if nodes joined by lines shorter than a step are solved again; then the state is corrected
    """
    k, ends, state = int(past[COUNT]) - 1, tables.layout[0]["ends"], out
    if short:
        state = tables.spare[: tables.layout[0]["size"]]
        arrive_all(past, tables, t)
        meet_short_lines(past, places, tables, t)
        past[KNOWN_TIME], past[KNOWN_COUNT] = t, past[COUNT]
        run(CLOSE, t, y, y[:0], state, tables.sharp)
        past[KNOWN_TIME] = NAN
    for stage in range(2):  # first the greatest jump, which the limit in `least_jump` needs
        for i in range(tables.delays.size):
            line = tables.delays[i]
            pipe, at = tables.pipes[line["pipe"]], ends + 4 * line["pipe"]
            for side in range(2):
                q, new = line["stretches"] - 1 if side == 1 else 0, state[at + 3 * side]
                old = sent_so_far(past, places, line, q, side, k)
                if stage == 0:
                    past[GREATEST] = max(past[GREATEST], abs(new - old) / pipe["admittance"])
                    continue
                if abs(new - old) > enough(past, tables, pipe):
                    keep(past, places, line["stretch"] + q, side, t, new - old, pipe)
                    if short:
                        past[MENDED], out[STATUS] = t, AMENDED
                write(past, places, line, q, k, side, new)
