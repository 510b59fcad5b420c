"""Tables of a model for meshes, basins on bodies, and moving walls with the grid lines that move with them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fvsolve.case import moving_walls as case
from fvsolve.case.bodies import carriers, free_joints, level_over
from fvsolve.core.assembly.features import coordinate_of, frames_of
from fvsolve.features.basins import basin_frames as frame
from fvsolve.features.basins import cell_sides, moving_meshes
from fvsolve.features.basins import tables as records
from fvsolve.features.basins.cell_sides import BLOCK
from fvsolve.features.basins.moving_walls import VECTOR_MARGIN

if TYPE_CHECKING:
    from fvsolve.core.mesh import Mesh


def lower_mesh(mesh: Mesh, steepest: float = math.inf) -> tuple[np.ndarray, np.ndarray]:
    """(float64[:] floats, int64[:] integers) with geometry and neighbours of the cells of a mesh, see `cell_sides`.

    Cells and faces keep their numbers. steepest : see `cell_sides.gradient_share`
    """
    n = len(mesh.area)
    f = len(mesh.left)
    inner = mesh.inner
    slots, face, own, side = sides_of_cells(mesh)
    block = own // BLOCK
    lane = own % BLOCK
    count = -(-n // BLOCK)
    slot, at = (4 * block + side) * BLOCK + lane, (slots * block + side) * BLOCK + lane
    # the side beyond, or itself
    other = np.concatenate([f + np.arange(inner), np.arange(inner, f), np.arange(inner)])
    step = np.abs(block[other] - block)
    ring = 1 << int(3 * step.max()).bit_length()
    need = np.zeros(count, np.int64)
    np.maximum.at(need, block, block[other] + 1)
    indices = np.zeros((cell_sides.INDICES, count * slots * BLOCK), np.int64)
    k, i = np.divmod(np.arange(indices.shape[1]), BLOCK)
    j, k = np.divmod(k, slots)
    indices[cell_sides.CELL] = (j % ring) * BLOCK + i  # missing side of a cell: the cell itself
    indices[cell_sides.SIDE] = (4 * (j % ring) + k) * BLOCK + i
    indices[:, at] = indices[:, at[other]]
    face_of = np.full(indices.shape[1], ~0)
    face_of[at] = face
    measures = np.zeros((cell_sides.MEASURES + cell_sides.DISTANCES, indices.shape[1]))
    measures[cell_sides.NX] = 1.0
    measures[:, at] = _measures(mesh, face, own, n, steepest)
    rank = np.argsort(slot[inner:f])
    measures, distances = np.split(measures, [cell_sides.MEASURES])
    floats = [
        _by_block(measures),
        mesh.normal[inner + rank].T.ravel(),
        mesh.length,
        _by_block(distances),
    ]
    need = np.maximum.accumulate(need)
    places = _by_block(indices).astype(np.int32).view(np.int64)
    integers = [[slots, n, f, f - inner, ring], places, need, slot[inner + rank], rank, face_of]
    return np.concatenate(floats), np.concatenate(integers).astype(np.int64)


def lower_ends(mesh: Mesh, moves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(blocks : int64[blocks], ends : int64[:]): blocks of cells that move, and corners of cells and of their sides.

    A block has the value 1 if a corner of its cells or of cells next to these moves, else 0.
    For the order in `ends` see `moving_meshes`. moves : bool[corners]  True if a corner moves
    """
    n, inner = len(mesh.area), mesh.inner
    slots, face, own, side = sides_of_cells(mesh)
    at, count = (slots * (own // BLOCK) + side) * BLOCK + own % BLOCK, -(-n // BLOCK)
    number, left = np.where(face >= 0, face, ~face), face >= 0
    ends = np.zeros((moving_meshes.ENDS, count * slots * BLOCK), np.int64)
    ends[:, at] = [
        mesh.ends[number, np.where(left, 0, 1)],
        mesh.ends[number, np.where(left, 1, 0)],
        np.maximum(np.where(left, mesh.right[number], mesh.left[number]), -1),
    ]
    corners = np.where(mesh.cells < 0, mesh.cells[:, :1], mesh.cells)
    has_moving_corner = moves[corners].any(axis=1)
    is_affected = has_moving_corner.copy()
    np.logical_or.at(is_affected, mesh.left[:inner], has_moving_corner[mesh.right[:inner]])
    np.logical_or.at(is_affected, mesh.right[:inner], has_moving_corner[mesh.left[:inner]])
    moving_blocks = np.bincount(np.arange(n) // BLOCK, is_affected, count) > 0.0
    pairs = [table.ravel().astype(np.int32).view(np.int64) for table in (corners, _by_block(ends))]
    return moving_blocks.astype(np.int64), np.concatenate(pairs)


def sides_of_cells(mesh: Mesh) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
    """(slots, face, own, side): 3 or 4 sides per cell, then for each side its face, its cell, its number in the cell.

    The entry of `face` is ~f where the cell is to the right of face f.
    """
    n = len(mesh.area)
    f = len(mesh.left)
    inner = mesh.inner
    slots = 4 if (mesh.cells[:, 3] >= 0).any() else 3
    # ~f where the cell is on the right of it
    face = np.concatenate([np.arange(f), ~np.arange(inner)])
    own = np.concatenate([mesh.left, mesh.right[:inner]])
    normal = np.where(face[:, None] >= 0, 1.0, -1.0) * mesh.normal[np.where(face >= 0, face, ~face)]
    # angle of the outward normal plus pi: sides of rectangles in the order west, south, east, north
    direction = np.round(np.arctan2(-normal[:, 1], -normal[:, 0]), 9) % round(2.0 * np.pi, 9)
    sort = np.lexsort((direction, own))
    first = np.concatenate([[0], np.cumsum(np.bincount(own, minlength=n))[:-1]])
    side = np.empty(own.size, np.int64)
    side[sort] = np.arange(own.size) - first[own[sort]]
    return slots, face, own, side


def _by_block(table: np.ndarray) -> np.ndarray:
    """Flatten a table to the order in memory of `cell_sides`: by block, side number, row of the table, cell.

    table : [rows, sides], its sides ordered by block, side number and cell, with BLOCK cells in every block
    """
    return table.reshape(len(table), -1, BLOCK).swapaxes(0, 1).ravel()


def _measures(mesh: Mesh, face: np.ndarray, own: np.ndarray, n: int, steepest: float) -> np.ndarray:
    """Measures of every side : float64[MEASURES + DISTANCES, sides], see `cell_sides`.

    face, own : face (~f if the cell is to its right) and cell of each side; n : number of cells; steepest : see above
    """
    number = np.where(face >= 0, face, ~face)
    normal = np.where(face[:, None] >= 0, 1.0, -1.0) * mesh.normal[number]
    to_side = mesh.middle[number] - mesh.centre[own]
    beyond = np.where(face >= 0, mesh.right[number], mesh.left[number])
    across = 2.0 * np.sum(to_side * normal, axis=1, keepdims=True) * normal  # to the mirror image
    across = np.where(beyond[:, None] >= 0, mesh.centre[beyond] - mesh.centre[own], across)
    weight = 1.0 / np.sum(across**2, axis=1)

    def sums(factors: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        terms = factors[:, None, None] * vectors[:, :, None] * vectors[:, None, :]
        return np.array([[np.bincount(own, terms[:, a, b], n) for a in (0, 1)] for b in (0, 1)])

    square = sums(weight, across)
    share_of = np.ones(n)
    if steepest < math.inf:
        around, weighted = sums(np.ones(own.size), to_side), sums(weight**2, across)
        share_of = _gradient_shares(around.T, square.T, weighted.T, steepest)
    (xx, xy), (_, yy) = square[:, :, own]
    scale = share_of[own] * weight / (xx * yy - xy * xy)
    slope = (
        scale * (yy * across[:, 0] - xy * across[:, 1]),
        scale * (xx * across[:, 1] - xy * across[:, 0]),
    )
    gap = 1.0 / np.sum(across * normal, axis=1)
    offset = normal - across * gap[:, None]
    share = 1.0 / mesh.area[own]
    return np.stack(
        [*normal.T, mesh.length[number] * share, *to_side.T, *slope, share, gap, *offset.T]
    )


def _gradient_shares(
    sides: np.ndarray, squares: np.ndarray, weighted: np.ndarray, steepest: float
) -> np.ndarray:
    """Factors on the gradients of cells, see `cell_sides.gradient_share` : float64[n]. Matrices : float64[n, 2, 2]"""
    inverse = np.linalg.inv(squares)
    largest = np.linalg.eigvals(sides @ inverse @ weighted @ inverse).real.max(axis=1)
    return np.minimum(1.0, steepest / np.sqrt(largest))


TRAVEL_SCALE = 1e-2  # a small travel [m]


def lower_frame(draft, basin, row) -> None:
    """Reserve entries for the frame of a basin on a body; store its place, rotation, positions and undisturbed surface.

    A liquid has no surface; it has potentials, and positions of grid lines or of sides of cells, instead. If an open
    patch prevents the correct load at an observed joint, a fault is added to the draft.
    The axes of the kernels have their origin in the middle of the basin. Accelerations along the normal are those at
    this point, and the mirror cells at walls neglect the Euler force beyond the wall. With this origin the error is
    least, and does not depend on the origin of the coordinates of the mesh.
    """
    part = basin.part
    grid = basin.mesh.grid
    middle = basin.mesh.centroid
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
        face_count = (
            lines[0].size * grid.ny + grid.nx * lines[1].size if basin.is_grid else lines[0].size
        )
        numbers[frame.POTENTIALS], places = draft.to_work(basin.n + face_count), [*places, *lines]
    numbers[frame.CELL_POSITIONS] = draft.to_plane(np.concatenate(places))
    row["body"], row["frame"] = frames_of(draft).index(part.on), draft.to_plane(numbers)
    numbered = enumerate(draft.case.probes)
    loads = [
        (k, p.name) for k, p in numbered if p.part == "nodes" and p.quantity.startswith("joint_")
    ]
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
    return [
        *(own[:2] - basin.mesh.centroid).tolist(),
        float(own[2]) - part.level,
        draft.case.gravity * place.depth,
    ]


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
    part = basin.part
    turn = basin.case.poses[basin.part.on].attitude if attitude is None else attitude
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
    from fvsolve.core.kernels.dtypes import BODY_OUT
    from fvsolve.core.kernels.moving_frames import ATTITUDE, POSITION

    first = int(layout["body"]) + BODY_OUT * int(basin.row["body"])
    place, turn = out[first + POSITION :][:3], out[first + ATTITUDE :][:9].reshape(3, 3)
    return place + turn @ np.array(basin.part.place), turn @ basin.part.rotation


def lower_walls(draft, own) -> None:
    """Fill the table of moving walls of a draft of a model, and add states for their travels."""
    parts = [(basin, patch) for basin in draft.meshed for patch in basin.walls]
    own.walls = own.pushes_at_rest = np.zeros(len(parts), records.WALL)
    own.wall_names = [f"{basin.name}.{patch}" for basin, patch in parts]
    for row, (basin, patch) in zip(own.walls, parts, strict=True):
        stated, (axis, side) = basin.part.patches[patch], case.outward(basin.mesh, patch)
        row["basin"], row["outward"] = draft.meshed.index(basin), side
        row["node"] = draft.node_index[f"{basin.name}.{patch}"]
        row["y"] = draft.states([f"{basin.name}.{patch}.travel"], TRAVEL_SCALE)
        row["mass"] = row["body"] = row["rate"] = -1
        row["toward"] = 1.0
        row["schedule"] = draft.schedules.add(stated.travel) if stated.travel is not None else -1
        if stated.body is not None:
            moved = coordinate_of(draft, stated.body)
            row["mass"], row["body"], row["rate"], row["speed"] = (
                moved.net,
                moved.frame,
                moved.rate,
                moved.velocity,
            )
            row["inertia"], row["lightness"], row["schedule"] = (
                moved.inertia,
                moved.lightness,
                moved.schedule,
            )
        if row["body"] >= 0:
            row["toward"] = np.sign(case.slide_direction(draft.case.nodes[stated.body])[axis])
        corner_weights = case.weights(basin.part, basin.mesh, patch, basin.mesh.points[:, axis])
        line_weights = corner_weights
        stretch_per_travel = case.area_growth(basin.mesh, axis, corner_weights)
        per_cell = stretch_per_travel
        if basin.is_grid:
            grid, lines = basin.mesh.grid, (basin.mesh.grid.x, basin.mesh.grid.y)[axis]
            line_weights = case.weights(basin.part, basin.mesh, patch, lines)
            stretch_per_travel = np.diff(line_weights) / np.diff(lines)
            per_cell = (
                np.repeat(stretch_per_travel, grid.nx)
                if axis == 1
                else np.tile(stretch_per_travel, grid.ny)
            )
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
    for k, basin in enumerate(draft.meshed):
        faces_of_wall = np.flatnonzero(own.walls["basin"] == k)
        basin.row["walls"], basin.row["wall"] = (
            faces_of_wall.size,
            faces_of_wall[0] if faces_of_wall.size else 0,
        )


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
    row["stretch"] = draft.to_plane(
        np.concatenate([np.ones(2 * drawn.size), drawn, np.ones(2 * mesh.grid.nx)])
    )
    row["lines"] = draft.to_plane(np.zeros(drawn.size + 1 + VECTOR_MARGIN))


def lower_corners(draft, basin, row, axis: int) -> None:
    """Reserve space in `plane` and `integers` for the moving corners of a mesh other than a grid.

    axis : axis of the motion, 0 for x and 1 for y
    """
    mesh, (x, y) = basin.mesh, basin.mesh.points.T
    row["corners"], row["stretch"] = x.size, draft.to_plane(np.ones(2 * basin.n))
    row["lines"] = draft.to_plane(np.zeros(x.size))
    scratch = np.zeros(moving_meshes.SCRATCH)
    row["places"] = draft.to_plane(
        np.concatenate([x, y, mesh.points[:, axis], *mesh.centre.T, scratch])
    )
    moves = (
        sum(case.weights(basin.part, mesh, patch, mesh.points[:, axis]) for patch in basin.walls)
        > 0.0
    )
    moving_blocks, pairs = lower_ends(mesh, moves)
    row["sides"] = draft.to_plane(np.zeros(4 * cell_sides.BLOCK * moving_blocks.size))
    row["ends"] = len(draft.integers)
    draft.integers += [moving_blocks.size, *moving_blocks.tolist(), *pairs.tolist()]
