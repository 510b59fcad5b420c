"""Gas over fluid in a vessel with a shape: the fluid stands to a level. Knows one vessel; knows no network.

Its numbers are those of `law` and, from `SHAPED` on, what follows. The gas has p V^n = p0 V0^n (1 + a)^n, with a the
gas that a compressor brought, as a share of that at the start. Under `linear` the pressure of the place is that of the
gas and rho g (bottom + level). Else the fluid inside has one density rho(q), at the pressure q = p + rho g (level - z)
of its centroid z, and h(q) + g (bottom + z) is that of the place: so that all of it follows from one energy.
"""

from math import exp, expm1, log, log1p

from fvsolve.jit import njit
from fvsolve.kernels.density import density, enthalpy, log_density, pressure_of_enthalpy
from fvsolve.kernels.either import either
from fvsolve.kernels.energy import height_pressure
from fvsolve.kernels.energy_barotropic import vessel_energy, vessel_power
from fvsolve.kernels.records import LAW_LINEAR
from fvsolve.parts.accumulator.law import EMPTY, EXPONENT, GAS, ROOM, gas_energy
from fvsolve.parts.accumulator.law import NUMBERS as SHAPED
from fvsolve.parts.accumulator.law_shape import TOP, level_at, moment_below, surface_at

FIRST, LEVEL, BOTTOM, BRINGS, START, STOP, SHAPE = range(SHAPED, SHAPED + 7)
"""gas pressure [Pa] and level [m] of the profile; its bottom above the place [m]; of the compressor, da/dt [1/s]
and the levels at which it starts and stops [m]; the numbers of the shape."""
NARROW = 1e-3  # of the mean surface: a lesser one, of a drop in a corner, counts as this in how stiff the vessel is


@njit
def brought(y, device):
    """a: what the compressor brought, as a share of the gas at the start."""
    return y[device["y"]] if device["states"] > 0 else 0.0


@njit
def standing(st, floats, node, at, y, a):
    """(ln(V / V0) of the gas, its pressure less that of the profile [Pa], volume [m3] and level [m] of the fluid)."""
    gas, room, n, first = floats[at + GAS], floats[at + ROOM], floats[at + EXPONENT], floats[at + FIRST]
    if st["law"] == LAW_LINEAR:
        share = max(1e-9, 1.0 - y / (st["rho"] * gas))
        u = log1p(-y / (st["rho"] * gas)) if share > 1e-9 else log(share)
        volume = (room - gas) + min(y / st["rho"], (1.0 - 1e-9) * gas)
    else:
        u, volume = standing_dense(st, floats, node, at, y, a)
    return u, first * expm1(n * (log1p(a) - u)), volume, level_at(floats, at + SHAPE, volume)


@njit
def standing_dense(st, floats, node, at, y, a):
    """(ln(V / V0) of the gas, volume of the fluid [m3]) where rho(q) V is its mass, by Newton."""
    gas, room, n, first = floats[at + GAS], floats[at + ROOM], floats[at + EXPONENT], floats[at + FIRST]
    mass = node["mass"] + y
    if y == 0.0 and a == 0.0:
        return 0.0, room - gas
    u = log(max(0.3, 1.0 - y / (density(st, floats, first) * gas)))
    for _ in range(60):
        p, over = first * exp(n * (log1p(a) - u)), gas * exp(u)
        volume = room - over
        lift, growth = lift_of(st, floats, at, mass, volume)
        value, soft = log_density(st, floats, p + lift)
        rho = st["rho"] * exp(value)
        slope = rho * (soft * volume * (n * p + growth * over) + over)
        step = (rho * volume - mass) / slope
        u += min(1.0, max(-1.0, step))
        if abs(step) <= 1e-15:
            break
    return u, room - gas * exp(u)


@njit
def lift_of(st, floats, at, mass, volume):
    """(rho g (level - z) of a mass in a volume, z its centroid [Pa]; what that grows by with the volume [Pa/m3])."""
    if volume <= 0.0 or mass <= 0.0:
        return 0.0, 0.0
    level = level_at(floats, at + SHAPE, volume)
    arm = level - moment_below(floats, at + SHAPE, level) / volume
    per = st["gravity"] * mass / volume
    return per * arm, per * (1.0 / breadth(floats, at, level) - 2.0 * arm / volume)


@njit
def breadth(floats, at, level):
    """Free surface at a level [m2]."""
    return max(surface_at(floats, at + SHAPE, level), NARROW * floats[at + ROOM] / floats[at + SHAPE + TOP])


@njit
def pressure_and_stiffness(st, floats, node, at, y, a):
    """(pressure of the place less that of the profile [Pa], dp/dm [Pa/kg])."""
    n, gas = floats[at + EXPONENT], floats[at + GAS]
    u, change, volume, level = standing(st, floats, node, at, y, a)
    p, per = floats[at + FIRST] + change, n / (gas * exp(u))
    weight = st["gravity"] / breadth(floats, at, level) if level > 0.0 else 0.0
    if st["law"] == LAW_LINEAR:
        return change + st["rho"] * st["gravity"] * (level - floats[at + LEVEL]), per * p / st["rho"] + weight
    if y == 0.0 and a == 0.0:
        change = 0.0
    else:
        q, z = at_centroid(st, floats, node, at, y, p, volume, level)
        change = place_pressure(st, floats, at, q, z) - node["pressure"]
    value, soft = log_density(st, floats, p)
    stiffness = per * p + st["rho"] * exp(value) * weight
    return change, stiffness / (st["rho"] * exp(value) * (1.0 + max(0.0, volume) * soft * stiffness))


