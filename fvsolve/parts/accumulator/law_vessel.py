"""Gas and fluid in a vessel with a shape, in which the fluid has a level.

The parameters of the vessel are those in the module `law`, then from index `SHAPED` on those that are listed below.
The gas follows p V^n = p0 V0^n (1 + a)^n, with its pressure p and volume V, their values p0 and V0 at the start, the
exponent n, and the gas `a` that a compressor has added, relative to the gas at the start.
Under the density law `linear` the pressure of the node is that of the gas plus rho g (bottom + level).
Under other laws the fluid inside has one density rho(q). q = p + rho g (level - z) is the pressure at its centroid, at
the height z above the bottom. h(q) + g (bottom + z) equals the enthalpy of the node, h the specific enthalpy.
All these values then follow from one energy of gas and fluid.

Volume, free surface and first moment of a vessel below a level: prisms, cylinders at any slope, tables of areas.
For a cylinder with flat ends, radius R and length L, whose axis has the angle `slope` to the horizontal, the water
level z above the lowest point is the depth d = z / (R cos(slope)) at the lower end and d' = d - (L / R) tan(slope) at
the upper end, both in radii. S(d) is the area of the unit circle below depth d; T and U are its first and second
integral over d. Then the volume is V = R^3 cot(slope) (T(d) - T(d')), and dV/dz = R^2 (S(d) - S(d')) / sin(slope).
"""

from math import acos, cos, exp, expm1, log, log1p, pi, sin, sqrt

from fvsolve.core.kernels.density import density, enthalpy, log_density, pressure_of_enthalpy
from fvsolve.core.kernels.dtypes import LAW_LINEAR
from fvsolve.core.kernels.network_energy import (
    height_pressure,
    level_moment,
    vessel_energy,
    vessel_power,
)
from fvsolve.core.kernels.self_acting_valves import event_pair
from fvsolve.core.kernels.tanks import level_of_volume
from fvsolve.jit import njit
from fvsolve.parts.accumulator.law import EMPTY_MASS, EXPONENT, GAS_VOLUME, TOTAL_VOLUME, gas_energy
from fvsolve.parts.accumulator.law import NUMBER_COUNT as SHAPED

KIND, FULL_LEVEL, FIRST_SIZE, SECOND_SIZE, THIRD_SIZE = 0, 1, 2, 3, 4
"""Numbers of a shape: its kind; the level at which it is full [m]; then an area [m2], or the radius [m], length [m] and
slope [rad] of a cylinder, or the number of levels, areas and volumes that follow."""
PRISM, HORIZONTAL_CYLINDER, INCLINED_CYLINDER, AREA_TABLE = 0, 1, 2, 3
NUMBER_COUNT = 5
LEAST_SLOPE = 1e-6  # of the mean surface: least slope dV/dz in the search for a level


@njit
def segment(d):
    """Area S(d) of the part of the unit circle that is filled to the depth d, from 0 (d <= 0) to pi (d >= 2)."""
    if d <= 0.0:
        return 0.0
    if d >= 2.0:
        return pi
    x = 1.0 - d
    return acos(x) - x * sqrt(d * (2.0 - d))


@njit
def segment_integral(d):
    """Integral T(d) of the area S (see `segment`) from depth 0 to d."""
    if d <= 0.0:
        return 0.0
    if d >= 2.0:
        return pi * (d - 1.0)
    x, s = 1.0 - d, sqrt(d * (2.0 - d))
    return s - s * s * s / 3.0 - x * acos(x)


@njit
def segment_double_integral(d):
    """Integral U(d) of T (see `segment_integral`) from depth 0 to d."""
    if d <= 0.0:
        return 0.0
    if d >= 2.0:
        return pi * (0.625 + 0.5 * d * (d - 2.0))
    x, s = 1.0 - d, sqrt(d * (2.0 - d))
    return (0.5 * x * x + 0.125) * acos(x) - 0.625 * x * s + x * s * s * s / 12.0


@njit
def cylinder_depths(floats, at, z):
    """(depth at the lower end, depth at the upper end, tangent of the slope) of an inclined cylinder filled to level z.

    Depths are in radii, relative to the lowest points of the ends; the upper depth may be negative.
    z : level above the lowest point [m]; floats[at:] : parameters of the shape, see `shape_numbers`
    """
    radius = floats[at + FIRST_SIZE]
    length = floats[at + SECOND_SIZE]
    slope = floats[at + THIRD_SIZE]
    tangent = sin(slope) / cos(slope)
    d = z / (radius * cos(slope))
    return d, d - length / radius * tangent, tangent


