"""Pump: speed, torque of the fluid on the shaft, and check valve.

While the motor holds the speed, the speed follows a schedule. After a trip, or with given torques from the start,
J d(omega)/dt = motor torque - torque of the fluid, in relative speed n = omega / rated speed. The torque of the fluid
is n^2 P(q / n) / rated speed, P the shaft power at rated speed, or that of a Suter table.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.devices import TEMPORARY
from fvsolve.kernels.dtypes import RATE
from fvsolve.kernels.event_pair import event_pair
from fvsolve.kernels.restrictions import head_drop
from fvsolve.kernels.schedule_pieces import schedule_value
from fvsolve.parts.check_valve.law import PRESSURE_MARGIN
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
    is_off_curve,
    joined_value,
    piecewise,
    suter_value,
)

# Numbers of a pump: mode of its speed; 1 with a check valve; schedule of the trip; relative speed at which the shaft
# begins to run free; J times rated speed [N m s]; unbalanced torque and torque of the fluid at the start [N m]; rated
# speed [rad/s]; number of points of P, or rated torque of a Suter table; number of given torques; 1 if the shaft power
# is known. Then pairs (schedule, value at the start) of given torques, then the points of P (flows, then powers) or WB.
# With a joined table, these follow P: rated torque, correction of WB at the last flow, and WB.
(
    MODE,
    CHECK,
    TRIP,
    START_SPEED,
    INERTIA,
    OFFSET,
    TORQUE,
    RATED,
    COUNT_OR_TORQUE,
    TORQUE_COUNT,
    HAS_SHAFT_POWER,
    OWN_NUMBERS,
) = range(12)
HELD_SPEED, TRIPPING, TORQUE_DRIVEN = 0, 1, 2  # modes
MAX_TORQUE_SLOPE = 8.0  # bound of d(torque) / d(speed) of a Suter table, over the rated torque and n + v
BAR, FLOW_ROUNDING = 1e5, 1e-9  # flow regarded as zero, over the flow at 1 bar
OUTSIDE = 1e-6  # tolerance of the range of the curve, over its flow scale


@njit
def tripped(t, tables, device):
    """True if the motor no longer holds the speed; false in a step that ends at the trip."""
    return schedule_value(tables, int(tables.floats[device["data"] + TRIP]), t) > 0.0


@njit
def pump_speed(t, y, tables, device):
    """Relative speed of the shaft."""
    floats, at = tables.floats, device["data"]
    mode = floats[at + MODE]
    if mode == HELD_SPEED or (mode == TRIPPING and not tripped(t, tables, device)):
        return schedule_value(tables, device["schedule"], t)
    return floats[at + START_SPEED] + y[device["y"]]


@njit
def set(t, y, out, tables, device):
    """Write the speed and the conductance, which is 0 behind a shut check valve."""
    layout, k, floats = tables.layout[0], device["valve"], tables.floats
    shut = floats[device["data"] + CHECK] > 0.0 and tables.armed[device["event"]] > 0.0
    out[layout["drive"] + k] = pump_speed(t, y, tables, device)
    out[layout["conductance"] + k] = 0.0 if shut else tables.valves[k]["conductance"]


@njit
def pump_point(out, tables, device):
    """(relative speed, flow [m3/s], density [kg/m3]) of a pump after the nodes are solved."""
    layout, k = tables.layout[0], device["valve"]
    rho, _ = head_drop(tables, out, k)
    return out[layout["drive"] + k], out[layout["valve"] + k] / rho, rho


@njit
def pump_torque(out, tables, device):
    """Torque of the fluid on the shaft, against the rotation [N m]."""
    n, q, rho = pump_point(out, tables, device)
    curve, dense = tables.valves[device["valve"]]["data"], rho / tables.settings[0]["rho"]
    return fluid_torque(tables.floats, device["data"], curve, n, q, dense)


@njit
def fluid_torque(floats, at, curve, n, q, dense):
    """Torque of the fluid [N m] at a relative speed, a flow [m3/s] and a density over that of the case."""
    table = at + OWN_NUMBERS + 2 * int(floats[at + TORQUE_COUNT])
    if floats[curve + LAW] == SUTER:
        rated = dense * floats[at + COUNT_OR_TORQUE]
        return rated * suter_value(floats, table, int(floats[curve + COUNT]), n, q / floats[curve + OWN + 1])[0]
    count = int(floats[at + COUNT_OR_TORQUE])
    if is_off_curve(floats, curve, n, q):
        join, own = curve + int(floats[curve + JOIN]), table + 2 * count
        return dense * floats[own] * joined_value(floats, join, own + 1, n, q / floats[join + RATED_FLOW])[0]
    if n <= 0.0:
        return 0.0
    place = max(floats[table], min(floats[table + count - 1], q / n))
    return dense * n * n * piecewise(floats, table, count, place)[0] / floats[at + RATED]


@njit
def move(t, y, dydt, out, tables, device):
    """Write d/dt of the relative speed of a free shaft, and its rate limit."""
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
    if mode == TORQUE_DRIVEN:
        push = floats[at + OFFSET] - (torque - floats[at + TORQUE]) + given_torque(t, tables, device, True)
    dydt[device["y"]] = push / floats[at + INERTIA]


@njit
def given_torque(t, tables, device, change):
    """Sum of the given torques on the shaft, or its `change` since the start [N m]."""
    floats, total = tables.floats, 0.0
    for k in range(int(floats[device["data"] + TORQUE_COUNT])):
        own = device["data"] + OWN_NUMBERS + 2 * k
        total += schedule_value(tables, int(floats[own]), t) - (floats[own + 1] if change else 0.0)
    return total


@njit
def shaft_rate(out, tables, device, torque):
    """Upper bound of the rate at which the fluid brakes a free shaft [1/s]."""
    floats, at, curve = tables.floats, device["data"], tables.valves[device["valve"]]["data"]
    n, q, _ = pump_point(out, tables, device)
    if floats[curve + LAW] == SUTER or floats[curve + JOIN] > 0.0:
        rated = floats[at + COUNT_OR_TORQUE]
        if floats[curve + JOIN] > 0.0:
            rated = floats[at + OWN_NUMBERS + 2 * (int(floats[at + TORQUE_COUNT]) + int(rated))]
        return MAX_TORQUE_SLOPE * abs(rated / floats[at + INERTIA]) * (abs(n) + abs(q / floats[curve + SCALE]))
    return 3.0 * abs(torque / (n * floats[at + INERTIA])) if n > 0.0 else 0.0


@njit
def power(t, y, dydt, out, tables, device):
    """Power given to the shaft, rate of its kinetic energy, and power taken from it by the fluid [W]."""
    floats, at = tables.floats, device["data"]
    if floats[at + HAS_SHAFT_POWER] == 0.0:
        return 0.0, 0.0, 0.0
    n = out[tables.layout[0]["drive"] + device["valve"]]
    omega, mode = n * floats[at + RATED], floats[at + MODE]
    taken = pump_torque(out, tables, device) * omega
    if mode == HELD_SPEED or (mode == TRIPPING and not tripped(t, tables, device)):
        return taken, 0.0, taken
    given = given_torque(t, tables, device, False) * omega if mode == TORQUE_DRIVEN else 0.0
    return given, floats[at + INERTIA] * omega * dydt[device["y"]], taken


@njit
def stored(y, tables, device):
    """Change of the kinetic energy of a free shaft since it began to run free [J]."""
    floats, at = tables.floats, device["data"]
    if floats[at + MODE] == HELD_SPEED:
        return 0.0
    n = y[device["y"]]
    return 0.5 * floats[at + INERTIA] * floats[at + RATED] * n * (2.0 * floats[at + START_SPEED] + n)


@njit
def reversal_margin(valve):
    """Reverse flow below which the check valve stays open [kg/s]: next to a shut valve it stays open without flow."""
    return FLOW_ROUNDING * sqrt(BAR * valve["conductance"])


@njit
def events(t, y, out, tables, device, g):
    """g of the check valve: flow above the margin if open [kg/s], opening drop if shut [Pa]; then its negative."""
    layout, k, at = tables.layout[0], device["valve"], device["event"]
    valve, floats = tables.valves[k], tables.floats
    g[at], g[at + 1] = 1.0, 1.0
    if floats[device["data"] + CHECK] == 0.0:
        return
    left = out[layout["valve"] + k] + reversal_margin(valve)
    if tables.armed[at] > 0.0:
        rho, drop = head_drop(tables, out, k)
        most = curve_head(floats, valve["data"], out[layout["drive"] + k], 0.0)[0]
        left = drop + rho * tables.settings[0]["gravity"] * most - PRESSURE_MARGIN
    event_pair(tables, g, at, left)


@njit
def value(t, y, out, tables, device, quantity):
    """Head [m], relative speed, torque of the fluid [N m] or power at the shaft [W], by number."""
    floats = tables.floats
    n, q, _ = pump_point(out, tables, device)
    if quantity == 0:
        return curve_head(floats, tables.valves[device["valve"]]["data"], n, q)[0]
    if quantity == 1:
        return n
    torque = pump_torque(out, tables, device)
    return torque if quantity == 2 else torque * n * floats[device["data"] + RATED]


@njit
def outside(out, tables, device):
    """1 where the pump works outside its curve, at reverse flow or beyond the last flow; 0 for a Suter table.

    PASSING with a joined table, and while the pump runs down with a check valve: slower than at the start, with a
    forward flow that was within the curve at the initial speed.
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
        return TEMPORARY
    down = floats[device["data"] + CHECK] > 0.0 and n < begun and 0.0 < q <= begun * last
    return TEMPORARY if down else 1


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """a, s of the Newton step, from the drop of heads at the upstream density."""
    rho, fall = head_drop(tables, out, k)
    return pump_step(tables, out, k, rho, g, m, fall)


@njit
def slope(out, tables, k, g, drop):
    """d flow / d drop [kg/s/Pa]; 0 with a shut check valve."""
    m = out[tables.layout[0]["valve"] + k]
    return pump_step(tables, out, k, tables.settings[0]["rho"], g, m, drop)[1] if g > 0.0 else 0.0


@njit
def pump_step(tables, out, k, rho, g, m, drop):
    """`curve_step` of a pump at its present speed, for fluid of density rho [kg/m3]."""
    at, speed = tables.valves[k]["data"], out[tables.layout[0]["drive"] + k]
    return curve_step(tables.floats, at, speed, rho, rho * tables.settings[0]["gravity"], g, m, drop)
