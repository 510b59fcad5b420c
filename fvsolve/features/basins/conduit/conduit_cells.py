"""Blocks of cells of conduits: depths, limited values at faces, fluxes and friction, in loops that vectorise.

Quantities of a block are stored as rows of one array at the constant distance STRIDE, so that the compiler knows that
they do not overlap. A block has cells beside those whose rates are computed. Depth h and surface e at faces have
limited slopes; both sides of a face use the higher invert (Audusse et al. 2004). Fluxes are those of Harten, Lax and
van Leer with the speeds of Einfeldt. Momentum fluxes are differences from the thrust g I of each side, so that water at
rest stays at rest to the bit.
"""

from math import inf, pi, sqrt

from fvsolve.core.kernels.reconstruction import by_limiter, half_slopes, slope
from fvsolve.features.basins.hll_flux import TINY, hll_flux
from fvsolve.jit import inline, njit
from fvsolve.parts.conduit.law_section import (
    celerity,
    depth_of,
    hydraulic_radius_power,
    section_at_depth,
)

MOST_CELLS = 128  # of a block, whose rates are computed
STRIDE = 136  # an odd number of cache lines, so that rows do not evict each other from the cache
ROWS = 17
# Rows of faces, each before the cell of its index: flow, momentum flux minus the thrust before, and minus that after.
FLOW, BEFORE, AFTER = (k * STRIDE for k in range(3))
# Rows of cells: area, width and thrust integral at the faces before (LOW) and after (HIGH) a cell; speed of waves, half
# the changes of depth, surface and velocity within the cell, these quantities, area. Loops that write a row shortly
# after the rows that they read do not vectorise, so results stand before what they follow from.
LOW_AREA, LOW_WIDTH, LOW_THRUST, HIGH_AREA, HIGH_WIDTH, HIGH_THRUST = (
    k * STRIDE for k in range(3, 9)
)
WAVE, D_DEPTH, D_SURFACE, D_SPEED, DEPTH, SURFACE, SPEED, AREA = (k * STRIDE for k in range(9, 17))
NEARLY_FULL = 0.7  # share of the full section from which on steps follow the surcharge celerity
THIN = 1e-7  # share of the full section below which velocities fade
STEEPEST = 1.0  # greatest change of depth within a cell, over its depth
# relative change of depth within a cell below which its mean area is that at the mean depth
EVEN = 1e-6


@njit(forceinline=True)
def fastest(section, area, c):
    """Speed of waves that limits the step [m/s]: that of the slot from the share NEARLY_FULL of the full section on."""
    surcharge = sqrt(section.g * section.area / section.slot)
    return c if area < NEARLY_FULL * section.area else max(c, surcharge)


@njit(forceinline=True)
def velocity_factor(section, area):
    """Velocity over flow [1/m2]: 1 / area, but towards 0 in thin water."""
    wet = max(area, THIN * section.area)
    return 2.0 * area / (area * area + wet * wet)


@njit(forceinline=True)
def drag_per_flow(section, rough, h, area):
    """Decay rate of the flow by friction over the flow |Q| [1/m3].

    The slot has weight, but no velocity: in the full section the slope of friction is that at the velocity Q / A_f.
    rough : (g n^2 with Manning's number n [m^(1/3)], minor loss coefficient over twice the length [1/m])
    """
    full = 0.25 * pi * section.diameter * section.diameter
    share = velocity_factor(section, area) if area < full else area / (full * full)
    return share * (rough[0] * hydraulic_radius_power(section, h, min(area, full)) + rough[1])


@njit(forceinline=True)
def cell_state(section, rest_area, rest_depth, rest_surface, change, flow):
    """(area, depth, surface above the level at rest, velocity) of a cell; change : deviation of the area from rest."""
    area = max(rest_area + change, 0.0)
    # so that water at rest has the same depth to the bit
    h = depth_of(section, area) if change != 0.0 else rest_depth
    return area, h, rest_surface + (h - rest_depth), velocity_factor(section, area) * flow


@inline
def put_cells(section, area, depth, surface, changes, flows, b):
    """Write area, depth, surface and velocity of a row of cells to the block b.

    area, depth, surface : of the water at rest; changes, flows : states
    """
    for i in range(changes.size):
        b[i + AREA], b[i + DEPTH], b[i + SURFACE], b[i + SPEED] = cell_state(
            section, area[i], depth[i], surface[i], changes[i], flows[i]
        )


