"""Gas and fluid in an accumulator, with p V^n constant in the gas.

p and V are pressure and volume of the gas, p0 and V0 their values at the start, n the polytropic exponent.
The state of the node is y, the mass of fluid that has flowed in since the start [kg].
Under the density law `linear`, with the density rho, V = V0 - y / rho and p - p0 = p0 ((V / V0)^-n - 1).
Under other laws, Newton's method solves rho(p) (total volume - V) = mass of the fluid for ln(V / V0).
A bladder expands until it fills the vessel. At lower pressures only the fluid in the neck is compressed; its stiffness
is that of a small chamber.
"""

from math import exp, expm1, log, log1p

from fvsolve.core.kernels.density import density, log_density, pressure_of_log
from fvsolve.core.kernels.dtypes import LAW_LINEAR
from fvsolve.core.kernels.network_energy import height_pressure, vessel_energy, vessel_power
from fvsolve.jit import njit

# Indices into the numbers of an accumulator
EXPONENT, GAS_VOLUME, TOTAL_VOLUME, NECK_STIFFNESS, EMPTY_MASS, EMPTY_PRESSURE = 0, 1, 2, 3, 4, 5
NUMBER_COUNT = 6
"""Exponent n; gas volume at the start [m3]; volume of gas, fluid and neck [m3]; stiffness dp/dm of the neck [Pa/kg], 0
without a neck; inflow since the start at which the gas just fills the vessel [kg], negative if fluid must flow out;
pressure at that inflow minus the pressure at the start [Pa]."""


@njit
def gas_state(st, floats, node, at, y):
    """(ln(V / V0), pressure change [Pa], stiffness [Pa/kg]) after an inflow y since the start [kg].

    V : gas volume, V0 : gas volume at the start
    pressure change : pressure of the node minus that at the start
    stiffness : dp/dm, rise of pressure per mass of fluid
    st : settings of the model; node : row of the node; floats[at:] : parameters of the accumulator
    """
    n = floats[at + EXPONENT]
    neck = floats[at + NECK_STIFFNESS]
    above_empty = y - floats[at + EMPTY_MASS]
    if st["law"] != LAW_LINEAR:
        return gas_state_dense(st, floats, node, at, y)
    if neck > 0.0 and above_empty < 0.0:
        squeezed = y if floats[at + EMPTY_MASS] > 0.0 else above_empty
        base = 0.0 if floats[at + EMPTY_MASS] > 0.0 else floats[at + EMPTY_PRESSURE]
        return full_bladder_gas(floats, node, at), base + neck * squeezed, neck
    p = node["pressure"]
    gas = floats[at + GAS_VOLUME]
    inflow = y
    if neck > 0.0 and floats[at + EMPTY_MASS] > 0.0:  # the bladder fills its vessel at the start
        p, inflow = p + floats[at + EMPTY_PRESSURE], above_empty
    ratio = max(1e-9, 1.0 - inflow / (st["rho"] * gas))
    u = log1p(-inflow / (st["rho"] * gas)) if ratio > 1e-9 else log(ratio)
    change = p * expm1(-n * u)
    return u, (p - node["pressure"]) + change, n * (p + change) / (st["rho"] * gas * ratio)


@njit
def full_bladder_gas(floats, node, at):
    """ln(V / V0) at the gas volume V at which bladder and gas fill the vessel; 0 if they fill it at the start.

    V0 : gas volume at the start; arguments as for `gas_state`
    """
    if floats[at + EMPTY_MASS] > 0.0:
        return 0.0
    return -log1p(floats[at + EMPTY_PRESSURE] / node["pressure"]) / floats[at + EXPONENT]


@njit
def gas_state_dense(st, floats, node, at, y):
    """Results of `gas_state` under density laws other than `linear`, with its arguments."""
    n = floats[at + EXPONENT]
    gas = floats[at + GAS_VOLUME]
    total = floats[at + TOTAL_VOLUME]
    neck = floats[at + NECK_STIFFNESS]
    p0 = node["pressure"]
    mass = node["mass"] + y
    empty = floats[at + EMPTY_MASS]
    if neck > 0.0 and y < empty:
        expansion = full_bladder_gas(floats, node, at)
        p = pressure_of_log(
            st, floats, 0.0, log(mass / (st["rho"] * (total - gas * exp(expansion))))
        )
        if empty > 0.0 and y == 0.0:
            p = p0
        return expansion, p - p0, 1.0 / (log_density(st, floats, p)[1] * mass)
    first = p0 + floats[at + EMPTY_PRESSURE] if neck > 0.0 and empty > 0.0 else p0
    u = 0.0
    if first == p0:
        u = log(max(0.3, 1.0 - y / (density(st, floats, p0) * gas))) if y != 0.0 else 0.0
    slope = 1.0
    for _ in range(60):
        p, volume = first * exp(-n * u), gas * exp(u)
        value, compressibility = log_density(st, floats, p)
        rho = st["rho"] * exp(value)
        slope = rho * (n * p * compressibility * (total - volume) + volume)
        step = (rho * (total - volume) - mass) / slope if y != 0.0 else 0.0
        u += min(1.0, max(-1.0, step))
        if abs(step) <= 1e-15:
            break
    return u, (first - p0) + first * expm1(-n * u), n * first * exp(-n * u) / slope


