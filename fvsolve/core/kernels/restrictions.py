"""Restrictions (valves, pumps, orifices): valve equation, driving pressure, Newton step, slope and events of each law.

Valve equation: M |M| = G dp with G = 2 rho (Cd A)^2, which is q = Cd A sqrt(2 dp / rho), equation (79) of
docs/course.md. M is the mass flow, q the volume flow, dp the drop, Cd A the effective area.
"""

from math import exp, log, sqrt

from fvsolve.core.kernels.calls import call_bends, call_lift, call_slope, call_step
from fvsolve.core.kernels.density import density, enthalpy
from fvsolve.core.kernels.devices import BENDS, LIFT, SLOPE, STEP
from fvsolve.core.kernels.dtypes import LAW_LINEAR
from fvsolve.core.kernels.isolated_nodes import inner_row
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.jit import njit

# chords are not steeper than at a drop of LEAST squared [Pa], the rounding of pressures
LEAST = 1e-4


@njit(forceinline=True)
def relative_area(kind, floats, table, size, opening):
    """Relative flow area at a stem position `opening`, by the characteristic `kind`.

    0 : linear
    1 : equal-percentage, rangeability 50, shut at 0
    else : table of `size` openings, then areas, in `floats` from index `table` on
    """
    if kind == 0:
        return opening
    # The formula leaves 1/50 of the area at opening 0, where a valve is shut.
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
    return conductance_of(
        tables, index, schedule_value(tables, tables.valves[index]["schedule"], t)
    )


@njit(forceinline=True)
def conductance_of(tables, index, opening):
    """Conductance G = 2 rho (Cd A)^2 of valve `index` at an opening [kg2/s2/Pa]."""
    valve = tables.valves[index]
    area = relative_area(
        valve["characteristic"], tables.floats, valve["table"], valve["table_size"], opening
    )
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
        # With these coefficients value, slope and second derivative at x = 1 are those of sqrt(x).
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
        # The slope of the polynomial is greatest at zero drop, 45 g / (32 transition).
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
    # A small change: this form of the root subtracts no nearly equal numbers, so x keeps its digits.
    if abs(surplus) <= 0.5 * flow * flow:
        b = 2.0 * abs(flow) + gz
        return 2.0 * surplus / (b + sqrt(b * b + 4.0 * side * surplus)) if b > 0.0 else 0.0
    # A large change may reverse the flow, so the root is found for the total flow M + x.
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
    # Pressures at the pipe ends oppose the change, so the root lies between zero and this change.
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
            # The slope of the law changes fast near the transition, where Newton may leave the bounds.
            new = 0.5 * (low + high)
        if abs(new - x) <= 1e-15 * (abs(flow) + abs(new)):
            return new
        x = new
    return x


@njit(forceinline=True)
def open_scheduled(t, out, tables):
    """Write conductances [kg2/s2/Pa] of restrictions that follow schedules, without a device, to out[conductance]."""
    valves, at = tables.valves, tables.layout[0]["conductance"]
    for k in range(valves.size):
        # Devices write the conductances of their own restrictions.
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
    return (
        valve_conductance(tables, k, t)
        if tables.valves[k]["device"] < 0
        else conductance(tables, out, k)
    )


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
        return call_step(
            tables.hooks[valve["hooks"], STEP], out, tables, k, g, m, drop, denser, wide
        )
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
    st = tables.settings[0]
    layout = tables.layout[0]
    nodes = tables.nodes
    floats = tables.floats
    valve = tables.valves[k]
    i, j = valve["from_node"], valve["to_node"]
    p_i, p_j = out[layout["pressure"] + i], out[layout["pressure"] + j]
    if st["law"] == LAW_LINEAR:
        # The drop of the profile contains the elevations.
        return st["rho"], valve["drop"] + (p_i - p_j)
    p_i, p_j = p_i + nodes[i]["pressure"], p_j + nodes[j]["pressure"]
    rise = st["gravity"] * (nodes[j]["elevation"] - nodes[i]["elevation"])
    rho = density(st, floats, p_i)
    return rho, rho * (enthalpy(st, floats, p_i) - enthalpy(st, floats, p_j) - rise)


@njit
def mean_density(st, floats, p_i, p_j):
    """Mean density dp / dh between the pressures p_i and p_j [kg/m3], h : specific enthalpy."""
    dp = p_i - p_j
    # At smaller differences of pressure the difference of enthalpies is rounding.
    if abs(dp) > 1e-3:
        return dp / (enthalpy(st, floats, p_i) - enthalpy(st, floats, p_j))
    return density(st, floats, p_i)


