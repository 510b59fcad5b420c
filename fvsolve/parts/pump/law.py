"""Pump: speed, torque of the fluid on the shaft, and check valve.

While the motor holds the speed, the speed follows a schedule. After a trip, or with given torques from the start,
J d(omega)/dt = motor torque - torque of the fluid, with inertia J and relative speed n = omega / rated speed. The
torque of the fluid is n^2 P(q / n) / rated speed at the flow q, P the shaft power at rated speed, or that of a Suter
table.

Head curves of pumps at any speed.
H = n^2 f(q / n), with head H, flow q and relative speed n (affinity).
Between two flows `first` and `last` [m3/s] at rated speed, f is a - b q^c, linear between points, or a polynomial.
It continues with equal slope: below `first` as a line, beyond `last` as a parabola a' - b' q^2, which also holds for a
pump at rest. Reverse flow adds b' q^2. Where `first` is above 0 (a curve that is flat at no flow), the line ends at the
reverse flow -`first`.
With a Suter table, H = (n^2 + v^2) WH(pi + atan2(v, n)) times the rated head, v the flow over the rated flow.
A Suter table may be joined to a curve in place of line and parabolas. It holds outside of 0 <= q <= n `last`, n > 0.
There WH is corrected so that it agrees with both ends of the curve. With x = pi + atan2(v, n), the corrections fade to
zero at standstill: at x = pi/2 (already in the values of the table) and at x = 3 pi/2.
"""

from math import atan2, pi, sqrt

from fvsolve.core.kernels.devices import TEMPORARY
from fvsolve.core.kernels.dtypes import RATE, RATE_UNWANTED
from fvsolve.core.kernels.restrictions import LEAST, head_drop
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.core.kernels.self_acting_valves import event_pair
from fvsolve.jit import njit
from fvsolve.parts.pump import law_energy
from fvsolve.parts.self_acting.law_check_valve import PRESSURE_MARGIN

CHORD_CHANGE = 1e-9  # relative change of flow below which the tangent replaces the chord

POWER, POINTS, POLYNOMIAL, SUTER = 0, 1, 2, 3  # laws of head curves
# Numbers of a curve: law, count, first, last, a', b', scale of flows, offset of the joined table (0 without a table).
# Then, from OWN on: a, b, c | flows, heads | coefficients | rated head, rated flow and WH.
LAW, COUNT, FIRST, LAST, TAIL_HEAD, TAIL, SCALE, JOIN, OWN = 0, 1, 2, 3, 4, 5, 6, 7, 8
# Numbers of a joined table: rated head, rated flow, count of values, atan2(v, n) of the last flow, then the correction
# of WH there, and WH. The numbers of WB have the last two as well.
RATED_HEAD, RATED_FLOW, VALUES, EDGE, CORRECTION = 0, 1, 2, 3, 4


@njit
def piecewise(floats, at, count, x):
    """(value, slope) of a piecewise linear function at x; floats[at:] : `count` abscissas, then `count` values"""
    k = 1
    while k < count - 1 and x > floats[at + k]:
        k += 1
    slope = (floats[at + count + k] - floats[at + count + k - 1]) / (
        floats[at + k] - floats[at + k - 1]
    )
    return floats[at + count + k] + slope * (x - floats[at + k]), slope


@njit
def base_head(floats, at, x):
    """(head [m], its slope over the flow [s/m2]) of a curve at rated speed and flow x [m3/s].

    floats[at:] : parameters of the curve; x : between its first and last flow
    """
    own, count = at + OWN, int(floats[at + COUNT])
    if floats[at + LAW] == POWER:
        part, exponent = floats[own + 1] * x ** floats[own + 2], floats[own + 2]
        if exponent == 1.0:  # a straight curve may begin at no flow
            return floats[own] - part, -floats[own + 1]
        return floats[own] - part, -exponent * part / x
    if floats[at + LAW] == POINTS:
        return piecewise(floats, own, count, x)
    head, slope = 0.0, 0.0
    for k in range(count - 1, -1, -1):
        slope = slope * x + head
        head = head * x + floats[own + k]
    return head, slope


