"""Gas and fluid in a vessel with a shape, in which the fluid has a level.

The parameters of the vessel are those in the module `law`, then from index `SHAPED` on those that are listed below.
The gas follows p V^n = p0 V0^n (1 + a)^n, with its pressure p and volume V, their values p0 and V0 at the start, the
exponent n, and the gas `a` that a compressor has added, relative to the gas at the start.
Under the density law `linear` the pressure of the node is that of the gas plus rho g (bottom + level).
Under other laws the fluid inside has one density rho(q). q = p + rho g (level - z) is the pressure at its centroid, at
the height z above the bottom. h(q) + g (bottom + z) equals the enthalpy of the node, h the specific enthalpy.
All these values then follow from one energy of gas and fluid.
"""

from math import exp, expm1, log, log1p

from fvsolve.jit import njit
from fvsolve.kernels.density import density, enthalpy, log_density, pressure_of_enthalpy
from fvsolve.kernels.dtypes import LAW_LINEAR
from fvsolve.kernels.network_energy import height_pressure, vessel_energy, vessel_power
from fvsolve.kernels.self_acting_valves import event_pair
from fvsolve.parts.accumulator.law import EMPTY_MASS, EXPONENT, GAS_VOLUME, TOTAL_VOLUME, gas_energy
from fvsolve.parts.accumulator.law import NUMBER_COUNT as SHAPED
from fvsolve.parts.accumulator.law_shape import FULL_LEVEL, level_at, moment_below, surface_at

GAS_PRESSURE, LEVEL, BOTTOM, COMPRESSOR_RATE, START_LEVEL, STOP_LEVEL, SHAPE = range(SHAPED, SHAPED + 7)
"""Indices into the numbers of a vessel: gas pressure [Pa] and level [m] at the start; height of the bottom above the
node [m]; gas that the compressor adds per second, relative to the gas at the start [1/s]; levels at which it starts and
stops [m]; the first number of the shape."""
LEAST_SURFACE = 1e-3  # of the mean surface: lower bound in the stiffness, for a little fluid in a corner


@njit
def compressor_gas(y, device):
    """Gas `a` that the compressor has added, relative to the gas at the start [-]; 0 without a compressor."""
    return y[device["y"]] if device["states"] > 0 else 0.0


@njit
def vessel_state(st, floats, node, at, y, a):
    """(ln(V / V0), change of the gas pressure [Pa], volume [m3] and level [m] of the fluid) of a vessel.

    V : gas volume, V0 : gas volume at the start; the pressure change is relative to the start
    y : inflow since the start [kg]; a : gas that a compressor has added, relative to the gas at the start [-]
    st : settings of the model; node : row of the node; floats[at:] : parameters of the vessel
    """
    gas, total, n, first = (
        floats[at + GAS_VOLUME],
        floats[at + TOTAL_VOLUME],
        floats[at + EXPONENT],
        floats[at + GAS_PRESSURE],
    )
    if st["law"] == LAW_LINEAR:
        ratio = max(1e-9, 1.0 - y / (st["rho"] * gas))
        u = log1p(-y / (st["rho"] * gas)) if ratio > 1e-9 else log(ratio)
        volume = (total - gas) + min(y / st["rho"], (1.0 - 1e-9) * gas)
    else:
        u, volume = vessel_state_dense(st, floats, node, at, y, a)
    return u, first * expm1(n * (log1p(a) - u)), volume, level_at(floats, at + SHAPE, volume)


@njit
def vessel_state_dense(st, floats, node, at, y, a):
    """(ln(V / V0), volume of the fluid [m3]) under density laws other than `linear`; arguments as for `vessel_state`.

    V : gas volume, V0 : gas volume at the start. Newton's method solves rho(q) times fluid volume = mass of the fluid,
    with the density rho at the pressure q at the centroid of the fluid.
    """
    gas, total, n, first = (
        floats[at + GAS_VOLUME],
        floats[at + TOTAL_VOLUME],
        floats[at + EXPONENT],
        floats[at + GAS_PRESSURE],
    )
    mass = node["mass"] + y
    if y == 0.0 and a == 0.0:
        return 0.0, total - gas
    u = log(max(0.3, 1.0 - y / (density(st, floats, first) * gas)))
    for _ in range(60):
        p, gas_volume = first * exp(n * (log1p(a) - u)), gas * exp(u)
        volume = total - gas_volume
        rise, growth = centroid_pressure_rise(st, floats, at, mass, volume)
        value, compressibility = log_density(st, floats, p + rise)
        rho = st["rho"] * exp(value)
        slope = rho * (compressibility * volume * (n * p + growth * gas_volume) + gas_volume)
        step = (rho * volume - mass) / slope
        u += min(1.0, max(-1.0, step))
        if abs(step) <= 1e-15:
            break
    return u, total - gas * exp(u)