@njit
def driving_pressure(st, floats, p_i, z_i, p_j, z_j):
    """(driving pressure of a link from node i to node j [Pa], upstream density [kg/m3]).

    The driving pressure is rho_mean (h_i - h_j + g (z_i - z_j)), with specific enthalpy h and elevation z [m]. At equal
    elevations it is p_i - p_j.
    """
    dp = p_i - p_j
    # At equal elevations the formula reduces to p_i - p_j, without the rounding of enthalpies.
    if z_i != z_j:
        dh = enthalpy(st, floats, p_i) - enthalpy(st, floats, p_j)
        dp = mean_density(st, floats, p_i, p_j) * (dh + st["gravity"] * (z_i - z_j))
    return dp, density(st, floats, p_i if dp >= 0.0 else p_j)


@njit
def valve_driving_pressure(tables, out, k):
    """(driving pressure of valve k [Pa], upstream density over reference density [-]), from the present pressures."""
    st = tables.settings[0]
    layout = tables.layout[0]
    nodes = tables.nodes
    floats = tables.floats
    valve = tables.valves[k]
    i, j = valve["from_node"], valve["to_node"]
    p_i = nodes[i]["pressure"] + out[layout["pressure"] + i]
    p_j = nodes[j]["pressure"] + out[layout["pressure"] + j]
    drop, rho = driving_pressure(st, floats, p_i, nodes[i]["elevation"], p_j, nodes[j]["elevation"])
    return drop, rho / st["rho"]


@njit
def valve_target(tables, out, k, g):
    """(flow by the law of valve k at the present pressures, its conductance at the upstream density [kg2/s2/Pa]).

    The first result is M |M| [kg2/s2] under the square-root law M |M| = G dp. If the law has a laminar part, it is the
    flow M [kg/s].
    g : conductance G at the reference density [kg2/s2/Pa]
    """
    valve = tables.valves[k]
    drop, denser = valve_driving_pressure(tables, out, k)
    dense = g * denser
    if drop < 0.0:
        dense *= valve["back"]
    if valve["transition"] > 0.0:
        return flow_at_drop(dense, transition_of(valve, dense), drop), dense
    return dense * drop, dense


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

    Its flags armed[event] and armed[event + 2] are zero, or it has no flags: a structure between two water levels.
    """
    valve = tables.valves[k]
    if valve["hooks"] < 0 or tables.hooks[valve["hooks"], LIFT] == 0:
        return False
    at = valve["event"]
    return at < 0 or (tables.armed[at] == 0.0 and tables.armed[at + 2] == 0.0)


@njit
def restriction_lift(tables, out, k, g, drop, denser, wide):
    """Derivative of the flow of restriction k with respect to its lifting pressure at constant drop [kg/s/Pa].

    The lifting pressure is the upstream pressure, or the weighted sum of those that its device senses (`is_sensing`).
    The result is 0 if no pressure lifts the restriction. Arguments as for `restriction_step`.
    """
    if not is_lifted(tables, k):
        return 0.0
    return call_lift(
        tables.hooks[tables.valves[k]["hooks"], LIFT], out, tables, k, g, drop, denser, wide
    )


@njit(forceinline=True)
def is_sensing(tables, k):
    """True if the device of restriction k senses pressures at given nodes."""
    device = tables.valves[k]["device"]
    return device >= 0 and tables.devices[device]["node"] >= 0


@njit
def has_lifted_backflow(tables, k, m):
    """True if the upstream pressure lifts restriction k and its flow m [kg/s] is negative."""
    # A structure between two levels has no event flags, and may flow backwards.
    return m < 0.0 and tables.valves[k]["event"] >= 0 and is_lifted(tables, k)


@njit
def restriction_events(t, y, out, handle, g):
    """Write the event functions of restrictions with kinks in their law to g, from solved nodes."""
    tables = open_tables(handle)
    nodes = tables.nodes
    valves = tables.valves
    pressure = tables.layout[0]["pressure"]
    for k in range(valves.size):
        i, j = valves[k]["from_node"], valves[k]["to_node"]
        if valves[k]["hooks"] >= 0 and tables.hooks[valves[k]["hooks"], BENDS] != 0:
            # Profile pressures are subtracted first, so the difference of small changes keeps its digits.
            drop = (
                nodes[i]["pressure"]
                - nodes[j]["pressure"]
                + (out[pressure + i] - out[pressure + j])
            )
            call_bends(tables.hooks[valves[k]["hooks"], BENDS], tables, k, drop, g)


@njit
def step_at(hook, out, handle, k, g, m, drop, denser):
    """(a, s) of `restriction_step` by the compiled function `hook` of its law, for calls from Python.

    Other arguments as for `restriction_step`, with `wide` False.
    """
    return call_step(hook, out, open_tables(handle), k, g, m, drop, denser, False)
