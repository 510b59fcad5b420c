"""Power and stored energy of every part under the density laws `log` and `table`.

h is the specific enthalpy, integral of dp / rho [J/kg], z the elevation above datum, m the mass per length of a pipe or
the mass of a vessel, V the volume of a vessel, A the area of a pipe.

    power of a mass flow M      M H,  H = h(p) - h(p_ambient) + g z
    energy of a pipe per length M^2 / (2 m) + W(m) + m g z,  dW/dm = h,  W = m h - integral of A dp
    energy of a vessel          m (h + g z) - (p - p_ambient) V
    loss of a jet into a vessel M v^2 / 2,  v : velocity

For a constant bulk modulus beta, z = 0 and gauge pressure p, a vessel stores V (beta (exp(p / beta) - 1) - p). Entries
of `power` and `stored` are those of `linear_energy.py`.
"""

from fvsolve.jit import njit
from fvsolve.kernels.column_junctions import column_drag
from fvsolve.kernels.density import enthalpy, pressure_of_mass, thrust
from fvsolve.kernels.density.steady_profile import rise_at
from fvsolve.kernels.dtypes import CHAMBER, JUNCTION, LAW_LINEAR, TANK
from fvsolve.kernels.linear_energy import (
    BRACE,
    COLUMN,
    CREEP,
    GAUSS_POINTS,
    GAUSS_WEIGHTS,
    MASS,
    NODE,
    PIPE,
    PISTON,
    STOP,
    VALVE,
    at_point,
    gauge_pressure,
    piston_side,
    polynomial_width,
    power_masses,
    stored_masses,
    tank_energy,
)
from fvsolve.kernels.mass_dynamics import excess_of, leak_flow, piston_travel
from fvsolve.kernels.steady_friction import drag
from fvsolve.kernels.table_handle import open_tables

MIN_CONTENT = 1e-6  # least mass per length, relative to that of a full pipe


@njit
def relative_enthalpy(st, floats, p):
    """Specific enthalpy above its value at ambient pressure, h(p) - h(p_ambient) [J/kg]."""
    return enthalpy(st, floats, p) - enthalpy(st, floats, st["ambient"])


@njit
def energy_head(st, floats, node, p):
    """Energy per mass of fluid that enters a node at the pressure p [J/kg], under any density law.

    It is (p - p_ambient) / rho + g z under the density law `linear`, otherwise h(p) - h(p_ambient) + g z, with the
    specific enthalpy h and the elevation z above datum.
    """
    height = st["gravity"] * (node["elevation"] - st["datum"])
    if st["law"] == LAW_LINEAR:
        return (p - st["ambient"]) / st["rho"] + height
    return relative_enthalpy(st, floats, p) + height


@njit
def total_head(tables, out, i):
    """Energy per mass at node i, H = h(p) - h(p_ambient) + g z [J/kg]: specific enthalpy h, elevation z above datum."""
    st, node = tables.settings[0], tables.nodes[i]
    h = relative_enthalpy(st, tables.floats, node["pressure"] + out[tables.layout[0]["pressure"] + i])
    return h + st["gravity"] * (node["elevation"] - st["datum"])


@njit(forceinline=True)
def profile_mass(profile, pipe, i, point):
    """Mass per length of the initial steady state [kg/m] at Gauss point number `point` of cell i.

    It is the value of a parabola through the values in `profile` at both faces and at the centre of the cell.
    """
    left, right, middle = profile[pipe["face"] + i], profile[pipe["face"] + i + 1], profile[pipe["center"] + i]
    s = GAUSS_POINTS[point]
    return middle + s * ((right - left) + 2.0 * s * ((left - middle) + (right - middle)))


@njit(forceinline=True)
def mass_at_point(st, profile, pipe, i, point, change):
    """Mass per length [kg/m] at Gauss point number `point` of cell i: initial steady value plus `change`.

    It is at least the fraction MIN_CONTENT of the mass per length of a full pipe. profile : initial steady values
    """
    return max(profile_mass(profile, pipe, i, point) + change, MIN_CONTENT * st["rho"] * pipe["area"])


