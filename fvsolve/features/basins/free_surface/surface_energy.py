"""Power and stored energy of water with a free surface, also between moving walls.

The stored energy per area is rho (g h^2 / 2 + g h z + |q|^2 / (2 h)): depth h [m], elevation z of the bed [m], flow per
width q [m2/s]. For the rows of the array `power` see `basin_output`.
"""

from math import sqrt

from fvsolve.core.kernels.network_energy import total_pressure
from fvsolve.features.basins.basin_output import basin_first_row, rest_potential
from fvsolve.features.basins.basin_patches import physics_code
from fvsolve.features.basins.boundary_cells import (
    depth_at_patch,
    flow_weight,
    patch_area,
    patch_length,
    weighted_volume,
)
from fvsolve.features.basins.free_surface.bed_friction import drag_per_flow
from fvsolve.features.basins.free_surface.patch_closures import (
    FLOW,
    MOMENTUM,
    SURFACE,
    driven_faces,
    faces_inside,
)
from fvsolve.features.basins.free_surface.surface_rows import THIN
from fvsolve.features.basins.moving_walls import area_growth_rate
from fvsolve.features.basins.tables import INTERIOR, LINKED, NO_DRAG, open_basins
from fvsolve.jit import njit

OWN_CODE = physics_code(__package__)


@njit(forceinline=True)
def velocity_factor(depth):
    """Velocity over unit flow [1/m] at a depth [m]: 1 / depth, but towards 0 below the depth THIN."""
    wet = max(depth, THIN)
    return 2.0 * depth / (depth * depth + wet * wet)


@njit
def add_power(t, y, dydt, out, handle, power):
    """Write losses at patches, power of friction and rate of storage of all basins of water to `power` [W]."""
    tables = open_basins(handle)
    patches, layout = tables.patches, tables.layout[0]
    for b in range(tables.basins.size):
        if tables.basins[b]["kind"] == OWN_CODE:
            rows = power[basin_first_row(tables, power, b) :]
            water_power(tables.settings[0], tables.basins[b], tables.plane, y, dydt, rows)
    for k in range(patches.size):
        patch, node = patches[k], patches[k]["node"]
        if tables.basins[patch["basin"]]["kind"] == OWN_CODE and patch["moves"] == 0:
            flow = out[layout["net"] + node] + out[layout["supply"] + node]
            if patch["closure"] == LINKED:
                loss = face_loss(tables, patch, flow, y, out)
            elif patch["closure"] == INTERIOR:
                loss = interior_loss(tables, patch, flow, y, dydt, out)
            else:
                loss = patch_loss(tables, patch, flow, y)
            power[basin_first_row(tables, power, patch["basin"]) + 1] += loss


@njit
def water_power(st, basin, plane, y, dydt, rows):
    """Write the power of friction to rows[2] and the rate of storage to rows[3] of a basin [W].

    rows : entries of the basin in `power`, see `basin_output`. Friction is capped as in the rates of the cells.
    """
    n, o = basin["n"], basin["y"]
    depths, surface = plane[basin["plan"] :], plane[basin["plan"] + n :]
    weight = st["rho"] * st["gravity"]
    rest = rest_potential(st, basin)
    area = plane[basin["area"] :]
    drawn, rough = plane[basin["drawn"] :], plane[basin["roughness"] :]
    friction, rate = 0.0, 0.0
    for i in range(n):
        d = y[o + i]
        qx = y[o + n + i]
        qy = y[o + 2 * n + i]
        depth = max(depths[i] + d, 0.0)
        share = velocity_factor(depth)
        u, v = share * qx, share * qy
        level = rest + weight * (surface[i] + d) - 0.5 * st["rho"] * (u * u + v * v)
        kinetic = u * dydt[o + n + i] + v * dydt[o + 2 * n + i]
        rate += drawn[i] * (level * dydt[o + i] + st["rho"] * kinetic)
        friction += area[i] * drag_power(
            st, basin, rough[i], depth, sqrt(qx * qx + qy * qy), u * u + v * v
        )
    rows[2], rows[3] = friction, rate


