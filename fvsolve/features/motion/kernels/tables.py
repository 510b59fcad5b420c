"""Tables of masses, bodies, and what acts between them, behind the same handle as those of the model."""

import functools
from collections import namedtuple

from fvsolve.core.assembly.features import with_slot
from fvsolve.core.kernels import table_handle
from fvsolve.core.kernels.dtypes import f8, i8, record
from fvsolve.jit import COMPILING, Intrinsic

SLOT = 5

BODY = record(  # its axes have their origin at its joint
    parent=i8,  # row of its parent body, a smaller number; -1 for the world
    root=i8,  # row of the first body of its tree
    joint=i8,  # REVOLUTE ...
    y=i8,  # offset in y of its coordinates, as deviations; -1 for none
    rate=i8,  # offset in y of its velocities, as deviations; -1 for none
    freedom=i8,  # its first row of `freedoms`
    freedoms=i8,  # number of its degrees of freedom
    schedule=i8,  # angle [rad] or travel [m] of a driven joint; -1 for none
    at="(3,)f8",  # position of the joint in the axes of the parent [m]
    attitude="(9,)f8",  # rotation matrix of the joint axes in the axes of the parent, by rows
    axis="(3,)f8",  # axis of the joint, in the joint axes and in its own
    mass=f8,  # [kg]
    centre="(3,)f8",  # centre of mass [m]
    inertia="(9,)f8",  # about the centre of mass [kg m2]
    damping=f8,  # damping of its joint [N m s] or [N s/m]
    stiffness=f8,  # stiffness of its joint [N m/rad] or [N/m]
    start="(7,)f8",  # coordinates at the start
    speed="(6,)f8",  # velocities at the start
    height=f8,  # height of its centre of mass at the start [m]
    energy=f8,  # kinetic energy at the start [J]
)
REVOLUTE, PRISMATIC, BALL, FREE, WELD = 0, 1, 2, 3, 4  # joints

FREEDOM = record(
    depth=i8,  # number of degrees of freedom on which its position depends
    path=i8,  # offset in `integers` of these, from the root on, and of itself
    row=i8,  # offset of its row of the mass matrix, for those on its path
    balance=f8,  # generalised force at the start that is rounding [N] or [N m]
)

POINT = record(
    body=i8,  # -1: the world
    place="(3,)f8",  # in the axes of the body
)

LINE = record(  # line of action of a force element on points of bodies
    push=i8,  # number of its force in out[push]
    from_point=i8,  # -1 for none
    to_point=i8,  # -1 for none
    # ALONG the line between points, TOWARD a direction of the world, ABOUT an axis of `to`
    acts=i8,
    direction="(3,)f8",  # unit vector of that direction or axis
    length=f8,  # length at the start [m]
)
ALONG, TOWARD, ABOUT = 0, 1, 2

PIN = record(
    from_point=i8,  # row of `points`
    to_point=i8,  # row of `points`
    rows=i8,  # number of constrained directions
    directions="(9,)f8",  # in the axes of the body of `from`
    pull=f8,  # rate of stabilisation (Baumgarte) [1/s]
    gap="(3,)f8",  # gap along each direction at the start [m]
    force="(3,)f8",  # constraint force at the start [N]
)

BUSHING = record(
    from_point=i8,  # row of `points`
    to_point=i8,  # row of `points`
    stiffness=f8,  # [N/m]
    damping=f8,  # [N s/m]
    turn_stiffness=f8,  # [N m/rad]
    turn_damping=f8,  # [N m s/rad]
    # rotation matrix of the body of `to` in the axes of that of `from` at the start
    attitude="(9,)f8",
    energy=f8,  # energy stored at the start [J]
)

# moving stretch of a pipe or column, or content of a node, on a body and in its axes
MOVING_SEGMENT = record(
    body=i8,  # row of the body that carries it
    start="(3,)f8",  # its start [m]; position of a node
    end="(3,)f8",  # its end [m]; the level of a tank rises along z
    swept="(3,)f8",  # integral of r x dr along it [m2]
    rest=f8,  # work of gravity along it at the start [J/kg]
    loads_body=i8,  # load on the body: MOVED_BY_FORCES, JOINT_LOAD_READ, or 0 if neither applies
)

