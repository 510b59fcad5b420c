"""Power and stored energy of basins under the linear law. Knows the tables; adds nothing up over time.

Water with a free surface stores rho (g h^2 / 2 + g h z_bed + |q|^2 / (2 h)) per area, a liquid per volume
P r / rho + a^2 r^2 / (2 rho) + |m|^2 / (2 rho), P its potential at rest; squares are those of a cell's mean. Rows of
`power`, last of all, a basin: what comes in by patches at their potential, what is lost there (water that enters has
no speed, water that leaves takes its own along and is not paid for it), friction, rate of storage [W]; of `stored`:
its change since the profile [J].
"""

from math import sqrt

from fvsolve.basins.free_surface.friction import FASTEST
from fvsolve.basins.free_surface.rows import THIN
from fvsolve.jit import njit
from fvsolve.kernels.energy import potential
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.plane.behind import counted, weight
from fvsolve.kernels.records import CARRIED_GRID, MANNING, NO_DRAG, SHALLOW_FACES

ROWS = 4  # of `power` a basin


@njit(forceinline=True)
def per_flow(depth):
    """Velocity over flow of water so deep [1/m]."""
    wet = max(depth, THIN)
    return 2.0 * depth / (depth * depth + wet * wet)


@njit(forceinline=True)
def at_rest(st, basin):
    """Potential of the profile [Pa]."""
    return basin["rest"] - st["rho"] * st["gravity"] * st["datum"]


@njit
def add_power(t, y, dydt, out, handle, power):
    """Rows of all basins."""
    tables = open_tables(handle)
    st, basins, patches = tables.settings[0], tables.basins, tables.patches
    first = power.size - ROWS * basins.size
    for b in range(basins.size):
        rows = power[first + ROWS * b : first + ROWS * (b + 1)]
        rows[0] = rows[1] = rows[2] = rows[3] = 0.0
        if basins[b]["kind"] <= SHALLOW_FACES:
            water_power(st, basins[b], tables.plane, y, dydt, rows)
        elif basins[b]["kind"] < CARRIED_GRID:
            liquid_power(st, basins[b], tables.plane, y, dydt, rows)
    for k in range(patches.size):
        patch, node = patches[k], patches[k]["node"]
        flow = out[tables.layout[0]["net"] + node] + out[tables.layout[0]["supply"] + node]
        power[first + ROWS * patch["basin"]] += potential(tables, out, node) * flow / st["rho"]
        if basins[patch["basin"]]["kind"] <= SHALLOW_FACES:
            power[first + ROWS * patch["basin"] + 1] += patch_loss(tables, patch, flow, y)


@njit
def water_power(st, basin, plane, y, dydt, rows):
    """Friction, held to FASTEST as in the rates, and rate of storage of water with a free surface."""
    n, o = basin["n"], basin["y"]
    depths, surface = plane[basin["plan"] :], plane[basin["plan"] + n :]
    weight, rest, area = st["rho"] * st["gravity"], at_rest(st, basin), plane[basin["area"] :]
    friction, rate = 0.0, 0.0
    for i in range(n):
        d, qx, qy = y[o + i], y[o + n + i], y[o + 2 * n + i]
        depth = max(depths[i] + d, 0.0)
        share = per_flow(depth)
        u, v = share * qx, share * qy
        level = rest + weight * (surface[i] + d) - 0.5 * st["rho"] * (u * u + v * v)
        moves = u * dydt[o + n + i] + v * dydt[o + 2 * n + i]
        rate += area[i] * (level * dydt[o + i] + st["rho"] * moves)
        friction += area[i] * drag_power(st, basin, depth, u * u + v * v)
    rows[2], rows[3] = friction, rate


