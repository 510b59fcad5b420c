"""Rigid columns that valves lead: what flows where these are all but shut. Knows a column and the valves at its end.

A column that leads to a node without storage is held by that node's valves alone. Where these are all but shut
(below a thousandth of their full area), its time constant goes to zero with their area F, and its flow follows them:
I = sum of F sqrt(dP), with (L / A) dI/dt = (L / A) sum of dF/dt sqrt(dP) the pressure that slows it down. When the
last of them shuts, nothing can flow: the column stands, and the node has the pressure of its other end.

A column follows a disc that leaves its seat and alone holds it, too, or the stem of a valve that regulates: lift x
and flow start as powers of time, and dP = M^2 / (G x^2), of 0 / 0 there, would relax at an infinite rate. Until x has
grown, dP is what drives both,
(L / A) sqrt(G dP) dx/dt(dP) + dP = that at rest; the column's momentum is kept.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.calls import call_lead
from fvsolve.kernels.devices import LEAD
from fvsolve.kernels.lead import leads
from fvsolve.kernels.restrictions import conductance, conductance_at
from fvsolve.kernels.rigid import far_side, gate_area, grounded, holds_shut, is_rigid, offset_of, pressure_at

NEARLY = 1e-3  # share of their full area below which valves lead their column
LOST = 0.05  # share of the flow at which valves take the lead, more than is then missed of it
NEAR = 1e-13  # of a pressure, relative, at which it is found
INSTANT = 1e-7  # over which the rate of an area is measured [s]


@njit
def led_at(tables, out, i):
    """Whether node i is the end of one column whose every valve is all but shut or leads, and asks for nothing."""
    node = tables.nodes[i]
    if node["gates"] < 0 or node["columns"] > 1:
        return False
    if node["gate_count"] == 1 and lone_lead(tables, i) >= 0:
        return True
    area, full = gate_area(tables, out, i)
    return area == 0.0 or (area < NEARLY * full and foreseen(tables, out, i))


@njit
def foreseen(tables, out, i):
    """Whether the rate of area of node i's valves is known: schedules move them, one leads, events alone open them."""
    node = tables.nodes[i]
    for e in range(node["gate_count"]):
        k = tables.integers[node["gates"] + e]
        if tables.valves[k]["device"] >= 0 and not leads(tables, k) and not holds_shut(tables, out, k):
            return False
    return True


@njit
def led_side(tables, out, k):
    """1 or -1 where valves lead column k at its `to` or `from` end, else 0; something must hold a rigid far end."""
    column, marks = tables.columns[k], tables.scratch[: tables.nodes.size]
    for side in (1, -1):
        x, i = column["to_node"], column["from_node"]
        if side < 0:
            x, i = i, x
        if led_at(tables, out, x) and (not is_rigid(tables, out, i) or grounded(tables, out, i, k, marks)):
            return side
    return 0


@njit
def lead_columns(tables, out):
    """Which columns their valves lead, into out[led]."""
    at, many = tables.layout[0]["led"], tables.columns.size
    out[at : at + many] = 0.0
    for k in range(many):
        out[at + k] = led_side(tables, out, k)


@njit
def led_end(tables, out, k):
    """1 or -1 where valves lead column k at its `to` or `from` end, else 0."""
    return int(out[tables.layout[0]["led"] + k])


@njit
def standing_pressure(y, tables, out, k, end, solved):
    """(p' of the led end of column k at which nothing drives it, fall of it per d/dt of its flow [Pa s2/kg])."""
    column = tables.columns[k]
    p, softness = far_side(y, tables, out, k, end, solved)
    inertia = column["length"] / column["area"]
    return p + end * (offset_of(tables, out, column) + column["drag"] * inertia), inertia + softness


@njit
def lift_drop(drop, still, slope, heavy):
    """(drop across what leads its column, dx/dt), by Newton on its root r: r2 + heavy r dx/dt(r2) = drop.

    drop : where nothing moves; still : dx/dt there; slope : of it over the drop; heavy : (L / A) sqrt(G). From above:
    the cubic is convex from its greatest root on.
    """
    if drop <= 0.0 or still == 0.0:
        return drop, still
    r, speed = sqrt(drop), still
    while r * r - drop + heavy * r * (still + slope * (r * r - drop)) < 0.0:
        r *= 2.0
    for _ in range(100):
        speed = still + slope * (r * r - drop)
        step = (r * r - drop + heavy * r * speed) / (2.0 * r + heavy * (speed + 2.0 * slope * r * r))
        r -= step
        if abs(step) <= 1e-14 * r:
            break
    return r * r, still + slope * (r * r - drop)


