"""States on which scalars depend, for the sparsity pattern of the Jacobian."""

from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np

from fvsolve.core.assembly.features import FeaturePattern, with_slot
from fvsolve.core.kernels.pipe_energy import MAX_WIDTH
from fvsolve.core.model.jacobian_pattern import Pairs, ends_of
from fvsolve.core.model.state_pairs import pairs_of, unique_states
from fvsolve.core.steady import union
from fvsolve.features.scalars.lower import STORES
from fvsolve.features.scalars.own_tables import scalar_tables
from fvsolve.features.scalars.reactions import names_read
from fvsolve.parts import law_elements as codes

# cells that a limited value at a face reads on each side; at an end of a pipe, 1 more
LIMITER_CELLS = 2


class ScalarPattern(FeaturePattern):
    """Couplings of all scalars, and of reactions. couplings : `Couplings` of the model"""

    def __init__(self, feature, couplings) -> None:
        super().__init__(feature)
        self.couplings = couplings

    def pairs(self) -> Iterator[Pairs]:
        model = self.couplings.model
        for q in range(len(self.feature.scalars)):
            yield from ScalarCouplings(self.couplings, model, q).pairs()
        yield from reaction_pairs(self.couplings, model)

    def source(self, row) -> np.ndarray | None:
        if row["kind"] != codes.FLUID_HEAT:
            return None
        node = int(self.feature.exchangers[int(row["index"])]["node"])
        return unique_states(self.temperature.values[node], *self.temperature.through[node])

    @cached_property
    def temperature(self):
        """Couplings of the scalar that is the temperature of the fluid."""
        model = self.couplings.model
        q = int(np.argmax(self.feature.scalars["specific_heat"]))
        return ScalarCouplings(self.couplings, model, q)


class ScalarCouplings:
    """Couplings of one scalar: pairs (rate, state on which it depends).

    They are in addition to the couplings of the flow that carries the scalar. q : number of the scalar
    """

    def __init__(self, couplings, model, q: int) -> None:
        self.of, self.tables = couplings, scalar_tables(model)
        self.row = self.tables.scalars[q]
        self.q, of, nodes = q, couplings, len(couplings.nodes)
        self.ledger = of.size + nodes * (1 + q)
        self.loss = of.size + nodes * (1 + len(self.tables.scalars)) + self.row["loss"]
        self.places = model.tables.integers[self.row["places"] : self.row["places"] + nodes]
        self.stores = np.isin(of.nodes["kind"], STORES)
        self.wide = max(LIMITER_CELLS, of.reach.behind, of.reach.ahead)
        # for each node, states that set flows there, and values at ends of pipes
        self.through: list[list] = [[] for _ in range(nodes)]
        for pipe in of.pipes:
            for right, i in enumerate(ends_of(pipe)):
                self.through[i] += [of.sets[i], of.edge_cells(pipe, right), *self.edge(pipe, right)]
        for valve in of.valves:
            i, j = ends_of(valve)
            flow = [of.sets[i], of.sets[j], of.opening_states(valve)]
            self.through[i] += flow
            self.through[j] += flow
        self.heated = self.row["specific_heat"] > 0.0
        # rows of the ledger up to that of heat
        self.heat_end = int(model.layout["extent"] - model.layout["supply"])
        for k, exchanger in enumerate(self.tables.exchangers if self.heated else ()):
            network = with_slot(of.features, codes.SLOT)
            thermal = network.row_states(network.feature.thermal_rows[k])
            self.through[exchanger["node"]].append(thermal)
        for source in self.tables.heat_sources if self.heated else ():
            for i in ends_of(of.valves[source["valve"]]):
                self.through[i] += self.heat_states(source)
        self.values = self.mixed_values()

    def heat_states(self, source) -> list[np.ndarray]:
        """States that set the heat of a restriction."""
        valve = self.of.valves[source["valve"]]
        device = [self.of.acting_states(source["device"])] if source["device"] >= 0 else []
        return [*(self.of.sets[i] for i in ends_of(valve)), self.of.opening_states(valve), *device]

    def heat_pairs(self) -> Iterator[Pairs]:
        """Yield couplings of the heat in the ledger, and of amounts in cells with the waves that friction reads."""
        first = self.of.size + len(self.of.nodes) * (1 + len(self.tables.scalars))
        first += int(self.tables.scalars["losses"].sum())
        for k, source in enumerate(self.tables.heat_sources):
            yield pairs_of(unique_states(first + k), unique_states(*self.heat_states(source)))
        for pipe in self.of.pipes[self.of.pipes["temperature"] > 0.0]:
            n, cells = int(pipe["cells"]), np.arange(pipe["cells"])
            for wave in (pipe["y"], pipe["y"] + n):
                yield wave + cells, self.row["y"] + pipe["cell"] + cells
        for pipe in self.of.pipes[self.of.pipes["heat"] >= 0]:
            n, cells = int(pipe["cells"]), np.arange(pipe["cells"])
            row = first + pipe["heat"] + (cells if self.row["by_cell"] else 0 * cells)
            yield row, self.row["y"] + pipe["cell"] + cells
            memory = [pipe["memory"] + k * n for k in range(pipe["terms"])]
            for offset in range(1 - MAX_WIDTH, MAX_WIDTH):
                here = cells[(cells + offset >= 0) & (cells + offset < n)]
                for at in (pipe["y"], pipe["y"] + n, *memory):
                    yield self.row["y"] + pipe["cell"] + here, at + here + offset
                    yield row[here], at + here + offset
        first = self.of.size + self.heat_end - len(self.tables.exchangers)
        for k, exchanger in enumerate(self.tables.exchangers):
            i = exchanger["node"]
            yield pairs_of(
                unique_states(first + k), unique_states(self.values[i], *self.through[i])
            )

    def own(self, i: int) -> list:
        """States that set the scalar's value at node i, a storing node or one of a feature; else an empty list."""
        if (found := self.carried(i)) is not None:
            amounts, holding = found
            return [amounts, *(self.through[i] if holding is None else [holding])]
        return [self.places[i], self.of.own(i)] if self.stores[i] else []

    def carried(self, i: int) -> tuple[np.ndarray, np.ndarray | None] | None:
        """Result of `FeaturePattern.carried` of the feature that sets the value at node i; None without one."""
        found = (own.carried(i, self.q) for own in self.of.features)
        return next((states for states in found if states is not None), None)

    def edge(self, pipe, right: int) -> list[np.ndarray]:
        """States of amounts and waves in the cells that give the value at an end of a pipe; right : 1 for `to`."""
        n = int(pipe["cells"])
        cells = (
            np.arange(n)[::-1][: LIMITER_CELLS + 1] if right else np.arange(n)[: LIMITER_CELLS + 1]
        )
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
        return [
            joined[group[i]] if inner[i] else unique_states(*self.own(i)) for i in range(len(group))
        ]

    def pairs(self) -> Iterator[Pairs]:
        """Yield the couplings of the scalar in pipes and nodes; some couplings of a state with itself are missing."""
        sources = [[self.values[i], *self.through[i]] for i in range(len(self.values))]
        for valve in self.of.valves:
            i, j = ends_of(valve)
            sources[i].append(self.values[j])
            sources[j].append(self.values[i])
        for i, read in enumerate(sources):
            found = self.carried(i)
            affected = [self.places[i]] if self.stores[i] else [] if found is None else [found[0]]
            yield pairs_of(unique_states(*affected, self.ledger + i), unique_states(*read))
        if self.row["losses"] > 0:
            yield from self.decay_pairs()
        if self.heated:
            yield from self.heat_pairs()
        for pipe in self.of.pipes:
            yield from self.inside(pipe)
            for right, i in enumerate(ends_of(pipe)):
                yield pairs_of(self.edge(pipe, right)[0], unique_states(self.values[i]))
                yield pairs_of(self.close(pipe, right), self.read(pipe, right, i))

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
            yield pairs_of(np.atleast_1d(pick(self.places[i] - self.row["y"])), read)

    def inside(self, pipe) -> Iterator[Pairs]:
        """Yield couplings of the amount in each cell of a pipe with amounts and waves in neighbouring cells."""
        n = int(pipe["cells"])
        cells, at = np.arange(n), self.row["y"] + pipe["cell"]
        for offset in range(-self.wide, self.wide + 1):
            here = cells[(cells + offset >= 0) & (cells + offset < n)]
            for first in (
                pipe["y"],
                pipe["y"] + n,
                *([at] if abs(offset) <= LIMITER_CELLS else []),
            ):
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
        near = enters[: reach.entering], leaves[: reach.leaving]
        return unique_states(self.of.sets[i], self.of.edge_cells(pipe, right), *near)


