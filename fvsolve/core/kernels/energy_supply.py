"""Supplied and stored energy at some states of a run, and the energy that appeared without supply.

`data` holds the results: a header (entries NEXT to PLACE), then for each source the supplied energy, the value at the
last state, the least and the greatest value; for each node the mass that has entered, and left; for each row of stored
energy its value at the start. The value of a source is its power [W], or for a node its energy per mass [J/kg].
"""

from collections import namedtuple
from functools import cache

import numpy as np

from fvsolve.core.kernels.calls import power_in_turn, rhs_in_turn, stored_in_turn
from fvsolve.core.kernels.network_energy import energy_head
from fvsolve.core.kernels.table_handle import addresses_of, boxed, floats_at, handle_of, open_tables
from fvsolve.jit import COMPILING, Intrinsic, njit, plain_kinds

# Header: count of steps at the next state; interval of states [steps], states with this interval, fraction of the next
# interval; error bound of the supplied energy, greatest released and supplied energies [J]; greatest excess over the
# allowed energy, that excess [J], its time [s] and account of stored energy; time of the last state [s].
(
    NEXT,
    INTERVAL,
    COUNT,
    TURN,
    ERROR,
    RELEASED,
    POSITIVE,
    RATIO,
    EXCESS,
    TIME,
    PLACE,
    T,
    STATES,
    HEADER,
) = range(14)
ALLOWED, BASE, ROUNDING, LIMITS = range(4)  # entries of `limits`
MOST = 6.0  # states after which the interval doubles
# the same while the supplied energy has no error, so that more states add nothing to it
MOST_EXACT = 2.0
GOLDEN = 0.6180339887498949  # fraction of an interval by which successive intervals differ

# Arrays of a watch : letter of the type.
WATCH_KINDS = {
    "own": "h",  # handle of the model with arrays of its own, so that the run is not disturbed
    "dydt": "v",
    "out": "v",
    "power": "v",
    "stored": "v",
    "held": "v",
    "values": "v",  # work arrays
    # number of the source and row of power of each term, in pairs, and its sign
    "sources": "h",
    "signs": "v",
    # node of each source, -1 for other sources; range of its values known before the run
    "nodes": "h",
    "spreads": "v",
    # number of the account and row of stored energy of each term, and its sign
    "holders": "h",
    "holding_signs": "v",
    "limits": "v",
    "data": "v",
}
WatchArrays = namedtuple("WatchArrays", WATCH_KINDS)


@cache
def watch_types() -> WatchArrays:
    """Numba types of the arrays of a watch."""
    return WatchArrays(*(plain_kinds()[kind] for kind in WATCH_KINDS.values()))


def handle_of_watch(arrays: WatchArrays) -> np.ndarray:
    """Handle of the arrays of a watch, which must be kept; without JIT an array that contains them."""
    return handle_of(addresses_of(arrays)) if COMPILING else boxed(arrays)


if COMPILING:

    @Intrinsic
    def open_watch(typingctx, watch):
        """Arrays behind the handle of a watch; an attribute such as `w.data` loads an array."""
        from fvsolve.compile.code_generation import Tables, handle_address

        return Tables("Watch", watch_types)(watch), handle_address
else:

    def open_watch(watch):
        """Arrays of a watch, given as an array that contains them."""
        return watch[0]


@njit
def watch_state(t, steps, y, ledger, handle, watch, begins):
    """Add the energy supplied since the last state, and compare it with the stored energy; writes `data`.

    The supply through a node is its mass times its energy per mass, averaged over both states; that of other sources is
    the trapezoidal rule of their power. Between two states a value may be anywhere in its range so far.

    t, steps, y : present time, count of steps, and state; ledger : sums of the ledger; handle : of the model, with the
    arrays of the run; watch : handle of the watch; begins : True for the first state after a jump, up to which nothing
    is added. Returns the count of steps at which the next state is due. Nothing is done without a first state, and
    while histories of the run have grown (the caller of the time loop then gives those of the watch the same size).
    """
    w = open_watch(watch)
    data = w.data
    nodes = w.nodes
    stored = w.stored
    if (np.isnan(data[T]) and not begins) or not copy_run(open_tables(handle), open_tables(w.own)):
        return data[NEXT]
    count, rows = nodes.size, stored.size
    masses, width = (data.size - HEADER - 4 * count - rows) // 2, ledger.size // 5
    supplied = HEADER
    last = HEADER + count
    least = HEADER + 2 * count
    greatest = HEADER + 3 * count
    entered = HEADER + 4 * count
    left, first = entered + masses, entered + 2 * masses
    energies_at(t, y, w)
    if np.isnan(data[T]):
        for i in range(rows):
            data[first + i] = stored[i]
    total, positive = 0.0, 0.0
    for k in range(count):
        value, node = w.values[k], nodes[k]
        if value < data[least + k]:
            data[least + k] = value
        if value > data[greatest + k]:
            data[greatest + k] = value
        # The value of a source that is no node is a power, so that its amount is the time.
        net, gross = t - data[T], t - data[T]
        if node >= 0:
            came = ledger[node] + ledger[2 * width + node] - data[entered + node]
            went = ledger[width + node] + ledger[3 * width + node] - data[left + node]
            net, gross = came + went, came - went
        if not begins:
            data[supplied + k] += 0.5 * net * (data[last + k] + value)
            data[ERROR] += gross * max(data[greatest + k] - data[least + k], w.spreads[k])
        data[last + k] = value
        total += data[supplied + k]
        positive += max(data[supplied + k], 0.0)
    for i in range(masses):
        data[entered + i] = ledger[i] + ledger[2 * width + i]
        data[left + i] = ledger[width + i] + ledger[3 * width + i]
    data[T] = t
    data[STATES] += 1.0
    # After a jump only the values are renewed; nothing has been supplied meanwhile.
    if begins:
        return data[NEXT]
    released = 0.0
    for i in range(rows):
        stored[i] -= data[first + i]
        released += max(-stored[i], 0.0)
    compare(t, total, positive, released, w)
    return next_state(steps, data)


