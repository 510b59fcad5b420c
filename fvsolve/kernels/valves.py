"""Valve equation, alone and with pipe ends.

M |M| = G dp with G = 2 rho (Cd A)^2, which is q = Cd A sqrt(2 dp / rho), equation (79) of docs/course.md. M is the mass
flow, q the volume flow, dp the drop, Cd A the effective area.
"""

from math import exp, log, sqrt

from fvsolve.jit import njit
from fvsolve.kernels.schedule_pieces import schedule_value

LEAST = 1e-4  # chords are not steeper than at a drop of LEAST squared [Pa], the rounding of pressures


@njit(forceinline=True)
def relative_area(kind, floats, table, size, opening):
    """Relative flow area at a stem position `opening`, by the characteristic `kind`.

    0 : linear
    1 : equal-percentage, rangeability 50, shut at 0
    else : table of `size` openings, then areas, in `floats` from index `table` on
    """
    if kind == 0:
        return opening
    if kind == 1:
        return exp(log(50.0) * (opening - 1.0)) if opening > 0.0 else 0.0
    if opening <= floats[table]:
        return floats[table + size]
    for k in range(1, size):
        if opening <= floats[table + k]:
            s = (opening - floats[table + k - 1]) / (floats[table + k] - floats[table + k - 1])
            low, high = floats[table + size + k - 1], floats[table + size + k]
            return low + s * (high - low)
    return floats[table + 2 * size - 1]


@njit(forceinline=True)
def valve_conductance(tables, index, t):
    """Conductance G = 2 rho (Cd A)^2 of valve `index` at time t [kg2/s2/Pa]."""
    return conductance_of(tables, index, schedule_value(tables, tables.valves[index]["schedule"], t))


@njit(forceinline=True)
def conductance_of(tables, index, opening):
    """Conductance G = 2 rho (Cd A)^2 of valve `index` at an opening [kg2/s2/Pa]."""
    valve = tables.valves[index]
    area = relative_area(valve["characteristic"], tables.floats, valve["table"], valve["table_size"], opening)
    return valve["conductance"] * area * area


@njit(forceinline=True)
def transition_of(valve, g):
    """Flow below which the law of a restriction with conductance g is laminar [kg/s]."""
    return max(valve["transition"], sqrt(g * valve["rounding_drop"]))


@njit(forceinline=True)
def flow_at_drop(conductance, transition, drop):
    """Mass flow of a valve at a pressure drop [kg/s], sqrt(conductance * drop) with the sign of the drop.

    Below the flow `transition` [kg/s] it is an odd polynomial with a bounded slope, joined with continuous second
    derivative.
    """
    if conductance <= 0.0:
        return 0.0
    size = conductance * abs(drop)
    if transition > 0.0 and size < transition * transition:
        x = size / (transition * transition)
        flow = transition * x * (45.0 + x * x * (5.0 * x * x - 18.0)) / 32.0
    else:
        flow = sqrt(size)
    return flow if drop >= 0.0 else -flow


@njit(forceinline=True)
def flow_slope(conductance, transition, drop):
    """Derivative of the mass flow of a valve with respect to its drop [kg/s per Pa].

    Law and arguments as for `flow_at_drop`.
    """
    if conductance <= 0.0:
        return 0.0
    size = conductance * abs(drop)
    if transition > 0.0 and size < transition * transition:
        x = size / (transition * transition)
        return conductance / transition * (45.0 + x * x * (25.0 * x * x - 54.0)) / 32.0
    return 0.5 * conductance / sqrt(size) if size > 0.0 else 0.0


@njit(forceinline=True)
def valve_step(g, transition, m, drop):
    """(a, s) of the change of flow a + s d(drop) in the next Newton step of a valve [kg/s, kg/s/Pa].

    g : conductance [kg2/s2/Pa]; m, drop : present flow [kg/s] and drop [Pa]
    transition : flow below which the law is laminar [kg/s]
    The chord of the square root replaces its slope: between the present flow and the flow of the law at this drop it is
    finite and never too steep.
    """
    if transition > 0.0:
        target = flow_at_drop(g, transition, drop)
        steepest = 45.0 / 32.0 * g / transition
        return target - m, min(steepest, g / max(abs(target) + abs(m), 1e-300))
    chord = max(abs(m) + sqrt(g * abs(drop)), LEAST * sqrt(g))
    return (g * drop - abs(m) * m) / chord, g / chord


@njit(forceinline=True)
def flow_change(conductance, impedance, flow, surplus, target):
    """Change x [kg/s] of the flow M of a valve between pipe ends: exact root of |M + x| (M + x) = G (dp0 + dp' - Z x).

    conductance : G [kg2/s2/Pa]; flow : initial steady flow M [kg/s]
    impedance : Z of both pipe ends together [Pa s/kg], zero for given pressures
    target : G (dp0 + dp') [kg2/s2], with initial drop dp0 and its change dp' at unchanged flow
    surplus : target - |M| M, computed so that it is zero if nothing changes: then x is zero too
    """
    if conductance <= 0.0:
        return -flow
    gz = conductance * impedance
    side = 1.0 if flow >= 0.0 else -1.0
    if abs(surplus) <= 0.5 * flow * flow:
        b = 2.0 * abs(flow) + gz
        return 2.0 * surplus / (b + sqrt(b * b + 4.0 * side * surplus)) if b > 0.0 else 0.0
    total = target + gz * flow
    root = gz + sqrt(gz * gz + 4.0 * abs(total))
    return (2.0 * total / root if root > 0.0 else 0.0) - flow


@njit
def flow_change_laminar(conductance, transition, impedance, flow, base, drop):
    """Change x [kg/s] of the flow M of a valve between pipe ends: root of M + x = law(drop - Z x), by bounded Newton.

    The law is that of `flow_at_drop`, with a laminar part below the flow `transition` [kg/s].
    conductance, impedance, flow : see `flow_change`; drop : drop at unchanged flow [Pa]
    base : flow of the law at the initial drop minus M, so that x is zero if nothing changes
    """
    if conductance <= 0.0:
        return -flow
    x = flow_at_drop(conductance, transition, drop) - flow - base
    if impedance == 0.0 or x == 0.0:
        return x
    low, high = min(x, 0.0), max(x, 0.0)
    for _ in range(100):
        rest = drop - impedance * x
        g = flow + x + base - flow_at_drop(conductance, transition, rest)
        if g > 0.0:
            high = x
        else:
            low = x
        step = g / (1.0 + impedance * flow_slope(conductance, transition, rest))
        new = x - step
        if not (low <= new <= high):
            new = 0.5 * (low + high)
        if abs(new - x) <= 1e-15 * (abs(flow) + abs(new)):
            return new
        x = new
    return x
