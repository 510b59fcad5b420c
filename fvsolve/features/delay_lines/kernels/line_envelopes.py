"""Pressure envelopes along delay lines, and extremes of probes in them: at recorded states and on both sides of jumps.

Extremes beside jumps are those at the centres of cells and where two jumps cross. Cells, jumps and pairs of jumps are
left out where the bounds of the waves (`wave_bounds`) show that they cannot extend the envelope.

before, t : begin and end of a step [s]; span : (before, t); known : range of the sum of both waves in which nothing
changes; waves : bounds of both waves; other arguments are those of `wave_history`.
"""

from fvsolve.core.kernels.dtypes import PIPE_FLOW, PIPE_PRESSURE
from fvsolve.core.kernels.observation import update_envelope, update_extremes
from fvsolve.features.delay_lines.kernels import wave_bounds
from fvsolve.features.delay_lines.kernels import wave_history as history
from fvsolve.features.delay_lines.kernels.line_rates import (
    joint_at,
    smooth_wave_linear,
    waves_in_stretch,
)
from fvsolve.features.delay_lines.kernels.wave_bounds import (
    BOUND_ROUNDING,
    GRID_ROUNDING,
    wave_at_jump,
)
from fvsolve.jit import njit

SLACK = 1e-9  # by which cells count as longer, as fraction of a stretch


@njit(forceinline=True)
def stays_within(low, high, other, most, known):
    """True if the sum of a wave between `low` and `high` and another wave stays in the range `known`.

    other : bounds of the other wave; most : bound of the friction loss [kg/s]
    """
    return low + other[0] - most >= known[0] and high + other[1] + most <= known[1]


EVERYWHERE = (-history.INFINITE, history.INFINITE)  # bounds of any wave
NOWHERE = (history.INFINITE, -history.INFINITE)  # range that contains no wave


@njit
def line_extremes_at_jumps(
    past, places, clock, line, both, shares, sign, begin, span, waves, most, known
):
    """Extremes of r + sign l on both sides of the jumps that pass a point of a delay line, without friction loss.

    Returns (least, time of the least, greatest, time of the greatest) [kg/s, s]; without a jump, least is INFINITE.
    Jumps with values in `known` are left out.
    r, l : forward and backward wave; sign : 1 for pressure, -1 for flow
    both : stretches in which both waves pass the point, different ones at a joint
    shares : fraction of its stretch that each wave has crossed at the point
    begin : positions in the lists of forward and backward jumps to begin with; most : bound of the friction loss [kg/s]
    """
    before, t = span
    least = history.INFINITE
    t_least = t
    greatest = -history.INFINITE
    t_greatest = t
    queue = int(past[history.JUMP_CAPACITY])
    tau = line["tau"]
    s = line["stretch"]
    same = clock[4]
    for wave in range(2):
        head = history.jump_head(places, s + both[wave], wave)
        other = history.jump_head(places, s + both[1 - wave], 1 - wave)
        (ring, mask), (other_ring, _) = (
            history.ring_of(places, line, both[wave]),
            history.ring_of(places, line, both[1 - wave]),
        )
        share, other_bounds = shares[wave], waves[1 - wave]
        # a jump meets a wave sent `back` later
        begins, back = before - share * tau + same, (share - shares[1 - wave]) * tau
        first = history.count_until(past, places, head, begin[wave], begins)
        reached = begin[1 - wave]
        for i in range(first, int(past[head + history.JUMP_COUNT])):
            place = history.jump_place(past, places, head, i)
            sent, size = past[place], past[place + queue]
            if sent > t - share * tau + same:
                break
            low = past[place + 3 * queue] + other_bounds[0]
            high = past[place + 4 * queue] + other_bounds[1]
            if (low >= least or low - most >= known[0]) and (
                high <= greatest or high + most <= known[1]
            ):
                continue
            reached = history.count_until(past, places, other, reached, sent + back + same)
            here = wave_at_jump(past, places, clock, ring, mask, head, wave, i)
            there = smooth_wave_linear(past, clock, other_ring, mask, 1 - wave, sent + back)
            earlier = history.count_back(past, places, other, reached, sent + back - same)
            for side in range(2):
                # jumps that cross at the point change both waves at once
                moved = here - (1 - side) * size
                opposite = there + history.sum_of_first(
                    past, places, other, earlier if side == 0 else reached
                )
                value = moved + sign * opposite if wave == 0 else opposite + sign * moved
                if value < least:
                    least, t_least = value, sent + share * tau
                if value > greatest:
                    greatest, t_greatest = value, sent + share * tau
    return least, t_least, greatest, t_greatest


