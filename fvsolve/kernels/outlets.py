"""Where leaks, and demands that follow the pressure, shut, open, give all or less. Knows links; knows no law."""

from fvsolve.jit import njit
from fvsolve.kernels.emitters import emitter_events
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import POWER


@njit
def outlet_events(t, y, out, handle, g):
    """Event functions of all outlets, from closed nodes; what is outside lies on the level of its place."""
    tables = open_tables(handle)
    nodes, valves, pressure = tables.nodes, tables.valves, tables.layout[0]["pressure"]
    for k in range(valves.size):
        i, j = valves[k]["from_node"], valves[k]["to_node"]
        if valves[k]["law"] == POWER:
            drop = nodes[i]["pressure"] - nodes[j]["pressure"] + (out[pressure + i] - out[pressure + j])
            emitter_events(tables, k, drop, g)
