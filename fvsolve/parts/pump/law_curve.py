"""Head curves of pumps at any speed.

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

from fvsolve.jit import njit
from fvsolve.kernels.restrictions import LEAST

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
    slope = (floats[at + count + k] - floats[at + count + k - 1]) / (floats[at + k] - floats[at + k - 1])
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
    square, place = speed * speed + flow * flow, (pi + atan2(flow, speed)) / (2.0 * pi) * (count - 1)
    k = min(int(place), count - 2)
    rise = floats[at + k + 1] - floats[at + k]
    value = floats[at + k] + (place - k) * rise
    return square * value, 2.0 * flow * value + speed * rise * (count - 1) / (2.0 * pi)


@njit
def is_off_curve(floats, at, speed, flow):
    """True if a pump with a joined Suter table works outside its head curve.

    floats[at:] : parameters of the curve; speed : relative speed; flow : [m3/s]
    """
    return floats[at + JOIN] > 0.0 and not (speed > 0.0 and 0.0 <= flow <= speed * floats[at + LAST])


@njit
def joined_value(floats, join, correction_at, speed, flow):
    """Results of `suter_value` for a joined table with its correction at the last flow of the curve.

    join : index of the parameters of the joined table in `floats`
    correction_at : index of the correction, after which the values of the table follow
    speed, flow : relative to rated values
    """
    value, slope = suter_value(floats, correction_at + 1, int(floats[join + VALUES]), speed, flow)
    angle, edge, fade, steep = atan2(flow, speed), floats[join + EDGE], 0.0, 0.0
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
        value, slope = suter_value(floats, at + OWN + 2, int(floats[at + COUNT]), speed, flow / rated)
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
    return head + slope * (flow - first) + tail * min(flow, 0.0) ** 2, slope - 2.0 * tail * abs(min(flow, 0.0))


@njit
def curve_flow(floats, at, speed, head, flow):
    """Flow [m3/s] at which a pump has a head [m] at a relative speed, by Newton's method with bounds.

    floats[at:] : parameters of its head curve; flow : start value [m3/s]
    """
    low, high, scale = -1e300, 1e300, floats[at + SCALE]
    for _ in range(200):
        value, slope = curve_head(floats, at, speed, flow)
        if abs(value - head) <= 4e-16 * (abs(value) + abs(head)):
            return flow
        if value > head:
            low = flow
        else:
            high = flow
        reach = 4.0 * (abs(flow) + scale)
        step = max(-reach, min(reach, (value - head) / -slope)) if slope < 0.0 else (reach if value > head else -reach)
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
