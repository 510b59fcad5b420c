"""Flow through the end of a conduit from the node there, by the head of the node.

The cell at the end, with depth h, surface e and inward velocity u, sends the invariant u - phi(h) outward, with the
Riemann function phi of `law_section`. At a head z of the node the depth in the end is h_b = h + z - e, the velocity
u_b = u + phi(h_b) - phi(h), and the inflow q = A_b u_b, with dq/dz = T_b (u_b + c_b). Outflow is at most critical:
then phi(h_b) + c(h_b) = phi(h) - u, which is the free overfall. Inflow is at most critical too, and at most that of
Torricelli, u_b^2 = 2 g h_b, which is lower in a full section. An outflow faster than waves takes the state of the cell.
A dry end passes nothing unless the head is above its invert. The numbers of an end are those of its `SlottedSection`,
and the row of its patch.
"""

from math import sqrt

from fvsolve.core.kernels.dtypes import FIRM
from fvsolve.core.kernels.isolated_nodes import inner_row
from fvsolve.core.kernels.structures import FACE_SHARE, least_slope
from fvsolve.jit import njit
from fvsolve.parts.conduit.law_section import (
    SlottedSection,
    celerity,
    riemann_function,
    section_at_depth,
)

NUMBERS = len(SlottedSection._fields)  # of a section
INSIDE = 7  # numbers of the state inside an end, see `end_state`
SAME_FLOW = 1e-9  # relative difference of flows that counts as rounding
# celerity at a dry end for its least derivative [m/s]; far below that of films of water
DRY_CELERITY = 1e-4
ROUNDING = 1e-14  # relative error of depths that solve an equation
SWEEPS = 100
# error of the flow, over that of the full section at sqrt(g D), above which a chord replaces the tangent
CHORD = 1e-6


@njit
def section_at(floats, at):
    """`SlottedSection` whose numbers are floats[at:]."""
    return SlottedSection(
        floats[at],
        floats[at + 1],
        floats[at + 2],
        floats[at + 3],
        floats[at + 4],
        floats[at + 5],
        floats[at + 6],
    )


@njit
def invariant_and_slope(section, h):
    """(phi + c, its derivative by h) at a depth h above 0 [m/s, 1/s]."""
    area, width, _ = section_at_depth(section, h)
    c = celerity(section, width, area)
    narrowing = 2.0 * (section.diameter - 2.0 * h) / width if h < section.depth else 0.0  # dT / dh
    return riemann_function(section, h) + c, section.g / c * (
        1.5 - 0.5 * area * narrowing / (width * width)
    )


@njit
def critical_depth(section, target, high):
    """Depth from 0 to `high` [m] at which phi + c is `target` [m/s]; 0 for a target of 0 or less."""
    if not target > 0.0:
        return 0.0
    low, h = 0.0, 0.5 * high
    for _ in range(SWEEPS):
        found, slope = invariant_and_slope(section, h)
        if found > target:
            high = h
        else:
            low = h
        new = h - (found - target) / slope
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - h) <= ROUNDING * high:
            return new
        h = new
    return h


@njit
def end_state(section, h, e, u):
    """State inside an end: (h, e, u, area [m2], thrust integral [m3], celerity [m/s], phi [m/s]).

    h, e, u : depth [m], surface above the level at rest [m], inward velocity [m/s]
    """
    area, width, thrust = section_at_depth(section, h)
    return h, e, u, area, thrust, celerity(section, width, area), riemann_function(section, h)


@njit
def read_state(work, at):
    """Result of `end_state` whose numbers are work[at:]."""
    return (
        work[at],
        work[at + 1],
        work[at + 2],
        work[at + 3],
        work[at + 4],
        work[at + 5],
        work[at + 6],
    )


