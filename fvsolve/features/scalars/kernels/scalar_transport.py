"""Scalars in pipes, carried by the mass flow of the mass equation, and at nodes, where inflows are mixed by mass.

A node has a single value of each scalar. With storage it is the value of the stored mass. At a given pressure or flow
it is the given value of inflow from outside, and elsewhere the mean of all inflows. A pipe end also exchanges the
amount g (c_cell - c_node) [kg/s] by diffusion, g = 2 D m / dx, with the values c_cell in the end cell and c_node at the
node, diffusivity D [m2/s], mass per length m [kg/m] and cell length dx.

State of a cell: amount per length s = (m + W) c [kg/m], with mass per length m and value c of the scalar. The wall has
the value of the fluid and stores as much as the wall mass W of fluid per length, which is constant. The equation of a
cell, with mass flow M [kg/s] and diffusivity D [m2/s], is

    s_t + (M c - D m c_x)_x = -decay m (c - ambient)

Flows at faces are summed from the `from` end, M[i+1] = M[i] - dx dm[i]/dt, with dm/dt of the waves. So a uniform c
remains uniform.
"""

from fvsolve.core.kernels.dtypes import (
    CHAMBER,
    FIXED,
    FLAT,
    JUNCTION,
    NO_COOLANT,
    NODE_SCALAR,
    OK,
    PATCH,
    PIPE_SCALAR,
    RATE,
    STATUS,
    TANK,
    UPWIND,
    WHERE,
)
from fvsolve.core.kernels.reconstruction import by_limiter, inner_slopes, limited
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.features.scalars.kernels.tables import open_scalars
from fvsolve.jit import njit

# Flow in a loop of nodes without volume is mixed by iteration: greatest number of sweeps, relative tolerance.
MAX_SWEEPS, CHANGE_TOLERANCE = 10000, 4e-16
# depths of a tank below which it has no value of its own; its rate stays constant [m]
DRY_DEPTH, RATE_DEPTH = 1e-9, 1e-3
# Rise of temperature of the flow through a junction by the heat of a part beyond which no liquid remains liquid [K];
# throttling by 4000 bar, the greatest pressure of water jets, gives 95 K.
GREATEST_RISE = 300.0


@njit(forceinline=True)
def end_flow(out, tables, p, right):
    """Mass flow along pipe p at its `from` (0) or `to` (1) end [kg/s]."""
    at = tables.layout[0]["ends"] + 4 * p + 2 * right
    return tables.pipes[p]["flow"] + (out[at] - out[at + 1])


@njit(forceinline=True)
def cell_mass(y, tables, p, i):
    """Mass of fluid per length in cell i of pipe p [kg/m]."""
    pipe = tables.pipes[p]
    waves = y[pipe["y"] + i] + y[pipe["y"] + pipe["cells"] + i]
    return tables.profile[pipe["center"] + i] + waves * (1.0 / pipe["speed"])


@njit(forceinline=True)
def wall_mass(tables, q, p):
    """Mass of fluid per length that stores as much of scalar q as the wall of pipe p [kg/m]; 0 for p = pipes.size."""
    return tables.floats[tables.scalars[q]["wall_masses"] + p]


@njit(forceinline=True)
def cell_value(y, tables, q, p, i):
    """Value of scalar q in cell i of pipe p."""
    amount = y[tables.scalars[q]["y"] + tables.pipes[p]["cell"] + i]
    return amount / (cell_mass(y, tables, p, i) + wall_mass(tables, q, p))


@njit(forceinline=True)
def end_cell(tables, p, right, k):
    """Index of cell k from the end of pipe p: its `from` end (right = 0) or its `to` end (right = 1).

    k is 0 for the end cell. If there are fewer cells, it is the index of the last one.
    """
    n = tables.pipes[p]["cells"]
    k = min(k, n - 1)
    return n - 1 - k if right == 1 else k


