"""Reactions of scalars in pipe cells, tanks and chambers: rates, changes of amounts, probes of the chemical port.

At a place with the mass m [kg, or per length or area] and the values c of its scalars, a reaction with the rate
r(c) [mol/m3/s] changes each amount at the rate nu m r, with the coefficient nu of the scalar in its unit. The product
m r is computed once, so that sums that the coefficients keep are kept to round-off. m is the mass of fluid: what walls
of pipes store does not react.

Three numbers of each scalar of a reaction lie in `floats`: its orders in the forward and in the reverse rate, and nu.
"""

from math import inf, log

from fvsolve.core.kernels.dtypes import (
    CELL_SCALAR,
    LOCAL_AFFINITY,
    RATE,
    RATE_UNWANTED,
    REACTION_VALUE,
)
from fvsolve.core.kernels.formula_programs import run_program
from fvsolve.features.scalars.kernels.scalar_transport import (
    DRY_DEPTH,
    cell_mass,
    has_storage,
    value_at_probe,
    wall_mass,
)
from fvsolve.features.scalars.kernels.tables import (
    CHANGE,
    CHEMICAL_POWER,
    FORWARD_ORDER,
    MOLAR_RATE,
    REVERSE_ORDER,
    open_scalars,
)
from fvsolve.jit import njit

DIFFERENCE = 1e-6  # of amounts, relative to the greatest: for slopes of rates, which limit steps
SMALLEST = 1e-250  # least rate of which the affinity is computed


@njit(forceinline=True)
def scalar_stride(tables):
    """Distance in y between the amounts of two successive scalars at a place in a pipe or node."""
    return tables.scalars[1]["y"] - tables.scalars[0]["y"] if tables.scalars.size > 1 else 0


@njit(forceinline=True)
def read_amounts(tables, y, first, stride, mass, p):
    """Write the values of all scalars at a place to `stack`, those of amounts in mol/m3.

    first, stride : index in y of the first amount, and distance to the next; mass : mass there, as in the amounts
    p : number of the pipe at whose wall the place is, pipes.size elsewhere
    """
    for q in range(tables.scalars.size):
        tables.stack[q] = (
            y[first + q * stride] / (mass + wall_mass(tables, q, p)) * tables.scalars[q]["molar"]
        )


@njit(forceinline=True)
def power_of(c, order):
    """Amount c to the power of an order; small negative amounts keep their sign, or count as 0."""
    if order == 1.0:
        return c
    if order == 0.0:
        return 1.0
    return c * abs(c) if order == 2.0 else max(c, 0.0) ** order


@njit(forceinline=True)
def rates_both_ways(tables, k):
    """(forward rate, reverse rate) of reaction k at the amounts in `stack` [mol/m3/s]; by a formula (rate, 0)."""
    reaction, floats = tables.reactions[k], tables.floats
    if reaction["program"] >= 0:
        none, count = tables.armed[:0], tables.scalars.size
        return run_program(
            tables.pieces, reaction["program"], 0.0, inf, count, tables.stack, none, none
        ), 0.0
    ahead, back = reaction["forward"], reaction["reverse"]
    for e in range(reaction["count"]):
        c, at = tables.stack[tables.integers[reaction["scalars"] + e]], reaction["data"] + 3 * e
        ahead *= power_of(c, floats[at + FORWARD_ORDER])
        back *= power_of(c, floats[at + REVERSE_ORDER])
    return ahead, back


@njit
def move_along(tables, k, extent):
    """Change the amounts in `stack` by an extent of reaction k [mol/m3]."""
    reaction = tables.reactions[k]
    for e in range(reaction["count"]):
        q = tables.integers[reaction["scalars"] + e]
        tables.stack[q] += (
            extent * tables.floats[reaction["data"] + 3 * e + CHANGE] * tables.scalars[q]["molar"]
        )


