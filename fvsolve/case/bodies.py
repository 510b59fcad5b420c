"""Poses of bodies at the start, and parts on bodies: checks of keys, positions and depths of patches of basins.

Equations (59), (62) and (67) of docs/course.md in NumPy; the kernels evaluate them at later times.
Arguments: nodes, links : parts by name; named : tables of all nodes, also of faulty nodes; poses : name of a body ->
`Pose`; patches : patches of basins on bodies, by full name.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from fvsolve import attitude
from fvsolve.case.connections import WORLD
from fvsolve.errors import article, did_you_mean, listing
from fvsolve.exact.solution import value
from fvsolve.parts.attitude_keys import is_zero_vector
from fvsolve.parts.formula import means, samples
from fvsolve.parts.nodes_and_links import Node, PlaceOnBody, is_kind
from fvsolve.units import show

if TYPE_CHECKING:
    from fvsolve.parts.body import Body

# Largest gap of a pin at the start, relative to its lengths: typed numbers have few digits.
PIN_GAP = 1e-4
Faults = Iterator[tuple[tuple, str]]


class Pose(NamedTuple):
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
        result = {
            key: dimension for key, dimension in self.body.quantities.items() if key not in absent
        }
        return result | ({"rate": "velocity"} if joint.kind == "prismatic" else {})


def bodies_of(nodes: dict[str, Any]) -> dict[str, Body]:
    """Bodies by name, sorted by the number of bodies that carry them, then in the order of the file.

    Bodies in a loop, bodies on a missing node or point, and bodies that these carry are left out.
    """
    waiting, result = {name: node for name, node in nodes.items() if is_kind(node, "body")}, {}
    frames = [name for name, node in nodes.items() if node.kind == "frame"]
    while waiting:
        ready = {}
        for name, body in waiting.items():
            on, point = carrier_of(body)
            exists = on == WORLD or (
                hasattr(nodes.get(on), "points") and (not point or point in nodes[on].points)
            )
            if exists and on not in waiting and on in (WORLD, *result, *frames):
                ready[name] = body
        if not ready:
            return result
        result |= ready
        waiting = {name: body for name, body in waiting.items() if name not in ready}
    return result


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
    velocity = up.velocity_at(at)
    spin = up.spin
    axis = turn @ joint.unit_axis
    if joint.kind == "revolute":
        return Pose(
            turn @ attitude.of_axis(joint.axis, joint_coordinate(joint, t)),
            place,
            velocity,
            spin + axis * joint_rate(joint, t),
        )
    if joint.kind == "prismatic":
        far = axis * joint_coordinate(joint, t)
        return Pose(
            turn, place + far, velocity + np.cross(spin, far) + axis * joint_rate(joint, t), spin
        )
    if joint.kind == "free":  # its stated velocity is that of the centre of mass
        spin = turn @ joint.angular_velocity
        centre = joint.centre_velocity - np.cross(spin, turn @ np.array(body.centre_of_mass))
        return Pose(turn, place, centre, spin)
    return Pose(
        turn,
        place,
        velocity,
        spin + turn @ joint.angular_velocity if joint.kind == "ball" else spin,
    )


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
    return name if is_kind(node, "body") else WORLD, np.array(node.points[point])


def separation(
    nodes: dict[str, Any], poses_of: dict[str, Pose], first: str, second: str
) -> float | None:
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


def coincident_ends(
    nodes: dict[str, Any], links: dict[str, Any], poses_of: dict[str, Pose]
) -> Faults:
    """Faults of links that act along the line between two points, if the points coincide at the start."""
    for name, link in links.items():
        ends = [
            link.ports.get(port)
            for port in (("case", "rod") if "rod" in link.ports else ("from", "to"))
        ]
        if (
            None in ends
            or link.kind in ("pin", "bushing")
            or any(getattr(link, key, None) for key in ("direction", "axis"))
        ):
            continue
        if (
            None not in [body_point(nodes, end) for end in ends]
            and separation(nodes, poses_of, *ends) == 0.0
        ):
            text = f"{ends[0]} and {ends[1]} coincide at the start, so the line between them has no direction"
            yield ("links", name), f"{text}; expected a distance above 0"


def open_pins(nodes: dict[str, Any], links: dict[str, Any], poses_of: dict[str, Pose]) -> Faults:
    """Faults of pins whose two points lie apart at the start. A distance along the axis of a pin is allowed."""
    for name, link in links.items():
        points = (
            [body_point(nodes, link.ports[port]) for port in ("from", "to")]
            if link.kind == "pin"
            else [None]
        )
        if (
            None in points
            or is_zero_vector(link.axis)
            or any(body not in (WORLD, *poses_of) for body, _ in points)
        ):
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
    bodies = {name: node for name, node in own.items() if is_kind(node, "body")}
    for name, body in bodies.items():
        on, point = carrier_of(body)
        keys = ("nodes", name, "joint", "on")
        if on == WORLD or (on not in nodes and on in named):  # the carrier itself is faulty
            continue
        if on not in own:
            state = f"is {article(nodes[on].kind)}" if on in nodes else "is not a node"
            hint = did_you_mean(on, own) or f"; bodies are {listing(bodies)}"
            yield (
                keys,
                f"{show(on)} {state}; expected a body, a point of a body, or a point of a frame{hint}",
            )
        elif point and point not in own[on].points:
            has = (
                f"its points are {listing(own[on].points)}"
                if own[on].points
                else "it has no points"
            )
            yield (
                keys,
                f"{on} has no point {show(point)}; {has}{did_you_mean(point, own[on].points)}",
            )
        elif not point and on not in bodies:
            text = f"{show(on)} is a frame; expected a point of this frame (FRAME.POINT)"
            yield keys, f"{text}; for a joint to the world leave out `on`"
    loop = set()
    for name in set(bodies) - set(bodies_of(nodes)):
        last = [*carriers(name, bodies)][-1]
        if carrier_of(bodies[last])[0] in bodies:  # not the world, a frame or a missing node
            loop.add(name)
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
    while is_kind(nodes.get(on), "body") and on not in seen:
        seen.add(on)
        yield on
        on = carrier_of(nodes[on])[0]


USE_PIPE = "expected a pipe there, or a chamber"
# relative, and tolerance of zero distance [m]: typed places have few digits
LENGTH_TOLERANCE = 1e-6
BISECTIONS = 200  # number of bisections


def with_elevation(node: Node, poses: dict[str, Any]) -> Node:
    """Copy of a node on a body with its elevation at the start; any other node, or a basin, is returned unchanged."""
    pose = poses.get(getattr(node, "on", None))
    if pose is None or is_kind(node, "basin"):
        return node
    return node.model_copy(update={"elevation": float(pose.at(node.place)[2])})


def has_elevation(node: Node, poses: dict[str, Any]) -> bool:
    """True if a node is fixed in the world, or is on a body with a known pose and is not a basin."""
    on = getattr(node, "on", None)
    return on is None or (on in poses and not is_kind(node, "basin"))


def faults_on_bodies(
    nodes: dict[str, Any], links: dict[str, Any], patches: dict[str, Any], named: Any
) -> Faults:
    """Faults (key path, message) of nodes on bodies, and of links that join them."""
    for name, node in nodes.items():
        if is_kind(node, "basin") or not isinstance(node, PlaceOnBody):
            continue
        yield from place_faults(name, node, nodes, named)
        if node.on is not None and getattr(node, "head", None) is not None:
            text = f"the node is on {node.on}, and a head counts from the ground; expected `pressure` instead"
            yield ("nodes", name, "head"), text
    for name, link in links.items():
        ends = [place for port, place in link.ports.items() if link.joins.get(port) == "hydraulic"]
        yield from (
            (("links", name, *key), text) for key, text in link_faults(link, ends, nodes, patches)
        )
    for place, text in missing_reactions(nodes, links, free=True):
        yield place, f"{text}, or a driven joint instead of a free joint"


def missing_reactions(nodes: dict[str, Any], links: dict[str, Any], free: bool = False) -> Faults:
    """Faults of parts whose flow acts on a body by a force that is not modelled.

    free : True to check only bodies that move freely; pipes at tanks on these are then faults too
    """

    def on_body(name: str) -> bool:
        on = getattr(node_of(name, nodes), "on", None)
        return on is not None and (not free or any(free_joints(on, nodes)))

    tanks = [name for name, node in nodes.items() if node.kind == "tank" and on_body(name)]
    for name in tanks:
        for key in ("connection", "height"):
            if getattr(nodes[name], key) is not None:
                flow = "flow through the connection" if key == "connection" else "spilled water"
                text = f"the reaction of the {flow} on the body is not modelled yet; expected a tank without this key"
                yield ("nodes", name, key), text
        if hasattr(nodes[name].area, "area"):
            yield (
                ("nodes", name, "area"),
                "a tank on a body supports only a constant area; expected a number",
            )
    for name, link in links.items():
        ends = [place for port, place in link.ports.items() if link.joins.get(port) == "hydraulic"]
        if not any(map(on_body, ends)):
            continue
        key = ("links", name)
        for end in dict.fromkeys(end for end in ends if is_kind(node_of(end, nodes), "basin")):
            text = f"the reaction of the flow through {end} is not modelled yet; expected a tank instead of the basin"
            yield key, text
        if link.kind in ("leak", "hydrant"):
            text = f"the reaction of the {link.kind} on the body is not modelled yet"
            yield key, f"{text}; expected a valve to a reservoir"
        elif link.kind == "rigid-column":
            for end in ends:
                kinds = {other.kind for other in links.values() if end in other.ports.values()}
                if (
                    end in nodes
                    and nodes[end].kind in ("junction", "inflow")
                    and "pipe" not in kinds
                ):
                    text = f"at {end} this column joins only valves and columns, whose reaction is not modelled yet"
                    yield key, f"{text}; {USE_PIPE}"
        elif link.kind != "pipe" or free:
            for end in dict.fromkeys(end for end in ends if end in tanks):
                reason = "the flow of a pipe" if link.kind == "pipe" else "the flow of a valve"
                text = f"at {end} neither {reason} nor the tank has inertia; expected a rigid-column at the tank"
                yield key, text


def node_of(place: str, nodes: dict[str, Any]) -> Any:
    """Node with the name `place`, or basin of the patch `place` (BASIN.PATCH); None if neither exists."""
    return nodes.get(place, nodes.get(place.rpartition(".")[0]))


def link_faults(
    link: Any, ends: list[str], nodes: dict[str, Any], patches: dict[str, Any]
) -> Faults:
    """Faults (key path in the link, message) of a link with an end on a body, or with a route on a body.

    ends : names of the places that its hydraulic ports join
    """
    stand = [node_of(place, nodes) for place in ends]
    on = [getattr(node, "on", None) for node in stand]
    if None in stand or any(body is not None and body not in nodes for body in on):
        return  # an end is faulty
    if not any(on):
        if getattr(link, "route", None):
            text = "is a route on a body, but no end of the pipe is on a body"
            yield ("route",), f"{text}; give the nodes at both ends the keys `on` and `at`"
        return
    if len(set(on)) > 1:
        each = zip(ends, on, strict=True)
        words = " and ".join(
            f"{end}, on {body}" if body else f"{end}, which is fixed" for end, body in each
        )
        text = f"joins {words}: this would be a flexible hose, which is not supported yet"
        yield (), f"{text}; expected both ends on one body, or both fixed"
        return
    unable = [
        *dict.fromkeys(
            words
            for end, node in zip(ends, stand, strict=True)
            for words in patch_faults(end, node)
        )
    ]
    yield from (((), text) for text in unable)
    where = [patches.get(end, node) for end, node in zip(ends, stand, strict=True)]
    if unable or any(is_kind(node, "basin") for node in where):
        return  # an end is faulty
    length = getattr(link, "length", None)
    points = np.array([where[0].place, *getattr(link, "route", []), where[-1].place])
    way = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    if length is None and way > LENGTH_TOLERANCE:
        text = f"the ends lie {way:g} m apart{position_text(ends, patches)}, and {article(link.kind)} has no length"
        yield (
            (),
            f"{text}; expected both ends at one place, and a pipe or rigid-column to the other place",
        )
    elif length is not None and way > length * (1.0 + LENGTH_TOLERANCE):
        text = f"{length:g} m is too short: the route on {on[0]} is {way:g} m long{position_text(ends, patches)}"
        yield ("length",), text


def patch_faults(end: str, node: Any) -> Iterator[str]:
    """Yield the reason, if there is one, why a link cannot join the place `end`, a patch of a basin on a body.

    node : node of the place, see `node_of`; nothing is yielded for a node that is not a basin
    """
    if not is_kind(node, "basin"):
        return
    if not node.physics_type.links_on_bodies:
        place = f"of a basin on a body, which physics {show(node.physics)} does not support yet"
        yield f"joins {end} {place}; expected a free surface, or a tank"
    elif node.lumped:
        yield f'joins {end}, a patch of a basin without cells; expected sloshing = "cells" in this basin'


def position_text(ends: list[str], patches: dict[str, Any]) -> str:
    """Text with the computed positions of the ends of a link that are patches; "" if no end is a patch."""
    texts = [
        f"{end} at [{', '.join(f'{x:.7g}' for x in patches[end].at)}]"
        for end in ends
        if end in patches
    ]
    return f" ({' and '.join(texts)})" if texts else ""


def basin_faults(name: str, basin: Any, nodes: dict[str, Any], named: Any) -> Faults:
    """Faults (key path, message) of the keys of a basin that place it on a body, or apply only on a body."""
    key = ("nodes", name)
    yield from place_faults(name, basin, nodes, named)
    if basin.on is None:
        if basin.sloshing != "cells":
            text = (
                "applies only to water on a body; give the body as `on = BODY`, or remove this key"
            )
            yield (*key, "sloshing"), text
        return
    if not basin.physics_type.on_bodies:
        from fvsolve.parts.basin import Physics

        kinds = " or ".join(
            show(name) for name, patch_options in Physics.kinds.items() if patch_options.on_bodies
        )
        yield (*key, "on"), f"physics {show(basin.physics)} cannot be on a body; expected {kinds}"
    if basin.sloshing != "cells" and not basin.physics_type.has_modes:
        yield (
            (*key, "sloshing"),
            f'needs a free surface; physics {show(basin.physics)} on a body has only "cells"',
        )
    if any(patch_options.moves for patch_options in basin.patches.values()):
        text = "a basin on a body cannot have moving walls; leave out `on`, or `body` and `travel` of its patches"
        yield (*key, "on"), text
    free = next(free_joints(basin.on, nodes), None)
    for patch, patch_options in basin.patches.items():
        opened = "boundary" if patch_options.boundary == "open" else None
        opened = opened if patch_options.impedance is None else "impedance"
        if opened is not None and free is not None and not basin.lumped:
            text = (
                f"{free} moves freely, and the reaction to outflow is not modelled; "
                "expected a wall or a driven joint"
            )
            yield (*key, "patches", patch, opened), text


def place_faults(name: str, node: PlaceOnBody, nodes: dict[str, Any], named: Any) -> Faults:
    """Faults (key path, message) of the keys that place a node on a body: `on`, `at`, `attitude`, `elevation`."""
    key = ("nodes", name)
    if node.on is None:
        for other in ("at", "attitude"):
            if getattr(node, other, None) is not None:
                yield (
                    (*key, other),
                    "has no effect without a body; give the body as `on = BODY`, or remove this key",
                )
        return
    if node.on in nodes or node.on not in named:  # otherwise the body itself is faulty
        yield from (((*key, "on"), text) for text in body_faults(node.on, nodes, named))
    if node.elevation is not None:
        text = f"has no effect on a body; give the position in the axes of {node.on} as `at`, and remove this key"
        yield (*key, "elevation"), text


def body_faults(on: str, nodes: dict[str, Any], named: Any) -> Iterator[str]:
    """Yield a fault text if the name `on` is not that of a body."""
    bodies = [body for body, node in nodes.items() if is_kind(node, "body")]
    bodies += [
        body
        for body in named
        if body not in nodes and getattr(named[body], "get", {}.get)("type") == "body"
    ]
    if not is_kind(nodes.get(on), "body"):
        state = f"is {article(nodes[on].kind)}" if on in nodes else "is not a node"
        expected = f"expected a body: {listing(bodies)}" if bodies else "the case has no body"
        yield f"{show(on)} {state}; {expected}{did_you_mean(on, bodies)}"
        return


def overturned(nodes: dict[str, Any], poses: dict[str, Any]) -> Faults:
    """Faults of tanks and free-surface basins that are tilted by 90 degrees or more, so that the water runs out.

    Frozen water is not checked. A tank or basin is checked only if all joints from its body to the world are fixed.
    """
    for name, node in nodes.items():
        on = getattr(node, "on", None)
        wet = node.kind == "tank" or (
            node.kind == "basin" and node.physics_type.has_modes and node.sloshing != "frozen"
        )
        if (
            not wet
            or on not in poses
            or any(nodes[body].joint.kind != "fixed" for body in carriers(on, nodes))
        ):
            continue
        turn = poses[on].attitude @ getattr(node, "rotation", np.eye(3))
        if turn[2, 2] <= 0.0:
            angle = np.degrees(np.arccos(turn[2, 2]))
            text = f"the bottom of {name} is inclined by {angle:.3g} deg on {on}, which is fixed"
            yield (
                ("nodes", name, "on"),
                f"{text}: the contents would run out; expected less than 90 deg",
            )


def on_body(basin: Any, mesh: Any, patch: str, rest: dict[str, Any], pose: Any) -> dict[str, Any]:
    """State at rest of a patch, with its position on the body that carries the basin.

    The keys `on` and `at` are added: the body, and the middle of the faces in body axes [m].
    rest : state at rest in the upright basin; pose : pose of the body at the start, by which elevation and depth are
    computed; if None, they stay as in `rest`
    """
    faces = mesh.patch(patch)
    x, y = mesh.length[faces] @ mesh.middle[faces] / mesh.length[faces].sum()
    own = np.array([x, y, rest["elevation"] or 0.0])
    at = np.array(basin.place) + basin.rotation @ own
    result = rest | {"on": basin.on, "at": tuple(at.tolist())}
    if pose is not None:
        result["elevation"] = float(pose.at(at)[2])
        if rest["depth"] is not None:
            result["depth"] = depth_over(basin, mesh, own, pose.attitude)
    return result


def depth_over(basin: Any, mesh: Any, place: np.ndarray, attitude: np.ndarray) -> float:
    """Vertical depth of water with a horizontal surface above a point of a tilted basin, at least 0 [m].

    It is 0 if the basin is tilted by 90 degrees or more.

    place : float64[3]  point in the axes of the basin [m]; attitude : float64[3, 3]  rotation matrix of the body
    """
    down = (attitude @ basin.rotation).T @ np.array([0.0, 0.0, -1.0])
    if not down[2] < 0.0:
        return 0.0
    bed, (x, y) = means(samples(basin.bed, mesh)), mesh.centre.T
    drawn = bed - basin.level
    volume = float(np.sum(mesh.area * np.maximum(basin.level - bed, 0.0)))
    level = level_over(drawn, (down[0] * x + down[1] * y) / down[2], mesh.area, volume)
    ground = place[2] - basin.level + (down[0] * place[0] + down[1] * place[1]) / down[2]
    return max(float((level - ground) * -down[2]), 0.0)


def level_over(drawn: np.ndarray, tilt: np.ndarray, area: np.ndarray, volume: float) -> float:
    """Level [m] of the surface of a volume of water [m3] over a tilted bed, relative to the level without tilt.

    drawn : float64[n]  height of the bed in each cell above the level without tilt [m]
    tilt : float64[n]  rise of the bed by the tilt [m]; area : float64[n]  areas of the cells [m2]
    """
    ground = drawn + tilt
    if not np.ptp(ground - drawn) > 0.0:
        return 0.0
    low, high = float(ground.min()), float(ground.max()) + volume / float(area.sum())
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        full = float(np.sum(area * np.maximum(middle - ground, 0.0))) > volume
        low, high = (low, middle) if full else (middle, high)
    return 0.5 * (low + high)
