"""Force elements, bushings and pins (loop constraints) between two points `from` and `to` of bodies.

A bushing is a spring with a damper, for displacement and for rotation. The force opposes the gap rho, the position of
`to` minus that of `from`, and its rate. The torque opposes the deviation of attitudes R~ = R R_d' (equation (56) of
docs/course.md) and the relative angular velocity. R is the attitude of the body of `to` in axes of the body of `from`,
and R_d is R at the attitudes that the case states; an equilibrium start may deviate from it. With the Euler parameters
eta and eps of R~, the torque is proportional to 2 eta eps, the vector of the skew part of R~; eps . eps =
(3 - trace R~) / 4. The rate of the gap is its rate in axes that turn with the mean of both angular velocities, and the
force acts on both bodies at the middle of the gap. So its power is force times rate, a common rotation of both bodies
is not damped, their angular momentum is conserved, and `from` and `to` may be exchanged.

link : row of a bushing or pin

Pins are solved by Lagrange multipliers with Baumgarte stabilisation. A pin constrains up to three directions n: it
keeps n . rho constant, where rho is the position of its point `to` in the axes of the body of its point `from`. Equal
and opposite forces lambda along n act on both bodies at `to`. Let q be the coordinates of all degrees of freedom, M =
L'L the mass matrix, and G q' the velocities along all constrained directions. With Z = L^-T G', so that Z' Z = G M^-1
G',

    lambda = -(Z' Z)^-1 (accelerations along these directions without pins + 2 pull G q' + pull^2 gap)

pull is the rate of stabilisation [1/s], gap the change of n . rho since the start [m]. Forces and positions are
relative to those at the start, which the table of pins contains: so a balanced start has no rounding errors. `scratch`
contains, after the data of `mass_matrix`: G and Z, with a number for each direction and degree of freedom; Z' Z;
lambda.
"""

from math import sqrt

from fvsolve.core.kernels import moving_frames as layout
from fvsolve.core.kernels.dtypes import BUSHING_VALUE, PIN_VALUE, RATE, RATE_UNWANTED
from fvsolve.core.kernels.energy_rows import device_power_row, device_stored_row
from fvsolve.core.kernels.moving_frames import add_force, add_torque, body_row
from fvsolve.core.kernels.vectors import (
    cross,
    minus,
    plus,
    rotate,
    scalar_product,
    scaled,
    vector,
    vector_product,
)
from fvsolve.features.motion.kernels import mass_matrix as mass
from fvsolve.features.motion.kernels.body_kinematics import body_of_point, point_at, spin_of
from fvsolve.features.motion.kernels.body_values import BODY_ROWS, acceleration_at
from fvsolve.features.motion.kernels.tables import ABOUT, open_motion
from fvsolve.jit import njit

BUSHING_ROWS = 2  # rows of `power` for each bushing


@njit(forceinline=True)
def add_element_end_force(out, tables, k, acts, f):
    """Add a force f [N], or for `acts` ABOUT a torque [N m], at point k to FORCE and TORQUE of its body."""
    i = body_of_point(tables, k)
    if i >= 0:
        here = body_row(tables, i)
        if acts == ABOUT:
            add_torque(out, here, *f)
        else:
            add_force(
                out, here, *rotate(out, here + layout.ATTITUDE, tables.points[k]["place"], 0), *f
            )


@njit
def add_element_forces(t, y, dydt, out, handle):
    """Add the forces of all elements to their bodies: along their direction at `to`, opposite to it at `from`."""
    tables = open_motion(handle)
    offsets, lines = tables.layout[0], tables.lines
    for k in range(lines.size):
        line = lines[k]
        f = scaled(out[offsets["push"] + line["push"]], vector(out, offsets["along"] + 3 * k))
        add_element_end_force(out, tables, line["to_point"], line["acts"], f)
        add_element_end_force(out, tables, line["from_point"], line["acts"], scaled(-1.0, f))


@njit
def relative_motion(out, tables, link):
    """Position of the point `to` minus that of `from` [m], and its rate [m/s], as two vectors in axes of the world.

    The rate is the velocity of `to` relative to the axes of the body of `from`.
    """
    i = body_of_point(tables, link["from_point"])
    to = point_at(out, tables, link["to_point"], layout.POSITION)
    gap, rate = minus(to, point_at(out, tables, link["from_point"], layout.POSITION)), to[3:]
    if i >= 0:
        here = body_row(tables, i)
        # Minus the velocity that the body of `from` has at the place of `to`.
        arm = minus(to, vector(out, here + layout.POSITION))
        rate = minus(
            minus(rate, vector(out, here + layout.VELOCITY)), cross(out, here + layout.SPIN, *arm)
        )
    return gap, rate


