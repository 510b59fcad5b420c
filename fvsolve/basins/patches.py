"""Patches of basins: what passes an open boundary, and what gives way where a link joins. Knows the tables."""

from fvsolve.basins.behind import through_patch
from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import GN


@njit(forceinline=True)
def weight_of(st, plane, basin):
    """Gravity along the normal of a basin [m/s2], which on a body is what it feels there; see `basins.frames`."""
    return st["gravity"] if basin["frame"] < 0 else plane[basin["frame"] + GN]


@njit(forceinline=True)
def wanted(basin, dydt):
    """Whether its rates are asked for, or what they say of flows through open patches."""
    return dydt.size > 0 or basin["through"] >= 0 or basin["frame"] >= 0


@njit
def book_open(tables, b, per, out):
    """Book what passes the open boundary of a basin, to each patch its own."""
    patches = tables.patches
    for k in range(patches.size):
        if patches[k]["basin"] == b and patches[k]["open"] == 1:
            out[tables.layout[0]["supply"] + patches[k]["node"]] = per * through_patch(tables, patches[k])


@njit
def record_patches(t, y, out, handle, values):
    """Mark where a link asked for more than there was; what passes an open boundary is booked, and no mark."""
    tables = open_tables(handle)
    patches, marks, nodes = tables.patches, tables.marks, tables.nodes.size
    for k in range(patches.size):
        at = tables.pipes.size + nodes + patches[k]["node"]
        made_up = patches[k]["open"] == 0 and out[tables.layout[0]["supply"] + patches[k]["node"]] > 0.0
        if made_up and marks[at] != marks[at]:
            marks[at] = t


@njit
def give_way(plane, patch, m, push, dydt, x, y):
    """Add to the momentum of the cell behind face m of a patch what a wall would not have let pass.

    A wall stops what runs into it, p + Z u_n; where v passes the pressure on it is p + Z (u_n - v).
    push : Z v, v positive outward
    """
    at, many = patch["normals"], patch["faces"]
    share = push * plane[at + 2 * many + m]
    dydt[x] += share * plane[at + m]
    dydt[y] += share * plane[at + many + m]


@njit
def put_inward(turn, k, flux, inward):
    """Flows through a row of faces; turn : 1 or -1 for fluxes inward or outward, k : 1 / lengths of faces."""
    for i in range(inward.size):
        inward[i] = turn * flux[i] / k[i]
