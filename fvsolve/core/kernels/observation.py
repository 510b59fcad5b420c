"""Observation of a state: probes, extremes, times of first occurrence, events of tanks. No state is changed.

Arguments common to these functions: r, l : forward and backward wave of cells [kg/s], whose sum is a measure of the
pressure change; t : present time [s].
"""

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.calls import CLOSE, run_job
from fvsolve.core.kernels.isolated_nodes import (
    DRAINED,
    JOINED,
    UNDETERMINED,
    UNSUPPLIED,
    marks_of_islands,
)
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.core.kernels.tanks import (
    BOTTOM,
    EVENTS,
    RIM,
    is_near,
    limit_events,
    mass_per_metre,
    tank_level,
)
from fvsolve.jit import njit, specialise

HUGE = 1e100  # waves beyond it count as not finite, although their squares may be finite
BLOCK = 64  # cells compared with the envelope at a time
# speed of a level [m/s]: a smaller supply of a tank is rounding and is not recorded
SUPPLY_ROUNDING = 1e-9
STOP_HERE = -2.0  # in out[WHERE]: the run must end


@njit(forceinline=True)
def wave_sum(probe, pipe, sign, index, y, out, tables):
    """r + sign l at a probe of a pipe [kg/s], with forward wave r, backward wave l and sign 1 or -1.

    At a pipe end it is computed from the waves of the solved node, inside the pipe from a polynomial through cells.
    index : number of the pipe
    """
    at = tables.layout[0]["ends"] + 4 * index
    # At an end the wave that enters is known from the node; an extrapolation of cells would miss it.
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
    """Write values of all probes of nodes, pipes, valves and rigid columns to `values`: scale * quantity + offset."""
    tables = open_tables(handle)
    layout, probes = tables.layout[0], tables.probes
    for k in range(probes.size):
        probe = probes[k]
        kind, i = probe["kind"], probe["index"]
        value = 0.0
        if kind == rec.PRESSURE:
            value = out[layout["pressure"] + i]
        elif kind == rec.LEVEL:
            node = tables.nodes[i]
            value = tank_level(node, tables.floats, tables.settings[0]["rho"], y[node["y"]])
        elif kind == rec.PIPE_PRESSURE:
            pipe = tables.pipes[i]
            value = wave_sum(probe, pipe, 1.0, i, y, out, tables)
        elif kind == rec.PIPE_FLOW:
            pipe = tables.pipes[i]
            value = pipe["flow"] + wave_sum(probe, pipe, -1.0, i, y, out, tables)
        elif kind == rec.VALVE_FLOW:
            value = out[layout["valve"] + i]
        elif kind == rec.PRESSURE_BETWEEN:
            x = tables.floats[probe["weights"]]
            value = (1.0 - x) * out[layout["pressure"] + i] + x * out[
                layout["pressure"] + probe["cell"]
            ]
        elif kind == rec.COLUMN_FLOW:
            value = out[layout["column"] + i]
        elif kind == rec.SPOOL_FLOW:
            for e in range(probe["count"]):
                value += tables.floats[probe["weights"] + e] * out[layout["valve"] + i + e]
        elif kind == rec.SCHEDULE_VALUE:
            value = schedule_value(tables, i, t)
        values[k] = probe["scale"] * value + probe["offset"]


@njit(forceinline=True)
def update_extremes(envelope, c, t, value):
    """Update column c of an envelope with a value at time t.

    envelope : float64[4, n]  least value, its time, greatest value, its time
    """
    if value < envelope[0, c]:
        envelope[0, c], envelope[1, c] = value, t
    if value > envelope[2, c]:
        envelope[2, c], envelope[3, c] = value, t


@njit(forceinline=True)
def count_new_extremes(r, l, least, greatest):
    """(number of cells with r + l below `least`, number with r + l above `greatest`); NaN counts as below and above."""
    low, high = 0, 0
    for i in range(r.size):
        s = r[i] + l[i]
        low += not s >= least[i]
        high += not s <= greatest[i]
    return low, high


