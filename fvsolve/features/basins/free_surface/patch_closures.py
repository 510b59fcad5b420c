"""Driven patches of water with a free surface: a level that a schedule, a rating or a slope determines.

A face of a patch, with depth h and inward velocity u in the cell behind it, sends the invariant u - 2 c outward,
c = sqrt(g h). If the surface at the face has the height z, the depth there is h_b = z - bed, c_b = sqrt(g h_b), the
velocity u_b = u + 2 (c_b - c), and the inflow per width q = h_b u_b, with dq/dz = u_b + c_b. Outflow is at most
critical: then c_b = (2 c - u) / 3. Inflow is at most critical too. An outflow faster than waves takes the state of the
cell, up to the level at which less would leave. A level below the bed is thus a free overfall, and a dry face above the
level passes nothing. The flow of a patch rises with its level, so each closure has one root: the level itself (stage),
the sum of flows (discharge), a rating of outflow over level, or the flow of uniform depth on a slope at each face. The
flow through a patch that links join balances theirs (`law_patch_face`); its faces then share this flow like a
discharge.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels.cube_root import cube_root_reciprocal
from fvsolve.core.kernels.dtypes import PATCH_FROUDE
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.features.basins.basin_patches import physics_code
from fvsolve.features.basins.cell_sides import deviations_of
from fvsolve.features.basins.free_surface.surface_rows import THIN
from fvsolve.features.basins.hll_flux import TINY
from fvsolve.features.basins.tables import (
    CRITICAL,
    DISCHARGE,
    INTERIOR,
    LINKED,
    NO_CLOSURE,
    NORMAL_SLOPE,
    RATING,
    STAGE,
    open_basins,
)
from fvsolve.jit import njit

OWN_CODE = physics_code(__package__)
# Rows of the work array of driven faces: inflow per width, its momentum q^2 / h_b, surface above the level at rest,
# greatest wave speed |u_b| + c_b (0 at faces that are not driven, DRY_FACE at dry faces); on meshes bed, surface and
# both velocities at the mirror image of the centre of the cell behind. All in the order of boundary faces.
FLOW, MOMENTUM, SURFACE, SPEED, BEYOND, ROWS = 0, 1, 2, 3, 4, 8
STENCIL = 9  # cells around a cell of a mesh, from which states at its driven face are extrapolated
ITERATIONS = 100
ROUNDING = 1e-15  # relative error of a flow at which a level is accepted
# Depth of critical flow below which an outflow counts as rounding: of a schedule that passes zero, or of its end [m].
FILM = 1e-7
HELD = 1e-9  # relative difference of a discharge from its schedule above which it counts as held
# Level of the links of a patch below its bed [m], farther than any network falls, from which on they may draw more than
# critical outflow (`law_patch_face`); the rest is supplied from outside.
DEEPEST = 2e3
DRY_FACE = -1.0  # entry in the row SPEED of a dry face of a driven patch
LEAST_RISE = 1e-3  # first rise of the level in the search for an upper bound [m]


@njit(forceinline=True)
def driven_range(basin):
    """(offset in `work`, number of boundary faces) of the work array of driven faces; (0, 0) without driven patches."""
    return (basin["driven"], basin["outer"]) if basin["driven"] >= 0 else (0, 0)


class DrivenFaces(NamedTuple):
    """Driven faces of a basin. values : float64[ROWS, outer]  rows FLOW to SPEED at boundary faces"""

    values: np.ndarray


@njit
def driven_faces(tables, basin):
    """`DrivenFaces` of a basin with driven patches."""
    first, outer = driven_range(basin)
    return DrivenFaces(tables.work[first : first + ROWS * outer].reshape((ROWS, outer)))


@njit
def face_flow(g, z, h, e, u):
    """(inflow q per width [m2/s], dq/dz [m/s], depth [m]) at a face with the surface z.

    h, e, u : depth, surface and inward velocity of the cell behind the face; z and e count from the level at rest
    """
    c, depth = sqrt(g * h), max(h + (z - e), 0.0)
    speed = sqrt(g * depth)
    own = u + 2.0 * (speed - c)
    if h > 0.0 and -u >= c and (own < -speed or depth * own <= h * u):
        return h * u, 0.0, h
    if own < -speed:
        speed = max((2.0 * c - u) / 3.0, 0.0)
        return -speed * speed * speed / g, 0.0, speed * speed / g
    if own > speed:
        return depth * speed, 1.5 * speed, depth
    return depth * own, own + speed, depth


@njit
def depth_at_wall(g, h, u):
    """Depth at a face without flow, by the invariant u - 2 c of the cell behind it; h, u : as for `face_flow`"""
    c = sqrt(g * h)
    return max(h + u * (0.25 * u - c) / g, 0.0) if u < 2.0 * c else 0.0


@njit
def patch_flow(g, z, faces):
    """(inflow [m3/s], its derivative by z [m2/s]) through all faces with the surface z.

    faces : (depth, surface, inward velocity, length) of the faces, four arrays
    """
    h, e, u, lengths = faces
    total, slope = 0.0, 0.0
    for m in range(h.size):
        q, change, _ = face_flow(g, z, h[m], e[m], u[m])
        total += lengths[m] * q
        slope += lengths[m] * change
    return total, slope


@njit
def rated_flow(levels, flows, z):
    """(outflow [m3/s], its derivative by the level [m2/s]) of a rating: zero below its first point, then linear.

    levels : increasing levels [m]; flows : outflows [m3/s]
    """
    if z <= levels[0]:
        return 0.0, 0.0
    k = 1
    while k < levels.size - 1 and z > levels[k]:
        k += 1
    slope = (flows[k] - flows[k - 1]) / (levels[k] - levels[k - 1])
    return flows[k - 1] + slope * (z - levels[k - 1]), slope


@njit
def excess(g, z, faces, target, rest, levels, flows):
    """(inflow minus that of the closure, its derivative by z).

    target : scheduled discharge [m3/s]; rest : level at rest [m]; levels, flows : rating, empty for a discharge
    """
    total, slope = patch_flow(g, z, faces)
    if levels.size == 0:
        return total - target, slope
    leaving, change = rated_flow(levels, flows, rest + z)
    return total + leaving, slope + change


@njit
def first_level(g, faces, target):
    """First estimate of the level of a patch: mean surface of wet faces, or critical inflow over the lowest dry bed."""
    h, e, _, lengths = faces
    wet = 0.0
    total = 0.0
    low = e[0]
    wide = 0.0
    for m in range(h.size):
        wide += lengths[m]
        low = min(low, e[m])
        if h[m] > 0.0:
            wet += lengths[m]
            total += lengths[m] * e[m]
    if wet > 0.0:
        return total / wet
    unit = max(target, 0.0) / wide
    return low + (1.0 / cube_root_reciprocal(unit * unit / g) if unit > 0.0 else 0.0)


@njit
def lowest_bed(faces):
    """Lowest bed at the faces of a patch, above the level at rest [m]. faces : as for `patch_flow`"""
    low = faces[1][0] - faces[0][0]
    for m in range(faces[0].size):
        low = min(low, faces[1][m] - faces[0][m])
    return low


@njit
def solve_level(g, faces, target, rest, levels, flows):
    """Level at which a patch has its discharge or rated flow; the lowest bed if the outflow would be above critical.

    Newton's method within bounds; other arguments as for `excess`.
    """
    z = first_level(g, faces, target)
    f, slope = excess(g, z, faces, target, rest, levels, flows)
    if f == 0.0:
        return z
    low = high = z
    if f < 0.0:
        rise = LEAST_RISE
        while excess(g, high, faces, target, rest, levels, flows)[0] < 0.0 and rise < 1e9:
            low = high
            high = high + rise
            rise = 4.0 * rise
        if rise >= 1e9:  # the flow is not finite
            return z
    else:
        low = min(low, lowest_bed(faces))
        if excess(g, low, faces, target, rest, levels, flows)[0] >= 0.0:
            return low
    for _ in range(ITERATIONS):
        new = z - f / slope if slope > 0.0 else 0.5 * (low + high)
        if not low < new < high:
            new = 0.5 * (low + high)
        if new == z or not low < new < high:
            break
        z = new
        f, slope = excess(g, z, faces, target, rest, levels, flows)
        if f < 0.0:
            low = z
        else:
            high = z
        if abs(f) <= ROUNDING * abs(target):
            break
    return z


@njit
def uniform_depth(g, h, e, u, conveyance):
    """Surface at which the outflow of a face is that of uniform flow, conveyance * depth^(5/3), above the rest level.

    conveyance : sqrt(slope) / Manning's n [m^(1/3)/s]; h, e, u : as for `face_flow`
    """
    low = e - h
    high = e + max(h, LEAST_RISE)
    z = e
    for _ in range(ITERATIONS):
        q, change, depth = face_flow(g, z, h, e, u)
        deep = h + (z - e)
        root = 1.0 / cube_root_reciprocal(deep) if deep > 0.0 else 0.0
        f = q + conveyance * deep * root * root
        slope = change + 5.0 / 3.0 * conveyance * root * root
        if f == 0.0:
            break
        if f < 0.0:
            low = z
            if high <= z:
                high = z + 2.0 * (z - (e - h)) + LEAST_RISE
        else:
            high = z
        new = z - f / slope if slope > 0.0 else 0.5 * (low + high)
        if not low < new:
            new = 0.5 * (low + z)
        if new == z:
            break
        z = new
    return z


@njit
def read_cell(plane, basin, k, x, y, deviations):
    """(depth, surface above the level at rest, velocity against the normal (x, y)) of cell k."""
    n, o = basin["n"], basin["y"]
    depth = max(plane[basin["plan"] + k] + deviations[o + k], 0.0)
    wet = max(depth, THIN)
    share = 2.0 * depth / (depth * depth + wet * wet)
    across = deviations[o + n + k] * x + deviations[o + 2 * n + k] * y
    return depth, plane[basin["plan"] + n + k] + deviations[o + k], -share * across


@njit
def faces_inside(tables, patch):
    """Four arrays of the state inside the faces of a patch, see `read_faces`."""
    return faces_at(tables.work, patch["inside"], patch["faces"])


@njit
def faces_at(work, at, n):
    """Four arrays of the state inside n faces, from index `at` of the array `work` on."""
    rows = work[at : at + 4 * n]
    return rows[:n], rows[n : 2 * n], rows[2 * n : 3 * n], rows[3 * n :]


@njit
def read_faces(tables, patch, y):
    """Write the state inside the faces of a patch to its work array; return four arrays.

    They are depth, surface above the level at rest, inward velocity, and length of the faces. y : deviations of cells
    """
    basin = tables.basins[patch["basin"]]
    plane = tables.plane
    integers = tables.integers
    count, at = patch["faces"], patch["normals"]
    h, e, u, lengths = faces_inside(tables, patch)
    for m in range(count):
        k, inner = integers[patch["ring"] + count + m], integers[patch["second"] + m]
        nx, ny = plane[at + m], plane[at + count + m]
        h[m], e[m], u[m] = read_cell(plane, basin, k, nx, ny, y)
        if patch["stencil"] == STENCIL:
            h[m], e[m], u[m] = read_around(tables, patch, m, y)
        elif inner != k and h[m] > 0.0:
            depth, surface, inward = read_cell(plane, basin, inner, nx, ny, y)
            # linear extrapolation from two cells, as in the ghost cells of the rates
            if depth > 0.0:
                h[m] = 0.5 * (h[m] + max(2.0 * h[m] - depth, 0.0))
                e[m] += 0.5 * (e[m] - surface)
                u[m] += 0.5 * (u[m] - inward)
        lengths[m] = plane[at + 2 * count + m] * plane[basin["area"] + k]
    if patch["neighbours"] >= 0:
        smooth_inflow(tables, patch, h, u)
    return h, e, u, lengths


@njit
def read_around(tables, patch, m, y):
    """(depth, surface, inward velocity) at the middle of face m of a patch of a mesh, by linear extrapolation.

    The state at the mirror image of the centre is written to the rows from BEYOND on. Both are the values of the cell
    behind plus the sum of weights times differences of the STENCIL cells around it from this cell, if all are wet.
    """
    basin = tables.basins[patch["basin"]]
    plane = tables.plane
    integers = tables.integers
    count, (first, outer) = patch["faces"], driven_range(basin)
    nx, ny = plane[patch["normals"] + m], plane[patch["normals"] + count + m]
    k, second = integers[patch["ring"] + count + m], integers[patch["second"] + STENCIL * m :]
    weights = plane[patch["weights"] + 2 * STENCIL * m :]
    h, e, u = read_cell(plane, basin, k, nx, ny, y)
    # along the face: not extrapolated, or its differences would grow
    v = read_cell(plane, basin, k, -ny, nx, y)[2]
    deeper = 0.0
    higher = 0.0
    faster = 0.0
    wet = h > 0.0
    bed = e - h
    surface = e
    across = u
    for j in range(STENCIL):
        depth, level, inward = read_cell(plane, basin, second[j], nx, ny, y)
        near = weights[2 * j]
        far = weights[2 * j + 1]
        wet = wet and depth > 0.0
        deeper += near * (depth - h)
        higher += near * (level - e)
        faster += near * (inward - u)
        bed += far * ((level - depth) - (e - h))
        surface += far * (level - e)
        across += far * (inward - u)
    if not wet:
        deeper = 0.0
        higher = 0.0
        faster = 0.0
        bed = e - h
        surface = e
        across = u
    at = first + BEYOND * outer + integers[patch["ring"] + m]
    tables.work[at], tables.work[at + outer] = bed, surface
    tables.work[at + 2 * outer], tables.work[at + 3 * outer] = (
        v * ny - across * nx,
        -across * ny - v * nx,
    )
    # differences of the velocity are bounded as at other sides of the cell
    c = sqrt(tables.settings[0]["gravity"] * h)
    depth, level = min(max(h + deeper, 0.5 * h), 2.0 * h), e + higher
    if depth != h + deeper:  # the bed is no lower than that of the cell and the extrapolated one
        level = max(level, (e - h) + min(higher - deeper, 0.0) + depth)
    return depth, level, u + min(max(faster, -c), c)


@njit
def smooth_inflow(tables, patch, h, u):
    """Replace velocities u into the basin by means, weighted by depth h, over three faces along the patch.

    Inflow would otherwise have the velocity of the cell behind its face, whatever that is: on triangles, differences
    from face to face then grow. A mean lies between 0 and twice the velocity of its face, so that it is continuous
    where this velocity passes zero: a jump of the rates there has no solution for implicit stages. The neighbours of a
    face with a quadrilateral behind it are the face itself.
    """
    n, neighbours = h.size, tables.integers[patch["neighbours"] :]
    as_read = tables.work[patch["inside"] + 4 * n : patch["inside"] + 5 * n]
    for m in range(n):
        as_read[m] = u[m]
    for m in range(n):
        if u[m] > 0.0:
            a, b = neighbours[m], neighbours[n + m]
            flow = 2.0 * h[m] * u[m] + (h[a] * as_read[a] + h[b] * as_read[b])
            u[m] = min(max(flow / (2.0 * h[m] + (h[a] + h[b]) + TINY), 0.0), 2.0 * u[m])


@njit
def read_faces_around(tables, patch, y):
    """Write the state inside the faces of an interior patch to its work array: that of the cells around it.

    A face has the higher of the beds of both cells. Its depth is at most twice that of the cell of the patch, from
    which its flow comes. y : deviations of cells
    """
    basin = tables.basins[patch["basin"]]
    plane = tables.plane
    integers = tables.integers
    count = patch["faces"]
    at = patch["normals"]
    beds = tables.basins[patch["basin"]]["plan"]
    h, e, u, lengths = faces_inside(tables, patch)
    for m in range(count):
        k, own = integers[patch["ring"] + count + m], integers[patch["second"] + m]
        depth, surface, u[m] = read_cell(plane, basin, k, plane[at + m], plane[at + count + m], y)
        step = (plane[beds + basin["n"] + own] - plane[beds + own]) - (
            plane[beds + basin["n"] + k] - plane[beds + k]
        )
        above = depth - max(step, 0.0)  # of the surface over the bed of the face
        within = max(plane[beds + own] + y[basin["y"] + own], 0.0)
        h[m], e[m] = min(max(above, 0.0), 2.0 * within), surface + max(-above, 0.0)
        if h[m] == 0.0:
            u[m] = 0.0  # no outflow through a dry face, however fast the water is beyond the kerb
        lengths[m] = plane[at + 2 * count + m] * plane[basin["area"] + k]


@njit
def level_of_patch(tables, patch, g, faces, t, out):
    """(level of a patch above the level at rest [m], given inflow [m3/s]).

    The level is the lowest bed for closures of single faces. The inflow is 0 where none is given.
    """
    empty = tables.plane[:0]
    if patch["closure"] == LINKED or patch["closure"] == INTERIOR:
        st = tables.settings[0]
        layout = tables.layout[0]
        valve = tables.valves[patch["valve"]]
        pressure = valve["drop"] + out[layout["pressure"] + valve["from_node"]]
        return patch["lowest"] + pressure / (st["rho"] * g), out[
            layout["valve"] + patch["valve"]
        ] / st["rho"]
    if patch["closure"] == STAGE:
        return schedule_value(tables, patch["drive"], t) - patch["rest"], 0.0
    if patch["closure"] == DISCHARGE:
        target = schedule_value(tables, patch["drive"], t)
        return solve_level(g, faces, target, 0.0, empty, empty), target
    if patch["closure"] == RATING:
        at, count = patch["numbers"], patch["points"]
        levels, flows = tables.plane[at : at + count], tables.plane[at + count : at + 2 * count]
        return solve_level(g, faces, 0.0, patch["rest"], levels, flows), 0.0
    return lowest_bed(faces), 0.0


@njit
def close_face(plane, patch, m, g, z, h, e, u):
    """(inflow per width [m2/s], depth [m]) at face m of a patch with the level z; h, e, u : as for `face_flow`"""
    if patch["closure"] == CRITICAL:
        q, _, depth = face_flow(g, e - h, h, e, u)
    elif patch["closure"] == NORMAL_SLOPE:
        q, _, depth = face_flow(
            g, uniform_depth(g, h, e, u, plane[patch["conveyance"] + m]), h, e, u
        )
    else:
        q, _, depth = face_flow(g, z, h, e, u)
    return q, depth


@njit
def close_patch(tables, patch, t, y, out):
    """Write the flow and the momentum of all faces of a driven patch, and the pressure of its node.

    Faces whose links are shut are walls. A level, equal at all faces, would let water pass from one to another.
    During outflow above critical the fraction of the discharge that leaves is written to the node's outflow fraction.
    What links draw beyond critical outflow is supplied from outside.
    """
    layout = tables.layout[0]
    basin = tables.basins[patch["basin"]]
    node = tables.nodes[patch["node"]]
    g, faces, (first, outer) = (
        tables.settings[0]["gravity"],
        read_faces(tables, patch, y),
        driven_range(basin),
    )
    rows, (h, e, u, lengths) = (
        tables.work[first : first + ROWS * outer].reshape((ROWS, outer)),
        faces,
    )
    z, target = level_of_patch(tables, patch, g, faces, t, out)
    shut = patch["closure"] == LINKED and target == 0.0
    total = 0.0
    surface = 0.0
    wet = 0.0
    wide = 0.0
    held = 1.0
    low = z
    given = schedule_value(tables, patch["depth"], t) if patch["depth"] >= 0 else 0.0
    for m in range(h.size):
        k = tables.integers[patch["ring"] + m]
        if shut:
            q, depth = 0.0, depth_at_wall(g, h[m], u[m])
        else:
            q, depth = close_face(tables.plane, patch, m, g, z, h[m], e[m], u[m])
        if given > 0.0:
            depth = given
        rows[FLOW, k], rows[SURFACE, k] = q, e[m] + (depth - h[m])
        total += lengths[m] * q
        wide += lengths[m]
        low = min(low, e[m] - h[m])
        wet += lengths[m] * depth
        surface += lengths[m] * depth * rows[SURFACE, k]
    if patch["closure"] == DISCHARGE or patch["closure"] == LINKED:
        may_hold = z < lowest_bed(faces) - DEEPEST if patch["closure"] == LINKED else given == 0.0
        least = wide * sqrt(g * FILM) * FILM
        held = put_discharge(tables, patch, rows, total, target, wide, given, may_hold, least)
    for m in range(h.size):
        k = tables.integers[patch["ring"] + m]
        q, depth = rows[FLOW, k], h[m] + (rows[SURFACE, k] - e[m])
        u_face = q / depth if depth > 0.0 else 0.0
        rows[MOMENTUM, k] = q * u_face
        rows[SPEED, k] = abs(u_face) + sqrt(g * depth) if depth > 0.0 else DRY_FACE
    if patch["closure"] == LINKED:
        if held < 1.0:
            out[layout["supply"] + patch["node"]] = (
                tables.settings[0]["rho"] * (held - 1.0) * target
            )
        return
    own = (
        patch["closure"] == CRITICAL or patch["closure"] == NORMAL_SLOPE or given > 0.0 or z <= low
    )
    rise = (surface / wet if own and wet > 0.0 else z) - patch["lowest"]
    out[layout["pressure"] + patch["node"]] = tables.settings[0]["rho"] * g * rise
    out[layout["outflow_fraction"] + node["row"]] = held


@njit
def put_discharge(tables, patch, rows, total, target, wide, given, may_hold, least):
    """Correct the flows of faces so that their sum is the discharge; return the fraction that leaves, else 1.

    total : sum of the flows [m3/s]; target : discharge [m3/s]; wide : length of all faces [m]; given : depth of a
    supercritical inflow [m], or 0; may_hold : True if an outflow above critical is possible
    least : outflow up to which none is held [m3/s]
    """
    if may_hold and target < 0.0 and total - target > -HELD * target:
        return total / target if -target > least else 1.0
    for m in range(patch["faces"] if total != target or given > 0.0 else 0):
        k = tables.integers[patch["ring"] + m]
        if given > 0.0:
            rows[FLOW, k] = target / wide
        elif total * target > 0.0:
            rows[FLOW, k] *= target / total
        else:
            rows[FLOW, k] += (target - total) / wide
    return 1.0


@njit
def close_patches(t, y, dydt, out, handle):
    """Write flows and momentum at the faces of all driven patches, for the rates of cells."""
    tables = open_basins(handle)
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        if (
            basin["kind"] == OWN_CODE
            and patch["closure"] != NO_CLOSURE
            and patch["closure"] != INTERIOR
        ):
            close_patch(tables, patch, t, deviations_of(basin, tables.seen, y), out)


@njit
def observe_froude(t, y, out, handle, values):
    """Write the Froude numbers of flows through driven patches: flow over the sum of length, depth and wave speed."""
    tables = open_basins(handle)
    g = tables.settings[0]["gravity"]
    for p in range(tables.probes.size):
        if tables.probes[p]["kind"] == PATCH_FROUDE:
            patch = tables.patches[tables.probes[p]["index"]]
            basin = tables.basins[patch["basin"]]
            at, lengths = basin["driven"], tables.plane[patch["normals"] + 2 * patch["faces"] :]
            total, critical = 0.0, 0.0
            for m in range(patch["faces"]):
                k = at + tables.integers[patch["ring"] + m]
                cell = tables.integers[patch["ring"] + patch["faces"] + m]
                q = tables.work[k + FLOW * basin["outer"]]
                square = tables.work[k + MOMENTUM * basin["outer"]]
                wave = max(tables.work[k + SPEED * basin["outer"]], 0.0) - (
                    square / abs(q) if q != 0.0 else 0.0
                )
                length = lengths[m] * tables.plane[basin["area"] + cell]
                total += length * q
                critical += length * wave * wave * wave / g
            values[p] = abs(total) / critical if critical > 0.0 else 0.0
