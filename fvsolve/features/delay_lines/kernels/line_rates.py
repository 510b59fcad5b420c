"""Delay lines in the right-hand side, under the linear density law, and waves at any point of a line.

A line consists of stretches of travel time tau. The forward wave r and the backward wave l travel unchanged to the
middle of a stretch. There friction subtracts delta = tau / 2 (drag(M) - drag0) from the forward wave and adds it to the
backward wave; drag is the friction term of dM/dt [kg/s2], drag0 its value in the initial steady state. M is the
mass flow in the middle, M + delta = M0 + r - l, with M0 in the initial steady state and the waves sent tau ago
(midpoint rule along the path; passive, as friction is).

A line shorter than the longest step h delivers the fraction beta = 1 - tau / h of a sent wave at once and the rest
after h. Its mean delay is tau, and it amplifies no wave. Its ends are coupled at once: p' follows from two admittances
Y tau / (2 h - tau) with a conductance between them; Y is the admittance of the pipe.

At a fraction x of a stretch, from its `from` end, the forward wave is r(t, x) = sent(t - x tau) - x delta, and the
backward wave is l(t, x) = sent(t - (1 - x) tau) + (1 - x) delta. delta is that of an earlier time: for x >= 1/2 when
the forward wave at x passed the middle, for x < 1/2 when the backward wave at x passed it. At both ends the formulas
give the arriving waves. Arguments are those of `wave_history`.
"""

from fvsolve.core.kernels.dtypes import (
    FRICTION_HAZEN,
    FRICTION_NONE,
    FRICTION_ROUGH,
    PIPE_FLOW,
    PIPE_PRESSURE,
)
from fvsolve.core.kernels.steady_friction import EXPONENT, drag, power_of_square
from fvsolve.features.delay_lines.kernels import wave_history as history
from fvsolve.features.delay_lines.kernels.tables import open_lines
from fvsolve.jit import njit

FLOW_TOLERANCE = 1e-6  # relative error of the flow at which Newton stops
SLOPE_ERROR = 0.2  # relative error of the slope where the friction factor depends on the flow
MAX_ITERATIONS = 60  # of Newton's method
JOINT_TOLERANCE = 1e-9  # distance from a joint, as fraction of a stretch, that is rounding
# in place of the number of an entry: before all entries, where smooth parts are zero
BEFORE_ALL = -(1 << 62)


@njit(forceinline=True)
def drag_and_slope(pipe, flow):
    """(drag [kg/s2], d drag / d flow [1/s]) of a pipe at a mass flow [kg/s].

    The slope is exact for Hazen-Williams; otherwise it ignores that the friction factor may depend on the flow.
    """
    size = abs(flow)
    if pipe["friction"] == FRICTION_HAZEN:
        # same rounding as in `drag`
        loss = pipe["loss"]
        rough = pipe["rough"]
        p = power_of_square(size * size)
        return loss * (size * flow) + rough * (p * flow), 2.0 * loss * size + (
            1.0 + EXPONENT
        ) * rough * p
    force = drag(
        pipe["friction"], pipe["loss"], pipe["rough"], pipe["roughness"], pipe["reynolds"], flow
    )
    return force, 2.0 * abs(force) / size if size > 0.0 else 0.0


@njit(forceinline=True)
def has_friction(pipe):
    """True if friction, or the initial drag of the pipe, changes its waves."""
    return not (pipe["friction"] == FRICTION_NONE and pipe["drag"] == 0.0)


@njit(forceinline=True)
def friction_loss(pipe, line, r, l):
    """Lumped friction loss in the middle of a stretch, where waves r and l meet [kg/s], by Newton's method.

    delta = tau / 2 (drag(M) - drag0), M = M0 + r - l - delta; the equation is monotone in M. The loss delta is
    subtracted from r and added to l. M0, drag0 : flow and drag of the initial steady state
    """
    if not has_friction(pipe):
        return 0.0
    kappa = 0.5 * line["tau"]
    x = r - l
    flow = pipe["flow"]
    drag0 = pipe["drag"]
    rough = SLOPE_ERROR if pipe["friction"] == FRICTION_ROUGH else 0.0
    # Newton starts from friction linearised at the initial steady flow.
    m, least = x * line["transmission"], FLOW_TOLERANCE * (abs(x) + 1e-3 * abs(flow))
    for _ in range(MAX_ITERATIONS):
        force, slope = drag_and_slope(pipe, flow + m)
        step = (m + kappa * (force - drag0) - x) / (1.0 + kappa * slope)
        m -= step
        # remaining error, from the change of the slope within the step
        left = abs(step) * kappa * slope
        if not left * (abs(step) + rough * abs(flow + m)) > least * abs(flow + m):
            break
    return x - m


