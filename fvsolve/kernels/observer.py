"""What is read off a state: probes, least and greatest values, marks and events. Changes no state."""

from fvsolve.jit import njit
from fvsolve.kernels.calls import CLOSE, run
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.limits import BOTTOM, EVENTS, RIM, base_mass, limit_events, near
from fvsolve.kernels.records import (
    COLUMN_FLOW,
    LEVEL,
    PIPE_FLOW,
    PIPE_PRESSURE,
    PRESSURE,
    SPOOL_FLOW,
    TANK,
    VALVE_FLOW,
    WHERE,
)
from fvsolve.kernels.tanks import tank_level

HUGE = 1e100  # waves beyond it are not finite, though their squares might still be
BLOCK = 64
TRACE = 1e-9  # of a level [m/s]: a slower supply of a tank is rounding, and no mark
STOP_HERE = -2.0  # in out[WHERE]: the run is to end


@njit(forceinline=True)
def wave_sum(probe, pipe, sign, which, y, out, tables):
    """r + l or r - l of a pipe at a place: at an end from the node, inside from a polynomial over cells."""
    at = tables.layout[0]["ends"] + 4 * which
    if probe["side"] < 0:
        return out[at] + sign * out[at + 1]
    if probe["side"] > 0:
        return out[at + 2] + sign * out[at + 3]
    total, n = 0.0, pipe["cells"]
    for k in range(probe["count"]):
        cell = pipe["y"] + probe["cell"] + k
        total += tables.floats[probe["weights"] + k] * (y[cell] + sign * y[cell + n])
    return total


@njit
def observe_linear(t, y, out, handle, values):
    """values[k] = scale * quantity + offset of every probe."""
    tables = open_tables(handle)
    layout, probes = tables.layout[0], tables.probes
    for k in range(probes.size):
        probe = probes[k]
        kind, i = probe["kind"], probe["index"]
        value = 0.0
        if kind == PRESSURE:
            value = out[layout["pressure"] + i]
        elif kind == LEVEL:
            node = tables.nodes[i]
            value = tank_level(node, tables.floats, tables.settings[0]["rho"], y[node["y"]])
        elif kind == PIPE_PRESSURE:
            pipe = tables.pipes[i]
            value = wave_sum(probe, pipe, 1.0, i, y, out, tables)
        elif kind == PIPE_FLOW:
            pipe = tables.pipes[i]
            value = pipe["flow"] + wave_sum(probe, pipe, -1.0, i, y, out, tables)
        elif kind == VALVE_FLOW:
            value = out[layout["valve"] + i]
        elif kind == COLUMN_FLOW:
            value = out[layout["column"] + i]
        elif kind == SPOOL_FLOW:
            for e in range(4):
                value += tables.floats[probe["weights"] + e] * out[layout["valve"] + i + e]
        values[k] = probe["scale"] * value + probe["offset"]


@njit(forceinline=True)
def widen(envelope, c, t, value):
    """Let the least and greatest value of column c, and their times, include a value."""
    if value < envelope[0, c]:
        envelope[0, c], envelope[1, c] = value, t
    if value > envelope[2, c]:
        envelope[2, c], envelope[3, c] = value, t


@njit(forceinline=True)
def outside(r, l, least, greatest):
    """How many of the cells lie below and above what was seen before; what is not a number lies on both sides."""
    low, high = 0, 0
    for i in range(r.size):
        s = r[i] + l[i]
        low += not s >= least[i]
        high += not s <= greatest[i]
    return low, high


@njit
def widen_low(t, r, l, least, t_least):
    """`widen` for many cells, downwards and without a branch; returns how many are not finite."""
    bad = 0
    for i in range(r.size):
        s = r[i] + l[i]
        low = s < least[i]
        least[i] = s if low else least[i]
        t_least[i] = t if low else t_least[i]
        bad += not (abs(r[i]) < HUGE and abs(l[i]) < HUGE)
    return bad


@njit
def widen_high(t, r, l, greatest, t_greatest):
    """`widen_low`, upwards."""
    bad = 0
    for i in range(r.size):
        s = r[i] + l[i]
        high = s > greatest[i]
        greatest[i] = s if high else greatest[i]
        t_greatest[i] = t if high else t_greatest[i]
        bad += not (abs(r[i]) < HUGE and abs(l[i]) < HUGE)
    return bad