@njit(forceinline=True)
def bounded(value, scalar):
    """Value limited to the bounds `least` and `greatest` of the scalar."""
    return min(max(value, scalar["least"]), scalar["greatest"])


@njit
def outlet_values(y, out, tables, q):
    """Write the value of scalar q in the water that leaves each pipe through each end to `out`.

    It follows from a limited slope, within the bounds of the scalar.
    """
    st = tables.settings[0]
    scalar = tables.scalars[q]
    at = tables.layout[0]["edge"]
    pipes, limiter = tables.pipes, st["limiter"]
    for p in range(pipes.size):
        for right in range(2):
            a = cell_value(y, tables, q, p, end_cell(tables, p, right, 0))
            value = a
            if st["scheme"] != UPWIND:
                b = cell_value(y, tables, q, p, end_cell(tables, p, right, 1))
                c = cell_value(y, tables, q, p, end_cell(tables, p, right, 2))
                # A pipe of two cells has a single difference, which counts on both sides.
                near, far = a - b, b - c if pipes[p]["cells"] > 2 else a - b
                slope = limited(limiter, near, far)
                if slope != 0.0:
                    value = bounded(a + 0.5 * slope, scalar)
            out[at + 2 * (q * pipes.size + p) + right] = value


@njit(forceinline=True)
def end_conductance(y, tables, q, p, right):
    """Diffusive exchange of scalar q between node and end cell of pipe p per difference of values, 2 D m / dx [kg/s].

    D : diffusivity [m2/s]; m : mass per length [kg/m]; dx : length of the cell [m]; right : 0 or 1, `from` or `to` end
    """
    scalar, pipe = tables.scalars[q], tables.pipes[p]
    if scalar["diffusivity"] == 0.0:
        return 0.0
    return (
        2.0
        * scalar["diffusivity"]
        * cell_mass(y, tables, p, end_cell(tables, p, right, 0))
        / pipe["dx"]
    )


@njit
def pipe_inflows(y, out, tables, q, amount, weight, cells, count):
    """Sum the inflows of scalar q from pipes into every node.

    amount, weight : float64[nodes]  receive amount of scalar, and mass flow plus diffusive conductance [kg/s]
    cells, count : float64[nodes]  receive the sum and the number of the values in pipe cells beside the node
    """
    pipes, edge = tables.pipes, tables.layout[0]["edge"]
    for i in range(amount.size):
        amount[i] = weight[i] = cells[i] = count[i] = 0.0
    for p in range(pipes.size):
        for right in range(2):
            node = pipes[p]["to_node"] if right == 1 else pipes[p]["from_node"]
            flow = end_flow(out, tables, p, right) * (1.0 if right == 1 else -1.0)
            cell = cell_value(y, tables, q, p, end_cell(tables, p, right, 0))
            g = end_conductance(y, tables, q, p, right)
            amount[node] += g * cell
            weight[node] += g
            cells[node] += cell
            count[node] += 1.0
            # Flow out of a node carries the value of the node, which is still unknown.
            if flow > 0.0:
                amount[node] += flow * out[edge + 2 * (q * pipes.size + p) + right]
                weight[node] += flow


@njit(forceinline=True)
def given_value(t, tables, q, i):
    """Value of scalar q in the inflow from outside at node i."""
    scalar, kind = tables.scalars[q], tables.nodes[i]["kind"]
    place = tables.integers[scalar["places"] + i]
    return (
        schedule_value(tables, place, t)
        if place >= 0 and not has_storage(kind)
        else scalar["initial"]
    )


@njit(forceinline=True)
def has_storage(kind):
    """True if a node of this kind stores an amount of scalar: a tank or a chamber."""
    return kind == TANK or kind == CHAMBER


@njit(forceinline=True)
def change_rate(out, tables, q):
    """Rate at which scalar q decays and reacts [1/s]; explicit steps are limited by half of it."""
    decay = tables.scalars[q]["decay"]
    return decay + out[tables.layout[0]["quickest"]] if tables.reactions.size > 0 else decay