@njit(forceinline=True)
def write_arrivals(past, places, clock, line, pipe, q, t):
    """Write both waves that arrive at t at the ends of stretch q of a delay line, and its friction loss, into `past`.

    Three numbers [kg/s]: the backward wave at its beginning, the forward wave at its end, the loss. In a line shorter
    than a step both waves hold for zero pressure deviation p' at its ends. Jumps travel through it as through any line.
    """
    u, v = history.smooth_waves(past, places, clock, line, q, t - line["hold"])
    head = history.jump_head(places, line["stretch"] + q, 0)
    r = u + history.arrived_until(past, places, clock, head, t, line["tau"])
    l = v + history.arrived_until(past, places, clock, head + history.HEAD_SIZE, t, line["tau"])
    delta, beta = friction_loss(pipe, line, r, l), line["now"]
    back, ahead = l + delta, r - delta
    # Of the smooth wave, 1 - beta was sent a step ago; the rest is sent now and depends on the nodes.
    if beta > 0.0:
        ahead -= beta * (u + history.jumps_until(past, places, head, t + clock[4]))
        back -= beta * (
            v + history.jumps_until(past, places, head + history.HEAD_SIZE, t + clock[4])
        )
        # At p' = 0 a node sends minus its arriving wave: ahead = A - beta back, back = B - beta ahead.
        per = 1.0 / (1.0 - beta * beta)
        ahead, back = per * (ahead - beta * back), per * (back - beta * ahead)
    at = places[0] + history.ARRIVALS_SIZE * (line["stretch"] + q)
    past[at], past[at + 1], past[at + 2] = back, ahead, delta


@njit
def write_all_arrivals(past, tables, t):
    """Write the waves that arrive at t in first and last stretches of delay lines into `past`, see `write_arrivals`.

    If nodes are solved several times for the same t, the waves are read only once.
    """
    if past[history.ARRIVALS_TIME] == t and past[history.ARRIVALS_COUNT] == past[history.COUNT]:
        return
    places = history.offsets_of(past)
    clock = history.reading_data(past, history.newest_before(past, t))
    delays, pipes = tables.delays, tables.pipes
    for i in range(delays.size):
        line = delays[i]
        pipe, last = pipes[line["pipe"]], line["stretches"] - 1
        write_arrivals(past, places, clock, line, pipe, 0, t)
        if last > 0:
            write_arrivals(past, places, clock, line, pipe, last, t)
    past[history.ARRIVALS_TIME], past[history.ARRIVALS_COUNT] = t, past[history.COUNT]


@njit
def outgoing_line_waves(t, y, dydt, out, handle):
    """Write the waves that leave delay lines into out[ends] [kg/s], and add twice each wave to out[net] of its node.

    Twice the wave is the mass flow into the node at zero pressure deviation p'.
    """
    tables = open_lines(handle)
    past = tables.past
    layout = tables.layout[0]
    lines = tables.delays
    started = past[history.COUNT] > 0.0
    place = history.offsets_of(past)[0]
    ends = layout["ends"]
    net = layout["net"]
    if started:
        write_all_arrivals(past, tables, t)
    for i in range(lines.size):
        line, pipe = lines[i], tables.pipes[lines[i]["pipe"]]
        at, first = ends + 4 * line["pipe"], place + history.ARRIVALS_SIZE * line["stretch"]
        left, right = 0.0, 0.0
        if started:
            left = past[first]
            right = past[first + history.ARRIVALS_SIZE * (line["stretches"] - 1) + 1]
        out[at + 1], out[at + 2] = left, right
        out[net + pipe["from_node"]] += 2.0 * left
        out[net + pipe["to_node"]] += 2.0 * right


