"""Power and stored energy of nodes, links and masses under the density law `linear`.

P = p - p_ambient + rho g z is the potential [Pa], z the elevation above datum. A mass flow M at a port carries the
power P M / rho. A pipe of area A and wave speed c stores A P^2 / (2 rho c^2) + M^2 / (2 rho A) per length. A chamber of
volume V stores V p^2 / (2 beta) with gauge pressure p, a tank its mass times g z, a rigid column of length L M^2 L / (2
rho A). Friction dissipates M drag / (rho A) per length. Squares are averaged over a cell from the values at three Gauss
points of a polynomial of the scheme's degree through neighbouring cells. Stored energies are changes since the initial
steady state, a cross term and a square: no small difference of large numbers.

Entries of `power` [W], for every part of a kind in turn:
NODE : power supplied from outside, rate of stored energy
PIPE : inflow of power, friction, loss of jets, rate of stored energy, dissipation by creep, residual of the density law
VALVE : loss
COLUMN : inflow of power, friction, rate of stored energy
MASS : rate of stored energy
BRACE : power absorbed by a spring or damper, or supplied by a force
STOP : rate of stored energy, loss
PISTON : loss of the leak, friction, residual of the density law where a volume changes

Entries of `stored` [J]: each node; kinetic and elastic (with potential) energy of each pipe, or energy of the forward
and the backward wave of a delay line; each column, mass, brace, stop.
"""

import numpy as np

from fvsolve.jit import njit
from fvsolve.kernels.column_junctions import column_drag
from fvsolve.kernels.delay_lines.line_energy import GAUSS_POINTS, GAUSS_WEIGHTS, line_energy, line_power
from fvsolve.kernels.dtypes import CHAMBER, MUSCL, SHORT, TANK, UPWIND, WENO5
from fvsolve.kernels.mass_dynamics import contact_force, excess_of, motion, piston_travel, stop_travel, travel_of
from fvsolve.kernels.pipes import scheme_family
from fvsolve.kernels.steady_friction import drag
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.tank_levels import tank_level

NODE, PIPE, VALVE, COLUMN, MASS, BRACE, STOP, PISTON = 2, 6, 1, 3, 1, 1, 2, 3  # rows of `power` for each part
CREEP = 4  # the row of creep among the rows of a pipe
MAX_WIDTH = 5  # cells of the widest polynomial


def point_weights():
    """Weights of cell averages in the value of a polynomial at Gauss points : float64[w, i, point, cell].

    The polynomial has the averages of w neighbouring cells; the Gauss points are those of cell i among them.
    """
    weights = np.zeros((MAX_WIDTH + 1, MAX_WIDTH, 3, MAX_WIDTH))
    for w in range(1, MAX_WIDTH + 1):
        for i in range(w):
            edges = np.arange(w + 1) - i - 0.5
            powers = np.arange(w)
            means = (edges[1:, None] ** (powers + 1) - edges[:-1, None] ** (powers + 1)) / (powers + 1)
            weights[w, i, :, :w] = np.linalg.solve(means.T, (GAUSS_POINTS[:, None] ** powers).T).T
    return weights


POINTS = point_weights()


@njit
def polynomial_width(settings, n):
    """Number of cells of the polynomial from which squares are averaged, for a pipe of n cells.

    It is 1 below order three, otherwise the order of the scheme, and at most n.
    """
    family, width = scheme_family(settings, n), 1
    if family == WENO5:
        width = MAX_WIDTH
    elif family == SHORT:
        width = 3
    elif family != UPWIND and family != MUSCL and settings["degree"] > 1:
        width = settings["degree"] + 1
    return min(width, n)