@njit
def drag_power(st, basin, roughness, depth, flow, square):
    """Power dissipated by bed friction per area [W/m2].

    roughness : Manning's n or the friction factor of the cell
    depth : depth of the water [m]; flow : unit flow [m2/s]; square : square of the velocity [m2/s2]
    """
    if basin["friction"] == NO_DRAG:
        return 0.0
    rate = drag_per_flow(basin["friction"], st["gravity"], roughness, depth) * flow
    return st["rho"] * depth * square * rate / (1.0 + rate / basin["held"])


@njit
def patch_loss(tables, patch, flow, y):
    """Power lost [W] where the mass flow `flow` passes a patch.

    flow : [kg/s], positive into the cells at the patch, negative out of them
    """
    st = tables.settings[0]
    basin = tables.basins[patch["basin"]]
    plane = tables.plane
    integers = tables.integers
    n = basin["n"]
    o = basin["y"]
    total = 0.0
    leaves = flow < 0.0
    depths, area = plane[basin["plan"] :], plane[basin["area"] :]
    each = flow / weighted_volume(tables, patch, leaves, y)
    for m in range(patch["count"]):
        i = integers[patch["first"] + m]
        share = velocity_factor(max(depths[i] + y[o + i], 0.0))
        square = share * share * (y[o + n + i] ** 2 + y[o + 2 * n + i] ** 2)
        total += 0.5 * area[i] * square * each * flow_weight(plane, basin, leaves, i, y)
    for m in range(patch["faces"]):
        i = integers[patch["ring"] + patch["faces"] + m]
        at = patch["normals"]
        count = patch["faces"]
        depth = max(depths[i] + y[o + i], 0.0)
        share, wide = velocity_factor(depth), plane[at + 2 * count + m] * plane[basin["drawn"] + i]
        u, v = share * y[o + n + i], share * y[o + 2 * n + i]
        away = (
            -each
            * flow_weight(plane, basin, leaves, i, y)
            * patch_area(tables, patch)
            / patch_length(tables, patch)
        )
        along = u * plane[at + m] + v * plane[at + count + m]
        net_outflow = away - st["rho"] * depth * along  # at a wall the inflow of momentum is lost
        total -= wide * along * (abs(along) + sqrt(st["gravity"] * depth)) * net_outflow
        if away > 0.0:
            total += wide * away * (u * u + v * v - along * along)
    return total


@njit
def face_loss(tables, patch, flow, y, out):
    """Power lost [W] at the faces of a linked patch: power of its inflow minus that of the fluxes on the cells.

    flow : mass flow into the cells [kg/s]. Its power is that at the pressure of the cells: the loss from the junction
    to this pressure is that of the restriction `law_patch_face`.
    """
    st = tables.settings[0]
    basin = tables.basins[patch["basin"]]
    plane = tables.plane
    count = patch["faces"]
    n = basin["n"]
    o = basin["y"]
    g = st["gravity"]
    rho = st["rho"]
    at = patch["normals"]
    rows, (h, e, _, lengths) = driven_faces(tables, basin).values, faces_inside(tables, patch)
    total, rest = 0.0, rest_potential(st, basin)
    for m in range(count):
        k, i = tables.integers[patch["ring"] + m], tables.integers[patch["ring"] + count + m]
        share = velocity_factor(max(plane[basin["plan"] + i] + y[o + i], 0.0))
        u, v = share * y[o + n + i], share * y[o + 2 * n + i]
        inward = -(u * plane[at + m] + v * plane[at + count + m])
        square = u * u + v * v
        q = rows[FLOW, k]
        depth = max(h[m] + (rows[SURFACE, k] - e[m]), 0.0)
        push = rows[MOMENTUM, k] + 0.5 * g * ((depth - h[m]) * (depth + h[m]))
        level = rest + rho * (g * (plane[basin["plan"] + n + i] + y[o + i]) - 0.5 * square)
        total += lengths[m] * (
            q * level + rho * (inward * push + min(q, 0.0) * (square - inward * inward))
        )
    return total_pressure(tables, out, patch["node"]) * flow / rho - total


