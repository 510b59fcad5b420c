"""Energy of the air in an air valve's chamber, and of the fluid there. Knows one chamber."""

from math import log1p

from fvsolve.jit import njit
from fvsolve.kernels.devices.accumulator_energy import vessel_power
from fvsolve.kernels.devices.air_valve import HEAT, air_rate, air_state


@njit
def air_energy(st, floats, node, at, y_fluid, y_air):
    """m R T (ln(p / p_ambient) - 1) + p_ambient V of the air, and the height of the fluid [J]; 0 in the profile."""
    gauge, volume, mass = air_state(st, floats, node, at, y_fluid, y_air)
    found = mass * floats[at + HEAT] * log1p(gauge / st["ambient"]) - gauge * volume
    return found + st["gravity"] * (node["elevation"] - st["datum"]) * y_fluid


@njit
def air_stored(y, tables, device):
    """What it stores, change since the profile [J]."""
    node = tables.nodes[device["node"]]
    return air_energy(tables.settings[0], tables.floats, node, device["data"], y[node["y"]], y[device["y"]])


@njit
def air_power(y, dydt, out, tables, device):
    """(0, rate of what it stores, what the air loses on its way through the orifice) [W]."""
    potential = air_rate(y, tables, device)[2] * dydt[device["y"]]
    return 0.0, vessel_power(dydt, out, tables, device) + potential, -potential
