"""Walls of basins that move, and the lines that go with them. Knows rows of tables; knows no physics.

d/dt of what a cell contains is the sum of F - w U over its faces, w their speeds (Reynolds' transport theorem, 71 to
73). So the states are contents over areas as drawn, (A U - A0 U0) / A0, and where walls stand are states as well: areas
are then linear in states, a sum that every Runge-Kutta method keeps, and what is even stays so to round-off. All walls
of a basin move along one axis. What other pieces see in place of the contents are deviations U - U0, and in `plane`
lines and areas as they are. Corners of other meshes are what lines are to grids (`moving_meshes` has the rest of them).
"""

from math import sqrt

from fvsolve.basins.energy import row_of
from fvsolve.basins.stretch import fill, multiply, row_across, see_densities, see_depths, stretched, widen
from fvsolve.jit import njit
from fvsolve.kernels.accounts import OF_WALL, wall_rows
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.masses import motion
from fvsolve.kernels.mechanism.room import FORCE
from fvsolve.kernels.mechanism.room import row_of as row_of_body
from fvsolve.kernels.records import NO_DRAG, NO_ROOM, RATE, STATUS, WALL_VALUE, WHERE
from fvsolve.kernels.schedules import schedule_slopes

FORCE_OF, POWER_OF, TRAVEL_OF = 0, 1, 2  # what probes read, in the order of `parts.basin.part.MovingWall`
ROOM = 1e-3  # share of its drawn width that a cell keeps at least
BESIDE = 8  # speeds of lines that loops over whole vectors look at beyond the last


@njit(forceinline=True)
def across(basin):
    """How many rows of cells stretch, and how many lines move; of a mesh cells and corners."""
    if basin["nx"] == 0:
        return basin["n"], basin["corners"]
    many = basin["ny"] if basin["turn"] == 1 else basin["nx"]
    return many, many + 1


@njit
def see(t, y, seen, out, handle):
    """Lines and areas of basins as they are at y, and in `seen` of the tables the state as all others see it.

    Where no `seen` is given kernels come next that take contents themselves: of these cells then those that patches and
    walls look at, unless more do.
    """
    tables, done = open_tables(handle), 0
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["walls"] > 0:
            stretch_cells(tables, basin, y)
            copy(y[done : basin["y"]], tables.seen[done:])
            if seen.size == 0 and takes_contents(basin) and basin["carried"] < 0 and basin["friction"] == NO_DRAG:
                see_near(tables, b, y)
            else:
                see_rows(tables, basin, y)
            if basin["nx"] > 0:
                stretch_patches(tables, b)
            done = basin["y"] + (3 + (tables.scalars.size if basin["carried"] >= 0 else 0)) * basin["n"]
    copy(y[done:], tables.seen[done:])


@njit(forceinline=True)
def takes_contents(basin):
    """Whether the kernel of its rates does: that of water on grids, row by row."""
    return basin["deep"] == 1 and basin["nx"] > 0


@njit
def copy(source, target):
    """target = source."""
    for i in range(source.size):
        target[i] = source[i]


@njit
def stretch_cells(tables, basin, y):
    """By how much columns, rows or cells are stretched with walls where they are, and 1 over that."""
    plane, walls, at = tables.plane, tables.walls, basin["stretch"]
    many, lines = across(basin)
    wide, narrow = plane[at : at + many], plane[at + many : at + 2 * many]
    fill(1.0, wide)
    for k in range(basin["wall"], basin["wall"] + basin["walls"]):
        weights, travel = plane[walls[k]["weights"] + lines :], y[walls[k]["y"]]
        for i in range(many):
            wide[i] += weights[i] * travel
    for i in range(many):
        narrow[i] = 1.0 / wide[i]
    if basin["nx"] > 0:
        spacing = basin["spacing"] + (basin["nx"] if basin["turn"] == 1 else 0)
        multiply(plane[at + 2 * many :], narrow, plane[spacing : spacing + many])  # 1 / widths as drawn