@njit
def suter_value(floats, at, count, speed, flow):
    """(w, dw/d(flow)) with w = W (speed^2 + flow^2), where W is a Suter function, such as WH or WB.

    floats[at:] : `count` values of W at equal intervals of x = pi + atan2(flow, speed) from 0 to 2 pi
    speed, flow : relative to rated values
    """
    square = speed * speed + flow * flow
    place = (pi + atan2(flow, speed)) / (2.0 * pi) * (count - 1)
    k = min(int(place), count - 2)
    rise = floats[at + k + 1] - floats[at + k]
    value = floats[at + k] + (place - k) * rise
    return square * value, 2.0 * flow * value + speed * rise * (count - 1) / (2.0 * pi)


@njit
def is_off_curve(floats, at, speed, flow):
    """True if a pump with a joined Suter table works outside its head curve.

    floats[at:] : parameters of the curve; speed : relative speed; flow : [m3/s]
    """
    return floats[at + JOIN] > 0.0 and not (
        speed > 0.0 and 0.0 <= flow <= speed * floats[at + LAST]
    )


@njit
def joined_value(floats, join, correction_at, speed, flow):
    """Results of `suter_value` for a joined table with its correction at the last flow of the curve.

    join : index of the parameters of the joined table in `floats`
    correction_at : index of the correction, after which the values of the table follow
    speed, flow : relative to rated values
    """
    value, slope = suter_value(floats, correction_at + 1, int(floats[join + VALUES]), speed, flow)
    angle = atan2(flow, speed)
    edge = floats[join + EDGE]
    fade = 0.0
    steep = 0.0
    if edge <= angle < 0.5 * pi:
        steep = -floats[correction_at] / (0.5 * pi - edge)
        fade = steep * (angle - 0.5 * pi)
    return value + (speed * speed + flow * flow) * fade, slope + 2.0 * flow * fade + speed * steep


@njit
def curve_head(floats, at, speed, flow):
    """(head [m], its slope over the flow [s/m2]) of a pump at a relative speed and a flow [m3/s].

    floats[at:] : parameters of its head curve
    """
    if is_off_curve(floats, at, speed, flow):
        join = at + int(floats[at + JOIN])
        head, rated = floats[join + RATED_HEAD], floats[join + RATED_FLOW]
        value, slope = joined_value(floats, join, join + CORRECTION, speed, flow / rated)
        return head * value, head / rated * slope
    if floats[at + LAW] == SUTER:
        head, rated = floats[at + OWN], floats[at + OWN + 1]
        value, slope = suter_value(
            floats, at + OWN + 2, int(floats[at + COUNT]), speed, flow / rated
        )
        return head * value, head / rated * slope
    n, tail = max(speed, 0.0), floats[at + TAIL]
    first, last = n * floats[at + FIRST], n * floats[at + LAST]
    if flow >= last or n == 0.0:
        return n * n * floats[at + TAIL_HEAD] - tail * abs(flow) * flow, -2.0 * tail * abs(flow)
    head, slope = base_head(floats, at, max(flow, first) / n)
    head, slope = n * n * head, n * slope
    if flow >= first:
        return head, slope
    if first > 0.0 and flow < -first:  # the line only smooths the curve near no flow
        return head - 2.0 * slope * first + tail * flow * flow, 2.0 * tail * flow
    return head + slope * (flow - first) + tail * min(flow, 0.0) ** 2, slope - 2.0 * tail * abs(
        min(flow, 0.0)
    )


@njit
def curve_flow(floats, at, speed, head, flow):
    """Flow [m3/s] at which a pump has a head [m] at a relative speed, by Newton's method with bounds.

    floats[at:] : parameters of its head curve; flow : start value [m3/s]
    """
    low = -1e300
    high = 1e300
    scale = floats[at + SCALE]
    for _ in range(200):
        value, slope = curve_head(floats, at, speed, flow)
        if abs(value - head) <= 4e-16 * (abs(value) + abs(head)):
            return flow
        if value > head:
            low = flow
        else:
            high = flow
        reach = 4.0 * (abs(flow) + scale)
        step = (
            max(-reach, min(reach, (value - head) / -slope))
            if slope < 0.0
            else (reach if value > head else -reach)
        )
        next_flow = flow + step
        if min(abs(step), high - low) <= 2e-16 * (abs(flow) + 1e-6 * scale):
            return next_flow
        if not low < next_flow < high:
            next_flow = 0.5 * (low + high)
        flow = next_flow
    return flow


