"""Structures between two water levels (weirs, gates, culverts, manholes): Newton step, slopes and regime of their flow.

The law of a structure is its function `rule`, from which these templates are made:
(flow [m3/s], regime) = rule(floats, at, setting, ahead, z, fall), the flow from the higher to the lower level.
floats[at:] : numbers of the structure; setting : its scheduled crest or opening [m]; ahead : True if its end `from` has
the higher level; z : higher level above datum [m]; fall : difference of the levels, at least LINEAR_FALL [m]
Each copy of a template needs a name of its own, because stored code is found by the file of the template and the name.
Below LINEAR_FALL the flow is proportional to the fall, so that its slope is bounded, and zero at equal levels.
"""

from math import exp, expm1, log, log1p, sqrt

from fvsolve.core.kernels.density import enthalpy
from fvsolve.core.kernels.dtypes import FIRM, LAW_LINEAR
from fvsolve.core.kernels.isolated_nodes import inner_row
from fvsolve.core.kernels.restrictions import head_drop
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.jit import njit

LINEAR_FALL = 1e-3  # fall of the levels below which the flow is proportional to it [m]
NONE, FREE, DROWNED = 0, 1, 2  # regimes
CHANGE = 1e-6  # change of a level for its slope [m]
NEAR = 1e-6  # relative difference of flows below which the tangent replaces the chord
CHORD_ERROR = 1e-2  # error of the fall at the present flow, over the length of the chord
SWEEPS = 40
LEAST_SLOPE, TINY_SLOPE = 1e-6, 1e-60  # least slope over the flow [1/m], and without flow [m2/s]
# firm slope of faces of water over that of structures, so that structures set a level at rest
FACE_SHARE = 1e-3
FARTHEST = 1e6  # greatest fall of the search for a flow [m]
RULE = FLOW = SLOPES = CHORD = LINE = None  # constants of the templates


@njit
def weir_flow(size, h, fall):
    """(flow [m3/s], regime) over a weir at a depth h above its crest and a fall of the levels [m].

    size : 2/3 C sqrt(2 g) b [m^1.5/s]
    """
    if h <= 0.0:
        return 0.0, NONE
    free = size * h * sqrt(h)
    if fall >= h:
        return free, FREE
    # Villemonte's factor of a drowned weir, (1 - ((h - fall) / h)^1.5)^0.385.
    return free * exp(0.385 * log(-expm1(1.5 * log1p(-fall / h)))), DROWNED


def flow_template(floats, at, setting, ahead, z, fall):
    """(volume flow [m3/s], regime) of a structure; arguments as for a `rule`, with any fall of at least 0."""
    if fall >= LINEAR_FALL:
        return RULE(floats, at, setting, ahead, z, fall)
    flow, regime = RULE(floats, at, setting, ahead, z, LINEAR_FALL)
    flow *= fall / LINEAR_FALL
    return flow, regime if flow > 0.0 else NONE


def slopes_template(floats, at, setting, ahead, z, fall):
    """Derivatives [m2/s] of the flow by the fall at a constant higher level, and by this level at a constant fall."""
    # A fall is never negative, so the difference is one-sided at equal levels.
    low, high = max(fall - CHANGE, 0.0), fall + CHANGE
    by_fall = (
        FLOW(floats, at, setting, ahead, z, high)[0] - FLOW(floats, at, setting, ahead, z, low)[0]
    )
    by_level = FLOW(floats, at, setting, ahead, z + CHANGE, fall)[0]
    by_level -= FLOW(floats, at, setting, ahead, z - CHANGE, fall)[0]
    return by_fall / (high - low), by_level / (2.0 * CHANGE)


@njit(forceinline=True)
def least_slope(flow, present, firm):
    """Least slope of a law between levels in Newton's method [m2/s], so that a level without flow is determined.

    flow, present : flow by the law, and before the step [m3/s]; firm : least value, see `dtypes.FIRM`
    It is far below the flow over the rise of metres of a structure that takes it, however small the flow is.
    """
    return max(LEAST_SLOPE * max(abs(flow), abs(present)), firm, TINY_SLOPE)


