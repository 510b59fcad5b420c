"""Gas over fluid in a vessel, p V^n constant. Knows one vessel; knows no network.

The node's state is the mass that came in since the start. Under `linear` V = V0 - m / rho, and p - p0 =
p0 ((V / V0)^-n - 1); under `log` and `table` rho(p) (room - V) = mass, by Newton on ln(V / V0). A bladder grows to
`whole` and no further: then the fluid left in the neck alone bears the pressure, as stiff as a small chamber.
"""

from math import exp, expm1, log, log1p

from fvsolve.jit import njit
from fvsolve.kernels.density import density, log_density, pressure_of_log
from fvsolve.kernels.energy import height_pressure
from fvsolve.kernels.energy_barotropic import vessel_energy, vessel_power
from fvsolve.kernels.records import LAW_LINEAR

EXPONENT, GAS, ROOM, NECK, EMPTY, SHED = 0, 1, 2, 3, 4, 5  # numbers of an accumulator
NUMBERS = 6
"""exponent; gas volume of the profile, room for gas, fluid and neck [m3]; stiffness of the neck, 0 for none [Pa/kg];
what must flow in until the bladder is just empty [kg] and the pressure then, over that of the profile [Pa]."""


@njit
def gas_and_pressure(st, floats, node, at, y):
    """(ln(V / V0) of the gas, p - p0 [Pa], dp/dm [Pa/kg]) once y [kg] came in."""
    n, neck, left = floats[at + EXPONENT], floats[at + NECK], y - floats[at + EMPTY]
    if st["law"] != LAW_LINEAR:
        return gas_and_pressure_dense(st, floats, node, at, y)
    if neck > 0.0 and left < 0.0:
        began = y if floats[at + EMPTY] > 0.0 else left
        last = 0.0 if floats[at + EMPTY] > 0.0 else floats[at + SHED]
        return gas_at_most(floats, node, at), last + neck * began, neck
    p, gas, came = node["pressure"], floats[at + GAS], y
    if neck > 0.0 and floats[at + EMPTY] > 0.0:  # the bladder lay in its neck at the start
        p, came = p + floats[at + SHED], left
    share = max(1e-9, 1.0 - came / (st["rho"] * gas))
    u = log1p(-came / (st["rho"] * gas)) if share > 1e-9 else log(share)
    change = p * expm1(-n * u)
    return u, (p - node["pressure"]) + change, n * (p + change) / (st["rho"] * gas * share)


@njit
def gas_at_most(floats, node, at):
    """ln(V / V0) of a bladder that fills its vessel: p V^n from the profile, or it filled it then."""
    if floats[at + EMPTY] > 0.0:
        return 0.0
    return -log1p(floats[at + SHED] / node["pressure"]) / floats[at + EXPONENT]


@njit
def gas_and_pressure_dense(st, floats, node, at, y):
    """The same under the laws log and table."""
    n, gas, room, neck = floats[at + EXPONENT], floats[at + GAS], floats[at + ROOM], floats[at + NECK]
    p0, mass, empty = node["pressure"], node["mass"] + y, floats[at + EMPTY]
    if neck > 0.0 and y < empty:
        fullest = gas_at_most(floats, node, at)
        p = pressure_of_log(st, floats, 0.0, log(mass / (st["rho"] * (room - gas * exp(fullest)))))
        if empty > 0.0 and y == 0.0:
            p = p0
        return fullest, p - p0, 1.0 / (log_density(st, floats, p)[1] * mass)
    first = p0 + floats[at + SHED] if neck > 0.0 and empty > 0.0 else p0
    u = 0.0
    if first == p0:
        u = log(max(0.3, 1.0 - y / (density(st, floats, p0) * gas))) if y != 0.0 else 0.0
    slope = 1.0
    for _ in range(60):
        p, volume = first * exp(-n * u), gas * exp(u)
        value, soft = log_density(st, floats, p)
        rho = st["rho"] * exp(value)
        slope = rho * (n * p * soft * (room - volume) + volume)
        step = (rho * (room - volume) - mass) / slope if y != 0.0 else 0.0
        u += min(1.0, max(-1.0, step))
        if abs(step) <= 1e-15:
            break
    return u, (first - p0) + first * expm1(-n * u), n * first * exp(-n * u) / slope


@njit
def set(t, y, out, tables, device):
    """Its pressure and stiffness."""
    i, layout = device["node"], tables.layout[0]
    node = tables.nodes[i]
    st, floats = tables.settings[0], tables.floats
    _, change, stiffness = gas_and_pressure(st, floats, node, device["data"], y[node["y"]])
    out[layout["pressure"] + i] = change
    out[layout["stiffness"] + node["row"]] = stiffness


@njit
def events(t, y, out, tables, device, g):
    """g: fluid left until the bladder or vessel is empty [kg], and the same negative."""
    left = y[tables.nodes[device["node"]]["y"]] - tables.floats[device["data"] + EMPTY]
    g[device["event"]], g[device["event"] + 1] = left, -left


@njit
def value(t, y, out, tables, device, which):
    """Gas volume [m3], gas pressure [Pa]."""
    node = tables.nodes[device["node"]]
    st, floats = tables.settings[0], tables.floats
    at, came = device["data"], y[node["y"]]
    u, change, _ = gas_and_pressure(st, floats, node, at, came)
    if floats[at + NECK] > 0.0 and came < floats[at + EMPTY]:  # the bladder stands in its neck, and holds its precharge
        change = floats[at + SHED]
    return node["pressure"] + change if which == 1 else floats[at + GAS] * exp(u)


@njit
def gas_energy(p, gas, n, ambient, u):
    """Minus the integral of (p - ambient) dV from `gas` at p to exp(u) times as much, p V^n constant [J]."""
    work = -p * gas * u if n == 1.0 else p * gas * expm1((1.0 - n) * u) / (n - 1.0)
    return work + ambient * gas * expm1(u)


@njit
def accumulator_energy(st, floats, node, at, y):
    """What it stores once y [kg] came in, over the profile [J]."""
    n, gas, empty, p0 = floats[at + EXPONENT], floats[at + GAS], floats[at + EMPTY], node["pressure"]
    neck = floats[at + NECK] if st["law"] == LAW_LINEAR else 0.0
    first = p0 + floats[at + SHED] if floats[at + NECK] > 0.0 and empty > 0.0 else p0
    u, change, _ = gas_and_pressure(st, floats, node, at, y)
    found = gas_energy(first, gas, n, st["ambient"], u)
    if st["law"] != LAW_LINEAR:
        room = floats[at + ROOM]
        found += vessel_energy(st, floats, node, node["mass"] + y, room - gas * exp(u), p0 + change)
        return found - vessel_energy(st, floats, node, node["mass"], room - gas, p0)
    came, p = min(y, empty), p0
    if empty <= 0.0:
        came, p = min(y - empty, 0.0), p0 + floats[at + SHED]
    if neck > 0.0:
        found += came * (p - st["ambient"] + 0.5 * neck * came) / st["rho"]
    return found + height_pressure(st, node) * y / st["rho"]


@njit
def stored(y, tables, device):
    """What it stores, change since the profile [J]."""
    node = tables.nodes[device["node"]]
    return accumulator_energy(tables.settings[0], tables.floats, node, device["data"], y[node["y"]])


@njit
def power(t, y, dydt, out, tables, device):
    """(0, rate of what it stores, 0) [W]."""
    return 0.0, vessel_power(dydt, out, tables, device), 0.0