@njit(forceinline=True)
def mixes(y, out, tables, i):
    """True if the value of a scalar at node i is that of the present inflow: the node is a junction or a dry tank."""
    node = tables.nodes[i]
    if not has_storage(node["kind"]):
        return node["kind"] == JUNCTION
    # A dry tank stores nothing, so what flows in leaves at once with its own value.
    dry = node["mass"] + y[node["y"]] <= DRY_DEPTH * node["density"] * node["area"]
    return dry or out[tables.layout[0]["supply"] + i] > 0.0


@njit
def heated_scalar(tables):
    """Number of the scalar that is the temperature of the fluid; -1 without one."""
    for q in range(tables.scalars.size):
        if tables.scalars[q]["specific_heat"] > 0.0:
            return q
    return -1


@njit(forceinline=True)
def heated_node(out, tables, j):
    """Node that heat source j heats: the node to which its flow leaves."""
    valve = tables.valves[tables.heat_sources[j]["valve"]]
    flow = out[tables.layout[0]["valve"] + tables.heat_sources[j]["valve"]]
    return valve["from_node"] if flow < 0.0 else valve["to_node"]


@njit
def mass_inflow(out, tables, i):
    """Sum of the mass flows from links and from outside into node i [kg/s]."""
    layout = tables.layout[0]
    pipes = tables.pipes
    valves = tables.valves
    total = max(out[layout["supply"] + i], 0.0)
    for p in range(pipes.size):
        if pipes[p]["to_node"] == i:
            total += max(end_flow(out, tables, p, 1), 0.0)
        if pipes[p]["from_node"] == i:
            total += max(-end_flow(out, tables, p, 0), 0.0)
    for k in range(valves.size):
        if valves[k]["to_node"] == i:
            total += max(out[layout["valve"] + k], 0.0)
        if valves[k]["from_node"] == i:
            total += max(-out[layout["valve"] + k], 0.0)
    return total


@njit
def add_heat(out, tables, specific_heat, amount, weight):
    """Add the heat of restrictions, and heat through conductances of exchangers, to the inflows of all nodes.

    amount, weight : sums of `pipe_inflows`; a conductance g between node and thermal node adds g times the value at
    the thermal node, and g, as diffusion does
    """
    heat, at = tables.layout[0]["heat"], tables.layout[0]["exchange"]
    for j in range(tables.heat_sources.size):
        amount[heated_node(out, tables, j)] += out[heat + j]
    # As an inflow with the value of the thermal node, so that the mean stays between both values.
    for k in range(tables.exchangers.size):
        g = tables.exchangers[k]["conductance"] / specific_heat
        amount[tables.exchangers[k]["node"]] += g * out[at + 2 * k]
        weight[tables.exchangers[k]["node"]] += g


@njit
def check_heated_junctions(out, tables, share):
    """Set STATUS to NO_COOLANT, and WHERE to the heat source, if a part heats a junction by more than GREATEST_RISE.

    share : mass flow into each node, plus conductances over the specific heat [kg/s]
    """
    for j in range(tables.heat_sources.size):
        i = heated_node(out, tables, j)
        too_hot = out[tables.layout[0]["heat"] + j] > GREATEST_RISE * share[i]
        if too_hot and tables.nodes[i]["kind"] == JUNCTION and out[STATUS] == OK:
            out[STATUS], out[WHERE] = NO_COOLANT, j


@njit(forceinline=True)
def after_exchange(out, tables, q, i, value):
    """Value of scalar q that leaves node i: mean `value` of its inflows, cooled by the effectiveness of exchangers."""
    at = tables.layout[0]["exchange"]
    for k in range(tables.exchangers.size if tables.scalars[q]["specific_heat"] > 0.0 else 0):
        if tables.exchangers[k]["node"] == i:
            value -= tables.exchangers[k]["effectiveness"] * (value - out[at + 2 * k])
    return value


