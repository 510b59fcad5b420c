"""Positions and water depths of patches of basins on bodies."""

from __future__ import annotations

from typing import Any

import numpy as np

from fvsolve.case.cell_means import means, samples

BISECTIONS = 200  # number of bisections


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
