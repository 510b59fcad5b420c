"""Air that a valve lets in and out of a chamber over the fluid. Knows one chamber; knows no network.

p V = m R T, V = V0 - y / rho with y [kg] the fluid that came in; the flow of air is isentropic through an orifice each
way, choked below r = 0.528 (Wylie and Streeter 1993, 7-4). Open (armed), fluid passes; shut, none does, and the place
is a junction. It opens where the pressure there falls below ambient and shuts once V is V0 again and fluid still comes.
One that throttles lets air out through its wide bore until the pressure inside is `SWITCH` above ambient, or it is
above ambient while fluid comes on at `COMING`, and from then on, armed[event + 2], through a small one, until it is at
ambient; its automatic bore lets air out beside either.
"""

from math import expm1, log1p, sqrt

from fvsolve.jit import njit
from fvsolve.kernels.density import enthalpy, pressure_of_enthalpy
from fvsolve.kernels.either import either
from fvsolve.kernels.energy_barotropic import vessel_power
from fvsolve.kernels.records import LAW_LINEAR, RATE
from fvsolve.kernels.restrictions import restriction_slope
from fvsolve.kernels.valves import flow_at_drop

VOLUME, AIR, HEAT, IN, OUT, SWITCH, SLOW, COMING = 0, 1, 2, 3, 4, 5, 6, 7
"""numbers: V0 [m3], air in it at ambient [kg], R T [J/kg], Cd A in and out [m2]; pressure over ambient at which it
throttles [Pa], 0 for none, and Cd A out from then on [m2]; flow of fluid at which it does [kg/s], 0 for none."""
KAPPA = 1.4
CHOKED = (2.0 / (KAPPA + 1.0)) ** (KAPPA / (KAPPA - 1.0))
SMALL = 1e-3  # share of the pressure upstream below which the root of a difference is made a polynomial
NEAR = 0.02  # the same below which a step may turn the flow: the quicker way sets how quick it is
RELUCTANCE = (
    10.0  # by which pressure must fall below ambient before it opens, or exceed it before fluid throttles it [Pa]
)
LAX = 1e-9  # share of V0 by which it must be overfull before it shuts
LINGER = 0.02  # s, in which the air that is left when it shuts comes to ambient pressure, at the quickest


@njit
def orifice_air(r):
    """Mass flow over Cd A p0 / sqrt(R T) from p0 to r p0, isentropic, choked below CHOKED."""
    x, power = 1.0 - max(r, CHOKED), (KAPPA - 1.0) / KAPPA
    share = -expm1(power * log1p(-x)) / x if x > 0.0 else power
    root = flow_at_drop(1.0, sqrt(SMALL), x)
    return root * sqrt(2.0 / power * share) * (1.0 - x) ** (1.0 / KAPPA)


@njit
def air_state(st, floats, node, at, y_fluid, y_air):
    """(pressure of the air over ambient [Pa], its volume [m3], its mass [kg])."""
    first, held = floats[at + VOLUME], floats[at + AIR]
    gone = y_fluid / (node["density"] * first)
    left = max(1e-3, 1.0 - gone)
    return st["ambient"] * (y_air / held + gone) / left, first * left, held + y_air


@njit
def throttles(floats, at):
    """Whether it has a small bore for air out."""
    return floats[at + SWITCH] > 0.0 or floats[at + COMING] > 0.0


@njit
def way_out(tables, device):
    """Cd A of what air leaves by now [m2]."""
    floats, at = tables.floats, device["data"]
    if throttles(floats, at) and tables.armed[device["event"] + 2] > 0.0:
        return floats[at + SLOW]
    return floats[at + OUT]


@njit
def air_inflow(st, floats, at, gauge, leaves):
    """(mass flow of air into the chamber [kg/s], the greatest it could be per share of pressure); leaves : Cd A out."""
    p, root = st["ambient"] + gauge, sqrt(floats[at + HEAT])
    if gauge < 0.0:
        size = floats[at + IN] * st["ambient"] / root
        r, sign = p / st["ambient"], 1.0
    else:
        size = leaves * p / root
        r, sign = st["ambient"] / p, -1.0
    x, widest = max(1.0 - r, SMALL), size
    if x < NEAR:
        widest = max(floats[at + IN], leaves) * p / root
    return sign * size * orifice_air(r), 1.5 * widest * orifice_air(1.0 - x) / x


@njit
def set(t, y, out, tables, device):
    """Pressure and stiffness of its chamber, and whether fluid passes."""
    st, floats, layout, i = tables.settings[0], tables.floats, tables.layout[0], device["node"]
    node, k = tables.nodes[i], device["valve"]
    gauge, volume, _ = air_state(st, floats, node, device["data"], y[node["y"]], y[device["y"]])
    change = gauge
    if st["law"] != LAW_LINEAR and gauge != 0.0:  # so that H dm is (p_air - p_ambient) dV
        base = enthalpy(st, floats, st["ambient"])
        change = pressure_of_enthalpy(st, floats, base + gauge / node["density"]) - st["ambient"]
    out[layout["pressure"] + i] = change
    out[layout["stiffness"] + node["row"]] = (st["ambient"] + gauge) / (volume * node["density"])
    is_open = tables.armed[device["event"]] > 0.0
    out[layout["conductance"] + k] = tables.valves[k]["conductance"] if is_open else 0.0


