"""Basins that ride on bodies, as rows of tables. Knows names; knows no law."""

from __future__ import annotations

import numpy as np

from fvsolve.basins.faces import BLOCK, blocks
from fvsolve.basins.frames import FRAME, LEVEL, PHI, PLACES, SURFACE
from fvsolve.case.riding import carriers, free_joints
from fvsolve.case.riding_patches import level_over


def lower_frame(draft, basin, row) -> None:
    """Reserve what is known of its axes, and keep the surface as drawn.

    The axes that kernels follow have their origin in the middle: what columns feel along the normal is taken there, and
    the mirrors of walls know no Euler force beyond it, so that this errs least, and alike wherever a corner is drawn.
    """
    part, grid, middle = basin.part, basin.mesh.grid, basin.mesh.centroid
    places = [*(basin.mesh.centre - middle).T]
    if basin.is_grid:
        lines = [one - at for one, at in zip((grid.x, grid.y), middle, strict=True)]
        places = [0.5 * (one[1:] + one[:-1]) for one in lines]
    numbers = np.zeros(FRAME)
    numbers[:3] = np.array(part.place) + part.turn[:, :2] @ middle
    numbers[3:12] = part.turn.ravel()
    if basin.deep:
        numbers[LEVEL] = part.level
        numbers[SURFACE] = draft.to_plane(np.maximum(basin.bed - part.level, 0.0))
    else:
        sides = lines if basin.is_grid else places_of_sides(basin) - middle[:, None]
        many = sides[0].size * grid.ny + grid.nx * sides[1].size if basin.is_grid else sides[0].size
        numbers[PHI], places = draft.to_work(basin.n + many), [*places, *sides]
    numbers[PLACES] = draft.to_plane(np.concatenate(places))
    row["body"], row["frame"] = draft.body_names.index(part.on), draft.to_plane(numbers)
    joints = asked_of_joints(draft.case)
    row["heavy"] = any(joints) or any(free_joints(part.on, draft.case.nodes))
    held = set(carriers(part.on, draft.case.nodes))
    for k, body in joints:
        if basin.opening is not None and body in held:
            text = f"{body} carries {basin.name}, and its joint's force lacks what passes {basin.name}.{basin.opening}"
            draft.fault(f"output.probes[{k}]", f"{text} yet; wanted none of these, or a wall there")


def asked_of_joints(case) -> list[tuple[int, str]]:
    """(number, body) of probes of what a joint holds."""
    asked = enumerate(case.probes)
    return [(k, one.name) for k, one in asked if one.part == "nodes" and one.quantity.startswith("joint_")]


def places_of_sides(basin) -> np.ndarray:
    """Middles of sides of cells in the order of `basins.faces`, alike from both cells : float64[2, sides]."""
    count = int(blocks(basin.integers) * basin.integers[0] * BLOCK)
    face = basin.integers[-count:]
    return basin.mesh.middle[np.where(face >= 0, face, ~face)].T


def place_in_frame(draft, basin, patch: str) -> list[float]:
    """Where a patch is in the axes that kernels follow, over the level at rest [m], and its profile's weight [J/kg]."""
    place, part = draft.case.places[f"{basin.name}.{patch}"], basin.part
    own = part.turn.T @ (np.array(place.at) - np.array(part.place))
    return [*(own[:2] - basin.mesh.centroid).tolist(), float(own[2]) - part.level, draft.case.gravity * place.depth]


def potential_at_start(basin) -> np.ndarray:
    """What gravity lifts cells by above their basin's middle, as its body stands at the start [J/kg]."""
    pose, gravity = basin.case.poses[basin.part.on], basin.case.gravity
    up = (pose.attitude @ basin.part.turn).T @ np.array([0.0, 0.0, gravity])
    return (basin.mesh.centre - basin.mesh.centroid) @ up[:2]


def level_at_start(basin, attitude: np.ndarray | None = None) -> np.ndarray:
    """Depth of water that is level in the world though its basin is not, of the volume that it has at rest [m].

    attitude : R of its body, that of the start if left out
    """
    part, turn = basin.part, basin.case.poses[basin.part.on].attitude if attitude is None else attitude
    down = (turn @ part.turn).T @ np.array([0.0, 0.0, -1.0])
    drawn, tilt = basin.bed - part.level, (down[0] * basin.x + down[1] * basin.y) / down[2]
    if not np.ptp(drawn + tilt - drawn) > 0.0:
        return basin.depth
    volume = float(np.sum(basin.mesh.area * basin.depth))
    return np.maximum(level_over(drawn, tilt, basin.mesh.area, volume) - (drawn + tilt), 0.0)


def axes_in_world(basin, out: np.ndarray, layout) -> tuple[np.ndarray, np.ndarray]:
    """Origin float64[3] [m] and axes float64[3, 3], one a column, of a basin on a body, in the world."""
    from fvsolve.kernels.mechanism.room import ATTITUDE, PLACE
    from fvsolve.kernels.records import BODY_OUT

    first = int(layout["body"]) + BODY_OUT * int(basin.row["body"])
    place, turn = out[first + PLACE :][:3], out[first + ATTITUDE :][:9].reshape(3, 3)
    return place + turn @ np.array(basin.part.place), turn @ basin.part.turn