@njit
def write_exchange(y, out, tables, q, total, share):
    """Write the heat out of the fluid through exchangers [W], and minus its effect on the amount of heat in the ledger.

    total, share : inflow of scalar q and of mass into each node, of which the quotient is the mean of its inflows
    Raises out[RATE] to the rates of stored mass and of the thermal node.
    """
    layout = tables.layout[0]
    exchangers = tables.exchangers
    nodes = tables.nodes
    at, specific_heat = layout["exchange"], tables.scalars[q]["specific_heat"]
    first = layout["net"] - exchangers.size
    for k in range(exchangers.size):
        exchanger = exchangers[k]
        i, other = exchanger["node"], out[at + 2 * k]
        arriving = leaving = out[layout["value"] + q * nodes.size + i]
        capacity = 0.0
        if exchanger["effectiveness"] > 0.0:
            # `value` at such a node is that after the exchanger; the heat follows from the fluid that arrives.
            if mixes(y, out, tables, i):
                flow, arriving = share[i], total[i] / share[i] if share[i] > 0.0 else other
            else:
                flow = mass_inflow(out, tables, i)
            capacity = exchanger["effectiveness"] * specific_heat * flow
        # Q = K (T_node - T_thermal) + eps cp M (T_inflow - T_thermal)
        heat = exchanger["conductance"] * (leaving - other) + capacity * (arriving - other)
        out[at + 2 * k + 1], out[first + k] = heat, -heat / specific_heat
        conductance = exchanger["conductance"] + capacity
        out[RATE] = max(out[RATE], conductance * exchanger["slowness"])
        if has_storage(nodes[i]["kind"]):
            mass = max(
                nodes[i]["mass"] + y[nodes[i]["y"]],
                RATE_DEPTH * nodes[i]["density"] * nodes[i]["area"],
            )
            out[RATE] = max(out[RATE], (share[i] + capacity / specific_heat) / mass)


@njit
def start_values(t, y, out, tables, q, amount, weight, cells, count):
    """Write the values of scalar q at all nodes, as far as they do not depend on other nodes.

    A junction or a dry tank, whose value is that of its inflow, gets the mean of the pipe cells beside it at first.
    amount, weight, cells, count : sums of `pipe_inflows`; a supply from outside is added to the first two
    """
    nodes = tables.nodes
    layout = tables.layout[0]
    scalar = tables.scalars[q]
    at = layout["value"] + q * nodes.size
    for i in range(nodes.size):
        kind = nodes[i]["kind"]
        if kind == FIXED:
            out[at + i] = given_value(t, tables, q, i)
        elif mixes(y, out, tables, i):
            supply = out[layout["supply"] + i]
            if supply > 0.0:
                amount[i] += supply * given_value(t, tables, q, i)
                weight[i] += supply
            out[at + i] = cells[i] / count[i] if count[i] > 0.0 else scalar["initial"]
        elif kind != PATCH:  # the basin has set its value
            mass = nodes[i]["mass"] + y[nodes[i]["y"]]
            out[at + i] = bounded(y[tables.integers[scalar["places"] + i]] / mass, scalar)


