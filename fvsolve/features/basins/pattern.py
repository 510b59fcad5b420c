"""States on which basins depend, for the sparsity pattern of the Jacobian."""

from collections.abc import Callable, Iterator

import numpy as np

from fvsolve.core.assembly.features import FeaturePattern
from fvsolve.core.model.jacobian_pattern import Pairs
from fvsolve.core.model.state_pairs import pairs_of, unique_states
from fvsolve.features.basins import lower_pattern as pattern
from fvsolve.features.basins import tables as records
from fvsolve.features.scalars.own_tables import scalar_tables


class BasinPattern(FeaturePattern):
    """Couplings of the cells of basins. of : `Couplings` of the model

    Cells depend on the cells around them (`lower_pattern`). A patch is a node whose pressure the cells behind it set.
    """

    def __init__(self, feature, couplings) -> None:
        super().__init__(feature)
        self.of, self.basins = couplings, feature.meshed
        self.integers, self.walls = couplings.model.tables.integers, feature.walls
        self.scalars = scalar_tables(couplings.model).scalars
        self.patches = {int(row["node"]): row for row in feature.patches}

    def pairs(self) -> Iterator[Pairs]:
        for basin in self.basins:
            yield pattern.interior_pattern(basin)
            if basin.soil is not None:
                yield pattern.source_pattern(basin)
        yield from self.boundary_pairs()
        yield from self.wall_pairs()
        if len(self.scalars):
            yield from map(pattern.scalar_pattern, self.basins)
        for q, scalar in enumerate(self.scalars):
            yield from self.carried_through_boundaries(q)
            if scalar["losses"] > 0:
                yield from self.decay_pairs(q, scalar)

    def boundary_pairs(self) -> Iterator[Pairs]:
        """Yield couplings of the flow through open patches with the cells there."""
        for i, row in self.patches.items():
            basin, behind = self.basins[row["basin"]], row["ring"] + row["faces"]
            if row["open"]:
                cells = pattern.cells_read(
                    pattern.neighbours(basin), self.integers[behind : behind + row["faces"]]
                )
                yield pairs_of(unique_states(self.of.size + i), pattern.cell_states(basin, cells))
            joint = (
                records.DISCHARGE,
                records.RATING,
                *pattern.THROUGH_FACES,
            )  # one level for all faces
            if row["closure"] in joint or (
                row["closure"] == records.STAGE and row["neighbours"] >= 0
            ):
                read = unique_states(
                    self.behind(i),
                    pattern.cell_states(basin, pattern.cells_at_faces(self.integers, row)),
                )
                yield pairs_of(self.behind(i), read)

    def behind(self, i: int, quantities: int | None = None) -> np.ndarray:
        """States of the cells behind patch i.

        quantities : number of quantities of the basin that are included, from the first on; None for all
        """
        row = self.patches[i]
        cells = self.integers[row["first"] : row["first"] + row["count"]]
        return pattern.cell_states(self.basins[row["basin"]], cells, quantities)

    def sets_pressure(self, i: int) -> np.ndarray | None:
        """First quantity of the cells behind a patch, and the travels of walls of its basin."""
        if i not in self.patches:
            return None
        row = self.patches[i]
        if row["closure"] in pattern.THROUGH_FACES:
            read = pattern.cell_states(
                self.basins[row["basin"]], pattern.cells_at_faces(self.integers, row)
            )
            return unique_states(self.behind(i), read)
        return unique_states(
            self.behind(i, 1), *(self.walls["y"][self.walls["basin"] == row["basin"]])
        )

    def fed(self, i: int) -> np.ndarray:
        return self.behind(i) if i in self.patches else unique_states()

    def wall_pairs(self) -> Iterator[Pairs]:
        """Yield couplings of cells with the travel of moving walls, and of this travel with what moves the walls.

        Couplings of what moves them with the cells at the walls are included.
        """
        for wall in self.walls:
            basin = self.basins[wall["basin"]]
            speed = unique_states(*([wall["rate"]] if wall["rate"] >= 0 else []))
            yield pairs_of(pattern.all_states(basin), unique_states(wall["y"], speed))
            yield pairs_of(unique_states(wall["y"]), speed)
            behind = self.integers[wall["faces"] + wall["count"] :][: wall["count"]]
            cells = pattern.cells_read(pattern.neighbours(basin), behind)
            yield pairs_of(speed, unique_states(wall["y"], pattern.cell_states(basin, cells)))

    def on_bodies(self) -> Iterator[tuple[int, np.ndarray]]:
        for basin in self.basins:
            if basin.row["body"] >= 0:
                yield int(basin.row["body"]), pattern.all_states(basin)

    # scalars ----------

    def carried(self, i: int, q: int) -> tuple[np.ndarray, np.ndarray | None] | None:
        """Amounts in the cells behind a patch, and their depths; None for depths if flows through faces weigh them."""
        if i not in self.patches:
            return None
        row = self.patches[i]
        cells = self.integers[row["first"] : row["first"] + row["count"]]
        amounts = pattern.amount_states(self.basins[row["basin"]], q, cells)
        return amounts, None if row["closure"] in pattern.THROUGH_FACES else self.behind(i, 1)

    def carried_through_boundaries(self, q: int) -> Iterator[Pairs]:
        """Yield couplings of the flow of scalar q through open boundaries with the cells there.

        This flow is booked at the patches of the basin.
        """
        ledger = self.of.size + len(self.of.nodes) * (1 + q)
        for basin in self.basins:
            if basin.row["through"] >= 0:
                nodes = [i for i, row in self.patches.items() if self.basins[row["basin"]] is basin]
                behind = [
                    self.integers[row["first"] :][: row["count"]]
                    for row in map(self.patches.get, nodes)
                ]
                cells = pattern.cells_read(pattern.scalar_neighbours(basin), np.concatenate(behind))
                read = unique_states(
                    pattern.amount_states(basin, q, cells), pattern.cell_states(basin, cells)
                )
                yield pairs_of(ledger + np.array(nodes), read)

    def decay_pairs(self, q: int, scalar) -> Iterator[Pairs]:
        """Yield couplings of the decay of scalar q in the ledger with the amounts and depths that decay."""
        first = self.of.size + len(self.of.nodes) * (1 + len(self.scalars)) + scalar["loss"]
        rows = first + np.arange(scalar["losses"])  # a single row for all states, or one for each
        for basin in self.basins:
            cells = np.arange(basin.n)
            own = rows[basin.row["lost"] + cells] if rows.size > 1 else np.repeat(rows, cells.size)
            for states in (
                pattern.amount_states(basin, q, 0),
                *([basin.row["y"]] if basin.quantities else []),
            ):
                yield own, states + cells

    def reacting_places(self) -> Iterator[tuple[np.ndarray, list, Callable]]:
        for basin in self.basins:
            cells = np.arange(basin.n)
            depths = [basin.row["y"] + cells] if basin.quantities else []
            if basin.scalars:
                yield (
                    basin.row["lost"] + cells,
                    depths,
                    lambda q, b=basin, k=cells: pattern.amount_states(b, q, k),
                )
