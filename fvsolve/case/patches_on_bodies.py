"""Places on bodies of the patches of basins."""

from __future__ import annotations

from typing import Any

import numpy as np

from fvsolve.case.cell_means import means, samples

BISECTIONS = 200  # bisections


def on_body(basin: Any, mesh: Any, patch: str, rest: dict[str, Any], pose: Any) -> dict[str, Any]:
    """Add to the state at rest of a patch its place: the middle of its faces, on the bed of the cells next to it.

    pose : pose of the body at the start, for elevation and depth of water; None leaves both as they are
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
    """Depth of water with a horizontal surface over a place in axes of a basin, at least 0 [m]."""
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
    """Level of a volume of water over a tilted bed relative to its level at rest [m]; 0 without tilt.

    drawn : height of the bed above the level at rest [m]; tilt : its rise by the tilt [m]; area [m2]; volume [m3]
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
