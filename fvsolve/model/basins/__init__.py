"""Basins lowered to rows of tables: one module for each physics, loaded by scenes that have one."""

from __future__ import annotations

import numpy as np

from fvsolve.kernels import records as rec
from fvsolve.model.basins.place import PatchRows  # noqa: F401  (to be found among the kinds of places)


def lower_basins(draft) -> None:
    """Fill the tables of basins and their patches, and states for their cells."""
    draft.basins, draft.basin_table, draft.patch_table = [], np.zeros(0, rec.BASIN), np.zeros(0, rec.PATCHES)
    if draft.case.meshes:
        import fvsolve.basins.free_surface.lower
        import fvsolve.basins.liquid.lower
        import fvsolve.basins.transport.lower  # noqa: F401
        from fvsolve.model.basins.basin import lower

        lower(draft)


def at_start(basins: list, size: int) -> np.ndarray:
    """States at the start: no deviation from the profile but where basins start from one."""
    found = np.zeros(size)
    for basin in basins:
        basin.of(found)[:] = basin.start()
        if basin.scalars:
            basin.start_scalars(found)
    return found