TANK = record(  # fluid of a part with a mesh, in the order of its numbers in `out`
    body=i8,  # body that carries it; -1 for none
    loads_body=i8,  # 1 if its load acts on that body: forces move it, or the joint load is read
)

MASS = record(
    y=i8,  # offset in y of its position, then velocity, both as deviations; -1 for a frame
    lightness=f8,  # 1 / mass, 0 for a frame [1/kg]
    position=f8,  # at the start [m]
    velocity=f8,  # at the start [m/s]
    force=f8,  # sum of all forces at the start, rounding set to zero [N]
)

# spring, damper or force: push = force + (schedule - given) - stiffness dx - damping (v - speed)
BRACE = record(
    from_mass=i8,  # row of the mass or frame at its start
    to_mass=i8,  # row of the mass or frame at its end
    schedule=i8,  # -1 for none
    given=f8,  # value of the schedule at the start [N]
    stiffness=f8,  # [N/m]
    damping=f8,  # [N s/m]
    speed=f8,  # v_to - v_from at the start [m/s]
    force=f8,  # push at the start [N]
    line=i8,  # row of `lines` if it joins points of bodies; -1 on the axis of masses
)

STOP = record(
    from_mass=i8,  # row of the mass or frame at its start
    to_mass=i8,  # row of the mass or frame at its end
    stiffness=f8,  # of the contact [N/m]
    damping=f8,  # of the contact [N s/m]
    below=f8,  # free travel at the start before it pushes forward, infinite for none [m]
    above=f8,  # free travel at the start before it pushes back [m]
    force=f8,  # push at the start [N]
    line=i8,  # row of `lines` if it joins points of bodies; -1 on the axis of masses
)

PISTON = record(
    case=i8,  # masses
    rod=i8,  # row of the mass of its rod
    a=i8,  # nodes
    b=i8,  # row of the node of its chamber B
    area_a=f8,  # area of the piston in chamber A [m2]
    area_b=f8,  # likewise in B [m2]
    sweep_a=f8,  # mass in A per travel at the density of the start, not part of the excess [kg/m]
    sweep_b=f8,  # likewise in B, negative
    position=f8,  # x at the start [m]
    stroke=f8,  # [m]
    leakage=f8,  # [m3/s/Pa]
    leak=f8,  # mass flow from A to B in the profile [kg/s]
    damping=f8,  # [N s/m]
    speed=f8,  # v_rod - v_case at the start [m/s]
    force=f8,  # force of the piston at the start [N]
    line=i8,  # row of `lines` if it joins points of bodies; -1 on the axis of masses
)

MOTION_SETTINGS = record(
    mark=i8,  # offset in `marks` of those of pistons
    flag=i8,  # offset in `armed` of the flags of stops
)
# load of a stretch: forces move its body; or the joint load is an output
MOVED_BY_FORCES, JOINT_LOAD_READ = 1, 2

RECORDS = {
    "bodies": BODY,
    "freedoms": FREEDOM,
    "points": POINT,
    "lines": LINE,
    "pins": PIN,
    "bushings": BUSHING,
    "moving_segments": MOVING_SEGMENT,
    "tanks": TANK,
    "masses": MASS,
    "braces": BRACE,
    "stops": STOP,
    "pistons": PISTON,
    "motion_settings": MOTION_SETTINGS,
}
MotionTables = namedtuple("MotionTables", tuple(RECORDS))


def motion_of(owner):
    """Feature of a draft or a model with masses or bodies."""
    return with_slot(owner.features, SLOT)


@functools.cache
def motion_types() -> MotionTables:
    """Numba types of these tables."""
    from numba import from_dtype, types

    return MotionTables(*(types.Array(from_dtype(kind), 1, "C") for kind in RECORDS.values()))


if COMPILING:

    @Intrinsic
    def open_motion(typingctx, handle):
        """Tables behind a handle as `open_tables`, and those of motion."""
        return table_handle.open_with("MotionTables", motion_types, SLOT, handle)
else:

    def open_motion(handle):
        """Tables of a handle as `open_tables`, and those of motion."""
        core = table_handle.open_tables(handle)
        return table_handle.BothTables(core, core.features[SLOT])