@njit
def pipe_power_barotropic(st, floats, profile, pipe, z, r, l, dr, dl, rows):
    """Write the dissipation by friction to rows[1] and the rate of stored energy to rows[3], both of a pipe [W].

    profile : values of the initial steady state; z : elevation of the `from` end above datum [m]
    r, l : float64[cells]  forward and backward wave [kg/s]
    dr, dl : float64[cells]  d/dt of both waves [kg/s2]
    rows : entries of the pipe in `power`, listed in `linear_energy.py`
    """
    n, c, width, dx = r.size, pipe["speed"], polynomial_width(st, r.size), pipe["dx"]
    base, reference = enthalpy(st, floats, st["ambient"]), st["rho"] * pipe["area"]
    friction, rate = 0.0, 0.0
    for i in range(n):
        for g in range(3):
            a, b = at_point(r, width, i, g), at_point(l, width, i, g)
            da, db = at_point(dr, width, i, g), at_point(dl, width, i, g)
            m, flow = mass_at_point(st, profile, pipe, i, g, (a + b) / c), pipe["flow"] + (a - b)
            v = flow / m
            h = enthalpy(st, floats, pressure_of_mass(st, floats, pipe, m)) - base
            h += st["gravity"] * (z + rise_at(profile, pipe, (i + 0.5 + GAUSS_POINTS[g]) * dx))
            force = drag(pipe["friction"], pipe["loss"], pipe["rough"], pipe["roughness"], pipe["reynolds"], flow)
            friction += GAUSS_WEIGHTS[g] * v * force * (reference / m)
            rate += GAUSS_WEIGHTS[g] * ((h - 0.5 * v * v) * (da + db) / c + v * (da - db))
    rows[1], rows[3] = dx * friction, dx * rate


@njit
def pipe_energy_barotropic(st, floats, profile, pipe, z, r, l, rows):
    """Write the energy changes of a pipe since the start [J]: kinetic to rows[0], elastic and potential to rows[1].

    profile : values of the initial steady state; z : elevation of the `from` end above datum [m]
    r, l : float64[cells]  forward and backward wave [kg/s]
    """
    n, c, width, dx = r.size, pipe["speed"], polynomial_width(st, r.size), pipe["dx"]
    base = enthalpy(st, floats, st["ambient"])
    kinetic, elastic = 0.0, 0.0
    for i in range(n):
        for g in range(3):
            a, b = at_point(r, width, i, g), at_point(l, width, i, g)
            m0 = profile_mass(profile, pipe, i, g)
            m, flow = mass_at_point(st, profile, pipe, i, g, (a + b) / c), pipe["flow"] + (a - b)
            p0, p = pressure_of_mass(st, floats, pipe, m0), pressure_of_mass(st, floats, pipe, m)
            h0, h = enthalpy(st, floats, p0) - base, enthalpy(st, floats, p) - base
            height = st["gravity"] * (z + rise_at(profile, pipe, (i + 0.5 + GAUSS_POINTS[g]) * dx))
            kinetic += GAUSS_WEIGHTS[g] * (0.5 * flow * flow / m - 0.5 * pipe["flow"] * pipe["flow"] / m0)
            squeezed = (m * h - m0 * h0) - (thrust(st, floats, pipe, p) - thrust(st, floats, pipe, p0))
            elastic += GAUSS_WEIGHTS[g] * (squeezed + height * (m - m0))
    rows[0], rows[1] = dx * kinetic, dx * elastic


