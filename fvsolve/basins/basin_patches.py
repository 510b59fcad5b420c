"""Patches of basins: flow through an open boundary, and momentum of the flow of links."""

from fvsolve.basins.boundary_cells import patch_inflow
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import GN
from fvsolve.kernels.table_handle import open_tables


@njit(forceinline=True)
def normal_gravity(st, plane, basin):
    """Gravity along the normal of a basin [m/s2], on a body that of its accelerated frame; see `basin_frames`."""
    return st["gravity"] if basin["frame"] < 0 else plane[basin["frame"] + GN]


@njit(forceinline=True)
def needs_rates(basin, dydt):
    """True if the rates of a basin are needed, or the flows through its open patches, which follow from them."""
    return dydt.size > 0 or basin["through"] >= 0 or basin["frame"] >= 0


@njit
def put_open_flows(tables, b, per, out):
    """Write the flows through the open boundary of a basin, patch by patch, as supplies of the nodes of patches."""
    patches = tables.patches
    for k in range(patches.size):
        if patches[k]["basin"] == b and patches[k]["open"] == 1:
            out[tables.layout[0]["supply"] + patches[k]["node"]] = per * patch_inflow(tables, patches[k])


@njit
def record_patches(t, y, out, handle, values):
    """Record the first time at which a link takes more water than the basin contains; open patches are excluded."""
    tables = open_tables(handle)
    patches, marks, nodes = tables.patches, tables.marks, tables.nodes.size
    for k in range(patches.size):
        at = tables.pipes.size + nodes + patches[k]["node"]
        is_short = patches[k]["open"] == 0 and out[tables.layout[0]["supply"] + patches[k]["node"]] > 0.0
        if is_short and marks[at] != marks[at]:
            marks[at] = t


@njit
def add_link_momentum(plane, patch, m, push, dydt, x, y):
    """Add to the momentum of the cell at face m of a patch the part that a wall would not transmit.

    A wall stops the flow, so the pressure on it is p + Z u_n. With a flow at v through the face it is p + Z (u_n - v).
    push : Z v, v positive outward
    """
    at, count = patch["normals"], patch["faces"]
    share = push * plane[at + 2 * count + m]
    dydt[x] += share * plane[at + m]
    dydt[y] += share * plane[at + count + m]


@njit
def put_inward(turn, k, flux, inward):
    """Inward flows through a row of faces. turn : 1 or -1 for fluxes inward or outward; k : 1 / lengths of faces"""
    for i in range(inward.size):
        inward[i] = turn * flux[i] / k[i]