@njit
def curve_step(floats, at, speed, rho, weight, g, m, drop):
    """(a [kg/s], s [kg/s/Pa]) of the next Newton step dM = a + s d(drop) of a pump, M the mass flow.

    The chord of the curve between the present flow and the flow at the drop replaces the slope. As for a restriction of
    conductance g, s is at most sqrt(g) / LEAST.
    floats[at:] : parameters of the head curve; speed : relative speed
    rho, weight : density [kg/m3] and rho g [N/m3] of the fluid
    g : conductance [kg2/s2/Pa]; m : present mass flow [kg/s]; drop : drop across the pump [Pa]
    """
    head, slope = curve_head(floats, at, speed, m / rho)
    residual = drop + weight * head
    chord = -slope * weight / rho
    change = rho * curve_flow(floats, at, speed, -drop / weight, m / rho) - m
    if abs(change) > CHORD_CHANGE * (abs(m) + rho * floats[at + SCALE]):
        chord = residual / change
    chord = max(chord, LEAST / sqrt(g))
    return residual / chord, 1.0 / chord


# Numbers of a pump: mode of its speed; 1 with a check valve; schedule of the trip; relative speed at which the shaft
# begins to run free; J times rated speed [N m s]; unbalanced torque and torque of the fluid at the start [N m]; rated
# speed [rad/s]; number of points of P, or rated torque of a Suter table; number of given torques; 1 if the shaft power
# is known; offset of the numbers of `law_energy`, which are last. Then pairs (schedule, value at the start) of given
# torques, then the points of P (flows, then powers) or WB. With a joined table, these follow P: rated torque,
# correction of WB at the last flow, and WB.
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
    ENERGY,
    OWN_NUMBERS,
) = range(13)
HELD_SPEED, TRIPPING, TORQUE_DRIVEN = 0, 1, 2  # modes
# bound of d(torque) / d(speed) of a Suter table, over the rated torque and n + v
MAX_TORQUE_SLOPE = 8.0
BAR, FLOW_ROUNDING = 1e5, 1e-9  # flow regarded as zero, over the flow at 1 bar
OUTSIDE = 1e-6  # tolerance of the range of the curve, over its flow scale


@njit
def tripped(t, tables, device):
    """True if the motor no longer holds the speed at time t; False at the end of a time step that ends at the trip."""
    return schedule_value(tables, int(tables.floats[device["data"] + TRIP]), t) > 0.0


@njit
def pump_speed(t, y, tables, device):
    """Speed of the shaft at time t, relative to its rated speed [-]."""
    floats, at = tables.floats, device["data"]
    mode = floats[at + MODE]
    if mode == HELD_SPEED or (mode == TRIPPING and not tripped(t, tables, device)):
        return schedule_value(tables, device["schedule"], t)
    return floats[at + START_SPEED] + y[device["y"]]


@njit
def set(t, y, out, tables, device):
    """Write to `out` the relative speed of the pump and its conductance, 0 while its check valve is shut."""
    layout = tables.layout[0]
    k = device["valve"]
    floats = tables.floats
    shut = floats[device["data"] + CHECK] > 0.0 and tables.armed[device["event"]] > 0.0
    out[layout["drive"] + k] = pump_speed(t, y, tables, device)
    out[layout["conductance"] + k] = 0.0 if shut else tables.valves[k]["conductance"]


@njit
def pump_point(out, tables, device):
    """(relative speed [-], flow [m3/s], density [kg/m3] of the fluid) of a pump, after the nodes are solved."""
    layout, k = tables.layout[0], device["valve"]
    rho, _ = head_drop(tables, out, k)
    return out[layout["drive"] + k], out[layout["valve"] + k] / rho, rho


@njit
def pump_torque(out, tables, device):
    """Torque of the fluid on the shaft [N m], positive against the rotation."""
    n, q, rho = pump_point(out, tables, device)
    curve, dense = tables.valves[device["valve"]]["data"], rho / tables.settings[0]["rho"]
    return fluid_torque(tables.floats, device["data"], curve, n, q, dense)


