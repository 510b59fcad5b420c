"""Basins lowered to rows of tables: states of their cells, what is fixed in them, the cells behind their patches."""

from __future__ import annotations

import numpy as np

from fvsolve.kernels import records as rec
from fvsolve.kernels.plane import shallow
from fvsolve.kernels.plane.basin import NO_SLOPE
from fvsolve.kernels.plane.shallow_rows import THIN

LIMITERS = {"minmod": rec.MINMOD, "van-leer": rec.VAN_LEER}


def basins_of(case) -> dict:
    """Basins of a case by name."""
    return {name: node for name, node in case.nodes.items() if node.kind == "basin"}


def behind_dam(basin) -> np.ndarray:
    """What the start has more of depth than the lake at `level` [m], cell by cell."""
    bed = basin.bed_at(np.arange(basin.cells[0] * basin.cells[1]))
    level = np.full(bed.size, basin.level)
    if basin.dam is not None:
        level[basin.centres()[0] > basin.dam.x] = basin.dam.level
    return np.maximum(level - bed, 0.0) - np.maximum(basin.level - bed, 0.0)


def basin_fields(model, basin, row, y: np.ndarray) -> dict[str, np.ndarray]:
    """Depth, surface, velocities and bed of a basin's cells, SI."""
    n = int(row["nx"] * row["ny"])
    o, at, plane = int(row["y"]), int(row["plan"]), model.tables[rec.I_PLANE]
    depth = np.maximum(plane[at : at + n] + y[o : o + n], 0.0)
    bed = basin.bed_at(np.arange(n)) + (basin.elevation or 0.0)
    wet = np.maximum(depth, THIN)
    share = 2.0 * depth / (depth * depth + wet * wet)
    velocity = np.column_stack([share * y[o + n : o + 2 * n], share * y[o + 2 * n : o + 3 * n], np.zeros(n)])
    return {"depth": depth, "bed": bed, "surface": bed + depth, "velocity": velocity}


def lower_basins(scene) -> None:
    """Fill the tables of basins and their patches, and states for their cells."""
    basins = basins_of(scene.case)
    scene.basin_table, scene.plane = np.zeros(len(basins), rec.BASIN), np.zeros(0)
    patches = [(name, place) for name, place in scene.case.places.items() if place.kind == "patch"]
    scene.patch_table = np.zeros(len(patches), rec.PATCHES)
    numerics, pieces, at = scene.case.numerics, [], 0
    for row, (name, basin) in zip(scene.basin_table, basins.items(), strict=True):
        (nx, ny), (wide, deep) = basin.cells, basin.size
        n = nx * ny
        row["nx"], row["ny"], row["dx"], row["dy"] = nx, ny, wide / nx, deep / ny
        row["limiter"] = LIMITERS.get(numerics.limiter, 2) if numerics.scheme != "upwind" else NO_SLOPE
        bed = basin.bed_at(np.arange(n)) - basin.level
        plan = np.zeros((shallow.PLANS, n))
        plan[0], plan[1] = np.maximum(-bed, 0.0), np.maximum(bed, 0.0)
        lengths = np.concatenate([np.full(nx, nx / wide), np.full(ny, ny / deep)])
        work = np.concatenate([lengths, np.zeros(shallow.WORK)])
        names = [f"{name}.{what}[{i}]" for what in ("depth", "flow_x", "flow_y") for i in range(n)]
        row["y"] = scene.states(names[:n], 0.1)
        scene.states(names[n:], 0.1 * np.sqrt(scene.case.gravity * 0.1))
        row["plan"], row["work"] = at, at + plan.size
        pieces += [plan.ravel(), work]
        at += plan.size + work.size
    if pieces:
        scene.plane = np.concatenate(pieces)
    for row, (name, place) in zip(scene.patch_table, patches, strict=True):
        cells = basins[place.basin].span_of(place.patch)
        row["basin"], row["node"] = list(basins).index(place.basin), scene.node_index[name]
        row["first"], row["count"] = len(scene.integers), len(cells)
        scene.integers += [int(cell) for cell in cells]
