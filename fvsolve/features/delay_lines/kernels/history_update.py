"""Update of the history of delay lines after an accepted state: sent waves, jumps at joints and nodes, extremes.

A jump is an instantaneous change of a wave; it passes a point between two recorded states. The value just before or
after it is the smooth part at that time, by linear interpolation between both states, plus the jumps that have arrived
by then. Extremes are those at nodes; those within delay lines are in `line_envelopes`.

before, t : begin and end of a step [s]; other arguments are those of `wave_history`.

Each jump passes nodes at its own time, in order of arrival, with the values on both sides of it. At a junction of pipes
only, the pressure is twice the sum of the arriving waves over the sum of the admittances, so a jump is reflected and
passed on at once. At a valve the nodes are solved again with the jump. So a jump passes linear elements exactly, and
nonlinear elements by the secant over the jump. The tables `sharp` serve this purpose: there, lines shorter than a step
are treated like longer lines, so that a jump needs its travel time in them too. At nodes with instantaneous devices a
step ends when a large jump arrives (`ends_step`). The state just before is recorded, then the jump is admitted
(`admit_jumps`) and events act.

state : values of the right-hand side at the end of the step, with the jumps that have arrived so far; other arguments
are those of `wave_history`.
"""

from fvsolve.core.kernels.calls import CLOSE, observe_in_turn, run_job
from fvsolve.core.kernels.dtypes import (
    ALONE,
    AMENDED,
    ARRIVES,
    JUNCTION,
    NEVER,
    PIPE_FLOW,
    PIPE_PRESSURE,
    STATUS,
)
from fvsolve.core.kernels.dtypes import ARRIVED as LET_ARRIVE
from fvsolve.core.kernels.observation import update_extremes
from fvsolve.features.delay_lines.kernels import jumps
from fvsolve.features.delay_lines.kernels import wave_history as history
from fvsolve.features.delay_lines.kernels.jumps import (
    add_change,
    clear_changes,
    first_waiting_jump,
    least_jump,
    send_changes,
)
from fvsolve.features.delay_lines.kernels.line_envelopes import update_line_envelopes
from fvsolve.features.delay_lines.kernels.line_rates import has_friction
from fvsolve.features.delay_lines.kernels.tables import open_lines
from fvsolve.jit import njit


@njit(forceinline=True)
def spare_offsets(tables):
    """Offsets of six arrays in the array `spare`, in this order.

    - probe values of the last record
    - node pressures of the last record
    - probe values at the end of the step, without the jumps that arrive in the step
    - node pressures at the end of the step, without these jumps
    - work array
    - arrival times of jumps and changes that they cause, see `arrival_arrays`
    """
    at = 2 * tables.layout[0]["size"]
    probes = tables.probes.size
    nodes = tables.nodes.size
    both = probes + nodes
    return at, at + probes, at + both, at + both + probes, at + 2 * both, at + 3 * both


@njit
def store_values(tables, out, values):
    """Store probe values and node pressures of an accepted state in `spare`, as those of the last record."""
    first, second, _, _, _, _ = spare_offsets(tables)
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
    tables = open_lines(handle)
    _, _, third, fourth, fifth, _ = spare_offsets(tables)
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
    tables = open_lines(handle)
    past = tables.past
    spare = tables.spare
    marks = tables.marks
    pipes = tables.pipes
    nodes = tables.nodes
    first, second, third, fourth, fifth, _ = spare_offsets(tables)
    probes = tables.probes.size
    pressure = tables.layout[0]["pressure"]
    vapor = tables.settings[0]["vapor"]
    before = history.time_of(past, int(past[history.COUNT]) - 1)
    share = (t - time) / (t - before)
    values = spare[fifth : fifth + probes]
    observe_in_turn(t, y, state, handle, values)
    for k in range(probes):
        probe = tables.probes[k]
        if (probe["kind"] == PIPE_PRESSURE or probe["kind"] == PIPE_FLOW) and probe["side"] == 0:
            continue  # see `update_probe_extremes`
        # Linear between both records, with the jumps that `state` contains.
        value = values[k] + share * (spare[first + k] - spare[third + k])
        update_extremes(tables.extremes, k, time, value)
        mark = probe["mark"]
        if mark >= 0 and value < vapor and marks[mark] != marks[mark]:
            marks[mark] = time
    for i in range(nodes.size):
        p = state[pressure + i] + share * (spare[second + i] - spare[fourth + i])
        if nodes[i]["pressure"] + p < vapor and marks[pipes.size + i] != marks[pipes.size + i]:
            marks[pipes.size + i] = time