def chord_template(floats, at, setting, ahead, z, fall, flow, present, by_level):
    """Slope [m2/s] of the chord between the flow at a level and a fall and the present flow, over one of both.

    by_level : True for the chord over the level at a constant fall, False for that over the fall at a constant level
    The slope is 0 if the present flow is greater than any flow of the law.
    """
    sought = max(present, 0.0) if by_level else abs(present)
    begin = z if by_level else fall
    reach = max(fall, LINEAR_FALL)
    x = 0.0
    low = begin if by_level else 0.0
    high = begin
    found = flow
    # The law gives more than the present flow, so a level with this flow lies below.
    while by_level and found > sought and reach < FARTHEST:
        low, reach = low - reach, 2.0 * reach
        found = FLOW(floats, at, setting, ahead, low, fall)[0]
    found = flow
    # The law gives less than the present flow, so it is sought above.
    while found < sought and reach < FARTHEST:
        low = high
        high = high + reach
        reach = 2.0 * reach
        found = FLOW(
            floats, at, setting, ahead, high if by_level else z, fall if by_level else high
        )[0]
    if found < sought:
        return 0.0
    for _ in range(SWEEPS):
        x = 0.5 * (low + high)
        found = FLOW(floats, at, setting, ahead, x if by_level else z, fall if by_level else x)[0]
        if abs(found - sought) <= CHORD_ERROR * abs(flow - present):
            break
        low, high = (x, high) if found < sought else (low, x)
    own = -x if present < 0.0 and not by_level else x
    return (flow - present) / (begin - own) if own != begin else 0.0


def line_template(floats, at, setting, z, fall, present, firm):
    """(flow [m3/s], its slope over the fall, its slope over the level `z` [m2/s]) for the next step of Newton's method.

    z, fall : level at the end `from`, and fall from there to the end `to`, of any sign [m]
    present : flow before the step [m3/s]; firm : as for `least_slope`
    Laws are concave in the fall and partly in the level, so that tangents might alternate. Therefore the slope over the
    fall is that of the chord, plus the excess of the chord over the level above the tangent.
    """
    ahead = fall >= 0.0
    size = abs(fall)
    m = present if fall >= 0.0 else -present
    high = z if ahead else z - fall
    flow = FLOW(floats, at, setting, ahead, high, size)[0]
    by_fall, by_level = SLOPES(floats, at, setting, ahead, high, size)
    by_level = max(by_level, 0.0)
    # Near the present flow the chord is the tangent, but a quotient of rounding errors.
    if abs(flow - m) > NEAR * (abs(flow) + abs(m)):
        by_fall = CHORD(floats, at, setting, ahead, high, size, flow, m, False)
        by_fall += max(CHORD(floats, at, setting, ahead, high, size, flow, m, True) - by_level, 0.0)
    by_fall = max(by_fall, least_slope(flow, m, firm))
    if ahead:
        return flow, by_fall, by_level
    # The higher level is z - fall, so its slope enters the slope over the fall.
    return -flow, by_fall + by_level, -by_level


@njit
def level_at(tables, out, i):
    """Level of the water at node i above datum [m], without velocity head."""
    st, node = tables.settings[0], tables.nodes[i]
    pressure = node["pressure"] + out[tables.layout[0]["pressure"] + i]
    if st["law"] == LAW_LINEAR:
        return (pressure - st["ambient"]) / (st["rho"] * st["gravity"]) + node["elevation"]
    above = enthalpy(st, tables.floats, pressure) - enthalpy(st, tables.floats, st["ambient"])
    return above / st["gravity"] + node["elevation"]


@njit
def level_and_fall(tables, out, k, drop):
    """(level at the end `from` of structure k, fall of the levels to its end `to`) [m]; drop : drop of potential [Pa]

    Under the density law `linear` the fall is that of the drop, which is zero to the bit at rest.
    """
    st, valve = tables.settings[0], tables.valves[k]
    z = level_at(tables, out, valve["from_node"])
    if st["law"] == LAW_LINEAR:
        return z, drop / (st["rho"] * st["gravity"])
    return z, z - level_at(tables, out, valve["to_node"])


