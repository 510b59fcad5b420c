"""Rows of force elements that act on masses along an axis, or between points of bodies."""

import numpy as np

from fvsolve.core.assembly.lowering import Lowering
from fvsolve.core.kernels import dtypes as rec

PLAIN_LINE = (-1, -1, -1, rec.ALONG, (0.0, 0.0, 0.0), 0.0)  # a line


class PushLowering(Lowering):
    """Conversion of links between masses; their probes read the force."""

    def probe(self, draft, name, probe, row) -> None:
        row["kind"], row["index"] = rec.FORCE, draft.push_names.index(name)


class AxisLowering(Lowering):
    """Conversion of masses, which move along an axis, and of frames, which are fixed on it."""

    def probe(self, draft, name, probe, row) -> None:
        row["kind"] = rec.POSITION if probe.quantity == "position" else rec.VELOCITY
        row["index"] = draft.mass_index[name]


def push_ends(link) -> tuple[str | None, str]:
    """Names of the two masses or points that a force element joins; the first may be None."""
    return (
        (link.ports["case"], link.ports["rod"]) if "rod" in link.ports else (link.ports.get("from"), link.ports["to"])
    )


def are_points(draft, *places: str | None) -> bool:
    """True if any of the names is a point of a body or of the world."""
    return any(place is not None and place not in draft.mass_index for place in places)


def join_ports(
    draft, row, ports: tuple[str, str], places: tuple[str | None, str], *line_options
) -> tuple[float, float]:
    """Write to the row of a force element the two masses or points that it joins.

    Returns the offset of the second mass from the first at the start [m] and its relative velocity [m/s]; for points
    the result of `mechanics.distance_and_rate`.
    ports : names of the fields for the masses; line_options : for points, further arguments of `mechanics.add_line`
    """
    row["line"] = -1
    if are_points(draft, *places):
        row["line"] = add_line(draft, places, *line_options)
        row[ports[0]] = row[ports[1]] = draft.mass_index[None]
        return distance_and_rate(draft, places, draft.lines[-1])
    for port, place in zip(ports, places, strict=True):
        row[port] = draft.mass_index[place]
    first, second = (draft.mass_table[int(row[port])] for port in ports)
    return second["position"] - first["position"], second["velocity"] - first["velocity"]


def point_row(draft, place: str) -> int:
    """Row in the table of points for the point that a link or a probe names; added on first use."""
    if place not in draft.point_index:
        name, position = draft.case.body_point(place)
        draft.point_index[place] = len(draft.points)
        draft.points.append((draft.body_names.index(name) if name else -1, tuple(position)))
    return draft.point_index[place]


def pose_of(draft, place: str):
    """Pose (position and attitude) stated for the body of a point; the pose at rest for a point of the world."""
    return draft.case.as_stated.pose_of(draft.case.body_point(place)[0])


def add_line(draft, places: tuple[str | None, str], acts: int = rec.ALONG, direction=(0.0, 0.0, 0.0)) -> int:
    """Add a line of action of a force between two points; return its row in the table of lines.

    acts : ALONG the line between the points, TOWARD a direction of the world, or ABOUT an axis of the second body
    direction : vector of that direction or axis. `lower_lines` later writes the number of the force element.
    """
    ends = [-1 if place is None else point_row(draft, place) for place in places]
    draft.lines.append((-1, *ends, acts, tuple(direction), 0.0))
    return len(draft.lines) - 1


def distance_and_rate(draft, places: tuple[str | None, str], line) -> tuple[float, float]:
    """Distance between two points at the start [m], and its rate [m/s]; a point None is the origin of the world.

    For a line that acts TOWARD a direction the result is (0, relative velocity in this direction [m/s]). For a line
    that acts ABOUT an axis it is (0, relative angular velocity about the axis [rad/s]). line : entry of `draft.lines`
    """
    ends = []
    for place in places:
        name, position = ("", np.zeros(3)) if place is None else draft.case.body_point(place)
        pose = draft.case.pose_of(name)
        ends.append((pose.at(position), pose.velocity_at(position), pose.spin))
    (x, u, a), (z, v, b) = ends
    _, _, _, acts, direction, _ = line
    if acts == rec.ABOUT:
        axis = draft.case.poses[draft.case.body_point(places[1])[0]].attitude @ direction
        return 0.0, float(np.dot(axis, b - a))
    if acts == rec.TOWARD:
        return 0.0, float(np.dot(direction, v - u))
    length = float(np.linalg.norm(z - x))
    return length, float(np.dot(z - x, v - u)) / length if length > 0.0 else 0.0