@njit
def lone_lead(tables, i):
    """The valve that alone holds the column of node i and leads it from its seat; -1 for none."""
    k = tables.integers[tables.nodes[i]["gates"]]
    return k if leads(tables, k) else -1


@njit
def led_by_lift(t, y, tables, out, k, which, standing, inertia, other, drop):
    """(drop across the valve `which` that leads column k, dx/dt), at p' beside it and a drop where nothing moves."""
    valve, column = tables.valves[which], tables.columns[k]
    device, heavy = tables.devices[valve["device"]], inertia * sqrt(valve["conductance"])
    ahead = valve["from_node"] == column["from_node"] or valve["from_node"] == column["to_node"]
    before, behind = (standing, other) if ahead else (other, standing)
    still, slope = call_lead(tables.hooks[device["hooks"], LEAD], t, y, tables, device, before, behind, drop, ahead)
    driving, speed = lift_drop(drop, still, slope, heavy)
    if driving <= 0.0 or conductance(tables, out, which) == 0.0 or tables.clock[0]["step"] == 0.0:
        return driving, speed
    way = 1.0 if valve["from_node"] == column["to_node"] or valve["to_node"] == column["from_node"] else -1.0
    root = kept_root(y, tables, out, k, which, way, sqrt(driving), slope, heavy)
    return root * abs(root), still + slope * (root * abs(root) - drop)


@njit
def kept_root(y, tables, out, k, which, way, root, slope, heavy):
    """Root of the drop that a given step keeps: of what drives both, as far as it does not resolve their exchange.

    r = r0 + (M / sqrt(G) - x r0) / max(x, x1), x1 = 2 h 2 r0 (1 / heavy + r0 slope): M relaxes to x sqrt(G) r0 in two
    steps at least, and not sooner than it would. What both share, x / slope + (L / A) M, does not change by it.
    """
    dense, column = tables.valves[which]["conductance"], tables.columns[k]
    x = sqrt(conductance(tables, out, which) / dense)
    own = way * (column["flow"] + y[column["y"]]) / sqrt(dense)
    slow = 4.0 * tables.clock[0]["step"] * root * (1.0 / heavy + root * slope)
    return root + (own - x * root) / max(x, slow)


@njit
def led_from_rest(t, y, tables, out, k, end, which, solved):
    """`led_flow` of a column that one valve leads from its seat."""
    valve, column = tables.valves[which], tables.columns[k]
    side = 1.0 if valve["from_node"] == (column["to_node"] if end == 1 else column["from_node"]) else -1.0
    standing, inertia = standing_pressure(y, tables, out, k, end, solved)
    other = pressure_at(tables, out, valve["to_node"] if side > 0.0 else valve["from_node"], 0.0, solved)
    still = valve["drop"] + side * (standing - other)
    drop, speed = led_by_lift(t, y, tables, out, k, which, standing, inertia, other, still)
    root = side * (sqrt(drop) if drop >= 0.0 else -sqrt(-drop))
    rate = speed * sqrt(valve["conductance"]) * root if drop > 0.0 else 0.0
    return sqrt(conductance(tables, out, which)) * root, rate, standing + side * (drop - still)


@njit
def gate_flow(t, tables, out, x, p, solved):
    """(flow out of node x through its valves at p', its rate as their areas change, d rate / dp)."""
    flow, rate, rise = 0.0, 0.0, 0.0
    for e in range(tables.nodes[x]["gate_count"]):
        which = tables.integers[tables.nodes[x]["gates"] + e]
        drop = p - level_behind(tables, out, x, which, solved)
        root = sqrt(drop) if drop >= 0.0 else -sqrt(-drop)
        later = sqrt(conductance_at(t + INSTANT, tables, out, which))
        widening = (later - sqrt(conductance_at(t, tables, out, which))) / INSTANT
        flow += sqrt(conductance(tables, out, which)) * root
        rate += widening * root
        rise += 0.5 * widening / max(abs(root), 1e-300)
    return flow, rate, rise


@njit
def level_behind(tables, out, x, which, solved):
    """p' of node x at which nothing flows through its valve `which`."""
    valve = tables.valves[which]
    side = 1.0 if valve["from_node"] == x else -1.0
    other = pressure_at(tables, out, valve["to_node"] if side > 0.0 else valve["from_node"], 0.0, solved)
    return other - side * valve["drop"]


