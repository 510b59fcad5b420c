"""Rows of force elements that act on masses along an axis, or between points of bodies."""

import numpy as np

from fvsolve.features.motion.kernels import tables as records
from fvsolve.features.motion.kernels.tables import motion_of

PLAIN_LINE = (-1, -1, -1, records.ALONG, (0.0, 0.0, 0.0), 0.0)  # a line


def join_ports(
    draft, row, ports: tuple, places: tuple, toward=None, about=None
) -> tuple[float, float]:
    """Write to the row of a force element, or of a joint, what it joins: masses or points, see `Feature.join`.

    For points it adds a line of action, to which `lower_lines` later writes the number of the force element. The force
    acts along the line between them, or `toward` a direction of the world; a torque acts `about` an axis of the second
    body.
    """
    if ports[0] == "from_point":
        row[ports[0]], row[ports[1]] = point_row(draft, places[0]), point_row(draft, places[1])
        return 0.0, 0.0
    motion = motion_of(draft)
    row["line"] = -1
    if any(place is not None and place not in motion.mass_index for place in places):  # points
        acts, direction = (
            (records.ALONG, (0.0, 0.0, 0.0)) if about is None else (records.ABOUT, about)
        )
        acts, direction = (acts, direction) if toward is None else (records.TOWARD, toward)
        row["line"] = len(motion.lines)
        first, second = (-1 if place is None else point_row(draft, place) for place in places)
        motion.lines.append((-1, first, second, acts, tuple(direction), 0.0))
        row[ports[0]] = row[ports[1]] = motion.mass_index[None]
        return distance_and_rate(draft, places, motion.lines[-1])
    for port, place in zip(ports, places, strict=True):
        row[port] = motion.mass_index[place]
    first, second = (motion.mass_table[int(row[port])] for port in ports)
    return second["position"] - first["position"], second["velocity"] - first["velocity"]


def point_row(draft, place: str) -> int:
    """Row in the table of points for the point that a link or a probe names; added on first use."""
    motion = motion_of(draft)
    if place not in motion.point_index:
        name, position = draft.case.body_point(place)
        motion.point_index[place] = len(motion.points)
        motion.points.append((motion.body_names.index(name) if name else -1, tuple(position)))
    return motion.point_index[place]


def distance_and_rate(draft, places: tuple[str | None, str], line) -> tuple[float, float]:
    """Distance between two points at the start [m], and its rate [m/s]; a point None is the origin of the world.

    For a line that acts TOWARD a direction the result is (0, relative velocity in this direction [m/s]). For a line
    that acts ABOUT an axis it is (0, relative angular velocity about the axis [rad/s]). line : entry of `Motion.lines`
    """
    ends = []
    for place in places:
        name, position = ("", np.zeros(3)) if place is None else draft.case.body_point(place)
        pose = draft.case.pose_of(name)
        ends.append((pose.at(position), pose.velocity_at(position), pose.spin))
    (x, u, a), (z, v, b) = ends
    _, _, _, acts, direction, _ = line
    if acts == records.ABOUT:
        axis = draft.case.poses[draft.case.body_point(places[1])[0]].attitude @ direction
        return 0.0, float(np.dot(axis, b - a))
    if acts == records.TOWARD:
        return 0.0, float(np.dot(direction, v - u))
    length = float(np.linalg.norm(z - x))
    return length, float(np.dot(z - x, v - u)) / length if length > 0.0 else 0.0