@njit
def incoming_line_waves(t, y, dydt, out, handle):
    """Write the waves that nodes send into delay lines, Y p' minus the arriving waves; write d/dt of the mass in lines.

    Y : admittance of the pipe [kg/s per Pa]; p' : deviation of the node pressure from the initial steady state [Pa]
    In lines shorter than a step the arriving waves depend on p'; this part is added to them in out[ends] first. d/dt of
    the mass [kg/s] is the inflow at both ends; it is not written if `dydt` is empty.
    """
    tables = open_lines(handle)
    layout, lines = tables.layout[0], tables.delays
    ends, pressure = layout["ends"], layout["pressure"]
    for i in range(lines.size):
        line, pipe = lines[i], tables.pipes[lines[i]["pipe"]]
        at, admittance = ends + 4 * line["pipe"], pipe["admittance"]
        near = admittance * out[pressure + pipe["from_node"]]
        far = admittance * out[pressure + pipe["to_node"]]
        # The waves that p' sends reach the other end at once by the fraction beta.
        if line["now"] > 0.0:
            beta = line["now"]
            per = beta / (1.0 - beta * beta)
            out[at + 1] += per * (far - beta * near)
            out[at + 2] += per * (near - beta * far)
        left, right = out[at + 1], out[at + 2]
        ahead, back = near - left, far - right
        out[at], out[at + 3] = ahead, back
        if dydt.size > 0:
            dydt[pipe["y"]] = (ahead - left) - (right - back)


# waves within a line ----------


@njit
def sent_wave(t, out, tables, number, q, wave, at):
    """Wave sent into stretch q of delay line `number` at a time `at` <= t, with its jumps [kg/s].

    `at` may lie in the step that ends at t; there a wave from a node is linear up to its value in `out` at t. The
    result is 0 before the first entry.
    """
    past, line = tables.past, tables.delays[number]
    newest = int(past[history.COUNT]) - 1
    if newest < 0:
        return 0.0
    last = history.time_of(past, newest)
    places = history.offsets_of(past)
    until = at + history.time_tolerance(past)
    both = history.smooth_waves(
        past, places, history.reading_data(past, newest), line, q, min(at, last)
    )
    jumps = history.jump_head(places, line["stretch"] + q, wave)
    value = (both[1] if wave == 1 else both[0]) + history.jumps_until(past, places, jumps, until)
    if at <= last or t <= last:
        return value
    # interpolated to the wave that its node sends now
    if q == (line["stretches"] - 1 if wave == 1 else 0):
        now = out[tables.layout[0]["ends"] + 4 * line["pipe"] + 3 * wave]
        return value + (now - value) * (at - last) / (t - last)
    # Into an inner stretch goes the wave that leaves its neighbour, with the friction there.
    pipe, before = tables.pipes[line["pipe"]], q + 1 if wave == 1 else q - 1
    r, l = history.read_waves(
        past, places, history.reading_data(past, newest), line, before, at - line["tau"]
    )
    delta = friction_loss(pipe, line, r, l)
    return l + delta if wave == 1 else r - delta


@njit(forceinline=True)
def joint_at(share, stretches):
    """Number of the stretch that begins at a fraction `share` of the length of a line; 0 if no inner joint is there."""
    k = int(share * stretches + 0.5)
    return k if 0 < k < stretches and abs(share * stretches - k) < JOINT_TOLERANCE else 0


@njit
def waves_at(t, out, tables, number, share):
    """(forward, backward) wave [kg/s] at t of delay line `number` at a fraction `share` of its length from `from`.

    At a joint both waves are those sent there, so that the result does not depend on the direction of the line.
    out : values of the right-hand side at t
    """
    line = tables.delays[number]
    pipe, stretches = tables.pipes[line["pipe"]], line["stretches"]
    joint = joint_at(share, stretches)
    if joint > 0:
        return sent_wave(t, out, tables, number, joint, 0, t), sent_wave(
            t, out, tables, number, joint - 1, 1, t
        )
    q = min(int(share * stretches), stretches - 1)
    x, tau = share * stretches - q, line["tau"]
    r = sent_wave(t, out, tables, number, q, 0, t - x * tau)
    l = sent_wave(t, out, tables, number, q, 1, t - (1.0 - x) * tau)
    # Waves that met in the middle, where friction acted, were both sent at this time.
    then = t - max(x, 1.0 - x) * tau
    near = r if x >= 0.5 else sent_wave(t, out, tables, number, q, 0, then)
    far = l if x < 0.5 else sent_wave(t, out, tables, number, q, 1, then)
    delta = friction_loss(pipe, line, near, far)
    return r - x * delta, l + (1.0 - x) * delta


@njit
def waves_along_line(t, out, handle, number, r, l):
    """Write forward and backward wave [kg/s] at the centres of r.size equal parts of line `number` to r and l.

    out : values of the right-hand side at t
    """
    tables, n = open_lines(handle), r.size
    for j in range(n):
        r[j], l[j] = waves_at(t, out, tables, number, (j + 0.5) / n)


