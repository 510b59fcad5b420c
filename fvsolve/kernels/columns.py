"""Rigid columns: one flow each, and what stops it. Knows columns and the valves at their ends; solves no node.

A column that leads to a node without storage is held by that node's valves alone. Where these are all but shut
(below a thousandth of their full area), its time constant goes to zero with their area F, and its flow follows them:
I = sum of F sqrt(dP), with (L / A) dI/dt = (L / A) sum of dF/dt sqrt(dP) the pressure that slows it down. When the
last of them shuts, nothing can flow: the column stands, and the node has the pressure of its other end.

A column follows a disc that leaves its seat and alone holds it, too: lift x and flow start as powers of time, and
dP = M^2 / (G x^2), of 0 / 0 there, would relax at an infinite rate. Until x has grown, dP is what drives both,
(L / A) sqrt(G dP) dx/dt(dP) + dP = that at rest; the column's momentum is kept.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.devices.codes import RELIEF_DISC
from fvsolve.kernels.devices.disc import disc_speed, leads
from fvsolve.kernels.friction import drag
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import (
    I_COLUMNS,
    I_DEVICES,
    I_INTEGERS,
    I_LAYOUT,
    I_NODES,
    I_SETTINGS,
    I_VALVES,
    JUNCTION,
    RATE,
)
from fvsolve.kernels.restrictions import conductance, conductance_at, restriction_slope

NEARLY = 1e-3  # share of their full area below which valves lead their column
INSTANT = 1e-7  # over which the rate of an area is measured [s]


@njit
def gate_area(tables, out, i):
    """(sum of the roots of the conductances of a node's valves, the same at full opening)."""
    node, area, full = tables[I_NODES][i], 0.0, 0.0
    for e in range(node["gate_count"]):
        k = tables[I_INTEGERS][node["gates"] + e]
        area += sqrt(conductance(tables, out, k))
        full += sqrt(tables[I_VALVES][k]["conductance"])
    return area, full


@njit
def led_at(tables, out, i):
    """Whether node i is the end of one column whose every valve is all but shut, and asks for nothing."""
    if tables[I_NODES][i]["gates"] < 0:
        return False
    area, full = gate_area(tables, out, i)
    return area == 0.0 or (area < NEARLY * full and foreseen(tables, i))


@njit
def foreseen(tables, i):
    """Whether the rate of area of node i's valves is known: schedules alone move them, or it is one disc that leads."""
    node = tables[I_NODES][i]
    for e in range(node["gate_count"]):
        k = tables[I_INTEGERS][node["gates"] + e]
        if tables[I_VALVES][k]["device"] >= 0 and not leads(tables, k):
            return False
    return True


@njit
def led_end(tables, out, k):
    """1 or -1 where valves lead column k at its `to` or `from` end, else 0."""
    column = tables[I_COLUMNS][k]
    if led_at(tables, out, column["to_node"]):
        return 1
    return -1 if led_at(tables, out, column["from_node"]) else 0


@njit
def pressure_at(tables, out, i, extra, solved):
    """p' of node i; of a junction, until nodes are `solved`, a guess from what its pipes and `extra` [kg/s] bring."""
    layout, node = tables[I_LAYOUT][0], tables[I_NODES][i]
    if node["kind"] != JUNCTION or solved:
        return out[layout["pressure"] + i]
    return (out[layout["net"] + i] + extra) / node["admittance"] if node["admittance"] > 0.0 else 0.0


@njit
def standing_pressure(tables, out, k, end, solved):
    """p' of the led end of column k at which nothing drives it."""
    column = tables[I_COLUMNS][k]
    i = column["from_node"] if end == 1 else column["to_node"]
    p = pressure_at(tables, out, i, end * column["flow"], solved)
    return p + end * (column["offset"] + column["drag"] * column["length"] / column["area"])


@njit
def disc_drop(y, tables, device, before, drop, slack, heavy):
    """(drop across a disc that leads its column, dx/dt), by Newton on its root r: r2 + heavy r dx/dt(r2) = drop.

    drop : where nothing moves; slack : what it feels for a drop of 1 Pa more; heavy : (L / A) sqrt(G). From above: the
    cubic is convex from its greatest root on.
    """
    still, slope = disc_speed(y, tables, device, before, drop)
    if drop <= 0.0 or still == 0.0:
        return drop, still
    r, slope, speed = sqrt(drop), slope * slack, still
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
def lone_disc(tables, i):
    """The disc that alone holds the column of node i and leads it; -1 for none."""
    k = tables[I_INTEGERS][tables[I_NODES][i]["gates"]]
    return k if leads(tables, k) else -1


@njit
def led_by_disc(y, tables, out, k, which, standing, other, still):
    """(drop across the disc `which` that leads column k, dx/dt), at p' beside it and a drop where nothing moves."""
    valve, column = tables[I_VALVES][which], tables[I_COLUMNS][k]
    device, heavy = tables[I_DEVICES][valve["device"]], column["length"] / column["area"] * sqrt(valve["conductance"])
    if valve["from_node"] == column["from_node"] or valve["from_node"] == column["to_node"]:
        return disc_drop(y, tables, device, standing, still, 1.0, heavy)
    return disc_drop(y, tables, device, other, still, 0.0 if device["kind"] == RELIEF_DISC else 1.0, heavy)


@njit
def led_from_rest(y, tables, out, k, end, which, solved):
    """`led_flow` of a column that one disc holds."""
    valve, column = tables[I_VALVES][which], tables[I_COLUMNS][k]
    side = 1.0 if valve["from_node"] == (column["to_node"] if end == 1 else column["from_node"]) else -1.0
    standing = standing_pressure(tables, out, k, end, solved)
    other = pressure_at(tables, out, valve["to_node"] if side > 0.0 else valve["from_node"], 0.0, solved)
    still = valve["drop"] + side * (standing - other)
    drop, speed = led_by_disc(y, tables, out, k, which, standing, other, still)
    root = side * (sqrt(drop) if drop >= 0.0 else -sqrt(-drop))
    rate = speed * sqrt(valve["conductance"]) * root if drop > 0.0 else 0.0
    return sqrt(conductance(tables, out, which)) * root, rate, standing + side * (drop - still)


@njit
def led_flow(t, y, tables, out, k, end, solved):
    """(flow out of column k through the valves that lead it, its rate, p' of that end), by damped iteration."""
    nodes, valves, column = tables[I_NODES], tables[I_VALVES], tables[I_COLUMNS][k]
    limit = tables[I_SETTINGS][0]["limit"]
    x = column["to_node"] if end == 1 else column["from_node"]
    if lone_disc(tables, x) >= 0:
        return led_from_rest(y, tables, out, k, end, lone_disc(tables, x), solved)
    early = t if t + 2.0 * INSTANT <= limit else t - INSTANT  # the rate on this side of a kink
    standing = standing_pressure(tables, out, k, end, solved)
    p, flow, rate = standing, 0.0, 0.0
    for _ in range(100):
        flow, rate = 0.0, 0.0
        for e in range(nodes[x]["gate_count"]):
            which = tables[I_INTEGERS][nodes[x]["gates"] + e]
            valve = valves[which]
            side = 1.0 if valve["from_node"] == x else -1.0
            other = pressure_at(tables, out, valve["to_node"] if side > 0.0 else valve["from_node"], 0.0, solved)
            drop = side * valve["drop"] + p - other
            root = sqrt(abs(drop)) if drop >= 0.0 else -sqrt(abs(drop))
            later = sqrt(conductance_at(early + INSTANT, tables, out, which))
            rate += (later - sqrt(conductance_at(early, tables, out, which))) / INSTANT * root
            flow += sqrt(conductance(tables, out, which)) * root
        new = 0.5 * (p + standing - column["length"] / column["area"] * rate)
        if abs(new - p) <= 1e-12 * (1e5 + abs(new)):
            break
        p = new
    return flow, rate, p


@njit
def column_inflows(t, y, dydt, out, handle):
    """Add what rigid columns carry more than in the profile to out[net]; their flows go to out[column]."""
    tables = open_tables(handle)
    layout, columns = tables[I_LAYOUT][0], tables[I_COLUMNS]
    for k in range(columns.size):
        column, end = columns[k], led_end(tables, out, k)
        change = y[column["y"]]
        if end != 0:
            change = end * led_flow(t, y, tables, out, k, end, False)[0] - column["flow"]
        out[layout["column"] + k] = column["flow"] + change
        out[layout["net"] + column["from_node"]] -= change
        out[layout["net"] + column["to_node"]] += change


@njit
def hold_columns(t, y, dydt, out, handle):
    """Give the node at the shut end of a standing column the pressure that drives no flow through it.

    That of one which a disc leads has what drives disc and column together.
    """
    tables = open_tables(handle)
    pressure = tables[I_LAYOUT][0]["pressure"]
    for k in range(tables[I_COLUMNS].size):
        end = led_end(tables, out, k)
        if end != 0:
            x = tables[I_COLUMNS][k]["to_node"] if end == 1 else tables[I_COLUMNS][k]["from_node"]
            if gate_area(tables, out, x)[0] == 0.0 or lone_disc(tables, x) >= 0:
                out[pressure + x] = led_flow(t, y, tables, out, k, end, True)[2]


@njit
def column_rates(t, y, dydt, out, handle):
    """d/dt of the flow in rigid columns under the linear law."""
    tables = open_tables(handle)
    columns, pressure = tables[I_COLUMNS], tables[I_LAYOUT][0]["pressure"]
    for k in range(columns.size):
        column = columns[k]
        change = out[pressure + column["from_node"]] - out[pressure + column["to_node"]]
        dydt[column["y"]] = column_rate(t, y, tables, out, k, change)


@njit
def column_rate(t, y, tables, out, k, change):
    """d/dt of one column's flow, (A / L) (change of what drives it) - drag'; one that stands or is led, by its valves.

    Where a disc leads it, the pressure beside that tells.
    """
    column, end = tables[I_COLUMNS][k], led_end(tables, out, k)
    x = column["to_node"] if end == 1 else column["from_node"]
    if end != 0 and (lone_disc(tables, x) < 0 or gate_area(tables, out, x)[0] == 0.0):
        return end * led_flow(t, y, tables, out, k, end, True)[1]
    pull = column_drag(column, out[tables[I_LAYOUT][0]["column"] + k])
    return column["area"] / column["length"] * (change + column["offset"]) - (pull - column["drag"])


@njit
def column_drag(column, flow):
    """Friction of a column [kg/s2] at a flow [kg/s]."""
    kind, loss, rough = column["friction"], column["loss"], column["rough"]
    return drag(kind, loss, rough, column["roughness"], column["reynolds"], flow)


@njit
def quickest_column(t, y, dydt, out, handle):
    """Greatest rate [1/s] at which valves alone brake a column, (A / L) dp / dM, into out[RATE]."""
    tables = open_tables(handle)
    layout, nodes, valves = tables[I_LAYOUT][0], tables[I_NODES], tables[I_VALVES]
    for k in range(tables[I_COLUMNS].size):
        column = tables[I_COLUMNS][k]
        for side in range(2):
            i = column["to_node"] if side == 1 else column["from_node"]
            slope = 0.0
            for e in range(nodes[i]["gate_count"]):
                which = tables[I_INTEGERS][nodes[i]["gates"] + e]
                drop = valves[which]["drop"] + out[layout["pressure"] + valves[which]["from_node"]]
                drop -= out[layout["pressure"] + valves[which]["to_node"]]
                slope += restriction_slope(tables, out, which, drop)
            if slope > 0.0 and led_end(tables, out, k) == 0:
                out[RATE] = max(out[RATE], column["area"] / column["length"] / slope)
