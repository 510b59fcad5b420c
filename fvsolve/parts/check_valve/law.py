"""A check valve that shuts where its flow reverses. Knows one valve; knows no network.

Open, it is a restriction both ways, and its flow is the event function; shut, nothing passes, and it opens once the
drop exceeds its cracking pressure. armed[event] says which: it changes on accepted states alone.
"""

from fvsolve.jit import njit
from fvsolve.kernels.either import either
from fvsolve.kernels.records import JUNCTION
from fvsolve.kernels.restrictions import head_drop

RELUCTANCE = 1.0  # drop beyond the cracking pressure below which it stays shut: rounding must not open it [Pa]


@njit
def set(t, y, out, tables, device):
    """Its conductance: whole, or none."""
    k, shut = device["valve"], tables.armed[device["event"]] > 0.0
    out[tables.layout[0]["conductance"] + k] = 0.0 if shut else tables.valves[k]["conductance"]


@njit
def leads_on(tables, device):
    """Whether a place without storage lies at one of its ends: there others may hold the flow back, and it is open."""
    valve, nodes = tables.valves[device["valve"]], tables.nodes
    return nodes[valve["from_node"]]["kind"] == JUNCTION or nodes[valve["to_node"]]["kind"] == JUNCTION


@njit
def events(t, y, out, tables, device, g):
    """g: flow that is left while open [kg/s], drop beyond what opens it while shut [Pa]; and the same negative."""
    k, at = device["valve"], device["event"]
    left = out[tables.layout[0]["valve"] + k]
    if left == 0.0 and tables.armed[at] == 0.0 and leads_on(tables, device):
        left = head_drop(tables, out, k)[1] + RELUCTANCE
    if tables.armed[at] > 0.0:
        left = head_drop(tables, out, k)[1] - tables.floats[device["data"]] - RELUCTANCE
    either(tables, g, at, left)


@njit
def value(t, y, out, tables, device, which):
    """1 while it is open, 0 while it is shut."""
    return 1.0 if out[tables.layout[0]["conductance"] + device["valve"]] > 0.0 else 0.0