@njit
def factors_of(tables, basin, j):
    """(wide, narrow) of the cells of row j of a grid, or of all of a mesh."""
    plane, nx, at, (many, _) = tables.plane, basin["nx"], basin["stretch"], across(basin)
    if nx == 0 or basin["turn"] == 0:
        return plane[at : at + many], plane[at + many : at + 2 * many]
    row = at + 3 * many
    fill(plane[at + j], plane[row : row + nx])
    fill(plane[at + many + j], plane[row + nx : row + 2 * nx])
    return plane[row : row + nx], plane[row + nx : row + 2 * nx]


@njit
def see_rows(tables, basin, y):
    """Areas, and U - U0 of all cells: ((A U - A0 U0) / A0 - U0 (A / A0 - 1)) A0 / A."""
    plane, seen, n, first = tables.plane, tables.seen, basin["n"], basin["y"]
    rows, size = (basin["ny"], basin["nx"]) if basin["nx"] > 0 else (1, n)
    many = tables.scalars.size if basin["carried"] >= 0 else 0
    for j in range(rows):
        a, z, (wide, narrow) = j * size, (j + 1) * size, factors_of(tables, basin, j)
        multiply(plane[basin["drawn"] + a :], wide, plane[basin["area"] + a : basin["area"] + z])
        if basin["deep"] == 1:
            see_depths(plane[basin["plan"] + a :], wide, narrow, y[first + a :], seen[first + a : first + z])
        else:
            see_densities(basin["density"], wide, narrow, y[first + a :], seen[first + a : first + z])
        for q in range(1, 3 + many):
            at = first + q * n if q < 3 else basin["carried"] + (q - 3) * n
            multiply(y[at + a :], narrow, seen[at + a : at + z])


@njit
def see_near(tables, b, y):
    """The same of the cells of water behind patches, walls among them."""
    plane, seen, basin, patches = tables.plane, tables.seen, tables.basins[b], tables.patches
    n, first = basin["n"], basin["y"]
    for p in range(patches.size):
        for m in range(patches[p]["count"] if patches[p]["basin"] == b else 0):
            i = tables.integers[patches[p]["first"] + m]
            wide = stretched(plane, basin, i)
            plane[basin["area"] + i] = plane[basin["drawn"] + i] * wide
            seen[first + i] = (y[first + i] - plane[basin["plan"] + i] * (wide - 1.0)) / wide
            seen[first + n + i], seen[first + 2 * n + i] = y[first + n + i] / wide, y[first + 2 * n + i] / wide


@njit
def stretch_patches(tables, b):
    """Sizes of the patches of a grid."""
    for p in range(tables.patches.size):
        if tables.patches[p]["basin"] == b:
            stretch_patch(tables, tables.basins[b], tables.patches[p])


@njit
def stretch_patch(tables, basin, patch):
    """Sizes of a patch that rides on a side along which lines move, or stands before cells that stretch.

    Rates of what cells contain go with lengths over areas as drawn.
    """
    plane, integers, area, length = tables.plane, tables.integers, 0.0, 0.0
    for m in range(patch["count"]):
        area += plane[basin["area"] + integers[patch["first"] + m]]
    at, many = patch["normals"], patch["faces"]
    for m in range(many):
        i = integers[patch["ring"] + many + m]
        rides = abs(plane[at + (1 if basin["turn"] == 1 else 0) * many + m]) < 0.5
        per_area = plane[at + 3 * many + m] * (stretched(plane, basin, i) if rides else 1.0)
        plane[at + 2 * many + m] = per_area
        length += per_area * plane[basin["drawn"] + i]
    plane[patch["sizes"]], plane[patch["sizes"] + 1] = area, length


@njit
def speed_of(t, tables, wall, y):
    """Speed of a wall along its axis [m/s]."""
    if wall["mass"] >= 0:
        return motion(tables.masses[wall["mass"]], y)[1]
    if wall["body"] >= 0:
        body = tables.bodies[wall["body"]]
        if body["schedule"] >= 0:
            return wall["toward"] * schedule_slopes(tables, body["schedule"], t)[0]
        return wall["toward"] * (body["speed"][0] + y[body["rate"]])
    return schedule_slopes(tables, wall["schedule"], t)[0]


