"""Valve whose lift follows its lifting pressure at once: the upstream pressure, or a sum of two sensed pressures.

Partly open: M |M| = G x^2 dP with x = (p - set pressure) / span, solved with the nodes; M is the mass flow, G the
conductance at full opening, x the lift, dP the drop, p the lifting pressure. Flags: armed[event], the valve is shut;
armed[event + 2], it is fully open. Both change on accepted states only, so that each mode has a smooth law. In mode
FREE_BACK the valve is also fully open while its flow is reversed.
"""

from math import sqrt

from fvsolve.core.kernels.restrictions import (
    LEAST,
    flow_at_drop,
    flow_slope,
    head_drop,
    is_lifted,
    root_slope,
    root_step,
    transition_of,
)
from fvsolve.core.kernels.self_acting_valves import event_pair, sensed_pressure
from fvsolve.jit import njit

FREE_BACK = 1  # mode
# margin at events of the lift, and of a flow over that at a drop of the span, against rounding
RELUCTANCE = 1e-10
ALMOST_SHUT = 1e-6  # lift below which its flow may be rounding
BACK_MARGIN = 1e-3  # reverse drop that opens a shut valve to reverse flow [Pa]


@njit
def set(t, y, out, tables, device):
    """Write to `out` the conductance of the valve at full opening [kg2/s2/Pa], 0 if it is shut."""
    k, shut = device["valve"], tables.armed[device["event"]] > 0.0
    out[tables.layout[0]["conductance"] + k] = 0.0 if shut else tables.valves[k]["conductance"]


@njit
def value(t, y, out, tables, device, quantity):
    """Lift of the valve, 0 to 1; 1 while a reversed flow passes the full opening."""
    if device["mode"] == FREE_BACK and tables.armed[device["event"] + 2] > 0.0:
        return 1.0
    return min(max(pressure_lift(tables, out, device["valve"]), 0.0), 1.0)


@njit
def events(t, y, out, tables, device, g):
    """Write two event functions to g, each followed by its negative: lift above the seat, lift below full opening.

    While the valve is shut, the first is the lift above a small margin.
    Between shut and fully open the valve always becomes partly open first. After a jump, a direct change to the
    opposite stop might contradict the law of that stop. In mode FREE_BACK a reversed flow counts as fully open.
    """
    armed = tables.armed
    at = device["event"]
    x = pressure_lift(tables, out, device["valve"])
    left, missing = x, 1.0 - x
    if armed[at] > 0.0:
        left, missing = x - RELUCTANCE, 1.0
    elif armed[at + 2] > 0.0:
        left, missing = 1.0, 1.0 - RELUCTANCE - x
    if device["mode"] == FREE_BACK:
        ahead = forward_flow(tables, out, device, x)
        if armed[at + 2] == 0.0:
            left = max(left, -ahead)
        if armed[at] == 0.0:
            missing = min(missing, ahead - RELUCTANCE if armed[at + 2] > 0.0 else ahead)
    event_pair(tables, g, at, left)
    event_pair(tables, g, at + 2, missing)


@njit
def forward_flow(tables, out, device, x):
    """Flow through the fully open valve at the present drop, over its flow at a drop of the span [-].

    For a shut valve, or without flow, it is the drop plus BACK_MARGIN, over the span. x : lift
    """
    k, span = device["valve"], tables.floats[device["data"] + 1]
    flow = out[tables.layout[0]["valve"] + k]
    opening = 1.0 if tables.armed[device["event"] + 2] > 0.0 else x
    if flow == 0.0 and tables.armed[device["event"] + 2] > 0.0:
        return 0.0
    if flow == 0.0 or opening <= ALMOST_SHUT:
        return (head_drop(tables, out, k)[1] + BACK_MARGIN) / span
    return flow / (opening * sqrt(tables.valves[k]["conductance"] * span))


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """(a [kg/s], s [kg/s/Pa]) of the next Newton step dM = a + s d(drop) of valve k, M the mass flow.

    A shut or fully open valve has the square-root law; for a partly open valve see `lifting_step`.
    Arguments as for `restriction_step`.
    """
    if not is_lifted(tables, k):
        return root_step(tables, k, g, m, drop, denser)
    dense = g * denser
    full = flow_at_drop(dense, transition_of(tables.valves[k], dense), drop)
    return lifting_step(tables, out, k, full, dense, m, wide)


