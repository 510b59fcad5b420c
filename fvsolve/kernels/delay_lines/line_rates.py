"""Delay lines in the right-hand side, under the linear density law.

A line consists of stretches of travel time tau. The forward wave r and the backward wave l travel unchanged to the
middle of a stretch. There friction subtracts delta = tau / 2 (drag(M) - drag0) from the forward wave and adds it to the
backward wave; drag is the friction term of dM/dt [kg/s2], drag0 its value in the initial steady state. M is the
mass flow in the middle, M + delta = M0 + r - l, with M0 in the initial steady state and the waves sent tau ago
(midpoint rule along the path; passive, as friction is).

A line shorter than the longest step h delivers the fraction beta = 1 - tau / h of a sent wave at once and the rest
after h. Its mean delay is tau, and it amplifies no wave. Its ends are coupled at once: p' follows from two admittances
Y tau / (2 h - tau) with a conductance between them; Y is the admittance of the pipe.
"""

from fvsolve.jit import njit
from fvsolve.kernels.delay_lines.wave_history import (
    ARRIVALS_COUNT,
    ARRIVALS_SIZE,
    ARRIVALS_TIME,
    COUNT,
    HEAD_SIZE,
    arrived_until,
    interpolate_waves,
    jump_head,
    jumps_until,
    newest_before,
    offsets_of,
    reading_data,
    ring_of,
    stencil,
)
from fvsolve.kernels.dtypes import FRICTION_HAZEN, FRICTION_NONE, FRICTION_ROUGH
from fvsolve.kernels.node_clusters import row_in_cluster
from fvsolve.kernels.steady_friction import EXPONENT, drag, power_of_square
from fvsolve.kernels.table_handle import open_tables

FLOW_TOLERANCE = 1e-6  # relative error of the flow at which Newton stops
SLOPE_ERROR = 0.2  # relative error of the slope where the friction factor depends on the flow
MAX_ITERATIONS = 60  # of Newton's method


@njit(forceinline=True)
def drag_and_slope(pipe, flow):
    """(drag [kg/s2], d drag / d flow [1/s]) of a pipe at a mass flow [kg/s].

    The slope is exact for Hazen-Williams; otherwise it ignores that the friction factor may depend on the flow.
    """
    size = abs(flow)
    if pipe["friction"] == FRICTION_HAZEN:
        loss, rough, p = pipe["loss"], pipe["rough"], power_of_square(size * size)  # same rounding as in `drag`
        return loss * (size * flow) + rough * (p * flow), 2.0 * loss * size + (1.0 + EXPONENT) * rough * p
    force = drag(pipe["friction"], pipe["loss"], pipe["rough"], pipe["roughness"], pipe["reynolds"], flow)
    return force, 2.0 * abs(force) / size if size > 0.0 else 0.0


@njit(forceinline=True)
def has_friction(pipe):
    """True if friction, or the initial drag of the pipe, changes its waves."""
    return not (pipe["friction"] == FRICTION_NONE and pipe["drag"] == 0.0)


@njit(forceinline=True)
def friction_loss(pipe, line, r, l):
    """Lumped friction loss in the middle of a stretch, where waves r and l meet [kg/s], by Newton's method.

    delta = tau / 2 (drag(M) - drag0), M = M0 + r - l - delta; the equation is monotone in M. The loss delta is
    subtracted from r and added to l. M0, drag0 : flow and drag of the initial steady state; line : row of the line
    """
    if not has_friction(pipe):
        return 0.0
    kappa, x, flow, drag0 = 0.5 * line["tau"], r - l, pipe["flow"], pipe["drag"]
    rough = SLOPE_ERROR if pipe["friction"] == FRICTION_ROUGH else 0.0
    m, least = x * line["transmission"], FLOW_TOLERANCE * (abs(x) + 1e-3 * abs(flow))
    for _ in range(MAX_ITERATIONS):
        force, slope = drag_and_slope(pipe, flow + m)
        step = (m + kappa * (force - drag0) - x) / (1.0 + kappa * slope)
        m -= step
        left = abs(step) * kappa * slope  # remaining error, from the change of the slope within the step
        if not left * (abs(step) + rough * abs(flow + m)) > least * abs(flow + m):
            break
    return x - m


