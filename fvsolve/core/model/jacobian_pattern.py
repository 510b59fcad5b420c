"""Sparsity pattern of the Jacobian of a model: the states on which the rate of each state can depend.

Cells of a pipe depend on their neighbours within the reach of the scheme. A node depends on the edge cells of all its
pipes, and cells whose stencil crosses a pipe end depend on the same cells. Tanks, chambers and given pressures separate
groups of nodes: their pressure follows from their own states. Features state the couplings of their own states, and of
nodes whose pressure they set or influence.
"""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import coo_array, csc_array

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model.state_pairs import pairs_of, unique_states
from fvsolve.core.schemes import SCHEMES, Reach
from fvsolve.core.steady import union

Pairs = tuple[np.ndarray, np.ndarray]  # rows, and the state that each depends on


def reach_of(scheme: str, settings) -> Reach:
    """Numbers of cells that a scheme reads in a model; with cavities both waves read cells on both sides."""
    reach = SCHEMES[scheme].reach
    if settings["floor"] > 0.0:  # cavities: both waves depend on both sides
        return Reach(reach.behind, reach.behind, 2 * reach.behind - 1, 3)
    return reach


class Couplings:
    """Couplings of a model: pairs (rate, state on which it depends), both by index.

    Rates with an index from the number of states on are flows in the stepper's ledger.
    """

    def __init__(self, model) -> None:
        tables = model.tables
        self.size, self.model = model.y_size, model
        self.nodes, self.pipes = tables.nodes, tables.pipes
        self.valves, self.columns = tables.valves, tables.columns
        self.couplings = tables.couplings
        settings = tables.settings[0]
        self.linear = model.case.law.linear
        self.own_friction = settings["scheme"] == rec.UPWIND and not settings["from_arriving"]
        self.reach = reach_of(model.case.numerics.scheme, settings)
        self.inner = self.nodes["kind"] == rec.JUNCTION
        self.devices, self.parts, self.floats = tables.devices, model.devices, tables.floats
        self.integers = tables.integers
        self.features = [feature.pattern(self) for feature in model.features]
        self.sets: list[np.ndarray] = []
        self.sets = self.pressures()  # for each node, the states that set its pressure

    def pairs(self) -> Iterator[Pairs]:
        """Yield all couplings of the model, except some of a state with itself."""
        for pipe in self.pipes:
            if pipe["cells"] == 0:
                yield pairs_of(
                    unique_states(pipe["y"]), unique_states(*(self.sets[i] for i in ends_of(pipe)))
                )
                continue
            yield from self.inside(pipe)
            yield from self.beyond(pipe)
            yield from self.friction_memory_pairs(pipe)
            yield from self.creep_pairs(pipe)
        yield from self.stored()
        for column in self.columns:
            yield pairs_of(
                unique_states(column["y"]), unique_states(*(self.sets[i] for i in ends_of(column)))
            )
        yield from self.device_pairs()
        for own in self.features:
            yield from own.pairs()

    # nodes ------------------------------------------------------------------------------------------------------

    def schedule(self, *indices: int) -> np.ndarray:
        """States on which schedules with these numbers depend, because features set them."""
        return unique_states(*(own.schedule(*indices) for own in self.features))

    def joints(self) -> list:
        """Links whose end nodes are solved together: valves, short delay lines, columns that valves can control."""
        return [
            *self.valves,
            *self.couplings,
            *(column for column in self.columns if self.is_controlled(column)),
        ]

    def is_controlled(self, column) -> bool:
        """True if the flow of a rigid column follows the valves at its end at some openings."""
        return any(self.nodes["gates"][i] >= 0 for i in ends_of(column))

    def own(self, i: int) -> np.ndarray:
        """Index of the state of the mass stored in node i; empty if it stores none."""
        y = self.nodes["y"][i]
        return np.array([y] if y >= 0 else [], dtype=np.int64)

    def pressure_states(self, i: int) -> np.ndarray:
        """Indices of the states that set the pressure of a storing node, or of one whose pressure a feature sets.

        For a storing node they are its mass, states of its device and of features.
        """
        for own in self.features:
            if (states := own.sets_pressure(i)) is not None:
                return states
        given = self.schedule(self.nodes["schedule"][i])
        of_devices = (
            self.device_states(row) for row in self.devices if row["row"] >= 0 and row["node"] == i
        )
        of_features = (own.pressure(i) for own in self.features)
        return unique_states(self.own(i), given, *of_features, *of_devices)

    def device_states(self, device) -> np.ndarray:
        """Indices of the states of a device."""
        return device["y"] + np.arange(device["states"] if device["y"] >= 0 else 0)

    def acting_states(self, k: int) -> np.ndarray:
        """Indices of the states of device k on which its flow and rates depend: all but its integrals over time."""
        states, (_, _, rows) = self.device_states(self.devices[k]), self.parts[k]
        return states[: states.size - rows.integrals(self.devices[k])]

    def opening_states(self, link) -> np.ndarray:
        """Indices of the states of the device and of the blocks that open and close a link; empty if it has none."""
        if "device" not in link.dtype.names:
            return unique_states()
        if link["device"] < 0:
            return self.schedule(link["schedule"])
        device = self.devices[link["device"]]
        _, part, rows = self.parts[link["device"]]
        of_features = [own.read_by(part, rows) for own in self.features]
        lifting = [
            self.sets[i] if self.sets else self.pressure_states(i) for i in self.lifting_nodes(link)
        ]
        schedules = self.schedule(*rows.schedules_at_once(device, self.valves, self.floats))
        return unique_states(self.acting_states(link["device"]), schedules, *of_features, *lifting)

    def lifting_nodes(self, link) -> list[int]:
        """Nodes whose pressures open a link at once, besides its ends; empty for links without such a device."""
        if "device" not in link.dtype.names or link["device"] < 0:
            return []
        row = self.devices[link["device"]]
        at_once = row["second"] >= 0 and row["states"] == 0
        return [int(row[column]) for column in ("node", "second")] if at_once else []

    def pressures(self) -> list[np.ndarray]:
        """For each node, the states that set its pressure.

        In a group of nodes without storage these are the states of all flows into the group.
        """
        joined_nodes = [(*ends_of(link), *self.lifting_nodes(link)) for link in self.joints()]
        inner = [[i for i in places if self.inner[i]] for places in joined_nodes]
        group = union(
            len(self.nodes),
            [(i, j) for places in inner for i, j in zip(places, places[1:], strict=False)],
        )
        enter: list[list] = [[] for _ in group]
        for pipe in self.pipes:
            for right, i in enumerate(ends_of(pipe)):
                enter[group[i]].append(self.edge_cells(pipe, right))
        for column in self.columns:
            for i in ends_of(column):
                enter[group[i]].append(column["y"])
        for link in self.joints():
            i, j = ends_of(link)
            enter[group[i]] += [self.pressure_states(j), self.opening_states(link)]
            enter[group[j]] += [self.pressure_states(i), self.opening_states(link)]
        for i in np.flatnonzero(self.inner):
            enter[group[i]].append(self.schedule(self.nodes["schedule"][i]))
        joined = [unique_states(*parts) for parts in enter]
        return [
            joined[group[i]] if self.inner[i] else self.pressure_states(i)
            for i in range(len(group))
        ]

    def stored(self) -> Iterator[Pairs]:
        """Yield pairs (rates, states) of the masses in nodes and in what they feed, and of the mass ledger.

        The states are those that determine the flows into them.
        """
        into = [[self.pressure_states(i)] for i in range(len(self.nodes))]
        for pipe in self.pipes:
            for right, i in enumerate(ends_of(pipe)):
                into[i].append(self.edge_cells(pipe, right))
        for link in self.joints():
            i, j = ends_of(link)
            into[i] += [self.sets[j], self.opening_states(link)]
            into[j] += [self.sets[i], self.opening_states(link)]
        for column in self.columns:
            for i in ends_of(column):
                into[i].append(column["y"])
        for own in self.features:
            for i, states in own.inflows():
                into[i].append(states)
        for i in np.flatnonzero(~self.inner):
            fed = (own.fed(i) for own in self.features)
            yield pairs_of(unique_states(self.own(i), *fed, self.size + i), unique_states(*into[i]))

    def device_pairs(self) -> Iterator[Pairs]:
        """Yield couplings of the states of each device with each other, and with pressures.

        The pressures are those at its ends and at the nodes that it senses.
        """
        for k, (row, (_, _, rows)) in enumerate(zip(self.devices, self.parts, strict=True)):
            ends = ends_of(self.valves[row["valve"]]) if row["valve"] >= 0 else ()
            read = [self.sets[i] for i in (*ends, row["node"], row["second"]) if i >= 0]
            read.append(
                self.schedule(
                    row["schedule"], *rows.schedules_of_rates(row, self.valves, self.floats)
                )
            )
            yield pairs_of(self.device_states(row), unique_states(self.acting_states(k), *read))

    def device_reading(self, device) -> np.ndarray:
        """States on which a quantity of a device can depend."""
        ends = self.valves[device["valve"]] if device["valve"] >= 0 else None
        nodes = [device["node"], device["second"], *(() if ends is None else ends_of(ends))]
        opening = unique_states() if ends is None else self.opening_states(ends)
        read = [self.sets[n] for n in nodes if n >= 0]
        read += [device["travel"] + np.arange(2)] if device["travel"] >= 0 else []
        return unique_states(self.device_states(device), opening, *read)

    # pipes ------------------------------------------------------------------------------------------------------

    def coupled(self, pipe) -> bool:
        """True if the rate of each wave depends on all states that the rate of either wave reads."""
        rough = pipe["friction"] in (rec.FRICTION_ROUGH, rec.FRICTION_HAZEN)
        return bool(not self.linear or rough or (pipe["loss"] != 0.0 and not self.own_friction))

    def inside(self, pipe) -> Iterator[Pairs]:
        """Yield couplings of the waves in cells of a pipe with the waves in neighbouring cells."""
        cells = np.arange(pipe["cells"])
        stencil = np.arange(-self.reach.behind, self.reach.ahead + 1)
        local = [0] if pipe["loss"] != 0.0 else []
        for wave, stencils in ((0, (stencil, -stencil)), (1, (-stencil, stencil))):
            other = stencils[1] if self.coupled(pipe) else local
            for source, offsets in ((wave, stencils[0]), (1 - wave, other)):
                for offset in offsets:
                    here = cells[(cells + offset >= 0) & (cells + offset < cells.size)]
                    first = pipe["y"] + source * cells.size
                    yield pipe["y"] + wave * cells.size + here, first + here + offset

    def friction_memory_pairs(self, pipe) -> Iterator[Pairs]:
        """Yield pairs (rates, states) of unsteady friction: waves with memory states, and memory states with waves.

        Both are those of the same cell.

        Under density laws other than `linear` the memory is that of the velocity, which depends on neighbouring cells
        too.
        """
        n = int(pipe["cells"])
        cells = np.arange(n)
        offsets = [0] if self.linear else [-1, 0, 1]
        for wave in (pipe["y"], pipe["y"] + n) if pipe["terms"] > 0 else ():
            for k in range(pipe["terms"]):
                yield wave + cells, pipe["memory"] + k * n + cells
            for offset in offsets:
                here = cells[(cells + offset >= 0) & (cells + offset < n)]
                for other in (pipe["y"], pipe["y"] + n):
                    yield wave + here, other + here + offset
                for k in range(pipe["terms"]):
                    yield pipe["memory"] + k * n + here, wave + here + offset

    def creep_pairs(self, pipe) -> Iterator[Pairs]:
        """Yield couplings of wall creep: waves and creep states of a cell with each other.

        Creep states also depend on the waves that set the mean pressure of their cell.
        """
        n = int(pipe["cells"])
        cells, waves = np.arange(n), (pipe["y"], pipe["y"] + n)
        strains = [pipe["strain"] + k * n for k in range(pipe["elements"])]
        for offset in [0] if self.linear else [-1, 0, 1]:
            here = cells[(cells + offset >= 0) & (cells + offset < n)]
            for row in (*waves, *strains) if strains else ():
                for other in waves:
                    yield row + here, other + here + offset
        for wave in waves:
            for strain in strains:
                yield wave + cells, strain + cells

    def sides(self, pipe, right: int) -> tuple[np.ndarray, np.ndarray]:
        """States of the waves in cells at an end of a pipe, nearest cell first : (entering wave, leaving wave).

        right : 1 for the `to` end of the pipe
        """
        forward = pipe["y"] + np.arange(pipe["cells"])
        backward = forward + pipe["cells"]
        return (backward[::-1], forward[::-1]) if right else (forward, backward)

    def edge_cells(self, pipe, right: int) -> np.ndarray:
        """States of the edge cells that a node reads at an end of a pipe."""
        enters, leaves = self.sides(pipe, right)
        edge = slice(self.reach.leaving)
        return leaves[edge] if self.linear else unique_states(leaves[edge], enters[edge])

    def beyond(self, pipe) -> Iterator[Pairs]:
        """Yield couplings of cells whose stencil crosses a pipe end.

        They depend on the polynomial that continues the waves there and, where a wave enters, on the node.
        """
        for right, i in enumerate(ends_of(pipe)):
            enters, leaves = self.sides(pipe, right)
            near, last = slice(self.reach.behind), slice(max(self.reach.ahead, 1))
            read = unique_states(
                self.sets[i], self.edge_cells(pipe, right), enters[: self.reach.entering]
            )
            yield pairs_of(enters[near], read)
            yield pairs_of(leaves[last], leaves[: self.reach.leaving])
            if self.coupled(pipe):
                yield pairs_of(leaves[near], read)
                yield pairs_of(enters[last], leaves[: self.reach.leaving])