@njit
def slope(out, tables, k, g, drop):
    """Derivative [kg/s/Pa] of the mass flow of valve k by its drop, including the change of lift.

    g : conductance at full opening [kg2/s2/Pa]; drop : [Pa]
    """
    if not is_lifted(tables, k):
        return root_slope(tables, k, g, drop)
    transition = transition_of(tables.valves[k], g)
    x, full = max(pressure_lift(tables, out, k), 0.0), flow_at_drop(g, transition, drop)
    return x * flow_slope(g, transition, drop) + max(full, 0.0) * end_weight(tables, k) * lift_rise(
        tables, k
    )


@njit
def end_weight(tables, k):
    """Weight of the drop of valve k in its lifting pressure, from the sensed nodes that are its ends; at least 0."""
    valve, weight = tables.valves[k], 0.0
    device = tables.devices[valve["device"]]
    if device["node"] < 0:
        return 1.0
    for node, own in (
        (device["node"], device["node_weight"]),
        (device["second"], device["second_weight"]),
    ):
        weight += own if node == valve["from_node"] else 0.0
        weight -= own if node == valve["to_node"] else 0.0
    return max(weight, 0.0)


@njit
def lift(out, tables, k, g, drop, denser, wide):
    """Derivative [kg/s/Pa] of the mass flow of valve k by its lifting pressure, at constant drop.

    Arguments as for `restriction_step`.
    """
    dense = g * denser
    return lifting_slope(
        tables, out, k, flow_at_drop(dense, transition_of(tables.valves[k], dense), drop), wide
    )


@njit
def pressure_lift(tables, out, k):
    """Lift x of valve k [-], linear in its lifting pressure and not limited to 0 to 1."""
    floats, valve = tables.floats, tables.valves[k]
    device = tables.devices[valve["device"]]
    if device["node"] >= 0:
        change = sensed_pressure(tables, out, device)
    else:
        change = out[tables.layout[0]["pressure"] + valve["from_node"]]
    return floats[valve["data"]] + change / floats[valve["data"] + 1]


@njit
def lift_rise(tables, k):
    """Derivative of the lift of valve k by its lifting pressure [1/Pa]."""
    return 1.0 / tables.floats[tables.valves[k]["data"] + 1]


@njit
def lift_of(tables, out, k, full, wide):
    """Lift of valve k in the equations of the nodes [-]; full : flow at full opening [kg/s]

    Reverse flow raises the pressure that lifts the disc. The lift is then limited to 0 to 1, and two solutions may
    exist, of which that with the greater lift is stable. Newton's method reaches it from above: it starts with `wide`
    True, and the valve then counts as fully open.
    """
    x = pressure_lift(tables, out, k)
    if full >= 0.0:
        return x
    return 1.0 if wide else min(max(x, 0.0), 1.0)


@njit
def lifting_step(tables, out, k, full, g, m, wide):
    """(a [kg/s], s [kg/s/Pa]) of the next Newton step dM = a + s d(drop) of a partly open valve k, M the mass flow.

    full : flow at full opening [kg/s]; g : conductance at full opening [kg2/s2/Pa]; m : present flow [kg/s]
    wide : True if the valve counts as fully open at reverse flow
    s is the slope of the chord as in `valve_step`, or for reverse flow that of the tangent.
    """
    x, transition = lift_of(tables, out, k, full, wide), transition_of(tables.valves[k], g)
    if x <= 0.0:
        return x * full - m, 0.0
    size = x * abs(full) if full < 0.0 and not wide else abs(m)
    s = x * x * g / max(x * abs(full) + size, x * LEAST * sqrt(g))
    if transition > 0.0:
        s = min(s, 45.0 / 32.0 * x * g / transition)
    return x * full - m, s


@njit
def lifting_slope(tables, out, k, full, wide):
    """Derivative [kg/s/Pa] of the flow of a partly open valve k by its lifting pressure.

    It is negative for reverse flow; it is 0 for reverse flow if the valve counts as fully open, or if the lift that its
    pressure sets is not between 0 and 1.
    full : flow at full opening [kg/s]; wide : True if the valve counts as fully open
    """
    if full < 0.0 and (wide or not 0.0 < pressure_lift(tables, out, k) < 1.0):
        return 0.0
    return full * lift_rise(tables, k)
