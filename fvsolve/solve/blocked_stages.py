"""Division of the stage sums of a Runge-Kutta step into blocks of basin rows that fit into the processor cache."""

from __future__ import annotations

import numpy as np

from fvsolve.basins.boundary_cells import BAND_MARGIN
from fvsolve.kernels import stage_sums
from fvsolve.solve.partition import Partition, common_cells, quantities

BLOCK = 4096  # cells of a block: their arrays and the work arrays of the rates fit into a second-level cache
LEAST_STATES = 2**17  # least number of states of a basin: smaller basins stay in the second-level cache during a step


def blocked_sums(cut: Partition, k: int) -> np.ndarray:
    """Table `sums` of `kernels.stage_sums` for band k : int64[n]; empty if no basin uses blocks.

    A basin uses blocks if it has at least 2^17 states and `forms_stages` is True.
    """
    model = cut.model
    blocked_basins = [
        b
        for b in cut.basins
        if model.basins[b].forms_stages and quantities(model, b) * model.basins[b].n >= LEAST_STATES
    ]
    if not blocked_basins:
        return np.zeros(0, dtype=np.int64)
    others, common_cells, edges = list(cut.common_states()), [], []
    for rows, b in zip(cut.firsts, cut.basins, strict=True):
        first, stop = (int(row) for row in rows[k : k + 2])
        for q in range(quantities(model, b)):
            if b not in blocked_basins:
                others.append(rows_at(model, b, q, first, stop))
                continue
            edges.append(rows_at(model, b, q, first, min(first + BAND_MARGIN, stop)))
            edges.append(rows_at(model, b, q, max(stop - BAND_MARGIN, first), stop))
            common_cells += cells_at(model, b, q, first, stop)
    head = np.zeros(stage_sums.HEAD + len(model.basins), dtype=np.int64)
    head[[stage_sums.OTHERS, stage_sums.CHECKED, stage_sums.EDGES]] = len(others), len(common_cells), len(edges)
    head[stage_sums.BASINS], head[stage_sums.CELLS] = len(model.basins), BLOCK
    head[[stage_sums.HEAD + b for b in blocked_basins]] = 1
    return np.concatenate([head, np.array([*others, *common_cells, *edges], dtype=np.int64).ravel()])


def rows_at(model, b: int, q: int, first: int, stop: int) -> tuple[int, int]:
    """(first state, last state + 1) of the rows from `first` to `stop` - 1 of quantity q of basin b."""
    basin = model.tables.basins[b]
    at, nx = int(basin["y"] + q * basin["n"]), int(basin["nx"])
    return at + nx * first, at + nx * stop


def cells_at(model, b: int, q: int, first: int, stop: int) -> list[tuple[int, int]]:
    """Ranges (first, last + 1) of states of cells that all bands read, within the rows from `first` to `stop` - 1.

    b : number of the basin; q : number of the quantity
    """
    begin, end = rows_at(model, b, q, first, stop)
    at = begin - int(model.tables.basins[b]["nx"]) * first
    cells = at + np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *common_cells(model, b)]))
    cells = cells[(cells >= begin) & (cells < end)]
    if not cells.size:
        return []
    new = np.flatnonzero(np.diff(cells) != 1) + 1
    return [(int(cell_run[0]), int(cell_run[-1]) + 1) for cell_run in np.split(cells, new)]
