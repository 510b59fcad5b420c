"""Walls of basins that move as rows of tables: lines that go with them, faces, bodies. Knows names; knows no law."""

from __future__ import annotations

import numpy as np

from fvsolve.basins import faces, moving_meshes
from fvsolve.basins.lower_mesh import lower_ends
from fvsolve.basins.walls import BESIDE
from fvsolve.case import walls as case
from fvsolve.kernels import records as rec

SCALE = 1e-2  # a small travel [m]


def lower_walls(draft) -> None:
    """Fill the table of walls, and states for where they stand."""
    parts = [(basin, patch) for basin in draft.basins for patch in basin.walls]
    draft.wall_table, draft.wall_names = np.zeros(len(parts), rec.WALL), [f"{b.name}.{patch}" for b, patch in parts]
    for row, (basin, patch) in zip(draft.wall_table, parts, strict=True):
        one, (axis, side) = basin.part.patches[patch], case.outward(basin.mesh, patch)
        row["basin"], row["outward"] = draft.basins.index(basin), side
        row["node"] = draft.node_index[f"{basin.name}.{patch}"]
        row["y"] = draft.states([f"{basin.name}.{patch}.travel"], SCALE)
        row["mass"] = draft.mass_index.get(one.body, -1) if one.body is not None else -1
        row["body"] = draft.body_names.index(one.body) if one.body in draft.body_names else -1
        if row["body"] >= 0:
            row["toward"] = np.sign(case.direction(draft.case.nodes[one.body])[axis])
        row["schedule"] = draft.schedules.add(one.travel) if one.travel is not None else -1
        with_it = case.weights(basin.part, basin.mesh, patch, basin.mesh.points[:, axis])
        goes, per = with_it, case.widened(basin.mesh, axis, with_it)
        per_cell = per
        if basin.is_grid:
            grid, lines = basin.mesh.grid, (basin.mesh.grid.x, basin.mesh.grid.y)[axis]
            goes = case.weights(basin.part, basin.mesh, patch, lines)
            per = np.diff(goes) / np.diff(lines)
            per_cell = np.repeat(per, grid.nx) if axis == 1 else np.tile(per, grid.ny)
        basin.stretches.append((int(row["y"]), per_cell, np.outer(with_it, np.eye(2)[axis])))
        row["weights"] = draft.to_plane(np.concatenate([goes, per]))
        own = np.arange(basin.mesh.left.size)[basin.mesh.patch(patch)]
        length, behind = basin.mesh.length[own], basin.mesh.left[own]
        row["faces"], row["count"] = len(draft.integers), own.size
        numbers = own - basin.mesh.inner
        draft.integers += [
            *(np.argsort(basin.ring())[numbers] if basin.is_grid else numbers).tolist(),
            *behind.tolist(),
        ]
        row["lengths"] = draft.to_plane(length)
        row["rest"] = float(np.sum(length * basin.thrust_at_rest()[behind]))
    for k, basin in enumerate(draft.basins):
        own = np.flatnonzero(draft.wall_table["basin"] == k)
        basin.row["walls"], basin.row["wall"] = own.size, own[0] if own.size else 0


def lower_lines(draft, basin, row) -> None:
    """Reserve what lines of a basin that move need in `plane`, beside what is drawn."""
    mesh, axis = basin.mesh, case.axis_of(basin.part, basin.mesh)
    row["turn"], row["area"] = axis, draft.to_plane(mesh.area)
    row["thrust"] = draft.to_work(2 * row["outer"])
    if not basin.is_grid:
        lower_corners(draft, basin, row, axis)
        return
    drawn = 1.0 / np.diff((mesh.grid.x, mesh.grid.y)[axis])
    row["stretch"] = draft.to_plane(np.concatenate([np.ones(2 * drawn.size), drawn, np.ones(2 * mesh.grid.nx)]))
    row["lines"] = draft.to_plane(np.zeros(drawn.size + 1 + BESIDE))


def lower_corners(draft, basin, row, axis: int) -> None:
    """The same of corners of a mesh of any cells."""
    mesh, (x, y) = basin.mesh, basin.mesh.points.T
    row["corners"], row["stretch"] = x.size, draft.to_plane(np.ones(2 * basin.n))
    row["lines"] = draft.to_plane(np.zeros(x.size))
    room = np.zeros(moving_meshes.ROOM)
    row["places"] = draft.to_plane(np.concatenate([x, y, mesh.points[:, axis], *mesh.centre.T, room]))
    goes = sum(case.weights(basin.part, mesh, patch, mesh.points[:, axis]) for patch in basin.walls) > 0.0
    stirs, pairs = lower_ends(mesh, goes)
    row["sides"] = draft.to_plane(np.zeros(4 * faces.BLOCK * stirs.size))
    row["ends"] = len(draft.integers)
    draft.integers += [stirs.size, *stirs.tolist(), *pairs.tolist()]
