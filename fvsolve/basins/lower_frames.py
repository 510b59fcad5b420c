"""Tables of a model for basins on bodies."""

from __future__ import annotations

import numpy as np

from fvsolve.basins.basin_frames import CELL_POSITIONS, FRAME_SIZE, POTENTIALS, REST_LEVEL, REST_SURFACE
from fvsolve.basins.cell_sides import BLOCK, blocks
from fvsolve.case.bodies import carriers, free_joints
from fvsolve.case.nodes_on_bodies import level_over


def lower_frame(draft, basin, row) -> None:
    """Reserve entries for the frame of a basin on a body; store its place, rotation, positions and undisturbed surface.

    A liquid has no surface; it has potentials, and positions of grid lines or of sides of cells, instead. If an open
    patch prevents the correct load at an observed joint, a fault is added to the draft.
    The axes of the kernels have their origin in the middle of the basin. Accelerations along the normal are those at
    this point, and the mirror cells at walls neglect the Euler force beyond the wall. With this origin the error is
    least, and does not depend on the origin of the coordinates of the mesh.
    """
    part, grid, middle = basin.part, basin.mesh.grid, basin.mesh.centroid
    places = [*(basin.mesh.centre - middle).T]
    if basin.is_grid:
        lines = [line - at for line, at in zip((grid.x, grid.y), middle, strict=True)]
        places = [0.5 * (line[1:] + line[:-1]) for line in lines]
    numbers = np.zeros(FRAME_SIZE)
    numbers[:3] = np.array(part.place) + part.rotation[:, :2] @ middle
    numbers[3:12] = part.rotation.ravel()
    if basin.deep:
        numbers[REST_LEVEL] = part.level
        numbers[REST_SURFACE] = draft.to_plane(np.maximum(basin.bed - part.level, 0.0))
    else:
        sides = lines if basin.is_grid else side_positions(basin) - middle[:, None]
        face_count = sides[0].size * grid.ny + grid.nx * sides[1].size if basin.is_grid else sides[0].size
        numbers[POTENTIALS], places = draft.to_work(basin.n + face_count), [*places, *sides]
    numbers[CELL_POSITIONS] = draft.to_plane(np.concatenate(places))
    row["body"], row["frame"] = draft.body_names.index(part.on), draft.to_plane(numbers)
    joint_probes = joint_load_probes(draft.case)
    row["loads_body"] = any(joint_probes) or any(free_joints(part.on, draft.case.nodes))
    chain = set(carriers(part.on, draft.case.nodes))
    for k, body in joint_probes:
        if basin.opening is not None and body in chain:
            text = f"{body} carries {basin.name}: the joint load omits the flow through {basin.name}.{basin.opening}"
            remedy = "Leave out the probe of the joint load, or make that patch a wall"
            draft.fault(f"output.probes[{k}]", f"{text}. {remedy}")


def joint_load_probes(case) -> list[tuple[int, str]]:
    """(number of the probe, name of the body) of each probe of a joint load in a case."""
    probes = enumerate(case.probes)
    return [(k, probe.name) for k, probe in probes if probe.part == "nodes" and probe.quantity.startswith("joint_")]


def side_positions(basin) -> np.ndarray:
    """Middles of the sides of cells, in the order of `cell_sides` : float64[2, sides] [m].

    Both cells of a face have equal positions of their sides.
    """
    count = int(blocks(basin.integers) * basin.integers[0] * BLOCK)
    face = basin.integers[-count:]
    return basin.mesh.middle[np.where(face >= 0, face, ~face)].T


def position_in_frame(draft, basin, patch: str) -> list[float]:
    """[x, y, z, g times depth at rest] of a patch of a basin on a body.

    x, y : position from the middle of the basin, in axes of the basin [m]; z : height above the level at rest [m]
    """
    place, part = draft.case.places[f"{basin.name}.{patch}"], basin.part
    own = part.rotation.T @ (np.array(place.at) - np.array(part.place))
    return [*(own[:2] - basin.mesh.centroid).tolist(), float(own[2]) - part.level, draft.case.gravity * place.depth]


def potential_at_start(basin) -> np.ndarray:
    """Gravity potential of cells, relative to that at the middle of their basin : float64[n] [J/kg].

    It is computed for the attitude of the body at the start.
    """
    pose, gravity = basin.case.poses[basin.part.on], basin.case.gravity
    up = (pose.attitude @ basin.part.rotation).T @ np.array([0.0, 0.0, gravity])
    return (basin.mesh.centre - basin.mesh.centroid) @ up[:2]


def level_at_start(basin, attitude: np.ndarray | None = None) -> np.ndarray:
    """Depth of the water in cells of a basin on a body, with a horizontal surface : float64[n] [m].

    The volume is that of the water at rest.
    attitude : rotation matrix of the body, None for that at the start
    """
    part, turn = basin.part, basin.case.poses[basin.part.on].attitude if attitude is None else attitude
    down = (turn @ part.rotation).T @ np.array([0.0, 0.0, -1.0])
    drawn, tilt = basin.bed - part.level, (down[0] * basin.x + down[1] * basin.y) / down[2]
    if not np.ptp(drawn + tilt - drawn) > 0.0:
        return basin.depth
    volume = float(np.sum(basin.mesh.area * basin.depth))
    return np.maximum(level_over(drawn, tilt, basin.mesh.area, volume) - (drawn + tilt), 0.0)


def axes_in_world(basin, out: np.ndarray, layout) -> tuple[np.ndarray, np.ndarray]:
    """(origin [m], axes as columns) of a basin on a body, in axes of the world : float64[3], float64[3, 3].

    The origin is that of the coordinates of its mesh, not the middle of the basin.
    out, layout : output array of the right-hand side, and the places of its parts
    """
    from fvsolve.kernels.dtypes import BODY_OUT
    from fvsolve.kernels.mechanism.body_layout import ATTITUDE, POSITION

    first = int(layout["body"]) + BODY_OUT * int(basin.row["body"])
    place, turn = out[first + POSITION :][:3], out[first + ATTITUDE :][:9].reshape(3, 3)
    return place + turn @ np.array(basin.part.place), turn @ basin.part.rotation