MINIMA = None  # constant of the template


def _update_sums(t, r, l, extreme, t_extreme):
    """Update least or greatest values of r + l of cells and their times, without a branch.

    extreme, t_extreme : float64[cells]  extremes of the sum so far and their times
    Returns how many waves are not finite.
    """
    bad = 0
    for i in range(r.size):
        s = r[i] + l[i]
        new = s < extreme[i] if MINIMA else s > extreme[i]
        extreme[i] = s if new else extreme[i]
        t_extreme[i] = t if new else t_extreme[i]
        bad += not (abs(r[i]) < HUGE and abs(l[i]) < HUGE)
    return bad


update_minima = specialise(_update_sums, "update_minima", MINIMA=True)
update_maxima = specialise(_update_sums, "update_maxima", MINIMA=False)


@njit
def count_below(r, l, boiling):
    """Number of cells below vapour pressure, where the sum of the waves r + l is below `boiling` [kg/s].

    boiling : float64[cells]  values of r + l at vapour pressure
    """
    count = 0
    for i in range(r.size):
        count += (r[i] + l[i]) < boiling[i]
    return count


@njit
def update_envelope(t, r, l, at, low, high, index, tables):
    """Update the envelope of r + l from cell `at` on; record the first time that pipe `index` is below vapour pressure.

    low, high : numbers of cells below and above the envelope so far
    Returns 0 if all values are finite.
    """
    e = tables.envelope
    profile = tables.profile
    marks = tables.marks
    b, bad = at + r.size, 0
    if low > 0:
        bad += update_minima(t, r, l, e[0, at:b], e[1, at:b])
        # A first pressure below vapour pressure is also a new minimum, so it is sought only here.
        if marks[index] != marks[index]:
            if count_below(r, l, profile[at:b]) > 0:
                marks[index] = t
    if high > 0:
        bad += update_maxima(t, r, l, e[2, at:b], e[3, at:b])
    return bad


@njit
def record_pipe(t, r, l, pipe, index, tables):
    """Update the envelope of r + l of pipe number `index`; blocks of cells without a new extreme are only compared."""
    start = 0
    at = pipe["cell"]
    envelope = tables.envelope
    # Few blocks contain a new extreme; comparing is cheaper than updating.
    while start < r.size:
        stop = min(start + BLOCK, r.size)
        a, b = at + start, at + stop
        low, high = count_new_extremes(
            r[start:stop], l[start:stop], envelope[0, a:b], envelope[2, a:b]
        )
        if low + high > 0:
            update_envelope(t, r[start:stop], l[start:stop], a, low, high, index, tables)
        start = stop


@njit
def record_pipes(t, y, out, handle, values):
    """Update pressure envelopes of all pipes, and first times below vapour pressure, after every accepted step."""
    tables = open_tables(handle)
    pipes = tables.pipes
    for i in range(pipes.size):
        n, o = pipes[i]["cells"], pipes[i]["y"]
        record_pipe(t, y[o : o + n], y[o + n : o + 2 * n], pipes[i], i, tables)


@njit(forceinline=True)
def is_undetermined(tables, out, probe):
    """True if a probe is the pressure of an isolated node, or of a pipe between such nodes, which nothing determines.

    A probe of a head counts as one of pressure.
    """
    at, kind = tables.layout[0]["isolated"], probe["kind"]
    return (kind == rec.PRESSURE or kind == rec.PRESSURE_BETWEEN) and out[
        at + probe["index"]
    ] == UNDETERMINED