@inline
def put_waves(section, n, b):
    """Write |u| + c of n cells to the block b, with the celerity that limits the step."""
    for i in range(n):
        area = b[i + AREA]
        c = celerity(section, section_at_depth(section, b[i + DEPTH])[1], area)
        b[i + WAVE] = abs(b[i + SPEED]) + fastest(section, area, c)


@inline
def put_slopes(limiter, n, b):
    """Write half the changes of depth, surface and velocity within cells 1 to n of the block b; 0 in dry cells."""
    for i in range(n):
        h = b[i + (DEPTH + 1)]
        e = b[i + (SURFACE + 1)]
        u = b[i + (SPEED + 1)]
        dh, de = half_slopes(
            limiter,
            h - b[i + DEPTH],
            b[i + (DEPTH + 2)] - h,
            e - b[i + SURFACE],
            b[i + (SURFACE + 2)] - e,
        )
        du = 0.5 * slope(limiter, u - b[i + SPEED], b[i + (SPEED + 2)] - u)
        dh = min(max(dh, -0.5 * STEEPEST * h), 0.5 * STEEPEST * h)
        b[i + (D_DEPTH + 1)] = dh if h > 0.0 else 0.0
        b[i + (D_SURFACE + 1)] = de if h > 0.0 else 0.0
        b[i + (D_SPEED + 1)] = du if h > 0.0 else 0.0


@njit
def put_end_slopes(b, i, inner):
    """Write half the changes within cell i of the block b at an end of a conduit; inner : the cell next to it."""
    h, turn = b[i + DEPTH], 0.5 * (inner - i)
    wet = h > 0.0 and b[inner + DEPTH] > 0.0
    b[i + D_DEPTH] = turn * (h - max(2.0 * h - b[inner + DEPTH], 0.0)) if wet else 0.0
    b[i + D_SURFACE] = turn * (b[inner + SURFACE] - b[i + SURFACE]) if wet else 0.0
    b[i + D_SPEED] = turn * (b[inner + SPEED] - b[i + SPEED]) if wet else 0.0


@njit
def put_limited(limiter, flat, n, first, last, b):
    """Write half the changes within n cells of the block b.

    flat : True for changes of 0; first, last : True if the first, the last cell is at an end of its conduit
    """
    for i in range(n):
        b[i + D_DEPTH] = b[i + D_SURFACE] = b[i + D_SPEED] = 0.0
    if flat or n == 1:
        return
    by_limiter(put_slopes, limiter, n - 2, b)
    if first:
        put_end_slopes(b, 0, 1)
    if last:
        put_end_slopes(b, n - 1, n - 2)


@inline
def put_sides(section, n, b):
    """Write area, width and thrust integral at both faces of n cells to the block b."""
    for i in range(n):
        h, change = b[i + DEPTH], b[i + D_DEPTH]
        b[i + LOW_AREA], b[i + LOW_WIDTH], b[i + LOW_THRUST] = section_at_depth(section, h - change)
        b[i + HIGH_AREA], b[i + HIGH_WIDTH], b[i + HIGH_THRUST] = section_at_depth(
            section, h + change
        )


@njit(forceinline=True)
def numerical_flux(section, ul, ur, left, right):
    """(flow [m3/s], momentum flux minus the thrust of the left side, and minus that of the right side [m4/s2]).

    ul, ur : velocities of both sides; left, right : (area, width, thrust integral) of both sides
    """
    (al, wide_l, thrust_l), (ar, wide_r, thrust_r) = left, right
    cl, cr = celerity(section, wide_l, al), celerity(section, wide_r, ar)
    d_area, d_thrust = ar - al, section.g * (thrust_r - thrust_l)
    rl, rr = sqrt(al), sqrt(ar)
    mean, square = (rl * ul + rr * ur) / (rl + rr + TINY), max(d_thrust / d_area, 0.0)
    c = sqrt(square) if abs(d_area) > EVEN * (al + ar) else 0.5 * (cl + cr)
    low = min(ul - cl if al > 0.0 else ur - 3.0 * cr, mean - c if al > 0.0 and ar > 0.0 else inf)
    high = max(ur + cr if ar > 0.0 else ul + 3.0 * cl, mean + c if al > 0.0 and ar > 0.0 else -inf)
    low, high = min(low, 0.0), max(high, 0.0)
    ql, qr = al * ul, ar * ur
    return hll_flux(low, high, al, ar, ql, qr, ql * ul, qr * ur, d_thrust)


