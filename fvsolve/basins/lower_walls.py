"""Tables of a model for moving walls of basins: grid lines that move, faces of walls, bodies that move walls."""

from __future__ import annotations

import numpy as np

from fvsolve.basins import cell_sides, moving_meshes
from fvsolve.basins.lower_mesh import lower_ends
from fvsolve.basins.moving_walls import VECTOR_MARGIN
from fvsolve.case import moving_wall_checks as case
from fvsolve.kernels import dtypes as rec

TRAVEL_SCALE = 1e-2  # a small travel [m]


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
        draft.integers += [
            *(np.argsort(basin.ring())[numbers] if basin.is_grid else numbers).tolist(),
            *wall_cells.tolist(),
        ]
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