@njit
def jet_losses(profile, pipe, out, end, nodes):
    """Power lost by the jets from both ends of a pipe into all nodes except junctions, M v^2 / 2 [W].

    M, v : mass flow and velocity of a jet; profile : values of the initial steady state; nodes : table of nodes
    end : index in `out` of the four waves at the ends of the pipe (forward and backward at `from`, then at `to`) [kg/s]
    """
    lost = 0.0
    for side in range(2):
        i = pipe["to_node"] if side == 1 else pipe["from_node"]
        r, l = out[end + 2 * side], out[end + 2 * side + 1]
        m = profile[pipe["face"] + side * pipe["cells"]] + (r + l) / pipe["speed"]
        flow = (2.0 * side - 1.0) * (pipe["flow"] + (r - l))
        if nodes[i]["kind"] != JUNCTION and flow > 0.0:
            lost += 0.5 * flow * (flow / m) * (flow / m)
    return lost


@njit
def power_barotropic(t, y, dydt, out, handle, power):
    """Fill `power` [W] for every part, in the order given in `linear_energy.py`, from a state and its rates."""
    tables = open_tables(handle)
    st, layout, nodes, pipes = tables.settings[0], tables.layout[0], tables.nodes, tables.pipes
    valves, columns, floats, profile = tables.valves, tables.columns, tables.floats, tables.profile
    at = 0
    for i in range(nodes.size):
        head = total_head(tables, out, i)
        power[at], power[at + 1] = head * out[layout["supply"] + i], 0.0
        if nodes[i]["kind"] == TANK or nodes[i]["kind"] == CHAMBER:
            power[at + 1] = head * dydt[nodes[i]["y"]]
        at += NODE
    for k in range(pipes.size):
        pipe = pipes[k]
        n, o, end = pipe["cells"], pipe["y"], layout["ends"] + 4 * k
        power[at] = total_head(tables, out, pipe["from_node"]) * (pipe["flow"] + (out[end] - out[end + 1]))
        power[at] -= total_head(tables, out, pipe["to_node"]) * (pipe["flow"] + (out[end + 2] - out[end + 3]))
        power[at + 2] = jet_losses(profile, pipe, out, end, nodes)
        power[at + CREEP : at + PIPE] = 0.0
        z = nodes[pipe["from_node"]]["elevation"] - st["datum"]
        pipe_power_barotropic(
            st, floats, profile, pipe, z, y[o : o + n], y[o + n : o + 2 * n], dydt[o : o + n],
            dydt[o + n : o + 2 * n], power[at : at + PIPE],
        )  # fmt: skip
        at += PIPE
    for k in range(valves.size):
        drop = total_head(tables, out, valves[k]["from_node"]) - total_head(tables, out, valves[k]["to_node"])
        power[at] = drop * out[layout["valve"] + k]
        at += VALVE
    for k in range(columns.size):
        column = columns[k]
        flow, own = out[layout["column"] + k], column["flow"] + y[column["y"]]
        drop = total_head(tables, out, column["from_node"]) - total_head(tables, out, column["to_node"])
        size = column["length"] / (column["area"] * st["rho"])
        power[at], power[at + 1] = drop * flow, size * flow * column_drag(column, flow)
        power[at + 2] = size * own * dydt[column["y"]]
        at += COLUMN
    power_masses(t, y, dydt, out, tables, power, at)
    at += MASS * tables.masses.size + BRACE * tables.braces.size + STOP * tables.stops.size
    power_pistons_barotropic(y, dydt, out, tables, power, at)


