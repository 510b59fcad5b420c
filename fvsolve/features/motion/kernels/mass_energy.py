"""Power and stored energy of masses, springs, dampers, forces, stops and pistons; the rest : `network_energy.py`.

The entries of `power` [W] follow those of columns. For every part of a kind in turn they are:
MASS : rate of stored energy
BRACE : power absorbed by a spring or damper, or supplied by a force
STOP : rate of stored energy, loss
PISTON : loss of the leak, friction, residual of the density law where a volume changes

Entries of `stored` [J] follow those of columns: each mass, brace, stop.
"""

from fvsolve.core.kernels.network_energy import (
    COLUMN,
    NODE,
    PIPE,
    VALVE,
    gauge_pressure,
    total_head,
    total_pressure,
    vessel_energy,
)
from fvsolve.core.kernels.pipe_energy import height_pressure
from fvsolve.features.motion.kernels.mass_dynamics import (
    contact_force,
    excess_of,
    leak_flow,
    motion,
    piston_travel,
    stop_travel,
    travel_of,
)
from fvsolve.features.motion.kernels.tables import open_motion
from fvsolve.jit import njit, specialise

MASS, BRACE, STOP, PISTON = 1, 1, 2, 3  # rows of `power` for each part


@njit
def power_masses(t, y, dydt, out, tables, power, at):
    """Write the power entries [W] of masses, then of springs, dampers and forces, then of stops, from power[at] on.

    Returns the index after them.
    """
    layout = tables.layout[0]
    masses = tables.masses
    braces = tables.braces
    stops = tables.stops
    armed = tables.armed
    for i in range(masses.size):
        power[at] = 0.0
        # A mass without states is fixed.
        if masses[i]["y"] >= 0:
            power[at] = motion(masses[i], y)[1] * dydt[masses[i]["y"] + 1] / masses[i]["lightness"]
        at += MASS
    for k in range(braces.size):
        brace = braces[k]
        speed = travel_of(out, tables, k)[1]
        power[at] = out[layout["push"] + k] * speed
        # The entry of a spring or damper is the absorbed power, that of a given force the supplied power.
        if brace["schedule"] < 0:
            power[at] = -power[at]
        at += BRACE
    first = tables.motion_settings[0]["flag"]
    for k in range(stops.size):
        stop = stops[k]
        x, speed = stop_travel(out, tables, k)
        into, rate = 0.0, 0.0
        for side in range(2):
            if armed[first + 2 * k + side] > 0.0:
                deep = x - stop["above"] if side == 1 else -(stop["below"] + x)
                faster = speed if side == 1 else -speed
                # `into` is the power of the contact force, `rate` the part that its spring stores.
                into += contact_force(stop["stiffness"], stop["damping"], deep, faster) * faster
                rate += stop["stiffness"] * deep * faster
        power[at], power[at + 1] = rate, into - rate
        at += STOP
    return at


@njit
def stored_masses(y, out, tables, stored, at):
    """Write the energy changes since the start [J] of masses, springs, dampers, forces and stops from stored[at] on."""
    masses = tables.masses
    braces = tables.braces
    stops = tables.stops
    for i in range(masses.size):
        stored[at] = 0.0
        if masses[i]["y"] >= 0:
            change = y[masses[i]["y"] + 1]
            stored[at] = change * (masses[i]["velocity"] + 0.5 * change) / masses[i]["lightness"]
        at += 1
    for k in range(braces.size):
        x = travel_of(out, tables, k)[0]
        # Work against a spring force that is `force` at the start and falls by k x.
        stored[at] = x * (0.5 * braces[k]["stiffness"] * x - braces[k]["force"])
        # A damper or a given force stores nothing, whatever its travel.
        if braces[k]["stiffness"] == 0.0:
            stored[at] = 0.0
        at += 1
    for k in range(stops.size):
        stop = stops[k]
        x = stop_travel(out, tables, k)[0]
        # Depth in the contact at either side, now and at the start; it may begin closed.
        now = max(0.0, max(-(stop["below"] + x), x - stop["above"]))
        then = max(0.0, max(-stop["below"], -stop["above"]))
        # As a product of difference and sum: no difference of large squares.
        stored[at] = 0.5 * stop["stiffness"] * (now - then) * (now + then)
        at += 1


@njit(forceinline=True)
def piston_side(tables, piston, side):
    """(chamber node, signed area [m2], swept mass per travel [kg/m]) of side 0 (A) or 1 (B) of a piston.

    The area is positive where the volume of the chamber grows with travel.
    """
    if side == 1:
        return piston["b"], -piston["area_b"], piston["sweep_b"]
    return piston["a"], piston["area_a"], piston["sweep_a"]


