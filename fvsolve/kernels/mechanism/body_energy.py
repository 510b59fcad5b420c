"""Power and stored energy of bodies and of their joints.

`power` has three entries for each body [W], see `energy_rows.py` for their place: rate of the stored energy, power
dissipated by the damping of the joint, power supplied by a driven joint. `stored` has one entry for each body [J], the
change since the start of kinetic energy + m g z + k s^2 / 2. m : mass, z : height of the centre of mass, k : stiffness
of the joint, s : its coordinate.
"""

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import FREE, PRISMATIC
from fvsolve.kernels.energy_rows import BODY_ROWS, body_power_row, body_stored_row
from fvsolve.kernels.mechanism.body_layout import (
    ACCELERATION,
    ATTITUDE,
    POSITION,
    SPIN,
    SPIN_RATE,
    body_row,
    dot,
    rotate,
)
from fvsolve.kernels.mechanism.body_probes import acceleration_at, inertia_product, joint_load, kinetic_energy
from fvsolve.kernels.mechanism.joints import centre_of, joint_coordinate
from fvsolve.kernels.table_handle import open_tables


@njit
def body_energy_rate(body, out, here, gravity):
    """Rate of the kinetic and potential energy of a body [W]: m v . a + w . J alpha + m g v_z.

    m : mass; v, a : velocity and acceleration of the centre of mass; w, alpha : angular velocity and acceleration
    J : inertia about the centre of mass; here : offset of the body in `out`
    """
    x, y, z, u, v, w = centre_of(body, out, here)
    a, b, c = acceleration_at(out, here, here + ACCELERATION, x, y, z)
    s = here + SPIN_RATE
    turn = inertia_product(body["inertia"], out, here + ATTITUDE, out[s], out[s + 1], out[s + 2])
    return body["mass"] * (u * a + v * b + w * (c + gravity)) + dot(out, here + SPIN, turn[0], turn[1], turn[2])


@njit
def joint_spring_energy(body, y):
    """(change of the energy of the spring of a joint since the start [J], its rate [W]), for a joint with one axis."""
    s, far = body["start"][0], y[body["y"]]
    return (
        body["stiffness"] * far * (s + 0.5 * far),
        body["stiffness"] * (s + far) * (body["speed"][0] + y[body["rate"]]),
    )


@njit
def joint_drive_power(t, y, out, tables, i):
    """Power that the drive of the joint of body i supplies [W]: load of the joint along its axis times its rate."""
    body = tables.bodies[i]
    rate = joint_coordinate(body, t, y, tables)[1]
    x, y0, z = rotate(out, body_row(tables, i) + ATTITUDE, body["axis"], 0)
    load = joint_load(out, tables, i)
    if body["joint"] == PRISMATIC:
        return rate * (load[0] * x + load[1] * y0 + load[2] * z)
    return rate * (load[3] * x + load[4] * y0 + load[5] * z)


@njit
def joint_damping_power(body, y):
    """Power dissipated by the damping of a joint [W]; for a free body only its rotation is damped."""
    total, first = 0.0, 3 if body["joint"] == FREE else 0
    for k in range(first, body["freedoms"]):
        rate = body["speed"][k] + y[body["rate"] + k]
        total += body["damping"] * rate * rate
    return total


@njit
def power_bodies(t, y, dydt, out, handle, power):
    """Write three powers of each body to `power` [W]: rate of stored energy, joint damping, joint drive."""
    tables = open_tables(handle)
    bodies, gravity = tables.bodies, tables.settings[0]["gravity"]
    at = body_power_row(tables, power)
    for i in range(bodies.size):
        power[at] = body_energy_rate(bodies[i], out, body_row(tables, i), gravity)
        if bodies[i]["stiffness"] > 0.0:
            power[at] += joint_spring_energy(bodies[i], y)[1]
        power[at + 1] = joint_damping_power(bodies[i], y) if bodies[i]["damping"] > 0.0 else 0.0
        power[at + 2] = joint_drive_power(t, y, out, tables, i) if bodies[i]["schedule"] >= 0 else 0.0
        at += BODY_ROWS


@njit
def stored_bodies(t, y, dydt, out, handle, stored):
    """Write the change of kinetic, potential and spring energy of each body since the start [J] to `stored`."""
    tables = open_tables(handle)
    bodies, gravity = tables.bodies, tables.settings[0]["gravity"]
    at = body_stored_row(tables, stored)
    for i in range(bodies.size):
        body, here = bodies[i], body_row(tables, i)
        z = out[here + POSITION + 2] + centre_of(body, out, here)[2]
        stored[at + i] = (
            kinetic_energy(body, out, here) - body["energy"] + body["mass"] * gravity * (z - body["height"])
        )
        if body["stiffness"] > 0.0:
            stored[at + i] += joint_spring_energy(body, y)[0]
