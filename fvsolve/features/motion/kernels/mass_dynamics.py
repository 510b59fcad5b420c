"""Masses on an axis, with pistons, springs, dampers, forces and stops, which may act on bodies too.

First the pressures of moving chambers and the flows swept by their pistons are computed, then the fluid, then forces
and accelerations. The state of a chamber is its excess mass e: its mass minus the mass in its present volume V at the
initial density m0 / V0. So the pressure itself is integrated, not a small difference of two large masses: p - p0 = beta
e / (rho0 V) under the density law `linear`, ln(rho / rho_0) = ln(1 + e V0 / (m0 V)) under `log` and `table`. The index
0 marks initial values. For a piston between points of bodies the state is the mass itself, which a closed chamber
conserves to the last bit. The force of a spring, stop or piston follows from its change of length (travel) in `out`: on
the axis from the positions of two masses, between bodies from two points, written by
`body_kinematics`. Its two masses are then the same fixed frame, on which the net force is zero.
"""

from math import log, log1p, sqrt

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.density import density, log_density, pressure_of_log
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.features.motion.kernels.tables import open_motion
from fvsolve.jit import njit

CONTACT_STEPS = (
    # times the rate of a contact: `step_control.closing_step` then takes a quarter of a radian in a step
    0.6
)


@njit(forceinline=True)
def motion(mass, y):
    """(change of position since the start [m], velocity [m/s]) of a mass."""
    if mass["y"] < 0:
        return 0.0, 0.0
    return y[mass["y"]], mass["velocity"] + y[mass["y"] + 1]


@njit(forceinline=True)
def relative_motion(tables, y, i, j):
    """(change of the distance from mass i to mass j since the start [m], its rate [m/s])."""
    x_i, v_i = motion(tables.masses[i], y)
    x_j, v_j = motion(tables.masses[j], y)
    return x_j - x_i, v_j - v_i


@njit(forceinline=True)
def travel_of(out, tables, k):
    """(change of length since the start [m], its rate [m/s]) of force element k.

    Springs, dampers and forces are numbered first, then stops, then pistons.
    """
    at = tables.layout[0]["travel"] + 2 * k
    return out[at], out[at + 1]


@njit
def write_travels(y, out, tables):
    """Write the change of length of all force elements between masses, and its rate, to `out`.

    Elements between points of bodies are written by `body_kinematics`.
    """
    braces = tables.braces
    stops = tables.stops
    pistons = tables.pistons
    at = tables.layout[0]["travel"]
    for k in range(braces.size):
        if braces[k]["line"] < 0:
            out[at], out[at + 1] = relative_motion(
                tables, y, braces[k]["from_mass"], braces[k]["to_mass"]
            )
        at += 2
    for k in range(stops.size):
        if stops[k]["line"] < 0:
            out[at], out[at + 1] = relative_motion(
                tables, y, stops[k]["from_mass"], stops[k]["to_mass"]
            )
        at += 2
    for k in range(pistons.size):
        if pistons[k]["line"] < 0:
            out[at], out[at + 1] = relative_motion(tables, y, pistons[k]["case"], pistons[k]["rod"])
        at += 2


@njit(forceinline=True)
def stop_travel(out, tables, k):
    """(change of length since the start [m], its rate [m/s]) of stop k."""
    return travel_of(out, tables, tables.braces.size + k)


@njit(forceinline=True)
def piston_travel(out, tables, k):
    """(travel since the start [m], its rate [m/s]) of piston k."""
    return travel_of(out, tables, tables.braces.size + tables.stops.size + k)


@njit(forceinline=True)
def contact_force(stiffness, damping, depth, speed):
    """Force of a closed contact [N] at `depth` [m], which grows at `speed` [m/s]; it never pulls.

    There is no jump at depth 0, which difference quotients would turn into an infinite slope.
    """
    return max(0.0, stiffness * depth + damping * speed)


@njit
def leak_flow(tables, piston, p_a, p_b):
    """Mass flow from chamber A to chamber B past the piston [kg/s], at the upstream density.

    p_a, p_b : pressures of the chambers [Pa]
    """
    st = tables.settings[0]
    rho = st["rho"]
    if st["law"] != rec.LAW_LINEAR:
        rho = density(st, tables.floats, max(p_a, p_b))
    return rho * piston["leakage"] * (p_a - p_b)