@njit(forceinline=True)
def write_arrivals(past, places, clock, line, pipe, q, t):
    """Write both waves that arrive at t at the ends of stretch q of a delay line, and its friction loss, into `past`.

    Three numbers [kg/s]: the backward wave at its beginning, the forward wave at its end, the loss. In a line shorter
    than a step both waves hold for zero pressure deviation p' at its ends. Jumps travel through it as through any line.
    places : result of `offsets_of`; clock : result of `reading_data`; line, pipe : rows of the line and of its pipe
    """
    ring, mask = ring_of(places, line, q)
    k, w = stencil(past, clock, t - line["hold"])
    u, v = interpolate_waves(past, ring, mask, k, w)
    head = jump_head(places, line["stretch"] + q, 0)
    r = u + arrived_until(past, places, clock, head, t, line["tau"])
    l = v + arrived_until(past, places, clock, head + HEAD_SIZE, t, line["tau"])
    delta, beta = friction_loss(pipe, line, r, l), line["now"]
    back, ahead = l + delta, r - delta
    if beta > 0.0:
        ahead -= beta * (u + jumps_until(past, places, head, t + clock[4]))
        back -= beta * (v + jumps_until(past, places, head + HEAD_SIZE, t + clock[4]))
        per = 1.0 / (1.0 - beta * beta)
        ahead, back = per * (ahead - beta * back), per * (back - beta * ahead)
    at = places[0] + ARRIVALS_SIZE * (line["stretch"] + q)
    past[at], past[at + 1], past[at + 2] = back, ahead, delta


@njit
def write_all_arrivals(past, tables, t):
    """Write the waves that arrive at t in first and last stretches of delay lines into `past`, see `write_arrivals`.

    If nodes are solved several times for the same t, the waves are read only once.
    """
    if past[ARRIVALS_TIME] == t and past[ARRIVALS_COUNT] == past[COUNT]:
        return
    places, clock = offsets_of(past), reading_data(past, newest_before(past, t))
    delays, pipes = tables.delays, tables.pipes
    for i in range(delays.size):
        line = delays[i]
        pipe, last = pipes[line["pipe"]], line["stretches"] - 1
        write_arrivals(past, places, clock, line, pipe, 0, t)
        if last > 0:
            write_arrivals(past, places, clock, line, pipe, last, t)
    past[ARRIVALS_TIME], past[ARRIVALS_COUNT] = t, past[COUNT]


@njit
def outgoing_line_waves(t, y, dydt, out, handle):
    """Write the waves that leave delay lines into out[ends] [kg/s], and add twice each wave to out[net] of its node.

    Twice the wave is the mass flow into the node at zero pressure deviation p'.
    """
    tables = open_tables(handle)
    past, layout, lines = tables.past, tables.layout[0], tables.delays
    started, place, ends, net = past[COUNT] > 0.0, offsets_of(past)[0], layout["ends"], layout["net"]
    if started:
        write_all_arrivals(past, tables, t)
    for i in range(lines.size):
        line, pipe = lines[i], tables.pipes[lines[i]["pipe"]]
        at, first = ends + 4 * line["pipe"], place + ARRIVALS_SIZE * line["stretch"]
        left, right = 0.0, 0.0
        if started:
            left, right = past[first], past[first + ARRIVALS_SIZE * (line["stretches"] - 1) + 1]
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
    tables = open_tables(handle)
    layout, lines = tables.layout[0], tables.delays
    ends, pressure = layout["ends"], layout["pressure"]
    for i in range(lines.size):
        line, pipe = lines[i], tables.pipes[lines[i]["pipe"]]
        at, admittance = ends + 4 * line["pipe"], pipe["admittance"]
        near = admittance * out[pressure + pipe["from_node"]]
        far = admittance * out[pressure + pipe["to_node"]]
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


@njit
def solve_line_clusters(t, y, dydt, out, handle):
    """Solve for the pressures of nodes that are joined by lines shorter than a step and by no valve.

    p' of each group of such nodes is the inverse of their admittance matrix times the arriving flows. These include the
    flow through short lines from nodes of known pressure.
    """
    tables = open_tables(handle)
    layout, integers, work = tables.layout[0], tables.integers, tables.scratch
    for number in range(tables.clusters.size):
        cluster = tables.clusters[number]
        if cluster["inverse"] < 0:
            continue
        n, first = cluster["nodes"], cluster["first_node"]
        for i in range(n):
            work[i] = out[layout["net"] + integers[first + i]]
        for c in range(cluster["couples"]):
            line = tables.delays[integers[cluster["first_couple"] + c]]
            pipe = tables.pipes[line["pipe"]]
            i, j = row_in_cluster(cluster, tables, pipe["from_node"]), row_in_cluster(cluster, tables, pipe["to_node"])
            if i >= 0 and j < 0:
                work[i] += line["couple"] * out[layout["pressure"] + pipe["to_node"]]
            if j >= 0 and i < 0:
                work[j] += line["couple"] * out[layout["pressure"] + pipe["from_node"]]
        for i in range(n):
            total, at = 0.0, cluster["inverse"] + i * n
            for j in range(n):
                total += tables.floats[at + j] * work[j]
            out[layout["pressure"] + integers[first + i]] = total
