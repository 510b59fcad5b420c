"""Loop constraints (pins) by Lagrange multipliers with Baumgarte stabilisation; imported only for cases with pins.

A pin constrains up to three directions n: it keeps n . rho constant, where rho is the position of its point `to` in the
axes of the body of its point `from`. Equal and opposite forces lambda along n act on both bodies at `to`. Let q be the
coordinates of all degrees of freedom, M = L'L the mass matrix, and G q' the velocities along all constrained
directions. With Z = L^-T G', so that Z' Z = G M^-1 G',

    lambda = -(Z' Z)^-1 (accelerations along these directions without pins + 2 pull G q' + pull^2 gap)

pull is the rate of stabilisation [1/s], gap the change of n . rho since the start [m]. Forces and positions are
relative to those at the start, which the table of pins contains: so a balanced start has no rounding errors. `scratch`
contains, after the data of `mass_matrix`: G and Z, with a number for each direction and degree of freedom; Z' Z;
lambda.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import PIN_VALUE, RATE, RATE_UNWANTED
from fvsolve.kernels.mechanism import body_layout as layout
from fvsolve.kernels.mechanism import mass_matrix as mass
from fvsolve.kernels.mechanism.body_kinematics import body_of_point, point_at
from fvsolve.kernels.mechanism.body_layout import body_row
from fvsolve.kernels.mechanism.body_values import acceleration_at
from fvsolve.kernels.mechanism.force_elements import add_pair_load, relative_motion
from fvsolve.kernels.mechanism.vectors import cross, minus, rotate, scalar_product, scaled, vector
from fvsolve.kernels.table_handle import open_tables


@njit(forceinline=True)
def constraint_offset(tables):
    """Offset in `scratch` of the matrix G, which gives velocities along constrained directions."""
    return mass.scratch_offsets(tables)[1] + mass.LOAD_SIZE * tables.bodies.size


@njit
def pin_direction(out, tables, pin, r):
    """Unit vector of constrained direction r of a pin, at its present attitude, in axes of the world."""
    i = body_of_point(tables, pin["from_point"])
    if i < 0:
        return vector(pin["directions"], 3 * r)
    return rotate(out, body_row(tables, i) + layout.ATTITUDE, pin["directions"], 3 * r)


@njit
def relative_acceleration(out, tables, pin, velocity):
    """Acceleration of the point `to` relative to the axes of the body of `from`; (65) of docs/course.md.

    velocity : velocity of `to` relative to these axes. The accelerations of both bodies in `out` are used.
    """
    i, j = body_of_point(tables, pin["from_point"]), body_of_point(tables, pin["to_point"])
    a = 0.0, 0.0, 0.0
    if j >= 0:
        here = body_row(tables, j)
        place = rotate(out, here + layout.ATTITUDE, tables.points[pin["to_point"]]["place"], 0)
        a = acceleration_at(out, here, here + layout.ACCELERATION, *place)
    if i >= 0:
        here = body_row(tables, i)
        arm = minus(point_at(out, tables, pin["to_point"], layout.POSITION), vector(out, here + layout.POSITION))
        coriolis = cross(out, here + layout.SPIN, *scaled(2.0, velocity))
        a = minus(minus(a, acceleration_at(out, here, here + layout.ACCELERATION, *arm)), coriolis)
    return a


@njit
def fill_constraint_rows(out, tables):
    """Write G, Z and the right-hand sides of the equations for the pin forces lambda to `scratch`, see the module.

    Returns the number of constrained directions.
    """
    pins, work, n, g = tables.pins, tables.scratch, tables.freedoms.size, constraint_offset(tables)
    rows = 0
    for k in range(pins.size):
        rows += pins[k]["rows"]
    z, last = g + rows * n, g + 2 * rows * n + rows * rows
    row = 0
    for k in range(pins.size):
        pin, pull = pins[k], pins[k]["pull"]
        gap, velocity = relative_motion(out, tables, pin)
        acceleration = relative_acceleration(out, tables, pin, velocity)
        p = point_at(out, tables, pin["to_point"], layout.POSITION)[:3]
        for r in range(pin["rows"]):
            direction, at = pin_direction(out, tables, pin, r), row * n
            mass.clear_column(tables, g + at)
            mass.add_pair_force(out, tables, pin, p, direction, g + at)
            for m in range(n):
                work[z + at + m] = work[g + at + m]
            mass.solve_factor(tables, z + at)
            slip, left = scalar_product(direction, velocity), scalar_product(direction, gap) - pin["gap"][r]
            work[last + row] = -(scalar_product(direction, acceleration) + 2.0 * pull * slip + pull * pull * left)
            row += 1
    return rows


@njit
def multipliers(tables, rows):
    """Solve Z' Z lambda = right-hand sides for the pin forces lambda, by the Cholesky factors Z' Z = C C'.

    lambda replaces the right-hand sides in `scratch`, see the module. rows : number of constrained directions
    """
    work, n, z = tables.scratch, tables.freedoms.size, constraint_offset(tables) + rows * tables.freedoms.size
    h, last = z + rows * n, z + rows * n + rows * rows
    for i in range(rows):
        for j in range(i + 1):
            total = 0.0
            for m in range(n):
                total += work[z + i * n + m] * work[z + j * n + m]
            for m in range(j):
                total -= work[h + i * rows + m] * work[h + j * rows + m]
            work[h + i * rows + j] = sqrt(total) if i == j else total / work[h + j * rows + j]
    for i in range(rows):
        for m in range(i):
            work[last + i] -= work[h + i * rows + m] * work[last + m]
        work[last + i] /= work[h + i * rows + i]
    for i in range(rows - 1, -1, -1):
        for m in range(i + 1, rows):
            work[last + i] -= work[h + m * rows + i] * work[last + m]
        work[last + i] /= work[h + i * rows + i]


@njit
def start_gaps(t, y, dydt, out, handle):
    """Write n . rho of each constrained direction n [m] in place of the pin forces in `out`, for the start of a model.

    It is the whole displacement, not its change since the start.
    """
    tables = open_tables(handle)
    pins, at = tables.pins, tables.layout[0]["pin"]
    for k in range(pins.size):
        gap = relative_motion(out, tables, pins[k])[0]
        for r in range(pins[k]["rows"]):
            out[at + 3 * k + r] = scalar_product(pin_direction(out, tables, pins[k], r), gap)


@njit
def add_start_pin_forces(t, y, dydt, out, handle):
    """Add the pin forces at the start to the forces on bodies, along the directions of the pins at the state y."""
    tables = open_tables(handle)
    pins = tables.pins
    for k in range(pins.size):
        for r in range(pins[k]["rows"]):
            force = scaled(pins[k]["force"][r], pin_direction(out, tables, pins[k], r))
            add_pair_load(out, tables, pins[k], force)


@njit
def solve_pinned_accelerations(t, y, dydt, out, handle):
    """Solve for the accelerations of all bodies with pin forces; write both and the rates of the joint states.

    The pin forces [N] are also added to the loads of bodies. out[RATE] is raised by `body_rate_limit` and to `pull`.
    """
    tables = open_tables(handle)
    pins, work, n, at = tables.pins, tables.scratch, tables.freedoms.size, tables.layout[0]["pin"]
    add_start_pin_forces(t, y, dydt, out, handle)
    mass.fill_mass_matrix(y, out, tables)
    mass.factor_mass_matrix(tables)
    mass.solve_mass_matrix(tables, 6 * n)
    mass.spread_accelerations(out, tables)
    rows = fill_constraint_rows(out, tables)
    multipliers(tables, rows)
    g = constraint_offset(tables)
    last = g + 2 * rows * n + rows * rows
    for m in range(n):
        total = 0.0
        for i in range(rows):
            total += work[last + i] * work[g + i * n + m]
        work[7 * n + m] = total
    mass.solve_mass_matrix(tables, 7 * n)
    for m in range(n):
        work[6 * n + m] += work[7 * n + m]
    row, rate = 0, 0.0
    for k in range(pins.size):
        rate = max(rate, pins[k]["pull"])
        for r in range(pins[k]["rows"]):
            force = scaled(work[last + row], pin_direction(out, tables, pins[k], r))
            add_pair_load(out, tables, pins[k], force)
            out[at + 3 * k + r] = pins[k]["force"][r] + work[last + row]
            row += 1
    mass.spread_accelerations(out, tables)
    if out[RATE] != RATE_UNWANTED:
        out[RATE] = max(mass.body_rate_limit(out, tables), rate)
    mass.state_rates(y, dydt, tables)


@njit
def observe_pins(t, y, out, handle, values):
    """Write probe values of pins: magnitude of gap [m] or force [N], in the constrained directions."""
    tables = open_tables(handle)
    probes, pins = tables.probes, tables.pins
    for k in range(probes.size):
        if probes[k]["kind"] == PIN_VALUE:
            pin, at = pins[probes[k]["index"]], tables.layout[0]["pin"] + 3 * probes[k]["index"]
            total = 0.0
            if probes[k]["side"] == 0:
                gap = relative_motion(out, tables, pin)[0]
                for r in range(pin["rows"]):
                    total += scalar_product(pin_direction(out, tables, pin, r), gap) ** 2
            else:
                for r in range(pin["rows"]):
                    total += out[at + r] * out[at + r]
            values[k] = sqrt(total)
