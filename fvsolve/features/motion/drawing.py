"""Lines by which bodies are drawn: from the origin to the centre of mass and to the points; force elements.

A sloshing mass is a line from its rest position to its position.
"""

import numpy as np

from fvsolve.core.model.frame_points import world_points
from fvsolve.features.motion.kernels import tables as records
from fvsolve.features.motion.kernels.tables import motion_of


class BodyLines:
    """Points fixed to bodies or to the world, and lines between them.

    owner : int[p]         body of each point, -1 for the world
    place : float64[p, 3]  coordinates of each point in the axes of its owner [m]
    lines : int[l, 2]      points at the ends of each line
    blocks : values of lines that do not change: int32[l], body of each line, -1 for none
    """

    name = "bodies"  # of the files

    def __init__(self, model) -> None:
        motion = motion_of(model)
        self.model, names = model, motion.body_names
        owner = []
        place = []
        lines = []
        line_body = []
        # for each body, points in its axes [m], without repetition: origin, centre of mass, named points
        bodies = [model.case.nodes.get(name) for name in names]
        drawn = [
            []
            if body is None
            else list(
                dict.fromkeys(
                    [(0.0,) * 3, tuple(body.centre_of_mass), *map(tuple, body.points.values())]
                )
            )
            for body in bodies
        ]
        # if others have extent, a body with only an origin is just a joint of them
        dots = max(map(len, drawn)) < 2
        for i, ends in enumerate(drawn):
            first = len(owner)
            # a mode of water in a tank
            if not ends and (row := motion.body_table[i])["joint"] == records.PRISMATIC:
                owner += [int(row["parent"]), i]
                place += [tuple(row["at"]), (0.0, 0.0, 0.0)]
            elif len(ends) > 1 or (ends and dots):
                owner += [i] * len(ends)
                place += ends
            if len(owner) > first:
                lines += [(first, first + k) for k in range(1, len(owner) - first)] or [
                    (first, first)
                ]
                line_body += [i] * max(len(owner) - first - 1, 1)
        for row in motion.line_table:
            if min(row["from_point"], row["to_point"]) >= 0:
                for key in ("from_point", "to_point"):
                    point = motion.point_table[row[key]]
                    owner.append(int(point["body"]))
                    place.append(tuple(point["place"]))
                lines.append((len(owner) - 2, len(owner) - 1))
                line_body.append(-1)
        self.owner, self.place = np.array(owner), np.array(place, dtype=float).reshape(-1, 3)
        self.lines, self.blocks = (
            np.array(lines).reshape(-1, 2),
            {"body": [np.array(line_body, dtype=np.int32)]},
        )

    def at(self, out: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points in world axes [m], and speeds of the midpoints of lines [m/s] : float64[p, 3], float64[l].

        out : output array of the right-hand side, which contains the motion of the bodies
        """
        points, speed = world_points(self.model, out, self.owner, self.place)
        return points, np.linalg.norm(speed[self.lines].mean(axis=1), axis=1)
