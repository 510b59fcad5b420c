"""Coriolis and Euler forces on the water in basins on bodies, and the coupling of water and body accelerations.

For the forces see `basin_frames`. If forces move the body, its acceleration is solved together with that of the water
in its basins. Lagrange's equations ((70) of docs/course.md) are those of columns that are point masses at mid depth and
slide along the bed. The force along the bed depends on the state alone, so the rates of flow are first computed for
zero joint accelerations. The load of the water on the body then follows from its rate of momentum (`frame_reaction`).
Along the normal it acts by its mass and moments, together with the inertia of bodies
(`kernels.mechanism.fluid_inertia`). After the accelerations are solved, the rates of flow are corrected for them
(`correct_for_bodies`). A liquid is a layer of this kind without height. The total momentum is conserved to the order of
the method.
"""

from fvsolve.basins.basin_frames import AZ, WZ
from fvsolve.basins.frame_momentum import accelerate_flow
from fvsolve.basins.frame_reaction import extra_accelerations, load_body
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import LAW_LINEAR, RATE, TANK_OUT
from fvsolve.kernels.mechanism.body_layout import EAST
from fvsolve.kernels.mechanism.vectors import dot
from fvsolve.kernels.table_handle import open_tables


@njit
def add_frame_forces(t, y, dydt, out, handle):
    """Add Coriolis and Euler forces to the rates of flow in basins on bodies, and loads of the water to the bodies.

    Under the density law `linear`, the inertia of a liquid is its inertia at rest. Loads are added only where column
    `loads_body` is 1: forces move the body, a probe observes the load of a joint, or energy is computed. The Coriolis
    rate 2 W_z raises out[RATE], which limits the step. If `dydt` is empty, the rates are those in `tables.work`.
    """
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        twice, euler = 2.0 * tables.plane[basin["frame"] + WZ], tables.plane[basin["frame"] + AZ]
        out[RATE] = max(out[RATE], abs(twice))
        to, first = (dydt, basin["y"]) if dydt.size > 0 else (tables.work, basin["boundary_rates"])
        own = 0.0 if basin["deep"] == 0 and tables.settings[0]["law"] == LAW_LINEAR else 1.0
        if (twice != 0.0 or euler != 0.0) and (basin["loads_body"] == 0 or basin["nx"] == 0):
            accelerate_flow(tables.plane, basin, y, to, first, own, twice, 0.0, 0.0, euler)
        if basin["loads_body"] == 1:
            load_body(tables, basin, b, y, to, first, own, twice, euler, out)


@njit
def correct_for_bodies(t, y, dydt, out, handle):
    """Correct the rates of flow in basins on bodies for the accelerations of the joints of these bodies.

    The inertia is that at the present depth or density, under all density laws.
    """
    tables = open_tables(handle)
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        ax, ay, az, wx, wy, wz = extra_accelerations(tables, basin, out)
        e = tables.layout[0]["tank"] + TANK_OUT * b + EAST
        x_part, y_part, turn = dot(out, e, ax, ay, az), dot(out, e + 3, ax, ay, az), dot(out, e + 6, wx, wy, wz)
        if x_part == 0.0 and y_part == 0.0 and turn == 0.0:
            continue
        accelerate_flow(tables.plane, basin, y, dydt, basin["y"], 1.0, 0.0, -x_part, -y_part, turn)
