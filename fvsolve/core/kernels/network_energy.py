"""Power and stored energy of nodes and links.

Density law `linear`: P = p - p_ambient + rho g z is the potential [Pa], z the elevation above datum. A mass flow M at a
port carries the power P M / rho. A chamber of volume V stores V p^2 / (2 beta) with gauge pressure p, a tank its mass
times g z.

Density laws `log` and `table`: a mass flow M carries M H, H = h(p) - h(p_ambient) + g z, with specific enthalpy h,
integral of dp / rho [J/kg]. A vessel of mass m and volume V stores m (h + g z) - (p - p_ambient) V. For a constant bulk
modulus beta, z = 0 and gauge pressure p this is V (beta (exp(p / beta) - 1) - p).

Under all laws a rigid column of length L stores M^2 L / (2 rho A). Stored energies are changes since the initial steady
state, a cross term and a square: no small difference of large numbers. Pipes : `pipe_energy.py`.

Entries of `power` [W], for every part of a kind in turn:
NODE : power supplied from outside, rate of stored energy
PIPE : inflow of power, friction, loss of jets, rate of stored energy, dissipation by creep, residual of the density law
VALVE : loss
COLUMN : inflow of power, friction, rate of stored energy

Entries of `stored` [J]: each node; kinetic and elastic (with potential) energy of each pipe, or energy of the forward
and the backward wave of a delay line; each column.
"""

from fvsolve.core.kernels.density import enthalpy
from fvsolve.core.kernels.dtypes import CHAMBER, LAW_LINEAR, TANK
from fvsolve.core.kernels.pipe_energy import (
    height_pressure,
    pipe_energy,
    pipe_energy_barotropic,
    pipe_power,
    pipe_power_barotropic,
)
from fvsolve.core.kernels.steady_friction import column_drag
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.core.kernels.tanks import tank_level
from fvsolve.jit import njit, specialise

NODE, PIPE, VALVE, COLUMN = 2, 6, 1, 3  # rows of `power` for each part
CREEP = 4  # the row of creep among the rows of a pipe


@njit(forceinline=True)
def gauge_pressure(tables, out, i):
    """Gauge pressure p - p_ambient of node i [Pa]."""
    start = tables.nodes[i]["pressure"] - tables.settings[0]["ambient"]
    return start + out[tables.layout[0]["pressure"] + i]


@njit(forceinline=True)
def total_pressure(tables, out, i):
    """Potential P = p - p_ambient + rho g z of node i [Pa]."""
    return gauge_pressure(tables, out, i) + height_pressure(tables.settings[0], tables.nodes[i])


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
    h = relative_enthalpy(
        st, tables.floats, node["pressure"] + out[tables.layout[0]["pressure"] + i]
    )
    return h + st["gravity"] * (node["elevation"] - st["datum"])


@njit(forceinline=True)
def column_inertia(st, column):
    """Energy of a rigid column per square of its mass flow, times two: L / (rho A) [1/kg], length L and area A."""
    if st["law"] == LAW_LINEAR:
        return 1.0 / st["rho"] * column["length"] / column["area"]
    return column["length"] / (column["area"] * st["rho"])


@njit
def vessel_energy(st, floats, node, mass, volume, p):
    """Energy of a vessel, m (h + g z) - (p - p_ambient) V [J].

    m, V : `mass` and `volume` of its fluid; z : elevation above datum; node : row of the vessel in the table of nodes
    h : specific enthalpy above its value at ambient pressure [J/kg]
    """
    head = relative_enthalpy(st, floats, p) + st["gravity"] * (node["elevation"] - st["datum"])
    return mass * head - (p - st["ambient"]) * volume


@njit
def vessel_power(dydt, out, tables, device):
    """Rate of the energy stored in the vessel of a device [W]: dm/dt times the energy per mass of entering fluid."""
    i, nodes = device["node"], tables.nodes
    p = nodes[i]["pressure"] + out[tables.layout[0]["pressure"] + i]
    return energy_head(tables.settings[0], tables.floats, nodes[i], p) * dydt[nodes[i]["y"]]


@njit
def tank_energy(st, floats, node, rho, change):
    """Change of the potential energy of a tank by a `change` of its mass [kg]: integral of g (z + level) dm [J].

    z : elevation of its bottom above datum; rho : density [kg/m3]
    """
    level, z = node["level"], node["elevation"] - st["datum"]
    # Constant area: the level rises by change / (rho A), by half of it on average.
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
        # Integral of z (a0 + growth (z - z0)) from z0 to z1.
        total += d * (a0 * (z0 + 0.5 * d) + growth * d * (0.5 * z0 + d / 3.0))
    return total


@njit
def chamber_energy(y, out, tables, i):
    """Change since the start of the energy of chamber i under the density law `linear` [J]."""
    st, node = tables.settings[0], tables.nodes[i]
    change, p0 = out[tables.layout[0]["pressure"] + i], node["pressure"] - st["ambient"]
    # Pressure is linear in mass: the mean pressure over the change gives the energy.
    return 1.0 / st["rho"] * y[node["y"]] * (p0 + 0.5 * change + height_pressure(st, node))


