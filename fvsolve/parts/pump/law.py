"""A pump: its speed, the torque of the fluid on its shaft, its check valve. Knows one pump; knows no network.

While its motor holds the speed, that is a schedule; once tripped, or where given torques turn the shaft from the
start, J d(omega)/dt = motor torque - torque of the fluid, in relative speed n = omega / rated speed. The fluid's
torque is n^2 P(q / n) / rated speed with P the shaft's power at rated speed, or that of a Suter table.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.devices import PASSING
from fvsolve.kernels.either import either
from fvsolve.kernels.records import RATE
from fvsolve.kernels.restrictions import head_drop
from fvsolve.kernels.schedules import schedule_value
from fvsolve.parts.check_valve.law import RELUCTANCE
from fvsolve.parts.pump.law_curve import (
    COUNT,
    JOIN,
    LAST,
    LAW,
    OWN,
    RATED_FLOW,
    SCALE,
    SUTER,
    curve_head,
    curve_step,
    joined_value,
    leaves,
    piecewise,
    suter_value,
)

# Numbers of a pump: how its speed comes about, whether it has a check valve, the schedule of its trip, the relative
# speed from which the shaft then runs free, J times rated speed [N m s], torque that is not balanced at the start and
# the fluid's there [N m], rated speed [rad/s], points of P or a Suter table's rated torque, how many given torques,
# whether its power at the shaft is known; then pairs of schedule and value at the start of given torques, then the
# points of P (flows, then powers) or WB. Where a table is joined, behind P stand its rated torque, what WB lacks at the
# last flow, and WB.
MODE, CHECK, TRIP, HELD, INERTIA, OFFSET, TORQUE, RATED, COUNT_OR_TORQUE, GIVEN, KNOWN, OWN_NUMBERS = range(12)
HELD_SPEED, TRIPPING, TURNED = 0, 1, 2  # modes
STEEPEST = 8.0  # d(torque) / d(speed) of a Suter table, over rated and over n + v, at most
BAR, STILL = 1e5, 1e-9  # a flow, over that at one bar, that is none yet
OUTSIDE = 1e-6  # share of a flow that is not yet outside the curve


@njit
def tripped(t, tables, device):
    """Whether the motor no longer holds the speed; a step that ends at the trip has not yet tripped."""
    return schedule_value(tables, int(tables.floats[device["data"] + TRIP]), t) > 0.0


@njit
def pump_speed(t, y, tables, device):
    """Relative speed."""
    floats, at = tables.floats, device["data"]
    mode = floats[at + MODE]
    if mode == HELD_SPEED or (mode == TRIPPING and not tripped(t, tables, device)):
        return schedule_value(tables, device["schedule"], t)
    return floats[at + HELD] + y[device["y"]]


@njit
def set(t, y, out, tables, device):
    """Its speed, and whether its check valve lets anything pass."""
    layout, k, floats = tables.layout[0], device["valve"], tables.floats
    shut = floats[device["data"] + CHECK] > 0.0 and tables.armed[device["event"]] > 0.0
    out[layout["drive"] + k] = pump_speed(t, y, tables, device)
    out[layout["conductance"] + k] = 0.0 if shut else tables.valves[k]["conductance"]


@njit
def pump_point(out, tables, device):
    """(relative speed, flow [m3/s], density [kg/m3]) of a pump whose nodes are closed."""
    layout, k = tables.layout[0], device["valve"]
    rho, _ = head_drop(tables, out, k)
    return out[layout["drive"] + k], out[layout["valve"] + k] / rho, rho


@njit
def pump_torque(out, tables, device):
    """Torque that the fluid asks of the shaft [N m]."""
    n, q, rho = pump_point(out, tables, device)
    curve, dense = tables.valves[device["valve"]]["data"], rho / tables.settings[0]["rho"]
    return fluid_torque(tables.floats, device["data"], curve, n, q, dense)


@njit
def fluid_torque(floats, at, curve, n, q, dense):
    """The same at a relative speed, a flow [m3/s] and a density over that of the case."""
    table = at + OWN_NUMBERS + 2 * int(floats[at + GIVEN])
    if floats[curve + LAW] == SUTER:
        rated = dense * floats[at + COUNT_OR_TORQUE]
        return rated * suter_value(floats, table, int(floats[curve + COUNT]), n, q / floats[curve + OWN + 1])[0]
    count = int(floats[at + COUNT_OR_TORQUE])
    if leaves(floats, curve, n, q):
        join, own = curve + int(floats[curve + JOIN]), table + 2 * count
        return dense * floats[own] * joined_value(floats, join, own + 1, n, q / floats[join + RATED_FLOW])[0]
    if n <= 0.0:
        return 0.0
    place = max(floats[table], min(floats[table + count - 1], q / n))
    return dense * n * n * piecewise(floats, table, count, place)[0] / floats[at + RATED]


@njit
def move(t, y, dydt, out, tables, device):
    """d/dt of the relative speed of a shaft that runs free, and its rate."""
    floats, at = tables.floats, device["data"]
    mode = floats[at + MODE]
    if mode == HELD_SPEED:
        return
    if mode == TRIPPING and not tripped(t, tables, device):
        if dydt.size > 0:
            dydt[device["y"]] = 0.0
        return
    torque = pump_torque(out, tables, device)
    out[RATE] = max(out[RATE], shaft_rate(out, tables, device, torque))
    if dydt.size == 0:
        return
    push = -torque
    if mode == TURNED:
        push = floats[at + OFFSET] - (torque - floats[at + TORQUE]) + given_torque(t, tables, device, True)
    dydt[device["y"]] = push / floats[at + INERTIA]


@njit
def given_torque(t, tables, device, change):
    """Sum of the torques given to the shaft, or its `change` since the start [N m]."""
    floats, total = tables.floats, 0.0
    for k in range(int(floats[device["data"] + GIVEN])):
        own = device["data"] + OWN_NUMBERS + 2 * k
        total += schedule_value(tables, int(floats[own]), t) - (floats[own + 1] if change else 0.0)
    return total


@njit
def shaft_rate(out, tables, device, torque):
    """Greatest rate at which the fluid brakes a free shaft [1/s]."""
    floats, at, curve = tables.floats, device["data"], tables.valves[device["valve"]]["data"]
    n, q, _ = pump_point(out, tables, device)
    if floats[curve + LAW] == SUTER or floats[curve + JOIN] > 0.0:
        rated = floats[at + COUNT_OR_TORQUE]
        if floats[curve + JOIN] > 0.0:
            rated = floats[at + OWN_NUMBERS + 2 * (int(floats[at + GIVEN]) + int(rated))]
        return STEEPEST * abs(rated / floats[at + INERTIA]) * (abs(n) + abs(q / floats[curve + SCALE]))
    return 3.0 * abs(torque / (n * floats[at + INERTIA])) if n > 0.0 else 0.0


@njit
def power(t, y, dydt, out, tables, device):
    """Power given to the shaft, rate of what it stores, power that the fluid takes from it [W]."""
    floats, at = tables.floats, device["data"]
    if floats[at + KNOWN] == 0.0:
        return 0.0, 0.0, 0.0
    n = out[tables.layout[0]["drive"] + device["valve"]]
    omega, mode = n * floats[at + RATED], floats[at + MODE]
    taken = pump_torque(out, tables, device) * omega
    if mode == HELD_SPEED or (mode == TRIPPING and not tripped(t, tables, device)):
        return taken, 0.0, taken
    given = given_torque(t, tables, device, False) * omega if mode == TURNED else 0.0
    return given, floats[at + INERTIA] * omega * dydt[device["y"]], taken


@njit
def stored(y, tables, device):
    """Energy of a free shaft, change since it was let go [J]."""
    floats, at = tables.floats, device["data"]
    if floats[at + MODE] == HELD_SPEED:
        return 0.0
    n = y[device["y"]]
    return 0.5 * floats[at + INERTIA] * floats[at + RATED] * n * (2.0 * floats[at + HELD] + n)


@njit
def unreversed(valve):
    """Flow backwards that is none yet [kg/s]: behind another that is shut, an open one stays open without flow."""
    return STILL * sqrt(BAR * valve["conductance"])


@njit
def events(t, y, out, tables, device, g):
    """g of its check valve: flow left while open [kg/s], drop that opens it while shut [Pa]; and the same negative."""
    layout, k, at = tables.layout[0], device["valve"], device["event"]
    valve, floats = tables.valves[k], tables.floats
    g[at], g[at + 1] = 1.0, 1.0
    if floats[device["data"] + CHECK] == 0.0:
        return
    left = out[layout["valve"] + k] + unreversed(valve)
    if tables.armed[at] > 0.0:
        rho, drop = head_drop(tables, out, k)
        most = curve_head(floats, valve["data"], out[layout["drive"] + k], 0.0)[0]
        left = drop + rho * tables.settings[0]["gravity"] * most - RELUCTANCE
    either(tables, g, at, left)


@njit
def value(t, y, out, tables, device, which):
    """Its head [m], relative speed, torque of the fluid [N m], power at the shaft [W]."""
    floats = tables.floats
    n, q, _ = pump_point(out, tables, device)
    if which == 0:
        return curve_head(floats, tables.valves[device["valve"]]["data"], n, q)[0]
    if which == 1:
        return n
    torque = pump_torque(out, tables, device)
    return torque if which == 2 else torque * n * floats[device["data"] + RATED]


@njit
def outside(out, tables, device):
    """1 where it works outside its curve, backwards or beyond the last flow; a Suter table has no outside.

    PASSING where a table is joined to it, and where it runs down behind a check valve: slower than at the start,
    forward, by a flow its curve then held.
    """
    floats, curve = tables.floats, tables.valves[device["valve"]]["data"]
    if floats[curve + LAW] == SUTER:
        return 0
    n, q, _ = pump_point(out, tables, device)
    slack, last, begun = (
        OUTSIDE * floats[curve + SCALE],
        floats[curve + LAST],
        tables.valves[device["valve"]]["drive"],
    )
    if -slack <= q <= max(n, 0.0) * last + slack:
        return 0
    if floats[curve + JOIN] > 0.0:
        return PASSING
    down = floats[device["data"] + CHECK] > 0.0 and n < begun and 0.0 < q <= begun * last
    return PASSING if down else 1


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """a, s by its curve, which asks for the drop of heads at the density before it."""
    rho, fall = head_drop(tables, out, k)
    return pump_step(tables, out, k, rho, g, m, fall)


@njit
def slope(out, tables, k, g, drop):
    """d flow / d drop [kg/s/Pa]; none behind its shut check valve."""
    m = out[tables.layout[0]["valve"] + k]
    return pump_step(tables, out, k, tables.settings[0]["rho"], g, m, drop)[1] if g > 0.0 else 0.0


@njit
def pump_step(tables, out, k, rho, g, m, drop):
    """`curve_step` of a pump whose fluid has the density rho [kg/m3], at the speed that it has."""
    at, speed = tables.valves[k]["data"], out[tables.layout[0]["drive"] + k]
    return curve_step(tables.floats, at, speed, rho, rho * tables.settings[0]["gravity"], g, m, drop)