@njit
def greatest_rate(tables):
    """Bound of the rates of change by reactions at the amounts in `stack` [1/s], which limits explicit steps.

    It is the greatest row sum of |dr_k/dx_l|, with the rate r_k of a reaction and the extent x_l of a reaction. This
    matrix has the eigenvalues of the Jacobian of the amounts, except zeros.
    """
    size, bound = 0.0, 0.0
    for q in range(tables.scalars.size):
        size = max(size, abs(tables.stack[q]))
    # Where all amounts are zero the difference is absolute.
    step = DIFFERENCE * size if size > 0.0 else DIFFERENCE
    for k in range(tables.reactions.size):
        ahead, back = rates_both_ways(tables, k)
        total = 0.0
        for l in range(tables.reactions.size):
            # dr_k/dx_l as a difference quotient along the extent of reaction l.
            move_along(tables, l, step)
            more_ahead, more_back = rates_both_ways(tables, k)
            move_along(tables, l, -step)
            total += abs((more_ahead - ahead) - (more_back - back)) / step
        bound = max(bound, total)
    return bound


@njit(forceinline=True)
def react(y, dydt, out, tables, first, stride, mass, p, present, weight, entry):
    """Add the changes by all reactions at a place to its rates.

    first, stride, mass, p : as for `read_amounts`; present : mass that reacts, less than `mass` in a thin film
    weight : mass [kg] per `present`; entry : number of the place in the ledger of reactions
    """
    integers, floats = tables.integers, tables.floats
    read_amounts(tables, y, first, stride, mass, p)
    for k in range(tables.reactions.size):
        reaction = tables.reactions[k]
        ahead, back = rates_both_ways(tables, k)
        change = present * (ahead - back)
        for e in range(reaction["count"] if dydt.size > 0 else 0):
            coefficient = floats[reaction["data"] + 3 * e + CHANGE]
            # A scalar may determine the rate without being changed, as a catalyst does.
            if coefficient != 0.0:
                dydt[first + stride * integers[reaction["scalars"] + e]] += coefficient * change
        # The ledger has a single sum for all places, or an entry for each place.
        at = tables.layout[0]["extent"] + reaction["extent"]
        if reaction["extents"] == 1:
            out[at] += weight * change
        else:
            out[at + entry] = weight * change


@njit(forceinline=True)
def stored_mass(y, node):
    """Mass in a node in which reactions take place [kg]; 0 in a dry tank and in a node without storage."""
    if not has_storage(node["kind"]):
        return 0.0
    mass = node["mass"] + y[node["y"]]
    return mass if mass > DRY_DEPTH * node["density"] * node["area"] else 0.0


@njit
def limit_rates(t, y, dydt, out, handle):
    """Write the greatest rate of change by reactions in pipes and nodes to `out`, if it limits steps [1/s]."""
    tables = open_scalars(handle)
    at = tables.layout[0]["quickest"]
    scalar = tables.scalars[0]
    stride = scalar_stride(tables)
    if out[RATE] == RATE_UNWANTED:
        return
    out[at] = 0.0
    if tables.reactions[0]["limits"] == 0:
        return
    for p in range(tables.pipes.size):
        for i in range(tables.pipes[p]["cells"]):
            first = scalar["y"] + tables.pipes[p]["cell"] + i
            read_amounts(tables, y, first, stride, cell_mass(y, tables, p, i), p)
            out[at] = max(out[at], greatest_rate(tables))
    for i in range(tables.nodes.size):
        mass = stored_mass(y, tables.nodes[i])
        if mass > 0.0:
            read_amounts(
                tables, y, tables.integers[scalar["places"] + i], stride, mass, tables.pipes.size
            )
            out[at] = max(out[at], greatest_rate(tables))


