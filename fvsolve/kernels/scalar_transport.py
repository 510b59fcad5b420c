"""Scalars in pipes, carried by the mass flow of the mass equation.

State of a cell: amount per length s = m c [kg/m], with mass per length m and value c of the scalar. Its equation, with
mass flow M [kg/s] and diffusivity D [m2/s], is

    s_t + (M c - D m c_x)_x = -decay (s - m ambient)

Flows at faces are summed from the `from` end, M[i+1] = M[i] - dx dm[i]/dt, with dm/dt of the waves. So a uniform c
remains uniform.
"""

from fvsolve.jit import inline, njit
from fvsolve.kernels.dtypes import FLAT, NODE_SCALAR, PIPE_SCALAR, RATE, UPWIND
from fvsolve.kernels.node_mixing import end_flow, exchange_amounts, mix_nodes, outlet_values, record_loss
from fvsolve.kernels.reconstruction import by_limiter, limited, slope
from fvsolve.kernels.table_handle import open_tables


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
    flow[dr.size] = last


@njit
def concentrations(s, m, c):
    """Write the values of a scalar in cells to c: amounts per length s over masses per length m."""
    for i in range(c.size):
        c[i] = s[i] / m[i]


@inline
def inner_slopes(limiter, c, d):
    """Write limited slopes of c (differences over a cell) to d, for all cells except those at the ends.

    limiter : limiter function of two differences; c : float64[cells]  values of a scalar
    """
    here, next, inside = c[1:], c[2:], d[1:]
    for i in range(c.size - 2):
        inside[i] = slope(limiter, here[i] - c[i], next[i] - here[i])


@njit
def inner_fluxes(conductance, c, d, m, flow, f):
    """Write the flux of a scalar after cell i to f[i + 1]: flow times upstream value, minus D m c_x [kg/s].

    conductance : D / (2 dx), multiplied with the sum of both masses per length m; D : diffusivity, dx : cell length
    c, d : values of the scalar in cells and their limited slopes; m : mass per length of cells [kg/m]
    flow : mass flow at faces [kg/s]
    """
    next, bend, mass, through, f = c[1:], d[1:], m[1:], flow[1:], f[1:]
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
def subtract_decay(decay, ambient, s, m, ds):
    """Subtract the decay of a scalar from the rates ds of its amounts per length; return its sum over cells [kg/m/s].

    decay : rate [1/s]; ambient : value to which it decays
    s, m : amount and mass per length of cells [kg/m]
    """
    lost = 0.0
    for i in range(s.size):
        fades = decay * (s[i] - ambient * m[i])
        ds[i] -= fades
        lost += fades
    return lost


@njit
def greatest_velocity(m, flow):
    """Upper bound of velocity in a pipe [m/s]: greatest |mass flow| of faces over least mass per length of cells.

    m : mass per length of cells [kg/m]; flow : mass flow at faces [kg/s]
    """
    least, most = m[0], abs(flow[m.size])
    for i in range(m.size):
        least, most = min(least, m[i]), max(most, abs(flow[i]))
    return most / least


