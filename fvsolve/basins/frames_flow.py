"""Forces on what rides on bodies that are no gradient, and what bodies feel of it. Knows rows of tables; knows no flux.

Coriolis' and Euler's terms, see `frames`. Where forces move the body its acceleration is not known before that of what
is in its basins. As Lagrange (70) has it for columns that are point masses which slide along the bed, weight at mid
depth: what pushes them along the bed hangs on the state alone. So rates of flow are found first as if joints were held;
water then loads the body by what its momentum lacks (`frames_load`), along the normal by its mass and moments beside
those of bodies (`kernels.mechanism.tanks`); once accelerations are solved, flow feels them (`follow_bodies`). A liquid
is such a layer without height. Momentum of the whole is kept to the method's order.
"""

from fvsolve.basins.frames import AZ, WZ
from fvsolve.basins.frames_load import load_body, yielded
from fvsolve.basins.frames_push import push_flow
from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.mechanism.room import dot
from fvsolve.kernels.mechanism.tanks import EAST, TANK_OUT
from fvsolve.kernels.records import LAW_LINEAR, RATE


@njit
def turn_fluid(t, y, dydt, out, handle):
    """Add Coriolis and Euler forces to rates of flow, and let bodies feel what is in their basins.

    Under law linear the inertia of a liquid is that at rest.
    """
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        twice, euler = 2.0 * tables.plane[basin["frame"] + WZ], tables.plane[basin["frame"] + AZ]
        out[RATE] = max(out[RATE], abs(twice))
        to, first = (dydt, basin["y"]) if dydt.size > 0 else (tables.work, basin["unused"])
        own = 0.0 if basin["deep"] == 0 and tables.settings[0]["law"] == LAW_LINEAR else 1.0
        if (twice != 0.0 or euler != 0.0) and (basin["heavy"] == 0 or basin["nx"] == 0):
            push_flow(tables.plane, basin, y, to, first, own, twice, 0.0, 0.0, euler)
        if basin["heavy"] == 1:
            load_body(tables, basin, b, y, to, first, own, twice, euler, out)


@njit
def follow_bodies(t, y, dydt, out, handle):
    """Let flow feel what the accelerations of its body are beyond those with joints held."""
    tables = open_tables(handle)
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        ax, ay, az, wx, wy, wz = yielded(tables, basin, out)
        e = tables.layout[0]["tank"] + TANK_OUT * b + EAST
        east, north, turn = dot(out, e, ax, ay, az), dot(out, e + 3, ax, ay, az), dot(out, e + 6, wx, wy, wz)
        if east == 0.0 and north == 0.0 and turn == 0.0:
            continue
        push_flow(tables.plane, basin, y, dydt, basin["y"], 1.0, 0.0, -east, -north, turn)
