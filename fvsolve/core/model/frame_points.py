"""Points fixed to frames that move, in axes of the world."""

import numpy as np

from fvsolve.core.assembly.features import frames_of
from fvsolve.core.kernels.dtypes import BODY_OUT


def world_points(
    model, out: np.ndarray, owner: np.ndarray, place: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """World coordinates [m] and velocities [m/s] of points fixed to frames : float64[p, 3] each.

    out : output array of the right-hand side, which contains the motion of the frames
    owner : int[p]         frame of each point, -1 for the world
    place : float64[p, 3]  coordinates in the axes of the frame [m]
    """
    # not loaded without frames
    from fvsolve.core.kernels.moving_frames import ATTITUDE, POSITION, SPIN, VELOCITY

    first, n = int(model.layout["body"]), len(frames_of(model))
    points, speed = place.copy(), np.zeros_like(place)
    for i, row in enumerate(out[first : first + BODY_OUT * n].reshape(n, BODY_OUT)):
        own = owner == i
        arms = place[own] @ row[ATTITUDE : ATTITUDE + 9].reshape(3, 3).T
        points[own] = row[POSITION : POSITION + 3] + arms
        speed[own] = row[VELOCITY : VELOCITY + 3] + np.cross(row[SPIN : SPIN + 3], arms)
    return points, speed