@njit
def drive_lines(t, y, dydt, out, handle):
    """Speeds of all lines; steps follow these too."""
    tables = open_tables(handle)
    plane, walls = tables.plane, tables.walls
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["walls"] == 0:
            continue
        at, (many, lines) = basin["lines"], across(basin)
        for i in range(lines):
            plane[at + i] = 0.0
        for k in range(basin["wall"], basin["wall"] + basin["walls"]):
            speed = speed_of(t, tables, walls[k], y)
            for i in range(lines):
                plane[at + i] += speed * plane[walls[k]["weights"] + i]
            if dydt.size > 0:
                dydt[walls[k]["y"]] = speed
        spacing, most = basin["spacing"] + (basin["nx"] if basin["turn"] == 1 else 0), 0.0
        for i in range(many):
            if not plane[basin["stretch"] + i] > ROOM:
                out[STATUS], out[WHERE] = NO_ROOM, nearest(tables, basin, i)
        for i in range(many if basin["nx"] > 0 else 0):
            most = max(most, max(abs(plane[at + i]), abs(plane[at + i + 1])) * plane[spacing + i])
        out[RATE] = max(out[RATE], most)


@njit
def nearest(tables, basin, i):
    """The place that is the wall with which column, row or cell i goes most."""
    found, most, (_, lines) = basin["wall"], -1.0, across(basin)
    for k in range(basin["wall"], basin["wall"] + basin["walls"]):
        per = abs(tables.plane[tables.walls[k]["weights"] + lines + i])
        if per > most:
            found, most = k, per
    return tables.walls[found]["node"]


@njit(forceinline=True)
def moves_of(tables, basin):
    """Speeds of lines along x and along y, room for what they find on the boundary; wide and narrow."""
    plane, at, rows, (many, lines) = tables.plane, basin["lines"], basin["stretch"], across(basin)
    speeds, none = plane[at : at + lines + BESIDE], plane[:0]
    thrust = tables.work[basin["thrust"] : basin["thrust"] + 2 * basin["outer"]]
    wide, narrow = plane[rows : rows + many], plane[rows + many : rows + 2 * many]
    if basin["turn"] == 1:
        return none, speeds, thrust, wide, narrow
    return speeds, none, thrust, wide, narrow


@njit
def impedance(tables, basin, i, y):
    """Force per speed of one metre of wall beside cell i that sends out waves [N s/m2]."""
    st = tables.settings[0]
    if basin["deep"] == 0:
        return basin["density"] * basin["speed"] * basin["thickness"]
    depth = max(tables.plane[basin["plan"] + i] + y[basin["y"] + i], 0.0)
    return st["rho"] * depth * sqrt(st["gravity"] * depth)


@njit
def press(out, tables, wall, force):
    """Add a force on a wall, outward, to those of its body, through that body's origin."""
    row, along, push = row_of_body(tables, wall["body"]), tables.basins[wall["basin"]]["turn"], wall["outward"] * force
    out[row + FORCE + along] += push


@njit
def press_at_rest(t, y, dydt, out, handle):
    """What the profile puts on walls, to the bodies that they go with."""
    tables = open_tables(handle)
    for k in range(tables.walls.size):
        if tables.walls[k]["body"] >= 0:
            press(out, tables, tables.walls[k], tables.walls[k]["rest"])


