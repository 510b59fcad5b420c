"""Forces on what rides on bodies that are no gradient, and what bodies feel of it. Knows rows of tables; knows no flux.

Coriolis' and Euler's terms, see `frames`. Where forces move the body its acceleration is not known before that of what
is in its basins. As Lagrange (70) has it for columns that are point masses which slide along the bed, weight at mid
depth: what pushes them along the bed hangs on the state alone. So rates of flow are found first as if joints were held;
water then loads the body by what its momentum lacks (`frames_load`), along the normal by its mass and moments beside
those of bodies (`kernels.mechanism.tanks`); once accelerations are solved, flow feels them (`follow_bodies`). A liquid
is such a layer without height. Momentum of the whole is kept to the method's order.
"""

from fvsolve.basins.frames import AZ, PLACES, WZ
from fvsolve.basins.frames_load import load_body, yielded
from fvsolve.jit import inner, njit
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
        if twice != 0.0 or euler != 0.0:
            own = 0.0 if basin["deep"] == 0 and tables.settings[0]["law"] == LAW_LINEAR else 1.0
            push_flow(tables.plane, basin, y, to, first, own, twice, 0.0, 0.0, euler)
        if basin["heavy"] == 1:
            load_body(tables, basin, b, y, to, first, out)


@njit
def push_flow(plane, basin, y, rates, first, own, twice, east, north, turn):
    """Add to rates of flow 2 W q and depth times a push that is even but for `turn` times the place.

    Depth is what is held per area, `own` the share of its deviation that counts.
    """
    n, o, nx, places = basin["n"], basin["y"], basin["nx"], int(plane[basin["frame"] + PLACES])
    rows, wide = (basin["ny"], nx) if nx > 0 else (1, n)
    for row in range(rows):
        at = row * wide
        a, z, p = o + at, o + at + wide, basin["plan"] + at
        x = plane[places : places + wide]
        if nx > 0:
            level = plane[places + nx + row]
            push_row(x, plane[p : p + wide], y[a:z], y[a + n : z + n], y[a + 2 * n : z + 2 * n], own,
                     twice, east + turn * level, north, turn, rates[first + n + at : first + n + at + wide],
                     rates[first + 2 * n + at : first + 2 * n + at + wide])  # fmt: skip
        else:
            for i in range(n):
                depth = max(plane[p + i] + own * y[o + i], 0.0)
                rates[first + n + i] += twice * y[o + 2 * n + i] + depth * (east + turn * plane[places + n + i])
                rates[first + 2 * n + i] += depth * (north - turn * x[i]) - twice * y[o + n + i]


@inner
def push_row(x, rest, dh, qx, qy, own, twice, east, north, turn, rate_x, rate_y):
    """`push_flow` of a row of cells of a grid."""
    for i in range(rate_x.size):
        depth = max(rest[i] + own * dh[i], 0.0)
        rate_x[i] += twice * qy[i] + depth * east
        rate_y[i] += depth * (north - turn * x[i]) - twice * qx[i]


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
