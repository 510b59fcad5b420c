"""Forward and backward waves at any point of a delay line, for probes, output along the line and envelopes.

At a fraction x of a stretch of travel time tau, from its `from` end, the forward wave is
r(t, x) = sent(t - x tau) - x delta, and the backward wave is l(t, x) = sent(t - (1 - x) tau) + (1 - x) delta. delta is
the friction loss in the middle of the stretch at an earlier time: for x >= 1/2 when the forward wave at x passed the
middle, for x < 1/2 when the backward wave at x passed it. At both ends the formulas give the arriving waves.
"""

from fvsolve.jit import njit
from fvsolve.kernels.delay_lines.line_rates import friction_loss
from fvsolve.kernels.delay_lines.wave_history import (
    ARRIVALS_SIZE,
    COUNT,
    HEAD_SIZE,
    JUMP_COUNT,
    PROFILE_ENTRIES,
    REMOVED_SUM,
    find_interval,
    interpolate_waves,
    jump_head,
    jumps_until,
    offsets_of,
    read_waves,
    reading_data,
    ring_of,
    stencil,
    time_of,
    time_tolerance,
)
from fvsolve.kernels.dtypes import PIPE_FLOW, PIPE_PRESSURE
from fvsolve.kernels.table_handle import open_tables


@njit
def sent_wave(t, out, tables, number, q, wave, at):
    """Wave sent into stretch q of delay line `number` at a time `at` <= t, with its jumps [kg/s].

    `at` may lie in the step that ends at t; there a wave from a node is linear up to its value in `out` at t. The
    result is 0 before the first entry. wave : 0 forward, 1 backward
    """
    past, line = tables.past, tables.delays[number]
    newest = int(past[COUNT]) - 1
    if newest < 0:
        return 0.0
    last, places, until = time_of(past, newest), offsets_of(past), at + time_tolerance(past)
    k, w = stencil(past, reading_data(past, newest), min(at, last))
    ring, mask = ring_of(places, line, q)
    both = interpolate_waves(past, ring, mask, k, w)
    jumps = jump_head(places, line["stretch"] + q, wave)
    value = (both[1] if wave == 1 else both[0]) + jumps_until(past, places, jumps, until)
    if at <= last or t <= last:
        return value
    if q == (line["stretches"] - 1 if wave == 1 else 0):  # interpolated to the wave that its node sends now
        now = out[tables.layout[0]["ends"] + 4 * line["pipe"] + 3 * wave]
        return value + (now - value) * (at - last) / (t - last)
    pipe, before = tables.pipes[line["pipe"]], q + 1 if wave == 1 else q - 1
    r, l = read_waves(past, places, reading_data(past, newest), line, before, at - line["tau"])
    delta = friction_loss(pipe, line, r, l)
    return l + delta if wave == 1 else r - delta


@njit
def waves_at(t, out, tables, number, share):
    """(forward, backward) wave [kg/s] at t of delay line `number` at a fraction `share` of its length from `from`.

    out : values of the right-hand side at t
    """
    line = tables.delays[number]
    pipe, stretches = tables.pipes[line["pipe"]], line["stretches"]
    q = min(int(share * stretches), stretches - 1)
    x, tau = share * stretches - q, line["tau"]
    r = sent_wave(t, out, tables, number, q, 0, t - x * tau)
    l = sent_wave(t, out, tables, number, q, 1, t - (1.0 - x) * tau)
    then = t - max(x, 1.0 - x) * tau
    near = r if x >= 0.5 else sent_wave(t, out, tables, number, q, 0, then)
    far = l if x < 0.5 else sent_wave(t, out, tables, number, q, 1, then)
    delta = friction_loss(pipe, line, near, far)
    return r - x * delta, l + (1.0 - x) * delta


@njit
def waves_along_line(t, out, tables, number, r, l):
    """Write forward and backward wave [kg/s] at the centres of r.size equal parts of line `number` to r and l.

    out : values of the right-hand side at t
    """
    n = r.size
    for j in range(n):
        r[j], l[j] = waves_at(t, out, tables, number, (j + 0.5) / n)


