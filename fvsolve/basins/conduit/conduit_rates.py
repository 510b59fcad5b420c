"""Rates of the cells of conduits: area A and flow Q of a circular section that is partly full or full.

A_t + Q_x = 0, Q_t + (Q^2 / A + g I)_x = -g A z_x - g n^2 |Q| Q / (A R^(4/3)), with the invert z, the integral I of the
area over the depth and the hydraulic radius R. Depth h and surface e at faces have limited slopes; both sides of a face
use the higher invert (Audusse et al. 2004). Fluxes are those of Harten, Lax and van Leer with the speeds of Einfeldt.
Momentum fluxes are differences from the thrust g I of each side, so that water at rest stays at rest to the bit.
"""

from math import inf, pi, sqrt

from fvsolve.basins.basin_patches import physics_code
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import CELL_FIELD, NO_DRAG, RATE, UPWIND
from fvsolve.kernels.reconstruction import limited
from fvsolve.kernels.table_handle import open_tables
from fvsolve.parts.conduit.law import end_flow, section_at
from fvsolve.parts.conduit.law_section import (
    area_of,
    celerity,
    depth_of,
    hydraulic_radius_power,
    width_and_thrust,
)

OWN_CODE = physics_code(__package__)
AREA, DEPTH, SURFACE, PLANS = range(4)  # constant data of cells at rest, the surface above the level at rest
WORK = 3  # work arrays of cells: depth, surface above the level at rest, velocity
OF_DEPTH, OF_AREA, OF_FLOW = range(3)  # quantities of probes
NEARLY_FULL = 0.7  # share of the full section from which on steps follow the surcharge celerity
THIN = 1e-7  # share of the full section below which velocities fade
STEEPEST = 1.0  # greatest change of depth within a cell, over its depth
EVEN = 1e-6  # relative change of depth within a cell below which its mean area is that at the mean depth
TINY = 1e-300


@njit(forceinline=True)
def fastest(section, area, c):
    """Speed of waves that limits the step [m/s]: that of the slot from the share NEARLY_FULL of the full section on."""
    if area < NEARLY_FULL * section.area:
        return c
    return max(c, sqrt(section.g * section.area / section.slot))


@njit(forceinline=True)
def velocity_factor(section, area):
    """Velocity over flow [1/m2]: 1 / area, but towards 0 in thin water."""
    wet = max(area, THIN * section.area)
    return 2.0 * area / (area * area + wet * wet)


@njit(forceinline=True)
def drag_per_flow(section, n, h, area):
    """Decay rate of the flow by friction over the flow |Q| [1/m3]; n : Manning's number.

    The slot has weight, but no velocity: in the full section the slope of friction is that at the velocity Q / A_f.
    """
    full = 0.25 * pi * section.diameter * section.diameter
    share = velocity_factor(section, area) if area < full else area / (full * full)
    return section.g * n * n * share * hydraulic_radius_power(section, h, min(area, full))


@njit(forceinline=True)
def read_cell(tables, basin, section, y, i):
    """(area, depth, surface above the level at rest, velocity) of cell i of a conduit."""
    n, plane, at, o = basin["n"], tables.plane, basin["plan"], basin["y"]
    change = y[o + i]
    area, h = max(plane[at + i] + change, 0.0), plane[at + DEPTH * n + i]
    rest = h
    if change != 0.0:  # so that water at rest has the same depth to the bit
        h = depth_of(section, area)
    surface = plane[at + SURFACE * n + i] + (h - rest)
    return area, h, surface, velocity_factor(section, area) * y[o + n + i]


@njit
def state_inside(tables, basin, section, y, turn):
    """(depth, surface, velocity) at an end of a conduit from the two cells next to it; turn : 1 for `from`, -1 for `to`

    The surface is extrapolated linearly, and so is the depth of water with both cells wet.
    """
    n = basin["n"]
    i = 0 if turn > 0 else n - 1
    _, h, e, u = read_cell(tables, basin, section, y, i)
    if n == 1 or not h > 0.0 or basin["scheme"] == UPWIND:
        return h, e, u
    _, h2, e2, u2 = read_cell(tables, basin, section, y, i + turn)
    if not h2 > 0.0:
        return h, e, u
    return 0.5 * (h + max(2.0 * h - h2, 0.0)), e + 0.5 * (e - e2), u + 0.5 * (u - u2)


