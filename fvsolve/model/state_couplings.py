"""Couplings of states: the states on which the rate of each state can depend, from the tables of a model.

Cells of a pipe depend on their neighbours within the reach of the scheme. A node depends on the edge cells of all its
pipes, and cells whose stencil crosses a pipe end depend on the same cells. Tanks, chambers and given pressures separate
groups of nodes: their pressure follows from their own states, except that chambers of cylinders also depend on their
masses. Cells of a basin depend on the cells around them (`basins.lower_pattern`). A patch is a node whose pressure is
set by the cells behind it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fvsolve.basins import lower_pattern as pattern
from fvsolve.kernels import dtypes as rec
from fvsolve.schemes import SCHEMES, Reach
from fvsolve.steady import union

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
        self.size = model.y_size
        self.nodes, self.pipes = tables.nodes, tables.pipes
        self.valves, self.columns = tables.valves, tables.columns
        self.short = self.pipes[tables.delays["pipe"][tables.delays["now"] > 0.0]]
        settings = tables.settings[0]
        self.linear = model.case.law.linear
        self.upwind = settings["scheme"] == rec.UPWIND
        self.reach = reach_of(model.case.numerics.scheme, settings)
        self.inner = self.nodes["kind"] == rec.JUNCTION
        self.masses, self.pistons = tables.masses["y"], tables.pistons
        self.braces = [*tables.braces, *tables.stops]
        self.bodies, self.lines, self.points = tables.bodies, tables.lines, tables.points
        self.moving_segments = tables.moving_segments
        self.bushings = tables.bushings
        joined = [[self.points[pin[end]]["body"] for end in ("from_point", "to_point")] for pin in tables.pins]
        joined = [[int(self.bodies[i]["root"]) for i in pair] for pair in joined if min(pair) >= 0]
        self.ties = union(len(self.bodies), joined)
        self.devices = tables.devices
        self.basins, self.integers, self.walls = model.basins, tables.integers, tables.walls
        self.patches = {int(row["node"]): row for row in tables.patches}
        self.sets = self.pressures()  # for each node, the states that set its pressure

    def pairs(self) -> Iterator[Pairs]:
        """Yield all couplings of the model, except some of a state with itself."""
        for pipe in self.pipes:
            if pipe["delay"] >= 0:
                yield all_pairs(unique_states(pipe["y"]), unique_states(*(self.sets[i] for i in ends_of(pipe))))
                continue
            yield from self.inside(pipe)
            yield from self.beyond(pipe)
            yield from self.friction_memory_pairs(pipe)
            yield from self.creep_pairs(pipe)
        for basin in self.basins:
            yield pattern.interior_pattern(basin)
        yield from self.boundary_pairs()
        yield from self.stored()
        yield from self.column_pairs()
        yield from self.moving()
        yield from self.device_pairs()
        yield from self.wall_pairs()
        yield from self.moving_fluid_pairs()

    def boundary_pairs(self) -> Iterator[Pairs]:
        """Yield couplings of the flow through open patches of basins with the cells there."""
        for i, row in self.patches.items():
            basin, behind = self.basins[row["basin"]], row["ring"] + row["faces"]
            if row["open"]:
                cells = pattern.cells_read(pattern.neighbours(basin), self.integers[behind : behind + row["faces"]])
                yield all_pairs(unique_states(self.size + i), pattern.cell_states(basin, cells))

    # nodes ------------------------------------------------------------------------------------------------------

    def joints(self) -> list:
        """Links whose end nodes are solved together: valves, short delay lines, columns that valves can control."""
        return [*self.valves, *self.short, *(column for column in self.columns if self.is_controlled(column))]

    def is_controlled(self, column) -> bool:
        """True if the flow of a rigid column follows the valves at its end at some openings."""
        return any(self.nodes["gates"][i] >= 0 for i in ends_of(column))

    def own(self, i: int) -> np.ndarray:
        """Index of the state of the mass stored in node i; empty if it stores none."""
        y = self.nodes["y"][i]
        return np.array([y] if y >= 0 else [], dtype=np.int64)

    def behind(self, i: int, quantities: int | None = None) -> np.ndarray:
        """States of the cells behind patch i; empty for other nodes.

        quantities : number of quantities of the basin that are included, from the first on; None for all
        """
        if i not in self.patches:
            return unique_states()
        row = self.patches[i]
        cells = self.integers[row["first"] : row["first"] + row["count"]]
        return pattern.cell_states(self.basins[row["basin"]], cells, quantities)

    def pressure_states(self, i: int) -> np.ndarray:
        """Indices of the states that set the pressure of a storing node or a patch.

        For a node they are its mass, positions of pistons and states of its device. For a patch they are the first
        quantity of the cells behind it, and the travels of walls of its basin.
        """
        if i in self.patches:
            return unique_states(self.behind(i, 1), *(self.walls["y"][self.walls["basin"] == self.patches[i]["basin"]]))
        of_devices = (self.device_states(row) for row in self.devices if row["row"] >= 0 and row["node"] == i)
        of_pistons = (self.places(row, 0) for row in self.pistons if i in (row["a"], row["b"]))
        return unique_states(self.own(i), *of_pistons, *of_devices)

    def device_states(self, device) -> np.ndarray:
        """Indices of the states of a device."""
        return device["y"] + np.arange(device["states"] if device["y"] >= 0 else 0)

    def opening_states(self, link) -> np.ndarray:
        """Indices of the states of the device that opens and closes a link; empty if it has none."""
        if "device" not in link.dtype.names or link["device"] < 0:
            return unique_states()
        return self.device_states(self.devices[link["device"]])

    def places(self, row, order: int) -> np.ndarray:
        """States of the positions (`order` 0) or velocities (1) of the masses or bodies that a row joins."""
        if row["line"] >= 0:
            ends = (self.points[k]["body"] for k in self.ends_of_line(row) if k >= 0)
            return unique_states(*(self.chain_states(i, order) for i in ends if i >= 0))
        ends = ("case", "rod") if "rod" in row.dtype.names else ("from_mass", "to_mass")
        return np.array([self.masses[row[end]] + order for end in ends if self.masses[row[end]] >= 0], dtype=np.int64)

    def ends_of_line(self, row) -> tuple[int, int]:
        """Rows of the two points of a force element's line of action; -1 for the world instead of a first point."""
        line = self.lines[row["line"]]
        return int(line["from_point"]), int(line["to_point"])

    def chain_states(self, i: int, order: int) -> np.ndarray:
        """States of the coordinates (`order` 0) or velocities (1) of body i and of all bodies that carry it."""
        parts = [unique_states()]
        while i >= 0:
            parts.append(self.joint_states(self.bodies[i], order))
            i = self.bodies[i]["parent"]
        return unique_states(*parts)

    def joint_states(self, body, order: int) -> np.ndarray:
        """States of the coordinates (`order` 0) or velocities (1) of a joint.

        A joint with three or more freedoms has one coordinate more, because four Euler parameters describe its
        rotation.
        """
        count = int(body["freedoms"])
        if not count:
            return unique_states()
        return body["rate"] + np.arange(count) if order else body["y"] + np.arange(count + (count >= 3))

    def tree_states(self, root: int, order: int) -> np.ndarray:
        """States of the coordinates (`order` 0) or velocities (1) of a tree of bodies and trees that pins tie to it."""
        return unique_states(
            *(self.joint_states(body, order) for body in self.bodies if self.tree_root(body["root"]) == root)
        )

    def tree_root(self, root: int) -> int:
        """Root body that stands for all trees that pins tie to the tree of the body `root`."""
        return self.ties[root]

    def spatial(self) -> Iterator[Pairs]:
        """Yield couplings of bodies with all bodies of their tree, and with the trees and chambers that push them."""
        for root in np.unique([self.tree_root(root) for root in self.bodies["root"]]):
            own = [self.tree_states(root, order) for order in (0, 1)]
            yield all_pairs(unique_states(*own), unique_states(*own))
        for row in self.bushings:
            ends = [self.points[row[end]]["body"] for end in ("from_point", "to_point")]
            read = [self.chain_states(i, order) for i in ends if i >= 0 for order in (0, 1)]
            roots = {self.tree_root(self.bodies[i]["root"]) for i in ends if i >= 0}
            yield all_pairs(unique_states(*(self.tree_states(root, 1) for root in roots)), unique_states(*read))
        for row in [*self.braces, *self.pistons]:
            if row["line"] < 0:
                continue
            ends = [self.points[k]["body"] for k in self.ends_of_line(row) if k >= 0]
            roots = {self.tree_root(self.bodies[i]["root"]) for i in ends if i >= 0}
            read = [self.places(row, 0), self.places(row, 1)]
            if "rod" in row.dtype.names:
                read += [self.own(row["a"]), self.own(row["b"])]
            yield all_pairs(unique_states(*(self.tree_states(root, 1) for root in roots)), unique_states(*read))

    def pressures(self) -> list[np.ndarray]:
        """For each node, the states that set its pressure.

        In a group of nodes without storage these are the states of all flows into the group.
        """
        ends = map(ends_of, self.joints())
        group = union(len(self.nodes), [(i, j) for i, j in ends if self.inner[i] and self.inner[j]])
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
        joined = [unique_states(*parts) for parts in enter]
        return [joined[group[i]] if self.inner[i] else self.pressure_states(i) for i in range(len(group))]

    def stored(self) -> Iterator[Pairs]:
        """Yield pairs (rates, states) of the masses in tanks, chambers and patches, and of the mass ledger.

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
        for row in self.pistons:
            swept = unique_states() if row["line"] >= 0 else self.places(row, 1)
            for i, other in ((row["a"], row["b"]), (row["b"], row["a"])):
                into[i] += [swept, *([self.pressure_states(other)] if row["leakage"] > 0.0 else [])]
        for i in np.flatnonzero(~self.inner):
            yield all_pairs(unique_states(self.own(i), self.behind(i), self.size + i), unique_states(*into[i]))

    def column_pairs(self) -> Iterator[Pairs]:
        """Yield couplings of the flow of each rigid column with the pressures at both ends."""
        for column in self.columns:
            yield all_pairs(unique_states(column["y"]), unique_states(*(self.sets[i] for i in ends_of(column))))

    def moving(self) -> Iterator[Pairs]:
        """Yield couplings of positions of masses with their velocities, and of these with adjacent masses and chambers.

        The couplings of bodies, see `spatial`, follow.
        """
        at = self.masses[self.masses >= 0]
        yield at, at + 1
        for row in [*self.braces, *self.pistons]:
            if row["line"] >= 0:
                continue
            read = [self.places(row, 0), self.places(row, 1)]
            if "rod" in row.dtype.names:
                read += [self.own(row["a"]), self.own(row["b"])]
            yield all_pairs(self.places(row, 1), unique_states(*read))
        yield from self.spatial()

    def device_pairs(self) -> Iterator[Pairs]:
        """Yield couplings of the states of each device with each other, and with pressures.

        The pressures are those at its ends and at the node that it senses.
        """
        for row in self.devices:
            ends = ends_of(self.valves[row["valve"]]) if row["valve"] >= 0 else ()
            read = [self.sets[i] for i in (*ends, row["node"]) if i >= 0]
            yield all_pairs(self.device_states(row), unique_states(self.device_states(row), *read))

    def wall_pairs(self) -> Iterator[Pairs]:
        """Yield couplings of basin cells with the travel of moving walls, and of this travel with masses and bodies.

        The masses and bodies are those that move the walls; their couplings with the cells at the walls are included.
        """
        for wall in self.walls:
            basin, mass = self.basins[wall["basin"]], self.masses[wall["mass"]] if wall["mass"] >= 0 else -1
            speed = unique_states(mass + 1) if mass >= 0 else unique_states()
            if wall["body"] >= 0:
                speed = self.joint_states(self.bodies[wall["body"]], 1)
            yield all_pairs(pattern.all_states(basin), unique_states(wall["y"], speed))
            yield all_pairs(unique_states(wall["y"]), speed)
            behind = self.integers[wall["faces"] + wall["count"] :][: wall["count"]]
            cells = pattern.cells_read(pattern.neighbours(basin), behind)
            yield all_pairs(speed, unique_states(wall["y"], pattern.cell_states(basin, cells)))

    def moving_fluid_pairs(self) -> Iterator[Pairs]:
        """Yield couplings of fluid on bodies and of the bodies that it moves.

        They depend on each other, and on chambers that push the bodies.
        """
        trees: dict[int, list] = {}
        for basin in self.basins:
            if basin.row["body"] >= 0:
                trees.setdefault(self.tree_root(self.bodies[basin.row["body"]]["root"]), []).append(
                    pattern.all_states(basin)
                )
        for index, cells in self.moving_fluid_states() if len(self.moving_segments) else ():
            trees.setdefault(self.tree_root(self.bodies[self.moving_segments[index]["body"]]["root"]), []).append(cells)
        for root, cells in trees.items():
            own = [self.tree_states(root, order) for order in (0, 1)]
            if own[0].size == 0:
                continue
            both = unique_states(*cells, own[1])
            pushing = [self.own(row[side]) for row in self.pistons if row["line"] >= 0 for side in ("a", "b")]
            yield all_pairs(both, unique_states(*cells, *own, *pushing))

    def moving_fluid_states(self) -> Iterator[tuple[int, np.ndarray]]:
        """Yield (row of `moving_segments`, its states and those that set its pressures) for the fluid on bodies."""
        for i, node in enumerate(self.nodes):
            if node["moving_segment"] >= 0:
                yield node["moving_segment"], unique_states(self.own(i), self.sets[i])
        for row in (*self.pipes, *self.columns):
            if row["moving_segment"] >= 0:
                own = row["y"] + np.arange(2 * row["cells"]) if "cells" in row.dtype.names else row["y"]
                at_ends = (self.sets[row[end]] for end in ("from_node", "to_node"))
                yield row["moving_segment"], unique_states(own, *at_ends)

    # pipes ------------------------------------------------------------------------------------------------------

    def coupled(self, pipe) -> bool:
        """True if the rate of each wave depends on all states that the rate of either wave reads."""
        rough = pipe["friction"] in (rec.FRICTION_ROUGH, rec.FRICTION_HAZEN)
        return bool(not self.linear or rough or (pipe["loss"] != 0.0 and not self.upwind))

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
            read = unique_states(self.sets[i], self.edge_cells(pipe, right), enters[: self.reach.entering])
            yield all_pairs(enters[near], read)
            yield all_pairs(leaves[last], leaves[: self.reach.leaving])
            if self.coupled(pipe):
                yield all_pairs(leaves[near], read)
                yield all_pairs(enters[last], leaves[: self.reach.leaving])


def ends_of(link) -> tuple[int, int]:
    """Indices of the nodes at both ends of a link."""
    return int(link["from_node"]), int(link["to_node"])


def unique_states(*parts) -> np.ndarray:
    """Sorted indices of states, each once, from arrays or numbers."""
    return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(np.atleast_1d(part) for part in parts)]))


def all_pairs(rows: np.ndarray, states: np.ndarray) -> Pairs:
    """Couplings of all given rows with all given states : (row, state) of each pair."""
    return np.repeat(rows, states.size), np.tile(states, rows.size)
