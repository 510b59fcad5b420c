"""Head curves of pumps at any speed. Knows one curve and its numbers; knows no network and no pressure.

H = n^2 f(q / n), n the relative speed (affinity). f is a law between two flows `first` and `last` [m3/s] at n = 1:
a - b q^c, straight lines between points, a polynomial. Beyond them it goes on with its slope, before `first` along a
line and beyond `last` along a parabola a' - b' q^2, which is what a pump at rest is too; flow backwards adds b' q^2,
and where `first` is above 0, as it is for a curve that is flat at no flow, the line ends at as much flow backwards.
With a table of Suter form, H = (n^2 + v^2) WH(pi + atan2(v, n)) [rated heads], v the flow over the rated one.
A curve may have such a table joined to it in place of line and parabolas: outside of 0 <= q <= n `last`, n > 0, where
WH gets what it lacks at either end of the curve, less and less of it until the pump stands, x = pi / 2 (this by the
values of the table already) and 3 pi / 2.
"""

from math import atan2, pi, sqrt

from fvsolve.jit import njit
from fvsolve.kernels.valves import LEAST

NEAR = 1e-9  # change of flow, relative, over which a chord is a tangent

POWER, POINTS, POLYNOMIAL, SUTER = 0, 1, 2, 3  # laws of head curves
# Numbers of a curve: law, how many, first, last, a', b', scale of flows, at which of them those of what is joined
# begin, 0 where nothing is, then a, b, c | flows, heads | coefficients | rated head, rated flow and WH. Those of a law
# begin at OWN.
LAW, COUNT, FIRST, LAST, TAIL_HEAD, TAIL, SCALE, JOIN, OWN = 0, 1, 2, 3, 4, 5, 6, 7, 8
# Numbers of what is joined: rated head, rated flow, values of the table, atan2(v, n) of the last flow, then what WH
# lacks there, and WH. WB has these two likewise.
RATED_HEAD, RATED_FLOW, VALUES, EDGE, LACKS = 0, 1, 2, 3, 4


@njit
def piecewise(floats, at, count, x):
    """(value, slope) of straight lines between points : count places, then count values."""
    k = 1
    while k < count - 1 and x > floats[at + k]:
        k += 1
    slope = (floats[at + count + k] - floats[at + count + k - 1]) / (floats[at + k] - floats[at + k - 1])
    return floats[at + count + k] + slope * (x - floats[at + k]), slope


@njit
def base_head(floats, at, x):
    """(head [m], slope [s/m2]) at rated speed and a flow x between `first` and `last`."""
    own, count = at + OWN, int(floats[at + COUNT])
    if floats[at + LAW] == POWER:
        part = floats[own + 1] * x ** floats[own + 2]
        return floats[own] - part, -floats[own + 2] * part / x
    if floats[at + LAW] == POINTS:
        return piecewise(floats, own, count, x)
    head, slope = 0.0, 0.0
    for k in range(count - 1, -1, -1):
        slope = slope * x + head
        head = head * x + floats[own + k]
    return head, slope


@njit
def suter_value(floats, at, count, speed, flow):
    """(value, d/d flow) of a Suter function times (speed^2 + flow^2), both over rated; its table covers 0 to 2 pi."""
    square, place = speed * speed + flow * flow, (pi + atan2(flow, speed)) / (2.0 * pi) * (count - 1)
    k = min(int(place), count - 2)
    rise = floats[at + k + 1] - floats[at + k]
    value = floats[at + k] + (place - k) * rise
    return square * value, 2.0 * flow * value + speed * rise * (count - 1) / (2.0 * pi)


@njit
def leaves(floats, at, speed, flow):
    """Whether a pump is outside its curve where a table is joined to it."""
    return floats[at + JOIN] > 0.0 and not (speed > 0.0 and 0.0 <= flow <= speed * floats[at + LAST])


@njit
def joined_value(floats, join, lacks, speed, flow):
    """`suter_value`, at a flow over the rated one, of what stands at `lacks`: a lack at the last flow, and a table."""
    value, slope = suter_value(floats, lacks + 1, int(floats[join + VALUES]), speed, flow)
    angle, edge, fade, steep = atan2(flow, speed), floats[join + EDGE], 0.0, 0.0
    if edge <= angle < 0.5 * pi:
        steep = -floats[lacks] / (0.5 * pi - edge)
        fade = steep * (angle - 0.5 * pi)
    return value + (speed * speed + flow * flow) * fade, slope + 2.0 * flow * fade + speed * steep


@njit
def curve_head(floats, at, speed, flow):
    """(head [m], its slope over flow [s/m2]) of the curve at `at` at a relative speed and a flow [m3/s]."""
    if leaves(floats, at, speed, flow):
        join = at + int(floats[at + JOIN])
        head, rated = floats[join + RATED_HEAD], floats[join + RATED_FLOW]
        value, slope = joined_value(floats, join, join + LACKS, speed, flow / rated)
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
    if first > 0.0 and flow < -first:  # a line that only softens the curve near no flow ends there
        return head - 2.0 * slope * first + tail * flow * flow, 2.0 * tail * flow
    return head + slope * (flow - first) + tail * min(flow, 0.0) ** 2, slope - 2.0 * tail * abs(min(flow, 0.0))


@njit
def curve_flow(floats, at, speed, head, flow):
    """The flow [m3/s] at which the curve has a head [m], by safeguarded Newton from `flow`."""
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
        new = flow + step
        if min(abs(step), high - low) <= 2e-16 * (abs(flow) + 1e-6 * scale):
            return new
        if not low < new < high:
            new = 0.5 * (low + high)
        flow = new
    return flow


@njit
def curve_step(floats, at, speed, rho, weight, g, m, drop):
    """a, s with dM = a + s d(drop) for the next Newton step of a pump that carries m [kg/s] at a drop [Pa].

    The chord of its curve between the flow now and the flow that the drop asks for stands for its slope, and is no
    flatter than that of a restriction of conductance g. rho, weight : density and rho g there.
    """
    head, slope = curve_head(floats, at, speed, m / rho)
    rest = drop + weight * head
    chord = -slope * weight / rho
    change = rho * curve_flow(floats, at, speed, -drop / weight, m / rho) - m
    if abs(change) > NEAR * (abs(m) + rho * floats[at + SCALE]):
        chord = rest / change
    chord = max(chord, LEAST / sqrt(g))
    return rest / chord, 1.0 / chord