@njit
def patch_turn(tables, patch):
    """1 for the end `from` of a conduit, -1 for the end `to`."""
    return 1 if tables.plane[patch["normals"]] < 0.0 else -1


@njit
def read_ends(t, y, dydt, out, handle):
    """Write the states inside the ends of all conduits to work arrays, and the pressures of the cells there to `out`.

    A dry end has its surface at the invert. The pressure is the change since the start [Pa].
    """
    tables = open_tables(handle)
    st, layout = tables.settings[0], tables.layout[0]
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        if basin["kind"] != OWN_CODE:
            continue
        at, turn, node = patch["inside"], patch_turn(tables, patch), patch["node"]
        section = section_at(tables.plane, basin["table"])
        h, e, u = state_inside(tables, basin, section, y, turn)
        tables.work[at], tables.work[at + 1], tables.work[at + 2] = h, e if h > 0.0 else patch["rest"], turn * u
        cell = read_cell(tables, basin, section, y, tables.integers[patch["first"]])
        out[layout["pressure"] + node] = st["rho"] * st["gravity"] * (cell[2] - patch["lowest"])
        out[layout["supply"] + node] = 0.0
        out[layout["outflow_fraction"] + tables.nodes[node]["row"]] = 1.0
        out[layout["stiffness"] + tables.nodes[node]["row"]] = 0.0


@njit(forceinline=True)
def numerical_flux(section, hl, ul, hr, ur, left, right):
    """(flow [m3/s], momentum flux minus the thrust of the left side, and minus that of the right side [m4/s2]).

    hl, ul, hr, ur : depth and velocity of both sides; left, right : (area, width, thrust integral) of both sides
    """
    (al, wide_l, thrust_l), (ar, wide_r, thrust_r) = left, right
    if not al + ar > 0.0:
        return 0.0, 0.0, 0.0
    cl, cr = celerity(section, wide_l, al), celerity(section, wide_r, ar)
    d_area, d_thrust = ar - al, section.g * (thrust_r - thrust_l)
    if not al > 0.0:
        low, high = ur - 3.0 * cr, ur + cr
    elif not ar > 0.0:
        low, high = ul - cl, ul + 3.0 * cl
    else:
        rl, rr = sqrt(al), sqrt(ar)
        mean, c = (rl * ul + rr * ur) / (rl + rr), 0.5 * (cl + cr)
        if abs(d_area) > EVEN * (al + ar):
            c = sqrt(max(d_thrust / d_area, 0.0))
        low, high = min(ul - cl, mean - c), max(ur + cr, mean + c)
    low, high = min(low, 0.0), max(high, 0.0)
    ql, qr = al * ul, ar * ur
    d_flow, per = qr - ql, 1.0 / (high - low + TINY)
    jump = (qr * ur - ql * ul) + d_thrust
    flow = ql + low * per * (high * d_area - d_flow)
    return flow, ql * ul + low * per * (high * d_flow - jump), qr * ur + high * per * (low * d_flow - jump)


@njit(forceinline=True)
def side(section, h):
    """(area, width, thrust integral) at a depth h."""
    area = area_of(section, h)
    width, thrust = width_and_thrust(section, h, area)
    return area, width, thrust


@njit(forceinline=True)
def face_flux(section, hl, el, ul, left, hr, er, ur, right):
    """`numerical_flux` at a face at which both sides use the higher invert; e : surfaces; others as there.

    The momentum fluxes of each side are those minus the thrust of its corrected depth.
    """
    if el - hl >= er - hr:
        h = max(hl + (er - el), 0.0)
        other = right if h == hr else side(section, h)
        return numerical_flux(section, hl, ul, h, ur, left, other)
    h = max(hr + (el - er), 0.0)
    other = left if h == hl else side(section, h)
    return numerical_flux(section, h, ul, hr, ur, other, right)


