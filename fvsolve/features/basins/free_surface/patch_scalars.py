"""Scalars in the flow of links through patches of water.

Outflow through a face has the values of the cell behind it. The place of the links has no volume, so the inflow through
a face has the mean, by flows, of the flow from links and of that out through other faces. The values in cells of an
interior patch leave in proportion to their volumes. The network reads the amounts that leave before cells are advected,
so the schemes of advection take these faces for walls, and their flows are added here.
"""

from fvsolve.features.basins.basin_patches import physics_code
from fvsolve.features.basins.basin_scalars import cell_value
from fvsolve.features.basins.boundary_cells import LEAST_DEPTH, depth_at_patch, patch_area
from fvsolve.features.basins.cell_sides import deviations_of
from fvsolve.features.basins.free_surface.patch_closures import FLOW, faces_inside
from fvsolve.features.basins.tables import INTERIOR, LINKED, open_basins
from fvsolve.jit import njit

OWN_CODE = physics_code(__package__)


@njit(forceinline=True)
def flow_index(basin, k):
    """Index in `tables.work` of the flow, read by the schemes of advection, through boundary face k of a basin."""
    nx = basin["nx"]
    ny = basin["ny"]
    first = basin["flows"]
    if nx == 0:
        return first + basin["faces"] - basin["outer"] + k
    if k < 2 * ny:
        return first + (k % ny) * (nx + 1) + (0 if k < ny else nx)
    k -= 2 * ny
    return first + ny * (nx + 1) + (k if k < nx else k + (ny - 1) * nx)


@njit(forceinline=True)
def outflow_of_face(tables, patch, basin, q, y, m):
    """(flow per width [m2/s] into the basin, value of scalar q in the cell behind) of face m of a patch."""
    k = tables.integers[patch["ring"] + m]
    i = tables.integers[patch["ring"] + patch["faces"] + m]
    return tables.work[basin["driven"] + FLOW * basin["outer"] + k], cell_value(
        tables, basin, q, y, i
    )


@njit
def leaving(tables, patch, basin, q, y):
    """(flow [m3/s], amount of scalar q in it) out through the faces of a patch."""
    total = 0.0
    amount = 0.0
    lengths = faces_inside(tables, patch)[3]
    for m in range(patch["faces"]):
        flow, value = outflow_of_face(tables, patch, basin, q, y, m)
        total -= lengths[m] * min(flow, 0.0)
        amount -= lengths[m] * min(flow, 0.0) * value
    return total, amount


@njit
def values_at_faces(t, y, dydt, out, handle):
    """Write the values of scalars in the outflow through faces of patches that links join to `out`.

    Without outflow the mean of the cells, which `patch_values` has written, remains. The flows through these faces are
    set to zero for the schemes of advection.
    """
    tables = open_basins(handle)
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        if basin["kind"] != OWN_CODE or patch["closure"] != LINKED:
            continue
        seen = deviations_of(basin, tables.seen, y)
        for q in range(tables.scalars.size):
            total, amount = leaving(tables, patch, basin, q, seen)
            if total > 0.0:
                out[tables.layout[0]["value"] + q * tables.nodes.size + patch["node"]] = (
                    amount / total
                )
        for m in range(patch["faces"]):
            tables.work[flow_index(basin, tables.integers[patch["ring"] + m])] = 0.0


@njit
def add_face_flows(t, y, dydt, out, handle):
    """Add the scalars in the flow of links through patches of water to the rates of cells."""
    tables = open_basins(handle)
    for k in range(tables.patches.size if dydt.size > 0 else 0):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        if basin["kind"] != OWN_CODE:
            continue
        seen = deviations_of(basin, tables.seen, y)
        for q in range(tables.scalars.size):
            rate = dydt[basin["carried"] + q * basin["n"] :][: basin["n"]]
            if patch["closure"] == LINKED:
                add_through_faces(tables, patch, basin, q, seen, rate, out)
            elif patch["closure"] == INTERIOR:
                add_inside(tables, patch, basin, q, seen, rate, out)


@njit
def add_through_faces(tables, patch, basin, q, y, rate, out):
    """Add the flows of scalar q through the faces of a patch to the rates of its amounts per area."""
    valve = tables.valves[patch["valve"]]
    layout = tables.layout[0]
    at = patch["normals"] + 2 * patch["faces"]
    total, amount = leaving(tables, patch, basin, q, y)
    entering = max(out[layout["valve"] + patch["valve"]], 0.0) / tables.settings[0]["rho"]
    amount += entering * out[layout["value"] + q * tables.nodes.size + valve["from_node"]]
    total += entering
    for m in range(patch["faces"]):
        flow, value = outflow_of_face(tables, patch, basin, q, y, m)
        if flow != 0.0:
            i = tables.integers[patch["ring"] + patch["faces"] + m]
            rate[i] += tables.plane[at + m] * flow * (amount / total if flow > 0.0 else value)


@njit
def add_inside(tables, patch, basin, q, y, rate, out):
    """Add the flow of scalar q into or out of the cells of an interior patch to the rates of its amounts per area."""
    layout = tables.layout[0]
    node = patch["node"]
    plane = tables.plane
    flow = out[layout["net"] + node] + out[layout["supply"] + node]
    at = q * tables.nodes.size + node
    inflow = (out[layout["scalar_inflow"] + at] + out[layout["gain"] + at]) / tables.settings[0][
        "rho"
    ]
    volume = 0.0
    for m in range(patch["count"] if flow < 0.0 else 0):
        i = tables.integers[patch["first"] + m]
        volume += plane[basin["area"] + i] * depth_at_patch(plane, basin, i, y)
    volume = max(volume, LEAST_DEPTH * patch_area(tables, patch))
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        if flow < 0.0:
            depth = depth_at_patch(plane, basin, i, y)
            rate[i] += (
                flow
                / (tables.settings[0]["rho"] * volume)
                * depth
                * cell_value(tables, basin, q, y, i)
            )
        else:
            rate[i] += inflow / patch_area(tables, patch)