@njit
def bounds_of_jumps(past, places, at, begin, end):
    """(position in a list of the first jump after time `end`, bounds of the jumps from position `begin` up to it)."""
    queue = int(past[history.JUMP_CAPACITY])
    low = history.INFINITE
    high = -history.INFINITE
    i = begin
    while i < int(past[at + history.JUMP_COUNT]):
        place = history.jump_place(past, places, at, i)
        if past[place] > end:
            break
        low = min(low, past[place + 3 * queue])
        high = max(high, past[place + 4 * queue])
        i = i + 1
    return i, (low, high)


@njit
def list_crossed_jumps(past, places, at, begin, stop, ahead, known, crossed):
    """List those of the backward jumps `begin` to `stop` - 1 that may leave the range `known` with a forward wave.

    Returns (number of these jumps, their bounds).
    ahead : bounds of the forward wave; crossed : receives the offsets of the jumps in `past`
    """
    queue = int(past[history.JUMP_CAPACITY])
    count = 0
    low = history.INFINITE
    high = -history.INFINITE
    for j in range(begin, stop):
        place = history.jump_place(past, places, at, j)
        own = past[place + 3 * queue], past[place + 4 * queue]
        if not stays_within(own[0], own[1], ahead, 0.0, known):
            crossed[count] = place
            low = min(low, own[0])
            high = max(high, own[1])
            count = count + 1
    return count, (low, high)


@njit
def envelope_where_jumps_cross(past, places, clock, tables, line, q, x, at, begin, span):
    """Update the pressure envelope at each point of a cell where two jumps cross in a step.

    All four combinations of values before and after both jumps are used.
    x : both ends of the cell as fractions of stretch q; at : number of the cell
    begin : positions in the lists of forward and backward jumps to begin with
    """
    before, t = span
    queue = int(past[history.JUMP_CAPACITY])
    tau = line["tau"]
    s = line["stretch"] + q
    same = clock[4]
    forward = history.jump_head(places, s, 0)
    backward = history.jump_head(places, s, 1)
    envelope = tables.envelope
    delta = abs(past[places[0] + history.ARRIVALS_SIZE * s + 2])
    first = history.count_until(past, places, forward, begin[0], before - x[1] * tau - same)
    end = t - x[0] * tau + same
    stop, ahead = bounds_of_jumps(past, places, forward, first, end)
    last, _ = bounds_of_jumps(past, places, backward, begin[1], t - (1.0 - x[1]) * tau + 2.0 * same)
    crossed, known = tables.scratch[3 * line["places"] :], (envelope[0, at], envelope[2, at])
    ahead = ahead[0] - delta, ahead[1] + delta
    count, back = list_crossed_jumps(past, places, backward, begin[1], last, ahead, known, crossed)
    if count == 0:
        return
    for i in range(first, stop):
        place = history.jump_place(past, places, forward, i)
        low, high = past[place + 3 * queue] - delta, past[place + 4 * queue] + delta
        if not stays_within(low, high, back, 0.0, (envelope[0, at], envelope[2, at])):
            jumps = crossed[:count]
            cross_jumps(past, places, clock, tables, line, q, x, at, i, (low, high), jumps, span)