@njit
def fluid_torque(floats, at, curve, n, q, dense):
    """Torque of the fluid on the shaft [N m], positive against the rotation.

    at, curve : indices of the parameters of the pump and of its head curve in `floats`
    n : relative speed; q : flow [m3/s]; dense : density of the fluid over reference density
    """
    table = at + OWN_NUMBERS + 2 * int(floats[at + TORQUE_COUNT])
    if floats[curve + LAW] == SUTER:
        rated = dense * floats[at + COUNT_OR_TORQUE]
        return (
            rated
            * suter_value(
                floats, table, int(floats[curve + COUNT]), n, q / floats[curve + OWN + 1]
            )[0]
        )
    count = int(floats[at + COUNT_OR_TORQUE])
    if is_off_curve(floats, curve, n, q):
        join, own = curve + int(floats[curve + JOIN]), table + 2 * count
        return (
            dense
            * floats[own]
            * joined_value(floats, join, own + 1, n, q / floats[join + RATED_FLOW])[0]
        )
    if n <= 0.0:
        return 0.0
    place = max(floats[table], min(floats[table + count - 1], q / n))
    return dense * n * n * piecewise(floats, table, count, place)[0] / floats[at + RATED]


@njit
def move(t, y, dydt, out, tables, device):
    """Write the rates of a free shaft and of the electric energy to `dydt`; raise out[RATE] to that of the shaft."""
    floats, at = tables.floats, device["data"]
    mode = floats[at + MODE]
    first = 0 if mode == HELD_SPEED else 1
    if device["states"] > first:
        per, e, q = electric_energy(out, tables, device)
        price = schedule_value(
            tables, int(floats[at + int(floats[at + ENERGY]) + law_energy.PRICE]), t
        )
        law_energy.rates(per, e, q, price, dydt, device["y"] + first)
    if mode == HELD_SPEED:
        return
    if mode == TRIPPING and not tripped(t, tables, device):
        dydt[device["y"]] = 0.0
        return
    torque = pump_torque(out, tables, device)
    if out[RATE] != RATE_UNWANTED:
        out[RATE] = max(out[RATE], shaft_rate(out, tables, device, torque))
    push = -torque
    if mode == TORQUE_DRIVEN:
        push = (
            floats[at + OFFSET]
            - (torque - floats[at + TORQUE])
            + given_torque(t, tables, device, True)
        )
    dydt[device["y"]] = push / floats[at + INERTIA]


@njit
def given_torque(t, tables, device, change):
    """Sum of the torques on the shaft that the case gives [N m]; if `change` is True, minus their sum at the start."""
    floats, total = tables.floats, 0.0
    for k in range(int(floats[device["data"] + TORQUE_COUNT])):
        own = device["data"] + OWN_NUMBERS + 2 * k
        total += schedule_value(tables, int(floats[own]), t) - (floats[own + 1] if change else 0.0)
    return total


@njit
def shaft_rate(out, tables, device, torque):
    """Upper bound of the rate [1/s] at which the fluid brakes a free shaft; torque : torque of the fluid [N m]"""
    floats = tables.floats
    at = device["data"]
    curve = tables.valves[device["valve"]]["data"]
    n, q, _ = pump_point(out, tables, device)
    if floats[curve + LAW] == SUTER or floats[curve + JOIN] > 0.0:
        rated = floats[at + COUNT_OR_TORQUE]
        if floats[curve + JOIN] > 0.0:
            rated = floats[at + OWN_NUMBERS + 2 * (int(floats[at + TORQUE_COUNT]) + int(rated))]
        return (
            MAX_TORQUE_SLOPE
            * abs(rated / floats[at + INERTIA])
            * (abs(n) + abs(q / floats[curve + SCALE]))
        )
    return 3.0 * abs(torque / (n * floats[at + INERTIA])) if n > 0.0 else 0.0


@njit
def power(t, y, dydt, out, tables, device):
    """(power supplied to the shaft, rate of its kinetic energy, power that the fluid takes from it) [W].

    All are 0 if the shaft power is unknown.
    """
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
    """Kinetic energy of a free shaft minus that at the moment at which it becomes free [J]; 0 for a given speed."""
    floats, at = tables.floats, device["data"]
    if floats[at + MODE] == HELD_SPEED:
        return 0.0
    n = y[device["y"]]
    return (
        0.5 * floats[at + INERTIA] * floats[at + RATED] * n * (2.0 * floats[at + START_SPEED] + n)
    )


@njit
def reversal_margin(valve):
    """Reverse mass flow [kg/s] up to which the check valve of a pump stays open; valve : row of the pump

    A check valve without flow, next to a shut valve, thus stays open.
    """
    return FLOW_ROUNDING * sqrt(BAR * valve["conductance"])