@njit
def volume_below(floats, at, z):
    """Volume of a vessel [m3] from its bottom to level z [m] above it; z must be within the vessel.

    floats[at:] : parameters of the shape, see `shape_numbers`
    """
    kind, first = int(floats[at + KIND]), floats[at + FIRST_SIZE]
    if kind == PRISM:
        return first * z
    if kind == HORIZONTAL_CYLINDER:
        return first * first * floats[at + SECOND_SIZE] * segment(z / first)
    if kind == INCLINED_CYLINDER:
        d, upper, tangent = cylinder_depths(floats, at, z)
        return first * first * first / tangent * (segment_integral(d) - segment_integral(upper))
    rows = int(first)
    o = at + NUMBER_COUNT
    k = 0
    while k < rows - 2 and z >= floats[o + k + 1]:
        k += 1
    low, high = floats[o + rows + k], floats[o + rows + k + 1]
    s, span = z - floats[o + k], floats[o + k + 1] - floats[o + k]
    if s > span:
        return floats[o + 3 * rows - 1] + (s - span) * high
    return floats[o + 2 * rows + k] + s * (low + 0.5 * s * (high - low) / span)


@njit
def surface_at(floats, at, z):
    """Area of the free surface of a vessel [m2] at level z [m] above its bottom; arguments as for `volume_below`."""
    kind, first = int(floats[at + KIND]), floats[at + FIRST_SIZE]
    if kind == PRISM:
        return first
    if kind == HORIZONTAL_CYLINDER:
        d = z / first
        return 2.0 * first * floats[at + SECOND_SIZE] * sqrt(max(0.0, d * (2.0 - d)))
    if kind == INCLINED_CYLINDER:
        d, upper, _ = cylinder_depths(floats, at, z)
        return first * first * (segment(d) - segment(upper)) / sin(floats[at + THIRD_SIZE])
    rows = int(first)
    o = at + NUMBER_COUNT
    k = 0
    while k < rows - 2 and z >= floats[o + k + 1]:
        k += 1
    low, high = floats[o + rows + k], floats[o + rows + k + 1]
    s = (z - floats[o + k]) / (floats[o + k + 1] - floats[o + k])
    return low + min(s, 1.0) * (high - low)


@njit
def moment_below(floats, at, z):
    """Integral of z dV in a vessel [m4] from its bottom to level z [m] above it; arguments as for `volume_below`."""
    kind, first = int(floats[at + KIND]), floats[at + FIRST_SIZE]
    if kind == PRISM:
        return 0.5 * first * z * z
    if kind == HORIZONTAL_CYLINDER:
        return z * volume_below(floats, at, z) - first * first * first * floats[
            at + SECOND_SIZE
        ] * segment_integral(z / first)
    if kind == INCLINED_CYLINDER:
        d, upper, tangent = cylinder_depths(floats, at, z)
        difference = segment_double_integral(d) - segment_double_integral(upper)
        return (
            z * volume_below(floats, at, z)
            - first**4 * cos(floats[at + THIRD_SIZE]) / tangent * difference
        )
    return level_moment(floats, at + NUMBER_COUNT, int(first), z)


@njit
def level_at(floats, at, volume):
    """Level [m] above the bottom to which a fluid of a given volume [m3] fills a vessel.

    For cylinders it is found by Newton's method with bounds. floats, at : as for `volume_below`
    """
    kind = int(floats[at + KIND])
    if volume <= 0.0:
        return 0.0
    if kind == PRISM:
        return volume / floats[at + FIRST_SIZE]
    if kind == AREA_TABLE:
        return level_of_volume(floats, at + NUMBER_COUNT, int(floats[at + FIRST_SIZE]), volume)
    low, high = 0.0, floats[at + FULL_LEVEL]
    total = pi * floats[at + FIRST_SIZE] ** 2 * floats[at + SECOND_SIZE]
    z, least = high * min(volume / total, 1.0), LEAST_SLOPE * total / high
    for _ in range(100):
        excess = volume_below(floats, at, z) - volume
        if excess > 0.0:
            high = z
        else:
            low = z
        next_z = z - excess / max(surface_at(floats, at, z), least)
        if not low <= next_z <= high:
            next_z = 0.5 * (low + high)
        if abs(next_z - z) <= 2e-16 * floats[at + FULL_LEVEL]:
            return next_z
        z = next_z
    return z


GAS_PRESSURE, LEVEL, BOTTOM, COMPRESSOR_RATE, START_LEVEL, STOP_LEVEL, SHAPE = range(
    SHAPED, SHAPED + 7
)
"""Indices into the numbers of a vessel: gas pressure [Pa] and level [m] at the start; height of the bottom above the
node [m]; gas that the compressor adds per second, relative to the gas at the start [1/s]; levels at which it starts and
stops [m]; the first number of the shape."""
# of the mean surface: lower bound in the stiffness, for a little fluid in a corner
LEAST_SURFACE = 1e-3


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
    gas = floats[at + GAS_VOLUME]
    total = floats[at + TOTAL_VOLUME]
    n = floats[at + EXPONENT]
    first = floats[at + GAS_PRESSURE]
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
    gas = floats[at + GAS_VOLUME]
    total = floats[at + TOTAL_VOLUME]
    n = floats[at + EXPONENT]
    first = floats[at + GAS_PRESSURE]
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
    return pressure_per_height * arm, pressure_per_height * (
        1.0 / surface_area(floats, at, level) - 2.0 * arm / volume
    )