@njit
def cross_jumps(past, places, clock, tables, line, q, x, at, i, bounds, crossed, span):
    """Update the envelope at the points of a cell where forward jump i crosses backward jumps.

    bounds : of the forward wave at its jump, widened by the friction loss
    crossed : offsets of backward jumps in `past`; other arguments are those of `envelope_where_jumps_cross`
    """
    before, t = span
    queue = int(past[history.JUMP_CAPACITY])
    tau = line["tau"]
    s = line["stretch"] + q
    same = clock[4]
    first_cell, (ring, mask) = tables.pipes[line["pipe"]]["cell"], history.ring_of(places, line, q)
    forward = history.jump_head(places, s, 0)
    backward = history.jump_head(places, s, 1)
    envelope = tables.envelope
    delta = past[places[0] + history.ARRIVALS_SIZE * s + 2]
    n = line["places"]
    r = history.NAN
    place = history.jump_place(past, places, forward, i)
    sent, size = past[place], past[place + queue]
    # Times of sending with which a backward jump crosses this jump within the step and the cell.
    opens, ends = max(2.0 * before - tau - sent, sent - tau), min(2.0 * t - tau - sent, sent + tau)
    opens = max(opens, sent - tau + 2.0 * tau * x[0])
    ends = min(ends, sent - tau + 2.0 * tau * x[1])
    for k in range(crossed.size):
        other, known = int(crossed[k]), (envelope[0, at], envelope[2, at])
        if stays_within(
            bounds[0], bounds[1], (past[other + 3 * queue], past[other + 4 * queue]), 0.0, known
        ):
            continue  # a pair at the end of the cell is looked at with the next cell too
        opposite, change = past[other], past[other + queue]
        if opposite <= opens + same or opposite > ends + same:
            continue
        # The forward wave is needed only if a pair may extend the envelope.
        if r != r:
            r = wave_at_jump(past, places, clock, ring, mask, forward, 0, i)
        j = history.jump_number(past, places, backward, other)
        l = wave_at_jump(past, places, clock, ring, mask, backward, 1, j)
        # Two jumps meet where their ages add up to the travel time.
        where, time = 0.5 * (tau + opposite - sent) / tau, 0.5 * (tau + opposite + sent)
        cell = first_cell + min(int((q + where) * n / line["stretches"]), n - 1)
        for side in range(4):
            value = r - (side % 2) * size + l - (side // 2) * change
            update_extremes(envelope, cell, time, value + (1.0 - 2.0 * where) * delta)


@njit(forceinline=True)
def jump_until(past, places, at, i, t):
    """True if jump i of a list exists and was sent up to t."""
    return (
        i < int(past[at + history.JUMP_COUNT])
        and past[history.jump_place(past, places, at, i)] <= t
    )


@njit
def update_stretch_extremes(past, places, clock, tables, line, q, before, t, unchanged):
    """Update the envelope along stretch q of a delay line by the values beside jumps that pass within a step.

    The first time below vapour pressure is updated too.
    unchanged : float64[n]  receives 1 for cells where no value in this step can change anything
    """
    pipe = tables.pipes[line["pipe"]]
    stretches = line["stretches"]
    n = line["places"]
    tau = line["tau"]
    head = history.jump_head(places, line["stretch"] + q, 0)
    newest = clock[0]
    envelope = tables.envelope
    cell = pipe["cell"]
    other = head + history.HEAD_SIZE
    bounds, (_, mask) = history.bounds_of(places, line, q), history.ring_of(places, line, q)
    reach = clock[4] + GRID_ROUNDING / clock[2]
    delta = past[places[0] + history.ARRIVALS_SIZE * (line["stretch"] + q) + 2]
    first = newest
    last = newest
    wrap = int(past[history.CAPACITY]) - 1
    width = stretches / n
    back_first = back_last = wave_bounds.entry_back(past, wrap, newest, before - tau - reach)
    i, k = int(past[head + history.JUMP_COUNT]), 0
    for j in range((q * n) // stretches, min(n, ((q + 1) * n) // stretches + 1)):
        low, high = max(j * width - q, 0.0) - SLACK, min((j + 1) * width - q, 1.0) + SLACK
        first = wave_bounds.entry_back(past, wrap, first, before - high * tau - reach)
        last = wave_bounds.entry_back(past, wrap, last, t - low * tau + reach)
        back_first = wave_bounds.entry_ahead(
            past, wrap, back_first, newest, before - (1.0 - low) * tau - reach
        )
        back_last = wave_bounds.entry_ahead(
            past, wrap, back_last, newest, t - (1.0 - high) * tau + reach
        )
        ahead = wave_bounds.bounds_between(past, bounds, mask, 0, first, last)
        back = wave_bounds.bounds_between(past, bounds, mask, 1, back_first, back_last)
        most, floor = 0.0, envelope[0, cell + j]
        # Friction changes the sum of both waves by less than delta along the stretch.
        if delta != 0.0:
            most = abs(delta) + BOUND_ROUNDING * (
                abs(ahead[0]) + abs(ahead[1]) + abs(back[0]) + abs(back[1])
            )
        # While the pipe has not boiled, values below vapour pressure must not be left out.
        if tables.marks[line["pipe"]] != tables.marks[line["pipe"]]:
            floor = max(floor, tables.profile[cell + j])
        known = (floor, envelope[2, cell + j])
        if stays_within(ahead[0], ahead[1], back, most, known):
            # the centre is in this stretch, not at a joint
            if 2 * n * q < (2 * j + 1) * stretches < 2 * n * (q + 1):
                unchanged[j] = 1.0
            continue
        i = history.count_back(past, places, head, i, before - high * tau - reach)
        k = history.count_until(past, places, other, k, before - (1.0 - low) * tau - reach)
        forward = jump_until(past, places, head, i, t - low * tau + reach)
        backward = jump_until(past, places, other, k, t - (1.0 - high) * tau + reach)
        if high > low and (forward or backward):
            extend_envelope(
                past,
                places,
                clock,
                tables,
                line,
                q,
                j,
                (i, k),
                (before, t),
                (ahead, back),
                most,
                known,
            )
        if high > low and forward and backward:
            ends, span = (low, high), (before, t)
            envelope_where_jumps_cross(
                past, places, clock, tables, line, q, ends, cell + j, (i, k), span
            )


@njit
def extend_envelope(past, places, clock, tables, line, q, j, begin, span, waves, most, known):
    """Extend the envelope of cell j of a delay line by the values beside jumps that pass its centre in stretch q.

    Other arguments are those of `line_extremes_at_jumps`.
    """
    share = (j + 0.5) / line["places"]
    x, joint = share * line["stretches"] - q, joint_at(share, line["stretches"])
    both = (q, q)
    shares = (x, 1.0 - x)
    delta = past[places[0] + history.ARRIVALS_SIZE * (line["stretch"] + q) + 2]
    if joint > 0:  # as in `waves_at`; the bounds are those of one stretch
        both = (joint, joint - 1)
        shares = (0.0, 0.0)
        delta = 0.0
        begin, waves = (0, 0), (EVERYWHERE, EVERYWHERE)
    elif not 0.0 <= x < 1.0:
        return
    found = line_extremes_at_jumps(
        past, places, clock, line, both, shares, 1.0, begin, span, waves, most, known
    )
    if found[0] == history.INFINITE:
        return
    pipe, mark = tables.pipes[line["pipe"]], line["pipe"]
    cell, more = pipe["cell"] + j, (1.0 - 2.0 * x) * delta
    if found[0] + more < tables.profile[cell] and tables.marks[mark] != tables.marks[mark]:
        tables.marks[mark] = found[1]
    update_extremes(tables.envelope, cell, found[1], found[0] + more)
    update_extremes(tables.envelope, cell, found[3], found[2] + more)


@njit
def update_probe_extremes(past, places, clock, tables, before, t):
    """Update the extremes of probes within delay lines by the values beside jumps between the times `before` and t."""
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        if (probe["kind"] != PIPE_PRESSURE and probe["kind"] != PIPE_FLOW) or probe["side"] != 0:
            continue
        pipe = tables.pipes[probe["index"]]
        if tables.line_of[probe["index"]] < 0:
            continue
        line = tables.delays[tables.line_of[probe["index"]]]
        share = tables.floats[probe["weights"]]
        q = min(int(share * line["stretches"]), line["stretches"] - 1)
        joint = joint_at(share, line["stretches"])
        x, sign = share * line["stretches"] - q, 1.0 if probe["kind"] == PIPE_PRESSURE else -1.0
        both, shares = (q, q), (x, 1.0 - x)
        delta = past[places[0] + history.ARRIVALS_SIZE * (line["stretch"] + q) + 2]
        if joint > 0:  # as in `waves_at`
            both = (joint, joint - 1)
            shares = (0.0, 0.0)
            delta = 0.0
        more = (1.0 - 2.0 * x) * delta if sign > 0.0 else pipe["flow"] - delta
        least, t_least, greatest, t_greatest = line_extremes_at_jumps(
            past,
            places,
            clock,
            line,
            both,
            shares,
            sign,
            (0, 0),
            (before, t),
            (EVERYWHERE, EVERYWHERE),
            0.0,
            NOWHERE,
        )
        if least < history.INFINITE:
            update_extremes(
                tables.extremes, k, t_least, probe["scale"] * (least + more) + probe["offset"]
            )
            update_extremes(
                tables.extremes, k, t_greatest, probe["scale"] * (greatest + more) + probe["offset"]
            )


@njit
def update_line_extremes(past, places, clock, tables, line, before, t, unchanged):
    """Update the envelope along a delay line by the values beside jumps that pass within a step.

    unchanged : float64[n]  receives 1 for cells where no value in this step can change anything, else 0
    """
    for j in range(unchanged.size):
        unchanged[j] = 0.0
    for q in range(line["stretches"]):
        head = history.jump_head(places, line["stretch"] + q, 0)
        if (
            past[head + history.JUMP_COUNT] + past[head + history.HEAD_SIZE + history.JUMP_COUNT]
            > 0.0
        ):
            wave_bounds.write_bounds(past, places, clock, line, q, 0)
            wave_bounds.write_bounds(past, places, clock, line, q, 1)
            update_stretch_extremes(past, places, clock, tables, line, q, before, t, unchanged)


@njit
def write_waves_at_joints(t, past, places, clock, line, r, l):
    """Write both waves at the time t of the last entry to the places of a line that are at joints, as in `waves_at`."""
    stretches, n = line["stretches"], r.size
    for joint in range(1, stretches):
        # True if a cell centre is at the joint, (j + 1/2) / n = joint / stretches, without rounding.
        if (2 * n * joint - stretches) % (2 * stretches) == 0:
            j = (2 * n * joint - stretches) // (2 * stretches)
            r[j], l[j] = (
                history.newest_wave(past, places, clock, line, joint, 0, t),
                history.newest_wave(past, places, clock, line, joint - 1, 1, t),
            )


@njit
def update_line_envelopes(before, t, places, tables, recorded):
    """Update the pressure envelopes along all delay lines by the values of the last step.

    These are the values beside jumps, if `before` < t, and if `recorded` those at t, the time of the last entry. The
    first times below vapour pressure, and the extremes of probes beside jumps, are updated too.
    """
    past, envelope = tables.past, tables.envelope
    clock = history.reading_data(past, int(past[history.COUNT]) - 1)
    for i in range(tables.delays.size):
        line = tables.delays[i]
        n, cell = line["places"], tables.pipes[line["pipe"]]["cell"]
        r = tables.scratch[:n]
        l = tables.scratch[n : 2 * n]
        low = 0
        high = 0
        j = 0
        unchanged = tables.scratch[2 * n : 3 * n if before < t else 2 * n]
        if before < t:
            update_line_extremes(past, places, clock, tables, line, before, t, unchanged)
        if not recorded:
            continue
        for q in range(line["stretches"]):
            j = waves_in_stretch(
                t, past, places, clock, line, q, j, r, l, unchanged, envelope[2, cell : cell + n]
            )
        write_waves_at_joints(t, past, places, clock, line, r, l)
        for j in range(n):
            s = r[j] + l[j]
            low += not s >= envelope[0, cell + j]
            high += not s <= envelope[2, cell + j]
        if low + high > 0:
            update_envelope(t, r, l, cell, low, high, line["pipe"], tables)
    if before < t:
        update_probe_extremes(past, places, clock, tables, before, t)