@njit
def add_pair_load(out, tables, link, p, f):
    """Add a force f [N] to the body of `to`, and -f to the body of `from`, both at the position p."""
    for end, sign in ((link["to_point"], 1.0), (link["from_point"], -1.0)):
        i = body_of_point(tables, end)
        if i >= 0:
            here = body_row(tables, i)
            add_force(out, here, *minus(p, vector(out, here + layout.POSITION)), *scaled(sign, f))


# bushings ----------


@njit
def bushing_motion(out, tables, bushing):
    """Gap of a bushing [m], its rate [m/s] in axes that turn with both bodies on average, and the middle of the gap.

    gap = r_to - r_from, rate = v_to - v_from - (w_to + w_from) x gap / 2, with the positions r and velocities v of its
    points and the angular velocities w of their bodies : three vectors in axes of the world
    """
    to = point_at(out, tables, bushing["to_point"], layout.POSITION)
    begin = point_at(out, tables, bushing["from_point"], layout.POSITION)
    gap, velocity = minus(to, begin), minus(to[3:], begin[3:])
    turning = plus(
        spin_of(out, tables, bushing["to_point"]), spin_of(out, tables, bushing["from_point"])
    )
    half = scaled(0.5, gap)
    return gap, minus(velocity, vector_product(turning, half)), minus(to, half)


@njit(forceinline=True)
def attitude_entry(out, tables, i, r, c):
    """Entry (r, c) of the rotation matrix of body i; for the world (i < 0) of the identity."""
    if i < 0:
        return 1.0 if r == c else 0.0
    return out[body_row(tables, i) + layout.ATTITUDE + 3 * r + c]


@njit
def deviation(out, tables, bushing, r, c):
    """Entry (r, c) of the deviation of attitudes R_to R_d' R_from' of a bushing, in axes of the world.

    R_to, R_from : attitudes of both bodies
    R_d : attitude of the body of `to` in axes of the body of `from` that the case states, without torque
    """
    i, j = body_of_point(tables, bushing["from_point"]), body_of_point(tables, bushing["to_point"])
    total = 0.0
    for k in range(3):
        for m in range(3):
            turn = attitude_entry(out, tables, j, r, k) * bushing["attitude"][3 * m + k]
            total += turn * attitude_entry(out, tables, i, c, m)
    return total


@njit
def rotation_deviation(out, tables, bushing):
    """Deviation of the relative attitude of the bodies of a bushing from R_d (see `deviation`).

    Returns, in axes of the world, 2 eta eps, the relative angular velocity [rad/s], and eps . eps, with the Euler
    parameters (eta, eps) of the deviation.
    """
    x = 0.5 * (deviation(out, tables, bushing, 2, 1) - deviation(out, tables, bushing, 1, 2))
    y = 0.5 * (deviation(out, tables, bushing, 0, 2) - deviation(out, tables, bushing, 2, 0))
    z = 0.5 * (deviation(out, tables, bushing, 1, 0) - deviation(out, tables, bushing, 0, 1))
    trace = deviation(out, tables, bushing, 0, 0) + deviation(out, tables, bushing, 1, 1)
    trace += deviation(out, tables, bushing, 2, 2)
    turning = minus(
        spin_of(out, tables, bushing["to_point"]), spin_of(out, tables, bushing["from_point"])
    )
    return (x, y, z), turning, 0.25 * (3.0 - trace)


@njit
def bushing_loads(out, tables, bushing):
    """Force [N] and torque [N m] of a bushing on the body of `to`, two vectors in axes of the world."""
    gap, rate, _ = bushing_motion(out, tables, bushing)
    turn, turning, _ = rotation_deviation(out, tables, bushing)
    force = minus(scaled(-bushing["stiffness"], gap), scaled(bushing["damping"], rate))
    torque = minus(
        scaled(-bushing["turn_stiffness"], turn), scaled(bushing["turn_damping"], turning)
    )
    return force, torque


@njit
def add_bushing_loads(t, y, dydt, out, handle):
    """Add the forces and torques of all bushings to their bodies."""
    tables = open_motion(handle)
    bushings = tables.bushings
    for k in range(bushings.size):
        force, torque = bushing_loads(out, tables, bushings[k])
        add_pair_load(out, tables, bushings[k], bushing_motion(out, tables, bushings[k])[2], force)
        add_element_end_force(out, tables, bushings[k]["to_point"], ABOUT, torque)
        add_element_end_force(out, tables, bushings[k]["from_point"], ABOUT, scaled(-1.0, torque))


