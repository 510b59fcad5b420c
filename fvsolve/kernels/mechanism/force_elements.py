"""Force elements and bushings between two points `from` and `to` of bodies, and the relative motion of their points.

A bushing is a spring with a damper, for displacement and for rotation. The force opposes the gap rho, the position of
`to` minus that of `from`, and its rate. The torque opposes the deviation of attitudes R~ = R R_d' (equation (56) of
docs/course.md) and the relative angular velocity. R is the attitude of the body of `to` in axes of the body of `from`,
and R_d is R at the attitudes that the case states; an equilibrium start may deviate from it. With the Euler parameters
eta and eps of R~, the torque is proportional to 2 eta eps, the vector of the skew part of R~; eps . eps =
(3 - trace R~) / 4. The force acts on both bodies at the point `to`, so its power is force times d(rho)/dt.

link : row of a bushing or pin
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import ABOUT, BUSHING_VALUE, RATE
from fvsolve.kernels.energy_rows import BUSHING_ROWS, bushing_power_row, bushing_stored_row
from fvsolve.kernels.mechanism import body_layout as layout
from fvsolve.kernels.mechanism import mass_matrix as mass
from fvsolve.kernels.mechanism.body_kinematics import body_of_point, point_at, spin_of
from fvsolve.kernels.mechanism.body_layout import add_force, add_torque, body_row
from fvsolve.kernels.mechanism.vectors import cross, minus, rotate, scalar_product, scaled, vector
from fvsolve.kernels.table_handle import open_tables


@njit(forceinline=True)
def add_element_end_force(out, tables, k, acts, f):
    """Add a force f [N], or for `acts` ABOUT a torque [N m], at point k to FORCE and TORQUE of its body."""
    i = body_of_point(tables, k)
    if i >= 0:
        here = body_row(tables, i)
        if acts == ABOUT:
            add_torque(out, here, *f)
        else:
            add_force(out, here, *rotate(out, here + layout.ATTITUDE, tables.points[k]["place"], 0), *f)


@njit
def add_element_forces(t, y, dydt, out, handle):
    """Add the forces of all elements to their bodies: along their direction at `to`, opposite to it at `from`."""
    tables = open_tables(handle)
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
    i, to = body_of_point(tables, link["from_point"]), point_at(out, tables, link["to_point"], layout.POSITION)
    gap, rate = minus(to, point_at(out, tables, link["from_point"], layout.POSITION)), to[3:]
    if i >= 0:
        here = body_row(tables, i)
        arm = minus(to, vector(out, here + layout.POSITION))
        rate = minus(minus(rate, vector(out, here + layout.VELOCITY)), cross(out, here + layout.SPIN, *arm))
    return gap, rate


@njit
def add_pair_load(out, tables, link, f):
    """Add a force f [N] to the body of `to`, and -f to the body of `from`, both at the point `to`."""
    p = point_at(out, tables, link["to_point"], layout.POSITION)
    for end, sign in ((link["to_point"], 1.0), (link["from_point"], -1.0)):
        i = body_of_point(tables, end)
        if i >= 0:
            here = body_row(tables, i)
            add_force(out, here, *minus(p, vector(out, here + layout.POSITION)), *scaled(sign, f))


# bushings ----------


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
    turning = minus(spin_of(out, tables, bushing["to_point"]), spin_of(out, tables, bushing["from_point"]))
    return (x, y, z), turning, 0.25 * (3.0 - trace)


@njit
def bushing_loads(out, tables, bushing):
    """Force [N] and torque [N m] of a bushing on the body of `to`, two vectors in axes of the world."""
    gap, rate = relative_motion(out, tables, bushing)
    turn, turning, _ = rotation_deviation(out, tables, bushing)
    force = minus(scaled(-bushing["stiffness"], gap), scaled(bushing["damping"], rate))
    torque = minus(scaled(-bushing["turn_stiffness"], turn), scaled(bushing["turn_damping"], turning))
    return force, torque


@njit
def add_bushing_loads(t, y, dydt, out, handle):
    """Add the forces and torques of all bushings to their bodies."""
    tables = open_tables(handle)
    bushings = tables.bushings
    for k in range(bushings.size):
        force, torque = bushing_loads(out, tables, bushings[k])
        add_pair_load(out, tables, bushings[k], force)
        add_element_end_force(out, tables, bushings[k]["to_point"], ABOUT, torque)
        add_element_end_force(out, tables, bushings[k]["from_point"], ABOUT, scaled(-1.0, torque))


@njit
def bushing_rate_limit(t, y, dydt, out, handle):
    """Raise out[RATE], the rate that limits steps [1/s], to the bound of `mass_matrix.oscillation_rate` for bushings.

    The factored mass matrix must be in `scratch`.
    """
    tables = open_tables(handle)
    bushings, at = tables.bushings, 7 * tables.freedoms.size
    stiffness, damping, none = 0.0, 0.0, (0.0, 0.0, 0.0)
    for k in range(bushings.size):
        bushing = bushings[k]
        i, j = body_of_point(tables, bushing["from_point"]), body_of_point(tables, bushing["to_point"])
        p = point_at(out, tables, bushing["to_point"], layout.POSITION)[:3]
        for axis in range(6):
            along = 1.0 * (axis % 3 == 0), 1.0 * (axis % 3 == 1), 1.0 * (axis % 3 == 2)
            mass.clear_column(tables, at)
            if axis < 3:
                mass.add_pair_force(out, tables, bushing, p, along, at)
            else:
                mass.add_body_wrench(tables, j, along, none, at)
                mass.add_body_wrench(tables, i, scaled(-1.0, along), none, at)
            inverse_mass = mass.mobility(tables, at)
            stiffness += inverse_mass * (bushing["stiffness"] if axis < 3 else bushing["turn_stiffness"])
            damping += inverse_mass * (bushing["damping"] if axis < 3 else bushing["turn_damping"])
    out[RATE] = max(out[RATE], mass.oscillation_rate(stiffness, damping))


@njit
def observe_bushings(t, y, out, handle, values):
    """Write probe values of bushings: magnitude of gap [m], force [N] or torque [N m]."""
    tables = open_tables(handle)
    probes = tables.probes
    for k in range(probes.size):
        if probes[k]["kind"] == BUSHING_VALUE:
            bushing = tables.bushings[probes[k]["index"]]
            value, (force, torque) = relative_motion(out, tables, bushing)[0], bushing_loads(out, tables, bushing)
            if probes[k]["side"] == 1:
                value = force
            elif probes[k]["side"] == 2:
                value = torque
            values[k] = sqrt(scalar_product(value, value))


@njit
def power_bushings(t, y, dydt, out, handle, power):
    """Write two entries of `power` for each bushing [W]: rate of stored energy, dissipated power."""
    tables = open_tables(handle)
    at = bushing_power_row(tables, power)
    for k in range(tables.bushings.size):
        bushing = tables.bushings[k]
        gap, rate = relative_motion(out, tables, bushing)
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
    tables = open_tables(handle)
    at = bushing_stored_row(tables, stored)
    for k in range(tables.bushings.size):
        bushing, gap = tables.bushings[k], relative_motion(out, tables, tables.bushings[k])[0]
        eps = rotation_deviation(out, tables, bushing)[2]
        own = 0.5 * bushing["stiffness"] * scalar_product(gap, gap) + 2.0 * bushing["turn_stiffness"] * eps
        stored[at + k] = own - bushing["energy"]