@njit
def mix_nodes(t, y, out, tables, q):
    """Write the value of scalar q at every node, in sweeps over nodes without volume until no value changes.

    Raises out[RATE] to the rate at which inflow replaces stored mass [1/s].
    """
    nodes = tables.nodes
    valves = tables.valves
    layout = tables.layout[0]
    scratch = tables.scratch
    n, at = nodes.size, layout["value"] + q * nodes.size
    amount = scratch[:n]
    weight = scratch[n : 2 * n]
    total = scratch[2 * n : 3 * n]
    share = scratch[3 * n : 4 * n]
    pipe_inflows(y, out, tables, q, amount, weight, total, share)
    start_values(t, y, out, tables, q, amount, weight, total, share)
    specific_heat = tables.scalars[q]["specific_heat"]
    if specific_heat > 0.0:
        add_heat(out, tables, specific_heat, amount, weight)
    for _ in range(MAX_SWEEPS):
        for i in range(n):
            # A value passes one valve in each sweep, so a chain of nodes without volume needs several.
            total[i], share[i] = amount[i], weight[i]
        for k in range(valves.size):
            flow = out[layout["valve"] + k]
            upstream, downstream = valves[k]["from_node"], valves[k]["to_node"]
            if flow < 0.0:
                upstream, downstream = downstream, upstream
            total[downstream] += abs(flow) * out[at + upstream]
            share[downstream] += abs(flow)
        changed = False
        for i in range(n):
            # Without any inflow the node keeps the mean of the cells beside it.
            if share[i] > 0.0 and mixes(y, out, tables, i):
                value = after_exchange(out, tables, q, i, total[i] / share[i])
                changed = changed or abs(value - out[at + i]) > CHANGE_TOLERANCE * abs(value)
                out[at + i] = value
        if not changed or valves.size == 0:
            break
    for i in range(n):
        if has_storage(nodes[i]["kind"]):
            mass = max(
                nodes[i]["mass"] + y[nodes[i]["y"]],
                RATE_DEPTH * nodes[i]["density"] * nodes[i]["area"],
            )
            out[RATE] = max(out[RATE], share[i] / mass + 0.5 * change_rate(out, tables, q))
    if specific_heat > 0.0:
        check_heated_junctions(out, tables, share)
        write_exchange(y, out, tables, q, total, share)


@njit(forceinline=True)
def record_loss(out, tables, q, k, lost):
    """Subtract the decay `lost` [kg/s] of state k of scalar q from its entries in the record of gains and losses.

    A scalar has a single entry there, or an entry for each state.
    """
    scalar, at = tables.scalars[q], tables.layout[0]["loss"] + tables.scalars[q]["loss"]
    if scalar["losses"] == 1:
        out[at] -= lost
    elif scalar["losses"] > 1:
        out[at + k] = -lost


@njit
def exchange_amounts(t, y, dydt, out, tables, q):
    """Write flows of scalar q through pipe ends and into nodes, rates of storage in nodes, gains and losses [kg/s]."""
    nodes = tables.nodes
    pipes = tables.pipes
    valves = tables.valves
    layout = tables.layout[0]
    scalar, n = tables.scalars[q], nodes.size
    value = layout["value"] + q * n
    inflow = layout["scalar_inflow"] + q * n
    gain = layout["gain"] + q * n
    for i in range(n):
        out[inflow + i] = 0.0
    for p in range(pipes.size):
        for right in range(2):
            sign, at = (1.0 if right == 1 else -1.0), 2 * (q * pipes.size + p) + right
            node = pipes[p]["to_node"] if right == 1 else pipes[p]["from_node"]
            flow = end_flow(out, tables, p, right)
            cell = cell_value(y, tables, q, p, end_cell(tables, p, right, 0))
            # Upwind: flow out of the pipe carries the value at its end, flow into it that of the node.
            through = flow * (out[layout["edge"] + at] if sign * flow > 0.0 else out[value + node])
            through += sign * end_conductance(y, tables, q, p, right) * (cell - out[value + node])
            out[layout["carried"] + at] = through
            out[inflow + node] += sign * through
    for k in range(valves.size):
        i = valves[k]["from_node"]
        j = valves[k]["to_node"]
        flow = out[layout["valve"] + k]
        # Upwind: a valve carries the value of the node from which the fluid comes.
        amount = flow * (out[value + i] if flow > 0.0 else out[value + j])
        out[inflow + i] -= amount
        out[inflow + j] += amount
    if scalar["specific_heat"] > 0.0:
        for j in range(tables.heat_sources.size):
            out[inflow + heated_node(out, tables, j)] += out[layout["heat"] + j]
        for k in range(tables.exchangers.size):
            out[inflow + tables.exchangers[k]["node"]] += out[
                layout["net"] - tables.exchangers.size + k
            ]
    for i in range(n):
        kind, supply = nodes[i]["kind"], out[layout["supply"] + i]
        # Outside a reservoir everything that flows in is taken away, and everything that leaves is supplied.
        if kind == FIXED:
            out[gain + i] = -out[inflow + i]
        elif kind != PATCH and supply > 0.0:
            out[gain + i] = supply * given_value(t, tables, q, i)
        else:
            out[gain + i] = supply * out[value + i]
        if has_storage(kind) and dydt.size > 0:
            at = tables.integers[scalar["places"] + i]
            # Decay at the rate k to the ambient value: k (amount - ambient value times mass).
            fades = scalar["decay"] * (
                y[at] - scalar["ambient"] * (nodes[i]["mass"] + y[nodes[i]["y"]])
            )
            dydt[at] = out[inflow + i] + out[gain + i] - fades
            record_loss(out, tables, q, at - scalar["y"], fades)