# multiple of the least jump above which a jump ends a step: about `numerics.delay_tolerance` of the greatest
STEP_END_FACTOR = 4.0
# jumps travelling at one time; with so many, only a jump as large as the greatest wave ends a step
CROWDED_COUNT = 1e6


@njit
def record_lines(t, y, out, handle, values):
    """After an accepted step, store the waves sent into delay lines, pass on arrived jumps, and update envelopes.

    For the status ARRIVED in `out`, only admit the jumps that end a step at t. The status AMENDED on return means that
    y or the waves have changed, so the state must be evaluated and recorded again. Otherwise out[ARRIVES] receives the
    time of the next jump that ends a step, t if it is now, or NEVER.
    values : probe values of the state y at t
    """
    tables = open_lines(handle)
    past = tables.past
    k = int(past[history.COUNT])
    places = history.offsets_of(past)
    status = out[STATUS]
    before = history.INFINITE
    if status == LET_ARRIVE:
        admit_jumps(past, places, tables, t)
        if jumps.has_short_lines(tables):
            jumps.detect_jumps(past, places, tables, history.time_of(past, k - 1), y, out, True)
            past[history.CORRECTED_TIME] = -history.INFINITE
        out[STATUS] = AMENDED
        return
    if k > 0 and t <= history.time_of(past, k - 1) + history.time_tolerance(past):
        record_again(past, places, tables, t, y, out)
    elif k == 0:  # a wave sent at the start is a jump: before, all waves were zero
        history.begin_entry(past, t)
        jumps.detect_jumps(past, places, tables, t, y, out, jumps.has_short_lines(tables))
    else:
        before = record_step(past, places, tables, t, y, out, handle)
    amended = out[STATUS] == AMENDED
    if not amended or before < t:
        update_line_envelopes(before, t, places, tables, not amended)
    if amended:
        return
    store_values(tables, out, values)
    # An arrival that is due stays until `admit_jumps` lets the jump arrive.
    if past[history.NEXT_ARRIVAL] > t + history.time_tolerance(past):
        past[history.NEXT_ARRIVAL] = next_arrival(past, places, tables, t)
    arrival = past[history.NEXT_ARRIVAL]
    out[ARRIVES] = NEVER
    # at the end of a segment the caller lets jumps arrive, with those of schedules
    if arrival < past[history.SEGMENT_END]:
        out[ARRIVES] = t if arrival <= t + history.time_tolerance(past) else arrival


@njit
def record_again(past, places, tables, t, y, out):
    """Record a state at the time of the last entry again: after a kink or event, or after a correction of the state.

    After a correction the waves that nodes send replace those of the entry; otherwise changes are jumps
    (`detect_jumps`). An earlier state is ignored.
    """
    k = int(past[history.COUNT]) - 1
    last, past[history.RESTATED_ENTRY] = history.time_of(past, k), k
    if past[history.CORRECTED_TIME] == last:
        write_ends(past, places, tables, k, out)
        past[history.CORRECTED_TIME] = -history.INFINITE
    elif t >= last - history.time_tolerance(past):
        short = jumps.has_short_lines(tables) and jumps.waves_differ(past, places, tables, k, out)
        jumps.detect_jumps(past, places, tables, last, y, out, short)


