"""The same under laws by which density follows pressure: what drives fluid by mass. Knows stretches; moves no body."""

from fvsolve.jit import njit
from fvsolve.kernels.density import enthalpy, pressure_of_enthalpy
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.mechanism.rides import mark_weightless, weight_under
from fvsolve.kernels.records import TANK
from fvsolve.kernels.tanks import tank_level


@njit
def press_tanks_barotropic(t, y, dydt, out, handle):
    """Pressures at the bottoms of tanks that ride, h(p) = h(ambient) + weight."""
    tables = open_tables(handle)
    st, nodes, floats = tables.settings[0], tables.nodes, tables.floats
    for i in range(nodes.size):
        node = nodes[i]
        if node["kind"] == TANK and node["ride"] >= 0:
            ride, level = tables.rides[node["ride"]], tank_level(node, floats, node["density"], y[node["y"]])
            h = enthalpy(st, floats, st["ambient"])
            now = pressure_of_enthalpy(st, floats, h + weight_under(tables, out, ride, level))
            out[tables.layout[0]["pressure"] + i] = now - pressure_of_enthalpy(st, floats, h + ride["rest"])
            mark_weightless(tables, out, i, ride, level)


@njit
def push_cells_barotropic(t, y, dydt, out, handle):
    """Add what drives the cells of pipes to their waves: m / dx of it to dM/dt, m the mass per length there."""
    tables = open_tables(handle)
    pipes, profile, at = tables.pipes, tables.profile, tables.layout[0]["ride"]
    for i in range(pipes.size if dydt.size > 0 else 0):
        pipe = pipes[i]
        n, o, ride = pipe["cells"], pipe["y"], pipe["ride"]
        for k in range(n if ride >= 0 else 0):
            m = profile[pipe["center"] + k] + (y[o + k] + y[o + n + k]) / pipe["speed"]
            push = 0.5 * m / pipe["dx"] * out[at + ride + k]
            dydt[o + k] += push
            dydt[o + n + k] -= push
