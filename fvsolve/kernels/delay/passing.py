"""Extremes on both sides of jumps: at nodes, at places within delay lines, and where two jumps meet there.

A jump passes between two recorded states. Values beside it are those of the smooth part at its time, by a line
through both states, and of the jumps that are there by then.
"""

from fvsolve.jit import njit
from fvsolve.kernels.calls import observe_in_turn
from fvsolve.kernels.delay.along import sketched
from fvsolve.kernels.delay.history import (
    ARRIVALS,
    COUNT,
    FIRST,
    HEADS,
    INFINITE,
    MANY,
    QUEUE,
    clock_of,
    first_after,
    jumps_at,
    queue_at,
    ring_of,
    time_of,
    turn,
)
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.observer import widen
from fvsolve.kernels.records import PIPE_FLOW, PIPE_PRESSURE


@njit(forceinline=True)
def rooms_of(tables):
    """Where in `spare` there begin: values and pressures of the last record, of this one without its jumps, values."""
    at, many, nodes = 2 * tables.layout[0]["size"], tables.probes.size, tables.nodes.size
    return at, at + many, at + many + nodes, at + 2 * many + nodes, at + 2 * (many + nodes)


@njit
def remember_values(tables, out, values):
    """Keep values of probes and pressures of nodes as they are recorded."""
    first, second, _, _, _ = rooms_of(tables)
    pressure = tables.layout[0]["pressure"]
    for k in range(tables.probes.size):
        tables.spare[first + k] = values[k]
    for i in range(tables.nodes.size):
        tables.spare[second + i] = out[pressure + i]


@njit
def base_values(t, y, state, handle):
    """Keep them as they would be at t, had no jump arrived."""
    tables = open_tables(handle)
    _, _, third, fourth, fifth = rooms_of(tables)
    pressure = tables.layout[0]["pressure"]
    observe_in_turn(t, y, state, handle, tables.spare[third:fourth])
    for i in range(tables.nodes.size):
        tables.spare[fourth + i] = state[pressure + i]


@njit
def note_side(t, when, y, state, handle):
    """Widen extremes by a state beside a jump that arrives at a time; state : at t, with what has arrived by then."""
    tables = open_tables(handle)
    past, spare, marks, pipes, nodes = tables.past, tables.spare, tables.marks, tables.pipes, tables.nodes
    first, second, third, fourth, fifth = rooms_of(tables)
    many, pressure, vapor = tables.probes.size, tables.layout[0]["pressure"], tables.settings[0]["vapor"]
    before = time_of(past, int(past[COUNT]) - 1)
    share = (t - when) / (t - before)
    values = spare[fifth : fifth + many]
    observe_in_turn(t, y, state, handle, values)
    for k in range(many):
        probe = tables.probes[k]
        if (probe["kind"] == PIPE_PRESSURE or probe["kind"] == PIPE_FLOW) and probe["side"] == 0:
            continue  # see `widen_passing`
        value = values[k] + share * (spare[first + k] - spare[third + k])
        widen(tables.extremes, k, when, value)
        which = probe["mark"]
        if which >= 0 and value < vapor and marks[which] != marks[which]:
            marks[which] = when
    for i in range(nodes.size):
        p = state[pressure + i] + share * (spare[second + i] - spare[fourth + i])
        if nodes[i]["pressure"] + p < vapor and marks[pipes.size + i] != marks[pipes.size + i]:
            marks[pipes.size + i] = when


@njit
def passed_at(past, places, clock, line, q, x, sign, before, t):
    """(least, its time, greatest, its time) of r + sign l beside jumps that pass a share x of stretch q in a step."""
    least, t_least, greatest, t_greatest = INFINITE, t, -INFINITE, t
    queue, tau, s, same = int(past[QUEUE]), line["tau"], line["stretch"] + q, clock[4]
    ring, mask = ring_of(places, line, q)
    for wave in range(2):
        head, other = jumps_at(places, s, wave), jumps_at(places, s, 1 - wave)
        share = x if wave == 0 else 1.0 - x
        times, first, many = queue_at(places, queue, head), int(past[head + FIRST]), int(past[head + MANY])
        for i in range(first_after(past, queue, times, first, many, before - share * tau + same), many):
            sent, size = past[times + turn(first + i, queue)], past[times + turn(first + i, queue) + queue]
            if sent > t - share * tau + same:
                break
            here = sketched(past, places, clock, ring, mask, head, wave, sent)
            there = sketched(past, places, clock, ring, mask, other, 1 - wave, sent + (2.0 * share - 1.0) * tau)
            for side in range(2):
                one = here - (1 - side) * size
                value = one + sign * there if wave == 0 else there + sign * one
                if value < least:
                    least, t_least = value, sent + share * tau
                if value > greatest:
                    greatest, t_greatest = value, sent + share * tau
    return least, t_least, greatest, t_greatest


