"""Rates of the cells of conduits: area A and flow Q of a circular section that is partly full or full.

A_t + Q_x = 0, Q_t + (Q^2 / A + g I)_x = -g A z_x - g n^2 |Q| Q / (A R^(4/3)) - K |Q| Q / (2 L A), with the invert
z, the coefficient K of minor losses over the length L, the integral I of the area over the depth and the hydraulic
radius R. Cells are computed in blocks, see `conduit_cells`.
"""

from math import inf

from fvsolve.core.kernels.dtypes import CELL_FIELD, RATE, UPWIND
from fvsolve.features.basins.basin_patches import physics_code
from fvsolve.features.basins.conduit import conduit_cells as cells
from fvsolve.features.basins.conduit.conduit_cells import cell_state, fastest
from fvsolve.features.basins.tables import NO_DRAG, open_basins
from fvsolve.jit import njit
from fvsolve.parts.conduit.law import INSIDE, end_flow, end_state, read_state, section_at
from fvsolve.parts.conduit.law_section import celerity, section_at_depth

OWN_CODE = physics_code(__package__)
# constant data of cells at rest, the surface above the level at rest
AREA, DEPTH, SURFACE, PLANS = range(4)
# size of the block in the work array of a conduit; two rows of its cells follow
WORK = cells.ROWS * cells.STRIDE
OF_DEPTH, OF_AREA, OF_FLOW = range(3)  # quantities of probes


@njit(forceinline=True)
def read_cell(tables, basin, section, y, i):
    """(area, depth, surface above the level at rest, velocity) of cell i of a conduit."""
    n = basin["n"]
    plane = tables.plane
    at = basin["plan"] + i
    o = basin["y"] + i
    return cell_state(
        section, plane[at], plane[at + DEPTH * n], plane[at + SURFACE * n], y[o], y[o + n]
    )


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
    tables = open_basins(handle)
    st, layout = tables.settings[0], tables.layout[0]
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        if basin["kind"] != OWN_CODE:
            continue
        at = patch["inside"]
        turn = patch_turn(tables, patch)
        node = patch["node"]
        section = section_at(tables.plane, basin["table"])
        h, e, u = state_inside(tables, basin, section, y, turn)
        inside = end_state(section, h, e if h > 0.0 else patch["rest"], turn * u)
        for i in range(INSIDE):
            tables.work[at + i] = inside[i]
        cell = read_cell(tables, basin, section, y, tables.integers[patch["first"]])
        out[layout["pressure"] + node] = st["rho"] * st["gravity"] * (cell[2] - patch["lowest"])
        out[layout["supply"] + node] = 0.0
        out[layout["outflow_fraction"] + tables.nodes[node]["row"]] = 1.0
        out[layout["stiffness"] + tables.nodes[node]["row"]] = 0.0


@njit
def flux_at_end(tables, patch, section, out):
    """(inflow [m3/s], momentum flux minus the thrust inside [m4/s2], wave speed [m/s]) at an end of a conduit."""
    st = tables.settings[0]
    layout = tables.layout[0]
    valve = tables.valves[patch["valve"]]
    q = out[layout["valve"] + patch["valve"]] / st["rho"]
    drop = valve["drop"] + out[layout["pressure"] + valve["from_node"]]
    z = patch["lowest"] + drop / (st["rho"] * st["gravity"])
    inside = read_state(tables.work, patch["inside"])
    depth = end_flow(section, z, inside)[2]
    area, width, thrust = section_at_depth(section, depth)
    u = q / area if area > 0.0 else 0.0
    momentum = q * u + section.g * (thrust - inside[4])
    return q, momentum, abs(u) + fastest(section, area, celerity(section, width, area))


@njit
def end_fluxes(tables, b, section, out):
    """(flow, momentum) along the conduit at `from`, the same at `to`, and the greatest wave speed at both ends."""
    first = (0.0, 0.0)
    last = (0.0, 0.0)
    most = 0.0
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
def read_block(tables, basin, section, y, low, high, block):
    """Write area, depth, surface and velocity of the cells low to high - 1 of a conduit to a block."""
    n = basin["n"]
    plane = tables.plane
    at = basin["plan"]
    o = basin["y"]
    rest = (
        plane[at + low : at + high],
        plane[at + n + low : at + n + high],
        plane[at + 2 * n + low : at + 2 * n + high],
    )
    cells.put_cells(section, *rest, y[o + low : o + high], y[o + n + low : o + n + high], block)


@njit
def drag_rows(tables, basin, first, last):
    """Rows `seen` and `drag` of the cells first to last - 1 for `conduit_cells.put_drag`."""
    at = basin["work"] + WORK
    return tables.work[at + first : at + last], tables.work[
        at + basin["n"] + first : at + basin["n"] + last
    ]


@njit
def rough_wall(tables, basin):
    """Argument `rough` of `conduit_cells.drag_per_flow`."""
    return tables.plane[basin["roughness"]], tables.plane[basin["roughness"] + 1]


