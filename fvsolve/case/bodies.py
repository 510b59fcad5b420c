"""Where bodies stand and how they move at the start, from what a case says. Knows joints; knows no force.

What (59), (62) and (67) say of points, by numpy; the kernels say the same of every later time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fvsolve import attitude
from fvsolve.errors import did_you_mean, listing
from fvsolve.exact.schedule import value
from fvsolve.parts.attitude import no_direction
from fvsolve.parts.body.part import Body
from fvsolve.units import show

OPEN = 1e-4  # of the length of things, by which a pin may be open at the start: numbers are typed with a few digits
WORLD = ""  # what all hangs on; no name
Found = Iterator[tuple[tuple, str]]


@dataclass(frozen=True)
class Pose:
    """Attitude R, place of the origin [m], its velocity [m/s], angular velocity [rad/s]; of the world by default."""

    attitude: np.ndarray
    place: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray

    def at(self, place: Any) -> np.ndarray:
        """A point in its axes, in the world (59) [m]."""
        return self.place + self.attitude @ np.asarray(place, dtype=float)

    def moves(self, place: Any) -> np.ndarray:
        """Velocity of a point in its axes (67) [m/s]."""
        return self.velocity + np.cross(self.spin, self.attitude @ np.asarray(place, dtype=float))


AT_REST = Pose(np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3))


@dataclass(frozen=True)
class Riding:
    """A body as probes see it: what its joint lets be read."""

    body: Body
    kind: ClassVar[str] = "body"

    @property
    def quantities(self) -> dict[str, str]:
        joint, left = self.body.joint, {"angle", "travel", "rate"}
        if joint.kind == "revolute":
            left = {"travel"}
        elif joint.kind == "prismatic":
            left = {"angle"}
        found = {key: one for key, one in Body.quantities.items() if key not in left}
        return found | ({"rate": "velocity"} if joint.kind == "prismatic" else {})


def bodies_of(nodes: dict[str, Any]) -> dict[str, Body]:
    """The bodies among nodes, each behind the one that it hangs on, else in the order of the file.

    Those that hang in a loop, or on what is not there, are left out.
    """
    waiting, found = {name: node for name, node in nodes.items() if isinstance(node, Body)}, {}
    frames = [name for name, node in nodes.items() if node.kind == "frame"]
    while waiting:
        ready = {name: one for name, one in waiting.items() if hangs_on(one)[0] not in waiting and placed(nodes, one)
                 and hangs_on(one)[0] in (WORLD, *found, *frames)}  # fmt: skip
        if not ready:
            return found
        found |= ready
        waiting = {name: one for name, one in waiting.items() if name not in ready}
    return found


def placed(nodes: dict[str, Any], body: Body) -> bool:
    """Whether what a body hangs on, and the point there, are known."""
    name, point = hangs_on(body)
    return name == WORLD or (hasattr(nodes.get(name), "points") and (not point or point in nodes[name].points))


def hangs_on(body: Body) -> tuple[str, str]:
    """(node, point) that a body is joined to; WORLD, and "" for none."""
    name, _, point = (body.joint.on or WORLD).partition(".")
    return name, point


def joint_place(nodes: dict[str, Any], body: Body) -> np.ndarray:
    """Where a joint lies in the axes of what it is on [m]."""
    name, point = hangs_on(body)
    if point:
        return np.array(nodes[name].points[point])
    return np.array(body.joint.at or (0.0, 0.0, 0.0))


def poses(nodes: dict[str, Any], t: float) -> dict[str, Pose]:
    """Where all bodies stand at time t [s], the start."""
    found: dict[str, Pose] = {}
    for name, body in bodies_of(nodes).items():
        up = found.get(hangs_on(body)[0], AT_REST)
        found[name] = joined(body, up, joint_place(nodes, body), t)
    return found


def joined(body: Body, up: Pose, at: np.ndarray, t: float) -> Pose:
    """The pose of a body whose joint lies at `at` in the axes of what it hangs on."""
    joint = body.joint
    turn, place = up.attitude @ joint.attitude.rotation, up.at(at)
    velocity, spin, axis = up.moves(at), up.spin, turn @ joint.unit_axis
    if joint.kind == "revolute":
        return Pose(turn @ attitude.of_axis(joint.axis, coordinate(joint, t)), place, velocity,
                    spin + axis * rate(joint, t))  # fmt: skip
    if joint.kind == "prismatic":
        far = axis * coordinate(joint, t)
        return Pose(turn, place + far, velocity + np.cross(spin, far) + axis * rate(joint, t), spin)
    if joint.kind == "free":  # whose velocity is that of its centre of mass
        spin = turn @ joint.turning
        centre = joint.speed - np.cross(spin, turn @ np.array(body.centre_of_mass))
        return Pose(turn, place, centre, spin)
    return Pose(turn, place, velocity, spin + turn @ joint.turning if joint.kind == "ball" else spin)


def coordinate(joint: Any, t: float) -> float:
    """Angle [rad] or travel [m] of a joint at the start."""
    return float(value(joint.coordinate, t, left=True)) if joint.coordinate is not None else 0.0


def rate(joint: Any, t: float) -> float:
    """Its rate then; of one that is driven by differences of what drives it from then on."""
    if joint.driven is None:
        return float(joint.rate or 0.0)
    h = 1e-4
    now, soon, later = (float(value(joint.driven, t + k * h)) for k in range(3))
    return (4.0 * soon - 3.0 * now - later) / (2.0 * h)


def point_of(nodes: dict[str, Any], place: str) -> tuple[str, np.ndarray] | None:
    """(body, place in its axes) of what a link names, WORLD for a frame's; None where it is no point."""
    name, _, point = place.partition(".")
    node = nodes.get(name)
    if getattr(node, "domain", "") == "spatial" and not point:
        return name, np.zeros(3)
    if point not in getattr(node, "points", {}):
        return None
    return name if isinstance(node, Body) else WORLD, np.array(node.points[point])


