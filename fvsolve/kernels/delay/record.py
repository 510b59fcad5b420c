"""Update of delay lines after an accepted state: waves sent by nodes, jumps that have arrived, envelopes."""

from fvsolve.jit import njit
from fvsolve.kernels.delay.along import sketch
from fvsolve.kernels.delay.history import (
    ARRIVALS,
    ARRIVED,
    COUNT,
    HEADS,
    INFINITE,
    LIVE,
    MENDED,
    NEXT,
    SWING,
    begin_entry,
    clock_of,
    forget_jumps,
    jumps_at,
    places_of,
    same_time,
    time_of,
    write,
)
from fvsolve.kernels.delay.jumps import arrive_at_joints, changes, note_jumps, pass_at_joints, shorter_lines
from fvsolve.kernels.delay.nodes import let_arrive, next_arrival, pass_at_ends
from fvsolve.kernels.delay.passing import remember_values, widen_passing
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.observer import note
from fvsolve.kernels.records import AMENDED, ARRIVES, NEVER, STATUS
from fvsolve.kernels.records import ARRIVED as LET_ARRIVE


@njit
def record_lines(t, y, out, handle, values):
    """After an accepted step, store the waves sent into lines, pass on arrived jumps and update envelopes."""
    tables = open_tables(handle)
    past = tables.past
    k, places, status = int(past[COUNT]), places_of(past), out[STATUS]
    if status == LET_ARRIVE:
        let_arrive(past, places, tables, t)
        if shorter_lines(tables):
            note_jumps(past, places, tables, time_of(past, k - 1), y, out, True)
            past[MENDED] = -INFINITE
        out[STATUS] = AMENDED
        return
    if k > 0 and t <= time_of(past, k - 1) + same_time(past):
        record_again(past, places, tables, t, y, out)
    elif k == 0:  # a wave sent at the start is a jump: before, all waves were zero
        begin_entry(past, t)
        note_jumps(past, places, tables, t, y, out, shorter_lines(tables))
    else:
        record_step(past, places, tables, t, y, out, handle)
    if out[STATUS] == AMENDED:
        return
    widen_all(t, places, tables)
    remember_values(tables, out, values)
    if past[NEXT] > t + same_time(past):
        past[NEXT] = next_arrival(past, places, tables, t)
        out[ARRIVES] = past[NEXT] if past[NEXT] < INFINITE else NEVER
    else:
        out[ARRIVES] = t


@njit
def record_again(past, places, tables, t, y, out):
    """Record a state at the time of the last entry: after a kink or an event, or with its state corrected."""
    k = int(past[COUNT]) - 1
    last = time_of(past, k)
    if past[MENDED] == last:
        write_ends(past, places, tables, k, out)
        past[MENDED] = -INFINITE
    elif t >= last - same_time(past):
        short = shorter_lines(tables) and changes(past, places, tables, k, out)
        note_jumps(past, places, tables, last, y, out, short)


@njit
def record_step(past, places, tables, t, y, out, handle):
    """Write a new entry, after the jumps that have arrived since the last entry are passed on."""
    before = time_of(past, int(past[COUNT]) - 1)
    arrive_at_joints(past, places, tables, t)
    live = past[LIVE] > 0.0
    if live:
        forget_all(past, places, tables.delays, before)
        pass_at_joints(past, places, tables, t)
        passed = pass_at_ends(past, places, tables, t, y, out, handle)
        if passed and shorter_lines(tables):  # jumps that have already passed are missing in the node pressures
            past[MENDED] = NAN
        arrive_at_joints(past, places, tables, t)  # again: nodes were solved without the jumps in between
    entry, ends = begin_entry(past, t), tables.layout[0]["ends"]
    if past[MENDED] != past[MENDED]:
        past[MENDED], out[STATUS] = t, AMENDED
    for i in range(tables.delays.size):
        line = tables.delays[i]
        at, last = ends + 4 * line["pipe"], line["stretches"] - 1
        write(past, places, line, 0, entry, 0, out[at])
        write(past, places, line, last, entry, 1, out[at + 3])
        sent = max(abs(out[at]), abs(out[at + 3]))
        past[SWING] = max(past[SWING], sent / tables.pipes[line["pipe"]]["admittance"])
        for q in range(last):
            joint = places[0] + ARRIVALS * (line["stretch"] + q)
            write(past, places, line, q + 1, entry, 0, past[joint + 1])
            write(past, places, line, q, entry, 1, past[joint + ARRIVALS])
    if live:
        widen_passing(past, places, tables, before, t)


NAN = float("nan")


@njit(forceinline=True)
def widen_line(t, places, clock, tables, number):
    """Update the envelope along a line at the time of the last entry, and its first time below vapour pressure."""
    line, envelope = tables.delays[number], tables.envelope
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
    """Update the envelopes along all lines."""
    clock = clock_of(tables.past, int(tables.past[COUNT]) - 1)
    for i in range(tables.delays.size):
        widen_line(t, places, clock, tables, i)


@njit
def write_ends(past, places, tables, entry, out):
    """Write the waves that nodes send into an entry once more."""
    for i in range(tables.delays.size):
        line, at = tables.delays[i], tables.layout[0]["ends"] + 4 * tables.delays[i]["pipe"]
        write(past, places, line, 0, entry, 0, out[at])
        write(past, places, line, line["stretches"] - 1, entry, 1, out[at + 3])


@njit
def forget_all(past, places, delays, before):
    """Remove from all lists the jumps that had arrived before a time and are not read any more."""
    for i in range(delays.size):
        line = delays[i]
        for s in range(line["stretch"], line["stretch"] + line["stretches"]):
            for at in range(jumps_at(places, s, 0), jumps_at(places, s + 1, 0), HEADS):
                if past[at + ARRIVED] > 0.0:
                    forget_jumps(past, places, at, before - line["hold"] - same_time(past))
