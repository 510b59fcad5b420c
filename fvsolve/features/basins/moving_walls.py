"""Moving walls of basins, and the grid lines that move with them.

Let U be a quantity per area, A the area of a cell, F the flux through a face of the cell and w the speed of the face.
The amount A U in a cell falls at the rate of the sum of the outward fluxes F - w U over its faces (Reynolds' transport
theorem, (71) to (73) of docs/course.md). So the states are changes of the amount over the undeformed area,
(A U - A0 U0) / A0, with U0 at rest; travels of walls are states too. Areas are then linear in the states; every
Runge-Kutta method keeps this relation, and a uniform state stays uniform to round-off. All walls of a basin move along
the same axis. Other functions read deviations U - U0 (`seen`) in place of the states, and the present lines and areas
in `plane`. On other meshes, corners take the place of grid lines (see `moving_meshes`).
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels.dtypes import NO_WIDTH, RATE, STATUS, WALL_VALUE, WHERE
from fvsolve.core.kernels.moving_frames import FORCE
from fvsolve.core.kernels.moving_frames import body_row as row_of_body
from fvsolve.core.kernels.schedule_pieces import schedule_slopes
from fvsolve.features.basins import cell_sides as stretching
from fvsolve.features.basins.basin_output import basin_first_row
from fvsolve.features.basins.cell_sides import BLOCK, MEASURES, blocks, row_across, stretch_of_cell
from fvsolve.features.basins.energy_rows import WALL_ROWS, wall_power_row
from fvsolve.features.basins.tables import NO_DRAG, open_basins
from fvsolve.jit import njit

# quantities of probes, in the order of `parts.basin.MovingWall`
FORCE_OF, POWER_OF, TRAVEL_OF = 0, 1, 2
LEAST_WIDTH = 1e-3  # least width of a cell over its undeformed width; below it the run stops
VECTOR_MARGIN = 8  # additional speeds of lines that vector loops read beyond the last line


@njit(forceinline=True)
def stretching_counts(basin):
    """(number of columns or rows of cells that stretch, number of moving lines).

    For a mesh other than a grid, it is (number of cells, number of corners).
    """
    if basin["nx"] == 0:
        return basin["n"], basin["corners"]
    count = basin["ny"] if basin["turn"] == 1 else basin["nx"]
    return count, count + 1


@njit
def update_geometry(t, y, seen, out, handle):
    """Compute lines and areas of basins at y, and write deviations of values per area from rest to `tables.seen`.

    All states other than those of basins with moving walls are copied to `tables.seen`.
    If the argument `seen` is empty, kernels of rates follow. Then, if the kernel of a basin reads the states
    themselves, only deviations next to patches and walls are computed, unless scalars or friction need all.
    """
    tables, done = open_basins(handle), 0
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["walls"] > 0:
            stretch_cells(tables, basin, y)
            copy(y[done : basin["y"]], tables.seen[done:])
            # kernels of rates of water on grids read the states (amounts in cells), not values per area
            reads_contents = basin["deep"] == 1 and basin["nx"] > 0
            if (
                seen.size == 0
                and reads_contents
                and basin["carried"] < 0
                and basin["friction"] == NO_DRAG
            ):
                deviations_at_patches(tables, b, y)
            else:
                deviations_of_rows(tables, basin, y)
            for p in range(tables.patches.size if basin["nx"] > 0 else 0):
                if tables.patches[p]["basin"] == b:
                    size_patch(tables, basin, tables.patches[p])
            done = (
                basin["y"]
                + (3 + (tables.scalars.size if basin["carried"] >= 0 else 0)) * basin["n"]
            )
    copy(y[done:], tables.seen[done:])


@njit
def copy(source, target):
    """Copy source to target."""
    for i in range(source.size):
        target[i] = source[i]


@njit
def stretch_cells(tables, basin, y):
    """Write the ratios of present to undeformed area of columns, rows or cells, for the travels of walls in y.

    Their reciprocals and, for a grid, the table of 1 / widths are updated too.
    """
    plane = tables.plane
    walls = tables.walls
    at = basin["stretch"]
    count, lines = stretching_counts(basin)
    wide, narrow = plane[at : at + count], plane[at + count : at + 2 * count]
    stretching.fill(1.0, wide)
    for k in range(basin["wall"], basin["wall"] + basin["walls"]):
        weights, travel = plane[walls[k]["weights"] + lines :], y[walls[k]["y"]]
        for i in range(count):
            wide[i] += weights[i] * travel
    for i in range(count):
        narrow[i] = 1.0 / wide[i]
    if basin["nx"] > 0:
        spacing = basin["spacing"] + (basin["nx"] if basin["turn"] == 1 else 0)
        # 1 / widths as drawn
        stretching.multiply(plane[at + 2 * count :], narrow, plane[spacing : spacing + count])


@njit
def factors_of(tables, basin, j):
    """(ratio of present to undeformed area, its reciprocal): arrays for row j of a grid, or for all cells of a mesh."""
    plane, nx, at, (count, _) = (
        tables.plane,
        basin["nx"],
        basin["stretch"],
        stretching_counts(basin),
    )
    if nx == 0 or basin["turn"] == 0:
        return plane[at : at + count], plane[at + count : at + 2 * count]
    row = at + 3 * count
    stretching.fill(plane[at + j], plane[row : row + nx])
    stretching.fill(plane[at + count + j], plane[row + nx : row + 2 * nx])
    return plane[row : row + nx], plane[row + nx : row + 2 * nx]


@njit
def deviations_of_rows(tables, basin, y):
    """Write areas and deviations U - U0 of all cells of a basin, from the states (A U - A0 U0) / A0."""
    plane = tables.plane
    seen = tables.seen
    n = basin["n"]
    first = basin["y"]
    rows, size = (basin["ny"], basin["nx"]) if basin["nx"] > 0 else (1, n)
    scalar_count = tables.scalars.size if basin["carried"] >= 0 else 0
    for j in range(rows):
        a, z, (wide, narrow) = j * size, (j + 1) * size, factors_of(tables, basin, j)
        stretching.multiply(
            plane[basin["drawn"] + a :], wide, plane[basin["area"] + a : basin["area"] + z]
        )
        if basin["deep"] == 1:
            stretching.depth_deviations(
                plane[basin["plan"] + a :],
                wide,
                narrow,
                y[first + a :],
                seen[first + a : first + z],
            )
        else:
            stretching.density_deviations(
                basin["density"], wide, narrow, y[first + a :], seen[first + a : first + z]
            )
        for q in range(1, 3 + scalar_count):
            at = first + q * n if q < 3 else basin["carried"] + (q - 3) * n
            stretching.multiply(y[at + a :], narrow, seen[at + a : at + z])


@njit
def deviations_at_patches(tables, b, y):
    """Write areas and deviations from rest, as `deviations_of_rows`, for the cells of water at patches and walls."""
    plane = tables.plane
    seen = tables.seen
    basin = tables.basins[b]
    patches = tables.patches
    n, first = basin["n"], basin["y"]
    for p in range(patches.size):
        for m in range(patches[p]["count"] if patches[p]["basin"] == b else 0):
            i = tables.integers[patches[p]["first"] + m]
            wide = stretch_of_cell(plane, basin, i)
            plane[basin["area"] + i] = plane[basin["drawn"] + i] * wide
            seen[first + i] = (y[first + i] - plane[basin["plan"] + i] * (wide - 1.0)) / wide
            seen[first + n + i], seen[first + 2 * n + i] = (
                y[first + n + i] / wide,
                y[first + 2 * n + i] / wide,
            )


@njit
def size_patch(tables, basin, patch):
    """Write the present sizes of a patch: length over area of its faces, total length, area of its cells.

    Length is over the undeformed area of the cell, because the rates of the states refer to that area. On a mesh, the
    lengths of faces are those that `moving_meshes` has computed.
    """
    plane = tables.plane
    integers = tables.integers
    area = 0.0
    length = 0.0
    for m in range(patch["count"]):
        area += plane[basin["area"] + integers[patch["first"] + m]]
    at = patch["normals"]
    count = patch["faces"]
    lengths = first_length(tables, basin)
    for m in range(count):
        i = integers[patch["ring"] + count + m]
        drawn = plane[basin["drawn"] + i]
        if basin["nx"] > 0:
            is_normal = abs(plane[at + (1 if basin["turn"] == 1 else 0) * count + m]) < 0.5
            per_area = plane[at + 3 * count + m] * (
                stretch_of_cell(plane, basin, i) if is_normal else 1.0
            )
            own = per_area * drawn
        else:
            own = plane[lengths + integers[patch["ring"] + m]]
            per_area = own / drawn
        plane[at + 2 * count + m] = per_area
        length += own
    plane[patch["sizes"]], plane[patch["sizes"] + 1] = area, length


@njit
def first_length(tables, basin):
    """Index in `plane` of the length of the first boundary face of a mesh, see `cell_sides`; 0 for a grid."""
    if basin["nx"] > 0:
        return 0
    links = tables.integers[basin["links"] :]
    return (
        basin["mesh"]
        + MEASURES * blocks(links) * links[0] * BLOCK
        + 2 * links[3]
        + links[2]
        - links[3]
    )


@njit
def speed_of(t, tables, wall, y):
    """Speed of a wall [m/s], positive along its axis x or y: that of what moves it, or of its schedule."""
    if wall["rate"] >= 0:
        return wall["toward"] * (wall["speed"] + y[wall["rate"]])
    return (
        wall["toward"] * schedule_slopes(tables, wall["schedule"], t)[0]
        if wall["schedule"] >= 0
        else 0.0
    )


@njit
def set_line_speeds(t, y, dydt, out, handle):
    """Write the speeds of all grid lines and the rates of the travels of walls; raise out[RATE], which limits the step.

    On other meshes the speeds are those of corners, and `moving_meshes.set_side_speeds` raises out[RATE]. The status is
    set to NO_WIDTH if a cell is narrower than LEAST_WIDTH times its undeformed width.
    """
    tables = open_basins(handle)
    plane, walls = tables.plane, tables.walls
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["walls"] == 0:
            continue
        at, (count, lines) = basin["lines"], stretching_counts(basin)
        for i in range(lines):
            plane[at + i] = 0.0
        for k in range(basin["wall"], basin["wall"] + basin["walls"]):
            speed = speed_of(t, tables, walls[k], y)
            for i in range(lines):
                plane[at + i] += speed * plane[walls[k]["weights"] + i]
            if dydt.size > 0:
                dydt[walls[k]["y"]] = speed
        spacing, most = basin["spacing"] + (basin["nx"] if basin["turn"] == 1 else 0), 0.0
        for i in range(count):
            if not plane[basin["stretch"] + i] > LEAST_WIDTH:
                out[STATUS], out[WHERE] = NO_WIDTH, wall_of_row(tables, basin, i)
        for i in range(count if basin["nx"] > 0 else 0):
            most = max(most, max(abs(plane[at + i]), abs(plane[at + i + 1])) * plane[spacing + i])
        out[RATE] = max(out[RATE], most)


@njit
def wall_of_row(tables, basin, i):
    """Node of the wall whose travel changes the width of column or row i most.

    On a mesh other than a grid, i is a cell, and the area of the cell takes the place of the width.
    """
    index, most, (_, lines) = basin["wall"], -1.0, stretching_counts(basin)
    for k in range(basin["wall"], basin["wall"] + basin["walls"]):
        per = abs(tables.plane[tables.walls[k]["weights"] + lines + i])
        if per > most:
            index, most = k, per
    return tables.walls[index]["node"]


class GridMotion(NamedTuple):
    """Motion of a grid between moving walls: speeds of its lines, forces, and ratios of areas.

    speed_x : speeds of the lines x = constant [m/s], empty for lines at rest; speed_y : of the lines y = constant
    thrust : values on boundary faces. For a liquid they are pressures above that at rest [Pa], then terms of lost power
    (see `MeshMotion`); for water, thrusts minus those at rest, over density and length [m3/s2]
    wide, narrow : present over undeformed area of columns or rows, and the reciprocal
    """

    speed_x: np.ndarray
    speed_y: np.ndarray
    thrust: np.ndarray
    wide: np.ndarray
    narrow: np.ndarray


@njit(forceinline=True)
def grid_motion(tables, basin):
    """`GridMotion` of a basin with moving walls, whose mesh is a grid."""
    plane, at, rows, (count, lines) = (
        tables.plane,
        basin["lines"],
        basin["stretch"],
        stretching_counts(basin),
    )
    speeds, no_speeds = plane[at : at + lines + VECTOR_MARGIN], plane[:0]
    thrust = tables.work[basin["thrust"] : basin["thrust"] + 2 * basin["outer"]]
    wide, narrow = plane[rows : rows + count], plane[rows + count : rows + 2 * count]
    if basin["turn"] == 1:
        return GridMotion(no_speeds, speeds, thrust, wide, narrow)
    return GridMotion(speeds, no_speeds, thrust, wide, narrow)


@njit
def impedance(tables, basin, i, y):
    """Radiation impedance of a wall next to cell i, per metre of wall: force over speed [N s/m2]."""
    st = tables.settings[0]
    if basin["deep"] == 0:
        return basin["density"] * basin["speed"] * basin["thickness"]
    depth = max(tables.plane[basin["plan"] + i] + y[basin["y"] + i], 0.0)
    return st["rho"] * depth * sqrt(st["gravity"] * depth)


@njit
def push_body(out, tables, wall, force):
    """Add the force [N] on a wall, positive outward, to the forces on the body that moves with it.

    It acts through the origin of the body, without torque.
    """
    along = tables.basins[wall["basin"]]["turn"]
    out[row_of_body(tables, wall["body"]) + FORCE + along] += wall["outward"] * force


@njit
def push_bodies_at_rest(t, y, dydt, out, handle):
    """Add the forces on walls in the steady start to the forces on the bodies that move with the walls."""
    tables = open_basins(handle)
    for k in range(tables.walls.size):
        if tables.walls[k]["body"] >= 0:
            push_body(out, tables, tables.walls[k], tables.walls[k]["rest"])


@njit
def add_wall_forces(t, y, dydt, out, handle):
    """Write the outward forces on walls minus those at rest to `out`, and add them to the moving masses or bodies.

    The waves that walls radiate raise out[RATE], which limits the step. On bodies, the forces at rest are added too.
    """
    tables = open_basins(handle)
    layout = tables.layout[0]
    walls = tables.walls
    st = tables.settings[0]
    seen = tables.seen
    for k in range(walls.size):
        wall = walls[k]
        total = 0.0
        waves = 0.0
        basin = tables.basins[wall["basin"]]
        for m in range(wall["count"]):
            face, length = tables.integers[wall["faces"] + m], tables.plane[wall["lengths"] + m]
            total += length * tables.work[basin["thrust"] + face]
            waves += length * impedance(
                tables, basin, tables.integers[wall["faces"] + wall["count"] + m], seen
            )
        total *= st["rho"] if basin["deep"] == 1 else basin["thickness"]
        out[layout["wall"] + k] = total
        if wall["body"] >= 0:
            out[RATE] = max(out[RATE], waves / wall["inertia"])
            push_body(out, tables, wall, wall["rest"] + total)
        if wall["mass"] < 0:
            continue
        force = wall["outward"] * total
        out[layout["net_force"] + wall["mass"]] += force
        out[RATE] = max(out[RATE], waves * wall["lightness"])
        if dydt.size > 0 and wall["rate"] >= 0:
            dydt[wall["rate"]] += force * wall["lightness"]


@njit
def stretch_scalar_rates(t, y, dydt, out, handle):
    """Convert rates of amounts of scalars per area s to rates of their states A s / A0.

    A, A0 : present and undeformed area of a cell. The rates of other states are computed in that form directly.
    """
    tables = open_basins(handle)
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if basin["walls"] == 0 or basin["carried"] < 0:
            continue
        n, (rows, size) = (
            basin["n"],
            (basin["ny"], basin["nx"]) if basin["nx"] > 0 else (1, basin["n"]),
        )
        for j in range(rows):
            wide = factors_of(tables, basin, j)[0]
            for q in range(tables.scalars.size):
                at = basin["carried"] + q * n + j * size
                stretching.multiply_in_place(wide, dydt[at : at + size])


@njit
def observe_walls(t, y, out, handle, values):
    """Write the values of probes of walls: inward force on the fluid [N], power supplied to it [W], travel [m].

    The travel is positive along the axis x or y.
    """
    tables = open_basins(handle)
    for p in range(tables.probes.size):
        probe = tables.probes[p]
        if probe["kind"] != WALL_VALUE:
            continue
        wall = tables.walls[probe["index"]]
        force = wall["rest"] + out[tables.layout[0]["wall"] + probe["index"]]
        if probe["side"] == FORCE_OF:
            values[p] = force
        elif probe["side"] == POWER_OF:
            values[p] = supplied_power(t, tables, probe["index"], y, out)
        else:
            values[p] = y[wall["y"]]


@njit(forceinline=True)
def supplied_power(t, tables, k, y, out):
    """Power that wall k supplies to its basin [W]."""
    wall = tables.walls[k]
    force = wall["rest"] + out[tables.layout[0]["wall"] + k]
    return -force * wall["outward"] * speed_of(t, tables, wall, y)


@njit
def wall_power(t, y, dydt, out, handle, power):
    """Write the power supplied by each wall, and the power at it that the density law dissipates, to `power` [W].

    The supplied minus the dissipated power is added to the inflow power of the basin.
    """
    tables = open_basins(handle)
    for k in range(tables.walls.size):
        work = supplied_power(t, tables, k, y, out)
        dissipated = dissipated_power(tables, tables.walls[k])
        first = wall_power_row(tables, power) + WALL_ROWS * k
        power[first], power[first + 1] = work, dissipated
        power[basin_first_row(tables, power, tables.walls[k]["basin"])] += work - dissipated


@njit
def dissipated_power(tables, wall):
    """Power at a wall that the density law `linear` dissipates [W].

    Under this law the motion of the wall does not carry density and momentum along, see `moving_meshes.MeshMotion`.
    """
    basin, total = tables.basins[wall["basin"]], 0.0
    for m in range(wall["count"]):
        at = basin["thrust"] + basin["outer"] + tables.integers[wall["faces"] + m]
        total += tables.plane[wall["lengths"] + m] * tables.work[at]
    return 0.5 * basin["thickness"] / tables.settings[0]["rho"] * total


@njit
def area_growth_rate(t, tables, basin, y, i):
    """Rate of the area of cell i over its undeformed area, by the motion of walls [1/s]."""
    total, (_, lines) = 0.0, stretching_counts(basin)
    for k in range(basin["wall"], basin["wall"] + basin["walls"]):
        wall = tables.walls[k]
        total += tables.plane[wall["weights"] + lines + row_across(basin, i)] * speed_of(
            t, tables, wall, y
        )
    return total
