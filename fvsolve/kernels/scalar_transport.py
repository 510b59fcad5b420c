"""Scalars in pipes, carried by the mass flow of the mass equation.

State of a cell: amount per length s = m c, m the mass per length, s_t + (M c - D m c_x)_x = -decay (s - m ambient).
Flows at faces are summed from the `from` end, M[i+1] = M[i] - dx dm[i]/dt, with dm/dt of the waves. So a uniform c
remains uniform.
"""

from fvsolve.jit import inline, njit
from fvsolve.kernels.dtypes import FLAT, NODE_SCALAR, PIPE_SCALAR, RATE, UPWIND
from fvsolve.kernels.limiters import by_limiter, limited, slope
from fvsolve.kernels.node_mixing import end_flow, exchange_amounts, mix_nodes, outlet_values, record_loss
from fvsolve.kernels.table_handle import open_tables


@njit
def cell_masses(base, slowness, r, l, m):
    """m[i], mass per length of cells [kg/m]: that of the profile plus (r + l) / speed."""
    for i in range(m.size):
        m[i] = base[i] + slowness * (r[i] + l[i])


@njit
def face_flows(first, last, slowness, dr, dl, flow):
    """Mass flow at all faces [kg/s], from that at the `from` end on; slowness = dx / speed."""
    flow[0] = first
    for i in range(dr.size - 1):
        flow[i + 1] = flow[i] - slowness * (dr[i] + dl[i])
    flow[dr.size] = last


@njit
def concentrations(s, m, c):
    """c = s / m."""
    for i in range(c.size):
        c[i] = s[i] / m[i]


@inline
def inner_slopes(limiter, c, d):
    """Limited differences over all cells except those at the ends."""
    here, next, inside = c[1:], c[2:], d[1:]
    for i in range(c.size - 2):
        inside[i] = slope(limiter, here[i] - c[i], next[i] - here[i])


@njit
def inner_fluxes(conductance, c, d, m, flow, f):
    """f[i + 1] through the face after cell i: flow times the upstream value, minus D m c_x.

    conductance : D / (2 dx), multiplied with the sum of both masses [kg/s]
    """
    next, bend, mass, through, f = c[1:], d[1:], m[1:], flow[1:], f[1:]
    for i in range(c.size - 1):
        high, low = c[i] + 0.5 * d[i], next[i] - 0.5 * bend[i]
        carried = through[i] * (high if through[i] > 0.0 else low)
        f[i] = carried - conductance * (m[i] + mass[i]) * (next[i] - c[i])


@njit
def amount_rates(k, f, ds):
    """ds from the fluxes f through all faces."""
    after = f[1:]
    for i in range(ds.size):
        ds[i] = k * (f[i] - after[i])


@njit
def subtract_decay(decay, ambient, s, m, ds):
    """Subtract the decay from ds; return its sum."""
    lost = 0.0
    for i in range(s.size):
        fades = decay * (s[i] - ambient * m[i])
        ds[i] -= fades
        lost += fades
    return lost


@njit
def greatest_velocity(m, flow):
    """Greatest |M| of faces over the least m of cells [m/s]."""
    least, most = m[0], abs(flow[m.size])
    for i in range(m.size):
        least, most = min(least, m[i]), max(most, abs(flow[i]))
    return most / least


@njit
def pipe_scalar_rates(y, dydt, out, tables, p):
    """Write rates of all scalars in pipe p; add the decay to the ledger, raise out[RATE]."""
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
    """Clear the rows of decay in the ledger."""
    tables = open_tables(handle)
    for q in range(tables.scalars.size):
        if tables.scalars[q]["losses"] > 0:
            out[tables.layout[0]["loss"] + tables.scalars[q]["loss"]] = 0.0


@njit
def pipe_outlet_values(t, y, dydt, out, handle):
    """Values of all scalars in the water that leaves pipes."""
    tables = open_tables(handle)
    for q in range(tables.scalars.size):
        outlet_values(y, out, tables, q)


@njit
def mix_scalars(t, y, dydt, out, handle):
    """Write values at all nodes, flows of scalars into them, and rates of storage unless `dydt` is empty."""
    tables = open_tables(handle)
    for q in range(tables.scalars.size):
        mix_nodes(t, y, out, tables, q)
        exchange_amounts(t, y, dydt, out, tables, q)


@njit
def scalar_rates(t, y, dydt, out, handle):
    """Rates of all amounts in pipes, unless `dydt` is empty."""
    tables = open_tables(handle)
    for p in range(tables.pipes.size if dydt.size > 0 else 0):
        pipe_scalar_rates(y, dydt, out, tables, p)


@njit
def observe_scalars(t, y, out, handle, values):
    """values[k] of every scalar probe: at a node, at a pipe end, or between the centres of two cells."""
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