@njit
def bushing_rate_limit(t, y, dydt, out, handle):
    """Raise out[RATE], the rate that limits steps [1/s], to the bound of `mass_matrix.oscillation_rate` for bushings.

    The factored mass matrix must be in `scratch`.
    """
    if out[RATE] == RATE_UNWANTED:
        return
    tables = open_motion(handle)
    bushings, at = tables.bushings, 7 * tables.freedoms.size
    stiffness = 0.0
    damping = 0.0
    none = (0.0, 0.0, 0.0)
    for k in range(bushings.size):
        bushing = bushings[k]
        i = body_of_point(tables, bushing["from_point"])
        j = body_of_point(tables, bushing["to_point"])
        p = bushing_motion(out, tables, bushing)[2]
        # Three directions of displacement, then three axes of rotation, each with its own stiffness.
        for axis in range(6):
            along = 1.0 * (axis % 3 == 0), 1.0 * (axis % 3 == 1), 1.0 * (axis % 3 == 2)
            mass.clear_column(tables, at)
            if axis < 3:
                mass.add_pair_force(out, tables, bushing, p, along, at)
            else:
                mass.add_body_wrench(tables, j, along, none, at)
                mass.add_body_wrench(tables, i, scaled(-1.0, along), none, at)
            inverse_mass = mass.mobility(tables, at)
            stiffness += inverse_mass * (
                bushing["stiffness"] if axis < 3 else bushing["turn_stiffness"]
            )
            damping += inverse_mass * (bushing["damping"] if axis < 3 else bushing["turn_damping"])
    out[RATE] = max(out[RATE], mass.oscillation_rate(stiffness, damping))


@njit
def observe_bushings(t, y, out, handle, values):
    """Write probe values of bushings: magnitude of gap [m], force [N] or torque [N m]."""
    tables = open_motion(handle)
    probes = tables.probes
    for k in range(probes.size):
        if probes[k]["kind"] == BUSHING_VALUE:
            bushing = tables.bushings[probes[k]["index"]]
            value, (force, torque) = (
                bushing_motion(out, tables, bushing)[0],
                bushing_loads(out, tables, bushing),
            )
            if probes[k]["side"] == 1:
                value = force
            elif probes[k]["side"] == 2:
                value = torque
            values[k] = sqrt(scalar_product(value, value))


@njit
def power_bushings(t, y, dydt, out, handle, power):
    """Write two entries of `power` for each bushing [W]: rate of stored energy, dissipated power."""
    tables = open_motion(handle)
    # Bushings come before bodies, and these before devices.
    at = (
        device_power_row(tables, power)
        - BODY_ROWS * tables.bodies.size
        - BUSHING_ROWS * tables.bushings.size
    )
    for k in range(tables.bushings.size):
        bushing = tables.bushings[k]
        gap, rate, _ = bushing_motion(out, tables, bushing)
        turn, turning, _ = rotation_deviation(out, tables, bushing)
        power[at] = bushing["stiffness"] * scalar_product(gap, rate)
        power[at] += bushing["turn_stiffness"] * scalar_product(turn, turning)
        power[at + 1] = bushing["damping"] * scalar_product(rate, rate)
        power[at + 1] += bushing["turn_damping"] * scalar_product(turning, turning)
        at += BUSHING_ROWS


@njit
def stored_bushings(t, y, dydt, out, handle, stored):
    """Write an entry of `stored` for each bushing [J]: change since the start of k gap^2 / 2 + 2 k_turn eps . eps.

    k [N/m], k_turn [N m/rad] : stiffnesses of the bushing; eps : vector of the Euler parameters of its rotation
    """
    tables = open_motion(handle)
    at = device_stored_row(tables, stored) - tables.bodies.size - tables.bushings.size
    for k in range(tables.bushings.size):
        bushing, gap = tables.bushings[k], bushing_motion(out, tables, tables.bushings[k])[0]
        eps = rotation_deviation(out, tables, bushing)[2]
        own = (
            0.5 * bushing["stiffness"] * scalar_product(gap, gap)
            + 2.0 * bushing["turn_stiffness"] * eps
        )
        stored[at + k] = own - bushing["energy"]


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
    # Acceleration of `to` in the world.
    if j >= 0:
        here = body_row(tables, j)
        place = rotate(out, here + layout.ATTITUDE, tables.points[pin["to_point"]]["place"], 0)
        a = acceleration_at(out, here, here + layout.ACCELERATION, *place)
    # Minus the acceleration of the axes of `from` at this place, and minus Coriolis, 2 w x v.
    if i >= 0:
        here = body_row(tables, i)
        arm = minus(
            point_at(out, tables, pin["to_point"], layout.POSITION),
            vector(out, here + layout.POSITION),
        )
        coriolis = cross(out, here + layout.SPIN, *scaled(2.0, velocity))
        a = minus(minus(a, acceleration_at(out, here, here + layout.ACCELERATION, *arm)), coriolis)
    return a