@njit
def chamber_energy_barotropic(y, out, tables, i):
    """Change since the start of the energy of chamber i under the density laws `log` and `table` [J]."""
    st = tables.settings[0]
    floats = tables.floats
    node = tables.nodes[i]
    p0 = tables.nodes[i]["pressure"]
    mass, volume = node["mass"] + y[node["y"]], node["volume"]
    now = vessel_energy(st, floats, node, mass, volume, p0 + out[tables.layout[0]["pressure"] + i])
    return now - vessel_energy(st, floats, node, node["mass"], volume, p0)


# Constants of the templates:
BAROTROPIC = POTENTIAL = PIPE_POWER = PIPE_ENERGY = CHAMBER_ENERGY = None


def _fill_power(t, y, dydt, out, handle, power):
    """Fill `power` [W] for nodes and links from a state, its rates and `out`, in the order at the top of this file."""
    tables = open_tables(handle)
    st = tables.settings[0]
    layout = tables.layout[0]
    nodes = tables.nodes
    pipes = tables.pipes
    valves = tables.valves
    columns = tables.columns
    at = 0
    per = 1.0 if BAROTROPIC else 1.0 / st["rho"]
    for i in range(nodes.size):
        # Power from outside is the energy per mass at the node times the supplied flow.
        head = POTENTIAL(tables, out, i) * per
        power[at], power[at + 1] = head * out[layout["supply"] + i], 0.0
        # Chambers of pistons are written by `mass_energy`, vessels by their devices.
        if nodes[i]["kind"] == TANK or nodes[i]["kind"] == CHAMBER:
            power[at + 1] = head * dydt[nodes[i]["y"]]
        at += NODE
    for k in range(pipes.size):
        pipe, end = pipes[k], layout["ends"] + 4 * k
        # Mass flows at both ends, from the four waves there.
        into = POTENTIAL(tables, out, pipe["from_node"]) * (
            pipe["flow"] + (out[end] - out[end + 1])
        )
        into -= POTENTIAL(tables, out, pipe["to_node"]) * (
            pipe["flow"] + (out[end + 2] - out[end + 3])
        )
        # Creep adds to its entries later.
        power[at], power[at + CREEP : at + PIPE] = into * per, 0.0
        PIPE_POWER(t, y, dydt, out, tables, k, power[at : at + PIPE])
        at += PIPE
    for k in range(valves.size):
        drop = POTENTIAL(tables, out, valves[k]["from_node"]) - POTENTIAL(
            tables, out, valves[k]["to_node"]
        )
        power[at] = per * drop * out[layout["valve"] + k]
        at += VALVE
    for k in range(columns.size):
        column, size = columns[k], column_inertia(st, columns[k])
        # While valves control a column, its flow in `out` differs from that of the state, which has the energy.
        flow, own = out[layout["column"] + k], column["flow"] + y[column["y"]]
        drop = POTENTIAL(tables, out, column["from_node"]) - POTENTIAL(
            tables, out, column["to_node"]
        )
        power[at], power[at + 1] = per * drop * flow, size * flow * column_drag(column, flow)
        power[at + 2] = size * own * dydt[column["y"]]
        at += COLUMN


def _fill_stored(t, y, dydt, out, handle, stored):
    """Fill `stored` with the energy changes since the start [J] of nodes, pipes and columns.

    Masses, devices, basins, bodies and bushings have functions of their own.
    """
    tables = open_tables(handle)
    st = tables.settings[0]
    nodes = tables.nodes
    pipes = tables.pipes
    columns = tables.columns
    for i in range(nodes.size):
        node = nodes[i]
        stored[i] = 0.0
        if node["kind"] == CHAMBER:
            stored[i] = CHAMBER_ENERGY(y, out, tables, i)
        elif node["kind"] == TANK:
            rho = node["density"] if BAROTROPIC else st["rho"]
            stored[i] = tank_energy(st, tables.floats, node, rho, y[node["y"]])
    at = nodes.size
    for k in range(pipes.size):
        PIPE_ENERGY(t, y, out, tables, k, stored[at : at + 2])
        at += 2
    for k in range(columns.size):
        change = y[columns[k]["y"]]
        # L / (rho A) (M^2 - M_0^2) / 2, from the change of the flow M.
        stored[at] = column_inertia(st, columns[k]) * change * (columns[k]["flow"] + 0.5 * change)
        at += 1


LINEAR = {
    "BAROTROPIC": False,
    "POTENTIAL": total_pressure,
    "PIPE_POWER": pipe_power,
    "PIPE_ENERGY": pipe_energy,
    "CHAMBER_ENERGY": chamber_energy,
}
OTHERS = {
    "BAROTROPIC": True,
    "POTENTIAL": total_head,
    "PIPE_POWER": pipe_power_barotropic,
    "PIPE_ENERGY": pipe_energy_barotropic,
    "CHAMBER_ENERGY": chamber_energy_barotropic,
}
power_linear = specialise(_fill_power, "power_linear", **LINEAR)
power_barotropic = specialise(_fill_power, "power_barotropic", **OTHERS)
stored_linear = specialise(_fill_stored, "stored_linear", **LINEAR)
stored_barotropic = specialise(_fill_stored, "stored_barotropic", **OTHERS)
