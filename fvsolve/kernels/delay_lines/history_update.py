"""Update of the history of delay lines after an accepted state: sent waves, arrived jumps, pressure envelopes."""

from fvsolve.jit import njit
from fvsolve.kernels.delay_lines.extremes_at_jumps import store_values, update_line_extremes
from fvsolve.kernels.delay_lines.jumps import (
    detect_jumps,
    has_short_lines,
    pass_jumps_at_joints,
    waves_differ,
    write_joint_arrivals,
)
from fvsolve.kernels.delay_lines.jumps_at_nodes import admit_jumps, next_arrival, pass_jumps_at_ends
from fvsolve.kernels.delay_lines.line_interior import waves_at_linear
from fvsolve.kernels.delay_lines.wave_history import (
    ARRIVALS_SIZE,
    ARRIVED_COUNT,
    CORRECTED_TIME,
    COUNT,
    GREATEST_WAVE,
    HEAD_SIZE,
    INFINITE,
    JUMPS_TRAVELLING,
    NEXT_ARRIVAL,
    begin_entry,
    jump_head,
    offsets_of,
    reading_data,
    remove_arrived_jumps,
    time_of,
    time_tolerance,
    write_entry,
)
from fvsolve.kernels.dtypes import AMENDED, ARRIVES, NEVER, STATUS
from fvsolve.kernels.dtypes import ARRIVED as LET_ARRIVE
from fvsolve.kernels.observation import update_envelope
from fvsolve.kernels.table_handle import open_tables


@njit
def record_lines(t, y, out, handle, values):
    """After an accepted step, store the waves sent into delay lines, pass on arrived jumps, and update envelopes.

    For the status ARRIVED in `out`, only admit the jumps that end a step at t. The status AMENDED on return means that
    y or the waves have changed, so the state must be evaluated and recorded again. Otherwise out[ARRIVES] receives the
    time of the next jump that ends a step, t if it is now, or NEVER.
    values : probe values of the state y at t
    """
    tables = open_tables(handle)
    past = tables.past
    k, places, status = int(past[COUNT]), offsets_of(past), out[STATUS]
    if status == LET_ARRIVE:
        admit_jumps(past, places, tables, t)
        if has_short_lines(tables):
            detect_jumps(past, places, tables, time_of(past, k - 1), y, out, True)
            past[CORRECTED_TIME] = -INFINITE
        out[STATUS] = AMENDED
        return
    if k > 0 and t <= time_of(past, k - 1) + time_tolerance(past):
        record_again(past, places, tables, t, y, out)
    elif k == 0:  # a wave sent at the start is a jump: before, all waves were zero
        begin_entry(past, t)
        detect_jumps(past, places, tables, t, y, out, has_short_lines(tables))
    else:
        record_step(past, places, tables, t, y, out, handle)
    if out[STATUS] == AMENDED:
        return
    update_line_envelopes(t, places, tables)
    store_values(tables, out, values)
    if past[NEXT_ARRIVAL] > t + time_tolerance(past):
        past[NEXT_ARRIVAL] = next_arrival(past, places, tables, t)
        out[ARRIVES] = past[NEXT_ARRIVAL] if past[NEXT_ARRIVAL] < INFINITE else NEVER
    else:
        out[ARRIVES] = t


@njit
def record_again(past, places, tables, t, y, out):
    """Record a state at the time of the last entry again: after a kink or event, or after a correction of the state.

    After a correction the waves that nodes send replace those of the entry; otherwise changes are jumps
    (`detect_jumps`). An earlier state is ignored. past, places : wave history, and result of `offsets_of`
    """
    k = int(past[COUNT]) - 1
    last = time_of(past, k)
    if past[CORRECTED_TIME] == last:
        write_ends(past, places, tables, k, out)
        past[CORRECTED_TIME] = -INFINITE
    elif t >= last - time_tolerance(past):
        short = has_short_lines(tables) and waves_differ(past, places, tables, k, out)
        detect_jumps(past, places, tables, last, y, out, short)