@njit
def chamber_state(tables, node, volume, excess):
    """(pressure change since the start [Pa], stiffness dp/dm [Pa/kg]) of a moving chamber.

    volume : present volume [m3]
    excess : mass minus the mass in this volume at the initial density [kg]
    """
    st, floats = tables.settings[0], tables.floats
    if st["law"] == rec.LAW_LINEAR:
        # dp/dm = beta / (rho_0 V): it grows as the chamber shrinks.
        stiffness = node["stiffness"] * node["volume"] / volume
        return stiffness * excess, stiffness
    # log1p keeps the digits of a small excess, which the quotient of two masses would lose.
    share = node["volume"] / volume * excess / node["mass"]
    q0 = log(node["mass"] / (st["rho"] * node["volume"]))
    p = pressure_of_log(st, floats, 0.0, q0 + log1p(share))
    mass = node["mass"] * volume / node["volume"] + excess
    return p - pressure_of_log(st, floats, 0.0, q0), 1.0 / (log_density(st, floats, p)[1] * mass)


@njit(forceinline=True)
def excess_of(y, tables, piston, i, sweep, x):
    """Excess mass of chamber i [kg]: its mass minus the mass in its present volume at the initial density.

    It is the state of the chamber. If the piston joins points of bodies, the state is instead the mass that has
    entered, from which the swept mass is subtracted.
    sweep : swept mass per travel [kg/m]; x : travel of the piston since the start [m]
    """
    state = y[tables.nodes[i]["y"]]
    return state - sweep * x if piston["line"] >= 0 else state


@njit
def piston_chambers(t, y, dydt, out, handle):
    """Write pressure and stiffness of moving chambers, and the flow that piston and leak take from each, to `out`.

    The values are the pressure change since the start [Pa], the stiffness dp/dm [Pa/kg], and the flow [kg/s], which
    contains only the change of the leak since the start. A piston between points of bodies takes no flow, because the
    state of its chambers is their mass. First, `write_travels` writes the travels of force elements between masses.
    """
    tables = open_motion(handle)
    layout = tables.layout[0]
    nodes = tables.nodes
    pistons = tables.pistons
    write_travels(y, out, tables)
    for k in range(pistons.size):
        piston = pistons[k]
        x, speed = piston_travel(out, tables, k)
        for side in range(2):
            # With travel, side A grows and side B shrinks.
            i = piston["b"] if side == 1 else piston["a"]
            area = -piston["area_b"] if side == 1 else piston["area_a"]
            sweep = piston["sweep_b"] if side == 1 else piston["sweep_a"]
            excess = excess_of(y, tables, piston, i, sweep, x)
            p, stiffness = chamber_state(tables, nodes[i], nodes[i]["volume"] + area * x, excess)
            out[layout["pressure"] + i] = p
            out[layout["stiffness"] + nodes[i]["row"]] = stiffness
            # Between points of bodies the state is the mass itself, which a piston does not change.
            out[layout["swept"] + nodes[i]["row"]] = sweep * speed if piston["line"] < 0 else 0.0
        # After the swept flows of both sides are written, because the leak is added to them.
        if piston["leakage"] > 0.0:
            a, b = piston["a"], piston["b"]
            p_a = nodes[a]["pressure"] + out[layout["pressure"] + a]
            p_b = nodes[b]["pressure"] + out[layout["pressure"] + b]
            leak = leak_flow(tables, piston, p_a, p_b) - piston["leak"]
            out[layout["swept"] + nodes[a]["row"]] += leak
            out[layout["swept"] + nodes[b]["row"]] -= leak


@njit(forceinline=True)
def add_push(out, tables, k, i, j, change, start):
    """Write the force of element k, `start` + `change` [N]; add `change` to mass j, and subtract it from mass i."""
    layout = tables.layout[0]
    out[layout["push"] + k] = start + change
    out[layout["net_force"] + i] -= change
    out[layout["net_force"] + j] += change


@njit
def forces(t, y, out, tables):
    """Write all element forces and the net force on every mass [N] to `out`.

    Forces that have not changed since the start add exactly zero.
    """
    layout = tables.layout[0]
    masses = tables.masses
    braces = tables.braces
    stops = tables.stops
    pistons = tables.pistons
    armed = tables.armed
    for i in range(masses.size):
        out[layout["net_force"] + i] = masses[i]["force"]
    for k in range(braces.size):
        brace = braces[k]
        x, speed = travel_of(out, tables, k)
        change = -brace["stiffness"] * x - brace["damping"] * (speed - brace["speed"])
        if brace["schedule"] >= 0:
            change += schedule_value(tables, brace["schedule"], t) - brace["given"]
        add_push(out, tables, k, brace["from_mass"], brace["to_mass"], change, brace["force"])
    # The flags of stops, two for each stop.
    first = tables.motion_settings[0]["flag"]
    for k in range(stops.size):
        stop = stops[k]
        x, speed = stop_travel(out, tables, k)
        total = 0.0
        # Flags hold during a step, so that no contact begins or ends within it.
        if armed[first + 2 * k] > 0.0:
            total += contact_force(stop["stiffness"], stop["damping"], -(stop["below"] + x), -speed)
        if armed[first + 2 * k + 1] > 0.0:
            total -= contact_force(stop["stiffness"], stop["damping"], x - stop["above"], speed)
        at = braces.size + k
        add_push(
            out,
            tables,
            at,
            stop["from_mass"],
            stop["to_mass"],
            total - stop["force"],
            stop["force"],
        )
    for k in range(pistons.size):
        piston = pistons[k]
        _, speed = piston_travel(out, tables, k)
        # Only changes of pressure act: the forces at the start are in balance.
        change = piston["area_a"] * out[layout["pressure"] + piston["a"]]
        change -= piston["area_b"] * out[layout["pressure"] + piston["b"]]
        change -= piston["damping"] * (speed - piston["speed"])
        add_push(
            out,
            tables,
            braces.size + stops.size + k,
            piston["case"],
            piston["rod"],
            change,
            piston["force"],
        )