def ends_of(link) -> tuple[int, int]:
    """Indices of the nodes at both ends of a link."""
    return int(link["from_node"]), int(link["to_node"])


def jacobian_pattern(model) -> csc_array:
    """Sparsity pattern : bool[n + m, n], True where a derivative may differ from zero in any state of the model.

    Rows are the rates of the n states, then the m flows in the stepper's ledger (`Model.ledgers`); columns are the
    states.
    """
    n, couplings = model.y_size, Couplings(model)
    pairs = [(np.arange(n), np.arange(n)), *couplings.pairs()]
    rows, states = (np.concatenate(side) for side in zip(*pairs, strict=True))
    entries = np.ones(rows.size, dtype=bool), (rows, states)
    return csc_array(coo_array(entries, shape=(n + model.ledgers, n)), dtype=bool)


def lumped_states(model) -> np.ndarray:
    """Indices of all states except waves in cells of pipes, and states of meshes : int64[q].

    Most are states of lumped parts such as tanks and chambers. Their pressures are hundreds of bars, while the
    flow of restrictions bends within a few pascals. The result is empty under density laws whose pressures come from
    iterations.
    """
    # pressures come from iterations, rougher than rounding
    if model.case.law.name not in ("linear", "log"):
        return np.zeros(0, dtype=np.int64)
    pipes = model.tables.pipes[model.tables.pipes["cells"] > 0]
    cells = [pipe["y"] + np.arange(2 * pipe["cells"]) for pipe in pipes]
    cells += [states for feature in model.features for states in feature.cell_states(model)]
    return np.setdiff1d(np.arange(model.y_size), np.concatenate([[], *cells]))
