"""What restrictions carry now: their conductances, and a Newton step of each law. Knows the tables; closes no node."""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.curves import curve_step
from fvsolve.kernels.density import density, enthalpy
from fvsolve.kernels.emitters import emitter_slope, emitter_step, rule_of
from fvsolve.kernels.records import CURVE, LAW_LINEAR, LIFT, POWER, TWO_WAY
from fvsolve.kernels.valves import LEAST, flow_at_drop, flow_slope, transition_of, valve_conductance, valve_step


@njit(forceinline=True)
def open_scheduled(t, out, tables):
    """Conductances of the restrictions that no device opens and shuts, into out[conductance]."""
    valves, at = tables.valves, tables.layout[0]["conductance"]
    for k in range(valves.size):
        if valves[k]["device"] < 0:
            out[at + k] = valve_conductance(tables, k, t)


@njit(forceinline=True)
def conductance(tables, out, k):
    """Conductance of restriction k now, 0 where it is shut [kg2/s2/Pa]."""
    return out[tables.layout[0]["conductance"] + k]


@njit
def conductance_at(t, tables, out, k):
    """The same at another time near by; what a device does is not foreseen."""
    return valve_conductance(tables, k, t) if tables.valves[k]["device"] < 0 else conductance(tables, out, k)


@njit
def restriction_step(tables, out, k, g, m, drop, wide):
    """a, s with dM = a + s d(drop) for the next Newton step of restriction k, which carries m [kg/s] at a drop [Pa].

    g : its conductance now, above zero. wide : as of `lift_of`.
    """
    valve = tables.valves[k]
    if valve["law"] == POWER:
        return emitter_step(tables.floats, valve["data"], g, m, drop, rule_of(tables, k))
    if valve["law"] == CURVE:
        rho = tables.settings[0]["rho"]
        return pump_step(tables, out, k, rho, g, m, drop)
    if valve["law"] == LIFT and is_lifting(tables, k):
        return lifting_step(tables, out, k, flow_at_drop(g, transition_of(valve, g), drop), g, m, wide)
    if valve["law"] == TWO_WAY and drop < 0.0:
        g *= valve["back"]
    return valve_step(g, transition_of(valve, g), m, drop)


@njit
def pump_step(tables, out, k, rho, g, m, drop):
    """The same of a pump whose fluid has the density rho [kg/m3]."""
    at, speed = tables.valves[k]["data"], out[tables.layout[0]["drive"] + k]
    return curve_step(tables.floats, at, speed, rho, rho * tables.settings[0]["gravity"], g, m, drop)


@njit
def head_drop(tables, out, k):
    """(density at its `from` end [kg/m3], that times what heads fall by along restriction k [J/kg]): [Pa] as a drop."""
    st, layout, nodes, floats = tables.settings[0], tables.layout[0], tables.nodes, tables.floats
    valve = tables.valves[k]
    i, j = valve["from_node"], valve["to_node"]
    p_i, p_j = out[layout["pressure"] + i], out[layout["pressure"] + j]
    if st["law"] == LAW_LINEAR:
        return st["rho"], valve["drop"] + (p_i - p_j)
    p_i, p_j = p_i + nodes[i]["pressure"], p_j + nodes[j]["pressure"]
    rise = st["gravity"] * (nodes[j]["elevation"] - nodes[i]["elevation"])
    rho = density(st, floats, p_i)
    return rho, rho * (enthalpy(st, floats, p_i) - enthalpy(st, floats, p_j) - rise)


@njit
def restriction_slope(tables, out, k, drop):
    """d flow / d drop of restriction k at a drop [kg/s/Pa]."""
    valve, g = tables.valves[k], conductance(tables, out, k)
    if valve["law"] == POWER:
        return emitter_slope(tables.floats, valve["data"], g, drop, rule_of(tables, k))
    if valve["law"] == CURVE:
        m = out[tables.layout[0]["valve"] + k]
        return pump_step(tables, out, k, tables.settings[0]["rho"], g, m, drop)[1] if g > 0.0 else 0.0
    if valve["law"] == LIFT and is_lifting(tables, k):
        x, full = max(pressure_lift(tables, out, k), 0.0), flow_at_drop(g, transition_of(valve, g), drop)
        return x * flow_slope(g, transition_of(valve, g), drop) + max(full, 0.0) * lift_rise(tables, k)
    if valve["law"] == TWO_WAY and drop < 0.0:
        g *= valve["back"]
    return flow_slope(g, transition_of(valve, g), drop)


@njit
def is_lifting(tables, k):
    """Whether a valve that the pressure before it lifts is between shut and fully open."""
    armed, at = tables.armed, tables.devices[tables.valves[k]["device"]]["event"]
    return armed[at] == 0.0 and armed[at + 2] == 0.0


@njit
def pressure_lift(tables, out, k):
    """Lift x of such a valve, linear in the pressure before it and not held between 0 and 1."""
    floats, valve = tables.floats, tables.valves[k]
    change = out[tables.layout[0]["pressure"] + valve["from_node"]]
    return floats[valve["data"]] + change / floats[valve["data"] + 1]


@njit
def lift_rise(tables, k):
    """Lift of such a valve over the pressure before it [1/Pa]."""
    return 1.0 / tables.floats[tables.valves[k]["data"] + 1]


@njit
def lift_of(tables, out, k, full, wide):
    """Lift that counts in the nodes; `full` is the flow at full opening [kg/s].

    Flow that comes back raises the pressure that lifts, so a lift is held between 0 and 1, and there may be two: the
    greater one is stable. Newton comes to it from above, from where all of these are `wide` open.
    """
    x = pressure_lift(tables, out, k)
    if full >= 0.0:
        return x
    return 1.0 if wide else min(max(x, 0.0), 1.0)


@njit
def lifting_step(tables, out, k, full, g, m, wide):
    """a, s of the flow x `full` of a lifting valve: of the root the chord as in `valve_step`, backwards its slope."""
    x, transition = lift_of(tables, out, k, full, wide), transition_of(tables.valves[k], g)
    if x <= 0.0:
        return x * full - m, 0.0
    near = x * abs(full) if full < 0.0 and not wide else abs(m)
    s = x * x * g / max(x * abs(full) + near, x * LEAST * sqrt(g))
    if transition > 0.0:
        s = min(s, 45.0 / 32.0 * x * g / transition)
    return x * full - m, s


@njit
def lifting_slope(tables, out, k, full, wide):
    """What the pressure before a lifting valve adds to its flow by its lift [kg/s/Pa]; backwards it takes."""
    if full < 0.0 and (wide or not 0.0 < pressure_lift(tables, out, k) < 1.0):
        return 0.0
    return full * lift_rise(tables, k)


@njit
def restriction_lift(tables, out, k, g, drop, wide):
    """The same of restriction k at a drop; none of other laws. A Newton step adds it times the change before it."""
    valve = tables.valves[k]
    if valve["law"] != LIFT or not is_lifting(tables, k):
        return 0.0
    return lifting_slope(tables, out, k, flow_at_drop(g, transition_of(valve, g), drop), wide)


@njit
def runs_back(tables, k, m):
    """Whether restriction k is such a valve and carries its flow m backwards."""
    return m < 0.0 and tables.valves[k]["law"] == LIFT and is_lifting(tables, k)
