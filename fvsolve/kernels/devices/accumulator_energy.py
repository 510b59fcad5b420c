"""Energy of accumulators: the gas's with the work of ambient, and the fluid's. Knows one vessel."""

from math import exp, expm1

from fvsolve.jit import njit
from fvsolve.kernels.devices.accumulator import EMPTY, EXPONENT, GAS, NECK, ROOM, SHED, gas_and_pressure
from fvsolve.kernels.energy import lift
from fvsolve.kernels.energy_barotropic import head_at, vessel_energy
from fvsolve.kernels.records import LAW_LINEAR


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
    return found + lift(st, node) * y / st["rho"]


@njit
def accumulator_stored(y, tables, device):
    """What it stores, change since the profile [J]."""
    node = tables.nodes[device["node"]]
    return accumulator_energy(tables.settings[0], tables.floats, node, device["data"], y[node["y"]])


@njit
def vessel_power(dydt, out, tables, device):
    """Rate of what a vessel stores [W]: what a mass brings, P / rho or h(p) - h(p_ambient) + g z, times its flow."""
    i, nodes = device["node"], tables.nodes
    p = nodes[i]["pressure"] + out[tables.layout[0]["pressure"] + i]
    return head_at(tables.settings[0], tables.floats, nodes[i], p) * dydt[nodes[i]["y"]]


@njit
def accumulator_power(dydt, out, tables, device):
    """(0, rate of what it stores, 0) [W]."""
    return 0.0, vessel_power(dydt, out, tables, device), 0.0
