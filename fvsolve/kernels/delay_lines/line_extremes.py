"""Extremes of pressure and flow in delay lines: envelopes, and values on both sides of jumps.

A jump is an instantaneous change of a wave; it passes a point between two recorded states. The value just before or
after it is the smooth part at that time, by linear interpolation between both states, plus the jumps that have arrived
by then. Extremes are those at nodes, within delay lines, and where two jumps cross.

before, t : begin and end of a step [s]; other arguments are those of `wave_history`.
"""

from fvsolve.jit import njit
from fvsolve.kernels.calls import observe_in_turn
from fvsolve.kernels.delay_lines import wave_history as history
from fvsolve.kernels.delay_lines.line_rates import sent_wave_linear, waves_at_linear
from fvsolve.kernels.dtypes import PIPE_FLOW, PIPE_PRESSURE
from fvsolve.kernels.observation import update_envelope, update_extremes
from fvsolve.kernels.table_handle import open_tables


@njit(forceinline=True)
def spare_offsets(tables):
    """Offsets of five arrays in the array `spare`, in this order.

    - probe values of the last record
    - node pressures of the last record
    - probe values at the end of the step, without the jumps that arrive in the step
    - node pressures at the end of the step, without these jumps
    - work array
    """
    at, probes, nodes = 2 * tables.layout[0]["size"], tables.probes.size, tables.nodes.size
    return at, at + probes, at + probes + nodes, at + 2 * probes + nodes, at + 2 * (probes + nodes)


@njit
def store_values(tables, out, values):
    """Store probe values and node pressures of an accepted state in `spare`, as those of the last record."""
    first, second, _, _, _ = spare_offsets(tables)
    pressure = tables.layout[0]["pressure"]
    for k in range(tables.probes.size):
        tables.spare[first + k] = values[k]
    for i in range(tables.nodes.size):
        tables.spare[second + i] = out[pressure + i]


@njit
def store_smooth_values(t, y, state, handle):
    """Store probe values and node pressures at t in `spare`, for the case that no jump arrives in the step.

    state : `out` at t for this case
    """
    tables = open_tables(handle)
    _, _, third, fourth, fifth = spare_offsets(tables)
    pressure = tables.layout[0]["pressure"]
    observe_in_turn(t, y, state, handle, tables.spare[third:fourth])
    for i in range(tables.nodes.size):
        tables.spare[fourth + i] = state[pressure + i]


@njit
def extremes_at_jump(t, time, y, state, handle):
    """Update the extremes of probes and the first times below vapour pressure by the values on one side of a jump.

    Probes within pipes are left out, see `update_probe_extremes`.
    time : arrival time of the jump [s]; t : end of the step [s]
    state : `out` at t, with the jumps that have arrived before this jump, or with this jump too
    """
    tables = open_tables(handle)
    past, spare, marks, pipes, nodes = tables.past, tables.spare, tables.marks, tables.pipes, tables.nodes
    first, second, third, fourth, fifth = spare_offsets(tables)
    probes, pressure, vapor = tables.probes.size, tables.layout[0]["pressure"], tables.settings[0]["vapor"]
    before = history.time_of(past, int(past[history.COUNT]) - 1)
    share = (t - time) / (t - before)
    values = spare[fifth : fifth + probes]
    observe_in_turn(t, y, state, handle, values)
    for k in range(probes):
        probe = tables.probes[k]
        if (probe["kind"] == PIPE_PRESSURE or probe["kind"] == PIPE_FLOW) and probe["side"] == 0:
            continue  # see `update_probe_extremes`
        value = values[k] + share * (spare[first + k] - spare[third + k])
        update_extremes(tables.extremes, k, time, value)
        mark = probe["mark"]
        if mark >= 0 and value < vapor and marks[mark] != marks[mark]:
            marks[mark] = time
    for i in range(nodes.size):
        p = state[pressure + i] + share * (spare[second + i] - spare[fourth + i])
        if nodes[i]["pressure"] + p < vapor and marks[pipes.size + i] != marks[pipes.size + i]:
            marks[pipes.size + i] = time


@njit
def line_extremes_at_jumps(past, places, clock, line, q, x, sign, before, t):
    """Extremes of r + sign l on both sides of the jumps that pass a point of a delay line, without friction loss.

    Returns (least, time of the least, greatest, time of the greatest) [kg/s, s]; without a jump, least is INFINITE.
    r, l : forward and backward wave; sign : 1 for pressure, -1 for flow; x : position as fraction of stretch q
    """
    least, t_least, greatest, t_greatest = history.INFINITE, t, -history.INFINITE, t
    queue, tau, s, same = int(past[history.JUMP_CAPACITY]), line["tau"], line["stretch"] + q, clock[4]
    ring, mask = history.ring_of(places, line, q)
    for wave in range(2):
        head, other = history.jump_head(places, s, wave), history.jump_head(places, s, 1 - wave)
        share = x if wave == 0 else 1.0 - x
        begin = history.first_after(past, places, head, before - share * tau + same)
        for i in range(begin, int(past[head + history.JUMP_COUNT])):
            place = history.jump_place(past, places, head, i)
            sent, size = past[place], past[place + queue]
            if sent > t - share * tau + same:
                break
            here = sent_wave_linear(past, places, clock, ring, mask, head, wave, sent)
            there = sent_wave_linear(past, places, clock, ring, mask, other, 1 - wave, sent + (2.0 * share - 1.0) * tau)
            for side in range(2):
                moved = here - (1 - side) * size
                value = moved + sign * there if wave == 0 else there + sign * moved
                if value < least:
                    least, t_least = value, sent + share * tau
                if value > greatest:
                    greatest, t_greatest = value, sent + share * tau
    return least, t_least, greatest, t_greatest