@njit
def air_rate(y, tables, device):
    """(d/dt of the air in its chamber [kg/s], how quick that is [1/s], R T ln(p / p_ambient) [J/kg])."""
    st, floats, at = tables.settings[0], tables.floats, device["data"]
    node = tables.nodes[device["node"]]
    gauge, volume, mass = air_state(st, floats, node, at, y[node["y"]], y[device["y"]])
    flow, slope = air_inflow(st, floats, at, gauge, way_out(tables, device))
    even = st["ambient"] * volume / floats[at + HEAT]  # mass at which it would be at ambient pressure
    quick = slope / min(mass, even)
    if tables.armed[device["event"]] <= 0.0 and abs(flow) * LINGER >= abs(even - mass):
        flow, quick = (even - mass) / LINGER, 1.0 / LINGER
    return flow, quick, floats[at + HEAT] * log1p(gauge / st["ambient"])


@njit
def move(t, y, dydt, out, tables, device):
    """d/dt of the air in its chamber."""
    flow, quick, _ = air_rate(y, tables, device)
    out[RATE] = max(out[RATE], quick, fluid_rate(out, tables, device))
    if dydt.size > 0:
        dydt[device["y"]] = flow


@njit
def fluid_rate(out, tables, device):
    """How quickly fluid comes and goes in its chamber while open [1/s]: stiffness times all that joins the place."""
    layout, nodes, valves, own = tables.layout[0], tables.nodes, tables.valves, device["valve"]
    place = valves[own]["from_node"]
    if tables.armed[device["event"]] <= 0.0:
        return 0.0
    total = nodes[place]["admittance"]
    for k in range(valves.size):
        i, j = valves[k]["from_node"], valves[k]["to_node"]
        if k != own and (i == place or j == place):
            drop = valves[k]["drop"] + (out[layout["pressure"] + i] - out[layout["pressure"] + j])
            total += restriction_slope(tables, out, k, drop)
    return out[layout["stiffness"] + nodes[device["node"]]["row"]] * total


@njit
def events(t, y, out, tables, device, g):
    """g: what is left until it opens [Pa], until it shuts, negative [kg]; and the same with the other sign."""
    st, floats, at = tables.settings[0], tables.floats, device["event"]
    node, place = tables.nodes[device["node"]], tables.valves[device["valve"]]["from_node"]
    fluid = y[node["y"]]
    lax = LAX * node["density"] * floats[device["data"] + VOLUME]
    left = fluid - lax
    if out[tables.layout[0]["valve"] + device["valve"]] <= 0.0:  # as full as when it shut, but fluid leaves
        left = min(left, -lax)
    if tables.armed[at] <= 0.0:
        p = tables.nodes[place]["pressure"] + out[tables.layout[0]["pressure"] + place] - st["ambient"]
        gauge = air_state(st, floats, node, device["data"], fluid, y[device["y"]])[0]
        left = p - min(gauge, 0.0) + RELUCTANCE
    either(tables, g, at, left)
    if throttles(floats, device["data"]):
        gauge = air_state(st, floats, node, device["data"], fluid, y[device["y"]])[0]
        either(tables, g, at + 2, -gauge if tables.armed[at + 2] > 0.0 else until_throttled(out, tables, device, gauge))


@njit
def until_throttled(out, tables, device, gauge):
    """What is left until it throttles: pressure [Pa], or flow of fluid [kg/s] once its air is RELUCTANCE above ambient.

    At ambient itself it is wide again, and would be neither.
    """
    floats, at = tables.floats, device["data"]
    if floats[at + SWITCH] > 0.0:
        return floats[at + SWITCH] - gauge
    return max(floats[at + COMING] - out[tables.layout[0]["valve"] + device["valve"]], RELUCTANCE - gauge)


@njit
def value(t, y, out, tables, device, which):
    """Volume [m3], mass [kg] and pressure [Pa] of the air in its chamber."""
    st, floats = tables.settings[0], tables.floats
    node = tables.nodes[device["node"]]
    gauge, volume, mass = air_state(st, floats, node, device["data"], y[node["y"]], y[device["y"]])
    return volume if which == 0 else mass if which == 1 else st["ambient"] + gauge


@njit
def air_energy(st, floats, node, at, y_fluid, y_air):
    """m R T (ln(p / p_ambient) - 1) + p_ambient V of the air, and the height of the fluid [J]; 0 in the profile."""
    gauge, volume, mass = air_state(st, floats, node, at, y_fluid, y_air)
    found = mass * floats[at + HEAT] * log1p(gauge / st["ambient"]) - gauge * volume
    return found + st["gravity"] * (node["elevation"] - st["datum"]) * y_fluid


@njit
def stored(y, tables, device):
    """What it stores, change since the profile [J]."""
    node = tables.nodes[device["node"]]
    return air_energy(tables.settings[0], tables.floats, node, device["data"], y[node["y"]], y[device["y"]])


@njit
def power(t, y, dydt, out, tables, device):
    """(0, rate of what it stores, what the air loses on its way through the orifice) [W]."""
    potential = air_rate(y, tables, device)[2] * dydt[device["y"]]
    return 0.0, vessel_power(dydt, out, tables, device) + potential, -potential
