"""Waves of all pipes under the linear density law: outgoing, incoming and rates of the cells."""

from fvsolve.jit import njit
from fvsolve.kernels.ghost_cells import end_value
from fvsolve.kernels.pipes import pipe_rates, scheme_family
from fvsolve.kernels.table_handle import open_tables


@njit
def outgoing_waves_linear(t, y, dydt, out, handle):
    """Write the outgoing waves of pipes to out[ends]; add their flow into nodes at unchanged pressure to out[net]."""
    tables = open_tables(handle)
    settings, layout, pipes = tables.settings[0], tables.layout[0], tables.pipes
    scratch = tables.scratch
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["delay"] >= 0:
            continue
        n, at = pipe["cells"], layout["ends"] + 4 * i
        r, l = y[pipe["y"] : pipe["y"] + n], y[pipe["y"] + n : pipe["y"] + 2 * n]
        family = scheme_family(settings, n)
        degree, limiter, small = settings["degree"], settings["limiter"], pipe["noise"]
        for right in range(2):
            wave = end_value(r if right == 1 else l, right, family, degree, limiter, small, scratch)
            out[at + 1 + right] = wave
            node = pipe["to_node"] if right == 1 else pipe["from_node"]
            out[layout["net"] + node] += 2.0 * wave


@njit
def incoming_waves_linear(t, y, dydt, out, handle):
    """Write the waves from nodes into pipes to out[ends]: incoming wave = Y p' - outgoing wave [kg/s].

    p' : pressure change of the node since the start [Pa]; Y : admittance of the pipe [kg/s per Pa]
    """
    tables = open_tables(handle)
    layout, pipes = tables.layout[0], tables.pipes
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["delay"] >= 0:
            continue
        at = layout["ends"] + 4 * i
        p_from = out[layout["pressure"] + pipe["from_node"]]
        p_to = out[layout["pressure"] + pipe["to_node"]]
        out[at] = pipe["admittance"] * p_from - out[at + 1]
        out[at + 3] = pipe["admittance"] * p_to - out[at + 2]


@njit
def wave_rates(t, y, dydt, out, handle):
    """Write d/dt of the waves in all pipe cells [kg/s2] to `dydt`, unless it is empty."""
    tables = open_tables(handle)
    settings, layout, pipes = tables.settings[0], tables.layout[0], tables.pipes
    if dydt.size == 0:
        return
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["delay"] >= 0:
            continue
        n, o, at = pipe["cells"], pipe["y"], layout["ends"] + 4 * i
        pipe_rates(
            settings, pipe, y[o : o + n], y[o + n : o + 2 * n], out[at], out[at + 1], out[at + 2], out[at + 3],
            tables.scratch, dydt[o : o + n], dydt[o + n : o + 2 * n],
        )  # fmt: skip