@njit
def power_pistons_barotropic(y, dydt, out, tables, power, at):
    """Write three powers of each piston [W] from power[at] on: loss of the leak, friction, and zero.

    Also write the rate of energy stored in each chamber, H dm/dt - (p - p_ambient) dV/dt [W], to the entry of its node.
    H is the energy per mass [J/kg], m the mass, V the volume.
    """
    nodes, pistons = tables.nodes, tables.pistons
    pressure = tables.layout[0]["pressure"]
    for k in range(pistons.size):
        piston = pistons[k]
        speed = piston_travel(out, tables, k)[1]
        a, b = piston["a"], piston["b"]
        for side in range(2):
            i, area, sweep = piston_side(tables, piston, side)
            gained = dydt[nodes[i]["y"]] + (sweep * speed if piston["line"] < 0 else 0.0)
            power[NODE * i + 1] = total_head(tables, out, i) * gained - gauge_pressure(tables, out, i) * area * speed
        p_a, p_b = nodes[a]["pressure"] + out[pressure + a], nodes[b]["pressure"] + out[pressure + b]
        leak = leak_flow(tables, piston, p_a, p_b)
        power[at] = (total_head(tables, out, a) - total_head(tables, out, b)) * leak
        power[at + 1], power[at + 2] = piston["damping"] * speed * speed, 0.0
        at += PISTON


@njit
def vessel_energy(st, floats, node, mass, volume, p):
    """Energy of a vessel, m (h + g z) - (p - p_ambient) V [J].

    m, V : `mass` and `volume` of its fluid; z : elevation above datum; node : row of the vessel in the table of nodes
    h : specific enthalpy above its value at ambient pressure [J/kg]
    """
    head = relative_enthalpy(st, floats, p) + st["gravity"] * (node["elevation"] - st["datum"])
    return mass * head - (p - st["ambient"]) * volume


@njit
def stored_barotropic(t, y, dydt, out, handle, stored):
    """Fill `stored` with the energy changes since the start [J] of the parts of `stored_linear`, in its order."""
    tables = open_tables(handle)
    st, layout, nodes, pipes = tables.settings[0], tables.layout[0], tables.nodes, tables.pipes
    columns, pistons, floats = tables.columns, tables.pistons, tables.floats
    for i in range(nodes.size):
        node = nodes[i]
        stored[i], p0 = 0.0, node["pressure"]
        if node["kind"] == CHAMBER:
            p, volume = p0 + out[layout["pressure"] + i], node["volume"]
            stored[i] = vessel_energy(st, floats, node, node["mass"] + y[node["y"]], volume, p)
            stored[i] -= vessel_energy(st, floats, node, node["mass"], volume, p0)
        elif node["kind"] == TANK:
            stored[i] = tank_energy(st, floats, node, node["density"], y[node["y"]])
    for k in range(pistons.size):
        piston = pistons[k]
        x = piston_travel(out, tables, k)[0]
        for side in range(2):
            i, area, sweep = piston_side(tables, piston, side)
            node, p0 = nodes[i], nodes[i]["pressure"]
            gained = excess_of(y, tables, piston, i, sweep, x) + sweep * x
            mass, volume = node["mass"] + gained, node["volume"] + area * x
            stored[i] = vessel_energy(st, floats, node, mass, volume, p0 + out[layout["pressure"] + i])
            stored[i] -= vessel_energy(st, floats, node, node["mass"], node["volume"], p0)
    at = nodes.size
    for k in range(pipes.size):
        pipe = pipes[k]
        n, o, z = pipe["cells"], pipe["y"], nodes[pipe["from_node"]]["elevation"] - st["datum"]
        pipe_energy_barotropic(
            st, floats, tables.profile, pipe, z, y[o : o + n], y[o + n : o + 2 * n], stored[at : at + 2]
        )
        at += 2
    for k in range(columns.size):
        column = columns[k]
        change = y[column["y"]]
        size = column["length"] / (column["area"] * st["rho"])
        stored[at] = size * change * (column["flow"] + 0.5 * change)
        at += 1
    stored_masses(y, out, tables, stored, at)


@njit
def vessel_power(dydt, out, tables, device):
    """Rate of the energy stored in the vessel of a device [W]: dm/dt times the energy per mass of entering fluid."""
    i, nodes = device["node"], tables.nodes
    p = nodes[i]["pressure"] + out[tables.layout[0]["pressure"] + i]
    return energy_head(tables.settings[0], tables.floats, nodes[i], p) * dydt[nodes[i]["y"]]
