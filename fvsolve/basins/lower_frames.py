"""Basins that ride on bodies, as rows of tables. Knows names; knows no law."""

from __future__ import annotations

import numpy as np

from fvsolve.basins.frames import FRAME, LEVEL, PLACES, SURFACE
from fvsolve.case.riding import free_joints

ENOUGH = 200  # halvings


def attitude_of(part) -> np.ndarray:
    """How a basin stands in the axes of its body : float64[3, 3]."""
    return np.eye(3) if part.attitude is None else part.attitude.rotation


def middle_of(basin) -> np.ndarray:
    """Where the axes that kernels follow have their origin, in those of the basin [m] : float64[2].

    What columns feel along the normal is taken there, and the mirrors of walls know no Euler force beyond it: at the
    middle that errs least, and alike wherever a basin's own corner is drawn.
    """
    return basin.mesh.area @ basin.mesh.centre / basin.mesh.area.sum()


def lower_frame(draft, basin, row) -> None:
    """Reserve what is known of its axes, and keep the surface as drawn."""
    part, grid, middle = basin.part, basin.mesh.grid, middle_of(basin)
    places = (basin.mesh.centre - middle).T.ravel()
    if basin.is_grid:
        lines = zip((grid.x, grid.y), middle, strict=True)
        places = np.concatenate([0.5 * (one[1:] + one[:-1]) - at for one, at in lines])
    numbers = np.zeros(FRAME)
    numbers[:3] = np.array(part.at or (0.0, 0.0, 0.0)) + attitude_of(part)[:, :2] @ middle
    numbers[LEVEL] = part.level
    numbers[3:12] = attitude_of(part).ravel()
    numbers[SURFACE] = draft.to_plane(np.maximum(basin.bed - part.level, 0.0))
    numbers[PLACES] = draft.to_plane(places)
    row["body"], row["frame"] = draft.body_names.index(part.on), draft.to_plane(numbers)
    joints = any(probe.quantity.startswith("joint_") for probe in draft.case.probes)
    row["heavy"] = joints or any(free_joints(part.on, draft.case.nodes))


def level_at_start(basin, attitude: np.ndarray | None = None) -> np.ndarray:
    """Depth of water that is level in the world though its basin is not, of the volume that it has at rest [m].

    attitude : R of its body, that of the start if left out
    """
    part, turn = basin.part, basin.case.poses[basin.part.on].attitude if attitude is None else attitude
    down = (turn @ attitude_of(part)).T @ np.array([0.0, 0.0, -1.0])
    ground = basin.bed - part.level + (down[0] * basin.x + down[1] * basin.y) / down[2]
    area, volume = basin.mesh.area, float(np.sum(basin.mesh.area * basin.depth))
    if not np.ptp(ground - (basin.bed - part.level)) > 0.0:
        return basin.depth
    low, high = float(ground.min()), float(ground.max()) + volume / float(area.sum())
    for _ in range(ENOUGH):
        middle = 0.5 * (low + high)
        full = float(np.sum(area * np.maximum(middle - ground, 0.0))) > volume
        low, high = (low, middle) if full else (middle, high)
    return np.maximum(0.5 * (low + high) - ground, 0.0)


def corners(basin, points: np.ndarray, out: np.ndarray, layout) -> np.ndarray:
    """Points in axes of a basin where they are in the world : float64[p, 3] [m]."""
    from fvsolve.kernels.mechanism.room import ATTITUDE, PLACE
    from fvsolve.kernels.records import BODY_OUT

    first = int(layout["body"]) + BODY_OUT * int(basin.row["body"])
    turn = out[first + ATTITUDE :][:9].reshape(3, 3)
    at = np.array(basin.part.at or (0.0, 0.0, 0.0))
    return out[first + PLACE :][:3] + (at + points @ attitude_of(basin.part).T) @ turn.T
