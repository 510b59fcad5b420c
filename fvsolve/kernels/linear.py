"""Pipes under the linear density law, in a scene's right-hand side. Knows the tables; closes no node."""

from fvsolve.jit import njit
from fvsolve.kernels.ends import end_value
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.pipes import family_of, pipe_rates


@njit
def offer_waves(t, y, dydt, out, handle):
    """Outgoing waves of all pipes into out[ends], and what they carry into their nodes into out[net]."""
    tables = open_tables(handle)
    settings, layout, pipes = tables.settings[0], tables.layout[0], tables.pipes
    scratch = tables.scratch
    for i in range(pipes.size):
        pipe = pipes[i]
        if pipe["delay"] >= 0:
            continue
        n, at = pipe["cells"], layout["ends"] + 4 * i
        r, l = y[pipe["y"] : pipe["y"] + n], y[pipe["y"] + n : pipe["y"] + 2 * n]
        family = family_of(settings, n)
        degree, limiter, small = settings["degree"], settings["limiter"], pipe["noise"]
        for right in range(2):
            wave = end_value(r if right == 1 else l, right, family, degree, limiter, small, scratch)
            out[at + 1 + right] = wave
            node = pipe["to_node"] if right == 1 else pipe["from_node"]
            out[layout["net"] + node] += 2.0 * wave


@njit
def answer_waves(t, y, dydt, out, handle):
    """Waves that the nodes send back: incoming = Y p' - outgoing."""
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
    """d/dt of the waves in the cells of all pipes, where rates are asked for."""
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