@njit
def record_step(past, places, tables, t, y, out, handle):
    """Pass on the jumps that have arrived in an accepted step; then write the waves as a new entry.

    Jumps at nodes correct the states y; then out[STATUS] becomes AMENDED. Extremes beside jumps are updated.
    past, places : wave history, and result of `offsets_of`
    """
    before = time_of(past, int(past[COUNT]) - 1)
    write_joint_arrivals(past, places, tables, t)
    live = past[JUMPS_TRAVELLING] > 0.0
    if live:
        remove_all_arrived_jumps(past, places, tables.delays, before)
        pass_jumps_at_joints(past, places, tables, t)
        passed = pass_jumps_at_ends(past, places, tables, t, y, out, handle)
        if passed and has_short_lines(tables):  # jumps that have already passed are missing in the node pressures
            past[CORRECTED_TIME] = NAN
        write_joint_arrivals(past, places, tables, t)  # again: nodes were solved without the jumps in between
    entry, ends = begin_entry(past, t), tables.layout[0]["ends"]
    if past[CORRECTED_TIME] != past[CORRECTED_TIME]:
        past[CORRECTED_TIME], out[STATUS] = t, AMENDED
    for i in range(tables.delays.size):
        line = tables.delays[i]
        at, last = ends + 4 * line["pipe"], line["stretches"] - 1
        write_entry(past, places, line, 0, entry, 0, out[at])
        write_entry(past, places, line, last, entry, 1, out[at + 3])
        sent = max(abs(out[at]), abs(out[at + 3]))
        past[GREATEST_WAVE] = max(past[GREATEST_WAVE], sent / tables.pipes[line["pipe"]]["admittance"])
        for q in range(last):
            joint = places[0] + ARRIVALS_SIZE * (line["stretch"] + q)
            write_entry(past, places, line, q + 1, entry, 0, past[joint + 1])
            write_entry(past, places, line, q, entry, 1, past[joint + ARRIVALS_SIZE])
    if live:
        update_line_extremes(past, places, tables, before, t)


NAN = float("nan")


@njit(forceinline=True)
def update_line_envelope(t, places, clock, tables, number):
    """Update the pressure envelope along a delay line at the time t of the last entry.

    The first time below vapour pressure is updated too. number : number of the delay line
    places, clock : results of `offsets_of` and `reading_data`
    """
    line, envelope = tables.delays[number], tables.envelope
    n, cell = line["places"], tables.pipes[line["pipe"]]["cell"]
    r, l, low, high = tables.scratch[:n], tables.scratch[n : 2 * n], 0, 0
    for j in range(n):
        r[j], l[j] = waves_at_linear(t, tables.past, places, clock, line, (j + 0.5) / n)
        s = r[j] + l[j]
        low += not s >= envelope[0, cell + j]
        high += not s <= envelope[2, cell + j]
    if low + high > 0:
        update_envelope(t, r, l, cell, low, high, line["pipe"], tables)


@njit
def update_line_envelopes(t, places, tables):
    """Update the pressure envelopes along all delay lines at the time t of the last entry."""
    clock = reading_data(tables.past, int(tables.past[COUNT]) - 1)
    for i in range(tables.delays.size):
        update_line_envelope(t, places, clock, tables, i)


@njit
def write_ends(past, places, tables, entry, out):
    """Write the waves that nodes send into delay lines, which are in `out`, again into entry number `entry`.

    past, places : wave history, and result of `offsets_of`
    """
    for i in range(tables.delays.size):
        line, at = tables.delays[i], tables.layout[0]["ends"] + 4 * tables.delays[i]["pipe"]
        write_entry(past, places, line, 0, entry, 0, out[at])
        write_entry(past, places, line, line["stretches"] - 1, entry, 1, out[at + 3])


@njit
def remove_all_arrived_jumps(past, places, delays, before):
    """Remove the jumps that have been passed on and that no later reading needs from the lists of all delay lines.

    before : time of the last entry [s]
    """
    for i in range(delays.size):
        line = delays[i]
        for s in range(line["stretch"], line["stretch"] + line["stretches"]):
            for at in range(jump_head(places, s, 0), jump_head(places, s + 1, 0), HEAD_SIZE):
                if past[at + ARRIVED_COUNT] > 0.0:
                    remove_arrived_jumps(past, places, at, before - line["hold"] - time_tolerance(past))