@njit
def levels_behind(tables, out, x, solved):
    """(least, greatest) of `level_behind` of all valves of node x."""
    least, most = 1e300, -1e300
    for e in range(tables.nodes[x]["gate_count"]):
        level = level_behind(tables, out, x, tables.integers[tables.nodes[x]["gates"] + e], solved)
        least, most = min(least, level), max(most, level)
    return least, most


@njit
def opening_pressure(t, tables, out, x, standing, inertia, solved):
    """p' of node x whose valves open: the one root of p - standing + inertia rate(p), by Newton between bounds."""
    low, high = levels_behind(tables, out, x, solved)
    low, high, p = min(low, standing), max(high, standing), standing
    for _ in range(200):
        _, rate, rise = gate_flow(t, tables, out, x, p, solved)
        left = p - standing + inertia * rate
        low, high = (low, p) if left > 0.0 else (p, high)
        new = p - left / (1.0 + inertia * rise)
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - p) <= NEAR * (1e5 + abs(new)):
            return new
        p = new
    return p


@njit
def braked_pressure(t, tables, out, x, way, start, standing, inertia, solved):
    """(p' of node x whose valves shut on a flow that way, 1: out of it; whether there is one), by Newton from beyond.

    p - standing + inertia rate(p) is convex there, and its outermost root is the one to which flows tend.
    """
    p = start
    for _ in range(200):
        flow, rate, rise = gate_flow(t, tables, out, x, p, solved)
        slope = 1.0 + inertia * rise
        if slope <= 0.0 or flow * way <= 0.0:
            return p, False
        step = (p - standing + inertia * rate) / slope
        p -= step
        if abs(step) <= NEAR * (1e5 + abs(p)):
            break
    return p, True


@njit
def led_pressure(t, tables, out, x, own, standing, inertia, solved):
    """p' of node x whose valves lead a column that brings `own` [kg/s].

    Shutting valves brake a flow either way: of two that they allow, it is the one that has been there.
    """
    flow, rate, _ = gate_flow(t, tables, out, x, standing, solved)
    if flow == 0.0 and rate == 0.0:
        return standing
    if rate * flow >= 0.0:
        return opening_pressure(t, tables, out, x, standing, inertia, solved)
    brake = -inertia * rate / flow * gate_area(tables, out, x)[0]
    way = 1.0 if own > 0.0 or (own == 0.0 and flow > 0.0) else -1.0
    least, most = levels_behind(tables, out, x, solved)
    reach = brake + sqrt(max(abs(standing - least), abs(standing - most)))
    for _ in range(2):
        start = most + reach * reach if way > 0.0 else least - reach * reach
        p, found = braked_pressure(t, tables, out, x, way, start, standing, inertia, solved)
        if found:
            return p
        way = -way
    return standing


@njit
def led_rate(t, y, tables, out, k, end):
    """d/dt of the flow out of column k as its valves lead it; its state keeps the way it went to the last.

    The state misses what was lost when they took the lead, about a hundredth: below LOST of it, it fades, not turns.
    """
    flow, rate, _ = led_flow(t, y, tables, out, k, end, True)
    column = tables.columns[k]
    if rate * flow >= 0.0:
        return rate
    area, full = gate_area(tables, out, column["to_node"] if end == 1 else column["from_node"])
    least = -LOST * NEARLY * full * column["length"] / column["area"] * rate / flow * area
    return rate * min(1.0, abs(column["flow"] + y[column["y"]]) / least)


@njit
def led_flow(t, y, tables, out, k, end, solved):
    """(flow out of column k through the valves that lead it, its rate, p' of that end)."""
    column, limit = tables.columns[k], tables.clock[0]["limit"]
    x = column["to_node"] if end == 1 else column["from_node"]
    if lone_lead(tables, x) >= 0:
        return led_from_rest(t, y, tables, out, k, end, lone_lead(tables, x), solved)
    early = t if t + 2.0 * INSTANT <= limit else t - INSTANT  # the rate on this side of a kink
    standing, inertia = standing_pressure(y, tables, out, k, end, solved)
    own = end * (column["flow"] + y[column["y"]])
    p = led_pressure(early, tables, out, x, own, standing, inertia, solved)
    flow, rate, _ = gate_flow(early, tables, out, x, p, solved)
    return flow, rate, p