@njit
def sent_wave_linear(past, places, clock, ring, mask, jumps, wave, t):
    """Wave sent into a stretch at t [kg/s], by linear interpolation between entries, with its jumps.

    ring, mask : result of `ring_of`; places : result of `offsets_of`; clock : result of `reading_data`
    jumps : offset of the head of its jumps; wave : 0 forward, 1 backward
    """
    last, latest, often, even = clock[0], clock[1], clock[2], clock[3]
    place = (t - latest) * often
    if place > -even:
        back = int(place)
        k, x = last + back - 1, place - back + 1.0
    else:
        k, x = find_interval(past, last, t)
        if k < PROFILE_ENTRIES and x == 0.0:  # before the first entry
            return jumps_until(past, places, jumps, t + clock[4])
    a, b = ring + 2 * (k & mask) + wave, ring + 2 * ((k + 1) & mask) + wave
    return past[a] + x * (past[b] - past[a]) + jumps_until(past, places, jumps, t + clock[4])


@njit(forceinline=True)
def waves_at_linear(t, past, places, clock, line, share):
    """Both waves as in `waves_at` at the time t of the last entry, by linear interpolation; used for envelopes.

    The friction loss is that of the waves that arrive at the ends of the stretch at t.
    line : row of the delay line; share : distance from `from` as a fraction of its length
    past, places, clock : wave history, result of `offsets_of`, result of `reading_data`
    """
    stretches, tau = line["stretches"], line["tau"]
    q = min(int(share * stretches), stretches - 1)
    x, s = share * stretches - q, line["stretch"] + q
    ring, mask = ring_of(places, line, q)
    delta, jumps = past[places[0] + ARRIVALS_SIZE * s + 2], jump_head(places, s, 0)
    steps = tau * clock[2]
    if steps + 2.0 < clock[3] and past[jumps + JUMP_COUNT] + past[jumps + HEAD_SIZE + JUMP_COUNT] == 0.0:
        ahead, back = x * steps, (1.0 - x) * steps  # age of both waves [steps]
        i, j = int(ahead), int(back)
        a, b = ring + 2 * ((clock[0] - i) & mask), ring + 2 * ((clock[0] - i - 1) & mask)
        c, d = ring + 2 * ((clock[0] - j) & mask) + 1, ring + 2 * ((clock[0] - j - 1) & mask) + 1
        r = past[a] + (ahead - i) * (past[b] - past[a]) + past[jumps + REMOVED_SUM]
        l = past[c] + (back - j) * (past[d] - past[c]) + past[jumps + HEAD_SIZE + REMOVED_SUM]
    else:
        r = sent_wave_linear(past, places, clock, ring, mask, jumps, 0, t - x * tau)
        l = sent_wave_linear(past, places, clock, ring, mask, jumps + HEAD_SIZE, 1, t - (1.0 - x) * tau)
    return r - x * delta, l + (1.0 - x) * delta


@njit
def waves_along_line_number(t, out, handle, number, r, l):
    """Write forward and backward wave [kg/s] at the centres of r.size equal parts of delay line `number` to r and l."""
    waves_along_line(t, out, open_tables(handle), number, r, l)


@njit
def observe_lines(t, y, out, handle, values):
    """Write the values of the pressure and flow probes within delay lines, between their ends, to `values`."""
    tables = open_tables(handle)
    probes = tables.probes
    for k in range(probes.size):
        probe = probes[k]
        if (probe["kind"] == PIPE_PRESSURE or probe["kind"] == PIPE_FLOW) and probe["side"] == 0:
            pipe = tables.pipes[probe["index"]]
            if pipe["delay"] >= 0:
                r, l = waves_at(t, out, tables, pipe["delay"], tables.floats[probe["weights"]])
                value = r + l if probe["kind"] == PIPE_PRESSURE else pipe["flow"] + (r - l)
                values[k] = probe["scale"] * value + probe["offset"]