@njit
def drag_power(st, basin, depth, square):
    """What the bed takes of water that runs over it, per area [W/m2]; square : of its velocity."""
    if basin["friction"] == NO_DRAG or square == 0.0:
        return 0.0
    rate, wet = 0.125 * basin["roughness"] * sqrt(square) / max(depth, THIN), max(depth, THIN)
    if basin["friction"] == MANNING:
        rate = st["gravity"] * basin["roughness"] ** 2 * sqrt(square) / wet ** (4.0 / 3.0)
    return st["rho"] * depth * square * rate / (1.0 + rate / FASTEST)


@njit
def liquid_power(st, basin, plane, y, dydt, rows):
    """Rate of storage of a liquid."""
    n, o, rest, area = basin["n"], basin["y"], at_rest(st, basin), plane[basin["area"] :]
    rate, square = 0.0, basin["speed"] * basin["speed"]
    for i in range(n):
        moves = y[o + n + i] * dydt[o + n + i] + y[o + 2 * n + i] * dydt[o + 2 * n + i]
        rate += area[i] * ((rest + square * y[o + i]) * dydt[o + i] + moves)
    rows[3] = basin["thickness"] * rate / st["rho"]


@njit
def patch_loss(tables, patch, flow, y):
    """What speed is lost where `flow` [kg/s] enters the cells behind a patch, or leaves them [W]; see `patches`."""
    st, basin, plane, integers = (
        tables.settings[0],
        tables.basins[patch["basin"]],
        tables.plane,
        tables.integers,
    )
    n, o, lost, leaves = basin["n"], basin["y"], 0.0, flow < 0.0
    depths, area = plane[basin["plan"] :], plane[basin["area"] :]
    each = flow / counted(tables, patch, leaves, y)
    for m in range(patch["count"]):
        i = integers[patch["first"] + m]
        share = per_flow(max(depths[i] + y[o + i], 0.0))
        square = share * share * (y[o + n + i] ** 2 + y[o + 2 * n + i] ** 2)
        lost += 0.5 * area[i] * square * each * weight(plane, basin, leaves, i, y)
    for m in range(patch["faces"]):
        i, at, many = integers[patch["ring"] + patch["faces"] + m], patch["normals"], patch["faces"]
        depth = max(depths[i] + y[o + i], 0.0)
        share, wide = per_flow(depth), plane[at + 2 * many + m] * area[i]
        u, v = share * y[o + n + i], share * y[o + 2 * n + i]
        away = -each * weight(plane, basin, leaves, i, y) * patch["area"] / patch["length"]
        along = u * plane[at + m] + v * plane[at + many + m]
        held = away - st["rho"] * depth * along  # against a wall all that runs into it is lost
        lost -= wide * along * (abs(along) + sqrt(st["gravity"] * depth)) * held
        if away > 0.0:
            lost += wide * away * (u * u + v * v - along * along)
    return lost


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Rows of all basins."""
    tables = open_tables(handle)
    st, basins, plane = tables.settings[0], tables.basins, tables.plane
    first = stored.size - basins.size
    for b in range(basins.size):
        basin, total = basins[b], 0.0
        n, o, rest, area = basin["n"], basin["y"], at_rest(st, basin), plane[basin["area"] :]
        if basin["kind"] <= SHALLOW_FACES:
            depths, surface = plane[basin["plan"] :], plane[basin["plan"] + n :]
            weight = st["rho"] * st["gravity"]
            for i in range(n):
                d, square = y[o + i], y[o + n + i] ** 2 + y[o + 2 * n + i] ** 2
                share = per_flow(max(depths[i] + d, 0.0))
                height = (rest + weight * surface[i]) * d + 0.5 * weight * d * d
                total += area[i] * (height + 0.5 * st["rho"] * share * square)
        elif basin["kind"] < CARRIED_GRID:
            for i in range(n):
                r, square = y[o + i], y[o + n + i] ** 2 + y[o + 2 * n + i] ** 2
                total += area[i] * (rest * r + 0.5 * (basin["speed"] ** 2 * r * r + square))
            total *= basin["thickness"] / st["rho"]
        stored[first + b] = total