@njit
def interior_loss(tables, patch, flow, y, dydt, out):
    """Power lost [W] in the cells of an interior patch: power of its inflow minus the rate of storage by this inflow.

    flow : mass flow into the cells [kg/s]. Its power is that at the pressure of the cells, as in `face_loss`.
    """
    st = tables.settings[0]
    basin = tables.basins[patch["basin"]]
    plane = tables.plane
    n = basin["n"]
    o = basin["y"]
    g = st["gravity"]
    rho = st["rho"]
    total = 0.0
    volume = 0.0
    rest, leaves = rest_potential(st, basin), flow < 0.0
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        volume += plane[basin["area"] + i] * (depth_at_patch(plane, basin, i, y) if leaves else 1.0)
    for m in range(patch["count"] if volume > 0.0 else 0):
        i = tables.integers[patch["first"] + m]
        depth = depth_at_patch(plane, basin, i, y)
        share = velocity_factor(depth)
        square = share * share * (y[o + n + i] ** 2 + y[o + 2 * n + i] ** 2)
        level = rest + rho * g * (plane[basin["plan"] + n + i] + y[o + i])
        part = plane[basin["area"] + i] * (depth if leaves else 1.0) / volume
        total += part * (level + (0.5 if leaves else -0.5) * rho * square)
    return (total_pressure(tables, out, patch["node"]) - total) * flow / rho


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Write the stored energy of all basins of water, relative to that at rest, to `stored` [J]."""
    tables = open_basins(handle)
    st = tables.settings[0]
    basins = tables.basins
    plane = tables.plane
    weight = st["rho"] * st["gravity"]
    for b in range(basins.size):
        basin, total = basins[b], 0.0
        if basin["kind"] != OWN_CODE:
            continue
        n = basin["n"]
        o = basin["y"]
        rest = rest_potential(st, basin)
        area = plane[basin["area"] :]
        depths, surface = plane[basin["plan"] :], plane[basin["plan"] + n :]
        for i in range(n):
            d, square = y[o + i], y[o + n + i] ** 2 + y[o + 2 * n + i] ** 2
            share = velocity_factor(max(depths[i] + d, 0.0))
            height = (rest + weight * surface[i]) * d + 0.5 * weight * d * d
            total += area[i] * (height + 0.5 * st["rho"] * share * square)
        stored[stored.size - basins.size + b] = total


@njit(forceinline=True)
def is_moving(basin):
    """True for a basin of water with a free surface and moving walls."""
    return basin["kind"] == OWN_CODE and basin["walls"] > 0


@njit
def add_wall_power(t, y, dydt, out, handle, power):
    """Correct the rate of storage in `power` for changing cell areas A: subtract rho g h^2 / 2 dA/dt [W] of cells."""
    tables = open_basins(handle)
    st, plane = tables.settings[0], tables.plane
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        for i in range(basin["n"] if is_moving(basin) else 0):
            depth = max(plane[basin["plan"] + i] + y[basin["y"] + i], 0.0)
            spent = (
                0.5
                * st["rho"]
                * st["gravity"]
                * depth
                * depth
                * area_growth_rate(t, tables, basin, y, i)
            )
            power[basin_first_row(tables, power, b) + 3] -= plane[basin["drawn"] + i] * spent


@njit
def add_wall_stored(t, y, dydt, out, handle, stored):
    """Add the energy of water at rest [J] on the area that cells have gained by the motion of walls to `stored`."""
    tables = open_basins(handle)
    st = tables.settings[0]
    plane = tables.plane
    first = stored.size - tables.basins.size
    weight = st["rho"] * st["gravity"]
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        for i in range(basin["n"] if is_moving(basin) else 0):
            depth, surface = plane[basin["plan"] + i], plane[basin["plan"] + basin["n"] + i]
            rest_energy = depth * (rest_potential(st, basin) + weight * (surface - 0.5 * depth))
            stored[first + b] += (
                plane[basin["area"] + i] - plane[basin["drawn"] + i]
            ) * rest_energy