@njit(forceinline=True)
def thrust_change(section, hl, el, left, hr, er, right):
    """Change of thrust minus weight along the invert within a cell, g A (e_r - e_l) with the mean area A [m4/s2]."""
    rise = er - el
    if rise == 0.0:
        return 0.0
    if abs(hr - hl) > EVEN * (hl + hr):
        return section.g * ((right[2] - left[2]) / (hr - hl)) * rise
    return section.g * area_of(section, 0.5 * (hl + hr)) * rise


@njit(forceinline=True)
def slopes(work, n, i, first_order, limiter):
    """Half the changes of depth, surface and velocity within cell i; one-sided at the ends of a conduit."""
    if first_order or n == 1:
        return 0.0, 0.0, 0.0
    h = work[i]
    if i == 0 or i == n - 1:
        step = 1 if i == 0 else -1
        if not (h > 0.0 and work[i + step] > 0.0):
            return 0.0, 0.0, 0.0
        inner, turn = i + step, 0.5 * step
        change = 0.5 * (h - max(2.0 * h - work[inner], 0.0)) * step
        return change, turn * (work[n + inner] - work[n + i]), turn * (work[2 * n + inner] - work[2 * n + i])
    if not h > 0.0:
        return 0.0, 0.0, 0.0
    change = 0.5 * limited(limiter, h - work[i - 1], work[i + 1] - h)
    change = min(max(change, -0.5 * STEEPEST * h), 0.5 * STEEPEST * h)
    e, u = work[n + i], work[2 * n + i]
    rise = 0.5 * limited(limiter, e - work[n + i - 1], work[n + i + 1] - e)
    return change, rise, 0.5 * limited(limiter, u - work[2 * n + i - 1], work[2 * n + i + 1] - u)


@njit
def flux_at_end(tables, patch, section, out):
    """(inflow [m3/s], momentum flux minus the thrust inside [m4/s2], wave speed [m/s]) at an end of a conduit."""
    st, layout, valve, at = tables.settings[0], tables.layout[0], tables.valves[patch["valve"]], patch["inside"]
    q = out[layout["valve"] + patch["valve"]] / st["rho"]
    drop = valve["drop"] + out[layout["pressure"] + valve["from_node"]]
    z = patch["lowest"] + drop / (st["rho"] * st["gravity"])
    depth = end_flow(section, z, tables.work[at], tables.work[at + 1], tables.work[at + 2])[2]
    area, width, thrust = side(section, depth)
    u = q / area if area > 0.0 else 0.0
    momentum = q * u + section.g * (thrust - side(section, tables.work[at])[2])
    return q, momentum, abs(u) + fastest(section, area, celerity(section, width, area))


@njit
def end_fluxes(tables, b, section, out):
    """(flow, momentum) along the conduit at `from`, the same at `to`, and the greatest wave speed at both ends."""
    first, last, most = (0.0, 0.0), (0.0, 0.0), 0.0
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        if patch["basin"] == b:
            if patch_turn(tables, patch) > 0:
                q, momentum, speed = flux_at_end(tables, patch, section, out)
                first = (q, momentum)
            else:
                q, momentum, speed = flux_at_end(tables, patch, section, out)
                last = (-q, momentum)
            most = max(most, speed)
    return first, last, most


@njit
def put_states(tables, basin, section, y, rates, out):
    """Write depth, surface and velocity of cells to the work array and friction to the rates; return the step's rate.

    rates : rates of the flows of cells; the rate is the greatest (|u| + c) / dx [1/s].
    """
    n, o, k, most = basin["n"], basin["y"], tables.plane[basin["spacing"]], 0.0
    work, rough = tables.work[basin["work"] : basin["work"] + WORK * n], tables.plane[basin["roughness"]]
    for i in range(n):
        area, h, e, u = read_cell(tables, basin, section, y, i)
        work[i], work[n + i], work[2 * n + i] = h, e, u
        c = celerity(section, width_and_thrust(section, h, area)[0], area)
        most = max(most, abs(u) + fastest(section, area, c))
        rate = 0.0
        if basin["friction"] != NO_DRAG and area > 0.0:
            rate = drag_per_flow(section, rough, h, area) * abs(y[o + n + i])
            if basin["held"] < inf:
                rate /= 1.0 + rate / basin["held"]
                out[RATE] = max(out[RATE], 2.0 * rate)
        rates[i] = -rate * y[o + n + i]
    return most * k


