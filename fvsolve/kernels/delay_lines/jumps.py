"""Jumps in delay lines: detection, storage, passage through friction and through the joints between stretches.

A jump is an instantaneous change of a wave by a schedule, a valve or an event. A jump below the size of `least_jump`
joins the smooth part of the wave. Friction in the middle of a stretch reflects the difference of the friction losses
with and without the jump. s, q : stretch, counted over all lines, or within its line; wave : 0 forward, 1 backward.
pipe, line : row of the pipe and of its delay line; places : result of `offsets_of`.
"""

from fvsolve.jit import njit
from fvsolve.kernels.calls import CLOSE, run_job
from fvsolve.kernels.delay_lines.line_rates import friction_loss, has_friction, write_all_arrivals, write_arrivals
from fvsolve.kernels.delay_lines.wave_history import (
    ARRIVALS_COUNT,
    ARRIVALS_SIZE,
    ARRIVALS_TIME,
    ARRIVED_COUNT,
    CORRECTED_TIME,
    COUNT,
    FIRST_JUMP,
    GREATEST_JUMP,
    GREATEST_UNSTORED_JUMP,
    GREATEST_WAVE,
    HEAD_SIZE,
    INFINITE,
    JUMP_CAPACITY,
    JUMP_COUNT,
    arrived_until,
    insert_jump,
    interpolate_waves,
    jump_head,
    jump_list,
    jumps_until,
    newest_before,
    passed_jumps,
    reading_data,
    ring_of,
    stencil,
    time_tolerance,
    wrap_index,
    write_entry,
)
from fvsolve.kernels.dtypes import AMENDED, STATUS

NAN = float("nan")
NOISE = 1e-13  # fraction of a wave of half a bar below which a change is rounding


@njit(forceinline=True)
def has_short_lines(tables):
    """True if the travel time of any delay line is shorter than the longest step."""
    for i in range(tables.delays.size):
        if tables.delays[i]["now"] > 0.0:
            return True
    return False


@njit(forceinline=True)
def least_jump(past, tables, pipe):
    """Size up to which a jump joins the smooth part of a wave of a pipe [kg/s].

    A quarter of `numerics.delay_tolerance` times the greatest jump or wave so far, and at least rounding.
    """
    least = tables.settings[0]["jumps"] * max(past[GREATEST_JUMP], past[GREATEST_WAVE])
    return max(least, NOISE * 0.5e5) * pipe["admittance"]


@njit
def store_jump(past, places, s, wave, t, size, pipe):
    """Store a jump of a wave that enters stretch s at t; if the list is full, only update the greatest unstored jump.

    past[GREATEST_UNSTORED_JUMP] is the greatest pressure of the jumps that could not be stored [Pa].
    s : stretch counted over all lines; wave : 0 forward, 1 backward; size : change of the wave [kg/s]
    pipe : row of the line's pipe; past, places : wave history, and result of `offsets_of`
    """
    if not insert_jump(past, places, jump_head(places, s, wave), t, size):
        past[GREATEST_UNSTORED_JUMP] = max(past[GREATEST_UNSTORED_JUMP], abs(size) / pipe["admittance"])


@njit
def store_large_jump(past, places, tables, s, wave, t, size, pipe):
    """Store a jump of a wave that enters stretch s at t, unless it is small.

    A jump up to the size of `least_jump` joins the smooth part of the wave. Arguments as for `store_jump`.
    """
    if abs(size) > least_jump(past, tables, pipe):
        store_jump(past, places, s, wave, t, size, pipe)


@njit(forceinline=True)
def first_waiting_jump(past, places, s, wave):
    """Offset in `past` of the time of the oldest jump of a wave that has not left stretch s; -1 without such a jump.

    Its size is `past[JUMP_CAPACITY]` places further. s : stretch counted over all lines; wave : 0 forward, 1 backward
    """
    at, queue = jump_head(places, s, wave), int(past[JUMP_CAPACITY])
    if not past[at + ARRIVED_COUNT] < past[at + JUMP_COUNT]:
        return -1
    return jump_list(places, queue, at) + wrap_index(int(past[at + FIRST_JUMP]) + int(past[at + ARRIVED_COUNT]), queue)


@njit
def reflected_part(past, places, tables, line, pipe, q, wave, size, t):
    """Part of a jump that friction in the middle of stretch q reflects [kg/s]; the jump is not yet passed on.

    size : change of the wave by the jump [kg/s]; t : end of the step in which it reaches the end of the stretch [s]
    line, pipe : rows of the delay line and of its pipe; wave : 0 forward, 1 backward
    past, places : wave history, and result of `offsets_of`
    """
    if not has_friction(pipe):
        return 0.0
    ring, mask = ring_of(places, line, q)
    k, w = stencil(past, reading_data(past, newest_before(past, t)), t - line["hold"])
    r, l = interpolate_waves(past, ring, mask, k, w)
    head = jump_head(places, line["stretch"] + q, 0)
    r, l = r + passed_jumps(past, places, head), l + passed_jumps(past, places, head + HEAD_SIZE)
    before = friction_loss(pipe, line, r, l)
    if wave == 0:
        return friction_loss(pipe, line, r + size, l) - before
    return before - friction_loss(pipe, line, r, l + size)


