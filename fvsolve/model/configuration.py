"""Forces of bodies and masses in configurations other than that of the start.

Pressures and velocities are those of the start. Lines of action, springs, stops and bushings act as in the
configuration; water in basins on bodies is level there. Pins, and pistons with closed chambers that support a load, are
constraints with given forces. Unknowns q are displacements along joint freedoms, then positions of masses.
"""

from __future__ import annotations

import numpy as np

from fvsolve.basins.lower import basin_start
from fvsolve.kernels import dtypes as rec
from fvsolve.model.mass_tables import pushed_masses
from fvsolve.model.static_forces import GAPS, HOLD, LINES, MOTION, StaticForces

DIFFERENCE_STEP = 1e-6  # step of finite differences [rad], [m]
CHAMBERS, PUSHES = "kernels.mass_dynamics: piston_chambers", "kernels.mass_dynamics: mass_rates"


class Configuration(StaticForces):
    """Forces on joint freedoms and masses in any configuration.

    A configuration is a state vector y : float64[n], deviations from the start. `size` is the number of unknowns,
    `count` the number of constraints. Tables of the draft are changed: forces of pins and supporting pistons, `balance`
    of freedoms.
    """

    def __init__(self, draft) -> None:
        super().__init__(draft, draft.case.numerics.start)
        self.bodies, self.masses = draft.body_table, draft.mass_table
        self.freedoms = len(draft.freedom_table)
        self.free = np.flatnonzero(self.masses["y"] >= 0)
        self.size = self.freedoms + len(self.free)
        draft.freedom_table["balance"] = 0.0
        self.written.armed[:] = 1.0  # with flags set, a stop without contact exerts no force
        self.locked, self.pins = list(draft.locked), int(draft.pin_table["rows"].sum())
        self.starting_forces = [draft.piston_table[k]["force"].item() for k in self.locked]
        self.first = len(draft.brace_table) + len(draft.stop_table)
        self.count = self.pins + len(self.locked)
        self.hold(np.zeros(self.count))

    def hold(self, sizes: np.ndarray) -> None:
        """Set the constraint forces : float64[constraints] [N].

        They are the forces of pins, then the forces of supporting pistons in addition to those at the start.
        """
        at = 0
        for row in self.draft.pin_table:
            row["force"][: row["rows"]] = sizes[at : at + row["rows"]]
            at += int(row["rows"])
        for k, own, size in zip(self.locked, self.starting_forces, sizes[at:], strict=True):
            self.draft.piston_table[k]["force"] = own + size

    def move_to(self, y: np.ndarray) -> None:
        """Move bodies and lines of action to a configuration, with level water and the pressures of the start."""
        self.y[:] = y
        self.run(*(MOTION,) * (self.freedoms > 0), *(CHAMBERS,) * (len(self.masses) > 0))
        first = int(self.layout["pressure"])
        for row in self.draft.piston_table:
            self.out[[first + row["a"], first + row["b"]]] = 0.0
        if (self.draft.basin_table["frame"] >= 0).any():
            level = basin_start(self.draft.basins, self.draft.size, self.attitudes())
            for basin in self.draft.basins:
                basin.states_of(self.y)[:] = basin.states_of(level)

    def force(self, y: np.ndarray) -> np.ndarray:
        """Generalised forces in a configuration : float64[size] [N], [N m], on joint freedoms, then on masses."""
        self.move_to(y)
        if len(self.masses):
            self.run(PUSHES)
        own = np.zeros(0)
        if self.freedoms:
            self.run(*self.pushes[1:], *(HOLD,) * (len(self.draft.pin_table) > 0))
            own = self.forces()
        net = self.out[int(self.layout["net_force"]) :][: len(self.masses)]
        return np.concatenate([own, net[self.free]])

    def scale(self) -> np.ndarray:
        """Upper bound of the sum of force magnitudes on each joint freedom and mass : float64[size].

        It is that in the configuration of the last call of `move_to` or `force`.
        """
        sizes, first = np.zeros(self.size), int(self.layout["push"])
        pushes = self.out[first : first + len(self.draft.push_names)].copy()
        if self.freedoms:
            sizes[: self.freedoms] = self.sizes(pushes)
        net = sizes[self.freedoms :]
        for push, ends in zip(pushes, pushed_masses(self.draft), strict=True):
            net += abs(push) * np.isin(self.free, ends)
        for row in self.draft.piston_table:
            parts = [self.draft.node_table[row[side]]["pressure"] * row[f"area_{side}"] for side in "ab"]
            net += sum(parts) * np.isin(self.free, (row["case"], row["rod"]))
        for row in self.draft.wall_table:
            net += abs(row["rest"]) * (self.free == row["mass"])
        return sizes

    def rows(self, y: np.ndarray) -> np.ndarray:
        """Generalised forces that each constraint force of magnitude 1 causes : float64[constraints, size].

        Afterwards the constraint forces are 0.
        """
        effects = np.zeros((self.count, self.size))
        if not self.count:
            return effects
        self.move_to(y)
        base = self.by(np.zeros_like(self.loads()))
        for i in range(self.pins):
            self.hold(np.eye(self.count)[i])
            self.loads()[:] = 0.0
            self.run(HOLD)
            effects[i, : self.freedoms] = self.forces() - base
        self.hold(np.zeros(self.count))
        for i, k in enumerate(self.locked):
            effects[self.pins + i] = self.lever(k)
        return effects

    def lever(self, k: int) -> np.ndarray:
        """Generalised forces that a push of 1 N of piston k causes in the current configuration : float64[size]."""
        effects, piston = np.zeros(self.size), self.draft.piston_table[k]
        if piston["line"] < 0:
            for mass, sign in ((piston["case"], -1.0), (piston["rod"], 1.0)):
                effects[self.freedoms :] += sign * (self.free == mass)
            return effects
        base, first = self.by(np.zeros_like(self.loads())), int(self.layout["push"])
        self.loads()[:] = 0.0
        self.out[first : first + len(self.draft.push_names)] = 0.0
        self.out[first + self.first + k] = 1.0
        self.run(LINES)
        effects[: self.freedoms] = self.forces() - base
        return effects

    def fluid_stiffness(self, y: np.ndarray) -> np.ndarray:
        """Stiffness matrix of the fluid trapped behind pistons : float64[size, size], to be added to `stiffness`.

        Each chamber has the stiffness A^2 K / V: piston area A [m2], bulk modulus K [Pa], volume V [m3].
        """
        matrix, nodes, first = np.zeros((self.size, self.size)), self.draft.node_table, int(self.layout["stiffness"])
        self.move_to(np.zeros_like(y))
        per_mass = self.out[first : first + self.draft.moving].copy()  # with chambers at their starting mass
        for k, sides in self.draft.shut.items():
            row = self.draft.piston_table[k]
            self.move_to(y)
            travel = self.out[int(self.layout["travel"]) + 2 * (self.first + k)]
            lever, stiffness = self.lever(k), 0.0
            for side, sign in (("a", 1.0), ("b", -1.0)):
                node, area = nodes[row[side]], row[f"area_{side}"]
                bulk = per_mass[node["row"]] * node["mass"]
                stiffness += area**2 * bulk / (node["volume"] + sign * area * travel) if side in sides else 0.0
            matrix += stiffness * np.outer(lever, lever)
        return matrix

    def gaps(self, y: np.ndarray) -> np.ndarray:
        """Gaps of pins, then travel of supporting pistons, in a configuration : float64[constraints] [m]."""
        self.move_to(y)
        pin_gaps, travel = [], int(self.layout["travel"])
        if len(self.draft.pin_table):
            self.run(GAPS)
            at = int(self.layout["pin"])
            pin_gaps = [
                self.out[at + 3 * k + r] for k, row in enumerate(self.draft.pin_table) for r in range(row["rows"])
            ]
        return np.array([*pin_gaps, *(self.out[travel + 2 * (self.first + k)] for k in self.locked)])

    def mass(self, y: np.ndarray) -> np.ndarray:
        """Mass matrix of the unknowns : float64[size, size] [kg], [kg m2]."""
        matrix, n = np.zeros((self.size, self.size)), self.freedoms
        if n:
            self.force(y)
        for j, row in enumerate(self.draft.freedom_table):
            path = self.draft.tables.integers[row["path"] : row["path"] + row["depth"] + 1]
            matrix[j, path] = matrix[path, j] = self.written.scratch[8 * n + row["row"] :][: row["depth"] + 1]
        matrix[range(n, self.size), range(n, self.size)] = 1.0 / self.masses["lightness"][self.free]
        return matrix

    def stiffness(self, y: np.ndarray) -> np.ndarray:
        """Stiffness matrix -dF/dq by central differences, with constant constraint forces : float64[size, size].

        F : generalised forces; q : unknowns
        """
        matrix = np.zeros((self.size, self.size))
        for i in range(self.size):
            step = DIFFERENCE_STEP * np.eye(self.size)[i]
            matrix[:, i] = (self.force(self.after_step(y, -step)) - self.force(self.after_step(y, step))) / (
                2.0 * DIFFERENCE_STEP
            )
        return matrix

    def moving(self) -> bool:
        """True if the case states a velocity of a body or mass."""
        poses = self.draft.case.poses.values()
        bodies_move = any(np.any(pose.spin) or np.any(pose.velocity) for pose in poses)
        return bodies_move or bool(np.any(self.masses["velocity"]))

    def after_step(self, y: np.ndarray, step: np.ndarray) -> np.ndarray:
        """State vector after a change `step` of the unknowns; ball joints and free bodies rotate about body axes."""
        new = y.copy()
        for row in self.bodies:
            own, at = step[row["freedom"] : row["freedom"] + row["freedoms"]], int(row["y"])
            if row["joint"] in (rec.BALL, rec.FREE):
                slides = 3 if row["joint"] == rec.FREE else 0
                new[at : at + slides] += own[:slides]
                at += slides
                start = row["start"][slides : slides + 4]
                new[at : at + 4] = rotated(start + y[at : at + 4], own[slides:]) - start
            elif len(own):
                new[at] += own[0]
        new[self.masses["y"][self.free]] += step[self.freedoms :]
        return new

    def angular(self) -> np.ndarray:
        """True for each unknown that is an angle : bool[size]."""
        angular = np.zeros(self.size, bool)
        for row in self.bodies:
            slides = {rec.FREE: 3, rec.PRISMATIC: 1}.get(int(row["joint"]), 0)
            angular[row["freedom"] + slides : row["freedom"] + row["freedoms"]] = True
        return angular

    def shortest(self) -> float:
        """Length of the shortest line of action between two points at the start [m]; infinite without lines."""
        lengths = self.draft.line_table["length"][self.draft.line_table["acts"] == rec.ALONG]
        return float(min(lengths, default=np.inf))

    def attitudes(self) -> dict[str, np.ndarray]:
        """Rotation matrix of every body in the current configuration : name -> float64[3, 3]."""
        from fvsolve.kernels.mechanism.body_layout import ATTITUDE

        return {name: self.row_of(i)[ATTITUDE : ATTITUDE + 9].reshape(3, 3).copy()
                for i, name in enumerate(self.draft.body_names)}  # fmt: skip


def rotated(e: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Euler parameters `e` followed by a rotation by a vector [rad] in axes of the body; (44) of docs/course.md."""
    angle = float(np.linalg.norm(rotation))
    half = 0.5 * angle
    eta, eps = np.cos(half), (np.sin(half) / angle if angle > 0.0 else 0.5) * rotation
    return np.concatenate([[e[0] * eta - e[1:] @ eps], e[0] * eps + eta * e[1:] + np.cross(e[1:], eps)])
