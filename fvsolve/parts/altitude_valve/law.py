"""An altitude valve: open, shut because its tank is full, or shut because its tank is empty.

The flags armed[event + FULL] and armed[event + EMPTY] are above 0 while it is shut; they change on accepted states
only. `floats` holds both levels of the tank, and the differential between shutting and opening [m].
"""

from math import sqrt

from fvsolve.core.kernels.dtypes import LAW_LINEAR
from fvsolve.core.kernels.restrictions import head_drop
from fvsolve.core.kernels.self_acting_valves import event_pair
from fvsolve.core.kernels.tanks import tank_level
from fvsolve.jit import njit

FULL, EMPTY = 0, 2  # offsets of event flags
MARGIN = 1.0  # drop in the allowed direction at which it opens, so that rounding does not [Pa]
# Flow in the other direction at which it shuts at a limit, over its flow at 1 Pa. Without flow it stays open: behind a
# shut check valve it would else shut, and open again at once by the pressure between both valves, which no flow sets.
NO_FLOW = 1e-9


@njit
def is_shut(tables, device):
    """True if the valve is shut."""
    at = device["event"]
    return tables.armed[at + FULL] > 0.0 or tables.armed[at + EMPTY] > 0.0


@njit
def set(t, y, out, tables, device):
    """Write to `out` the conductance of the valve [kg2/s2/Pa], 0 while it is shut."""
    k = device["valve"]
    out[tables.layout[0]["conductance"] + k] = (
        0.0 if is_shut(tables, device) else tables.valves[k]["conductance"]
    )


@njit
def events(t, y, out, tables, device, g):
    """Write event functions of both limits and their negatives to g.

    While the valve is open: the distance of the level from the limit [m], and at the limit the flow away from it plus
    that of `NO_FLOW` [kg/s]. While it is shut: the drop towards the allowed direction, less `MARGIN` [Pa], or the
    distance of the level from the limit, less the differential [m], whichever is above 0.
    """
    k = device["valve"]
    at = device["event"]
    st = tables.settings[0]
    node, flow = tables.nodes[tables.valves[k]["to_node"]], out[tables.layout[0]["valve"] + k]
    rho = st["rho"] if st["law"] == LAW_LINEAR else node["density"]
    level, drop = tank_level(node, tables.floats, rho, y[node["y"]]), head_drop(tables, out, k)[1]
    space, depth = tables.floats[device["data"]] - level, level - tables.floats[device["data"] + 1]
    differential = tables.floats[device["data"] + 2]
    least = NO_FLOW * sqrt(tables.valves[k]["conductance"])
    full, empty = space if space > 0.0 else least - flow, depth if depth > 0.0 else flow + least
    if tables.armed[at + FULL] > 0.0:
        full, empty = max(-drop - MARGIN, space - differential), 1.0
    elif tables.armed[at + EMPTY] > 0.0:
        full, empty = 1.0, max(drop - MARGIN, depth - differential)
    event_pair(tables, g, at + FULL, full)
    event_pair(tables, g, at + EMPTY, empty)


@njit
def value(t, y, out, tables, device, quantity):
    """Opening of the valve: 1 if open, 0 if shut."""
    return 0.0 if is_shut(tables, device) else 1.0