@njit(forceinline=True)
def at_point(c, width, i, point):
    """Value at a Gauss point of cell i, from the polynomial through the averages c of `width` cells around it."""
    first = min(max(i - width // 2, 0), c.size - width)
    total = 0.0
    for k in range(width):
        total += POINTS[width, i - first, point, k] * c[first + k]
    return total


@njit(forceinline=True)
def gauge_pressure(tables, out, i):
    """Gauge pressure p - p_ambient of node i [Pa]."""
    start = tables.nodes[i]["pressure"] - tables.settings[0]["ambient"]
    return start + out[tables.layout[0]["pressure"] + i]


@njit(forceinline=True)
def total_pressure(tables, out, i):
    """Potential P = p - p_ambient + rho g z of node i [Pa]."""
    return gauge_pressure(tables, out, i) + height_pressure(tables.settings[0], tables.nodes[i])


@njit(forceinline=True)
def height_pressure(st, node):
    """Hydrostatic pressure rho g z of a node at the elevation z above datum [Pa]."""
    return st["rho"] * st["gravity"] * (node["elevation"] - st["datum"])


@njit
def pipe_power(st, pipe, start, r, l, dr, dl, rows):
    """Write dissipation by friction to rows[1], zero to rows[2] and the rate of stored energy to rows[3] of a pipe [W].

    rows : entries of the pipe in `power`; start : potential P of the initial steady state at the `from` end [Pa]
    r, l : float64[cells]  forward and backward wave [kg/s]
    dr, dl : float64[cells]  d/dt of both waves [kg/s2]
    """
    n, width, per = r.size, polynomial_width(st, r.size), 1.0 / (st["rho"] * pipe["area"])
    fall, flow = pipe["drag"] / pipe["area"], pipe["flow"]
    friction, rate = 0.0, 0.0
    for i in range(n):
        for g in range(3):
            a, b = at_point(r, width, i, g), at_point(l, width, i, g)
            da, db = at_point(dr, width, i, g), at_point(dl, width, i, g)
            total = flow + (a - b)
            p = pipe["admittance"] * (start - fall * (i + 0.5 + GAUSS_POINTS[g]) * pipe["dx"])
            force = drag(pipe["friction"], pipe["loss"], pipe["rough"], pipe["roughness"], pipe["reynolds"], total)
            friction += GAUSS_WEIGHTS[g] * (total * force)
            rate += GAUSS_WEIGHTS[g] * ((p * (da + db) + flow * (da - db)) + 2.0 * (a * da + b * db))
    rows[1], rows[2], rows[3] = per * pipe["dx"] * friction, 0.0, per * pipe["dx"] * rate


@njit
def pipe_energy(st, pipe, start, r, l, rows):
    """Write the energy changes of a pipe since the start [J]: kinetic to rows[0], elastic and potential to rows[1].

    start : potential P of the initial steady state at the `from` end [Pa]
    r, l : float64[cells]  forward and backward wave [kg/s]
    """
    n, width, per = r.size, polynomial_width(st, r.size), 0.5 / (st["rho"] * pipe["area"])
    fall, flow = pipe["drag"] / pipe["area"], pipe["flow"]
    kinetic, elastic = 0.0, 0.0
    for i in range(n):
        for g in range(3):
            a, b = at_point(r, width, i, g), at_point(l, width, i, g)
            p = pipe["admittance"] * (start - fall * (i + 0.5 + GAUSS_POINTS[g]) * pipe["dx"])
            kinetic += GAUSS_WEIGHTS[g] * ((2.0 * flow + (a - b)) * (a - b))
            elastic += GAUSS_WEIGHTS[g] * ((2.0 * p + (a + b)) * (a + b))
    rows[0], rows[1] = per * pipe["dx"] * kinetic, per * pipe["dx"] * elastic


@njit
def power_linear(t, y, dydt, out, handle, power):
    """Fill `power` [W] for every part under the density law `linear`, from a state, its rates and `out`."""
    tables = open_tables(handle)
    st, layout, nodes, pipes = tables.settings[0], tables.layout[0], tables.nodes, tables.pipes
    valves, columns, per = tables.valves, tables.columns, 1.0 / tables.settings[0]["rho"]
    at = 0
    for i in range(nodes.size):
        p = total_pressure(tables, out, i) * per
        power[at], power[at + 1] = p * out[layout["supply"] + i], 0.0
        if nodes[i]["kind"] == TANK or nodes[i]["kind"] == CHAMBER:
            power[at + 1] = p * dydt[nodes[i]["y"]]
        at += NODE
    for k in range(pipes.size):
        pipe = pipes[k]
        n, o, end = pipe["cells"], pipe["y"], layout["ends"] + 4 * k
        first = nodes[pipe["from_node"]]
        start = (first["pressure"] - st["ambient"]) + height_pressure(st, first)
        into = total_pressure(tables, out, pipe["from_node"]) * (pipe["flow"] + (out[end] - out[end + 1]))
        into -= total_pressure(tables, out, pipe["to_node"]) * (pipe["flow"] + (out[end + 2] - out[end + 3]))
        power[at], power[at + CREEP : at + PIPE] = into * per, 0.0
        if pipe["delay"] >= 0:
            line_power(t, out, tables, pipe["delay"], power[at : at + PIPE])
        else:
            pipe_power(
                st, pipe, start, y[o : o + n], y[o + n : o + 2 * n], dydt[o : o + n], dydt[o + n : o + 2 * n],
                power[at : at + PIPE],
            )  # fmt: skip
        at += PIPE
    for k in range(valves.size):
        drop = total_pressure(tables, out, valves[k]["from_node"]) - total_pressure(tables, out, valves[k]["to_node"])
        power[at] = per * drop * out[layout["valve"] + k]
        at += VALVE
    for k in range(columns.size):
        column = columns[k]
        flow, own = out[layout["column"] + k], column["flow"] + y[column["y"]]
        drop = total_pressure(tables, out, column["from_node"]) - total_pressure(tables, out, column["to_node"])
        size = per * column["length"] / column["area"]
        power[at], power[at + 1] = per * drop * flow, size * flow * column_drag(column, flow)
        power[at + 2] = size * own * dydt[column["y"]]
        at += COLUMN
    at = power_masses(t, y, dydt, out, tables, power, at)
    power_pistons(y, dydt, out, tables, power, at)


@njit
def power_masses(t, y, dydt, out, tables, power, at):
    """Write the power entries [W] of masses, then of springs, dampers and forces, then of stops, from power[at] on.

    Returns the index after them. The entries of each part are listed at the top of this file.
    """
    layout, masses, braces, stops = tables.layout[0], tables.masses, tables.braces, tables.stops
    armed = tables.armed
    for i in range(masses.size):
        power[at] = 0.0
        if masses[i]["y"] >= 0:
            power[at] = motion(masses[i], y)[1] * dydt[masses[i]["y"] + 1] / masses[i]["lightness"]
        at += MASS
    for k in range(braces.size):
        brace = braces[k]
        speed = travel_of(out, tables, k)[1]
        power[at] = out[layout["push"] + k] * speed
        if brace["schedule"] < 0:
            power[at] = -power[at]
        at += BRACE
    first = armed.size - 2 * stops.size
    for k in range(stops.size):
        stop = stops[k]
        x, speed = stop_travel(out, tables, k)
        into, rate = 0.0, 0.0
        for side in range(2):
            if armed[first + 2 * k + side] > 0.0:
                deep = x - stop["above"] if side == 1 else -(stop["below"] + x)
                faster = speed if side == 1 else -speed
                into += contact_force(stop["stiffness"], stop["damping"], deep, faster) * faster
                rate += stop["stiffness"] * deep * faster
        power[at], power[at + 1] = rate, into - rate
        at += STOP
    return at


@njit(forceinline=True)
def piston_side(tables, piston, side):
    """(chamber node, signed area [m2], swept mass per travel [kg/m]) of side 0 (A) or 1 (B) of a piston.

    The area is positive where the volume of the chamber grows with travel.
    """
    if side == 1:
        return piston["b"], -piston["area_b"], piston["sweep_b"]
    return piston["a"], piston["area_a"], piston["sweep_a"]


@njit
def power_pistons(y, dydt, out, tables, power, at):
    """Write three powers of each piston [W] from power[at] on: loss of the leak, friction, residual of the density law.

    Also write the rate of energy stored in the chambers to the entries of their nodes: that of V p^2 / (2 beta), with
    volume V, gauge pressure p and bulk modulus beta, and of the potential energy of the mass.
    """
    st, layout, nodes, pistons = tables.settings[0], tables.layout[0], tables.nodes, tables.pistons
    per = 1.0 / st["rho"]
    for k in range(pistons.size):
        piston = pistons[k]
        speed = piston_travel(out, tables, k)[1]
        a, b = piston["a"], piston["b"]
        drop = total_pressure(tables, out, a) - total_pressure(tables, out, b)
        law = 0.0
        for side in range(2):
            i, area, sweep = piston_side(tables, piston, side)
            change = out[layout["pressure"] + i]
            p = (nodes[i]["pressure"] - st["ambient"]) + change
            excess, swept = dydt[nodes[i]["y"]], area * speed
            if piston["line"] >= 0:
                excess -= sweep * speed
            own = p * swept * (0.5 * p / st["beta"] - change / st["beta"])
            power[NODE * i + 1] = per * (p * excess + height_pressure(st, nodes[i]) * (excess + sweep * speed)) + own
            law += (per * p * sweep * speed - p * swept) - own
        power[at] = drop * piston["leakage"] * (gauge_pressure(tables, out, a) - gauge_pressure(tables, out, b))
        power[at + 1], power[at + 2] = piston["damping"] * speed * speed, law
        at += PISTON


@njit
def stored_linear(t, y, dydt, out, handle, stored):
    """Fill `stored` with the energy changes since the start [J] of nodes, pipes, columns, masses, braces and stops.

    Density law `linear`; devices, basins, bodies and bushings have functions of their own.
    """
    tables = open_tables(handle)
    st, layout, nodes, pipes = tables.settings[0], tables.layout[0], tables.nodes, tables.pipes
    columns, pistons, per = tables.columns, tables.pistons, 1.0 / tables.settings[0]["rho"]
    for i in range(nodes.size):
        node = nodes[i]
        stored[i] = 0.0
        if node["kind"] == CHAMBER:
            change, p0 = out[layout["pressure"] + i], node["pressure"] - st["ambient"]
            stored[i] = per * y[node["y"]] * (p0 + 0.5 * change + height_pressure(st, node))
        elif node["kind"] == TANK:
            stored[i] = tank_energy(st, tables.floats, node, st["rho"], y[node["y"]])
    for k in range(pistons.size):
        piston = pistons[k]
        x = piston_travel(out, tables, k)[0]
        for side in range(2):
            i, area, sweep = piston_side(tables, piston, side)
            change, p0 = out[layout["pressure"] + i], nodes[i]["pressure"] - st["ambient"]
            squeezed = nodes[i]["volume"] * change * (2.0 * p0 + change) + area * x * (p0 + change) * (p0 + change)
            gained = excess_of(y, tables, piston, i, sweep, x) + sweep * x
            height = per * height_pressure(st, nodes[i]) * gained
            stored[i] = 0.5 * squeezed / st["beta"] + height
    at = nodes.size
    for k in range(pipes.size):
        pipe = pipes[k]
        n, o, first = pipe["cells"], pipe["y"], nodes[pipe["from_node"]]
        start = (first["pressure"] - st["ambient"]) + height_pressure(st, first)
        if pipe["delay"] >= 0:
            line_energy(t, out, tables, pipe["delay"], stored[at : at + 2])
        else:
            pipe_energy(st, pipe, start, y[o : o + n], y[o + n : o + 2 * n], stored[at : at + 2])
        at += 2
    for k in range(columns.size):
        column = columns[k]
        change = y[column["y"]]
        stored[at] = per * column["length"] / column["area"] * change * (column["flow"] + 0.5 * change)
        at += 1
    stored_masses(y, out, tables, stored, at)


@njit
def tank_energy(st, floats, node, rho, change):
    """Change of the potential energy of a tank by a `change` of its mass [kg]: integral of g (z + level) dm [J].

    z : elevation of its bottom above datum; rho : density [kg/m3]
    """
    level, z = node["level"], node["elevation"] - st["datum"]
    if node["shape"] < 0:
        return st["gravity"] * change * (z + level + 0.5 * change / (rho * node["area"]))
    new = level_moment(floats, node["shape"], node["shapes"], tank_level(node, floats, rho, change))
    old = level_moment(floats, node["shape"], node["shapes"], tank_level(node, floats, rho, 0.0))
    return st["gravity"] * (z * change + rho * (new - old))


@njit
def level_moment(floats, shape, rows, level):
    """Integral of z A(z) dz from the first level of a shaped tank to `level` [m4], with surface area A at the level z.

    floats[shape:] holds `rows` levels [m], then areas [m2].
    """
    total = 0.0
    for k in range(rows):
        z0 = floats[shape + k]
        last = k == rows - 1
        z1 = level if last else min(floats[shape + k + 1], level)
        if k > 0 and level <= z0:
            break
        a0 = floats[shape + rows + k]
        growth = 0.0
        if not last and z1 >= z0:  # a tank is a prism below its first level
            growth = (floats[shape + rows + k + 1] - a0) / (floats[shape + k + 1] - z0)
        d = z1 - z0
        total += d * (a0 * (z0 + 0.5 * d) + growth * d * (0.5 * z0 + d / 3.0))
    return total


@njit
def stored_masses(y, out, tables, stored, at):
    """Write the energy changes since the start [J] of masses, springs, dampers, forces and stops from stored[at] on."""
    masses, braces, stops = tables.masses, tables.braces, tables.stops
    for i in range(masses.size):
        stored[at] = 0.0
        if masses[i]["y"] >= 0:
            change = y[masses[i]["y"] + 1]
            stored[at] = change * (masses[i]["velocity"] + 0.5 * change) / masses[i]["lightness"]
        at += 1
    for k in range(braces.size):
        x = travel_of(out, tables, k)[0]
        stored[at] = x * (0.5 * braces[k]["stiffness"] * x - braces[k]["force"])
        if braces[k]["stiffness"] == 0.0:
            stored[at] = 0.0
        at += 1
    for k in range(stops.size):
        stop = stops[k]
        x = stop_travel(out, tables, k)[0]
        now, then = (
            max(0.0, max(-(stop["below"] + x), x - stop["above"])),
            max(0.0, max(-stop["below"], -stop["above"])),
        )
        stored[at] = 0.5 * stop["stiffness"] * (now - then) * (now + then)
        at += 1