@njit
def events(t, y, out, tables, device, g):
    """Write the event function of the check valve and its negative to g.

    While the valve is open, it is the flow plus `reversal_margin` [kg/s]. While the valve is shut, it is the drop
    minus that at which the valve opens [Pa]. Both functions are 1 for a pump without check valve.
    """
    layout = tables.layout[0]
    k = device["valve"]
    at = device["event"]
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
    """Head [m] (quantity 0), relative speed (1), torque of the fluid [N m] (2), power at the shaft [W] (3).

    Quantity 4 is the electric power [W], and 5 that of this pump and all next ones.
    """
    floats = tables.floats
    n, q, _ = pump_point(out, tables, device)
    if quantity >= 4:
        per, _, flow = electric_energy(out, tables, device)
        total, k = per * flow, next_pump(tables, device) if quantity == 5 else -1
        while k >= 0:
            per, _, flow = electric_energy(out, tables, tables.devices[k])
            total += per * flow
            k = next_pump(tables, tables.devices[k])
        return total
    if quantity == 0:
        return curve_head(floats, tables.valves[device["valve"]]["data"], n, q)[0]
    if quantity == 1:
        return n
    torque = pump_torque(out, tables, device)
    return torque if quantity == 2 else torque * n * floats[device["data"] + RATED]


@njit
def next_pump(tables, device):
    """Index of the device of the next pump, -1 after the last."""
    at = device["data"] + int(tables.floats[device["data"] + ENERGY])
    return int(tables.floats[at + law_energy.NEXT])


@njit
def electric_energy(out, tables, device):
    """(electric energy per volume [J/m3], overall efficiency, size of the flow [m3/s]) of a pump, see `law_energy`."""
    floats, at = tables.floats, device["data"] + int(tables.floats[device["data"] + ENERGY])
    n, q, rho = pump_point(out, tables, device)
    head = curve_head(floats, tables.valves[device["valve"]]["data"], n, q)[0]
    per, e = law_energy.energy_per_volume(
        floats, at, n, q, head, rho * tables.settings[0]["gravity"]
    )
    return per, e, abs(q)


@njit
def outside(out, tables, device):
    """1 if the pump works outside its head curve, at reverse flow or beyond the last flow; 0 on its curve.

    It is always 0 for a pump with only a Suter table.
    Outside the curve it is TEMPORARY instead of 1 if a Suter table is joined to the curve, or while a pump with a check
    valve runs down: it is slower than at the start, and its forward flow is within the curve at the initial speed.
    """
    floats, curve = tables.floats, tables.valves[device["valve"]]["data"]
    if floats[curve + LAW] == SUTER:
        return 0
    n, q, _ = pump_point(out, tables, device)
    slack = OUTSIDE * floats[curve + SCALE]
    last = floats[curve + LAST]
    begun = tables.valves[device["valve"]]["drive"]
    if -slack <= q <= max(n, 0.0) * last + slack:
        return 0
    if floats[curve + JOIN] > 0.0:
        return TEMPORARY
    down = floats[device["data"] + CHECK] > 0.0 and n < begun and 0.0 < q <= begun * last
    return TEMPORARY if down else 1


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """(a [kg/s], s [kg/s/Pa]) of `curve_step` for pump k; arguments as for `restriction_step`.

    The drop of head, times rho g with the upstream density, replaces `drop`.
    """
    rho, fall = head_drop(tables, out, k)
    return pump_step(tables, out, k, rho, g, m, fall)


@njit
def slope(out, tables, k, g, drop):
    """Derivative [kg/s/Pa] of the mass flow of pump k by its drop; 0 while its check valve is shut.

    g : conductance [kg2/s2/Pa]; drop : [Pa]
    """
    m = out[tables.layout[0]["valve"] + k]
    return pump_step(tables, out, k, tables.settings[0]["rho"], g, m, drop)[1] if g > 0.0 else 0.0


@njit
def pump_step(tables, out, k, rho, g, m, drop):
    """(a, s) of `curve_step` for pump k at its present speed, with fluid of density rho [kg/m3].

    g, m, drop : as for `curve_step`
    """
    at, speed = tables.valves[k]["data"], out[tables.layout[0]["drive"] + k]
    return curve_step(
        tables.floats, at, speed, rho, rho * tables.settings[0]["gravity"], g, m, drop
    )