@njit
def record_step(past, places, tables, t, y, out, handle):
    """Pass on the jumps that have arrived in an accepted step; then write the waves as a new entry.

    Jumps at nodes correct the states y; then out[STATUS] becomes AMENDED. Returns the begin of the step if jumps are
    travelling, else INFINITE.
    """
    before = history.time_of(past, int(past[history.COUNT]) - 1)
    jumps.write_joint_arrivals(past, places, tables, t)
    live = past[history.JUMPS_TRAVELLING] > 0.0
    if live:
        remove_all_arrived_jumps(past, places, tables.delays, before)
        jumps.pass_jumps_at_joints(past, places, tables, t)
        passed = pass_jumps_at_ends(past, places, tables, t, y, out, handle)
        # jumps that have already passed are missing in the node pressures
        if passed and jumps.has_short_lines(tables):
            past[history.CORRECTED_TIME] = history.NAN
        # again: nodes were solved without the jumps in between
        jumps.write_joint_arrivals(past, places, tables, t)
    entry, ends = history.begin_entry(past, t), tables.layout[0]["ends"]
    # NaN: jumps have corrected the state, which must be evaluated again.
    if past[history.CORRECTED_TIME] != past[history.CORRECTED_TIME]:
        past[history.CORRECTED_TIME], out[STATUS] = t, AMENDED
    for i in range(tables.delays.size):
        line = tables.delays[i]
        at, last = ends + 4 * line["pipe"], line["stretches"] - 1
        history.write_entry(past, places, line, 0, entry, 0, out[at])
        history.write_entry(past, places, line, last, entry, 1, out[at + 3])
        sent = max(abs(out[at]), abs(out[at + 3]))
        past[history.GREATEST_WAVE] = max(
            past[history.GREATEST_WAVE], sent / tables.pipes[line["pipe"]]["admittance"]
        )
        # A wave that arrives at a joint is sent into the next stretch.
        for q in range(last):
            joint = places[0] + history.ARRIVALS_SIZE * (line["stretch"] + q)
            history.write_entry(past, places, line, q + 1, entry, 0, past[joint + 1])
            history.write_entry(
                past, places, line, q, entry, 1, past[joint + history.ARRIVALS_SIZE]
            )
    return before if live else history.INFINITE


@njit
def write_ends(past, places, tables, entry, out):
    """Write the waves that nodes send into delay lines, which are in `out`, again into entry number `entry`."""
    for i in range(tables.delays.size):
        line, at = tables.delays[i], tables.layout[0]["ends"] + 4 * tables.delays[i]["pipe"]
        history.write_entry(past, places, line, 0, entry, 0, out[at])
        history.write_entry(past, places, line, line["stretches"] - 1, entry, 1, out[at + 3])


@njit
def remove_all_arrived_jumps(past, places, delays, before):
    """Remove the jumps that have been passed on and that no later reading needs from the lists of all delay lines.

    before : time of the last entry [s]
    """
    for i in range(delays.size):
        line = delays[i]
        for s in range(line["stretch"], line["stretch"] + line["stretches"]):
            for at in range(
                history.jump_head(places, s, 0),
                history.jump_head(places, s + 1, 0),
                history.HEAD_SIZE,
            ):
                if past[at + history.ARRIVED_COUNT] > 0.0:
                    history.remove_arrived_jumps(
                        past, places, at, before - line["hold"] - history.time_tolerance(past)
                    )


# jumps at nodes ----------


@njit(forceinline=True)
def solved_alone(tables, i):
    """True if node i is solved without other nodes.

    Its pressure is then given by a state or schedule, or follows from arriving waves, known flows and its admittance.
    """
    node = tables.nodes[i]
    return node["kind"] != JUNCTION or node["solve"] == ALONE


@njit(forceinline=True)
def end_stretch(line, side):
    """Stretch at an end of a delay line, counted over all lines."""
    return line["stretch"] + (line["stretches"] - 1 if side == 1 else 0)


@njit(forceinline=True)
def ends_step(past, tables, line, pipe, q, wave, size):
    """True if a step ends when a jump of stretch q, or the part of it that friction reflects, leaves the stretch.

    The step ends if the jump arrives at a node with an instantaneous device and is large; after a small jump the device
    acts at the end of the step. The least size of a large jump never decreases in a run: otherwise a jump to be passed
    on within a step would stay in the list.
    size : change of the wave [kg/s]
    """
    acts = line["acts"]
    if acts == 0:
        return False
    crowd = past[history.MOST_JUMPS_TRAVELLING] / CROWDED_COUNT
    greatest = max(past[history.GREATEST_JUMP], past[history.GREATEST_WAVE])
    if abs(size) <= max(
        STEP_END_FACTOR * least_jump(past, tables, pipe), crowd * greatest * pipe["admittance"]
    ):
        return False
    first, last = q == 0 and acts % 2 == 1, q + 1 == line["stretches"] and acts >= 2
    return (first and (wave == 1 or has_friction(pipe))) or (
        last and (wave == 0 or has_friction(pipe))
    )