@njit
def reaction_rates(t, y, dydt, out, handle):
    """Add changes by reactions to the rates in pipes and nodes; write rates of all reactions to the ledger."""
    tables = open_scalars(handle)
    layout = tables.layout[0]
    scalar = tables.scalars[0]
    stride = scalar_stride(tables)
    # A single sum is added up place by place, so it starts from zero in each evaluation.
    for k in range(tables.reactions.size):
        for m in range(tables.reactions[k]["extents"]):
            out[layout["extent"] + tables.reactions[k]["extent"] + m] = 0.0
    for p in range(tables.pipes.size):
        pipe = tables.pipes[p]
        for i in range(pipe["cells"]):
            mass, entry = cell_mass(y, tables, p, i), pipe["cell"] + i
            react(
                y, dydt, out, tables, scalar["y"] + entry, stride, mass, p, mass, pipe["dx"], entry
            )
    for i in range(tables.nodes.size):
        mass = stored_mass(y, tables.nodes[i])
        if mass > 0.0:
            first = tables.integers[scalar["places"] + i]
            react(
                y,
                dydt,
                out,
                tables,
                first,
                stride,
                mass,
                tables.pipes.size,
                mass,
                1.0,
                first - scalar["y"],
            )


@njit(forceinline=True)
def affinity_of(reaction, ahead, back):
    """Affinity R T ln(forward rate / reverse rate) [J/mol], with the sign of their difference."""
    return reaction["thermal"] * log(max(ahead, SMALLEST) / max(back, SMALLEST))


@njit
def add_observed(tables, k, volume, sums):
    """Add molar flow, power, |molar flow| and |molar flow| affinity of reaction k to `sums`; volume : of the place [m3]

    Amounts are those in `stack`; sums : float64[4]
    """
    ahead, back = rates_both_ways(tables, k)
    flow = volume * (ahead - back)
    sums[0] += flow
    sums[2] += abs(flow)
    # Without a reverse rate the affinity would be infinite.
    if tables.reactions[k]["reverse"] > 0.0:
        affinity = affinity_of(tables.reactions[k], ahead, back)
        sums[1] += flow * affinity
        sums[3] += abs(flow) * affinity


@njit
def sums_of_network(y, tables, k, sums):
    """Write the sums of `add_observed` over all pipe cells, tanks and chambers."""
    rho = tables.settings[0]["rho"]
    stride = scalar_stride(tables)
    scalar = tables.scalars[0]
    for e in range(4):
        sums[e] = 0.0
    for p in range(tables.pipes.size):
        pipe = tables.pipes[p]
        for i in range(pipe["cells"]):
            mass = cell_mass(y, tables, p, i)
            read_amounts(tables, y, scalar["y"] + pipe["cell"] + i, stride, mass, p)
            add_observed(tables, k, pipe["dx"] * mass / rho, sums)
    for i in range(tables.nodes.size):
        mass = stored_mass(y, tables.nodes[i])
        if mass > 0.0:
            read_amounts(
                tables, y, tables.integers[scalar["places"] + i], stride, mass, tables.pipes.size
            )
            add_observed(tables, k, mass / rho, sums)


@njit(forceinline=True)
def chosen(code, sums):
    """Value of a probe by its code, from the sums of `add_observed`; the mean affinity has the weights |molar flow|."""
    if code == MOLAR_RATE:
        return sums[0]
    if code == CHEMICAL_POWER:
        return sums[1]
    return sums[3] / sums[2] if sums[2] > 0.0 else 0.0


@njit
def observe_reactions(t, y, out, handle, values):
    """Write the values of probes of reactions to `values`, without places in basins."""
    tables = open_scalars(handle)
    for j in range(tables.probes.size):
        probe = tables.probes[j]
        k, sums = probe["index"], tables.scratch[:4]
        if probe["kind"] == REACTION_VALUE:
            sums_of_network(y, tables, k, sums)
            values[j] = chosen(probe["side"], sums)
        elif probe["kind"] == LOCAL_AFFINITY and probe["head"] != CELL_SCALAR:
            for q in range(tables.scalars.size):
                value = value_at_probe(y, out, tables, probe, probe["head"], probe["scalar"], q)
                tables.stack[q] = value * tables.scalars[q]["molar"]
            ahead, back = rates_both_ways(tables, k)
            values[j] = affinity_of(tables.reactions[k], ahead, back)