@njit
def surface_area(floats, at, level):
    """Area of the free surface at a level [m2], at least `LEAST_SURFACE` times the mean area of the vessel.

    floats, at : as for `vessel_state`
    """
    least = LEAST_SURFACE * floats[at + TOTAL_VOLUME] / floats[at + SHAPE + FULL_LEVEL]
    return max(surface_at(floats, at + SHAPE, level), least)


@njit
def pressure_and_stiffness(st, floats, node, at, y, a):
    """(pressure of the node minus that at the start [Pa], stiffness dp/dm [Pa/kg]); arguments as for `vessel_state`."""
    n, gas = floats[at + EXPONENT], floats[at + GAS_VOLUME]
    u, change, volume, level = vessel_state(st, floats, node, at, y, a)
    p, gas_stiffness = floats[at + GAS_PRESSURE] + change, n / (gas * exp(u))
    weight = st["gravity"] / surface_area(floats, at, level) if level > 0.0 else 0.0
    if st["law"] == LAW_LINEAR:
        return change + st["rho"] * st["gravity"] * (
            level - floats[at + LEVEL]
        ), gas_stiffness * p / st["rho"] + weight
    if y == 0.0 and a == 0.0:
        change = 0.0
    else:
        q, z = centroid_state(st, floats, node, at, y, p, volume, level)
        change = node_pressure(st, floats, at, q, z) - node["pressure"]
    value, compressibility = log_density(st, floats, p)
    stiffness = gas_stiffness * p + st["rho"] * exp(value) * weight
    return change, stiffness / (
        st["rho"] * exp(value) * (1.0 + max(0.0, volume) * compressibility * stiffness)
    )


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
    return pressure_of_enthalpy(
        st, floats, enthalpy(st, floats, q) + st["gravity"] * (floats[at + BOTTOM] + z)
    )


@njit
def set(t, y, out, tables, device):
    """Write to `out` the pressure of the node minus that at the start [Pa], and the stiffness dp/dm [Pa/kg]."""
    i = device["node"]
    layout = tables.layout[0]
    at = device["data"]
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
    if device["states"] > 0:
        dydt[device["y"]] = compressor_rate(tables, device)


@njit
def events(t, y, out, tables, device, g):
    """Write to g the mass of fluid that is left until the vessel is empty [kg], then its negative.

    With a compressor, the level at which it next starts or stops minus the present level [m] follows, then its
    negative.
    """
    node = tables.nodes[device["node"]]
    st = tables.settings[0]
    floats = tables.floats
    at = device["data"]
    left, flag = y[node["y"]] - floats[at + EMPTY_MASS], device["event"]
    g[flag], g[flag + 1] = left, -left
    if device["states"] > 0:
        level = vessel_state(st, floats, node, at, y[node["y"]], compressor_gas(y, device))[3]
        event_pair(
            tables,
            g,
            flag + 2,
            floats[at + (STOP_LEVEL if tables.armed[flag + 2] > 0.0 else START_LEVEL)] - level,
        )


@njit
def value(t, y, out, tables, device, quantity):
    """Gas volume [m3] for quantity 0, gas pressure [Pa] for quantity 1, level [m] for quantity 2."""
    node = tables.nodes[device["node"]]
    st = tables.settings[0]
    floats = tables.floats
    at = device["data"]
    u, change, _, level = vessel_state(
        st, floats, node, at, y[node["y"]], compressor_gas(y, device)
    )
    if quantity == 2:
        return level
    return floats[at + GAS_PRESSURE] + change if quantity == 1 else floats[at + GAS_VOLUME] * exp(u)


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
    n = floats[at + EXPONENT]
    gas = floats[at + GAS_VOLUME]
    total = floats[at + TOTAL_VOLUME]
    first = floats[at + GAS_PRESSURE]
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
        stored = vessel_energy(st, floats, node, mass, content, q) + mass * st["gravity"] * (
            floats[at + BOTTOM] + z
        )
        energy += stored if side == 1 else -stored
    return energy


@njit
def stored(y, tables, device):
    """Stored energy of the vessel minus that at the start [J]."""
    node = tables.nodes[device["node"]]
    return stored_energy_change(
        tables.settings[0],
        tables.floats,
        node,
        device["data"],
        y[node["y"]],
        compressor_gas(y, device),
    )


@njit
def power(t, y, dydt, out, tables, device):
    """(power supplied by the compressor, rate of the stored energy, dissipated power, which is 0) [W]."""
    supplied, rate = 0.0, compressor_rate(tables, device)
    if rate > 0.0:
        st = tables.settings[0]
        floats = tables.floats
        at = device["data"]
        node, a = tables.nodes[device["node"]], compressor_gas(y, device)
        u, change, _, _ = vessel_state(st, floats, node, at, y[node["y"]], a)
        p, gas_volume = floats[at + GAS_PRESSURE] + change, floats[at + GAS_VOLUME] * exp(u)
        supplied = rate * compression_energy_rate(
            p, gas_volume, floats[at + EXPONENT], st["ambient"], a
        )
    return supplied, vessel_power(dydt, out, tables, device) + supplied, 0.0
