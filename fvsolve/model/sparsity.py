"""Which states the rate of each state can depend on, from the tables of a model alone. Knows indices; no values.

A pipe's cells depend on their neighbours as far as the scheme reaches. Where a pipe meets a node, what it offers
(its edge cells) is read by the node, and what the node makes of all offers together is read by the cells that look
beyond the end. Tanks, chambers and given pressures part one group of nodes from the next: their pressure is their own,
but for chambers of cylinders, whose pressure is that of their masses too. Cells of a basin depend on those about them
(`basins.lower_pattern`), and a patch is a node whose pressure the cells behind it set.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fvsolve.basins import lower_pattern as pattern
from fvsolve.kernels import records as rec
from fvsolve.schemes import SCHEMES, Reach
from fvsolve.steady import union

Pairs = tuple[np.ndarray, np.ndarray]  # rows, and as many states that they depend on


def reach_of(scheme: str, settings) -> Reach:
    """Reach of a model's scheme; pipes too short for it reach no further."""
    reach = SCHEMES[scheme].reach
    if settings["floor"] > 0.0:  # cavities: both waves from both sides
        return Reach(reach.behind, reach.behind, 2 * reach.behind - 1, 3)
    return reach


class Couplings:
    """The couplings of one model while they are collected."""

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
        self.rides = tables.rides
        self.bushings = tables.bushings
        joined = [[self.points[pin[end]]["body"] for end in ("from_point", "to_point")] for pin in tables.pins]
        joined = [[int(self.bodies[i]["root"]) for i in pair] for pair in joined if min(pair) >= 0]
        self.ties = union(len(self.bodies), joined)
        self.devices = tables.devices
        self.basins, self.integers, self.walls = model.basins, tables.integers, tables.walls
        self.patches = {int(row["node"]): row for row in tables.patches}
        self.sets = self.pressures()  # of each node, the states that set its pressure

    def pairs(self) -> Iterator[Pairs]:
        """All couplings but those of a state with itself."""
        for pipe in self.pipes:
            if pipe["delay"] >= 0:
                yield every(states(pipe["y"]), states(*(self.sets[i] for i in ends_of(pipe))))
                continue
            yield from self.inside(pipe)
            yield from self.beyond(pipe)
            yield from self.remembered(pipe)
            yield from self.crept(pipe)
        for basin in self.basins:
            yield pattern.inside(basin)
        yield from self.passing()
        yield from self.stored()
        yield from self.rigid()
        yield from self.moving()
        yield from self.driven()
        yield from self.walled()
        yield from self.riding()

    def passing(self) -> Iterator[Pairs]:
        """What passes an open patch, on the cells there."""
        for i, row in self.patches.items():
            basin, behind = self.basins[row["basin"]], row["ring"] + row["faces"]
            if row["open"]:
                cells = pattern.about(pattern.neighbours(basin), self.integers[behind : behind + row["faces"]])
                yield every(states(self.size + i), pattern.of_cells(basin, cells))

    # nodes ------------------------------------------------------------------------------------------------------

    def joints(self) -> list:
        """Links whose ends are solved together: valves, short delay lines, columns that valves can lead."""
        return [*self.valves, *self.short, *(column for column in self.columns if self.led(column))]

    def led(self, column) -> bool:
        """Whether there are openings at which a column's flow follows the valves at its end."""
        return any(self.nodes["gates"][i] >= 0 for i in ends_of(column))

    def own(self, i: int) -> np.ndarray:
        """The state that is the mass stored in node i, or none."""
        y = self.nodes["y"][i]
        return np.array([y] if y >= 0 else [], dtype=np.int64)

    def behind(self, i: int, quantities: int | None = None) -> np.ndarray:
        """States of the cells behind a patch, of its basin's first quantities or all; none of another node."""
        if i not in self.patches:
            return states()
        row = self.patches[i]
        cells = self.integers[row["first"] : row["first"] + row["count"]]
        return pattern.of_cells(self.basins[row["basin"]], cells, quantities)

    def held(self, i: int) -> np.ndarray:
        """The states that set the pressure of a node that stores: its mass, its cells, and where its piston is."""
        if i in self.patches:
            return states(self.behind(i, 1), *(self.walls["y"][self.walls["basin"] == self.patches[i]["basin"]]))
        filled = (self.held_by(row) for row in self.devices if row["row"] >= 0 and row["node"] == i)
        moved = (self.places(row, 0) for row in self.pistons if i in (row["a"], row["b"]))
        return states(self.own(i), *moved, *filled)

    def held_by(self, device) -> np.ndarray:
        """The states of a device."""
        return device["y"] + np.arange(device["states"] if device["y"] >= 0 else 0)

    def opens(self, link) -> np.ndarray:
        """The states that open and shut a link."""
        if "device" not in link.dtype.names or link["device"] < 0:
            return states()
        return self.held_by(self.devices[link["device"]])

    def places(self, row, what: int) -> np.ndarray:
        """Positions (`what` 0) or velocities (1) of what a row joins, where they are states."""
        if row["line"] >= 0:
            ends = (self.points[k]["body"] for k in self.ends_of_line(row) if k >= 0)
            return states(*(self.of_chain(i, what) for i in ends if i >= 0))
        ends = ("case", "rod") if "rod" in row.dtype.names else ("from_mass", "to_mass")
        return np.array([self.masses[row[end]] + what for end in ends if self.masses[row[end]] >= 0], dtype=np.int64)

    def ends_of_line(self, row) -> tuple[int, int]:
        """Points that the line of a push joins."""
        line = self.lines[row["line"]]
        return int(line["from_point"]), int(line["to_point"])

    def of_chain(self, i: int, what: int) -> np.ndarray:
        """Coordinates (`what` 0) or velocities (1) of body i and of all that it hangs on."""
        found = [states()]
        while i >= 0:
            found.append(self.of_joint(self.bodies[i], what))
            i = self.bodies[i]["parent"]
        return states(*found)

    def of_joint(self, body, what: int) -> np.ndarray:
        """The same of its own joint; a joint of as many freedoms has four Euler parameters for three of them."""
        many = int(body["freedoms"])
        if not many:
            return states()
        return body["rate"] + np.arange(many) if what else body["y"] + np.arange(many + (many >= 3))

    def of_tree(self, root: int, what: int) -> np.ndarray:
        """The same of a whole tree, and of those that pins tie to it."""
        return states(*(self.of_joint(body, what) for body in self.bodies if self.tied(body["root"]) == root))

    def tied(self, root: int) -> int:
        """The first root of all trees that pins tie together."""
        return self.ties[root]

    def spatial(self) -> Iterator[Pairs]:
        """Bodies: all of a tree on one another, and on what pushes it: other trees, chambers."""
        for root in np.unique([self.tied(root) for root in self.bodies["root"]]):
            own = [self.of_tree(root, what) for what in (0, 1)]
            yield every(states(*own), states(*own))
        for row in self.bushings:
            ends = [self.points[row[end]]["body"] for end in ("from_point", "to_point")]
            felt = [self.of_chain(i, what) for i in ends if i >= 0 for what in (0, 1)]
            roots = {self.tied(self.bodies[i]["root"]) for i in ends if i >= 0}
            yield every(states(*(self.of_tree(root, 1) for root in roots)), states(*felt))
        for row in [*self.braces, *self.pistons]:
            if row["line"] < 0:
                continue
            ends = [self.points[k]["body"] for k in self.ends_of_line(row) if k >= 0]
            roots = {self.tied(self.bodies[i]["root"]) for i in ends if i >= 0}
            felt = [self.places(row, 0), self.places(row, 1)]
            if "rod" in row.dtype.names:
                felt += [self.own(row["a"]), self.own(row["b"])]
            yield every(states(*(self.of_tree(root, 1) for root in roots)), states(*felt))

    def pressures(self) -> list[np.ndarray]:
        """Of each node, the states that set its pressure: its own, or all that enter its group."""
        ends = map(ends_of, self.joints())
        group = union(len(self.nodes), [(i, j) for i, j in ends if self.inner[i] and self.inner[j]])
        enter: list[list] = [[] for _ in group]
        for pipe in self.pipes:
            for right, i in enumerate(ends_of(pipe)):
                enter[group[i]].append(self.offered(pipe, right))
        for column in self.columns:
            for i in ends_of(column):
                enter[group[i]].append(column["y"])
        for link in self.joints():
            i, j = ends_of(link)
            enter[group[i]] += [self.held(j), self.opens(link)]
            enter[group[j]] += [self.held(i), self.opens(link)]
        joined = [states(*some) for some in enter]
        return [joined[group[i]] if self.inner[i] else self.held(i) for i in range(len(group))]

    def stored(self) -> Iterator[Pairs]:
        """What flows into tanks, chambers, patches and given pressures: what they hold, and their row of the ledger."""
        into = [[self.held(i)] for i in range(len(self.nodes))]
        for pipe in self.pipes:
            for right, i in enumerate(ends_of(pipe)):
                into[i].append(self.offered(pipe, right))
        for link in self.joints():
            i, j = ends_of(link)
            into[i] += [self.sets[j], self.opens(link)]
            into[j] += [self.sets[i], self.opens(link)]
        for column in self.columns:
            for i in ends_of(column):
                into[i].append(column["y"])
        for row in self.pistons:
            swept = states() if row["line"] >= 0 else self.places(row, 1)
            for i, other in ((row["a"], row["b"]), (row["b"], row["a"])):
                into[i] += [swept, *([self.held(other)] if row["leakage"] > 0.0 else [])]
        for i in np.flatnonzero(~self.inner):
            yield every(states(self.own(i), self.behind(i), self.size + i), states(*into[i]))

    def rigid(self) -> Iterator[Pairs]:
        """A column's flow feels the pressures of both its ends."""
        for column in self.columns:
            yield every(states(column["y"]), states(*(self.sets[i] for i in ends_of(column))))

    def moving(self) -> Iterator[Pairs]:
        """A mass's position on its velocity, and that on what pushes it: masses beside it, and chambers."""
        at = self.masses[self.masses >= 0]
        yield at, at + 1
        for row in [*self.braces, *self.pistons]:
            if row["line"] >= 0:
                continue
            felt = [self.places(row, 0), self.places(row, 1)]
            if "rod" in row.dtype.names:
                felt += [self.own(row["a"]), self.own(row["b"])]
            yield every(self.places(row, 1), states(*felt))
        yield from self.spatial()

    def driven(self) -> Iterator[Pairs]:
        """What devices hold, on itself and on the pressures at their ends and at the place they sense."""
        for row in self.devices:
            ends = ends_of(self.valves[row["valve"]]) if row["valve"] >= 0 else ()
            felt = [self.sets[i] for i in (*ends, row["node"]) if i >= 0]
            yield every(self.held_by(row), states(self.held_by(row), *felt))

    def walled(self) -> Iterator[Pairs]:
        """Cells on where walls of their basin stand and how fast these move, and bodies on the cells before them."""
        for wall in self.walls:
            basin, mass = self.basins[wall["basin"]], self.masses[wall["mass"]] if wall["mass"] >= 0 else -1
            speed = states(mass + 1) if mass >= 0 else states()
            if wall["body"] >= 0:
                speed = self.of_joint(self.bodies[wall["body"]], 1)
            yield every(pattern.all_of(basin), states(wall["y"], speed))
            yield every(states(wall["y"]), speed)
            behind = self.integers[wall["faces"] + wall["count"] :][: wall["count"]]
            cells = pattern.about(pattern.neighbours(basin), behind)
            yield every(speed, states(wall["y"], pattern.of_cells(basin, cells)))

    def riding(self) -> Iterator[Pairs]:
        """Water and the bodies that it moves: all on all, and on what pushes these."""
        trees: dict[int, list] = {}
        for basin in self.basins:
            if basin.row["body"] >= 0:
                trees.setdefault(self.tied(self.bodies[basin.row["body"]]["root"]), []).append(pattern.all_of(basin))
        for ride, cells in self.carried() if len(self.rides) else ():
            trees.setdefault(self.tied(self.bodies[self.rides[ride]["body"]]["root"]), []).append(cells)
        for root, cells in trees.items():
            own = [self.of_tree(root, what) for what in (0, 1)]
            if own[0].size == 0:
                continue
            both = states(*cells, own[1])
            felt = [self.own(row[side]) for row in self.pistons if row["line"] >= 0 for side in ("a", "b")]
            yield every(both, states(*cells, *own, *felt))

    def carried(self) -> Iterator[tuple[int, np.ndarray]]:
        """(row of `rides`, states of what rides there, and those that set its pressures)."""
        for i, node in enumerate(self.nodes):
            if node["ride"] >= 0:
                yield node["ride"], states(self.own(i), self.sets[i])
        for row in (*self.pipes, *self.columns):
            if row["ride"] >= 0:
                own = row["y"] + np.arange(2 * row["cells"]) if "cells" in row.dtype.names else row["y"]
                felt = (self.sets[row[end]] for end in ("from_node", "to_node"))
                yield row["ride"], states(own, *felt)

    # pipes ------------------------------------------------------------------------------------------------------

    def coupled(self, pipe) -> bool:
        """Whether the rates of both waves depend on all that either of them reads."""
        rough = pipe["friction"] in (rec.FRICTION_ROUGH, rec.FRICTION_HAZEN)
        return bool(not self.linear or rough or (pipe["loss"] != 0.0 and not self.upwind))

    def inside(self, pipe) -> Iterator[Pairs]:
        """Cells on their neighbours."""
        cells = np.arange(pipe["cells"])
        looks = np.arange(-self.reach.behind, self.reach.ahead + 1)
        at_once = [0] if pipe["loss"] != 0.0 else []
        for wave, looks_of in ((0, (looks, -looks)), (1, (-looks, looks))):
            other = looks_of[1] if self.coupled(pipe) else at_once
            for source, offsets in ((wave, looks_of[0]), (1 - wave, other)):
                for offset in offsets:
                    here = cells[(cells + offset >= 0) & (cells + offset < cells.size)]
                    first = pipe["y"] + source * cells.size
                    yield pipe["y"] + wave * cells.size + here, first + here + offset

    def remembered(self, pipe) -> Iterator[Pairs]:
        """Unsteady friction: waves on the flows that follow theirs, and these on the waves of their cell.

        Where the density changes what follows is the velocity, by two points of a cell that lean on its neighbours.
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

    def crept(self, pipe) -> Iterator[Pairs]:
        """Walls that creep: waves and elements of a cell on each other, and on what its pressure is averaged by."""
        n = int(pipe["cells"])
        cells, waves = np.arange(n), (pipe["y"], pipe["y"] + n)
        strains = [pipe["strain"] + k * n for k in range(pipe["elements"])]
        for offset in [0] if self.linear else [-1, 0, 1]:
            here = cells[(cells + offset >= 0) & (cells + offset < n)]
            for one in (*waves, *strains) if strains else ():
                for other in waves:
                    yield one + here, other + here + offset
        for wave in waves:
            for strain in strains:
                yield wave + cells, strain + cells

    def sides(self, pipe, right: int) -> tuple[np.ndarray, np.ndarray]:
        """(cells of the wave that enters by an end, cells of the one that leaves), nearest first."""
        forward = pipe["y"] + np.arange(pipe["cells"])
        backward = forward + pipe["cells"]
        return (backward[::-1], forward[::-1]) if right else (forward, backward)

    def offered(self, pipe, right: int) -> np.ndarray:
        """The edge cells that a node reads at one end of a pipe."""
        enters, leaves = self.sides(pipe, right)
        edge = slice(self.reach.leaving)
        return leaves[edge] if self.linear else states(leaves[edge], enters[edge])

    def beyond(self, pipe) -> Iterator[Pairs]:
        """Cells that look beyond an end: on the polynomial there and, where the wave enters, on the node."""
        for right, i in enumerate(ends_of(pipe)):
            enters, leaves = self.sides(pipe, right)
            near, last = slice(self.reach.behind), slice(max(self.reach.ahead, 1))
            read = states(self.sets[i], self.offered(pipe, right), enters[: self.reach.entering])
            yield every(enters[near], read)
            yield every(leaves[last], leaves[: self.reach.leaving])
            if self.coupled(pipe):
                yield every(leaves[near], read)
                yield every(enters[last], leaves[: self.reach.leaving])


def ends_of(link) -> tuple[int, int]:
    """Indices of the nodes at both ends of a link."""
    return int(link["from_node"]), int(link["to_node"])


def states(*parts) -> np.ndarray:
    """Indices of states, each once."""
    return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(np.atleast_1d(part) for part in parts)]))


def every(rows: np.ndarray, states: np.ndarray) -> Pairs:
    """Each of some rows on each of some states."""
    return np.repeat(rows, states.size), np.tile(states, rows.size)
