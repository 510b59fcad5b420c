"""Restrictions (valves, pumps, orifices): conductance, Newton step, slope and events of each law."""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.calls import call_bends, call_lift, call_slope, call_step
from fvsolve.kernels.density import density, enthalpy
from fvsolve.kernels.devices import BENDS, LIFT, SLOPE, STEP
from fvsolve.kernels.dtypes import LAW_LINEAR
from fvsolve.kernels.isolated_nodes import inner_row
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.valves import LEAST, flow_slope, transition_of, valve_conductance, valve_step


@njit(forceinline=True)
def open_scheduled(t, out, tables):
    """Write conductances [kg2/s2/Pa] of restrictions that follow schedules, without a device, to out[conductance]."""
    valves, at = tables.valves, tables.layout[0]["conductance"]
    for k in range(valves.size):
        if valves[k]["device"] < 0:
            out[at + k] = valve_conductance(tables, k, t)


@njit(forceinline=True)
def conductance(tables, out, k):
    """Present conductance of restriction k, 0 if it is closed [kg2/s2/Pa]."""
    return out[tables.layout[0]["conductance"] + k]


@njit
def conductance_at(t, tables, out, k):
    """Conductance of restriction k at another time t close to the present one [kg2/s2/Pa].

    For a restriction with a device it is the present value.
    """
    return valve_conductance(tables, k, t) if tables.valves[k]["device"] < 0 else conductance(tables, out, k)


@njit
def restriction_step(tables, out, k, g, m, drop, denser, wide):
    """(a, s) of the change of flow a + s d(drop) in the next Newton step of restriction k [kg/s, kg/s/Pa].

    m, drop : present flow [kg/s] and drop [Pa]
    g : present conductance [kg2/s2/Pa], above zero
    denser : upstream density over reference density, 1 under the density law `linear`
    wide : True to treat restrictions that a pressure lifts as wide open, which is the start of Newton; where two
        flows are possible, Newton then reaches the root with the greater lift
    """
    valve = tables.valves[k]
    if valve["hooks"] >= 0:
        return call_step(tables.hooks[valve["hooks"], STEP], out, tables, k, g, m, drop, denser, wide)
    return root_step(tables, k, g, m, drop, denser)


@njit
def root_step(tables, k, g, m, drop, denser):
    """(a, s) of `restriction_step` for the square-root law M |M| = G dp, flow M, conductance G, drop dp.

    Arguments as for `restriction_step`.
    """
    valve, g = tables.valves[k], g * denser
    if drop < 0.0:
        g *= valve["back"]
    transition = transition_of(valve, g)
    if transition > 0.0 or tables.settings[0]["law"] == LAW_LINEAR:
        return valve_step(g, transition, m, drop)
    target = g * drop
    chord = max(abs(m) + sqrt(abs(target)), LEAST * sqrt(g))
    upstream = valve["from_node"] if target >= 0.0 else valve["to_node"]
    if inner_row(tables.nodes, upstream) >= 0:  # the upstream density grows with the pressure
        g += abs(target) / tables.settings[0]["beta"]
    return (target - abs(m) * m) / chord, g / chord


@njit
def head_drop(tables, out, k):
    """(density at the `from` end [kg/m3], this density times the drop of specific energy over restriction k [Pa]).

    Under the density law `linear` the second result is the drop of P = p + rho g z.
    """
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
    """Derivative d flow / d drop of restriction k [kg/s/Pa], at the drop `drop` [Pa]."""
    valve, g = tables.valves[k], conductance(tables, out, k)
    if valve["hooks"] >= 0:
        return call_slope(tables.hooks[valve["hooks"], SLOPE], out, tables, k, g, drop)
    return root_slope(tables, k, g, drop)


@njit
def root_slope(tables, k, g, drop):
    """Result of `restriction_slope` for the square-root law with conductance g [kg2/s2/Pa]."""
    valve = tables.valves[k]
    if drop < 0.0:
        g *= valve["back"]
    return flow_slope(g, transition_of(valve, g), drop)


@njit
def is_lifted(tables, k):
    """True if a pressure can lift restriction k by its law: the restriction is neither closed nor fully open.

    Its flags armed[event] and armed[event + 2] are zero.
    """
    valve = tables.valves[k]
    if valve["hooks"] < 0 or tables.hooks[valve["hooks"], LIFT] == 0:
        return False
    at = valve["event"]
    return tables.armed[at] == 0.0 and tables.armed[at + 2] == 0.0


@njit
def restriction_lift(tables, out, k, g, drop, denser, wide):
    """Derivative of the flow of restriction k with respect to its upstream pressure at constant drop [kg/s/Pa].

    It is 0 if no pressure lifts the restriction. Arguments as for `restriction_step`.
    """
    if not is_lifted(tables, k):
        return 0.0
    return call_lift(tables.hooks[tables.valves[k]["hooks"], LIFT], out, tables, k, g, drop, denser, wide)


@njit
def has_lifted_backflow(tables, k, m):
    """True if the upstream pressure lifts restriction k and its flow m [kg/s] is negative."""
    return m < 0.0 and is_lifted(tables, k)


@njit
def restriction_events(t, y, out, handle, g):
    """Write the event functions of restrictions with kinks in their law to g, from solved nodes."""
    tables = open_tables(handle)
    nodes, valves, pressure = tables.nodes, tables.valves, tables.layout[0]["pressure"]
    for k in range(valves.size):
        i, j = valves[k]["from_node"], valves[k]["to_node"]
        if valves[k]["hooks"] >= 0 and tables.hooks[valves[k]["hooks"], BENDS] != 0:
            drop = nodes[i]["pressure"] - nodes[j]["pressure"] + (out[pressure + i] - out[pressure + j])
            call_bends(tables.hooks[valves[k]["hooks"], BENDS], tables, k, drop, g)


@njit
def step_at(hook, out, handle, k, g, m, drop, denser):
    """(a, s) of `restriction_step` by the compiled function `hook` of its law, for calls from Python.

    Other arguments as for `restriction_step`, with `wide` False.
    """
    return call_step(hook, out, open_tables(handle), k, g, m, drop, denser, False)
