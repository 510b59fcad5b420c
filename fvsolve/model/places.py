"""Forces of bodies and masses at places other than those of the start. Knows tables; looks for nothing.

Pressures and rates are those of the start; lines, springs, stops and bushings act as they do at that place, and water
that rides on bodies lies level there. Pins, and pistons whose shut chambers hold, are constraints whose forces are
given. Unknowns are freedoms of joints as velocities have them, then places of masses.
"""

from __future__ import annotations

import numpy as np

from fvsolve.basins.lower import at_start
from fvsolve.kernels import records as rec
from fvsolve.model.masses import pushed_masses
from fvsolve.model.statics import GAPS, HOLD, LINES, MOTION, Statics

BESIDE = 1e-6  # [rad], [m] by which differences are taken
CHAMBERS, PUSHES = "kernels.masses: chambers", "kernels.masses: finish_masses"


class Displaced(Statics):
    """What freedoms and masses feel where they may be put; y : states, deviations from the start."""

    def __init__(self, draft) -> None:
        super().__init__(draft, draft.case.numerics.start)
        self.bodies, self.masses = draft.body_table, draft.mass_table
        self.freedoms = len(draft.freedom_table)
        self.free = np.flatnonzero(self.masses["y"] >= 0)
        self.size = self.freedoms + len(self.free)
        draft.freedom_table["balance"] = 0.0
        self.written.armed[:] = 1.0  # a stop that is not touched does not push
        self.locked, self.pins = list(draft.locked), int(draft.pin_table["rows"].sum())
        self.held = [draft.piston_table[k]["force"].item() for k in self.locked]
        self.first = len(draft.brace_table) + len(draft.stop_table)
        self.count = self.pins + len(self.locked)
        self.hold(np.zeros(self.count))

    def hold(self, sizes: np.ndarray) -> None:
        """Let pins, then pistons that are held, push as much."""
        at = 0
        for row in self.draft.pin_table:
            row["force"][: row["rows"]] = sizes[at : at + row["rows"]]
            at += int(row["rows"])
        for k, own, size in zip(self.locked, self.held, sizes[at:], strict=True):
            self.draft.piston_table[k]["force"] = own + size

    def stand(self, y: np.ndarray) -> None:
        """Bodies, lines and water at places, water level again; pressures as they were."""
        self.y[:] = y
        self.run(*(MOTION,) * (self.freedoms > 0), *(CHAMBERS,) * (len(self.masses) > 0))
        first = int(self.layout["pressure"])
        for row in self.draft.piston_table:
            self.out[[first + row["a"], first + row["b"]]] = 0.0
        if (self.draft.basin_table["frame"] >= 0).any():
            level = at_start(self.draft.basins, self.draft.size, self.attitudes())
            for basin in self.draft.basins:
                basin.own(self.y)[:] = basin.own(level)

    def force(self, y: np.ndarray) -> np.ndarray:
        """Forces of freedoms, then of masses."""
        self.stand(y)
        if len(self.masses):
            self.run(PUSHES)
        own = np.zeros(0)
        if self.freedoms:
            self.run(*self.pushes[1:], *(HOLD,) * (len(self.draft.pin_table) > 0))
            own = self.forces()
        net = self.out[int(self.layout["net_force"]) :][: len(self.masses)]
        return np.concatenate([own, net[self.free]])

    def scale(self) -> np.ndarray:
        """What forces can be to each freedom and mass, as bodies stand."""
        found, first = np.zeros(self.size), int(self.layout["push"])
        pushes = self.out[first : first + len(self.draft.push_names)].copy()
        if self.freedoms:
            found[: self.freedoms] = self.sizes(pushes)
        net = found[self.freedoms :]
        for push, ends in zip(pushes, pushed_masses(self.draft), strict=True):
            net += abs(push) * np.isin(self.free, ends)
        for row in self.draft.piston_table:
            parts = [self.draft.node_table[row[side]]["pressure"] * row[f"area_{side}"] for side in "ab"]
            net += sum(parts) * np.isin(self.free, (row["case"], row["rod"]))
        for row in self.draft.wall_table:
            net += abs(row["rest"]) * (self.free == row["mass"])
        return found

    def rows(self, y: np.ndarray) -> np.ndarray:
        """What each constraint of size one is to freedoms and masses : float64[constraints, size]."""
        found = np.zeros((self.count, self.size))
        if not self.count:
            return found
        self.stand(y)
        still = self.by(np.zeros_like(self.loads()))
        for i in range(self.pins):
            self.hold(np.eye(self.count)[i])
            self.loads()[:] = 0.0
            self.run(HOLD)
            found[i, : self.freedoms] = self.forces() - still
        self.hold(np.zeros(self.count))
        for i, k in enumerate(self.locked):
            found[self.pins + i] = self.lever(k)
        return found

    def lever(self, k: int) -> np.ndarray:
        """What piston k is to freedoms and masses where it pushes by one, bodies standing as they do."""
        found, piston = np.zeros(self.size), self.draft.piston_table[k]
        if piston["line"] < 0:
            for mass, sign in ((piston["case"], -1.0), (piston["rod"], 1.0)):
                found[self.freedoms :] += sign * (self.free == mass)
            return found
        still, first = self.by(np.zeros_like(self.loads())), int(self.layout["push"])
        self.loads()[:] = 0.0
        self.out[first : first + len(self.draft.push_names)] = 0.0
        self.out[first + self.first + k] = 1.0
        self.run(LINES)
        found[: self.freedoms] = self.forces() - still
        return found

    def oil(self, y: np.ndarray) -> np.ndarray:
        """What fluid shut in behind pistons adds to -dF/dq, A^2 K / V of each chamber : float64[size, size]."""
        found, nodes, first = np.zeros((self.size, self.size)), self.draft.node_table, int(self.layout["stiffness"])
        self.stand(np.zeros_like(y))
        per_mass = self.out[first : first + self.draft.moving].copy()  # where chambers hold what they start with
        for k, sides in self.draft.shut.items():
            row = self.draft.piston_table[k]
            self.stand(y)
            travel = self.out[int(self.layout["travel"]) + 2 * (self.first + k)]
            lever, stiff = self.lever(k), 0.0
            for side, sign in (("a", 1.0), ("b", -1.0)):
                node, area = nodes[row[side]], row[f"area_{side}"]
                bulk = per_mass[node["row"]] * node["mass"]
                stiff += area**2 * bulk / (node["volume"] + sign * area * travel) if side in sides else 0.0
            found += stiff * np.outer(lever, lever)
        return found

    def gaps(self, y: np.ndarray) -> np.ndarray:
        """How far constraints are from being met [m]."""
        self.stand(y)
        found, travel = [], int(self.layout["travel"])
        if len(self.draft.pin_table):
            self.run(GAPS)
            at = int(self.layout["pin"])
            found = [self.out[at + 3 * k + r] for k, row in enumerate(self.draft.pin_table) for r in range(row["rows"])]
        return np.array([*found, *(self.out[travel + 2 * (self.first + k)] for k in self.locked)])

    def mass(self, y: np.ndarray) -> np.ndarray:
        """M : float64[size, size] [kg], [kg m2]."""
        found, n = np.zeros((self.size, self.size)), self.freedoms
        if n:
            self.force(y)
        for j, row in enumerate(self.draft.freedom_table):
            path = self.draft.tables.integers[row["path"] : row["path"] + row["depth"] + 1]
            found[j, path] = found[path, j] = self.written.scratch[8 * n + row["row"] :][: row["depth"] + 1]
        found[range(n, self.size), range(n, self.size)] = 1.0 / self.masses["lightness"][self.free]
        return found

    def stiffness(self, y: np.ndarray) -> np.ndarray:
        """-dF/dq by differences, constraints pushing as they do : float64[size, size]."""
        found = np.zeros((self.size, self.size))
        for i in range(self.size):
            way = BESIDE * np.eye(self.size)[i]
            found[:, i] = (self.force(self.moved(y, -way)) - self.force(self.moved(y, way))) / (2.0 * BESIDE)
        return found

    def moving(self) -> bool:
        """Whether something moves at a rate that is stated."""
        poses = self.draft.case.poses.values()
        fast = any(np.any(pose.spin) or np.any(pose.velocity) for pose in poses)
        return fast or bool(np.any(self.masses["velocity"]))

    def moved(self, y: np.ndarray, way: np.ndarray) -> np.ndarray:
        """States where freedoms and masses went on by so much; Euler parameters turn in axes of their body."""
        found = y.copy()
        for row in self.bodies:
            own, at = way[row["freedom"] : row["freedom"] + row["freedoms"]], int(row["y"])
            if row["joint"] in (rec.BALL, rec.FREE):
                slides = 3 if row["joint"] == rec.FREE else 0
                found[at : at + slides] += own[:slides]
                at += slides
                start = row["start"][slides : slides + 4]
                found[at : at + 4] = turned(start + y[at : at + 4], own[slides:]) - start
            elif len(own):
                found[at] += own[0]
        found[self.masses["y"][self.free]] += way[self.freedoms :]
        return found

    def turns(self) -> np.ndarray:
        """Which unknowns are angles : bool[size]."""
        found = np.zeros(self.size, bool)
        for row in self.bodies:
            slides = {rec.FREE: 3, rec.PRISMATIC: 1}.get(int(row["joint"]), 0)
            found[row["freedom"] + slides : row["freedom"] + row["freedoms"]] = True
        return found

    def shortest(self) -> float:
        """Length of the shortest line between two points at the start [m]."""
        lengths = self.draft.line_table["length"][self.draft.line_table["acts"] == rec.ALONG]
        return float(min(lengths, default=np.inf))

    def attitudes(self) -> dict[str, np.ndarray]:
        """R of every body now, by name."""
        from fvsolve.kernels.mechanism.room import ATTITUDE

        return {name: self.row_of(i)[ATTITUDE : ATTITUDE + 9].reshape(3, 3).copy()
                for i, name in enumerate(self.draft.body_names)}  # fmt: skip


def turned(e: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Euler parameters after a turn by a vector [rad] in axes of the body, (44) of it behind them."""
    angle = float(np.linalg.norm(turn))
    half = 0.5 * angle
    eta, eps = np.cos(half), (np.sin(half) / angle if angle > 0.0 else 0.5) * turn
    return np.concatenate([[e[0] * eta - e[1:] @ eps], e[0] * eps + eta * e[1:] + np.cross(e[1:], eps)])