@njit
def fill_constraint_rows(out, tables):
    """Write G, Z and the right-hand sides of the equations for the pin forces lambda to `scratch`, see the module.

    Returns the number of constrained directions.
    """
    pins = tables.pins
    work = tables.scratch
    n = tables.freedoms.size
    g = constraint_offset(tables)
    rows = 0
    for k in range(pins.size):
        rows += pins[k]["rows"]
    # In `scratch` after G: Z, the matrix Z' Z, the right-hand sides.
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
            # A copy, because the rows of G are needed again for the forces on bodies.
            for m in range(n):
                work[z + at + m] = work[g + at + m]
            mass.solve_factor(tables, z + at)
            # Baumgarte: a + 2 pull v + pull^2 gap = 0 lets a deviation decay with critical damping.
            slip = scalar_product(direction, velocity)
            left = scalar_product(direction, gap) - pin["gap"][r]
            work[last + row] = -(
                scalar_product(direction, acceleration) + 2.0 * pull * slip + pull * pull * left
            )
            row += 1
    return rows


@njit
def multipliers(tables, rows):
    """Solve Z' Z lambda = right-hand sides for the pin forces lambda, by the Cholesky factors Z' Z = C C'.

    lambda replaces the right-hand sides in `scratch`, see the module. rows : number of constrained directions
    """
    work = tables.scratch
    n = tables.freedoms.size
    z = constraint_offset(tables) + rows * tables.freedoms.size
    h, last = z + rows * n, z + rows * n + rows * rows
    # Products Z' Z and their Cholesky factor C, row by row, in the same sweep.
    for i in range(rows):
        for j in range(i + 1):
            total = 0.0
            for m in range(n):
                total += work[z + i * n + m] * work[z + j * n + m]
            for m in range(j):
                total -= work[h + i * rows + m] * work[h + j * rows + m]
            work[h + i * rows + j] = sqrt(total) if i == j else total / work[h + j * rows + j]
    # Forward substitution with C, then backward with C'.
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
    tables = open_motion(handle)
    pins, at = tables.pins, tables.layout[0]["pin"]
    for k in range(pins.size):
        gap = relative_motion(out, tables, pins[k])[0]
        for r in range(pins[k]["rows"]):
            out[at + 3 * k + r] = scalar_product(pin_direction(out, tables, pins[k], r), gap)


@njit
def add_start_pin_forces(t, y, dydt, out, handle):
    """Add the pin forces at the start to the forces on bodies, along the directions of the pins at the state y."""
    tables = open_motion(handle)
    pins = tables.pins
    for k in range(pins.size):
        for r in range(pins[k]["rows"]):
            force = scaled(pins[k]["force"][r], pin_direction(out, tables, pins[k], r))
            add_pair_load(
                out,
                tables,
                pins[k],
                point_at(out, tables, pins[k]["to_point"], layout.POSITION),
                force,
            )


@njit
def solve_pinned_accelerations(t, y, dydt, out, handle):
    """Solve for the accelerations of all bodies with pin forces; write both and the rates of the joint states.

    The pin forces [N] are also added to the loads of bodies. out[RATE] is raised by `body_rate_limit` and to `pull`.
    """
    tables = open_motion(handle)
    pins = tables.pins
    work = tables.scratch
    n = tables.freedoms.size
    at = tables.layout[0]["pin"]
    # lambda is then the change of the pin forces since the start, which is zero in an equilibrium.
    add_start_pin_forces(t, y, dydt, out, handle)
    mass.fill_mass_matrix(y, out, tables)
    mass.factor_mass_matrix(tables)
    mass.solve_mass_matrix(tables, 6 * n)
    mass.spread_accelerations(out, tables)
    # lambda follows from the accelerations without pins.
    rows = fill_constraint_rows(out, tables)
    multipliers(tables, rows)
    g = constraint_offset(tables)
    last = g + 2 * rows * n + rows * rows
    # The forces G' lambda give accelerations that are added to those without pins.
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
        # The stabilisation is a decay at the rate `pull`, which limits explicit steps too.
        rate = max(rate, pins[k]["pull"])
        for r in range(pins[k]["rows"]):
            force = scaled(work[last + row], pin_direction(out, tables, pins[k], r))
            add_pair_load(
                out,
                tables,
                pins[k],
                point_at(out, tables, pins[k]["to_point"], layout.POSITION),
                force,
            )
            out[at + 3 * k + r] = pins[k]["force"][r] + work[last + row]
            row += 1
    # Once more, now with the pin forces.
    mass.spread_accelerations(out, tables)
    if out[RATE] != RATE_UNWANTED:
        out[RATE] = max(mass.body_rate_limit(out, tables), rate)
    mass.state_rates(y, dydt, tables)


@njit
def observe_pins(t, y, out, handle, values):
    """Write probe values of pins: magnitude of gap [m] or force [N], in the constrained directions."""
    tables = open_motion(handle)
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
