"""Air that a valve admits to and releases from a chamber above the fluid.

p V = m R T, with p, V, m and T pressure, volume, mass and temperature of the air, and V = V0 - y / rho; V0 is the
volume of the empty chamber, y the mass of fluid that has flowed in [kg] and rho its density. The flow of air is
isentropic through an orifice in each direction, choked below the pressure ratio 0.528 (Wylie and Streeter 1993, 7-4).
While open (flag armed[event]), the valve lets fluid into the chamber; while shut, the node is a junction. The valve
opens when the pressure at the node falls below ambient. It shuts when the air volume is V0 again and fluid still flows
in.

A throttling valve releases air through its wide bore until the air pressure is `SWITCH_PRESSURE` above ambient, or
until the air is above ambient and fluid flows in at `SWITCH_FLOW`. From then on (armed[event + 2]) it releases air
through a small bore, until the air is at ambient pressure. An automatic bore releases air in both cases.

A bore may have the table of its maker in place of an area. Between its points, the first of which is no flow, the
square of the mass flow is linear in the pressure difference, as in an orifice; it goes on so beyond the last point.
"""

from math import expm1, log1p, sqrt

from fvsolve.core.kernels.density import enthalpy, pressure_of_enthalpy
from fvsolve.core.kernels.dtypes import LAW_LINEAR, RATE, RATE_UNWANTED
from fvsolve.core.kernels.network_energy import vessel_power
from fvsolve.core.kernels.restrictions import flow_at_drop, restriction_slope
from fvsolve.core.kernels.self_acting_valves import event_pair
from fvsolve.jit import njit

VOLUME = 0
AIR_MASS = 1
RT = 2
INLET_AREA = 3
OUTLET_AREA = 4
SWITCH_PRESSURE = 5
THROTTLED_AREA = 6
SWITCH_FLOW = 7
INLET_TABLE, OUTLET_TABLE, THROTTLED_TABLE, OWN_NUMBERS = 8, 9, 10, 11
"""Numbers of an air valve: chamber volume V0 [m3], mass of air in V0 at ambient pressure [kg], R T [J/kg], Cd A of the
inlet and of the outlet [m2]; pressure above ambient from which the valve throttles [Pa], 0 for none; Cd A of the outlet
while it throttles [m2]; flow of fluid from which it throttles [kg/s], 0 for none; offsets of the tables of inlet,
outlet and throttled outlet, 0 for none. A table has a count, pressure differences [Pa] and squares of mass flows."""
KAPPA = 1.4
CRITICAL_RATIO = (2.0 / (KAPPA + 1.0)) ** (KAPPA / (KAPPA - 1.0))
# pressure drop over upstream pressure below which a polynomial replaces the square root
SMALL_DROP = 1e-3
# such a ratio below which a step may reverse the flow: the larger area then sets the rate limit
REVERSAL_DROP = 0.02
# below ambient at which it opens, above ambient at which the flow may throttle it [Pa]
PRESSURE_MARGIN = 10.0
OVERFILL = 1e-9  # fluid in excess of V0 at which it shuts, over V0
# shortest time constant in which the air left after shutting returns to ambient pressure [s]
EQUALISATION_TIME = 0.02


@njit
def orifice_flow(r):
    """Mass flow of air through an orifice from pressure p0 to r p0, over Cd A p0 / sqrt(R T) [-].

    The flow is isentropic, and choked below CRITICAL_RATIO. r : pressure ratio, at most 1
    """
    x, power = 1.0 - max(r, CRITICAL_RATIO), (KAPPA - 1.0) / KAPPA
    factor = -expm1(power * log1p(-x)) / x if x > 0.0 else power
    root = flow_at_drop(1.0, sqrt(SMALL_DROP), x)
    return root * sqrt(2.0 / power * factor) * (1.0 - x) ** (1.0 / KAPPA)


@njit
def air_state(st, floats, node, at, y_fluid, y_air):
    """(gauge pressure [Pa], volume [m3], mass [kg]) of the air in the chamber.

    y_fluid, y_air : mass of fluid and of air that have entered the chamber since the start [kg]
    st : settings of the model; node : row of the node; floats[at:] : parameters of the air valve
    """
    volume, start_mass = floats[at + VOLUME], floats[at + AIR_MASS]
    filled = y_fluid / (node["density"] * volume)
    left = max(1e-3, 1.0 - filled)
    return st["ambient"] * (y_air / start_mass + filled) / left, volume * left, start_mass + y_air


@njit
def has_throttled_outlet(floats, at):
    """True if the valve has a small bore for throttled outflow of air; floats[at:] : parameters of the air valve"""
    return floats[at + SWITCH_PRESSURE] > 0.0 or floats[at + SWITCH_FLOW] > 0.0