@njit
def cell_masses(base, slowness, r, l, m):
    """Write the mass per length of cells [kg/m] to m: initial steady value `base` plus (r + l) / speed.

    slowness : 1 / wave speed [s/m]; r, l : forward and backward wave [kg/s]
    """
    for i in range(m.size):
        m[i] = base[i] + slowness * (r[i] + l[i])


@njit
def face_flows(first, last, slowness, dr, dl, flow):
    """Write the mass flow at all faces [kg/s], from the flow `first` at the `from` end on, to `flow`.

    last : flow at the `to` end; slowness : dx / wave speed [s]; dr, dl : d/dt of both waves in cells [kg/s2]
    """
    flow[0] = first
    for i in range(dr.size - 1):
        flow[i + 1] = flow[i] - slowness * (dr[i] + dl[i])
    # Not the sum, which differs by rounding from the flow with which the node is balanced.
    flow[dr.size] = last


@njit
def concentrations(s, m, wall, c):
    """Write the values of a scalar in cells to c: amounts s over masses m, plus that of the wall; all per length."""
    for i in range(c.size):
        c[i] = s[i] / (m[i] + wall)


@njit
def inner_fluxes(conductance, c, d, m, flow, f):
    """Write the flux of a scalar after cell i to f[i + 1]: flow times upstream value, minus D m c_x [kg/s].

    conductance : D / (2 dx), multiplied with the sum of both masses per length m; D : diffusivity, dx : cell length
    c, d : values of the scalar in cells and their limited slopes; m : mass per length of cells [kg/m]
    flow : mass flow at faces [kg/s]
    """
    next = c[1:]
    bend = d[1:]
    mass = m[1:]
    through = flow[1:]
    f = f[1:]
    for i in range(c.size - 1):
        high, low = c[i] + 0.5 * d[i], next[i] - 0.5 * bend[i]
        carried = through[i] * (high if through[i] > 0.0 else low)
        f[i] = carried - conductance * (m[i] + mass[i]) * (next[i] - c[i])


@njit
def amount_rates(k, f, ds):
    """Write d/dt of amounts per length to ds, from the fluxes f through all faces; k = 1 / dx."""
    after = f[1:]
    for i in range(ds.size):
        ds[i] = k * (f[i] - after[i])


@njit
def subtract_decay(decay, ambient, s, m, wall, c, ds):
    """Subtract the decay of a scalar in the fluid from the rates ds of its amounts; return its sum [kg/m/s].

    decay : rate [1/s]; ambient : value to which it decays
    s, m, c : amount per length, mass of fluid per length [kg/m] and value in cells; wall : wall mass per length [kg/m]
    """
    lost = 0.0
    for i in range(s.size):
        # What the wall stores does not decay.
        fades = decay * ((s[i] - wall * c[i]) - ambient * m[i])
        ds[i] -= fades
        lost += fades
    return lost