@inline
def put_fluxes(section, n, b):
    """Write the fluxes through n faces, each between cells i and i + 1 of the block b.

    Both sides of a face use the higher invert. The momentum fluxes of each side are those minus the thrust of its
    corrected depth.
    """
    for i in range(n):
        hl, el = b[i + DEPTH] + b[i + D_DEPTH], b[i + SURFACE] + b[i + D_SURFACE]
        hr = b[i + (DEPTH + 1)] - b[i + (D_DEPTH + 1)]
        er = b[i + (SURFACE + 1)] - b[i + (D_SURFACE + 1)]
        ul, ur = b[i + SPEED] + b[i + D_SPEED], b[i + (SPEED + 1)] - b[i + (D_SPEED + 1)]
        left_is_higher = el - hl >= er - hr
        h = hl + (er - el) if left_is_higher else hr + (el - er)
        area, width, thrust = section_at_depth(section, max(h, 0.0))
        al = b[i + HIGH_AREA]
        wide_l = b[i + HIGH_WIDTH]
        thrust_l = b[i + HIGH_THRUST]
        ar = b[i + (LOW_AREA + 1)]
        wide_r = b[i + (LOW_WIDTH + 1)]
        thrust_r = b[i + (LOW_THRUST + 1)]
        if left_is_higher:
            ar = area
            wide_r = width
            thrust_r = thrust
        else:
            al = area
            wide_l = width
            thrust_l = thrust
        left, right = (al, wide_l, thrust_l), (ar, wide_r, thrust_r)
        b[i + (FLOW + 1)], b[i + (BEFORE + 1)], b[i + (AFTER + 1)] = numerical_flux(
            section, ul, ur, left, right
        )


@inline
def put_rates(g, k, b, area_rates, flow_rates):
    """Write the rates of a row of cells of the block b: inflow minus outflow, and the forces of pressure and weight.

    Thrust minus weight along the invert changes by g A (e_r - e_l) within a cell, with the mean area A.
    k : 1 / length of cells [1/m]
    """
    for i in range(area_rates.size):
        h = b[i + DEPTH]
        rise = 2.0 * b[i + D_SURFACE]
        change = 2.0 * b[i + D_DEPTH]
        mean = (b[i + HIGH_THRUST] - b[i + LOW_THRUST]) / change
        mean = mean if abs(change) > 2.0 * EVEN * h else b[i + AREA]
        force = g * mean * rise
        area_rates[i] = k * b[i + FLOW] - k * b[i + (FLOW + 1)]
        flow_rates[i] = k * (b[i + AFTER] - (b[i + (BEFORE + 1)] + force))


@inline
def put_drag(section, rough, changes, b, seen, drag):
    """Write the decay rate of the flow over |Q| of a row of cells of the block b to `drag`, and the states to `seen`.

    changes : states of the area, on which alone it depends
    """
    for i in range(changes.size):
        # above 0: written
        drag[i] = drag_per_flow(section, rough, b[i + DEPTH], b[i + AREA]) + TINY
    for i in range(changes.size):
        seen[i] = changes[i]


@njit
def are_equal(a, b):
    """True if the numbers of two rows are equal."""
    count = 0
    for i in range(a.size):  # without an early end, so that it is vectorised
        count += a[i] != b[i]
    return count == 0


@inline
def add_friction(cap, flows, drag, b, flow_rates):
    """Add friction -r Q to the rates of flows Q, with r / (1 + r / cap) for r, and write r to the row WAVE of b.

    drag : decay rate over |Q|, see `put_drag`
    """
    for i in range(flows.size):
        rate = drag[i] * abs(flows[i])
        rate *= 1.0 / (1.0 + rate / cap)
        b[i + WAVE] = rate
        flow_rates[i] -= rate * flows[i]


@inline
def damp_row(h, flows, drag, rates, quick):
    """Divide the rates of flows Q by 1 + h R for friction, and write h R to `quick`; see `bed_friction.damp_flows`."""
    for i in range(flows.size):
        flow, per = flows[i], drag[i]
        rate = per * abs(flow)
        free = h * per * abs(flow + h * (rates[i] + rate * flow))
        damping = h * rate + 2.0 * free / (1.0 + sqrt(1.0 + 4.0 * free))
        rates[i] *= 1.0 / (1.0 + damping)
        quick[i] = damping


@njit
def greatest(n, row):
    """Greatest of the first n values of a row, 0 at least."""
    most = 0.0
    for i in range(n):
        most = max(most, row[i])
    return most
