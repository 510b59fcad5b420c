"""Facts about basins, for `fvsolve check`."""

from typing import Any

import numpy as np

from fvsolve.case.basins import boundary_cells, patch_names


def basin_facts(basin) -> dict[str, Any]:
    """Facts about a basin: mesh, waves at the start, walls and sections, and patches.

    Facts of a patch are the length of its faces, and the area of the cells behind them.
    """
    mesh, patches = basin.mesh, {}
    for name in patch_names(mesh):
        faces, part = mesh.faces(name).index, basin.part.patches.get(name)
        patches[name] = {
            "faces": faces.size,
            "length": float(mesh.length[faces].sum()),
            "area": float(mesh.area[boundary_cells(mesh, name)].sum()),
            "reflects": 1.0 if part is None else basin.reflection(part),
        }
    return {
        "physics": basin.part.physics,
        "cells": basin.n,
        "path": "grid" if basin.is_grid else "faces",
        "area": float(mesh.area.sum()),
        "least_width": float(np.sqrt(mesh.area.min())),
        **{key: list(limits) for key, limits in basin.ranges().items()},
        "memory": basin.memory,
        "patches": patches,
        "chains": basin.chain_texts(),
    }
