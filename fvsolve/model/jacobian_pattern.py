"""Sparsity pattern of the Jacobian of a model, with the couplings of scalars."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.sparse import coo_array, csc_array

from fvsolve.basins import lower_pattern as pattern
from fvsolve.basins.lower_pattern import all_states
from fvsolve.model.scalar_tables import STORES
from fvsolve.model.state_couplings import Couplings, Pairs, all_pairs, ends_of, unique_states
from fvsolve.steady import union

LIMITER_CELLS = 2  # cells that a limited value at a face reads on each side; at an end of a pipe, 1 more


class ScalarCouplings:
    """Couplings of one scalar: pairs (rate, state on which it depends).

    They are in addition to the couplings of the flow that carries the scalar. q : number of the scalar
    """

    def __init__(self, couplings, model, q: int) -> None:
        self.of, self.row = couplings, model.tables.scalars[q]
        self.q, of, nodes = q, couplings, len(couplings.nodes)
        self.ledger = of.size + nodes * (1 + q)
        self.loss = of.size + nodes * (1 + len(model.tables.scalars)) + self.row["loss"]
        self.places = model.tables.integers[self.row["places"] : self.row["places"] + nodes]
        self.stores = np.isin(of.nodes["kind"], STORES)
        self.wide = max(LIMITER_CELLS, of.reach.behind, of.reach.ahead)
        self.through = [
            [] for _ in range(nodes)
        ]  # for each node, states that set flows there, and values at ends of pipes
        for pipe in of.pipes:
            for right, i in enumerate(ends_of(pipe)):
                self.through[i] += [of.sets[i], of.edge_cells(pipe, right), *self.edge(pipe, right)]
        for valve in of.valves:
            i, j = ends_of(valve)
            flow = [of.sets[i], of.sets[j], of.opening_states(valve)]
            self.through[i] += flow
            self.through[j] += flow
        self.values = self.mixed_values()

    def own(self, i: int) -> list:
        """States that set the scalar's value at node i, a storing node or a patch of a basin; else an empty list."""
        if i in self.of.patches:
            return [self.behind(i), self.of.behind(i, 1)]
        return [self.places[i], self.of.own(i)] if self.stores[i] else []

    def behind(self, i: int) -> np.ndarray:
        """States of the amounts in the basin cells behind patch i."""
        row = self.of.patches[i]
        cells = self.of.integers[row["first"] : row["first"] + row["count"]]
        return pattern.amount_states(self.of.basins[row["basin"]], self.q, cells)

    def edge(self, pipe, right: int) -> list[np.ndarray]:
        """States of amounts and waves in the cells that give the value at an end of a pipe; right : 1 for `to`."""
        n = int(pipe["cells"])
        cells = np.arange(n)[::-1][: LIMITER_CELLS + 1] if right else np.arange(n)[: LIMITER_CELLS + 1]
        return [self.row["y"] + pipe["cell"] + cells, pipe["y"] + cells, pipe["y"] + n + cells]

    def mixed_values(self) -> list[np.ndarray]:
        """For each node, the states that set the scalar's value there.

        In a group of nodes without storage these are the states of all flows into the group.
        """
        inner, valves = self.of.inner, [ends_of(valve) for valve in self.of.valves]
        group = union(len(inner), [(i, j) for i, j in valves if inner[i] and inner[j]])
        enter: list[list] = [[] for _ in group]
        for i in np.flatnonzero(inner):
            enter[group[i]] += self.through[i]
        for i, j in valves:
            enter[group[i]] += self.own(j)
            enter[group[j]] += self.own(i)
        joined = [unique_states(*parts) for parts in enter]
        return [joined[group[i]] if inner[i] else unique_states(*self.own(i)) for i in range(len(group))]

    def pairs(self) -> Iterator[Pairs]:
        """Yield the couplings of the scalar; some couplings of a state with itself are missing.

        Those within basins are yielded for all scalars together, with the first scalar.
        """
        sources = [[self.values[i], *self.through[i]] for i in range(len(self.values))]
        for valve in self.of.valves:
            i, j = ends_of(valve)
            sources[i].append(self.values[j])
            sources[j].append(self.values[i])
        for i, read in enumerate(sources):
            affected = [self.places[i]] if self.stores[i] else [self.behind(i)] if i in self.of.patches else []
            yield all_pairs(unique_states(*affected, self.ledger + i), unique_states(*read))
        if self.q == 0:
            yield from map(pattern.scalar_pattern, self.of.basins)
        for basin in self.of.basins:
            yield from self.boundary_pairs(basin)
        if self.row["losses"] > 0:
            yield from self.decay_pairs()
        for pipe in self.of.pipes:
            yield from self.inside(pipe)
            for right, i in enumerate(ends_of(pipe)):
                yield all_pairs(self.edge(pipe, right)[0], unique_states(self.values[i]))
                yield all_pairs(self.close(pipe, right), self.read(pipe, right, i))

    def boundary_pairs(self, basin) -> Iterator[Pairs]:
        """Yield couplings of the flow through open boundaries of a basin with the cells there.

        This flow is booked at the patches of the basin.
        """
        nodes = [i for i, row in self.of.patches.items() if self.of.basins[row["basin"]] is basin]
        if basin.row["through"] >= 0:
            behind = [self.of.integers[row["first"] :][: row["count"]] for row in map(self.of.patches.get, nodes)]
            cells = pattern.cells_read(pattern.scalar_neighbours(basin), np.concatenate(behind))
            read = unique_states(pattern.amount_states(basin, self.q, cells), pattern.cell_states(basin, cells))
            yield all_pairs(self.ledger + np.array(nodes), read)

    def decay_pairs(self) -> Iterator[Pairs]:
        """Yield couplings of the decay in the ledger with the amounts and masses that decay.

        The ledger has a single row for the decay of all states, or a row for each state.
        """
        rows = self.loss + np.arange(self.row["losses"])
        pick = (lambda k: rows[k]) if rows.size > 1 else (lambda k: np.repeat(rows, np.size(k)))
        for pipe in self.of.pipes:
            cells = np.arange(pipe["cells"])
            for first in (self.row["y"] + pipe["cell"], pipe["y"], pipe["y"] + pipe["cells"]):
                yield pick(pipe["cell"] + cells), first + cells
        for i in np.flatnonzero(self.stores):
            read = unique_states(*self.own(i))
            yield all_pairs(np.atleast_1d(pick(self.places[i] - self.row["y"])), read)
        for basin in self.of.basins:
            cells = np.arange(basin.n)
            for first in (pattern.amount_states(basin, self.q, 0), *([basin.row["y"]] if basin.quantities else [])):
                yield pick(basin.row["lost"] + cells), first + cells

    def inside(self, pipe) -> Iterator[Pairs]:
        """Yield couplings of the amount in each cell of a pipe with amounts and waves in neighbouring cells."""
        n = int(pipe["cells"])
        cells, at = np.arange(n), self.row["y"] + pipe["cell"]
        for offset in range(-self.wide, self.wide + 1):
            here = cells[(cells + offset >= 0) & (cells + offset < n)]
            for first in (pipe["y"], pipe["y"] + n, *([at] if abs(offset) <= LIMITER_CELLS else [])):
                yield at + here, first + here + offset

    def close(self, pipe, right: int) -> np.ndarray:
        """Indices of the states (amounts) of cells near one end of a pipe, whose face flows depend on that end.

        right : 1 for the end `to`, 0 for the end `from`
        """
        cells = self.row["y"] + pipe["cell"] + np.arange(pipe["cells"])
        return (cells[::-1] if right else cells)[: self.wide]

    def read(self, pipe, right: int, i: int) -> np.ndarray:
        """States on which the flows near an end of a pipe depend, in addition to those of adjacent cells.

        right : as for `close`; i : node at this end
        """
        enters, leaves = self.of.sides(pipe, right)
        reach = self.of.reach
        return unique_states(
            self.of.sets[i], self.of.edge_cells(pipe, right), enters[: reach.entering], leaves[: reach.leaving]
        )


