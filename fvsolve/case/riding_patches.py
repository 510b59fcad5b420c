"""Patches of basins that ride, as places on bodies. Knows meshes; knows no network."""

from __future__ import annotations

from typing import Any

import numpy as np

from fvsolve.case.cells import means, samples

ENOUGH = 200  # halvings


def on_body(basin: Any, mesh: Any, patch: str, rest: dict[str, Any], pose: Any) -> dict[str, Any]:
    """Of a patch at rest, where it is: amid its faces, on the bed behind, and there what stands over it at the start.

    pose : of its body at the start; None where that is not asked for
    """
    faces = mesh.patch(patch)
    x, y = mesh.length[faces] @ mesh.middle[faces] / mesh.length[faces].sum()
    own = np.array([x, y, rest["elevation"] or 0.0])
    at = np.array(basin.place) + basin.turn @ own
    found = rest | {"on": basin.on, "at": tuple(at.tolist())}
    if pose is not None:
        found["elevation"] = float(pose.at(at)[2])
        if rest["depth"] is not None:
            found["depth"] = depth_over(basin, mesh, own, pose.attitude)
    return found


def depth_over(basin: Any, mesh: Any, place: np.ndarray, attitude: np.ndarray) -> float:
    """Height of the surface, level in the world, over a place in axes of a basin, not below it [m]."""
    down = (attitude @ basin.turn).T @ np.array([0.0, 0.0, -1.0])
    if not down[2] < 0.0:
        return 0.0
    bed, (x, y) = means(samples(basin.bed, mesh)), mesh.centre.T
    drawn = bed - basin.level
    volume = float(np.sum(mesh.area * np.maximum(basin.level - bed, 0.0)))
    level = level_over(drawn, (down[0] * x + down[1] * y) / down[2], mesh.area, volume)
    ground = place[2] - basin.level + (down[0] * place[0] + down[1] * place[1]) / down[2]
    return max(float((level - ground) * -down[2]), 0.0)


def level_over(drawn: np.ndarray, tilt: np.ndarray, area: np.ndarray, volume: float) -> float:
    """Where water of a volume stands over a bed, less its level, that is tilted by so much [m]; 0 where by nothing."""
    ground = drawn + tilt
    if not np.ptp(ground - drawn) > 0.0:
        return 0.0
    low, high = float(ground.min()), float(ground.max()) + volume / float(area.sum())
    for _ in range(ENOUGH):
        middle = 0.5 * (low + high)
        full = float(np.sum(area * np.maximum(middle - ground, 0.0))) > volume
        low, high = (low, middle) if full else (middle, high)
    return 0.5 * (low + high)