@njit
def widen_meeting(past, places, clock, tables, line, q, before, t):
    """Widen the envelope beside each point of stretch q at which two jumps meet in a step."""
    queue, tau, s, same, pipe = int(past[QUEUE]), line["tau"], line["stretch"] + q, clock[4], tables.pipes[line["pipe"]]
    ring, mask = ring_of(places, line, q)
    one, two = jumps_at(places, s, 0), jumps_at(places, s, 1)
    times, first, many = queue_at(places, queue, one), int(past[one + FIRST]), int(past[one + MANY])
    others, start, left = queue_at(places, queue, two), int(past[two + FIRST]), int(past[two + MANY])
    delta, n = past[places[0] + ARRIVALS * s + 2], line["places"]
    for i in range(many):
        sent, size = past[times + turn(first + i, queue)], past[times + turn(first + i, queue) + queue]
        begin = first_after(past, queue, others, start, left, max(2.0 * before - tau - sent, sent - tau) + same)
        for j in range(begin, left):
            against = past[others + turn(start + j, queue)]
            if against > min(2.0 * t - tau - sent, sent + tau) + same:
                break
            x, when = 0.5 * (tau + against - sent) / tau, 0.5 * (tau + against + sent)
            r = sketched(past, places, clock, ring, mask, one, 0, sent)
            l = sketched(past, places, clock, ring, mask, two, 1, against)
            cell = pipe["cell"] + min(int((q + x) * n / line["stretches"]), n - 1)
            for side in range(4):
                value = r - (side % 2) * size + l - (side // 2) * past[others + turn(start + j, queue) + queue]
                widen(tables.envelope, cell, when, value + (1.0 - 2.0 * x) * delta)


@njit
def widen_passing(past, places, tables, before, t):
    """Widen envelopes and extremes within lines by the values beside jumps that have passed there since `before`."""
    clock = clock_of(past, int(past[COUNT]) - 1)
    for which in range(tables.delays.size):
        line, pipe = tables.delays[which], tables.pipes[tables.delays[which]["pipe"]]
        many, n = line["stretches"], line["places"]
        for q in range(many):
            head = jumps_at(places, line["stretch"] + q, 0)
            one, two = past[head + MANY], past[head + HEADS + MANY]
            if one + two == 0.0:
                continue
            delta = past[places[0] + ARRIVALS * (line["stretch"] + q) + 2]
            for j in range((q * n) // many, min(n, ((q + 1) * n) // many + 1)):
                x = (j + 0.5) / n * many - q
                if 0.0 <= x < 1.0:
                    least, t_least, greatest, t_greatest = passed_at(past, places, clock, line, q, x, 1.0, before, t)
                    if least < INFINITE:
                        mark_pipe(tables, line["pipe"], j, t_least, least + (1.0 - 2.0 * x) * delta)
                        widen(tables.envelope, pipe["cell"] + j, t_least, least + (1.0 - 2.0 * x) * delta)
                        widen(tables.envelope, pipe["cell"] + j, t_greatest, greatest + (1.0 - 2.0 * x) * delta)
            if one > 0.0 and two > 0.0:
                widen_meeting(past, places, clock, tables, line, q, before, t)
    widen_probes(past, places, clock, tables, before, t)


@njit(forceinline=True)
def mark_pipe(tables, which, j, t, value):
    """Mark a pipe that falls below vapour pressure at one of its places."""
    marks, cell = tables.marks, tables.pipes[which]["cell"] + j
    if value < tables.profile[cell] and marks[which] != marks[which]:
        marks[which] = t


@njit
def widen_probes(past, places, clock, tables, before, t):
    """Widen the extremes of probes within lines."""
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        if (probe["kind"] != PIPE_PRESSURE and probe["kind"] != PIPE_FLOW) or probe["side"] != 0:
            continue
        pipe = tables.pipes[probe["index"]]
        if pipe["delay"] < 0:
            continue
        line = tables.delays[pipe["delay"]]
        share = tables.floats[probe["weights"]] * line["stretches"]
        q = min(int(share), line["stretches"] - 1)
        x, sign = share - q, 1.0 if probe["kind"] == PIPE_PRESSURE else -1.0
        delta = past[places[0] + ARRIVALS * (line["stretch"] + q) + 2]
        more = (1.0 - 2.0 * x) * delta if sign > 0.0 else pipe["flow"] - delta
        least, t_least, greatest, t_greatest = passed_at(past, places, clock, line, q, x, sign, before, t)
        if least < INFINITE:
            widen(tables.extremes, k, t_least, probe["scale"] * (least + more) + probe["offset"])
            widen(tables.extremes, k, t_greatest, probe["scale"] * (greatest + more) + probe["offset"])