@njit
def pass_jumps_at_joints(past, places, tables, t):
    """Pass all jumps that leave inner stretches of delay lines by t on to the next stretches, with their reflections.

    Inner stretches are neither the first nor the last of their line. Small jumps join the smooth part (`least_jump`).
    """
    queue = int(past[JUMP_CAPACITY])
    for number in range(tables.delays.size):
        line, pipe = tables.delays[number], tables.pipes[tables.delays[number]["pipe"]]
        for q in range(1, line["stretches"] - 1):
            for wave in range(2):
                s = line["stretch"] + q
                place = first_waiting_jump(past, places, s, wave)
                while place >= 0 and past[place] + line["tau"] <= t + time_tolerance(past):
                    when, size = min(past[place] + line["tau"], t), past[place + queue]
                    share = reflected_part(past, places, tables, line, pipe, q, wave, size, t)
                    past[jump_head(places, s, wave) + ARRIVED_COUNT] += 1.0
                    onward = 1 if wave == 0 else -1
                    store_large_jump(past, places, tables, s + onward, wave, when, size - share, pipe)
                    store_large_jump(past, places, tables, s - onward, 1 - wave, when, share, pipe)
                    place = first_waiting_jump(past, places, s, wave)


@njit
def write_joint_arrivals(past, places, tables, t):
    """Write the waves that arrive at t at both ends of every stretch, and its friction loss, into `past`.

    See `write_arrivals`; at the ends of lines see `write_all_arrivals`.
    """
    write_all_arrivals(past, tables, t)
    clock = reading_data(past, newest_before(past, t))
    for i in range(tables.delays.size):
        line = tables.delays[i]
        for q in range(1, line["stretches"] - 1):
            write_arrivals(past, places, clock, line, tables.pipes[line["pipe"]], q, t)


@njit
def complete_short_arrivals(past, places, tables, t):
    """Write the arriving waves of delay lines shorter than a step, with the part of sent waves that arrives at once.

    They replace the waves by `write_arrivals`, which hold for zero pressure deviations at both ends. The part that
    arrives at once is computed from the waves in the last entry. t : time of that entry
    """
    newest = int(past[COUNT]) - 1
    clock = reading_data(past, newest)
    for i in range(tables.delays.size):
        line, beta = tables.delays[i], tables.delays[i]["now"]
        if beta > 0.0:
            ring, mask = ring_of(places, line, 0)
            k, w = stencil(past, clock, t - line["hold"])
            u, v = interpolate_waves(past, ring, mask, k, w)
            head = jump_head(places, line["stretch"], 0)
            r = arrived_until(past, places, clock, head, t, line["tau"])
            l = arrived_until(past, places, clock, head + HEAD_SIZE, t, line["tau"])
            delta, at = friction_loss(tables.pipes[line["pipe"]], line, u + r, v + l), ring + 2 * (newest & mask)
            arrivals = places[0] + ARRIVALS_SIZE * line["stretch"]
            past[arrivals] = v + beta * (past[at + 1] - v) + l + delta
            past[arrivals + 1] = u + beta * (past[at] - u) + r - delta


@njit(forceinline=True)
def last_sent_wave(past, places, line, q, side, k):
    """Wave sent into stretch q of a delay line at entry k: its smooth part and all jumps so far [kg/s].

    side : 0 forward, 1 backward wave; line : row of the delay line; past, places : wave history, result of `offsets_of`
    """
    ring, mask = ring_of(places, line, q)
    jumps = jump_head(places, line["stretch"] + q, side)
    return past[ring + 2 * (k & mask) + side] + jumps_until(past, places, jumps, INFINITE)


@njit
def waves_differ(past, places, tables, k, out):
    """True if the waves that nodes send now differ from those of entry k by more than rounding, or are NaN.

    out : values of the right-hand side now; past, places : wave history, and result of `offsets_of`
    """
    for i in range(tables.delays.size):
        line = tables.delays[i]
        pipe, at = tables.pipes[line["pipe"]], tables.layout[0]["ends"] + 4 * line["pipe"]
        for side in range(2):
            old = last_sent_wave(past, places, line, line["stretches"] - 1 if side == 1 else 0, side, k)
            if not abs(out[at + 3 * side] - old) <= NOISE * 0.5e5 * pipe["admittance"]:
                return True
    return False


@njit
def detect_jumps(past, places, tables, t, y, out, short):
    """Compare the waves that nodes send now with the last entry; store large differences as jumps, others in the entry.

    t : time of the last entry; out : values of the right-hand side now
    short : True to solve nodes again, with the waves of that entry in lines shorter than a step. A jump then sets
        out[STATUS] to AMENDED, because the state must be evaluated again.
    past, places : wave history, and result of `offsets_of`
    """
    k, ends, state = int(past[COUNT]) - 1, tables.layout[0]["ends"], out
    if short:
        state = tables.spare[: tables.layout[0]["size"]]
        write_all_arrivals(past, tables, t)
        complete_short_arrivals(past, places, tables, t)
        past[ARRIVALS_TIME], past[ARRIVALS_COUNT] = t, past[COUNT]
        run_job(CLOSE, t, y, y[:0], state, tables.sharp)
        past[ARRIVALS_TIME] = NAN
    for stage in range(2):  # first the greatest jump, which the limit in `least_jump` needs
        for i in range(tables.delays.size):
            line = tables.delays[i]
            pipe, at = tables.pipes[line["pipe"]], ends + 4 * line["pipe"]
            for side in range(2):
                q, new = line["stretches"] - 1 if side == 1 else 0, state[at + 3 * side]
                old = last_sent_wave(past, places, line, q, side, k)
                if stage == 0:
                    past[GREATEST_JUMP] = max(past[GREATEST_JUMP], abs(new - old) / pipe["admittance"])
                    continue
                if abs(new - old) > least_jump(past, tables, pipe):
                    store_jump(past, places, line["stretch"] + q, side, t, new - old, pipe)
                    if short:
                        past[CORRECTED_TIME], out[STATUS] = t, AMENDED
                write_entry(past, places, line, q, k, side, new)