@njit
def next_arrival(past, places, tables, t):
    """Arrival time of the next jump that ends a step (`ends_step`) [s]; INFINITE for none.

    At most the end of the segment after t: schedules may jump there, and the state between such a jump and one that
    arrives at the same time never occurs. It may lie before t: a jump may cross a line shorter than a step within that
    step.
    """
    first_time, queue = history.INFINITE, int(past[history.JUMP_CAPACITY])
    for number in range(tables.delays.size):
        line, pipe = tables.delays[number], tables.pipes[tables.delays[number]["pipe"]]
        if line["acts"] == 0:
            continue
        for q in range(0, line["stretches"], max(1, line["stretches"] - 1)):
            for wave in range(2):
                at = history.jump_head(places, line["stretch"] + q, wave)
                for i in range(
                    int(past[at + history.ARRIVED_COUNT]), int(past[at + history.JUMP_COUNT])
                ):
                    place = history.jump_place(past, places, at, i)
                    arrival, size = past[place] + line["tau"], past[place + queue]
                    if ends_step(past, tables, line, pipe, q, wave, size):
                        first_time = min(first_time, arrival)
                        break
    end, tolerance = past[history.SEGMENT_END], history.time_tolerance(past)
    return end if end > t + tolerance and first_time >= end - tolerance else first_time


@njit
def admit_jumps(past, places, tables, t):
    """Let the jumps that end a step at t arrive, and all jumps that arrive with them, in any line.

    `detect_jumps` then computes the changes at nodes. The parts of the jumps that stay in a line, transmitted or
    reflected, enter the neighbouring stretches. past[NEXT_ARRIVAL] receives the time of the following such jump.
    """
    latest = t + history.time_tolerance(past)
    for number in range(tables.delays.size):
        line = tables.delays[number]
        for q in range(line["stretches"]):
            jumps.pass_waiting_jumps(past, places, tables, line, q, t, latest, t)
    past[history.NEXT_ARRIVAL], past[history.ARRIVALS_TIME] = (
        next_arrival(past, places, tables, t),
        history.NAN,
    )


@njit
def arrival_of(past, places, tables, number, slot, latest):
    """Arrival time of the next jump to leave an end stretch of a delay line, if it is at most `latest`, else INFINITE.

    Jumps that end a step (`ends_step`) are left out.
    slot : 0 or 1 for the forward or backward wave of the first stretch, 2 or 3 for those of the last
    """
    line = tables.delays[number]
    if slot > 1 and line["stretches"] == 1:
        return history.INFINITE
    q, wave = line["stretches"] - 1 if slot > 1 else 0, slot % 2
    place = first_waiting_jump(past, places, line["stretch"] + q, wave)
    if place < 0:
        return history.INFINITE
    size = past[place + int(past[history.JUMP_CAPACITY])]
    time = history.arrival_until(past[place], line["tau"], latest)
    if time <= latest and ends_step(past, tables, line, tables.pipes[line["pipe"]], q, wave, size):
        return history.INFINITE
    return time


@njit(forceinline=True)
def arrival_arrays(tables):
    """Tree of arrival times of jumps (`write_arrival`), and changes that they cause (`clear_changes`), in `spare`."""
    slots = 4 * tables.delays.size
    first = spare_offsets(tables)[5]
    n = 1
    while n < slots:
        n *= 2
    middle = first + 2 * n
    return tables.spare[first:middle], tables.spare[middle : middle + 2 * slots + 1]


@njit(forceinline=True)
def write_arrival(tree, k, time):
    """Write arrival time k to a binary tree, in which each element is the least of its two children.

    tree : float64[2 n]  the root is element 1, the times are the last n elements
    """
    k += tree.size // 2
    tree[k] = time
    while k > 1:
        time = min(time, tree[k ^ 1])
        k //= 2
        tree[k] = time


@njit(forceinline=True)
def earliest_arrival(tree):
    """Number of the least arrival time in a tree of `write_arrival`, the last one if several are equal."""
    k = 1
    while 2 * k < tree.size:
        k = 2 * k + 1 * (tree[2 * k + 1] <= tree[2 * k])
    return k - tree.size // 2