@njit
def add_fluxes(tables, b, section, area_rates, flow_rates, out):
    """Write the rates of areas and add those of flows by fluxes; return the greatest rate at the ends [1/s]."""
    basin = tables.basins[b]
    n, k, first_order, limiter = basin["n"], tables.plane[basin["spacing"]], basin["scheme"] == UPWIND, basin["limiter"]
    work = tables.work[basin["work"] : basin["work"] + WORK * n]
    first, last, most = end_fluxes(tables, b, section, out)
    hr, er, ur, right, inner = 0.0, 0.0, 0.0, (0.0, 0.0, 0.0), 0.0
    for i in range(n):
        dh, de, du = slopes(work, n, i, first_order, limiter)
        h, e, u = work[i], work[n + i], work[2 * n + i]
        hl, el, ul = h - dh, e - de, u - du
        left = side(section, hl)
        flow, before, after = first[0], 0.0, first[1]
        if i > 0:
            flow, before, after = face_flux(section, hr, er, ur, right, hl, el, ul, left)
            area_rates[i - 1] -= k * flow
            flow_rates[i - 1] -= k * (before + inner)
        hr, er, ur = h + dh, e + de, u + du
        right = side(section, hr) if dh != 0.0 else left
        area_rates[i] = k * flow
        flow_rates[i] += k * after
        inner = thrust_change(section, hl, el, left, hr, er, right)
    area_rates[n - 1] -= k * last[0]
    flow_rates[n - 1] -= k * (last[1] + inner)
    return most * k


@njit
def conduit_rates(t, y, dydt, out, handle):
    """Write the rates of the cells of all conduits; out[RATE], which limits the step, is raised."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] != OWN_CODE or dydt.size == 0:
            continue
        n, o, section = basin["n"], basin["y"], section_at(tables.plane, basin["table"])
        area_rates, flow_rates = dydt[o : o + n], dydt[o + n : o + 2 * n]
        rate = put_states(tables, basin, section, y, flow_rates, out)
        rate = max(rate, add_fluxes(tables, b, section, area_rates, flow_rates, out))
        out[RATE] = max(out[RATE], basin["unsplit"] * rate)


@njit
def damp_conduits(h, y, rates, quick, handle):
    """Divide the rates of flows by 1 + h R for friction, and write h R to `quick`; see `bed_friction.damp_flows`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] != OWN_CODE or basin["damped"] == 0:
            continue
        n, o, section = basin["n"], basin["y"], section_at(tables.plane, basin["table"])
        for i in range(n):
            area, deep, _, _ = read_cell(tables, basin, section, y, i)
            flow, damping = y[o + n + i], 0.0
            if area > 0.0:
                per = drag_per_flow(section, tables.plane[basin["roughness"]], deep, area)
                rate = per * abs(flow)
                free = h * per * abs(flow + h * (rates[o + n + i] + rate * flow))
                damping = h * rate + 2.0 * free / (1.0 + sqrt(1.0 + 4.0 * free))
            rates[o + n + i] /= 1.0 + damping
            quick[o + n + i] = damping


@njit
def observe_conduits(t, y, out, handle, values):
    """Write the values of probes in conduits: scale times depth [m], area [m2] or flow [m3/s], plus offset."""
    tables = open_tables(handle)
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        if probe["kind"] != CELL_FIELD or tables.basins[probe["index"]]["kind"] != OWN_CODE:
            continue
        basin, total = tables.basins[probe["index"]], 0.0
        section, n, o = section_at(tables.plane, basin["table"]), basin["n"], basin["y"]
        for m in range(probe["count"]):
            i, weight = tables.integers[probe["cell"] + m], tables.floats[probe["weights"] + m]
            area, h, _, _ = read_cell(tables, basin, section, y, i)
            total += weight * (h if probe["side"] == OF_DEPTH else area if probe["side"] == OF_AREA else y[o + n + i])
        values[k] = probe["scale"] * total + probe["offset"]