@njit
def set(t, y, out, tables, device):
    """Write to `out` the pressure of the node minus that at the start [Pa], and the stiffness dp/dm [Pa/kg]."""
    i, layout = device["node"], tables.layout[0]
    node = tables.nodes[i]
    st, floats = tables.settings[0], tables.floats
    _, change, stiffness = gas_state(st, floats, node, device["data"], y[node["y"]])
    out[layout["pressure"] + i] = change
    out[layout["stiffness"] + node["row"]] = stiffness


@njit
def events(t, y, out, tables, device, g):
    """Write to g the mass of fluid that is left until the gas fills the vessel [kg], then its negative."""
    left = y[tables.nodes[device["node"]]["y"]] - tables.floats[device["data"] + EMPTY_MASS]
    g[device["event"]], g[device["event"] + 1] = left, -left


@njit
def value(t, y, out, tables, device, quantity):
    """Gas volume [m3] for quantity 0, gas pressure [Pa] for quantity 1."""
    node = tables.nodes[device["node"]]
    st, floats = tables.settings[0], tables.floats
    at, inflow = device["data"], y[node["y"]]
    u, change, _ = gas_state(st, floats, node, at, inflow)
    if (
        floats[at + NECK_STIFFNESS] > 0.0 and inflow < floats[at + EMPTY_MASS]
    ):  # the gas of a full bladder keeps its precharge
        change = floats[at + EMPTY_PRESSURE]
    return node["pressure"] + change if quantity == 1 else floats[at + GAS_VOLUME] * exp(u)


@njit
def gas_energy(p, gas, n, ambient, u):
    """Energy [J] that a gas takes up as its volume changes from `gas` [m3] to exp(u) `gas`, with p V^n constant.

    It is minus the integral of (pressure - ambient) dV.
    p : pressure at the volume `gas` [Pa]; n : polytropic exponent; ambient : ambient pressure [Pa]
    """
    work = -p * gas * u if n == 1.0 else p * gas * expm1((1.0 - n) * u) / (n - 1.0)
    return work + ambient * gas * expm1(u)


@njit
def accumulator_energy(st, floats, node, at, y):
    """Stored energy of an accumulator minus that at the start [J]; arguments as for `gas_state`."""
    n = floats[at + EXPONENT]
    gas = floats[at + GAS_VOLUME]
    empty = floats[at + EMPTY_MASS]
    p0 = node["pressure"]
    neck = floats[at + NECK_STIFFNESS] if st["law"] == LAW_LINEAR else 0.0
    first = (
        p0 + floats[at + EMPTY_PRESSURE]
        if floats[at + NECK_STIFFNESS] > 0.0 and empty > 0.0
        else p0
    )
    u, change, _ = gas_state(st, floats, node, at, y)
    energy = gas_energy(first, gas, n, st["ambient"], u)
    if st["law"] != LAW_LINEAR:
        total = floats[at + TOTAL_VOLUME]
        energy += vessel_energy(
            st, floats, node, node["mass"] + y, total - gas * exp(u), p0 + change
        )
        return energy - vessel_energy(st, floats, node, node["mass"], total - gas, p0)
    inflow, p = min(y, empty), p0
    if empty <= 0.0:
        inflow, p = min(y - empty, 0.0), p0 + floats[at + EMPTY_PRESSURE]
    if neck > 0.0:
        energy += inflow * (p - st["ambient"] + 0.5 * neck * inflow) / st["rho"]
    return energy + height_pressure(st, node) * y / st["rho"]


@njit
def stored(y, tables, device):
    """Stored energy of the accumulator minus that at the start [J]."""
    node = tables.nodes[device["node"]]
    return accumulator_energy(tables.settings[0], tables.floats, node, device["data"], y[node["y"]])


@njit
def power(t, y, dydt, out, tables, device):
    """(power supplied from outside, which is 0, rate of the stored energy, dissipated power, which is 0) [W]."""
    return 0.0, vessel_power(dydt, out, tables, device), 0.0
