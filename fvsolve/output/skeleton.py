"""Bodies as lines between what is known of them: origins, centres of mass, points, and what pushes between points;
water in modes as lines from where its masses rest to where they are.

Knows the tables of a model; knows no file.
"""

from __future__ import annotations

import numpy as np

from fvsolve.kernels.mechanism.room import ATTITUDE, PLACE, SPIN, VELOCITY
from fvsolve.kernels.records import BODY_OUT, PRISMATIC

UNITS = {"body": "-", "speed": "m/s"}


def ends_of(body) -> list[tuple[float, ...]]:
    """What is known of a body in its axes, its origin first [m]."""
    return list(dict.fromkeys([(0.0, 0.0, 0.0), tuple(body.centre_of_mass), *map(tuple, body.points.values())]))


class Skeleton:
    """Points fixed in bodies or in the world, and lines between them; a line belongs to a body, -1 to none.

    owner : int[p]  body of each point, -1 the world; place : float64[p, 3]  in its axes [m]; lines : int[l, 2]
    """

    def __init__(self, model) -> None:
        self.model, names = model, model.body_names
        owner, place, lines, whose = [], [], [], []
        drawn = [ends_of(model.case.nodes[name]) if name in model.case.nodes else [] for name in names]
        dots = max(map(len, drawn)) < 2  # else a body that is but an origin is no more than a joint of others
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
                whose += [i] * max(len(owner) - first - 1, 1)
        for row in model.tables.lines:
            if min(row["from_point"], row["to_point"]) >= 0:
                for end in ("from_point", "to_point"):
                    point = model.tables.points[row[end]]
                    owner.append(int(point["body"]))
                    place.append(tuple(point["place"]))
                lines.append((len(owner) - 2, len(owner) - 1))
                whose.append(-1)
        self.owner, self.place = np.array(owner), np.array(place, dtype=float).reshape(-1, 3)
        self.lines, self.whose = np.array(lines).reshape(-1, 2), np.array(whose, dtype=np.int32)

    def at(self, out: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(points float64[p, 3] [m], speeds of middles of lines float64[l] [m/s]) where bodies are as `out` says."""
        points, speed = moved(self.model, out, self.owner, self.place)
        return points, np.linalg.norm(speed[self.lines].mean(axis=1), axis=1)


def moved(model, out: np.ndarray, owner: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(points, their velocities : float64[p, 3]) in the world of places in axes of their bodies; -1: of the world."""
    first, many = int(model.layout["body"]), len(model.body_names)
    points, speed = place.copy(), np.zeros_like(place)
    for i, row in enumerate(out[first : first + BODY_OUT * many].reshape(many, BODY_OUT)):
        own = owner == i
        arms = place[own] @ row[ATTITUDE : ATTITUDE + 9].reshape(3, 3).T
        points[own] = row[PLACE : PLACE + 3] + arms
        speed[own] = row[VELOCITY : VELOCITY + 3] + np.cross(row[SPIN : SPIN + 3], arms)
    return points, speed