@njit
def count_below(r, l, boiling):
    """How many of the cells are below vapour pressure, r + l below `boiling`."""
    count = 0
    for i in range(r.size):
        count += (r[i] + l[i]) < boiling[i]
    return count


@njit
def note(t, r, l, at, low, high, which, tables):
    """Widen the envelope from cell `at` on by r + l, `low` and `high` of which lie outside; marks a pipe that boils.

    Returns zero where all values are finite.
    """
    e, profile, marks = tables.envelope, tables.profile, tables.marks
    b, bad = at + r.size, 0
    if low > 0:
        bad += widen_low(t, r, l, e[0, at:b], e[1, at:b])
        if marks[which] != marks[which]:
            if count_below(r, l, profile[at:b]) > 0:
                marks[which] = t
    if high > 0:
        bad += widen_high(t, r, l, e[2, at:b], e[3, at:b])
    return bad


@njit
def record_pipe(t, r, l, pipe, which, tables):
    """Envelope of r + l, cell by cell; most blocks hold nothing new and are only compared."""
    start, at, envelope = 0, pipe["cell"], tables.envelope
    while start < r.size:
        stop = min(start + BLOCK, r.size)
        a, b = at + start, at + stop
        low, high = outside(r[start:stop], l[start:stop], envelope[0, a:b], envelope[2, a:b])
        if low + high > 0:
            note(t, r[start:stop], l[start:stop], a, low, high, which, tables)
        start = stop


@njit
def record_pipes(t, y, out, handle, values):
    """Envelopes of pipes, and when they first fall below vapour pressure, after every accepted step."""
    tables = open_tables(handle)
    pipes = tables.pipes
    for i in range(pipes.size):
        n, o = pipes[i]["cells"], pipes[i]["y"]
        record_pipe(t, y[o : o + n], y[o + n : o + 2 * n], pipes[i], i, tables)


@njit
def record_nodes(t, y, out, handle, values):
    """Extremes of probes and first times of marks, after every accepted step and its pipes.

    marks = first time of: pipes below vapour pressure, nodes below it, tanks dry, tanks spilling; nan: never.
    """
    tables = open_tables(handle)
    pipes, nodes, extremes = tables.pipes, tables.nodes, tables.extremes
    marks, layout, vapor = tables.marks, tables.layout[0], tables.settings[0]["vapor"]
    for k in range(values.size):
        widen(extremes, k, t, values[k])
        which = tables.probes[k]["mark"]
        if which >= 0 and values[k] < vapor and marks[which] != marks[which]:
            marks[which] = t
    for i in range(nodes.size):
        at = pipes.size + i
        if nodes[i]["pressure"] + out[layout["pressure"] + i] < vapor and marks[at] != marks[at]:
            marks[at] = t
        if nodes[i]["kind"] == TANK and abs(out[layout["supply"] + i]) > TRACE * base_mass(nodes[i]):
            at += nodes.size if out[layout["supply"] + i] > 0.0 else 2 * nodes.size
            if marks[at] != marks[at]:
                marks[at] = t
    if tables.settings[0]["stop_below"] == 1:
        for i in range(pipes.size + nodes.size):
            if marks[i] == marks[i]:
                out[WHERE] = STOP_HERE


@njit
def tank_events(t, y, out, handle, g):
    """Event functions of the bottom and the rim of tanks; at either nodes are closed, as what flows then counts."""
    tables = open_tables(handle)
    nodes, armed, closed = tables.nodes, tables.armed, tables.devices.size > 0  # whose events have done so
    for i in range(nodes.size):
        if nodes[i]["kind"] == TANK:
            node, k = nodes[i], EVENTS * nodes[i]["row"]
            stored = node["mass"] + y[node["y"]]
            room = node["full"] - stored
            if not closed and (near(node, stored) or near(node, room)):
                run(CLOSE, t, y, y[:0], out, handle)
                closed = True
            net = out[tables.layout[0]["net"] + i]
            limit_events(node, armed, g, k + BOTTOM, stored, net)
            limit_events(node, armed, g, k + RIM, room, -net)
