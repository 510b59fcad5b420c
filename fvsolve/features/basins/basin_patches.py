"""Patches of basins, the named parts of their boundary: their flow, and the momentum of the flow of links.

Compiled functions of a type of basin recognise its basins by a code (`physics_code`).
"""

from zlib import crc32

from fvsolve.core.kernels import band_exchange
from fvsolve.features.basins.boundary_cells import patch_inflow
from fvsolve.features.basins.tables import DISCHARGE, GN, open_basins
from fvsolve.jit import njit

# mass flow from outside up to which a patch is not short of water [kg/s]: rounding
LEAST_SUPPLY = 1e-7


def physics_code(package: str) -> int:
    """Code of the type of basin in a package; its compiled files contain `OWN_CODE = physics_code(__package__)`."""
    return crc32(package.encode())


@njit(forceinline=True)
def normal_gravity(st, plane, basin):
    """Gravity along the normal of a basin [m/s2].

    On a body it is gravity minus the acceleration of the frame of the basin, see `basin_frames`.
    """
    return st["gravity"] if basin["frame"] < 0 else plane[basin["frame"] + GN]


@njit(forceinline=True)
def needs_rates(basin, dydt):
    """True if rates of a basin are requested (dydt is not empty) or needed for open patches, sections or frames."""
    return dydt.size > 0 or basin["through"] >= 0 or basin["frame"] >= 0 or basin["sections"] == 1


@njit
def put_open_flows(tables, b, per, out):
    """Write the flow through each open patch of basin b to `out`, as the supply of the node of the patch [kg/s].

    per : factor that converts the flows that `patch_inflow` returns to mass flows
    """
    patches = tables.patches
    for k in range(patches.size):
        if patches[k]["basin"] == b and patches[k]["open"] == 1:
            out[tables.layout[0]["supply"] + patches[k]["node"]] = per * patch_inflow(
                tables, patches[k]
            )


@njit
def put_boundary_flows(t, y, dydt, out, handle):
    """Write the flows through open patches again, after all bands have computed their fluxes.

    Basins with a given velocity are left out, as their flows are not computed.
    """
    tables = open_basins(handle)
    band_exchange.get_runs(tables.joint, band_exchange.SEND_FLOWS, tables.work)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["given"] == 0 and basin["through"] >= 0:
            put_open_flows(
                tables,
                b,
                tables.settings[0]["rho"] if basin["deep"] == 1 else basin["thickness"],
                out,
            )


@njit
def record_patches(t, y, out, handle, values):
    """Record, for each patch, the first time at which its links take more water than its cells supply.

    At a patch with a scheduled discharge it is the first time at which this is held at critical outflow. Other open
    patches are excluded.
    """
    tables = open_basins(handle)
    patches = tables.patches
    marks = tables.marks
    nodes = tables.nodes
    layout = tables.layout[0]
    for k in range(patches.size):
        i = patches[k]["node"]
        at = tables.pipes.size + nodes.size + i
        is_short = patches[k]["open"] == 0 and out[layout["supply"] + i] > LEAST_SUPPLY
        if patches[k]["closure"] == DISCHARGE:
            is_short = out[layout["outflow_fraction"] + nodes[i]["row"]] < 1.0
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
