"""Walls of basins that move as rows of tables: lines that go with them, faces, bodies. Knows names; knows no law."""

from __future__ import annotations

import numpy as np

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
        row["mass"] = draft.mass_index[one.body] if one.body is not None else -1
        row["schedule"] = draft.schedules.add(one.travel) if one.travel is not None else -1
        lines = (basin.mesh.grid.x, basin.mesh.grid.y)[axis]
        goes = case.weights(basin.part, basin.mesh, patch, lines)
        per = np.diff(goes) / np.diff(lines)
        grid = basin.mesh.grid
        per_cell = np.repeat(per, grid.nx) if axis == 1 else np.tile(per, grid.ny)
        with_it = case.weights(basin.part, basin.mesh, patch, basin.mesh.points[:, axis])
        basin.stretches.append((int(row["y"]), per_cell, np.outer(with_it, np.eye(2)[axis])))
        row["weights"] = draft.to_plane(np.concatenate([goes, per]))
        faces = np.arange(basin.mesh.left.size)[basin.mesh.patch(patch)]
        length, behind = basin.mesh.length[faces], basin.mesh.left[faces]
        row["faces"], row["count"] = len(draft.integers), faces.size
        draft.integers += [*np.argsort(basin.ring())[faces - basin.mesh.inner].tolist(), *behind.tolist()]
        row["lengths"] = draft.to_plane(length)
        row["rest"] = float(np.sum(length * basin.thrust_at_rest()[behind]))
    for k, basin in enumerate(draft.basins):
        own = np.flatnonzero(draft.wall_table["basin"] == k)
        basin.row["walls"], basin.row["wall"] = own.size, own[0] if own.size else 0


def lower_lines(draft, basin, row) -> None:
    """Reserve what lines of a basin that move need in `plane`, beside what is drawn."""
    grid, axis = basin.mesh.grid, case.axis_of(basin.part, basin.mesh)
    drawn = 1.0 / np.diff((grid.x, grid.y)[axis])
    row["turn"], row["area"] = axis, draft.to_plane(basin.mesh.area)
    row["stretch"] = draft.to_plane(np.concatenate([np.ones(drawn.size), drawn]))
    row["lines"] = draft.to_plane(np.zeros(drawn.size + 1 + BESIDE))
    row["thrust"] = draft.to_work(2 * (grid.nx + grid.ny))