@njit
def copy_run(run, own):
    """Copy the arrays of a run on which energies depend; returns False, without a copy, if their sizes differ.

    run, own : open handles of the model
    """
    # All sizes are compared before the first copy: a part of the arrays would be another state.
    for k in range(run.memory.size // 2):
        if run.memory[2 * k + 1] != own.memory[2 * k + 1]:
            return False
    for k in range(run.memory.size // 2):
        size = run.memory[2 * k + 1]
        copy(floats_at(run.memory[2 * k], size), floats_at(own.memory[2 * k], size))
    copy(run.armed, own.armed)
    own.clock[0]["limit"], own.clock[0]["step"] = run.clock[0]["limit"], run.clock[0]["step"]
    return True


@njit
def copy(source, target):
    """Copy an array to another of the same size."""
    for i in range(source.size):
        target[i] = source[i]


@njit
def energies_at(t, y, w):
    """Write the rows of stored energy and the value of each source at the state y; w : open handle of the watch."""
    stored = w.stored
    values = w.values
    nodes = w.nodes
    tables, by_node = open_tables(w.own), 0
    for i in range(stored.size):
        stored[i] = 0.0
    for k in range(nodes.size):
        values[k] = 0.0
        by_node += nodes[k] >= 0
    # Energies per mass of nodes need no rates; only powers do.
    dydt = w.dydt if by_node < nodes.size else w.dydt[:0]
    rhs_in_turn(t, y, dydt, w.out, w.own)
    stored_in_turn(t, y, dydt[:0], w.out, w.own, stored)
    st, pressure = tables.settings[0], w.out[tables.layout[0]["pressure"] :]
    for k in range(nodes.size):
        if nodes[k] >= 0:
            node = tables.nodes[nodes[k]]
            values[k] = energy_head(st, tables.floats, node, node["pressure"] + pressure[nodes[k]])
    if by_node < nodes.size:
        for i in range(w.power.size):
            w.power[i] = 0.0
        power_in_turn(t, y, dydt, w.out, w.own, w.power)
        for j in range(w.signs.size):
            k = w.sources[2 * j]
            if nodes[k] < 0:
                values[k] += w.signs[j] * w.power[w.sources[2 * j + 1]]


@njit
def compare(t, supplied, positive, released, w):
    """Compare the change of the stored energy, in `w.stored`, with the supplied energy; keep the greatest excess."""
    data = w.data
    held = w.held
    limits = w.limits
    if released > data[RELEASED]:
        data[RELEASED] = released
    if positive > data[POSITIVE]:
        data[POSITIVE] = positive
    for k in range(held.size):
        held[k] = 0.0
    for j in range(w.holding_signs.size):
        held[w.holders[2 * j]] += w.holding_signs[j] * w.stored[w.holders[2 * j + 1]]
    excess, place = -supplied, 0
    for k in range(held.size):
        excess += held[k]
        place = k if held[k] > held[place] else place
    exchanged = limits[BASE] + data[RELEASED] + data[POSITIVE]
    limit = limits[ALLOWED] * exchanged + data[ERROR] + limits[ROUNDING]
    ratio = excess / limit if limit > 0.0 else (np.inf if excess > 0.0 else 0.0)
    if ratio > data[RATIO]:
        data[RATIO], data[EXCESS], data[TIME], data[PLACE] = ratio, excess, t, place


@njit
def next_state(steps, data):
    """Count of steps at which the next state is due; intervals are irregular, and double from time to time."""
    most = MOST if data[ERROR] > 0.0 else MOST_EXACT
    data[COUNT] += 1.0
    if data[COUNT] >= most:
        data[INTERVAL] *= 2.0
        data[COUNT] = 0.5 * most
    data[TURN] = (data[TURN] + GOLDEN) % 1.0
    data[NEXT] = steps + np.ceil(data[INTERVAL] * (0.5 + data[TURN]))
    return data[NEXT]