@njit
def write_all_times(past, places, tables, tree, latest):
    """Write the arrival times at the ends of all delay lines to a tree (`write_arrival`), see `arrival_of`."""
    n = tree.size // 2
    for k in range(n):
        within = k < 4 * tables.delays.size
        tree[n + k] = (
            arrival_of(past, places, tables, k // 4, k % 4, latest) if within else history.INFINITE
        )
    for k in range(n - 1, 0, -1):
        tree[k] = min(tree[2 * k], tree[2 * k + 1])


@njit
def times_may_change(past, tables, t):
    """True if a jump that arrives in a step until t may change the arrivals of other jumps in the step.

    This holds for lines with a travel time shorter than the step, and where jumps end a step (`ends_step`).
    """
    h = t - history.time_of(past, int(past[history.COUNT]) - 1)
    for i in range(tables.delays.size):
        if tables.delays[i]["acts"] != 0 or tables.delays[i][
            "tau"
        ] < h + 4.0 * history.time_tolerance(past):
            return True
    return False


@njit
def pass_jumps_at_ends(past, places, own, t, y, out, handle):
    """Pass on the jumps that leave first and last stretches of delay lines up to t, in order; return True if any do.

    Jumps that arrive together pass as one: the states between them never occur, and the result does not depend on the
    order of the lines. Extremes are updated by the values on both sides. Masses of storing nodes and lines and flows of
    columns in y are corrected (`jumps`). Jumps that end a step are left out.
    own : tables of the run, in which short lines couple their ends at once
    """
    latest, (tree, changes) = history.latest_arrival(past, t), arrival_arrays(own)
    write_all_times(past, places, own, tree, latest)
    if tree[1] > latest:
        return False
    sharp, changing = own.sharp, times_may_change(past, own, t)
    tables, state = open_lines(sharp), own.spare[: own.layout[0]["size"]]
    # Nodes are first solved as if no jump arrived in this step.
    past[history.ONLY_PASSED_JUMPS], past[history.ARRIVALS_TIME] = 1.0, history.NAN
    run_job(CLOSE, t, y, y[:0], state, handle)
    past[history.ONLY_PASSED_JUMPS] = 0.0
    past[history.ARRIVALS_TIME], past[history.ARRIVALS_COUNT] = t, past[history.COUNT]
    # Arriving waves without the jumps, which are added one by one as they pass.
    for i in range(tables.delays.size):
        line, at = tables.delays[i], tables.layout[0]["ends"] + 4 * tables.delays[i]["pipe"]
        past[places[0] + history.ARRIVALS_SIZE * end_stretch(line, 0)] = state[at + 1]
        past[places[0] + history.ARRIVALS_SIZE * end_stretch(line, 1) + 1] = state[at + 2]
    store_smooth_values(t, y, state, handle)
    clear_changes(changes)
    while tree[1] <= latest:
        time = min(tree[1], t)
        extremes_at_jump(t, time, y, state, handle)
        alone, times = pass_next_jumps(
            past, places, own, tables, tree, changes, t, y, state, latest
        )
        if not alone:
            solve_nodes_again(past, places, tables, t, y, state, changes, sharp, times)
        send_changes(past, places, tables, changes, time)
        # Jumps sent now may arrive, or let others arrive, within the same step.
        if changing:
            write_all_times(past, places, own, tree, latest)
        extremes_at_jump(t, time, y, state, handle)
    past[history.ARRIVALS_TIME] = history.NAN
    return True


@njit
def pass_next_jumps(past, places, own, tables, tree, changes, t, y, state, latest):
    """Let the next jumps that arrive together leave their stretches; what they send goes to the changes.

    Returns (True if no nodes must be solved for them, result of `change_times` for those where nodes must be solved).
    Jumps that were sent within the step have other times than older ones; their mean is weighted by size.
    own, tables : tables of the run, and those with lines shorter than a step as longer lines
    """
    until = min(latest, tree[1] + history.time_tolerance(past))
    queue = int(past[history.JUMP_CAPACITY])
    alone, total, since, booked = True, 0.0, 0.0, 0.0
    while tree[1] <= until:
        slot = earliest_arrival(tree)
        number, wave = slot // 4, slot % 2
        line = tables.delays[number]
        pipe, q = tables.pipes[line["pipe"]], line["stretches"] - 1 if slot % 4 > 1 else 0
        place = first_waiting_jump(past, places, line["stretch"] + q, wave)
        sent, jump = past[place], past[place + queue]
        share = jumps.reflected_part(past, places, line, pipe, q, wave, jump, t)
        past[history.jump_head(places, line["stretch"] + q, wave) + history.ARRIVED_COUNT] += 1.0
        times = jumps.change_times(past, tables, t, min(sent + line["tau"], t), sent)
        closed = leave_stretch(
            past, places, tables, y, state, changes, number, q, wave, jump - share, times
        )
        closed = (
            leave_stretch(
                past, places, tables, y, state, changes, number, q, 1 - wave, share, times
            )
            and closed
        )
        if not closed:
            alone, weight = False, abs(jump) / pipe["admittance"]
            total = total + weight
            since = since + weight * times[0]
            booked = booked + weight * times[1]
        write_arrival(tree, slot, arrival_of(past, places, own, number, slot % 4, latest))
    return alone, (since / total, booked / total) if total > 0.0 else (0.0, 0.0)


@njit
def leave_stretch(past, places, tables, y, state, changes, number, q, wave, size, times):
    """Pass a jump on from stretch q of a delay line, in the direction of a wave; False if nodes must be solved for it.

    At an end of the line it is added to the arriving wave in `past`; a node that is solved alone then responds, see
    `enter_plain_node`, which defines the arguments.
    """
    line, pipe = tables.delays[number], tables.pipes[tables.delays[number]["pipe"]]
    onward, side = q + 1 if wave == 0 else q - 1, 1 if wave == 0 else 0
    if size == 0.0:
        return True
    if 0 <= onward < line["stretches"]:
        add_change(changes, 4 * number + 2 + wave, size)
        return True
    past[places[0] + history.ARRIVALS_SIZE * end_stretch(line, side) + side] += size
    if not solved_alone(tables, pipe["to_node"] if side == 1 else pipe["from_node"]):
        return False
    enter_plain_node(past, tables, y, state, changes, number, side, size, times)
    return True


@njit
def enter_plain_node(past, tables, y, state, changes, number, side, size, times):
    """Let a jump arrive at an end of a delay line, at a node that is solved alone: the node sends jumps at once.

    y : states, corrected; state : values of the right-hand side at the end of the step, updated
    changes : see `clear_changes`; number : number of the line; size : change of the wave [kg/s]
    times : result of `change_times`
    """
    line = tables.delays[number]
    pipe = tables.pipes[tables.delays[number]["pipe"]]
    layout = tables.layout[0]
    i = pipe["to_node"] if side == 1 else pipe["from_node"]
    node, at = tables.nodes[i], layout["ends"] + 4 * line["pipe"]
    state[at + 1 + side] += size
    # Known pressure: the jump is reflected with the opposite sign.
    if node["kind"] != JUNCTION:
        state[at + 3 * side] -= size
        add_change(changes, 4 * number + side, -size)
        jumps.correct_store(past, tables, y, state, pipe, i, 2.0 * size, times)
        return
    # Junction: dp = 2 dw / sum of Y, and each pipe receives Y dp minus the wave that came from it.
    change = 2.0 * size / node["admittance"]
    state[layout["pressure"] + i] += change
    jumps.correct_columns(past, tables, y, i, change, times)
    for k in range(tables.node_ends[i], tables.node_ends[i + 1]):
        end = tables.node_ends[k]
        other, right = tables.delays[end // 2], end % 2
        pipe = tables.pipes[other["pipe"]]
        part = pipe["admittance"] * change - (size if end == 2 * number + side else 0.0)
        state[layout["ends"] + 4 * other["pipe"] + 3 * right] += part
        add_change(changes, 4 * (end // 2) + right, part)


@njit
def solve_nodes_again(past, places, tables, t, y, state, changes, sharp, times):
    """Solve the nodes with the waves that arrive now; the changes of the waves that they send are added to `changes`.

    y : states, corrected; state : values of the right-hand side before the jumps, replaced by the solution
    sharp : handle, see the module; times : result of `change_times`
    """
    layout, size = tables.layout[0], state.size
    solved = tables.spare[size : 2 * size]
    run_job(CLOSE, t, y, y[:0], solved, sharp)
    for i in range(tables.delays.size):
        pipe = tables.pipes[tables.delays[i]["pipe"]]
        at = layout["ends"] + 4 * tables.delays[i]["pipe"]
        for side in range(2):
            come = solved[at + 1 + side] - state[at + 1 + side]
            change = solved[at + 3 * side] - state[at + 3 * side]
            end = pipe["to_node"] if side == 1 else pipe["from_node"]
            jumps.correct_store(past, tables, y, solved, pipe, end, come - change, times)
            add_change(changes, 4 * i + side, change)
    jumps.correct_behind_valves(past, tables, y, state, solved, times)
    for i in range(size):
        state[i] = solved[i]
