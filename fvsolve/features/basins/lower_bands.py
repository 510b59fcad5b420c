"""Rows of the cells of a basin, which threads share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from fvsolve.core.assembly.meshed_parts import MeshedPart
from fvsolve.core.kernels import dtypes as rec
from fvsolve.errors import listing
from fvsolve.features.basins import tables as records
from fvsolve.features.basins.boundary_cells import BAND_MARGIN
from fvsolve.features.basins.cell_sides import BLOCK, HEAD, INDICES

LEAST_CELLS_DIVIDED = 8 * BLOCK  # cells of a mesh below which threads do not share them


class BandedRows(MeshedPart):
    """Rows of a grid, or blocks of cells of another mesh (`cell_sides.BLOCK`), which are its rows."""

    banded: ClassVar[bool] = False  # True if threads can step bands of rows of a grid
    # True if threads can step bands of blocks of cells of another mesh
    banded_mesh: ClassVar[bool] = False
    margin: ClassVar[int] = BAND_MARGIN
    row: Any  # of the table of basins
    number: int  # of this row

    @property
    def undivided_reason(self) -> str:
        if not self.is_grid and (self.scalars or not self.banded_mesh):
            return "its mesh is not a full rectangle" + " and carries scalars" * (
                len(self.scalars) > 0
            )
        if not self.is_grid and self.n < LEAST_CELLS_DIVIDED:
            return (
                f"its mesh is not a full rectangle and has fewer than {LEAST_CELLS_DIVIDED} cells"
            )
        if self.moves:
            return "its walls move"
        if self.part.on is not None:
            return "it is on a body"
        if self.scalars and self.is_fifth_order:
            return f"its scalars use the scheme {self.scheme}"
        if self.scalars and self.opening is not None:
            return f"scalars flow through its open boundary {self.opening}"
        if decaying := [name for name in self.scalars if self.case.scalars[name].decay > 0.0]:
            return f"{listing(decaying)} {'decay' if len(decaying) > 1 else 'decays'}"
        if self.scalars and self.case.reactions:
            return "its scalars react"
        return (
            ""
            if self.banded
            else f"its physics {self.part.physics} cannot be distributed over threads"
        )

    @property
    def row_size(self) -> int:
        return int(self.row["nx"]) or BLOCK

    def row_text(self, count: int) -> str:
        ending = "s" * (count > 1)
        return f"{count} row{ending}" if self.is_grid else f"{count} block{ending} of {BLOCK} cells"

    @property
    def states_per_cell(self) -> int:
        return len(self.quantities) + len(self.scalars) + self.soil_states

    @property
    def first_state(self) -> int:
        return int(self.row["y"])

    def rows_read(self, first: int, stop: int) -> tuple[int, int]:
        if self.row["nx"] > 0:
            return max(first - BAND_MARGIN, 0), min(stop + BAND_MARGIN, self.row_count)
        slots, count = self.integers[0], -(-self.n // BLOCK)
        at = HEAD + INDICES * count * slots * BLOCK // 2
        # array `need` of `cell_sides`: rates read values at sides, and these read the cells next to them
        need = self.integers[at : at + count]
        sides = int(np.searchsorted(need, first, "right")), int(need[stop - 1])
        return int(np.searchsorted(need, sides[0], "right")), int(need[sides[1] - 1])

    def common_cells(self, tables) -> Iterator[np.ndarray]:
        from fvsolve.features.basins.lower_pattern import cells_at_faces  # loads scipy

        integers, number = tables.integers, self.number
        for patch in self.all_patches[self.all_patches["basin"] == number]:
            yield integers[patch["first"] : patch["first"] + patch["count"]]
            if patch["closure"] != records.NO_CLOSURE:
                yield cells_at_faces(integers, patch)
        probes = tables.probes
        for probe in probes[
            np.isin(probes["kind"], (rec.CELL_FIELD, rec.CELL_SCALAR)) & (probes["index"] == number)
        ]:
            yield integers[probe["cell"] : probe["cell"] + probe["count"]]

    def boundary_rows(self) -> tuple[int, np.ndarray]:
        nx, ny, at = (int(self.row[name]) for name in ("nx", "ny", "through"))
        if at < 0:
            return at, np.zeros(0, int)
        if nx > 0:
            return at, np.concatenate(
                [np.arange(ny), np.arange(ny), np.zeros(nx, int), np.full(nx, ny - 1)]
            )
        return at, self.mesh.left[self.mesh.inner :] // BLOCK

    def maxima_of_rows(self, first: int, stop: int) -> list[slice]:
        at, size = int(self.row["maxima"]), int(self.row["maxima_row"])
        if at < 0:
            return []
        if self.row["nx"] > 0:
            return [slice(at + size * first, at + size * stop)]
        begin, end = self.cells_of_rows(first, stop)  # a row of each quantity
        return [
            slice(at + q * self.n + begin, at + q * self.n + end) for q in range(size // self.n)
        ]

    def band(self, first: int, stop: int) -> tuple[int, int]:
        return (first, stop) if self.row["nx"] > 0 else self.cells_of_rows(first, stop)