@njit
def record_losses(rate, ambient, s, m, wall, c, losses):
    """Write minus the decay in each cell [kg/s] to `losses`.

    rate : decay times length of a cell [m/s]; other arguments as for `subtract_decay`
    """
    for i in range(s.size):
        losses[i] = -(rate * ((s[i] - wall * c[i]) - ambient * m[i]))


@njit
def extremes(m, flow):
    """(least mass per length of cells [kg/m], greatest |mass flow| of faces [kg/s]); m, flow : in cells, at faces."""
    least, most = m[0], abs(flow[m.size])
    for i in range(m.size):
        least, most = min(least, m[i]), max(most, abs(flow[i]))
    return least, most


@njit
def pipe_scalar_rates(y, dydt, out, tables, p):
    """Write d/dt of the amounts of all scalars in pipe p to `dydt`; raise out[RATE] to the rate of transport [1/s].

    On entry `dydt` holds d/dt of the waves. The decay is also subtracted from the record of gains and losses.
    """
    st = tables.settings[0]
    layout = tables.layout[0]
    pipe = tables.pipes[p]
    scratch = tables.scratch
    n = pipe["cells"]
    o = pipe["y"]
    dx = pipe["dx"]
    base = tables.profile[pipe["center"] :]
    r = y[o : o + n]
    l = y[o + n : o + 2 * n]
    m = scratch[:n]
    flow = scratch[n : 2 * n + 1]
    c = scratch[2 * n + 1 : 3 * n + 1]
    d = scratch[3 * n + 1 : 4 * n + 1]
    f = scratch[4 * n + 1 : 5 * n + 2]
    cell_masses(base, 1.0 / pipe["speed"], r, l, m)
    # The flows of the solved nodes, by which scalars at nodes are balanced too.
    first, last = end_flow(out, tables, p, 0), end_flow(out, tables, p, 1)
    face_flows(first, last, dx / pipe["speed"], dydt[o : o + n], dydt[o + n : o + 2 * n], flow)
    least, most = extremes(m, flow)
    nodes, limiter = tables.nodes.size, st["limiter"]
    for q in range(tables.scalars.size):
        scalar = tables.scalars[q]
        at, ends = scalar["y"] + pipe["cell"], 2 * (q * tables.pipes.size + p)
        s = y[at : at + n]
        ds = dydt[at : at + n]
        wall = wall_mass(tables, q, p)
        concentrations(s, m, wall, c)
        for i in range(n):
            d[i] = 0.0
        if st["scheme"] != UPWIND and limiter != FLAT:
            by_limiter(inner_slopes, limiter, c, d)
            for right in range(2):
                near, inner = (n - 1, n - 2) if right == 1 else (0, 1)
                sign = 1.0 if right == 1 else -1.0
                # outflow: the slope follows from the value at the end
                if sign * (last if right == 1 else first) > 0.0:
                    # The face is half a cell away, so the slope over a cell is twice the difference.
                    d[near] = 2.0 * sign * (out[layout["edge"] + ends + right] - c[near])
                elif n > 1:
                    # Where fluid enters, the value of the node at the face bounds the slope.
                    node = pipe["to_node"] if right == 1 else pipe["from_node"]
                    datum = out[layout["value"] + q * nodes + node]
                    d[near] = sign * limited(limiter, 2.0 * (datum - c[near]), c[near] - c[inner])
        inner_fluxes(0.5 * scalar["diffusivity"] / dx, c, d, m, flow, f)
        # The flows that the nodes have booked: what leaves a pipe enters its node.
        f[0], f[n] = out[layout["carried"] + ends], out[layout["carried"] + ends + 1]
        amount_rates(1.0 / dx, f, ds)
        lost = (
            subtract_decay(scalar["decay"], scalar["ambient"], s, m, wall, c, ds)
            if scalar["losses"] > 0
            else 0.0
        )
        if scalar["losses"] > 1:
            losses = out[layout["loss"] + scalar["loss"] + pipe["cell"] :]
            record_losses(dx * scalar["decay"], scalar["ambient"], s, m, wall, c, losses)
        else:
            record_loss(out, tables, q, 0, dx * lost)
        rate = (
            most / (least + wall) / dx
            + 2.0 * scalar["diffusivity"] / (dx * dx)
            + 0.5 * change_rate(out, tables, q)
        )
        out[RATE] = max(out[RATE], rate)