@njit
def at_centroid(st, floats, node, at, y, p, volume, level):
    """(pressure of the fluid at its centroid [Pa], height of that above the bottom [m])."""
    z = moment_below(floats, at + SHAPE, level) / volume if volume > 0.0 else 0.0
    return p + lift_of(st, floats, at, node["mass"] + y, volume)[0], z


@njit
def place_pressure(st, floats, at, q, z):
    """Pressure [Pa] of the place beside fluid of pressure q at its centroid, laws log and table."""
    return pressure_of_enthalpy(st, floats, enthalpy(st, floats, q) + st["gravity"] * (floats[at + BOTTOM] + z))


@njit
def set(t, y, out, tables, device):
    """Its pressure and stiffness."""
    i, layout, at = device["node"], tables.layout[0], device["data"]
    node, st = tables.nodes[i], tables.settings[0]
    a = brought(y, device)
    change, stiffness = pressure_and_stiffness(st, tables.floats, node, at, y[node["y"]], a)
    out[layout["pressure"] + i] = change
    out[layout["stiffness"] + node["row"]] = stiffness


@njit
def bringing(tables, device):
    """da/dt while its compressor runs, else 0 [1/s]."""
    runs = device["states"] > 0 and tables.armed[device["event"] + 2] > 0.0
    return tables.floats[device["data"] + BRINGS] if runs else 0.0


@njit
def move(t, y, dydt, out, tables, device):
    """What its compressor brings."""
    if dydt.size > 0 and device["states"] > 0:
        dydt[device["y"]] = bringing(tables, device)


@njit
def events(t, y, out, tables, device, g):
    """g: fluid left until it is empty [kg], and the same negative; level left until its compressor starts or stops."""
    node, st, floats, at = tables.nodes[device["node"]], tables.settings[0], tables.floats, device["data"]
    left, flag = y[node["y"]] - floats[at + EMPTY], device["event"]
    g[flag], g[flag + 1] = left, -left
    if device["states"] > 0:
        level = standing(st, floats, node, at, y[node["y"]], brought(y, device))[3]
        either(tables, g, flag + 2, floats[at + (STOP if tables.armed[flag + 2] > 0.0 else START)] - level)


@njit
def value(t, y, out, tables, device, which):
    """Gas volume [m3], gas pressure [Pa], level [m]."""
    node, st, floats, at = tables.nodes[device["node"]], tables.settings[0], tables.floats, device["data"]
    u, change, _, level = standing(st, floats, node, at, y[node["y"]], brought(y, device))
    return level if which == 2 else floats[at + FIRST] + change if which == 1 else floats[at + GAS] * exp(u)


@njit
def added_energy(p, gas, n, ambient, a):
    """What (1 + a) times as much gas in a volume holds more, at p and `gas` before, from ambient [J]."""
    r = 1.0 + a
    if n == 1.0:
        return p * gas * (r * log1p(a) + a * (log(p / ambient) - 1.0))
    spread = ambient * gas * (p / ambient) ** (1.0 / n)
    return (p * gas * expm1(n * log1p(a)) - n * spread * a) / (n - 1.0)


@njit
def vessel_gas_power(p, gas, n, ambient, a):
    """d/da of the same, p with that of a: the work of compressing from ambient by the same p V^n [J]."""
    if n == 1.0:
        return p * gas * log(p / ambient) / (1.0 + a)
    return n / (n - 1.0) * (p * gas - ambient * gas * (p / ambient) ** (1.0 / n)) / (1.0 + a)


@njit
def energy_since(st, floats, node, at, y, a):
    """What it stores once y [kg] and a came in, over the profile [J]."""
    n, gas, room, first = floats[at + EXPONENT], floats[at + GAS], floats[at + ROOM], floats[at + FIRST]
    u, change, volume, level = standing(st, floats, node, at, y, a)
    start, was = floats[at + LEVEL], room - gas
    found = gas_energy(first, gas, n, st["ambient"], u)
    if a != 0.0:
        found += added_energy(first * exp(-n * u), gas * exp(u), n, st["ambient"], a)
    lifted = moment_below(floats, at + SHAPE, level) - moment_below(floats, at + SHAPE, start)
    if st["law"] == LAW_LINEAR:
        found += st["gravity"] * (floats[at + BOTTOM] * y + st["rho"] * lifted)
        return found + height_pressure(st, node) * y / st["rho"]
    for side in range(2):
        held, mass = (volume, node["mass"] + y) if side == 1 else (was, node["mass"])
        p, here = (first + change, level) if side == 1 else (first, start)
        q, z = at_centroid(st, floats, node, at, mass - node["mass"], p, held, here)
        stored = vessel_energy(st, floats, node, mass, held, q) + mass * st["gravity"] * (floats[at + BOTTOM] + z)
        found += stored if side == 1 else -stored
    return found


@njit
def stored(y, tables, device):
    """What it stores, change since the profile [J]."""
    node = tables.nodes[device["node"]]
    return energy_since(tables.settings[0], tables.floats, node, device["data"], y[node["y"]], brought(y, device))


@njit
def power(t, y, dydt, out, tables, device):
    """(what its compressor gives, rate of what it stores, 0) [W]."""
    given, rate = 0.0, bringing(tables, device)
    if rate > 0.0:
        st, floats, at = tables.settings[0], tables.floats, device["data"]
        node, a = tables.nodes[device["node"]], brought(y, device)
        u, change, _, _ = standing(st, floats, node, at, y[node["y"]], a)
        p, over = floats[at + FIRST] + change, floats[at + GAS] * exp(u)
        given = rate * vessel_gas_power(p, over, floats[at + EXPONENT], st["ambient"], a)
    return given, vessel_power(dydt, out, tables, device) + given, 0.0