@njit
def power_pistons(y, dydt, out, tables, power, at):
    """Write three powers of each piston [W] from power[at] on: loss of the leak, friction, residual of the density law.

    Also write the rate of energy stored in the chambers to the entries of their nodes: that of V p^2 / (2 beta), with
    volume V, gauge pressure p and bulk modulus beta, and of the potential energy of the mass.
    """
    st = tables.settings[0]
    layout = tables.layout[0]
    nodes = tables.nodes
    pistons = tables.pistons
    per = 1.0 / st["rho"]
    for k in range(pistons.size):
        piston = pistons[k]
        speed = piston_travel(out, tables, k)[1]
        a, b = piston["a"], piston["b"]
        drop = total_pressure(tables, out, a) - total_pressure(tables, out, b)
        law = 0.0
        for side in range(2):
            i, area, sweep = piston_side(tables, piston, side)
            change = out[layout["pressure"] + i]
            p = (nodes[i]["pressure"] - st["ambient"]) + change
            excess, swept = dydt[nodes[i]["y"]], area * speed
            # Between bodies the state is the mass, which contains the swept mass.
            if piston["line"] >= 0:
                excess -= sweep * speed
            # Part of d/dt (V p^2 / (2 beta)) due to the change of volume at constant excess.
            own = p * swept * (0.5 * p / st["beta"] - change / st["beta"])
            power[NODE * i + 1] = (
                per * (p * excess + height_pressure(st, nodes[i]) * (excess + sweep * speed)) + own
            )
            # Power that the swept flow carries minus work of the piston: unequal at constant density.
            law += (per * p * sweep * speed - p * swept) - own
        power[at] = (
            drop
            * piston["leakage"]
            * (gauge_pressure(tables, out, a) - gauge_pressure(tables, out, b))
        )
        power[at + 1], power[at + 2] = piston["damping"] * speed * speed, law
        at += PISTON


@njit
def power_pistons_barotropic(y, dydt, out, tables, power, at):
    """Write three powers of each piston [W] from power[at] on: loss of the leak, friction, and zero.

    Also write the rate of energy stored in each chamber, H dm/dt - (p - p_ambient) dV/dt [W], to the entry of its node.
    H is the energy per mass [J/kg], m the mass, V the volume.
    """
    nodes, pistons = tables.nodes, tables.pistons
    pressure = tables.layout[0]["pressure"]
    for k in range(pistons.size):
        piston = pistons[k]
        speed = piston_travel(out, tables, k)[1]
        a, b = piston["a"], piston["b"]
        for side in range(2):
            i, area, sweep = piston_side(tables, piston, side)
            # The excess does not contain the mass that the piston sweeps.
            gained = dydt[nodes[i]["y"]] + (sweep * speed if piston["line"] < 0 else 0.0)
            power[NODE * i + 1] = (
                total_head(tables, out, i) * gained - gauge_pressure(tables, out, i) * area * speed
            )
        p_a = nodes[a]["pressure"] + out[pressure + a]
        p_b = nodes[b]["pressure"] + out[pressure + b]
        leak = leak_flow(tables, piston, p_a, p_b)
        power[at] = (total_head(tables, out, a) - total_head(tables, out, b)) * leak
        power[at + 1], power[at + 2] = piston["damping"] * speed * speed, 0.0
        at += PISTON


@njit
def moving_chamber_energy(out, tables, i, growth, gained):
    """Change since the start of the energy of chamber i of a piston under the density law `linear` [J].

    growth, gained : changes of its volume [m3] and of its mass [kg] since the start
    """
    st, node = tables.settings[0], tables.nodes[i]
    change, p0 = out[tables.layout[0]["pressure"] + i], node["pressure"] - st["ambient"]
    # V p^2 - V_0 p_0^2, expanded in the changes of pressure and volume.
    squeezed = node["volume"] * change * (2.0 * p0 + change) + growth * (p0 + change) * (
        p0 + change
    )
    height = 1.0 / st["rho"] * height_pressure(st, node) * gained
    return 0.5 * squeezed / st["beta"] + height


@njit
def moving_chamber_energy_barotropic(out, tables, i, growth, gained):
    """Result of `moving_chamber_energy` under the density laws `log` and `table` [J]."""
    st = tables.settings[0]
    floats = tables.floats
    node = tables.nodes[i]
    p0 = tables.nodes[i]["pressure"]
    mass, volume = node["mass"] + gained, node["volume"] + growth
    now = vessel_energy(st, floats, node, mass, volume, p0 + out[tables.layout[0]["pressure"] + i])
    return now - vessel_energy(st, floats, node, node["mass"], node["volume"], p0)


PISTON_POWER = MOVING_CHAMBER_ENERGY = None  # constants of the templates


def _add_power(t, y, dydt, out, handle, power):
    """Write the power [W] of masses, braces, stops and pistons, and of the chambers of pistons."""
    tables = open_motion(handle)
    at = NODE * tables.nodes.size + PIPE * tables.pipes.size + VALVE * tables.valves.size
    at = power_masses(t, y, dydt, out, tables, power, at + COLUMN * tables.columns.size)
    PISTON_POWER(y, dydt, out, tables, power, at)


def _add_stored(t, y, dydt, out, handle, stored):
    """Write the energy changes since the start [J] of masses, braces and stops, and of the chambers of pistons."""
    tables = open_motion(handle)
    for k in range(tables.pistons.size):
        piston, x = tables.pistons[k], piston_travel(out, tables, k)[0]
        for side in range(2):
            i, area, sweep = piston_side(tables, piston, side)
            gained = excess_of(y, tables, piston, i, sweep, x) + sweep * x
            stored[i] = MOVING_CHAMBER_ENERGY(out, tables, i, area * x, gained)
    stored_masses(
        y, out, tables, stored, tables.nodes.size + 2 * tables.pipes.size + tables.columns.size
    )


LINEAR = {"PISTON_POWER": power_pistons, "MOVING_CHAMBER_ENERGY": moving_chamber_energy}
OTHERS = {
    "PISTON_POWER": power_pistons_barotropic,
    "MOVING_CHAMBER_ENERGY": moving_chamber_energy_barotropic,
}
add_power_linear = specialise(_add_power, "add_power_linear", **LINEAR)
add_power_barotropic = specialise(_add_power, "add_power_barotropic", **OTHERS)
add_stored_linear = specialise(_add_stored, "add_stored_linear", **LINEAR)
add_stored_barotropic = specialise(_add_stored, "add_stored_barotropic", **OTHERS)
