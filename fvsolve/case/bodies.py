"""Poses and velocities of bodies at the start, from the joints of a case.

Equations (59), (62) and (67) of docs/course.md in NumPy; the kernels evaluate them at later times.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fvsolve import attitude
from fvsolve.errors import article, did_you_mean, listing
from fvsolve.exact.solution import value
from fvsolve.parts.attitude_keys import is_zero_vector
from fvsolve.parts.body import Body
from fvsolve.units import show

# Largest gap of a pin at the start, relative to its lengths: typed numbers have few digits.
PIN_GAP = 1e-4
WORLD = ""  # root of all bodies; it has no name
Faults = Iterator[tuple[tuple, str]]


@dataclass(frozen=True)
class Pose:
    """Pose and motion of a body in world axes.

    attitude : float64[3, 3]  rotation matrix from body axes to world axes
    place, velocity : float64[3]  position [m] and velocity [m/s] of the origin of the body axes
    spin : float64[3]  angular velocity [rad/s]
    """

    attitude: np.ndarray
    place: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray

    def at(self, place: Any) -> np.ndarray:
        """World position [m] of the point `place` in body axes [m], equation (59) of docs/course.md."""
        return self.place + self.attitude @ np.asarray(place, dtype=float)

    def velocity_at(self, place: Any) -> np.ndarray:
        """World velocity [m/s] of the point `place` in body axes [m], equation (67) of docs/course.md."""
        return self.velocity + np.cross(self.spin, self.attitude @ np.asarray(place, dtype=float))


AT_REST = Pose(np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3))


@dataclass(frozen=True)
class BodyQuantities:
    """Quantities of one body that probes can record (name -> dimension); they depend on its joint."""

    body: Body
    kind: ClassVar[str] = "body"

    @property
    def quantities(self) -> dict[str, str]:
        joint, absent = self.body.joint, {"angle", "travel", "rate"}
        if joint.kind == "revolute":
            absent = {"travel"}
        elif joint.kind == "prismatic":
            absent = {"angle"}
        result = {key: dimension for key, dimension in Body.quantities.items() if key not in absent}
        return result | ({"rate": "velocity"} if joint.kind == "prismatic" else {})


def bodies_of(nodes: dict[str, Any]) -> dict[str, Body]:
    """Bodies by name, sorted by the number of bodies that carry them, then in the order of the file.

    Bodies in a loop, bodies on a missing node or point, and bodies that these carry are left out.
    """
    waiting, result = {name: node for name, node in nodes.items() if isinstance(node, Body)}, {}
    frames = [name for name, node in nodes.items() if node.kind == "frame"]
    while waiting:
        ready = {name: body for name, body in waiting.items()
                 if carrier_of(body)[0] not in waiting and carrier_exists(nodes, body)
                 and carrier_of(body)[0] in (WORLD, *result, *frames)}  # fmt: skip
        if not ready:
            return result
        result |= ready
        waiting = {name: body for name, body in waiting.items() if name not in ready}
    return result


def carrier_exists(nodes: dict[str, Any], body: Body) -> bool:
    """True if the node and the point to which the joint of a body is fixed exist."""
    name, point = carrier_of(body)
    return name == WORLD or (hasattr(nodes.get(name), "points") and (not point or point in nodes[name].points))


def carrier_of(body: Body) -> tuple[str, str]:
    """Place to which the joint of a body is fixed : (name of the node, name of its point).

    The node is `WORLD` for the world; the point is "" for a joint that is not at a point.
    """
    name, _, point = (body.joint.on or WORLD).partition(".")
    return name, point


def joint_position(nodes: dict[str, Any], body: Body) -> np.ndarray:
    """Position of the joint of a body in the axes of the node that carries it : float64[3] [m]."""
    name, point = carrier_of(body)
    if point:
        return np.array(nodes[name].points[point])
    return np.array(body.joint.at or (0.0, 0.0, 0.0))


def poses(nodes: dict[str, Any], t: float) -> dict[str, Pose]:
    """Poses of the bodies in `bodies_of`, by name and in their order, at the start time t [s]."""
    result: dict[str, Pose] = {}
    for name, body in bodies_of(nodes).items():
        up = result.get(carrier_of(body)[0], AT_REST)
        result[name] = body_pose(body, up, joint_position(nodes, body), t)
    return result


def body_pose(body: Body, up: Pose, at: np.ndarray, t: float) -> Pose:
    """Pose of a body at the start time t [s], from its joint.

    up : pose of its carrier; at : float64[3]  position of its joint in the axes of the carrier [m]
    """
    joint = body.joint
    turn, place = up.attitude @ joint.attitude.rotation, up.at(at)
    velocity, spin, axis = up.velocity_at(at), up.spin, turn @ joint.unit_axis
    if joint.kind == "revolute":
        return Pose(turn @ attitude.of_axis(joint.axis, joint_coordinate(joint, t)), place, velocity,
                    spin + axis * joint_rate(joint, t))  # fmt: skip
    if joint.kind == "prismatic":
        far = axis * joint_coordinate(joint, t)
        return Pose(turn, place + far, velocity + np.cross(spin, far) + axis * joint_rate(joint, t), spin)
    if joint.kind == "free":  # its stated velocity is that of the centre of mass
        spin = turn @ joint.angular_velocity
        centre = joint.centre_velocity - np.cross(spin, turn @ np.array(body.centre_of_mass))
        return Pose(turn, place, centre, spin)
    return Pose(turn, place, velocity, spin + turn @ joint.angular_velocity if joint.kind == "ball" else spin)


def joint_coordinate(joint: Any, t: float) -> float:
    """Angle [rad] or travel [m] of a joint at the start time t [s]; 0 for a joint without such a coordinate."""
    return float(value(joint.coordinate, t, left=True)) if joint.coordinate is not None else 0.0


def joint_rate(joint: Any, t: float) -> float:
    """Rate [rad/s] or [m/s] of a joint at the start time t [s].

    For a driven joint it is a forward difference quotient of its schedule.
    """
    if joint.drive_schedule is None:
        return float(joint.rate or 0.0)
    h = 1e-4
    now, soon, later = (float(value(joint.drive_schedule, t + k * h)) for k in range(3))
    return (4.0 * soon - 3.0 * now - later) / (2.0 * h)


def body_point(nodes: dict[str, Any], place: str) -> tuple[str, np.ndarray] | None:
    """Name of the body, and position in its axes [m], of a place that a link joins : (name, float64[3]).

    place : BODY.POINT, FRAME.POINT, or the name of a body (its origin)
    The name is `WORLD` for a point of a frame. The result is None for any other place.
    """
    name, _, point = place.partition(".")
    node = nodes.get(name)
    if getattr(node, "domain", "") == "spatial" and not point:
        return name, np.zeros(3)
    if point not in getattr(node, "points", {}):
        return None
    return name if isinstance(node, Body) else WORLD, np.array(node.points[point])


def separation(nodes: dict[str, Any], poses_of: dict[str, Pose], first: str, second: str) -> float | None:
    """Distance [m] from the place `first` to the place `second` of a link at the start; None if a position is unknown.

    Between masses on their common axis it has a sign: positive if `second` has the greater coordinate.
    """
    ends = [nodes.get(place) for place in (first, second)]
    if all(getattr(end, "domain", "") == "translational" for end in ends):
        return ends[1].initial_position - ends[0].initial_position
    points = [body_point(nodes, place) for place in (first, second)]
    if None in points or any(name not in (WORLD, *poses_of) for name, _ in points):
        return None
    here, there = (poses_of.get(name, AT_REST).at(place) for name, place in points)
    return float(np.linalg.norm(there - here))


def point_inertia(mass: float, r: np.ndarray) -> np.ndarray:
    """Inertia matrix of a point mass about the origin : float64[3, 3] [kg m2].

    mass [kg]; r : float64[3]  position of the mass [m]
    """
    return mass * (np.dot(r, r) * np.eye(3) - np.outer(r, r))


def coincident_ends(nodes: dict[str, Any], links: dict[str, Any], poses_of: dict[str, Pose]) -> Faults:
    """Faults of links that act along the line between two points, if the points coincide at the start."""
    for name, link in links.items():
        ends = [link.ports.get(port) for port in (("case", "rod") if "rod" in link.ports else ("from", "to"))]
        if (
            None in ends
            or link.kind in ("pin", "bushing")
            or any(getattr(link, key, None) for key in ("direction", "axis"))
        ):
            continue
        if None not in [body_point(nodes, end) for end in ends] and separation(nodes, poses_of, *ends) == 0.0:
            text = f"{ends[0]} and {ends[1]} coincide at the start, so the line between them has no direction"
            yield ("links", name), f"{text}; expected a distance above 0"


def open_pins(nodes: dict[str, Any], links: dict[str, Any], poses_of: dict[str, Pose]) -> Faults:
    """Faults of pins whose two points lie apart at the start. A distance along the axis of a pin is allowed."""
    for name, link in links.items():
        points = [body_point(nodes, link.ports[port]) for port in ("from", "to")] if link.kind == "pin" else [None]
        if None in points or is_zero_vector(link.axis) or any(body not in (WORLD, *poses_of) for body, _ in points):
            continue
        here, there = (poses_of.get(body, AT_REST).at(place) for body, place in points)
        turn = poses_of.get(points[0][0], AT_REST).attitude
        gap = float(np.linalg.norm(link.directions() @ (turn.T @ (there - here))))
        if gap > PIN_GAP * (1.0 + float(np.linalg.norm(points[0][1]))):
            across = " across the axis of the pin" if link.axis else ""
            text = f"{link.from_} and {link.to} lie {gap:.4g} m apart{across} at the start; expected the same place"
            yield ("links", name), text


def find_faults(nodes: dict[str, Any], named: Any) -> Faults:
    """Faults of the key `on` of joints: unknown body or point, and bodies that carry each other in a loop.

    named : tables of all nodes, also of faulty nodes
    """
    own = {name: node for name, node in nodes.items() if hasattr(node, "points")}
    bodies = {name: node for name, node in own.items() if isinstance(node, Body)}
    for name, body in bodies.items():
        on, point = carrier_of(body)
        keys = ("nodes", name, "joint", "on")
        if on == WORLD or (on not in nodes and on in named):  # the carrier itself is faulty
            continue
        if on not in own:
            state = f"is {article(nodes[on].kind)}" if on in nodes else "is not a node"
            hint = did_you_mean(on, own) or f"; bodies are {listing(bodies)}"
            yield keys, f"{show(on)} {state}; expected a body, a point of a body, or a point of a frame{hint}"
        elif point and point not in own[on].points:
            has = f"its points are {listing(own[on].points)}" if own[on].points else "it has no points"
            yield keys, f"{on} has no point {show(point)}; {has}{did_you_mean(point, own[on].points)}"
        elif not point and on not in bodies:
            text = f"{show(on)} is a frame; expected a point of this frame (FRAME.POINT)"
            yield keys, f"{text}; for a joint to the world leave out `on`"
    loop = set(bodies) - set(bodies_of(nodes)) - {name for name in bodies if not ends_in_loop(nodes, bodies, name)}
    while loop:
        name = min(loop, key=list(bodies).index)
        ring = [name]
        while (up := carrier_of(bodies[ring[-1]])[0]) not in ring:
            ring.append(up)
        ring = ring[ring.index(up) :]
        text = " on ".join([*ring, ring[0]])
        text = f"is carried by itself: {text}; remove `on` from one of these bodies and close the loop by a pin"
        yield ("nodes", ring[0], "joint", "on"), text
        loop -= {member for member in loop if {*carriers(member, bodies)} & {*ring}}


def free_joints(on: str, nodes: dict[str, Any]) -> Iterator[str]:
    """Yield the names of the bodies, from `on` to the world, whose joints move freely (neither fixed nor driven)."""
    for body in carriers(on, nodes):
        joint = nodes[body].joint
        if joint.kind != "fixed" and joint.drive_schedule is None:
            yield body


def carriers(on: str, nodes: dict[str, Any]) -> Iterator[str]:
    """Yield the names of the body `on` and of all bodies that carry it, from `on` to the world."""
    seen: set[str] = set()
    while isinstance(nodes.get(on), Body) and on not in seen:
        seen.add(on)
        yield on
        on = carrier_of(nodes[on])[0]


def ends_in_loop(nodes: dict[str, Any], bodies: dict[str, Body], name: str) -> bool:
    """True if the carriers of a body form a loop; False if they end at the world, a frame or a missing node."""
    return carrier_of(bodies[[*carriers(name, bodies)][-1]])[0] in bodies
