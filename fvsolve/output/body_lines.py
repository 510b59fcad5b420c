"""Lines that represent bodies in pictures: from the origin to the centre of mass and to the points, and force elements.

A sloshing mass is a line from its rest position to its position.
"""

from __future__ import annotations

import numpy as np

from fvsolve.kernels.dtypes import BODY_OUT, PRISMATIC
from fvsolve.kernels.mechanism.body_layout import ATTITUDE, POSITION, SPIN, VELOCITY

BODY_UNITS = {"body": "-", "speed": "m/s"}


def body_points(body) -> list[tuple[float, ...]]:
    """Points of a body in its axes, without repetition: origin, centre of mass, then its named points [m]."""
    return list(dict.fromkeys([(0.0, 0.0, 0.0), tuple(body.centre_of_mass), *map(tuple, body.points.values())]))


class BodyLines:
    """Points fixed to bodies or to the world, and lines between them.

    owner : int[p]         body of each point, -1 for the world
    place : float64[p, 3]  coordinates of each point in the axes of its owner [m]
    lines : int[l, 2]      points at the ends of each line
    line_body : int32[l]   body of each line, -1 for none
    """

    def __init__(self, model) -> None:
        self.model, names = model, model.body_names
        owner, place, lines, line_body = [], [], [], []
        drawn = [body_points(model.case.nodes[name]) if name in model.case.nodes else [] for name in names]
        dots = max(map(len, drawn)) < 2  # if others have extent, a body with only an origin is just a joint of them
        for i, ends in enumerate(drawn):
            first = len(owner)
            if not ends and (row := model.tables.bodies[i])["joint"] == PRISMATIC:  # a mode of water in a tank
                owner += [int(row["parent"]), i]
                place += [tuple(row["at"]), (0.0, 0.0, 0.0)]
            elif len(ends) > 1 or (ends and dots):
                owner += [i] * len(ends)
                place += ends
            if len(owner) > first:
                lines += [(first, first + k) for k in range(1, len(owner) - first)] or [(first, first)]
                line_body += [i] * max(len(owner) - first - 1, 1)
        for row in model.tables.lines:
            if min(row["from_point"], row["to_point"]) >= 0:
                for key in ("from_point", "to_point"):
                    point = model.tables.points[row[key]]
                    owner.append(int(point["body"]))
                    place.append(tuple(point["place"]))
                lines.append((len(owner) - 2, len(owner) - 1))
                line_body.append(-1)
        self.owner, self.place = np.array(owner), np.array(place, dtype=float).reshape(-1, 3)
        self.lines, self.line_body = np.array(lines).reshape(-1, 2), np.array(line_body, dtype=np.int32)

    def at(self, out: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points in world axes [m], and speeds of the midpoints of lines [m/s] : float64[p, 3], float64[l].

        out : output array of the right-hand side, which contains the motion of the bodies
        """
        points, speed = world_points(self.model, out, self.owner, self.place)
        return points, np.linalg.norm(speed[self.lines].mean(axis=1), axis=1)


def world_points(model, out: np.ndarray, owner: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """World coordinates [m] and velocities [m/s] of points fixed to bodies : float64[p, 3] each.

    out : output array of the right-hand side, which contains the motion of the bodies
    owner : int[p]         body of each point, -1 for the world
    place : float64[p, 3]  coordinates in the axes of the body [m]
    """
    first, n = int(model.layout["body"]), len(model.body_names)
    points, speed = place.copy(), np.zeros_like(place)
    for i, row in enumerate(out[first : first + BODY_OUT * n].reshape(n, BODY_OUT)):
        own = owner == i
        arms = place[own] @ row[ATTITUDE : ATTITUDE + 9].reshape(3, 3).T
        points[own] = row[POSITION : POSITION + 3] + arms
        speed[own] = row[VELOCITY : VELOCITY + 3] + np.cross(row[SPIN : SPIN + 3], arms)
    return points, speed