def reaction_pairs(couplings, model) -> Iterator[Pairs]:
    """Yield couplings of amounts that reactions change, and of the ledger of reactions, with what rates depend on.

    These are amounts of scalars and the mass at the same place.
    """
    tables, scalars = scalar_tables(model), list(model.case.scalars)
    ledger = (
        couplings.size
        + len(couplings.nodes) * (1 + len(scalars))
        + int(sum(tables.scalars["losses"]))
    )
    stores = np.flatnonzero(np.isin(model.tables.nodes["kind"], STORES))
    for row, reaction in zip(tables.reactions, model.case.reactions.values(), strict=True):
        changed = [
            scalars.index(name)
            for name in reaction.sides.names
            if reaction.sides.change(name) != 0.0
        ]
        read = [scalars.index(name) for name in names_read(reaction, model.case.scalars)]
        first, single = ledger + row["extent"], row["extents"] == 1
        for entries, masses, amounts in reacting_places(couplings, model, stores):
            rows = [amounts(q) for q in changed] + [
                np.full(entries.size, first) if single else first + entries
            ]
            for states in [*(amounts(q) for q in read), *masses]:
                yield from ((here, states) for here in rows)


def reacting_places(
    couplings, model, stores: np.ndarray
) -> Iterator[tuple[np.ndarray, list, Callable]]:
    """Yield groups of places of reactions: their numbers, states of the masses there, states of amounts of a scalar.

    stores : numbers of nodes with storage
    """
    tables = model.tables
    scalars, nodes = scalar_tables(model).scalars, tables.nodes
    for pipe in tables.pipes:
        cells = np.arange(pipe["cells"])
        masses = [pipe["y"] + cells, pipe["y"] + pipe["cells"] + cells]
        yield pipe["cell"] + cells, masses, lambda q, k=pipe["cell"] + cells: scalars[q]["y"] + k
    if stores.size:
        places = tables.integers[scalars[0]["places"] + stores] - scalars[0]["y"]
        yield places, [nodes["y"][stores]], lambda q: scalars[q]["y"] + places
    for own in couplings.features:
        yield from own.reacting_places()