@njit
def end_flow(section, z, inside):
    """(inflow q [m3/s], dq/dz [m2/s], depth [m]) of an end with the head z of its node, from the level at rest [m].

    inside : result of `end_state`
    """
    h, e, u, area, _, c, phi = inside
    depth = max(h + (z - e), 0.0)
    area_b, width_b, _ = section_at_depth(section, depth)
    speed, own = celerity(section, width_b, area_b), u
    if depth != h:
        own = u + (riemann_function(section, depth) - phi)
    if h > 0.0 and -u >= c and (own < -speed or area_b * own <= area * u):
        return area * u, 0.0, h
    if own < -speed:
        depth = critical_depth(section, phi - u, h)
        area_b, width_b, _ = section_at_depth(section, depth)
        return -area_b * celerity(section, width_b, area_b), 0.0, depth
    if not depth > 0.0:
        return 0.0, 0.0, 0.0
    jet = sqrt(2.0 * section.g * depth)
    if own > jet and jet < speed:
        return area_b * jet, width_b * jet + area_b * section.g / jet, depth
    if own > speed:
        slope = invariant_and_slope(section, depth)[1] - section.g / speed  # of c
        return area_b * speed, width_b * speed + area_b * slope, depth
    return area_b * own, width_b * (own + speed), depth


@njit
def passing_head(section, target, inside):
    """Head of the node at which an end passes the inflow `target` [m3/s]; that of a dry end for lower flows."""
    h, e = inside[:2]
    low, rise = e - h, 1e-3 * section.diameter
    z, high = e, e + rise
    while end_flow(section, high, inside)[0] < target and rise < 1e9:
        low = high
        high = high + rise
        rise = 4.0 * rise
    for _ in range(SWEEPS):
        q, slope, _ = end_flow(section, z, inside)
        if q < target:
            low = max(low, z)
        else:
            high = min(high, z)
        new = z + (target - q) / slope if slope > 0.0 else low
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - z) <= ROUNDING * section.diameter:
            return new
        z = new
    return z


@njit
def level_step(section, z, target, inside, firm):
    """(change of the flow from `target` [m3/s], slope over the head [m2/s]) in Newton's step from the head z.

    Far from the target the slope is at least that of the chord to the head at which the target passes: the slope
    changes by the factor T_s / D at the crown and vanishes at critical outflow, where tangents would alternate.
    inside : result of `end_state`; firm : as for `structures.least_slope`
    """
    q, slope, _ = end_flow(section, z, inside)
    if slope > 0.0 and abs(q - target) <= CHORD * section.area * sqrt(section.g * section.diameter):
        return q - target, slope
    least = end_flow(section, inside[1] - inside[0], inside)[0]
    flat = least_slope(q, target, firm)  # critical outflow does not depend on the head
    if not target > least + SAME_FLOW * abs(least):
        if slope > 0.0:
            return q - target, slope
        return q - target, DRY_CELERITY * section.diameter if q == 0.0 else flat
    reach = z - passing_head(section, target, inside)
    return q - target, max(slope, (q - target) / reach if reach != 0.0 else 0.0, flat)


@njit
def end_of(out, tables, k, drop):
    """(section, head above the level at rest [m], state inside) of an end.

    k : restriction of the end; drop : of the pressure, to the cell [Pa]
    """
    at, st = tables.valves[k]["data"], tables.settings[0]
    pressure = out[tables.layout[0]["pressure"] + tables.valves[k]["to_node"]] + drop
    # behind those of the section: lowest bed above the level at rest [m], offset in `work` of the state inside
    lowest, inside = tables.floats[at + NUMBERS], int(tables.floats[at + NUMBERS + 1])
    z = pressure / (st["rho"] * st["gravity"]) + lowest
    return section_at(tables.floats, at), z, read_state(tables.work, inside)


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """(a, s) of `restrictions.restriction_step`: Newton's step; at a node with a known head the tangent is enough."""
    section, z, inside = end_of(out, tables, k, drop)
    rho = tables.settings[0]["rho"]
    if inner_row(tables.nodes, tables.valves[k]["from_node"]) < 0:
        q, s, _ = end_flow(section, z, inside)
        return rho * q - m, s / tables.settings[0]["gravity"]
    a, s = level_step(section, z, m / rho, inside, FACE_SHARE * out[FIRM])
    return rho * a, s / tables.settings[0]["gravity"]


@njit
def slope(out, tables, k, g, drop):
    """Derivative of the mass flow by the drop [kg/s/Pa]."""
    section, z, inside = end_of(out, tables, k, drop)
    return end_flow(section, z, inside)[1] / tables.settings[0]["gravity"]