@njit
def push_bodies(t, y, dydt, out, handle):
    """Forces on walls, outward, less those of the profile; bodies feel them, as steps do."""
    tables = open_tables(handle)
    layout, walls, masses, st = tables.layout[0], tables.walls, tables.masses, tables.settings[0]
    seen = tables.seen
    for k in range(walls.size):
        wall, total, waves = walls[k], 0.0, 0.0
        basin = tables.basins[wall["basin"]]
        for m in range(wall["count"]):
            face, length = tables.integers[wall["faces"] + m], tables.plane[wall["lengths"] + m]
            total += length * tables.work[basin["thrust"] + face]
            waves += length * impedance(tables, basin, tables.integers[wall["faces"] + wall["count"] + m], seen)
        total *= st["rho"] if basin["deep"] == 1 else basin["thickness"]
        out[layout["wall"] + k] = total
        if wall["body"] >= 0:
            body = tables.bodies[wall["body"]]
            out[RATE] = max(out[RATE], waves / body["mass"])
            press(out, tables, wall, wall["rest"] + total)
        if wall["mass"] < 0:
            continue
        mass = masses[wall["mass"]]
        force = wall["outward"] * total
        out[layout["net_force"] + wall["mass"]] += force
        out[RATE] = max(out[RATE], waves * mass["lightness"])
        if dydt.size > 0 and mass["y"] >= 0:
            dydt[mass["y"] + 1] += force * mass["lightness"]


@njit
def swell(t, y, dydt, out, handle):
    """Rates of what cells contain of scalars, from those of what they hold per area; others are made so as found."""
    tables = open_tables(handle)
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if basin["walls"] == 0 or basin["carried"] < 0:
            continue
        n, (rows, size) = basin["n"], (basin["ny"], basin["nx"]) if basin["nx"] > 0 else (1, basin["n"])
        for j in range(rows):
            wide = factors_of(tables, basin, j)[0]
            for q in range(tables.scalars.size):
                at = basin["carried"] + q * n + j * size
                widen(wide, dydt[at : at + size])


@njit
def observe_walls(t, y, out, handle, values):
    """Forces of walls on the water, inward, the power that they bring, and how far they have moved."""
    tables = open_tables(handle)
    for p in range(tables.probes.size):
        probe = tables.probes[p]
        if probe["kind"] != WALL_VALUE:
            continue
        wall = tables.walls[probe["index"]]
        force = wall["rest"] + out[tables.layout[0]["wall"] + probe["index"]]
        if probe["side"] == FORCE_OF:
            values[p] = force
        elif probe["side"] == POWER_OF:
            values[p] = brought(t, tables, probe["index"], y, out)
        else:
            values[p] = y[wall["y"]]


@njit(forceinline=True)
def brought(t, tables, k, y, out):
    """Power that wall k brings to what it stands in [W]."""
    wall = tables.walls[k]
    force = wall["rest"] + out[tables.layout[0]["wall"] + k]
    return -force * wall["outward"] * speed_of(t, tables, wall, y)


@njit
def wall_power(t, y, dydt, out, handle, power):
    """Rows of walls, before those of basins: what they bring to these, and what the law of these loses beside them."""
    tables = open_tables(handle)
    for k in range(tables.walls.size):
        work, lost = brought(t, tables, k, y, out), lost_beside(tables, tables.walls[k])
        first = wall_rows(tables, power) + OF_WALL * k
        power[first], power[first + 1] = work, lost
        power[row_of(tables, power, tables.walls[k]["basin"])] += work - lost


@njit
def lost_beside(tables, wall):
    """What law linear loses beside a wall, whose density and momentum do not ride along [W]; see `liquid.faces`."""
    basin, total = tables.basins[wall["basin"]], 0.0
    for m in range(wall["count"]):
        at = basin["thrust"] + basin["outer"] + tables.integers[wall["faces"] + m]
        total += tables.plane[wall["lengths"] + m] * tables.work[at]
    return 0.5 * basin["thickness"] / tables.settings[0]["rho"] * total


@njit
def widening(t, tables, basin, y, i):
    """Rate of the area of cell i over that as drawn [1/s]."""
    total, (_, lines) = 0.0, across(basin)
    for k in range(basin["wall"], basin["wall"] + basin["walls"]):
        wall = tables.walls[k]
        total += tables.plane[wall["weights"] + lines + row_across(basin, i)] * speed_of(t, tables, wall, y)
    return total