@njit
def centroid_pressure_rise(st, floats, at, mass, volume):
    """(pressure at the centroid of a fluid minus that at its surface [Pa], its derivative by the volume [Pa/m3]).

    The first is rho g times the depth of the centroid, with rho = mass [kg] / volume [m3] of the fluid. The mass is
    constant in the derivative.
    st, floats, at : as for `vessel_state`
    """
    if volume <= 0.0 or mass <= 0.0:
        return 0.0, 0.0
    level = level_at(floats, at + SHAPE, volume)
    arm = level - moment_below(floats, at + SHAPE, level) / volume
    pressure_per_height = st["gravity"] * mass / volume
    return pressure_per_height * arm, pressure_per_height * (1.0 / surface_area(floats, at, level) - 2.0 * arm / volume)


@njit
def surface_area(floats, at, level):
    """Area of the free surface at a level [m2], at least `LEAST_SURFACE` times the mean area of the vessel.

    floats, at : as for `vessel_state`
    """
    return max(
        surface_at(floats, at + SHAPE, level),
        LEAST_SURFACE * floats[at + TOTAL_VOLUME] / floats[at + SHAPE + FULL_LEVEL],
    )


@njit
def pressure_and_stiffness(st, floats, node, at, y, a):
    """(pressure of the node minus that at the start [Pa], stiffness dp/dm [Pa/kg]); arguments as for `vessel_state`."""
    n, gas = floats[at + EXPONENT], floats[at + GAS_VOLUME]
    u, change, volume, level = vessel_state(st, floats, node, at, y, a)
    p, gas_stiffness = floats[at + GAS_PRESSURE] + change, n / (gas * exp(u))
    weight = st["gravity"] / surface_area(floats, at, level) if level > 0.0 else 0.0
    if st["law"] == LAW_LINEAR:
        return change + st["rho"] * st["gravity"] * (level - floats[at + LEVEL]), gas_stiffness * p / st["rho"] + weight
    if y == 0.0 and a == 0.0:
        change = 0.0
    else:
        q, z = centroid_state(st, floats, node, at, y, p, volume, level)
        change = node_pressure(st, floats, at, q, z) - node["pressure"]
    value, compressibility = log_density(st, floats, p)
    stiffness = gas_stiffness * p + st["rho"] * exp(value) * weight
    return change, stiffness / (st["rho"] * exp(value) * (1.0 + max(0.0, volume) * compressibility * stiffness))


@njit
def centroid_state(st, floats, node, at, y, p, volume, level):
    """(pressure of the fluid at its centroid [Pa], height of the centroid above the bottom [m]).

    p : gas pressure [Pa]; volume, level : of the fluid [m3], [m]; other arguments as for `vessel_state`
    """
    z = moment_below(floats, at + SHAPE, level) / volume if volume > 0.0 else 0.0
    return p + centroid_pressure_rise(st, floats, at, node["mass"] + y, volume)[0], z


@njit
def node_pressure(st, floats, at, q, z):
    """Pressure of the node [Pa] under density laws other than `linear`.

    q : pressure of the fluid at its centroid [Pa]; z : height of the centroid above the bottom [m]
    st, floats, at : as for `vessel_state`
    """
    return pressure_of_enthalpy(st, floats, enthalpy(st, floats, q) + st["gravity"] * (floats[at + BOTTOM] + z))


@njit
def set(t, y, out, tables, device):
    """Write to `out` the pressure of the node minus that at the start [Pa], and the stiffness dp/dm [Pa/kg]."""
    i, layout, at = device["node"], tables.layout[0], device["data"]
    node, st = tables.nodes[i], tables.settings[0]
    a = compressor_gas(y, device)
    change, stiffness = pressure_and_stiffness(st, tables.floats, node, at, y[node["y"]], a)
    out[layout["pressure"] + i] = change
    out[layout["stiffness"] + node["row"]] = stiffness


@njit
def compressor_rate(tables, device):
    """Rate [1/s] at which the compressor adds gas, relative to the gas at the start; 0 while it is off."""
    runs = device["states"] > 0 and tables.armed[device["event"] + 2] > 0.0
    return tables.floats[device["data"] + COMPRESSOR_RATE] if runs else 0.0


@njit
def move(t, y, dydt, out, tables, device):
    """Write to `dydt` the rate of the gas that the compressor adds."""
    if dydt.size > 0 and device["states"] > 0:
        dydt[device["y"]] = compressor_rate(tables, device)