@njit
def outlet_bore(tables, device):
    """(number of its area Cd A, number of its table) of the bore for outflow of air, in the present mode of the valve.

    Cd is the discharge coefficient, A the area.
    """
    if (
        has_throttled_outlet(tables.floats, device["data"])
        and tables.armed[device["event"] + 2] > 0.0
    ):
        return THROTTLED_AREA, THROTTLED_TABLE
    return OUTLET_AREA, OUTLET_TABLE


@njit
def table_flow(floats, at, high, drop):
    """Mass flow of air [kg/s] by the table of a maker; 0 without a table.

    floats[at] : offset of the table from the parameters of the air valve, which are before it; high, drop : upstream
    pressure and pressure difference [Pa]. Below SMALL_DROP it is a polynomial, as in an orifice.
    """
    if floats[at] == 0.0:
        return 0.0
    table = at + int(floats[at])
    count, k = int(floats[table]), 1
    while k < count and drop > floats[table + k]:
        k += 1
    drops, squares = table + k, table + count + k
    if k == 1:
        slope = floats[squares] / floats[drops]
        return flow_at_drop(slope, sqrt(slope * SMALL_DROP * high), drop)
    slope = (floats[squares] - floats[squares - 1]) / (floats[drops] - floats[drops - 1])
    return sqrt(floats[squares] + slope * (drop - floats[drops]))


@njit
def bore_flow(floats, at, area, table, p, r):
    """Mass flow of air [kg/s] from pressure p [Pa] to r p through a bore.

    area, table : numbers of its area and of its table in the parameters of the air valve, floats[at:]
    """
    flow = table_flow(floats, at + table, p, (1.0 - r) * p)
    if floats[at + area] > 0.0:
        flow += floats[at + area] * p / sqrt(floats[at + RT]) * orifice_flow(r)
    return flow


@njit
def air_inflow(st, floats, at, gauge, area, table):
    """(mass flow of air into the chamber [kg/s], estimate of its greatest slope over the pressure ratio [kg/s]).

    The pressure ratio is the lower of the pressures inside and outside the chamber over the higher one.
    gauge : gauge pressure of the air in the chamber [Pa]; area, table : results of `outlet_bore`
    st : settings of the model; floats[at:] : parameters of the air valve
    """
    p, ambient = st["ambient"] + gauge, st["ambient"]
    if gauge < 0.0:
        high = ambient
        r = p / ambient
        sign = 1.0
        own, own_table = INLET_AREA, INLET_TABLE
    else:
        high = p
        r = ambient / p
        sign = -1.0
        own, own_table = area, table
    x = max(1.0 - r, SMALL_DROP)
    largest = bore_flow(floats, at, own, own_table, high, 1.0 - x)
    if x < REVERSAL_DROP:
        into = bore_flow(floats, at, INLET_AREA, INLET_TABLE, p, 1.0 - x)
        largest = max(into, bore_flow(floats, at, area, table, p, 1.0 - x))
    return sign * bore_flow(floats, at, own, own_table, high, r), 1.5 * largest / x


@njit
def set(t, y, out, tables, device):
    """Write to `out` the pressure and the stiffness of the chamber, and the conductance between chamber and node.

    The pressure is relative to ambient [Pa], the stiffness is dp/dm [Pa/kg]. The conductance [kg2/s2/Pa] is 0 while the
    valve is shut.
    """
    st = tables.settings[0]
    floats = tables.floats
    layout = tables.layout[0]
    i = device["node"]
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
    """(rate of the air mass in the chamber [kg/s], its rate limit [1/s], R T ln(p / p_ambient) of the air [J/kg])."""
    st = tables.settings[0]
    floats = tables.floats
    at = device["data"]
    node = tables.nodes[device["node"]]
    gauge, volume, mass = air_state(st, floats, node, at, y[node["y"]], y[device["y"]])
    area, table = outlet_bore(tables, device)
    flow, slope = air_inflow(st, floats, at, gauge, area, table)
    ambient_mass = st["ambient"] * volume / floats[at + RT]  # mass of the air at ambient pressure
    rate = slope / min(mass, ambient_mass)
    if tables.armed[device["event"]] <= 0.0 and abs(flow) * EQUALISATION_TIME >= abs(
        ambient_mass - mass
    ):
        flow, rate = (ambient_mass - mass) / EQUALISATION_TIME, 1.0 / EQUALISATION_TIME
    return flow, rate, floats[at + RT] * log1p(gauge / st["ambient"])


@njit
def move(t, y, dydt, out, tables, device):
    """Write the rate of the air mass in the chamber to `dydt`, and raise out[RATE] to the rate limit of the valve."""
    flow, rate, _ = air_rate(y, tables, device)
    if out[RATE] != RATE_UNWANTED:
        out[RATE] = max(out[RATE], rate, fluid_rate_limit(out, tables, device))
    dydt[device["y"]] = flow