def scalar_pairs(couplings, model) -> Iterator[Pairs]:
    """Yield the couplings of all scalars of a model, see `ScalarCouplings`."""
    for q in range(len(model.tables.scalars)):
        yield from ScalarCouplings(couplings, model, q).pairs()


def jacobian_pattern(model) -> csc_array:
    """Sparsity pattern : bool[n + m, n], True where a derivative may differ from zero in any state of the model.

    Rows are the rates of the n states, then the m flows in the stepper's ledger (`Model.ledgers`); columns are the
    states.
    """
    n, couplings = model.y_size, Couplings(model)
    pairs = [(np.arange(n), np.arange(n)), *couplings.pairs(), *scalar_pairs(couplings, model)]
    rows, states = (np.concatenate(side) for side in zip(*pairs, strict=True))
    return csc_array(
        coo_array((np.ones(rows.size, dtype=bool), (rows, states)), shape=(n + model.ledgers, n)), dtype=bool
    )


def lumped_states(model) -> np.ndarray:
    """Indices of all states except waves in cells of pipes, states of basins and travels of their walls : int64[q].

    Most are states of lumped parts such as tanks, chambers and masses. Their pressures are hundreds of bars, while the
    flow of restrictions bends within a few pascals. The result is empty under density laws whose pressures come from
    iterations.
    """
    if model.case.law.name not in ("linear", "log"):  # pressures come from iterations, rougher than rounding
        return np.zeros(0, dtype=np.int64)
    pipes = model.tables.pipes[model.tables.pipes["delay"] < 0]
    cells = [pipe["y"] + np.arange(2 * pipe["cells"]) for pipe in pipes] + [all_states(basin) for basin in model.basins]
    walls = [[at for at, _, _ in basin.stretches] for basin in model.basins]  # every cell's volume follows these
    return np.setdiff1d(np.arange(model.y_size), np.concatenate([[], *cells, *walls]))