@njit
def events(t, y, out, tables, device, g):
    """Write to g the mass of fluid that is left until the vessel is empty [kg], then its negative.

    With a compressor, the level at which it next starts or stops minus the present level [m] follows, then its
    negative.
    """
    node, st, floats, at = tables.nodes[device["node"]], tables.settings[0], tables.floats, device["data"]
    left, flag = y[node["y"]] - floats[at + EMPTY_MASS], device["event"]
    g[flag], g[flag + 1] = left, -left
    if device["states"] > 0:
        level = vessel_state(st, floats, node, at, y[node["y"]], compressor_gas(y, device))[3]
        event_pair(
            tables, g, flag + 2, floats[at + (STOP_LEVEL if tables.armed[flag + 2] > 0.0 else START_LEVEL)] - level
        )


@njit
def value(t, y, out, tables, device, quantity):
    """Gas volume [m3] for quantity 0, gas pressure [Pa] for quantity 1, level [m] for quantity 2."""
    node, st, floats, at = tables.nodes[device["node"]], tables.settings[0], tables.floats, device["data"]
    u, change, _, level = vessel_state(st, floats, node, at, y[node["y"]], compressor_gas(y, device))
    return (
        level
        if quantity == 2
        else floats[at + GAS_PRESSURE] + change
        if quantity == 1
        else floats[at + GAS_VOLUME] * exp(u)
    )


@njit
def compressed_gas_energy(p, gas, n, ambient, a):
    """Work [J] that a compressor needs to take gas at ambient pressure and add it to a gas at constant volume.

    p, gas : pressure [Pa] and volume [m3] of the gas before; a : added gas relative to the gas present before
    n : polytropic exponent of the compression; ambient : ambient pressure [Pa]
    """
    r = 1.0 + a
    if n == 1.0:
        return p * gas * (r * log1p(a) + a * (log(p / ambient) - 1.0))
    spread = ambient * gas * (p / ambient) ** (1.0 / n)
    return (p * gas * expm1(n * log1p(a)) - n * spread * a) / (n - 1.0)


@njit
def compression_energy_rate(p, gas, n, ambient, a):
    """Work of the compressor per relative amount of added gas [J], the derivative of `compressed_gas_energy` by `a`.

    p : pressure [Pa] after the amount `a` has been added; other arguments as for `compressed_gas_energy`
    """
    if n == 1.0:
        return p * gas * log(p / ambient) / (1.0 + a)
    return n / (n - 1.0) * (p * gas - ambient * gas * (p / ambient) ** (1.0 / n)) / (1.0 + a)


@njit
def stored_energy_change(st, floats, node, at, y, a):
    """Stored energy of a vessel minus that at the start [J]; arguments as for `vessel_state`."""
    n, gas, total, first = (
        floats[at + EXPONENT],
        floats[at + GAS_VOLUME],
        floats[at + TOTAL_VOLUME],
        floats[at + GAS_PRESSURE],
    )
    u, change, volume, level = vessel_state(st, floats, node, at, y, a)
    start, start_volume = floats[at + LEVEL], total - gas
    energy = gas_energy(first, gas, n, st["ambient"], u)
    if a != 0.0:
        energy += compressed_gas_energy(first * exp(-n * u), gas * exp(u), n, st["ambient"], a)
    moment = moment_below(floats, at + SHAPE, level) - moment_below(floats, at + SHAPE, start)
    if st["law"] == LAW_LINEAR:
        energy += st["gravity"] * (floats[at + BOTTOM] * y + st["rho"] * moment)
        return energy + height_pressure(st, node) * y / st["rho"]
    for side in range(2):
        content, mass = (volume, node["mass"] + y) if side == 1 else (start_volume, node["mass"])
        p, height = (first + change, level) if side == 1 else (first, start)
        q, z = centroid_state(st, floats, node, at, mass - node["mass"], p, content, height)
        stored = vessel_energy(st, floats, node, mass, content, q) + mass * st["gravity"] * (floats[at + BOTTOM] + z)
        energy += stored if side == 1 else -stored
    return energy


@njit
def stored(y, tables, device):
    """Stored energy of the vessel minus that at the start [J]."""
    node = tables.nodes[device["node"]]
    return stored_energy_change(
        tables.settings[0], tables.floats, node, device["data"], y[node["y"]], compressor_gas(y, device)
    )


@njit
def power(t, y, dydt, out, tables, device):
    """(power supplied by the compressor, rate of the stored energy, dissipated power, which is 0) [W]."""
    supplied, rate = 0.0, compressor_rate(tables, device)
    if rate > 0.0:
        st, floats, at = tables.settings[0], tables.floats, device["data"]
        node, a = tables.nodes[device["node"]], compressor_gas(y, device)
        u, change, _, _ = vessel_state(st, floats, node, at, y[node["y"]], a)
        p, gas_volume = floats[at + GAS_PRESSURE] + change, floats[at + GAS_VOLUME] * exp(u)
        supplied = rate * compression_energy_rate(p, gas_volume, floats[at + EXPONENT], st["ambient"], a)
    return supplied, vessel_power(dydt, out, tables, device) + supplied, 0.0
