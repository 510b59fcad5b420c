"""Patches of basins, the named parts of their boundary: cells next to a patch, flow, momentum of the flow of links.

A band is a range of rows of cells that one thread steps. Compiled functions of a type of basin recognise its basins by
a code (`physics_code`).
"""

from zlib import crc32

from fvsolve.jit import njit
from fvsolve.kernels import band_exchange
from fvsolve.kernels.dtypes import GN
from fvsolve.kernels.table_handle import open_tables


def physics_code(package: str) -> int:
    """Code of the type of basin in a package; its compiled files contain `OWN_CODE = physics_code(__package__)`."""
    return crc32(package.encode())


SHALLOW = 1e-3  # depth at a patch below which only a fraction of the demanded outflow can leave [m]
LEAST_DEPTH = 1e-9  # volume at a patch over its area below which its surface tends to the lowest bed [m]
BAND_MARGIN = 5  # rows beyond a band that its rates read: three, or the five of the boundary closure of a liquid


@njit
def available_fraction(depth):
    """Fraction of the demanded outflow that water of a depth [m] supplies: 0 at depth 0 to 1 at the depth SHALLOW."""
    s = min(max(depth, 0.0) / SHALLOW, 1.0)
    return s * s * (3.0 - 2.0 * s)


@njit(forceinline=True)
def patch_area(tables, patch):
    """Area of the cells next to a patch [m2]."""
    return tables.plane[patch["sizes"]]


@njit(forceinline=True)
def patch_length(tables, patch):
    """Length of the faces of a patch [m]."""
    return tables.plane[patch["sizes"] + 1]


@njit
def depth_at_patch(plane, basin, i, y):
    """Depth of cell i of a basin with a free surface [m]."""
    return max(plane[basin["plan"] + i] + y[basin["y"] + i], 0.0)


@njit
def outflow_weight(depth):
    """Weight [m] of a cell of a depth [m] in the outflow through a patch: its depth times `available_fraction`.

    With the depth as factor, the water of all cells leaves at one speed.
    """
    return depth * available_fraction(depth)


@njit
def flow_weight(plane, basin, leaves, i, y):
    """Weight of cell i in the flow through a patch [m].

    It is `outflow_weight` for outflow (`leaves` is True). For inflow it is the depth, but at least SHALLOW.
    """
    depth = depth_at_patch(plane, basin, i, y)
    return outflow_weight(depth) if leaves else max(depth, SHALLOW)


@njit
def weighted_volume(tables, patch, leaves, y):
    """Sum of area times `flow_weight` over the cells at a patch [m3], at least LEAST_DEPTH times their area.

    leaves : True for outflow
    """
    basin, plane, total = tables.basins[patch["basin"]], tables.plane, 0.0
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        total += plane[basin["area"] + i] * flow_weight(plane, basin, leaves, i, y)
    return max(total, LEAST_DEPTH * patch_area(tables, patch))


@njit(forceinline=True)
def has_given_flows(basin):
    """True if the flows through faces follow from a given velocity.

    Such flows are stored in `tables.plane`, computed flows in `tables.work`.
    """
    return basin["given"] == 1


@njit
def patch_inflow(tables, patch):
    """Inflow through all faces of an open patch: [m3/s] of water, [m2/s] by a given velocity, [kg/(m s)] of a liquid.

    The inflow by a given velocity is that at full speed, without `flow_factor`.
    """
    basin, total = tables.basins[patch["basin"]], 0.0
    flows = tables.plane if has_given_flows(basin) else tables.work
    for m in range(patch["faces"]):
        total += flows[basin["through"] + tables.integers[patch["ring"] + m]]
    return total


@njit(forceinline=True)
def band_cells(tables, b):
    """(first, last + 1) of the cells of basin b in the band of this thread."""
    wide = max(tables.basins[b]["nx"], 1)
    return wide * tables.bands[2 * b], wide * tables.bands[2 * b + 1]


@njit(forceinline=True)
def stencil_cells(tables, b):
    """(first, last + 1) of the cells of basin b whose values the rates in the band of this thread read."""
    basin = tables.basins[b]
    begin, stop = max(tables.bands[2 * b] - BAND_MARGIN, 0), min(tables.bands[2 * b + 1] + BAND_MARGIN, basin["ny"])
    return (basin["nx"] * begin, basin["nx"] * stop) if basin["nx"] > 0 else (0, basin["n"])


@njit(forceinline=True)
def normal_gravity(st, plane, basin):
    """Gravity along the normal of a basin [m/s2].

    On a body it is gravity minus the acceleration of the frame of the basin, see `basin_frames`.
    """
    return st["gravity"] if basin["frame"] < 0 else plane[basin["frame"] + GN]


@njit(forceinline=True)
def needs_rates(basin, dydt):
    """True if rates of a basin are requested (dydt is not empty) or needed for flows at open patches or for frames."""
    return dydt.size > 0 or basin["through"] >= 0 or basin["frame"] >= 0


@njit
def put_open_flows(tables, b, per, out):
    """Write the flow through each open patch of basin b to `out`, as the supply of the node of the patch [kg/s].

    per : factor that converts the flows that `patch_inflow` returns to mass flows
    """
    patches = tables.patches
    for k in range(patches.size):
        if patches[k]["basin"] == b and patches[k]["open"] == 1:
            out[tables.layout[0]["supply"] + patches[k]["node"]] = per * patch_inflow(tables, patches[k])


@njit
def put_boundary_flows(t, y, dydt, out, handle):
    """Write the flows through open patches again, after all bands have computed their fluxes.

    Basins with a given velocity are left out, as their flows are not computed.
    """
    tables = open_tables(handle)
    band_exchange.get_runs(tables.joint, band_exchange.SEND_FLOWS, tables.work)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["given"] == 0 and basin["through"] >= 0:
            put_open_flows(tables, b, tables.settings[0]["rho"] if basin["deep"] == 1 else basin["thickness"], out)


@njit
def record_patches(t, y, out, handle, values):
    """Record, for each patch, the first time at which its links take more water than its cells supply.

    Open patches are excluded.
    """
    tables = open_tables(handle)
    patches, marks, nodes = tables.patches, tables.marks, tables.nodes.size
    for k in range(patches.size):
        at = tables.pipes.size + nodes + patches[k]["node"]
        is_short = patches[k]["open"] == 0 and out[tables.layout[0]["supply"] + patches[k]["node"]] > 0.0
        if is_short and marks[at] != marks[at]:
            marks[at] = t


@njit
def add_link_momentum(plane, patch, m, push, dydt, x, y):
    """Correct the momentum rates of the cell behind face m of a patch, computed for a wall, for the flow of links.

    A wall stops the flow, so the pressure on it is p + Z u_n: pressure p of the cell, its velocity u_n toward the wall,
    impedance Z. With a flow through the face at the outward velocity v, the pressure is p + Z (u_n - v).
    push : Z v; x, y : indices in `dydt` of the momentum of the cell along x and y
    """
    at, count = patch["normals"], patch["faces"]
    share = push * plane[at + 2 * count + m]
    dydt[x] += share * plane[at + m]
    dydt[y] += share * plane[at + count + m]


@njit
def put_inward(turn, k, flux, inward):
    """Write the inward flows through a row of boundary faces, fluxes times face lengths, to `inward`.

    turn : 1 if the fluxes are positive inward, -1 if outward; k : 1 / lengths of faces [1/m]
    """
    for i in range(inward.size):
        inward[i] = turn * flux[i] / k[i]