@njit(forceinline=True)
def entry_before(past, clock, t):
    """(entry k, fraction of the way to entry k + 1) at the time t, for linear interpolation.

    Before all entries k is BEFORE_ALL.
    """
    # Within the last equal steps the entry follows from the time without a search.
    place = (t - clock[1]) * clock[2]
    if place > -clock[3]:
        back = int(place)
        return clock[0] + back - 1, place - back + 1.0
    k, x = history.find_interval(past, clock[0], t)
    return (BEFORE_ALL, 0.0) if k < history.PROFILE_ENTRIES and x == 0.0 else (k, x)


@njit(forceinline=True)
def smooth_wave_linear(past, clock, ring, mask, wave, t):
    """Smooth part of a wave sent into a stretch at t [kg/s], by linear interpolation between entries.

    ring, mask : result of `ring_of`
    """
    k, x = entry_before(past, clock, t)
    if k == BEFORE_ALL:
        return 0.0
    a, b = ring + 2 * (k & mask) + wave, ring + 2 * ((k + 1) & mask) + wave
    return past[a] + x * (past[b] - past[a])


@njit
def waves_in_stretch(t, past, places, clock, line, q, first, r, l, unchanged, greatest):
    """Write both waves at the places of stretch q, as in `waves_at` at the time t of the last entry, for envelopes.

    Waves are linear between entries. The friction loss is that of the waves that arrive at the ends of the stretch.
    first : number of its first place; returns that of the next stretch
    r, l : float64[n]  waves at the centres of n equal parts of the line
    unchanged : float64[n]  1 for places where r receives `greatest` and l receives 0, or empty
    """
    stretches = line["stretches"]
    tau = line["tau"]
    n = r.size
    s = line["stretch"] + q
    j = first
    (ring, mask), jumps = history.ring_of(places, line, q), history.jump_head(places, s, 0)
    delta = past[places[0] + history.ARRIVALS_SIZE * s + 2]
    steps = tau * clock[2]
    others = jumps + history.HEAD_SIZE
    i, k = int(past[jumps + history.JUMP_COUNT]), 0
    # Equal steps over the whole travel time and no jumps: entries are read by their index.
    calm = steps + 2.0 < clock[3] and i + past[others + history.JUMP_COUNT] == 0.0
    while j < n and (q + 1 == stretches or int((j + 0.5) / n * stretches) <= q):
        if unchanged.size > 0 and unchanged[j] > 0.0:
            r[j], l[j] = greatest[j], 0.0
            j += 1
            continue
        x = (j + 0.5) / n * stretches - q
        if calm:
            before, after = x * steps, (1.0 - x) * steps  # age of both waves [steps]
            u, v = int(before), int(after)
            a, b = ring + 2 * ((clock[0] - u) & mask), ring + 2 * ((clock[0] - u - 1) & mask)
            c = ring + 2 * ((clock[0] - v) & mask) + 1
            d = ring + 2 * ((clock[0] - v - 1) & mask) + 1
            ahead = past[a] + (before - u) * (past[b] - past[a]) + past[jumps + history.REMOVED_SUM]
            back = past[c] + (after - v) * (past[d] - past[c]) + past[others + history.REMOVED_SUM]
        else:
            # i and k jumps were sent until the times of both readings, which fall and rise along the stretch
            sent, returned = t - x * tau, t - (1.0 - x) * tau
            i = history.count_back(past, places, jumps, i, sent + clock[4])
            k = history.count_until(past, places, others, k, returned + clock[4])
            ahead = history.sum_of_first(past, places, jumps, i)
            back = history.sum_of_first(past, places, others, k)
            ahead = smooth_wave_linear(past, clock, ring, mask, 0, sent) + ahead
            back = smooth_wave_linear(past, clock, ring, mask, 1, returned) + back
        r[j], l[j] = ahead - x * delta, back + (1.0 - x) * delta
        j += 1
    return j


@njit
def observe_lines(t, y, out, handle, values):
    """Write the values of the pressure and flow probes within delay lines, between their ends, to `values`."""
    tables = open_lines(handle)
    probes = tables.probes
    for k in range(probes.size):
        probe = probes[k]
        if (probe["kind"] == PIPE_PRESSURE or probe["kind"] == PIPE_FLOW) and probe["side"] == 0:
            pipe = tables.pipes[probe["index"]]
            if tables.line_of[probe["index"]] >= 0:
                r, l = waves_at(
                    t, out, tables, tables.line_of[probe["index"]], tables.floats[probe["weights"]]
                )
                value = r + l if probe["kind"] == PIPE_PRESSURE else pipe["flow"] + (r - l)
                values[k] = probe["scale"] * value + probe["offset"]