@njit
def fluid_rate_limit(out, tables, device):
    """Rate of the fluid in the open chamber [1/s]; 0 while the valve is shut.

    It is the stiffness of the chamber times the sum of d flow / d pressure of all other parts at the node.
    """
    layout = tables.layout[0]
    nodes = tables.nodes
    valves = tables.valves
    own = device["valve"]
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
    """Write the event functions to g, each followed by its negative.

    The first is the pressure left until the valve opens [Pa], while it is shut. While it is open, it is minus the mass
    of fluid that must still flow in until it shuts [kg].
    With a throttled outlet, the margin until throttling begins or ends follows.
    """
    st = tables.settings[0]
    floats = tables.floats
    at = device["event"]
    node, place = tables.nodes[device["node"]], tables.valves[device["valve"]]["from_node"]
    fluid = y[node["y"]]
    overfill = OVERFILL * node["density"] * floats[device["data"] + VOLUME]
    margin = fluid - overfill
    # full as at shutting, but fluid flows out
    if out[tables.layout[0]["valve"] + device["valve"]] <= 0.0:
        margin = min(margin, -overfill)
    if tables.armed[at] <= 0.0:
        p = (
            tables.nodes[place]["pressure"]
            + out[tables.layout[0]["pressure"] + place]
            - st["ambient"]
        )
        gauge = air_state(st, floats, node, device["data"], fluid, y[device["y"]])[0]
        margin = p - min(gauge, 0.0) + PRESSURE_MARGIN
    event_pair(tables, g, at, margin)
    if has_throttled_outlet(floats, device["data"]):
        gauge = air_state(st, floats, node, device["data"], fluid, y[device["y"]])[0]
        # while it is shut no air moves, and the sign of its pressure is that of rounding
        if tables.armed[at] <= 0.0:
            gauge = max(gauge, 0.5 * PRESSURE_MARGIN)
        event_pair(
            tables,
            g,
            at + 2,
            -gauge if tables.armed[at + 2] > 0.0 else throttling_margin(out, tables, device, gauge),
        )


@njit
def throttling_margin(out, tables, device, gauge):
    """Margin until throttling begins: a pressure [Pa], or with SWITCH_FLOW the greater of two margins.

    These are SWITCH_FLOW minus the flow of fluid [kg/s], and PRESSURE_MARGIN minus the gauge pressure of the air [Pa].
    Throttling ends at ambient pressure; because of PRESSURE_MARGIN it does not begin again there.
    gauge : gauge pressure of the air [Pa]
    """
    floats, at = tables.floats, device["data"]
    if floats[at + SWITCH_PRESSURE] > 0.0:
        return floats[at + SWITCH_PRESSURE] - gauge
    return max(
        floats[at + SWITCH_FLOW] - out[tables.layout[0]["valve"] + device["valve"]],
        PRESSURE_MARGIN - gauge,
    )


@njit
def value(t, y, out, tables, device, quantity):
    """Volume [m3] (quantity 0), mass [kg] (quantity 1) or pressure [Pa] (quantity 2) of the air in the chamber."""
    st, floats = tables.settings[0], tables.floats
    node = tables.nodes[device["node"]]
    gauge, volume, mass = air_state(st, floats, node, device["data"], y[node["y"]], y[device["y"]])
    return volume if quantity == 0 else mass if quantity == 1 else st["ambient"] + gauge


@njit
def air_energy(st, floats, node, at, y_fluid, y_air):
    """Energy of the air and potential energy of the fluid in the chamber, minus those at the start [J].

    The energy of the air is m R T (ln(p / p_ambient) - 1) + p_ambient V; m, p and V are its mass, pressure and volume.
    Arguments as for `air_state`.
    """
    gauge, volume, mass = air_state(st, floats, node, at, y_fluid, y_air)
    energy = mass * floats[at + RT] * log1p(gauge / st["ambient"]) - gauge * volume
    return energy + st["gravity"] * (node["elevation"] - st["datum"]) * y_fluid


@njit
def stored(y, tables, device):
    """Stored energy of the chamber minus that at the start [J]."""
    node = tables.nodes[device["node"]]
    return air_energy(
        tables.settings[0], tables.floats, node, device["data"], y[node["y"]], y[device["y"]]
    )


@njit
def power(t, y, dydt, out, tables, device):
    """(power supplied, which is 0, rate of the stored energy, power that the air dissipates in the orifice) [W]."""
    potential = air_rate(y, tables, device)[2] * dydt[device["y"]]
    return 0.0, vessel_power(dydt, out, tables, device) + potential, -potential