def ahead(nodes: dict[str, Any], found: dict[str, Pose], first: str, second: str) -> float | None:
    """How far place `second` lies ahead of `first` at the start [m], of points their distance; None unless known."""
    ends = [nodes.get(place) for place in (first, second)]
    if all(getattr(end, "domain", "") == "translational" for end in ends):
        return ends[1].initial_position - ends[0].initial_position
    points = [point_of(nodes, place) for place in (first, second)]
    if None in points or any(name not in (WORLD, *found) for name, _ in points):
        return None
    here, there = (found.get(name, AT_REST).at(place) for name, place in points)
    return float(np.linalg.norm(there - here))


def point_inertia(mass: float, r: np.ndarray) -> np.ndarray:
    """What a mass at r from an origin has of inertia about it : float64[3, 3] [kg m2]."""
    return mass * (np.dot(r, r) * np.eye(3) - np.outer(r, r))


def one_place(nodes: dict[str, Any], links: dict[str, Any], found: dict[str, Pose]) -> Found:
    """Faults of links along a line between two points that lie in one place at the start: it has no direction."""
    for name, link in links.items():
        ends = [link.ports.get(port) for port in (("case", "rod") if "rod" in link.ports else ("from", "to"))]
        if (
            None in ends
            or link.kind in ("pin", "bushing")
            or any(getattr(link, key, None) for key in ("direction", "axis"))
        ):
            continue
        if None not in [point_of(nodes, end) for end in ends] and ahead(nodes, found, *ends) == 0.0:
            text = f"{ends[0]} and {ends[1]} lie in one place at the start, so the line between them has no direction"
            yield ("links", name), text


def open_pins(nodes: dict[str, Any], links: dict[str, Any], found: dict[str, Pose]) -> Found:
    """Faults of pins whose two points do not meet at the start."""
    for name, link in links.items():
        points = [point_of(nodes, link.ports[port]) for port in ("from", "to")] if link.kind == "pin" else [None]
        if None in points or no_direction(link.axis) or any(one not in (WORLD, *found) for one, _ in points):
            continue
        here, there = (found.get(one, AT_REST).at(place) for one, place in points)
        turn = found.get(points[0][0], AT_REST).attitude
        gap = float(np.linalg.norm(link.directions() @ (turn.T @ (there - here))))
        if gap > OPEN * (1.0 + float(np.linalg.norm(points[0][1]))):
            across = " across its axis" if link.axis else ""
            yield (
                ("links", name),
                f"{link.from_} and {link.to} lie {gap:.4g} m apart{across} at the start; wanted them to meet",
            )


def misfits(nodes: dict[str, Any], named: Any) -> Found:
    """Faults of what bodies hang on: no such body or point, and loops, each named once; named : those at fault too."""
    own = {name: node for name, node in nodes.items() if hasattr(node, "points")}
    bodies = {name: node for name, node in own.items() if isinstance(node, Body)}
    for name, body in bodies.items():
        on, point = hangs_on(body)
        keys = ("nodes", name, "joint", "on")
        if on == WORLD or (on not in nodes and on in named):  # at fault itself
            continue
        if on not in own:
            what = f"is a {nodes[on].kind}" if on in nodes else "is no node"
            hint = did_you_mean(on, own) or f"; bodies are {listing(bodies)}"
            yield keys, f"{show(on)} {what}; wanted a body, a point of one, or a point of a frame{hint}"
        elif point and point not in own[on].points:
            has = f"its points are {listing(own[on].points)}" if own[on].points else "it has no points"
            yield keys, f"{on} has no point {show(point)}; {has}{did_you_mean(point, own[on].points)}"
        elif not point and on not in bodies:
            yield keys, f"{show(on)} is a frame; wanted one of its points, FRAME.POINT, or leave on out"
    loop = set(bodies) - set(bodies_of(nodes)) - {name for name in bodies if not reaches(nodes, bodies, name)}
    while loop:
        name = min(loop, key=list(bodies).index)
        ring = [name]
        while (up := hangs_on(bodies[ring[-1]])[0]) not in ring:
            ring.append(up)
        ring = ring[ring.index(up) :]
        text = " on ".join([*ring, ring[0]])
        yield ("nodes", ring[0], "joint", "on"), f"hangs on itself: {text}; close a loop by a pin, and leave one on out"
        loop -= {one for one in loop if set(chain(bodies, one)) & set(ring)}


def chain(bodies: dict[str, Body], name: str) -> list[str]:
    """A body and all that it hangs on, each once."""
    found = [name]
    while (up := hangs_on(bodies[found[-1]])[0]) in bodies and up not in found:
        found.append(up)
    return found


def reaches(nodes: dict[str, Any], bodies: dict[str, Body], name: str) -> bool:
    """Whether what a body hangs on goes round in a loop, and not to what is missing."""
    return hangs_on(bodies[chain(bodies, name)[-1]])[0] in bodies