@njit(forceinline=True)
def add_stiffness(tables, i, j, stiffness, damping):
    """Add stiffness and damping of an element, per mass [1/s2, 1/s], to the sums of its masses i and j in scratch."""
    masses, work = tables.masses, tables.scratch
    # Two masses on a spring oscillate at the rate sqrt(k (1/m_i + 1/m_j)).
    lightness = masses[i]["lightness"] + masses[j]["lightness"]
    for mass in (i, j):
        work[2 * mass] += lightness * stiffness
        work[2 * mass + 1] += lightness * damping


@njit
def push_stiffness(out, tables, k):
    """Present (stiffness [N/m], damping [N s/m]) of element k: spring, closed stop, or piston between its chambers."""
    braces = tables.braces
    stops = tables.stops
    pistons = tables.pistons
    armed = tables.armed
    if k < braces.size:
        return braces[k]["stiffness"], braces[k]["damping"]
    k -= braces.size
    if k < stops.size:
        first = tables.motion_settings[0]["flag"] + 2 * k
        if armed[first] + armed[first + 1] > 0.0:
            return stops[k]["stiffness"], stops[k]["damping"]
        return 0.0, 0.0
    piston = pistons[k - stops.size]
    stiffness = tables.layout[0]["stiffness"]
    nodes = tables.nodes
    # A chamber acts as a spring: its pressure rises by the swept mass, and pushes on the area.
    stiff_a = out[stiffness + nodes[piston["a"]]["row"]]
    stiff_b = out[stiffness + nodes[piston["b"]]["row"]]
    stiff = (
        piston["area_a"] * stiff_a * piston["sweep_a"]
        - piston["area_b"] * stiff_b * piston["sweep_b"]
    )
    return stiff, piston["damping"]


@njit
def mechanical_rate(out, tables):
    """Greatest rate of a mass [1/s], c / 2 + sqrt(c^2 / 4 + k).

    k : stiffness of all elements at the mass, with chambers, per mass [1/s2]; c : their damping per mass [1/s]
    """
    masses = tables.masses
    braces = tables.braces
    stops = tables.stops
    pistons = tables.pistons
    work = tables.scratch
    for i in range(2 * masses.size):
        work[i] = 0.0
    for k in range(braces.size):
        add_stiffness(
            tables, braces[k]["from_mass"], braces[k]["to_mass"], *push_stiffness(out, tables, k)
        )
    for k in range(stops.size):
        add_stiffness(
            tables,
            stops[k]["from_mass"],
            stops[k]["to_mass"],
            *push_stiffness(out, tables, braces.size + k),
        )
    for k in range(pistons.size):
        add_stiffness(
            tables,
            pistons[k]["case"],
            pistons[k]["rod"],
            *push_stiffness(out, tables, braces.size + stops.size + k),
        )
    rate = 0.0
    for i in range(masses.size):
        # A mass without states does not move, so that it limits nothing.
        if masses[i]["y"] >= 0:
            brake = 0.5 * work[2 * i + 1]
            rate = max(rate, brake + sqrt(brake * brake + work[2 * i]))
    return rate


