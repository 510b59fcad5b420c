"""Power and stored energy of bodies and of their joints.

Rows of `power` [W] of a body, before those of devices and basins: rate of stored energy, dissipation of its joint,
power of its driven joint. Row of `stored` [J], change since the start: kinetic energy, m g z of the centre of mass and
k s^2 / 2 of the joint.
"""

from fvsolve.jit import njit
from fvsolve.kernels.accounts import OF_BODY, body_rows, body_stores
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.mechanism.joints import angle_of, centre_of
from fvsolve.kernels.mechanism.observe import acceleration_at, joint_load, kinetic, spread_inertia
from fvsolve.kernels.mechanism.room import ACCELERATION, ATTITUDE, PLACE, SPIN, TURNING, dot, row_of, turned
from fvsolve.kernels.records import FREE, PRISMATIC


@njit
def gained(body, out, here, gravity):
    """Rate of the kinetic and potential energy of a body: m v_c . a_c + w . J alpha + m g dz_c/dt [W]."""
    x, y, z, u, v, w = centre_of(body, out, here)
    a, b, c = acceleration_at(out, here, here + ACCELERATION, x, y, z)
    s = here + TURNING
    turn = spread_inertia(body["inertia"], out, here + ATTITUDE, out[s], out[s + 1], out[s + 2])
    return body["mass"] * (u * a + v * b + w * (c + gravity)) + dot(out, here + SPIN, turn[0], turn[1], turn[2])


@njit
def sprung(body, y):
    """(energy stored in the spring of the joint since the start [J], its rate [W])."""
    s, far = body["start"][0], y[body["y"]]
    return (
        body["stiffness"] * far * (s + 0.5 * far),
        body["stiffness"] * (s + far) * (body["speed"][0] + y[body["rate"]]),
    )


@njit
def driven(t, y, out, tables, i):
    """Power supplied by a driven joint [W]."""
    body = tables.bodies[i]
    rate = angle_of(body, t, y, tables)[1]
    x, y0, z = turned(out, row_of(tables, i) + ATTITUDE, body["axis"], 0)
    load = joint_load(out, tables, i)
    if body["joint"] == PRISMATIC:
        return rate * (load[0] * x + load[1] * y0 + load[2] * z)
    return rate * (load[3] * x + load[4] * y0 + load[5] * z)


@njit
def rubbed(body, y):
    """Power dissipated by the damping of a joint [W]."""
    total, first = 0.0, 3 if body["joint"] == FREE else 0
    for k in range(first, body["freedoms"]):
        rate = body["speed"][k] + y[body["rate"] + k]
        total += body["damping"] * rate * rate
    return total


@njit
def power_bodies(t, y, dydt, out, handle, power):
    """Write the power rows of bodies."""
    tables = open_tables(handle)
    bodies, gravity = tables.bodies, tables.settings[0]["gravity"]
    at = body_rows(tables, power)
    for i in range(bodies.size):
        power[at] = gained(bodies[i], out, row_of(tables, i), gravity)
        if bodies[i]["stiffness"] > 0.0:
            power[at] += sprung(bodies[i], y)[1]
        power[at + 1] = rubbed(bodies[i], y) if bodies[i]["damping"] > 0.0 else 0.0
        power[at + 2] = driven(t, y, out, tables, i) if bodies[i]["schedule"] >= 0 else 0.0
        at += OF_BODY


@njit
def stored_bodies(t, y, dydt, out, handle, stored):
    """Write the storage rows of bodies."""
    tables = open_tables(handle)
    bodies, gravity = tables.bodies, tables.settings[0]["gravity"]
    at = body_stores(tables, stored)
    for i in range(bodies.size):
        body, here = bodies[i], row_of(tables, i)
        z = out[here + PLACE + 2] + centre_of(body, out, here)[2]
        stored[at + i] = kinetic(body, out, here) - body["energy"] + body["mass"] * gravity * (z - body["height"])
        if body["stiffness"] > 0.0:
            stored[at + i] += sprung(body, y)[0]