@njit
def clear_losses(t, y, dydt, out, handle):
    """Clear the entries of decay in the record of gains and losses."""
    tables = open_scalars(handle)
    for q in range(tables.scalars.size):
        if tables.scalars[q]["losses"] > 0:
            out[tables.layout[0]["loss"] + tables.scalars[q]["loss"]] = 0.0


@njit
def pipe_outlet_values(t, y, dydt, out, handle):
    """Write the values of all scalars in the water that leaves pipes to `out`."""
    tables = open_scalars(handle)
    for q in range(tables.scalars.size):
        outlet_values(y, out, tables, q)


@njit
def mix_scalars(t, y, dydt, out, handle):
    """Write values of scalars at all nodes, flows of scalars into them, and rates of storage unless `dydt` is empty.

    Also raise out[RATE] to the rate at which inflow replaces stored mass [1/s].
    """
    tables = open_scalars(handle)
    for q in range(tables.scalars.size):
        mix_nodes(t, y, out, tables, q)
        exchange_amounts(t, y, dydt, out, tables, q)


@njit
def mix_for_events(t, y, out, handle, g):
    """Write values of scalars at pipe ends and nodes to `out` before event functions of blocks; g is not used."""
    tables = open_scalars(handle)
    for q in range(tables.scalars.size):
        outlet_values(y, out, tables, q)
        mix_nodes(t, y, out, tables, q)


@njit
def scalar_rates(t, y, dydt, out, handle):
    """Write d/dt of the amounts of all scalars in pipes to `dydt`, unless it is empty."""
    tables = open_scalars(handle)
    for p in range(tables.pipes.size if dydt.size > 0 else 0):
        pipe_scalar_rates(y, dydt, out, tables, p)


@njit
def value_at_probe(y, out, tables, probe, kind, i, q):
    """Value of scalar q at the place of a probe.

    kind : NODE_SCALAR or PIPE_SCALAR; i : number of the node or pipe
    """
    layout = tables.layout[0]
    pipes = tables.pipes
    nodes = tables.nodes.size
    if kind == NODE_SCALAR:
        return out[layout["value"] + q * nodes + i]
    if probe["side"] != 0:
        right = 1 if probe["side"] > 0 else 0
        # Where fluid enters the pipe, its end has the value of the node.
        if probe["side"] * end_flow(out, tables, i, right) < 0.0:
            node = pipes[i]["to_node"] if right == 1 else pipes[i]["from_node"]
            return out[layout["value"] + q * nodes + node]
        return out[layout["edge"] + 2 * (q * pipes.size + i) + right]
    value = 0.0
    for j in range(probe["count"]):
        c = probe["cell"] + j
        w = y[pipes[i]["y"] + c] + y[pipes[i]["y"] + pipes[i]["cells"] + c]
        m = tables.profile[pipes[i]["center"] + c] + w / pipes[i]["speed"]
        s = y[tables.scalars[q]["y"] + pipes[i]["cell"] + c]
        value += tables.floats[probe["weights"] + j] * s / (m + wall_mass(tables, q, i))
    return value


@njit
def observe_scalars(t, y, out, handle, values):
    """Write the values of scalar probes to `values`: at a node, at a pipe end, or between the centres of two cells."""
    tables = open_scalars(handle)
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        if probe["kind"] == NODE_SCALAR or probe["kind"] == PIPE_SCALAR:
            values[k] = value_at_probe(
                y, out, tables, probe, probe["kind"], probe["index"], probe["scalar"]
            )