@njit
def contact_rate(out, tables):
    """Greatest rate [1/s] of the closed contacts of stops that will open again, in units of out[CLOSING].

    A contact with stiffness k and damping c per mass has the rate c / 2 + sqrt(c^2 / 4 + k). Its depth x swings about
    that at rest, x_0 = x + (x'' + c x') / k, with an amplitude (x - x_0)^2 + x'^2 / k; it opens again if the amplitude
    exceeds x_0. A load at rest on a stop does not limit the step.
    """
    masses = tables.masses
    stops = tables.stops
    armed = tables.armed
    net = tables.layout[0]["net_force"]
    first = tables.motion_settings[0]["flag"]
    greatest = 0.0
    for k in range(stops.size):
        stop = stops[k]
        i, j = stop["from_mass"], stop["to_mass"]
        lightness = masses[i]["lightness"] + masses[j]["lightness"]
        stiffness, brake = lightness * stop["stiffness"], lightness * stop["damping"]
        # Contacts between points of bodies are part of the rates of bodies.
        if not stiffness > 0.0 or stop["line"] >= 0:
            continue
        travel, speed = stop_travel(out, tables, k)
        # Acceleration x'' of the distance between both masses.
        change = out[net + j] * masses[j]["lightness"] - out[net + i] * masses[i]["lightness"]
        for side in range(2):
            if armed[first + 2 * k + side] > 0.0:
                sign = 2.0 * side - 1.0
                depth = travel - stop["above"] if side == 1 else -(stop["below"] + travel)
                resting = depth + sign * (change + brake * speed) / stiffness
                swing = (depth - resting) * (depth - resting) + speed * speed / stiffness
                if resting <= 0.0 or swing > resting * resting:
                    greatest = max(greatest, 0.5 * brake + sqrt(0.25 * brake * brake + stiffness))
    return CONTACT_STEPS * greatest


@njit
def mass_rates(t, y, dydt, out, handle):
    """Write net forces to `out`, d/dt of positions and velocities to `dydt`; raise out[RATE] to `mechanical_rate`.

    A given step is divided while a contact lasts, by out[CLOSING].
    STATUS is NO_VOLUME if a piston has used up its chamber.
    """
    tables = open_motion(handle)
    layout = tables.layout[0]
    nodes = tables.nodes
    masses = tables.masses
    forces(t, y, out, tables)
    if out[rec.RATE] != rec.RATE_UNWANTED:
        out[rec.RATE] = max(out[rec.RATE], mechanical_rate(out, tables))
        if tables.stops.size > 0:
            # columns have cleared it in this call
            closing = out[rec.CLOSING] if tables.columns.size > 0 else 0.0
            out[rec.CLOSING] = max(closing, contact_rate(out, tables))
    for k in range(tables.pistons.size):
        for i in (tables.pistons[k]["a"], tables.pistons[k]["b"]):
            # Written so that a stiffness that is not a number is a fault too.
            if not out[layout["stiffness"] + nodes[i]["row"]] > 0.0:
                out[rec.STATUS], out[rec.WHERE] = rec.NO_VOLUME, i
    if dydt.size == 0:
        return
    for i in range(masses.size):
        at = masses[i]["y"]
        if at >= 0:
            dydt[at] = masses[i]["velocity"] + y[at + 1]
            dydt[at + 1] = out[layout["net_force"] + i] * masses[i]["lightness"]


@njit
def observe_masses(t, y, out, handle, values):
    """Write the values of the probes of masses, force elements and pistons to `values`."""
    tables = open_motion(handle)
    layout = tables.layout[0]
    masses = tables.masses
    pistons = tables.pistons
    probes = tables.probes
    for k in range(probes.size):
        kind, i = probes[k]["kind"], probes[k]["index"]
        if kind == rec.POSITION:
            values[k] = masses[i]["position"] + motion(masses[i], y)[0]
        elif kind == rec.VELOCITY:
            values[k] = motion(masses[i], y)[1]
        elif kind == rec.FORCE:
            values[k] = out[layout["push"] + i]
        elif kind == rec.PISTON_POSITION:
            values[k] = pistons[i]["position"] + piston_travel(out, tables, i)[0]
        elif kind == rec.PISTON_VELOCITY:
            values[k] = piston_travel(out, tables, i)[1]


@njit
def record_masses(t, y, out, handle, values):
    """Record the first time at which each piston leaves its stroke, in `marks`."""
    tables = open_motion(handle)
    marks, pistons = tables.marks, tables.pistons
    first = tables.motion_settings[0]["mark"]
    for k in range(pistons.size):
        piston, at = pistons[k], first + k
        x = piston["position"] + piston_travel(out, tables, k)[0]
        if not 0.0 <= x <= piston["stroke"] and marks[at] != marks[at]:
            marks[at] = t


@njit
def forces_for_events(t, y, out, handle, g):
    """Write all element forces and net forces to `out`, for sources of networks that read them; g is not used."""
    forces(t, y, out, open_motion(handle))


@njit
def mass_events(t, y, out, handle, g):
    """Write the event functions of stops to g: remaining free travel to each of their two sides [m]."""
    tables = open_motion(handle)
    stops = tables.stops
    # No rates have been computed at the state of an event, so travels are written here.
    write_travels(y, out, tables)
    first = tables.motion_settings[0]["flag"]
    for k in range(stops.size):
        x, _ = stop_travel(out, tables, k)
        g[first + 2 * k], g[first + 2 * k + 1] = stops[k]["below"] + x, stops[k]["above"] - x