@njit
def block_rates(tables, b, section, y, dydt, first, last, ends):
    """Write the rates of cells first to last - 1; return (greatest (|u| + c) / dx, greatest decay rate) there [1/s].

    ends : ((flow, momentum) at `from`, the same at `to`)
    """
    basin, st = tables.basins[b], tables.settings[0]
    n = basin["n"]
    o = basin["y"]
    k = tables.plane[basin["spacing"]]
    low, high = max(first - 2, 0), min(last + 2, n)
    count, at = high - low, first - low
    block = tables.work[basin["work"] : basin["work"] + WORK]
    read_block(tables, basin, section, y, low, high, block)
    cells.put_waves(section, count, block)
    most = k * cells.greatest(last - first, block[at + cells.WAVE :])
    cells.put_limited(
        basin["limiter"], basin["scheme"] == UPWIND, count, low == 0, high == n, block
    )
    cells.put_sides(section, count, block)
    cells.put_fluxes(section, count - 1, block)
    if first == 0:
        block[cells.FLOW], block[cells.AFTER] = ends[0]
    if last == n:
        block[count + cells.FLOW], block[count + cells.BEFORE] = ends[1]
    # for scalars: times the width; walls at ends
    for i in range(max(first, 1), last if basin["flows"] >= 0 else 0):
        tables.work[basin["flows"] + i] = section.diameter * block[i - low + cells.FLOW]
    own, flow_rates = block[at:], dydt[o + n + first : o + n + last]
    cells.put_rates(st["gravity"], k, own, dydt[o + first : o + last], flow_rates)
    if basin["friction"] == NO_DRAG:
        return most, 0.0
    rough, flows = rough_wall(tables, basin), y[o + n + first : o + n + last]
    seen, drag = drag_rows(tables, basin, first, last)
    cells.put_drag(section, rough, y[o + first : o + last], own, seen, drag)
    cells.add_friction(basin["held"], flows, drag, own, flow_rates)
    return most, cells.greatest(last - first, own[cells.WAVE :])


@njit
def conduit_rates(t, y, dydt, out, handle):
    """Write the rates of the cells of all conduits; out[RATE], which limits the step, is raised."""
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] != OWN_CODE or dydt.size == 0:
            continue
        n, section = basin["n"], section_at(tables.plane, basin["table"])
        from_end, to_end, most = end_fluxes(tables, b, section, out)
        rate = most * tables.plane[basin["spacing"]]
        for first in range(0, n, cells.MOST_CELLS):
            last = min(first + cells.MOST_CELLS, n)
            waves, decay = block_rates(tables, b, section, y, dydt, first, last, (from_end, to_end))
            rate = max(rate, waves)
            if basin["held"] < inf:
                out[RATE] = max(out[RATE], 2.0 * decay)
        out[RATE] = max(out[RATE], basin["unsplit"] * rate)


@njit
def add_end_scalars(t, y, dydt, out, handle):
    """Add the scalars in the flows through the ends of conduits to the rates of the amounts in the cells there."""
    tables = open_basins(handle)
    layout, nodes = tables.layout[0], tables.nodes.size
    for k in range(tables.patches.size if dydt.size > 0 else 0):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        if basin["kind"] != OWN_CODE:
            continue
        flow = out[layout["valve"] + patch["valve"]]
        at = basin["carried"] + tables.integers[patch["first"]]
        node = tables.valves[patch["valve"]]["from_node"] if flow > 0.0 else patch["node"]
        per = tables.plane[basin["spacing"]] * flow / tables.settings[0]["rho"]
        for q in range(tables.scalars.size):
            dydt[at + q * basin["n"]] += per * out[layout["value"] + q * nodes + node]


@njit
def damp_conduits(h, y, rates, quick, handle):
    """Divide the rates of flows by 1 + h R for friction, and write h R to `quick`; see `bed_friction.damp_flows`."""
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] != OWN_CODE or basin["damped"] == 0:
            continue
        n = basin["n"]
        o = basin["y"]
        section = section_at(tables.plane, basin["table"])
        for first in range(0, n, cells.MOST_CELLS):
            last = min(first + cells.MOST_CELLS, n)
            seen, drag = drag_rows(tables, basin, first, last)
            # not the state of the last rates
            if drag[0] == 0.0 or not cells.are_equal(seen, y[o + first : o + last]):
                block = tables.work[basin["work"] : basin["work"] + WORK]
                read_block(tables, basin, section, y, first, last, block)
                cells.put_drag(
                    section, rough_wall(tables, basin), y[o + first : o + last], block, seen, drag
                )
            low, high = o + n + first, o + n + last
            cells.damp_row(h, y[low:high], drag, rates[low:high], quick[low:high])


@njit
def observe_conduits(t, y, out, handle, values):
    """Write the values of probes in conduits: scale times depth [m], area [m2] or flow [m3/s], plus offset."""
    tables = open_basins(handle)
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        if probe["kind"] != CELL_FIELD or tables.basins[probe["index"]]["kind"] != OWN_CODE:
            continue
        basin, total = tables.basins[probe["index"]], 0.0
        section = section_at(tables.plane, basin["table"])
        n = basin["n"]
        o = basin["y"]
        for m in range(probe["count"]):
            i, weight = tables.integers[probe["cell"] + m], tables.floats[probe["weights"] + m]
            area, h, _, _ = read_cell(tables, basin, section, y, i)
            total += weight * (
                h
                if probe["side"] == OF_DEPTH
                else area
                if probe["side"] == OF_AREA
                else y[o + n + i]
            )
        values[k] = probe["scale"] * total + probe["offset"]