@njit
def higher_level(tables, out, k, drop):
    """(True if the end `from` has the higher level, this level [m], fall to the other [m]) of structure k.

    drop : drop of potential [Pa]
    """
    z, fall = level_and_fall(tables, out, k, drop)
    return (
        fall >= 0.0,
        z if fall >= 0.0 else level_at(tables, out, tables.valves[k]["to_node"]),
        abs(fall),
    )


@njit
def ends_at_junction(tables, k):
    """True if a level at an end of structure k follows from flows."""
    nodes, valve = tables.nodes, tables.valves[k]
    return inner_row(nodes, valve["from_node"]) >= 0 or inner_row(nodes, valve["to_node"]) >= 0


@njit
def setting_of(tables, out, k):
    """Present crest or opening of structure k [m]."""
    return out[tables.layout[0]["drive"] + k]


@njit
def set_structure(t, y, out, tables, device):
    """Write the scheduled crest or opening of a structure [m], and its conductance, to `out`."""
    k, layout = device["valve"], tables.layout[0]
    out[layout["conductance"] + k] = tables.valves[k]["conductance"]
    if device["schedule"] >= 0:
        out[layout["drive"] + k] = schedule_value(tables, device["schedule"], t)


def step_template(out, tables, k, g, m, drop, denser, wide):
    """(a [kg/s], s [kg/s/Pa]) of the next Newton step dM = a + s d(drop); arguments as for `restriction_step`."""
    st = tables.settings[0]
    floats = tables.floats
    at = tables.valves[k]["data"]
    setting = setting_of(tables, out, k)
    rho = st["rho"] * denser
    # Both levels are known, so the flow is too, and Newton needs no slope.
    if not ends_at_junction(tables, k):
        ahead, z, fall = higher_level(tables, out, k, drop)
        flow = rho * FLOW(floats, at, setting, ahead, z, fall)[0]
        return (flow if ahead else -flow) - m, 0.0
    z, fall = level_and_fall(tables, out, k, drop)
    flow, by_fall, _ = LINE(floats, at, setting, z, fall, m / rho, out[FIRM])
    return rho * flow - m, denser * by_fall / st["gravity"]


def lift_template(out, tables, k, g, drop, denser, wide):
    """Derivative [kg/s/Pa] of the mass flow of structure k by the pressure at `from`, at constant drop.

    Arguments as for `restriction_step`.
    """
    if not ends_at_junction(tables, k):
        return 0.0
    ahead, z, fall = higher_level(tables, out, k, drop)
    by_level = SLOPES(
        tables.floats, tables.valves[k]["data"], setting_of(tables, out, k), ahead, z, fall
    )[1]
    by_level = denser * max(by_level, 0.0) / tables.settings[0]["gravity"]
    return by_level if ahead else -by_level


def slope_template(out, tables, k, g, drop):
    """Greatest derivative [kg/s/Pa] of the mass flow of structure k by a pressure at its ends; drop : [Pa]"""
    ahead, z, fall = higher_level(tables, out, k, drop)
    slopes = SLOPES(
        tables.floats, tables.valves[k]["data"], setting_of(tables, out, k), ahead, z, fall
    )
    return (max(slopes[0], 0.0) + max(slopes[1], 0.0)) / tables.settings[0]["gravity"]


def regime_template(t, y, out, tables, device, quantity):
    """Regime of a structure: NONE without flow, FREE if the lower level does not change its flow, else DROWNED."""
    k = device["valve"]
    ahead, z, fall = higher_level(tables, out, k, head_drop(tables, out, k)[1])
    found = FLOW(
        tables.floats, tables.valves[k]["data"], setting_of(tables, out, k), ahead, z, fall
    )
    return float(found[1])
