"""Couplings of masses and bodies, of chambers of cylinders, and of fluid on bodies, for the pattern of the Jacobian."""

from collections.abc import Iterator

import numpy as np

from fvsolve.core.assembly.features import FeaturePattern
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model.jacobian_pattern import Pairs
from fvsolve.core.model.state_pairs import pairs_of, unique_states
from fvsolve.core.steady import union
from fvsolve.parts import law_elements as codes


class MotionPattern(FeaturePattern):
    """Couplings by motion; couplings : see `model.jacobian_pattern.Couplings`.

    ties : for each body the root of the trees that pins tie to its tree
    """

    def __init__(self, feature, couplings) -> None:
        super().__init__(feature)
        self.model = couplings
        self.masses, self.pistons = feature.mass_table["y"], feature.piston_table
        self.braces = [*feature.brace_table, *feature.stop_table]
        self.bodies, self.lines, self.points = (
            feature.body_table,
            feature.line_table,
            feature.point_table,
        )
        self.moving_segments, self.bushings = feature.moving_segment_table, feature.bushing_table
        joined = [
            [self.points[pin[end]]["body"] for end in ("from_point", "to_point")]
            for pin in feature.pin_table
        ]
        joined = [[int(self.bodies[i]["root"]) for i in pair] for pair in joined if min(pair) >= 0]
        self.ties = union(len(self.bodies), joined)

    # what others ask ----------

    def pressure(self, i: int) -> np.ndarray:
        return unique_states(
            *(self.places(row, 0) for row in self.pistons if i in (row["a"], row["b"]))
        )

    def inflows(self) -> Iterator[tuple[int, np.ndarray]]:
        for row in self.pistons:
            swept = unique_states() if row["line"] >= 0 else self.places(row, 1)
            for i, other in ((row["a"], row["b"]), (row["b"], row["a"])):
                leak = [self.model.pressure_states(other)] if row["leakage"] > 0.0 else []
                yield i, unique_states(swept, *leak)

    def source(self, row) -> np.ndarray | None:
        return (
            unique_states(*self.pushing_states(int(row["index"])))
            if row["kind"] == codes.FORCE_INPUT
            else None
        )

    def probe(self, row) -> np.ndarray | None:
        kind, i = int(row["kind"]), int(row["index"])
        if kind in (rec.POSITION, rec.VELOCITY):
            return unique_states(self.masses[i] + (kind == rec.VELOCITY))
        if kind in (rec.PISTON_POSITION, rec.PISTON_VELOCITY):
            return self.places(self.pistons[i], int(kind == rec.PISTON_VELOCITY))
        return None

    def schedules(self) -> set[int]:
        return {int(row["schedule"]) for row in self.braces if "schedule" in row.dtype.names}

    # pairs ----------

    def pairs(self) -> Iterator[Pairs]:
        yield from self.moving()
        yield from self.moving_fluid_pairs()

    def moving(self) -> Iterator[Pairs]:
        """Yield couplings of positions of masses with their velocities, and of these with adjacent masses and chambers.

        Bodies are coupled with all bodies of their tree, and with the trees and chambers that push them.
        """
        at = self.masses[self.masses >= 0]
        yield at, at + 1
        for root in np.unique([self.tree_root(root) for root in self.bodies["root"]]):
            own = unique_states(*(self.tree_states(root, order) for order in (0, 1)))
            yield pairs_of(own, own)
        for row in self.bushings:
            points = row["from_point"], row["to_point"]
            read = [self.chain_states(i, order) for i in self.bodies_at(points) for order in (0, 1)]
            yield pairs_of(self.tree_velocities(points), unique_states(*read))
        for row in [*self.braces, *self.pistons]:
            read = [self.places(row, 0), self.places(row, 1)]
            read += [self.model.schedule(row["schedule"])] if "schedule" in row.dtype.names else []
            if "rod" in row.dtype.names:
                read += [self.model.own(row["a"]), self.model.own(row["b"])]
            pushed = (
                self.places(row, 1)
                if row["line"] < 0
                else self.tree_velocities(self.ends_of_line(row))
            )
            yield pairs_of(pushed, unique_states(*read))

    def pushing_states(self, mass: int) -> Iterator[np.ndarray]:
        """Yield states of all force elements that act on a mass."""
        for row in [*self.braces, *self.pistons]:
            ends = ("case", "rod") if "rod" in row.dtype.names else ("from_mass", "to_mass")
            if mass in (row[ends[0]], row[ends[1]]):
                yield from (self.places(row, 0), self.places(row, 1))
                if "schedule" in row.dtype.names:
                    yield self.model.schedule(row["schedule"])
                if "rod" in row.dtype.names:
                    yield from (self.model.own(row["a"]), self.model.own(row["b"]))

    def moving_fluid_pairs(self) -> Iterator[Pairs]:
        """Yield couplings of fluid on bodies and of the bodies that it moves.

        They depend on each other, and on chambers that push the bodies.
        """
        trees: dict[int, list] = {}
        for body, states in (pair for own in self.model.features for pair in own.on_bodies()):
            trees.setdefault(self.tree_root(self.bodies[body]["root"]), []).append(states)
        for index, cells in self.moving_fluid_states() if len(self.moving_segments) else ():
            trees.setdefault(
                self.tree_root(self.bodies[self.moving_segments[index]["body"]]["root"]), []
            ).append(cells)
        for root, cells in trees.items():
            own = [self.tree_states(root, order) for order in (0, 1)]
            if own[0].size == 0:
                continue
            both = unique_states(*cells, own[1])
            pushing = [
                self.model.own(row[side])
                for row in self.pistons
                if row["line"] >= 0
                for side in ("a", "b")
            ]
            yield pairs_of(both, unique_states(*cells, *own, *pushing))

    def moving_fluid_states(self) -> Iterator[tuple[int, np.ndarray]]:
        """Yield (row of `moving_segments`, its states and those that set its pressures) for the fluid on bodies."""
        for i, node in enumerate(self.model.nodes):
            if node["forcing"] >= 0:
                yield node["forcing"], unique_states(self.model.own(i), self.model.sets[i])
        for row in (*self.model.pipes, *self.model.columns):
            if row["forcing"] >= 0:
                own = (
                    row["y"] + np.arange(2 * row["cells"])
                    if "cells" in row.dtype.names
                    else row["y"]
                )
                at_ends = (self.model.sets[row[end]] for end in ("from_node", "to_node"))
                yield row["forcing"], unique_states(own, *at_ends)

    # states of masses and joints ----------

    def places(self, row, order: int) -> np.ndarray:
        """States of the positions (`order` 0) or velocities (1) of the masses or bodies that a row joins."""
        if row["line"] >= 0:
            return unique_states(
                *(self.chain_states(i, order) for i in self.bodies_at(self.ends_of_line(row)))
            )
        ends = ("case", "rod") if "rod" in row.dtype.names else ("from_mass", "to_mass")
        return np.array(
            [self.masses[row[end]] + order for end in ends if self.masses[row[end]] >= 0],
            dtype=np.int64,
        )

    def ends_of_line(self, row) -> tuple[int, int]:
        """Rows of the two points of a force element's line of action; -1 for the world instead of a first point."""
        line = self.lines[row["line"]]
        return int(line["from_point"]), int(line["to_point"])

    def bodies_at(self, points) -> list[int]:
        """Bodies to which points belong; points of the world, and -1 in place of a point, are left out."""
        bodies = (int(self.points[k]["body"]) for k in points if k >= 0)
        return [i for i in bodies if i >= 0]

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
        return (
            body["rate"] + np.arange(count)
            if order
            else body["y"] + np.arange(count + (count >= 3))
        )

    def tree_states(self, root: int, order: int) -> np.ndarray:
        """States of the coordinates (`order` 0) or velocities (1) of a tree of bodies and trees that pins tie to it."""
        bodies = [body for body in self.bodies if self.tree_root(body["root"]) == root]
        return unique_states(*(self.joint_states(body, order) for body in bodies))

    def tree_root(self, root: int) -> int:
        """Root body that stands for all trees that pins tie to the tree of the body `root`."""
        return self.ties[root]

    def tree_velocities(self, points) -> np.ndarray:
        """States of the velocities of all trees of bodies to which points belong."""
        roots = {self.tree_root(self.bodies[i]["root"]) for i in self.bodies_at(points)}
        return unique_states(*(self.tree_states(root, 1) for root in roots))
