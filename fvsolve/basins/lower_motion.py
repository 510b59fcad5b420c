"""Tables of a model for basins on bodies, and for moving walls with the grid lines that move with them."""

from __future__ import annotations

import numpy as np

from fvsolve.basins import basin_frames as frame
from fvsolve.basins import cell_sides, moving_meshes
from fvsolve.basins.lower_mesh import lower_ends
from fvsolve.basins.moving_walls import VECTOR_MARGIN
from fvsolve.case import basins as case
from fvsolve.case.bodies import carriers, free_joints, level_over
from fvsolve.kernels import dtypes as rec

TRAVEL_SCALE = 1e-2  # a small travel [m]


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
    numbers = np.zeros(frame.FRAME_SIZE)
    numbers[:3] = np.array(part.place) + part.rotation[:, :2] @ middle
    numbers[3:12] = part.rotation.ravel()
    if basin.deep:
        numbers[frame.REST_LEVEL] = part.level
        numbers[frame.REST_SURFACE] = draft.to_plane(np.maximum(basin.bed - part.level, 0.0))
    else:
        if not basin.is_grid:  # middles of the sides of cells, in the order of `cell_sides`
            count = int(cell_sides.blocks(basin.integers) * basin.integers[0] * cell_sides.BLOCK)
            face = basin.integers[-count:]
            lines = basin.mesh.middle[np.where(face >= 0, face, ~face)].T - middle[:, None]
        face_count = lines[0].size * grid.ny + grid.nx * lines[1].size if basin.is_grid else lines[0].size
        numbers[frame.POTENTIALS], places = draft.to_work(basin.n + face_count), [*places, *lines]
    numbers[frame.CELL_POSITIONS] = draft.to_plane(np.concatenate(places))
    row["body"], row["frame"] = draft.body_names.index(part.on), draft.to_plane(numbers)
    numbered = enumerate(draft.case.probes)
    loads = [(k, p.name) for k, p in numbered if p.part == "nodes" and p.quantity.startswith("joint_")]
    row["loads_body"] = any(loads) or any(free_joints(part.on, draft.case.nodes))
    chain = set(carriers(part.on, draft.case.nodes))
    for k, body in loads:
        if basin.opening is not None and body in chain:
            text = f"{body} carries {basin.name}: the joint load omits the flow through {basin.name}.{basin.opening}"
            remedy = "Leave out the probe of the joint load, or make that patch a wall"
            draft.fault(f"output.probes[{k}]", f"{text}. {remedy}")


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


def lower_walls(draft) -> None:
    """Fill the table of moving walls of a draft of a model, and add states for their travels."""
    parts = [(basin, patch) for basin in draft.basins for patch in basin.walls]
    draft.wall_table, draft.wall_names = np.zeros(len(parts), rec.WALL), [f"{b.name}.{patch}" for b, patch in parts]
    for row, (basin, patch) in zip(draft.wall_table, parts, strict=True):
        stated, (axis, side) = basin.part.patches[patch], case.outward(basin.mesh, patch)
        row["basin"], row["outward"] = draft.basins.index(basin), side
        row["node"] = draft.node_index[f"{basin.name}.{patch}"]
        row["y"] = draft.states([f"{basin.name}.{patch}.travel"], TRAVEL_SCALE)
        row["mass"] = draft.mass_index.get(stated.body, -1) if stated.body is not None else -1
        row["body"] = draft.body_names.index(stated.body) if stated.body in draft.body_names else -1
        if row["body"] >= 0:
            row["toward"] = np.sign(case.slide_direction(draft.case.nodes[stated.body])[axis])
        row["schedule"] = draft.schedules.add(stated.travel) if stated.travel is not None else -1
        corner_weights = case.weights(basin.part, basin.mesh, patch, basin.mesh.points[:, axis])
        line_weights, stretch_per_travel = corner_weights, case.area_growth(basin.mesh, axis, corner_weights)
        per_cell = stretch_per_travel
        if basin.is_grid:
            grid, lines = basin.mesh.grid, (basin.mesh.grid.x, basin.mesh.grid.y)[axis]
            line_weights = case.weights(basin.part, basin.mesh, patch, lines)
            stretch_per_travel = np.diff(line_weights) / np.diff(lines)
            per_cell = np.repeat(stretch_per_travel, grid.nx) if axis == 1 else np.tile(stretch_per_travel, grid.ny)
        basin.stretches.append((int(row["y"]), per_cell, np.outer(corner_weights, np.eye(2)[axis])))
        row["weights"] = draft.to_plane(np.concatenate([line_weights, stretch_per_travel]))
        faces_of_wall = np.arange(basin.mesh.left.size)[basin.mesh.patch(patch)]
        length, wall_cells = basin.mesh.length[faces_of_wall], basin.mesh.left[faces_of_wall]
        row["faces"], row["count"] = len(draft.integers), faces_of_wall.size
        numbers = faces_of_wall - basin.mesh.inner
        numbers = np.argsort(basin.ring())[numbers] if basin.is_grid else numbers
        draft.integers += [*numbers.tolist(), *wall_cells.tolist()]
        row["lengths"] = draft.to_plane(length)
        row["rest"] = float(np.sum(length * basin.thrust_at_rest()[wall_cells]))
    for k, basin in enumerate(draft.basins):
        faces_of_wall = np.flatnonzero(draft.wall_table["basin"] == k)
        basin.row["walls"], basin.row["wall"] = faces_of_wall.size, faces_of_wall[0] if faces_of_wall.size else 0


def lower_lines(draft, basin, row) -> None:
    """Reserve space in `plane` for speeds of moving lines, present areas and stretching of the cells of a basin.

    Space in `work` is reserved for the forces on boundary faces.
    """
    mesh, axis = basin.mesh, case.axis_of(basin.part, basin.mesh)
    row["turn"], row["area"] = axis, draft.to_plane(mesh.area)
    row["thrust"] = draft.to_work(2 * row["outer"])
    if not basin.is_grid:
        lower_corners(draft, basin, row, axis)
        return
    drawn = 1.0 / np.diff((mesh.grid.x, mesh.grid.y)[axis])
    row["stretch"] = draft.to_plane(np.concatenate([np.ones(2 * drawn.size), drawn, np.ones(2 * mesh.grid.nx)]))
    row["lines"] = draft.to_plane(np.zeros(drawn.size + 1 + VECTOR_MARGIN))


def lower_corners(draft, basin, row, axis: int) -> None:
    """Reserve space in `plane` and `integers` for the moving corners of a mesh other than a grid.

    axis : axis of the motion, 0 for x and 1 for y
    """
    mesh, (x, y) = basin.mesh, basin.mesh.points.T
    row["corners"], row["stretch"] = x.size, draft.to_plane(np.ones(2 * basin.n))
    row["lines"] = draft.to_plane(np.zeros(x.size))
    scratch = np.zeros(moving_meshes.SCRATCH)
    row["places"] = draft.to_plane(np.concatenate([x, y, mesh.points[:, axis], *mesh.centre.T, scratch]))
    moves = sum(case.weights(basin.part, mesh, patch, mesh.points[:, axis]) for patch in basin.walls) > 0.0
    moving_blocks, pairs = lower_ends(mesh, moves)
    row["sides"] = draft.to_plane(np.zeros(4 * cell_sides.BLOCK * moving_blocks.size))
    row["ends"] = len(draft.integers)
    draft.integers += [moving_blocks.size, *moving_blocks.tolist(), *pairs.tolist()]
