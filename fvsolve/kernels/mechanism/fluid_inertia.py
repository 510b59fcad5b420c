"""Contribution of the fluid of networks and of the water in basins to the mass matrix M of bodies that forces can move.

First all fluid of a network counts as fixed to its body. Then the inertia of its sliding along the flow path (C, Z) is
subtracted; C and Z are the integrals of dr and r x dr along the path. For a rigid column of density rho, area A and
length L this inertia is rho (A / L) c c' with c = (C, Z), taken from surface to surface. For each cell of a pipe, the
mass of the cell over the square of its length replaces rho A / L. M contains the products over degrees of freedom, see
`mass_matrix`. The water in a basin moves with its body only along the normal of the bed; along the bed it slides.

s : offset in `work`, or `scratch`, of the angular velocity and the velocity at o (`body_layout`) per unit rate of one
degree of freedom
"""

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import CHAMBER, LAW_LINEAR, TANK, TANK_OUT
from fvsolve.kernels.mechanism import body_layout as layout
from fvsolve.kernels.mechanism import fluid_loads as fluid
from fvsolve.kernels.mechanism.body_layout import body_row, freedom_path, nearest_free_body
from fvsolve.kernels.mechanism.vectors import cross, dot, plus, rotate, scalar_product, scaled, vector


@njit(forceinline=True)
def freedom_velocity(work, s, r):
    """Velocity of a point of a body per unit rate of one degree of freedom; r : position of the point from o."""
    return plus(vector(work, s + 3), cross(work, s, *r))


@njit
def add_segment_inertia(out, tables, i, segment):
    """Add the inertia of a straight segment of fluid on body i to the mass matrix M in `scratch`.

    Velocities are linear along the segment. segment : (start r, direction t, mass moments m), see `fluid_loads`
    """
    (r, t, m), work, here = segment, tables.scratch, body_row(tables, i)
    path, count = freedom_path(tables, nearest_free_body(tables, i))
    start = plus(rotate(out, here + layout.ATTITUDE, r, 0), vector(out, here + layout.ARM))
    along = rotate(out, here + layout.ATTITUDE, t, 0)
    for p in range(count):
        j = tables.integers[path + p]
        v, a = freedom_velocity(work, 6 * j, start), cross(work, 6 * j, *along)
        first, second = plus(scaled(m[0], v), scaled(m[1], a)), plus(scaled(m[1], v), scaled(m[2], a))
        row = 8 * tables.freedoms.size + tables.freedoms[j]["row"]
        for q in range(p + 1):
            s = 6 * tables.integers[path + q]
            v, a = freedom_velocity(work, s, start), cross(work, s, *along)
            work[row + q] += scalar_product(v, first) + scalar_product(a, second)


@njit(forceinline=True)
def path_component(out, work, here, s, flow_path):
    """Velocity of a body integrated along a flow path (C, Z), C . v + Z . w, per unit rate of one degree of freedom.

    v, w : velocity of the origin of the body, and angular velocity
    """
    v = freedom_velocity(work, s, vector(out, here + layout.ARM))
    straight = scalar_product(rotate(out, here + layout.ATTITUDE, flow_path, 0), v)
    return straight + dot(work, s, *rotate(out, here + layout.ATTITUDE, flow_path, 3))


@njit
def subtract_sliding_inertia(out, tables, i, flow_path, slides):
    """Subtract the inertia of fluid that slides along a flow path on body i from the mass matrix M in `scratch`.

    flow_path : integrals of dr and r x dr along the path
    slides : mass of the fluid over the square of its length [kg/m2]; if the path has unit length, this value times the
        square of the distance between the ends of the fluid [kg]
    """
    work, n, here = tables.scratch, tables.freedoms.size, body_row(tables, i)
    path, count = freedom_path(tables, nearest_free_body(tables, i))
    for p in range(count):
        j = tables.integers[path + p]
        row, first = 8 * n + tables.freedoms[j]["row"], path_component(out, work, here, 6 * j, flow_path)
        for q in range(p + 1):
            second = path_component(out, work, here, 6 * tables.integers[path + q], flow_path)
            work[row + q] -= slides * first * second