@njit
def envelope_where_jumps_cross(past, places, clock, tables, line, q, before, t):
    """Update the pressure envelope at each point of stretch q where two jumps cross between times `before` and t.

    All four combinations of values before and after both jumps are used.
    """
    queue, tau, s, same = int(past[history.JUMP_CAPACITY]), line["tau"], line["stretch"] + q, clock[4]
    first_cell, (ring, mask) = tables.pipes[line["pipe"]]["cell"], history.ring_of(places, line, q)
    forward, backward = history.jump_head(places, s, 0), history.jump_head(places, s, 1)
    delta, n = past[places[0] + history.ARRIVALS_SIZE * s + 2], line["places"]
    for i in range(int(past[forward + history.JUMP_COUNT])):
        place = history.jump_place(past, places, forward, i)
        sent, size = past[place], past[place + queue]
        begin = history.first_after(past, places, backward, max(2.0 * before - tau - sent, sent - tau) + same)
        for j in range(begin, int(past[backward + history.JUMP_COUNT])):
            other = history.jump_place(past, places, backward, j)
            opposite = past[other]
            if opposite > min(2.0 * t - tau - sent, sent + tau) + same:
                break
            x, time = 0.5 * (tau + opposite - sent) / tau, 0.5 * (tau + opposite + sent)
            r = sent_wave_linear(past, places, clock, ring, mask, forward, 0, sent)
            l = sent_wave_linear(past, places, clock, ring, mask, backward, 1, opposite)
            cell = first_cell + min(int((q + x) * n / line["stretches"]), n - 1)
            for side in range(4):
                value = r - (side % 2) * size + l - (side // 2) * past[other + queue]
                update_extremes(tables.envelope, cell, time, value + (1.0 - 2.0 * x) * delta)


@njit
def update_line_extremes(past, places, tables, before, t):
    """Update envelopes and extremes within delay lines by the values beside jumps that pass between `before` and t.

    The first times below vapour pressure along the lines are updated too.
    """
    clock, marks = history.reading_data(past, int(past[history.COUNT]) - 1), tables.marks
    for number in range(tables.delays.size):
        line, pipe = tables.delays[number], tables.pipes[tables.delays[number]["pipe"]]
        stretches, n = line["stretches"], line["places"]
        for q in range(stretches):
            head = history.jump_head(places, line["stretch"] + q, 0)
            forward, backward = past[head + history.JUMP_COUNT], past[head + history.HEAD_SIZE + history.JUMP_COUNT]
            if forward + backward == 0.0:
                continue
            delta = past[places[0] + history.ARRIVALS_SIZE * (line["stretch"] + q) + 2]
            for j in range((q * n) // stretches, min(n, ((q + 1) * n) // stretches + 1)):
                x = (j + 0.5) / n * stretches - q
                if 0.0 <= x < 1.0:
                    found = line_extremes_at_jumps(past, places, clock, line, q, x, 1.0, before, t)
                    least, greatest = found[0] + (1.0 - 2.0 * x) * delta, found[2] + (1.0 - 2.0 * x) * delta
                    if found[0] < history.INFINITE:
                        cell, mark = pipe["cell"] + j, line["pipe"]
                        if least < tables.profile[cell] and marks[mark] != marks[mark]:
                            marks[mark] = found[1]
                        update_extremes(tables.envelope, cell, found[1], least)
                        update_extremes(tables.envelope, cell, found[3], greatest)
            if forward > 0.0 and backward > 0.0:
                envelope_where_jumps_cross(past, places, clock, tables, line, q, before, t)
    update_probe_extremes(past, places, clock, tables, before, t)


@njit
def update_probe_extremes(past, places, clock, tables, before, t):
    """Update the extremes of probes within delay lines by the values beside jumps between the times `before` and t."""
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
        delta = past[places[0] + history.ARRIVALS_SIZE * (line["stretch"] + q) + 2]
        more = (1.0 - 2.0 * x) * delta if sign > 0.0 else pipe["flow"] - delta
        least, t_least, greatest, t_greatest = line_extremes_at_jumps(past, places, clock, line, q, x, sign, before, t)
        if least < history.INFINITE:
            update_extremes(tables.extremes, k, t_least, probe["scale"] * (least + more) + probe["offset"])
            update_extremes(tables.extremes, k, t_greatest, probe["scale"] * (greatest + more) + probe["offset"])


@njit
def update_line_envelopes(t, places, tables):
    """Update the pressure envelopes along all delay lines at the time t of the last entry.

    The first times below vapour pressure are updated too.
    """
    clock = history.reading_data(tables.past, int(tables.past[history.COUNT]) - 1)
    for i in range(tables.delays.size):
        line, envelope = tables.delays[i], tables.envelope
        n, cell = line["places"], tables.pipes[line["pipe"]]["cell"]
        r, l, low, high = tables.scratch[:n], tables.scratch[n : 2 * n], 0, 0
        for j in range(n):
            r[j], l[j] = waves_at_linear(t, tables.past, places, clock, line, (j + 0.5) / n)
            s = r[j] + l[j]
            low += not s >= envelope[0, cell + j]
            high += not s <= envelope[2, cell + j]
        if low + high > 0:
            update_envelope(t, r, l, cell, low, high, line["pipe"], tables)