@njit
def pipe_scalar_rates(y, dydt, out, tables, p):
    """Write d/dt of the amounts of all scalars in pipe p to `dydt`; raise out[RATE] to the rate of transport [1/s].

    On entry `dydt` holds d/dt of the waves. The decay is also subtracted from the record of gains and losses.
    """
    st, layout, pipe, scratch = tables.settings[0], tables.layout[0], tables.pipes[p], tables.scratch
    n, o, dx = pipe["cells"], pipe["y"], pipe["dx"]
    base, r, l = tables.profile[pipe["center"] :], y[o : o + n], y[o + n : o + 2 * n]
    m, flow, c, d, f = (
        scratch[:n], scratch[n : 2 * n + 1], scratch[2 * n + 1 : 3 * n + 1], scratch[3 * n + 1 : 4 * n + 1],
        scratch[4 * n + 1 : 5 * n + 2],
    )  # fmt: skip
    cell_masses(base, 1.0 / pipe["speed"], r, l, m)
    first, last = end_flow(out, tables, p, 0), end_flow(out, tables, p, 1)
    face_flows(first, last, dx / pipe["speed"], dydt[o : o + n], dydt[o + n : o + 2 * n], flow)
    quick = greatest_velocity(m, flow) / dx
    nodes, limiter = tables.nodes.size, st["limiter"]
    for q in range(tables.scalars.size):
        scalar = tables.scalars[q]
        at, ends = scalar["y"] + pipe["cell"], 2 * (q * tables.pipes.size + p)
        s, ds = y[at : at + n], dydt[at : at + n]
        concentrations(s, m, c)
        for i in range(n):
            d[i] = 0.0
        if st["scheme"] != UPWIND and limiter != FLAT:
            by_limiter(inner_slopes, limiter, c, d)
            for right in range(2):
                near, inner = (n - 1, n - 2) if right == 1 else (0, 1)
                sign = 1.0 if right == 1 else -1.0
                if sign * (last if right == 1 else first) > 0.0:  # outflow: the slope follows from the value at the end
                    d[near] = 2.0 * sign * (out[layout["edge"] + ends + right] - c[near])
                elif n > 1:
                    node = pipe["to_node"] if right == 1 else pipe["from_node"]
                    datum = out[layout["value"] + q * nodes + node]
                    d[near] = sign * limited(limiter, 2.0 * (datum - c[near]), c[near] - c[inner])
        inner_fluxes(0.5 * scalar["diffusivity"] / dx, c, d, m, flow, f)
        f[0], f[n] = out[layout["carried"] + ends], out[layout["carried"] + ends + 1]
        amount_rates(1.0 / dx, f, ds)
        lost = subtract_decay(scalar["decay"], scalar["ambient"], s, m, ds) if scalar["losses"] > 0 else 0.0
        if scalar["losses"] > 1:
            for i in range(n):
                record_loss(out, tables, q, pipe["cell"] + i, dx * scalar["decay"] * (s[i] - scalar["ambient"] * m[i]))
        else:
            record_loss(out, tables, q, 0, dx * lost)
        rate = quick + 2.0 * scalar["diffusivity"] / (dx * dx) + 0.5 * scalar["decay"]
        out[RATE] = max(out[RATE], rate)


@njit
def clear_losses(t, y, dydt, out, handle):
    """Clear the entries of decay in the record of gains and losses."""
    tables = open_tables(handle)
    for q in range(tables.scalars.size):
        if tables.scalars[q]["losses"] > 0:
            out[tables.layout[0]["loss"] + tables.scalars[q]["loss"]] = 0.0


@njit
def pipe_outlet_values(t, y, dydt, out, handle):
    """Write the values of all scalars in the water that leaves pipes to `out`."""
    tables = open_tables(handle)
    for q in range(tables.scalars.size):
        outlet_values(y, out, tables, q)


@njit
def mix_scalars(t, y, dydt, out, handle):
    """Write values of scalars at all nodes, flows of scalars into them, and rates of storage unless `dydt` is empty.

    Also raise out[RATE] to the rate at which inflow replaces stored mass [1/s].
    """
    tables = open_tables(handle)
    for q in range(tables.scalars.size):
        mix_nodes(t, y, out, tables, q)
        exchange_amounts(t, y, dydt, out, tables, q)


@njit
def scalar_rates(t, y, dydt, out, handle):
    """Write d/dt of the amounts of all scalars in pipes to `dydt`, unless it is empty."""
    tables = open_tables(handle)
    for p in range(tables.pipes.size if dydt.size > 0 else 0):
        pipe_scalar_rates(y, dydt, out, tables, p)


@njit
def observe_scalars(t, y, out, handle, values):
    """Write the values of scalar probes to `values`: at a node, at a pipe end, or between the centres of two cells."""
    tables = open_tables(handle)
    layout, pipes, nodes = tables.layout[0], tables.pipes, tables.nodes.size
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        q, i = probe["scalar"], probe["index"]
        if probe["kind"] == NODE_SCALAR:
            values[k] = out[layout["value"] + q * nodes + i]
        elif probe["kind"] == PIPE_SCALAR and probe["side"] != 0:
            right = 1 if probe["side"] > 0 else 0
            if probe["side"] * end_flow(out, tables, i, right) < 0.0:
                node = pipes[i]["to_node"] if right == 1 else pipes[i]["from_node"]
                values[k] = out[layout["value"] + q * nodes + node]
            else:
                values[k] = out[layout["edge"] + 2 * (q * pipes.size + i) + right]
        elif probe["kind"] == PIPE_SCALAR:
            values[k] = 0.0
            for j in range(probe["count"]):
                c = probe["cell"] + j
                w = y[pipes[i]["y"] + c] + y[pipes[i]["y"] + pipes[i]["cells"] + c]
                m = tables.profile[pipes[i]["center"] + c] + w / pipes[i]["speed"]
                s = y[tables.scalars[q]["y"] + pipes[i]["cell"] + c]
                values[k] += tables.floats[probe["weights"] + j] * s / m