@njit
def add_pipe_inertia(y, out, tables, k):
    """Add the fluid of pipe k to the mass matrix M: it moves with its body, but slides along the axis of the pipe.

    Under the linear density law, the mass that pressure waves add does not slide.
    """
    pipe, (r, t, span) = tables.pipes[k], fluid.pipe_segment(tables, k)
    i, m = tables.moving_segments[pipe["moving_segment"]]["body"], fluid.pipe_moments(tables, y, k, span, 1.0)[0]
    add_segment_inertia(out, tables, i, (r, t, m))
    length, slides = pipe["cells"] * pipe["dx"], m[0]
    if tables.settings[0]["law"] == LAW_LINEAR:
        slides = tables.settings[0]["rho"] * pipe["area"] * length
    subtract_sliding_inertia(out, tables, i, fluid.straight_path(r, t), slides * (span / length) ** 2)


@njit
def add_fluid_inertia(y, out, tables):
    """Add the fluid of nodes, pipes and rigid columns to the mass matrix M of bodies that forces can move."""
    nodes, pipes, columns = tables.nodes, tables.pipes, tables.columns
    if tables.moving_segments.size == 0:
        return
    for i in range(nodes.size):
        kind, body = nodes[i]["kind"], fluid.free_carrier(tables, nodes[i]["moving_segment"])
        if body >= 0 and (kind == TANK or kind == CHAMBER):
            add_segment_inertia(out, tables, body, fluid.node_segment(y, tables, i))
    for k in range(pipes.size):
        if fluid.free_carrier(tables, pipes[k]["moving_segment"]) >= 0:
            add_pipe_inertia(y, out, tables, k)
    for k in range(columns.size):
        column, body = columns[k], fluid.free_carrier(tables, columns[k]["moving_segment"])
        if body >= 0:
            for m in range(column["moving_segments"]):
                add_segment_inertia(out, tables, body, fluid.column_segment(tables, column, m))
            slides = tables.settings[0]["rho"] * column["area"] / column["length"]
            subtract_sliding_inertia(out, tables, body, fluid.column_path(y, tables, column), slides)


# basins ----------


@njit
def add_basin_inertia(out, tables):
    """Add the inertia of the water in all basins on bodies, J' N J for each basin, to the mass matrix in `scratch`.

    Basins on bodies that no degree of freedom moves are left out.
    J : coefficients of 1, x, y in the normal acceleration of the bed, a column for each degree of freedom
    N : matrix of the moments of mass of 1, x, y
    """
    work, freedoms, paths, n = tables.scratch, tables.freedoms, tables.integers, tables.freedoms.size
    for b in range(tables.basins.size):
        i, tank = nearest_free_body(tables, tables.basins[b]["body"]), tables.layout[0]["tank"] + TANK_OUT * b
        if i < 0:
            continue
        path, count = freedom_path(tables, i)
        for p in range(count):
            j = paths[path + p]
            row, (a, c, d) = 8 * n + freedoms[j]["row"], normal_accelerations(out, work, tank, 6 * j)
            m = tank + layout.MOMENTS
            e = out[m] * a + out[m + 1] * c + out[m + 2] * d
            f = out[m + 1] * a + out[m + 3] * c + out[m + 4] * d
            g = out[m + 2] * a + out[m + 4] * c + out[m + 5] * d
            for q in range(p + 1):
                x, y, z = normal_accelerations(out, work, tank, 6 * paths[path + q])
                work[row + q] += e * x + f * y + g * z


@njit(forceinline=True)
def normal_accelerations(out, work, tank, s):
    """Normal velocity of the bed of a basin per unit rate of one degree of freedom, as coefficients of 1, x and y.

    They are also those of the normal acceleration per unit acceleration of that degree of freedom.
    tank : offset of the numbers of the basin in `out`
    """
    v, w = freedom_velocity(work, s, vector(out, tank + layout.BASIN_ARM)), vector(work, s)
    return dot(out, tank + layout.NORMAL, *v), -dot(out, tank + layout.NORTH, *w), dot(out, tank + layout.EAST, *w)