@njit
def record_unsupplied(t, out, tables, i):
    """Record in `marks` that the demand of node i is not supplied: first time, last time, valves shut at the first."""
    marks = tables.marks
    layout = tables.layout[0]
    first = marks_of_islands(tables)
    at = first + tables.valves.size + i
    marks[at + tables.nodes.size] = t
    # Only valves that are shut at the first time are the cause.
    if marks[at] == marks[at]:
        return
    marks[at] = t
    for k in range(tables.valves.size):
        valve = tables.valves[k]
        a = out[layout["isolated"] + valve["from_node"]] >= DRAINED
        b = out[layout["isolated"] + valve["to_node"]] >= DRAINED
        if a != b and valve["one_way"] == rec.BOTH_WAYS and marks[first + k] != marks[first + k]:
            marks[first + k] = t


@njit
def record_nodes(t, y, out, handle, values):
    """Update extremes of probes, and first times of low pressures and tank limits, after an accepted step.

    Runs after `record_pipes`. The array `marks` holds the first times [s] at which pipes, then nodes, are below vapour
    pressure, tanks are dry, tanks spill; NaN for never. If the case requires it, a pressure below vapour pressure ends
    the run: out[WHERE] is set. Pressures of isolated nodes give no mark, and no extremes where nothing determines them.
    """
    tables = open_tables(handle)
    pipes = tables.pipes
    nodes = tables.nodes
    extremes = tables.extremes
    has_codes = tables.clusters.size > 0
    marks = tables.marks
    layout = tables.layout[0]
    vapor = tables.settings[0]["vapor"]
    lowest = tables.settings[0]["unmarked"]
    for k in range(values.size):
        if has_codes and is_undetermined(tables, out, tables.probes[k]):
            continue
        update_extremes(extremes, k, t, values[k])
        mark = tables.probes[k]["mark"]
        if mark >= 0 and values[k] < vapor and marks[mark] != marks[mark]:
            marks[mark] = t
    for i in range(nodes.size):
        at = pipes.size + i
        # The pressure of an isolated node is a convention, not a result.
        if has_codes and out[layout["isolated"] + i] > JOINED:
            last = marks.size - nodes.size + i
            if out[layout["isolated"] + i] == UNSUPPLIED:
                record_unsupplied(t, out, tables, i)
            elif out[layout["isolated"] + i] == UNDETERMINED and marks[last] != marks[last]:
                marks[last] = t
            continue
        if (
            lowest < nodes[i]["pressure"] + out[layout["pressure"] + i] < vapor
            and marks[at] != marks[at]
        ):
            marks[at] = t
        if nodes[i]["kind"] == rec.TANK and abs(
            out[layout["supply"] + i]
        ) > SUPPLY_ROUNDING * mass_per_metre(nodes[i]):
            # A positive supply holds a dry tank at its bottom, a negative one is the spill of a full tank.
            at += nodes.size if out[layout["supply"] + i] > 0.0 else 2 * nodes.size
            if marks[at] != marks[at]:
                marks[at] = t
    if tables.settings[0]["stop_below"] == 1:
        for i in range(pipes.size + nodes.size):
            if marks[i] == marks[i]:
                out[rec.WHERE] = STOP_HERE


@njit
def tank_events(t, y, out, handle, g):
    """Write the event functions of tanks at bottom and rim to g.

    At a limit they depend on the net flow, so nodes are solved first.
    """
    tables = open_tables(handle)
    # event functions of devices have solved the nodes
    nodes = tables.nodes
    armed = tables.armed
    solved = tables.devices.size > 0
    for i in range(nodes.size):
        if nodes[i]["kind"] == rec.TANK:
            node, k = nodes[i], EVENTS * nodes[i]["row"]
            stored = node["mass"] + y[node["y"]]
            space = node["full"] - stored
            # Only a tank at a limit needs its net flow, which costs a solution of all nodes.
            if not solved and (is_near(node, stored) or is_near(node, space)):
                run_job(CLOSE, t, y, y[:0], out, handle)
                solved = True
            net = out[tables.layout[0]["net"] + i]
            limit_events(node, armed, g, k + BOTTOM, stored, net)
            limit_events(node, armed, g, k + RIM, space, -net)
