"""Search for the static equilibrium of bodies, with forces in any configuration, and its notices.

The unknowns q are displacements along joint freedoms, then positions of masses, F the forces on them, M the mass matrix
and K = -dF/dq the stiffness. Pressures and velocities are those of the start. Lines of action, springs, stops,
bushings, solenoids and dry friction of cylinders act as in the configuration; water in basins on bodies is level
there. Pins, and pistons with closed chambers that support a load, are constraints with given forces.

Steps are computed in the coordinates M^(1/2) dq: there K has squares of angular frequencies as eigenvalues, and lengths
and angles have comparable weight. The search runs in the directions that constraints leave free. If all eigenvalues are
positive, a step is Newton's step. A negative eigenvalue enters by its magnitude, so that bodies move away from an
unstable position. A position that is stated and in balance is kept, stable or not; so is a coordinate on which no force
and no stiffness act.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from fvsolve import attitude, units
from fvsolve.case import checks
from fvsolve.case.bodies import joint_coordinate
from fvsolve.core.assembly.model_draft import EQUILIBRIUM_SHARE, ROUNDING_SHARE
from fvsolve.core.kernels import dtypes as rec
from fvsolve.errors import Notice
from fvsolve.features.motion.kernels import tables as records
from fvsolve.features.motion.kernels.tables import motion_of
from fvsolve.features.motion.lower import pushed_masses
from fvsolve.features.motion.static_forces import (
    FOLDER,
    GAPS,
    HOLD,
    LINES,
    MOTION,
    RANK_TOLERANCE,
    StaticForces,
)
from fvsolve.parts.attitude_keys import Attitude
from fvsolve.parts.schedule import constant
from fvsolve.parts.table_model import RunTimes

DIFFERENCE_STEP = 1e-6  # step of finite differences [rad], [m]
CHAMBERS, PUSHES = f"{FOLDER}.mass_dynamics: piston_chambers", f"{FOLDER}.mass_dynamics: mass_rates"


class Configuration(StaticForces):
    """Forces on joint freedoms and masses in any configuration.

    A configuration is a state vector y : float64[n], deviations from the start. `size` is the number of unknowns,
    `count` the number of constraints. Tables of the draft are changed: forces of pins and supporting pistons, `balance`
    of freedoms.
    """

    def __init__(self, draft) -> None:
        motion = motion_of(draft)
        super().__init__(draft, draft.case.numerics.start)
        self.bodies, self.masses = motion.body_table, motion.mass_table
        self.freedoms = len(motion.freedom_table)
        self.free = np.flatnonzero(self.masses["y"] >= 0)
        self.size = self.freedoms + len(self.free)
        motion.freedom_table["balance"] = 0.0
        self.written.armed[:] = 1.0  # with flags set, a stop without contact exerts no force
        self.locked, self.pins = list(motion.locked), int(motion.pin_table["rows"].sum())
        self.starting_forces = [motion.piston_table[k]["force"].item() for k in self.locked]
        self.first = len(motion.brace_table) + len(motion.stop_table)
        self.count = self.pins + len(self.locked)
        self.by_features = np.zeros(len(self.masses))
        self.hold(np.zeros(self.count))

    def hold(self, sizes: np.ndarray) -> None:
        """Set the constraint forces : float64[constraints] [N].

        They are the forces of pins, then the forces of supporting pistons in addition to those at the start.
        """
        at = 0
        for row in self.motion.pin_table:
            row["force"][: row["rows"]] = sizes[at : at + row["rows"]]
            at += int(row["rows"])
        for k, own, size in zip(self.locked, self.starting_forces, sizes[at:], strict=True):
            self.motion.piston_table[k]["force"] = own + size

    def move_to(self, y: np.ndarray) -> None:
        """Move bodies and lines of action to a configuration, with level water and the pressures of the start."""
        self.y[:] = y
        self.run(*(MOTION,) * (self.freedoms > 0), *(CHAMBERS,) * (len(self.masses) > 0))
        first = int(self.layout["pressure"])
        for row in self.motion.piston_table:
            self.out[[first + row["a"], first + row["b"]]] = 0.0
        for feature in self.draft.features:
            feature.level(self.draft, self.y, self.attitudes)

    def force(self, y: np.ndarray) -> np.ndarray:
        """Generalised forces in a configuration : float64[size] [N], [N m], on joint freedoms, then on masses."""
        self.move_to(y)
        if len(self.masses):
            self.run(PUSHES)
        own = np.zeros(0)
        if self.freedoms:
            self.run(*self.pushes[1:], *(HOLD,) * (len(self.motion.pin_table) > 0))
            own = self.forces()
        net = self.out[int(self.layout["net_force"]) :][: len(self.masses)].copy()
        self.by_features[:] = self.forces_of_features(net)
        return np.concatenate([own, (net + self.by_features)[self.free]])

    def forces_of_features(self, net: np.ndarray) -> np.ndarray:
        """Forces of features on masses in the current configuration : float64[masses] [N].

        net : float64[masses]  net forces of force elements and pistons [N]
        """
        forces, masses = np.zeros(len(self.masses)), self.masses
        before = masses["position"].copy(), masses["force"].copy()
        masses["position"][self.free] += self.y[masses["y"][self.free]]
        masses["force"] = net
        for feature in self.draft.features:
            for name, acceleration in feature.accelerations(self.draft).items():
                i = self.motion.mass_index[name]
                forces[i] = acceleration / masses["lightness"][i] - net[i]
        masses["position"], masses["force"] = before
        return forces

    def scale(self) -> np.ndarray:
        """Upper bound of the sum of force magnitudes on each joint freedom and mass : float64[size].

        It is that in the configuration of the last call of `move_to` or `force`.
        """
        sizes, first = np.zeros(self.size), int(self.layout["push"])
        pushes = self.out[first : first + len(self.motion.push_names)].copy()
        if self.freedoms:
            sizes[: self.freedoms] = self.sizes(pushes)
        net = sizes[self.freedoms :]
        for push, ends in zip(pushes, pushed_masses(self.draft), strict=True):
            net += abs(push) * np.isin(self.free, ends)
        for row in self.motion.piston_table:
            parts = [
                self.draft.node_table[row[side]]["pressure"] * row[f"area_{side}"] for side in "ab"
            ]
            net += sum(parts) * np.isin(self.free, (row["case"], row["rod"]))
        net += np.abs(self.by_features[self.free])
        for row in self.motion.still_pushes:
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
        effects, piston = np.zeros(self.size), self.motion.piston_table[k]
        if piston["line"] < 0:
            for mass, sign in ((piston["case"], -1.0), (piston["rod"], 1.0)):
                effects[self.freedoms :] += sign * (self.free == mass)
            return effects
        base, first = self.by(np.zeros_like(self.loads())), int(self.layout["push"])
        self.loads()[:] = 0.0
        self.out[first : first + len(self.motion.push_names)] = 0.0
        self.out[first + self.first + k] = 1.0
        self.run(LINES)
        effects[: self.freedoms] = self.forces() - base
        return effects

    def fluid_stiffness(self, y: np.ndarray) -> np.ndarray:
        """Stiffness matrix of the fluid trapped behind pistons : float64[size, size], to be added to `stiffness`.

        Each chamber has the stiffness A^2 K / V: piston area A [m2], bulk modulus K [Pa], volume V [m3].
        """
        matrix = np.zeros((self.size, self.size))
        nodes = self.draft.node_table
        first = int(self.layout["stiffness"])
        self.move_to(np.zeros_like(y))
        # with chambers at their starting mass
        per_mass = self.out[first : first + self.draft.moving].copy()
        for k, sides in self.motion.shut.items():
            row = self.motion.piston_table[k]
            self.move_to(y)
            travel = self.out[int(self.layout["travel"]) + 2 * (self.first + k)]
            lever, stiffness = self.lever(k), 0.0
            for side, sign in (("a", 1.0), ("b", -1.0)):
                node, area = nodes[row[side]], row[f"area_{side}"]
                bulk = per_mass[node["row"]] * node["mass"]
                stiffness += (
                    area**2 * bulk / (node["volume"] + sign * area * travel)
                    if side in sides
                    else 0.0
                )
            matrix += stiffness * np.outer(lever, lever)
        return matrix

    def gaps(self, y: np.ndarray) -> np.ndarray:
        """Gaps of pins, then travel of supporting pistons, in a configuration : float64[constraints] [m]."""
        self.move_to(y)
        pin_gaps, travel = [], int(self.layout["travel"])
        if len(self.motion.pin_table):
            self.run(GAPS)
            at = int(self.layout["pin"])
            rows = enumerate(self.motion.pin_table)
            pin_gaps = [self.out[at + 3 * k + r] for k, row in rows for r in range(row["rows"])]
        return np.array(
            [*pin_gaps, *(self.out[travel + 2 * (self.first + k)] for k in self.locked)]
        )

    def mass(self, y: np.ndarray) -> np.ndarray:
        """Mass matrix of the unknowns : float64[size, size] [kg], [kg m2]."""
        matrix, n = np.zeros((self.size, self.size)), self.freedoms
        if n:
            self.force(y)
        for j, row in enumerate(self.motion.freedom_table):
            path = self.draft.tables.integers[row["path"] : row["path"] + row["depth"] + 1]
            matrix[j, path] = matrix[path, j] = self.written.scratch[8 * n + row["row"] :][
                : row["depth"] + 1
            ]
        matrix[range(n, self.size), range(n, self.size)] = 1.0 / self.masses["lightness"][self.free]
        return matrix

    def stiffness(self, y: np.ndarray) -> np.ndarray:
        """Stiffness matrix -dF/dq by central differences, with constant constraint forces : float64[size, size].

        F : generalised forces; q : unknowns
        """
        matrix = np.zeros((self.size, self.size))
        for i in range(self.size):
            step = DIFFERENCE_STEP * np.eye(self.size)[i]
            change = self.force(self.after_step(y, -step)) - self.force(self.after_step(y, step))
            matrix[:, i] = change / (2.0 * DIFFERENCE_STEP)
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
            if row["joint"] in (records.BALL, records.FREE):
                slides = 3 if row["joint"] == records.FREE else 0
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
            slides = {records.FREE: 3, records.PRISMATIC: 1}.get(int(row["joint"]), 0)
            angular[row["freedom"] + slides : row["freedom"] + row["freedoms"]] = True
        return angular

    def shortest(self) -> float:
        """Length of the shortest line of action between two points at the start [m]; infinite without lines."""
        lengths = self.motion.line_table["length"][self.motion.line_table["acts"] == records.ALONG]
        return float(min(lengths, default=np.inf))

    def attitudes(self) -> dict[str, np.ndarray]:
        """Rotation matrix of every body in the current configuration : name -> float64[3, 3]."""
        from fvsolve.core.kernels.moving_frames import ATTITUDE

        return {
            name: self.row_of(i)[ATTITUDE : ATTITUDE + 9].reshape(3, 3).copy()
            for i, name in enumerate(self.motion.body_names)
        }


def rotated(e: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Euler parameters `e` followed by a rotation by a vector [rad] in axes of the body; (44) of docs/course.md."""
    angle = float(np.linalg.norm(rotation))
    half = 0.5 * angle
    eta, eps = np.cos(half), (np.sin(half) / angle if angle > 0.0 else 0.5) * rotation
    return np.concatenate(
        [[e[0] * eta - e[1:] @ eps], e[0] * eps + eta * e[1:] + np.cross(e[1:], eps)]
    )


MOVE_TOLERANCE = 1e-15  # smaller changes of a length or an angle count as none, relative


def moved_nodes(at: Configuration, y: np.ndarray) -> dict[str, Any]:
    """Bodies and masses that moved in the search, with their new positions : name -> part; y : state vector found."""
    draft, nodes = at.draft, {}
    for name, row in zip(at.motion.body_names, at.bodies, strict=True):
        body, first = draft.case.nodes.get(name), int(row["y"])
        count = {records.BALL: 4, records.FREE: 7}.get(int(row["joint"]), int(row["freedoms"]))
        moves = np.abs(y[first : first + count]) > MOVE_TOLERANCE * (
            1.0 + np.abs(row["start"][:count])
        )
        if body is not None and np.any(moves):
            change = joint_keys(body.joint, row, row["start"][:count] + y[first : first + count])
            nodes[name] = body.model_copy(update={"joint": body.joint.model_copy(update=change)})
    distance = np.abs(y[at.masses["y"][at.free]])
    for i in at.free[distance > MOVE_TOLERANCE * (1.0 + np.abs(at.masses["position"][at.free]))]:
        name, place = at.motion.mass_names[i], at.masses["position"][i] + y[at.masses["y"][i]]
        nodes[name] = draft.case.nodes[name].model_copy(update={"initial_position": float(place)})
    return nodes


def joint_keys(joint: Any, row, q: np.ndarray) -> dict[str, Any]:
    """Keys of a joint with the values that follow from its coordinates q : key -> value."""
    if row["joint"] in (records.REVOLUTE, records.PRISMATIC):
        return {"angle" if row["joint"] == records.REVOLUTE else "travel": constant(float(q[0]))}
    turn = attitude.of_euler_parameters(q[-4:])
    if row["joint"] == records.FREE:
        place = q[:3] - turn @ row["centre"]
        return {"at": tuple(place.tolist()), "attitude": attitude_from(turn)}
    return {"attitude": attitude_from(joint.attitude.rotation @ turn)}


def attitude_from(rotation: np.ndarray) -> Attitude:
    """Attitude keys with the Euler parameters of a rotation matrix."""
    return Attitude().model_copy(
        update={"euler_parameters": tuple(attitude.euler_parameters(rotation).tolist())}
    )


def position_notices(case) -> Iterator[Notice]:
    """Yield notices of bodies and masses whose equilibrium position differs from the stated position."""
    for name, node in case.equilibrium_nodes.items():
        before = case.nodes[name]
        if node.kind == "mass":
            stated, found = before.initial_position, node.initial_position
            yield coordinate_notice(case, name, "initial_position", stated, found, "position")
        elif node.joint.kind in ("revolute", "prismatic"):
            key, dimension = (
                ("angle", "angle") if node.joint.kind == "revolute" else ("travel", "position")
            )
            stated, found = (joint_coordinate(part.joint, 0.0) for part in (before, node))
            yield coordinate_notice(case, name, f"joint.{key}", stated, found, dimension)
        else:
            stated, free = case.as_stated.poses[name], node.joint.kind == "free"
            yield from attitude_notices(case, name, free, case.poses[name], stated)


def attitude_notices(case, name: str, free: bool, pose, before) -> Iterator[Notice]:
    """Yield a notice of the equilibrium attitude of a body with a ball or free joint.

    A free body gives a second notice, of its position.
    free : True for a free body; pose, before : pose in equilibrium, and as stated
    """
    turn = attitude.axis_angle(attitude.deviation(pose.attitude, before.attitude))[1]
    roll, pitch, yaw = np.degrees(attitude.roll_pitch_yaw(pose.attitude))
    text = f"roll {roll:.6g}, pitch {pitch:.6g}, yaw {yaw:.6g} deg, turned by {math.degrees(turn):.4g} deg"
    yield Notice(
        "start", f"nodes.{name}", f"{name}: forces balance at {text}", "joint.attitude", turn, 0.0
    )
    if free:
        own, far = case.unit_of("position"), float(np.linalg.norm(pose.place - before.place))
        x, y, z = units.convert(pose.place, "position", own)
        text = f"[{x:.6g}, {y:.6g}, {z:.6g}] {own}, {case.amount(far, 'position')} from the stated position"
        yield Notice(
            "start", f"nodes.{name}", f"{name}: forces balance at {text}", "joint.at", far, 0.0
        )


def coordinate_notice(
    case, name: str, key: str, before: float, now: float, dimension: str
) -> Notice:
    """Notice of a coordinate whose equilibrium value `now` differs from its stated value `before`."""
    result, stated = (case.amount(value, dimension, 6) for value in (now, before))
    text = f"{name}: forces balance at {key.removeprefix('joint.')} {result}, stated {stated}"
    return Notice("start", f"nodes.{name}", text, key, now, before)


def owner_name(at: Configuration, unknown: int) -> str:
    """Name of the body or mass to which an unknown belongs; for a sloshing mode the name of its basin."""
    if unknown >= at.freedoms:
        return at.motion.mass_names[at.free[unknown - at.freedoms]]
    ends = at.bodies["freedom"] + at.bodies["freedoms"]
    return at.motion.body_names[int(np.searchsorted(ends, unknown, side="right"))].partition(" ")[0]


def report_unbalanced(at: Configuration, force: np.ndarray, scale: np.ndarray) -> None:
    """Add a fault for every body and mass with an unbalanced force at the end of the search.

    force, scale : float64[size]  forces on the unknowns, and sums of their magnitudes
    """
    angular, unbalanced = at.angular(), np.abs(force) > EQUILIBRIUM_SHARE * scale
    for name in dict.fromkeys(owner_name(at, int(i)) for i in np.flatnonzero(unbalanced)):
        own = np.array([owner_name(at, i) == name for i in range(at.size)])
        residuals = [
            f"{np.linalg.norm(force[own & part]):.4g} {unit}"
            for part, unit in ((~angular, "N"), (angular, "N m"))
            if np.any(unbalanced & own & part)
        ]
        text = f'"equilibrium" finds no position where the forces on {name} balance: {" and ".join(residuals)} remain'
        remedy = "add a spring, a cylinder or a driven joint as support, state a position nearer to equilibrium"
        at.draft.fault(f"nodes.{name}", f'{text}; {remedy}, or use initial = "steady"')


def refuse_overturned(at: Configuration, y: np.ndarray) -> None:
    """Add a fault if a tank or basin on a body is overturned in the equilibrium found."""
    at.out[rec.STATUS] = rec.OK
    at.force(y)
    if at.out[rec.STATUS] != rec.NO_WEIGHT:
        return
    names = [*(part.name for part in at.draft.meshed), *at.draft.case.places]
    name = names[int(at.out[rec.WHERE])]
    text = f"{name} is turned over in the equilibrium found, and its contents would run out"
    at.draft.fault(
        f"nodes.{name}",
        f'{text}; hold the body upright, state another position, or use initial = "steady"',
    )


MAX_STEPS, MAX_HALVINGS = 100, 30
MAX_TURN = 0.3  # largest rotation in a step [rad]
MAX_STRETCH = 0.5  # largest displacement in a step, as a share of the shortest line
ZERO_STIFFNESS = 1e-9  # share of the greatest eigenvalue below which the stiffness counts as zero
LEAST_STIFFNESS = 1e-6  # same share: least magnitude used in a step, and threshold of instability
# unbalanced share of forces up to which a stated position counts as an intended equilibrium
STATED_TOLERANCE = 1e-4
GAP_TOLERANCE = 1e-14  # gap of constraints that counts as closed [m]
MAX_REVERSAL = 0.5  # a step may reverse the force along it up to this share


@dataclass(frozen=True)
class StaticState:
    """Configuration and its forces.

    y : state vector; force : forces on the unknowns [N], [N m]; scale : sums of the magnitudes of their parts
    rows : float64[constraints, size]  constraint matrix; gaps : gaps of the constraints [m]
    """

    y: np.ndarray
    force: np.ndarray
    scale: np.ndarray
    rows: np.ndarray
    gaps: np.ndarray

    @property
    def share(self) -> float:
        """Greatest unbalanced force, relative to the sum of the magnitudes of its parts."""
        return float(
            np.max(np.abs(self.force) / np.where(self.scale > 0.0, self.scale, 1.0), initial=0.0)
        )

    @property
    def open(self) -> float:
        """Greatest gap of a constraint [m]."""
        return float(np.max(np.abs(self.gaps), initial=0.0))

    def clearly_better(self, other: Self) -> bool:
        """True if the unbalanced share or the greatest gap is less than half that of the other configuration.

        Values below the limits of rounding count as these limits.
        """
        own, others = (
            (max(place.share, ROUNDING_SHARE), max(place.open, GAP_TOLERANCE))
            for place in (self, other)
        )
        return own[0] < 0.5 * others[0] or own[1] < 0.5 * others[1]


def with_equilibrium(case, draft) -> tuple[Any, list[Notice]]:
    """Case with bodies and masses in static equilibrium, and notices about it : (case, notices).

    draft : tables of the case with its steady start. If a velocity is stated, nothing moves from its stated position.
    Raises CaseError if no equilibrium is found, or if the positions found are not possible.
    """
    at = Configuration(draft)
    if not at.size or at.moving():
        return case, []
    result = search(at)
    if result.share <= EQUILIBRIUM_SHARE:
        refuse_overturned(at, result.y)
    else:
        report_unbalanced(at, result.force, result.scale)
    draft.check()
    case = replace(case, equilibrium_nodes=moved_nodes(at, result.y))
    nodes = case.nodes | case.equilibrium_nodes
    groups = {"links": case.links, "nodes": nodes}
    surroundings = (case.ambient_pressure, case.gravity, None, None, RunTimes(at.t))
    for keys, text in checks.part_faults(groups, *surroundings, case.meshes, case.lumped):
        draft.fault(".".join(map(str, keys)), f"where forces balance {text}")
    draft.check()
    return case, [*position_notices(case), *instability_notices(at, result)]


def evaluate_configuration(at: Configuration, y: np.ndarray) -> StaticState:
    """Forces and gaps in the configuration y.

    Constraint forces minimise the unbalanced forces, in the norm of the inverse mass matrix.
    """
    rows = at.rows(y)
    gaps = at.gaps(y)
    sizes = np.zeros(at.count)
    at.hold(sizes)
    force = at.force(y)
    if at.count:
        inverse_root = np.linalg.inv(np.linalg.cholesky(at.mass(y)))
        sizes = -np.linalg.lstsq(inverse_root @ rows.T, inverse_root @ force, rcond=RANK_TOLERANCE)[
            0
        ]
        at.hold(sizes)
        force = at.force(y)
    return StaticState(y, force, at.scale(), rows, gaps)


def search(at: Configuration) -> StaticState:
    """Equilibrium reached by Newton steps, or if none is reached the best configuration that was visited."""
    here = best = evaluate_configuration(at, at.y.copy())
    intended = here.share <= STATED_TOLERANCE
    for _ in range(MAX_STEPS):
        if here.share <= ROUNDING_SHARE and here.open <= GAP_TOLERANCE:
            return here
        new = evaluate_configuration(at, limited_step(at, here, *step(at, here, intended)))
        if not np.all(np.isfinite(new.force)):
            break
        if here.share <= EQUILIBRIUM_SHARE and not new.clearly_better(here):
            return min(here, new, key=lambda place: place.share)
        here = new
        best = here if here.clearly_better(best) else best
    return best


def step(at: Configuration, here: StaticState, intended: bool) -> tuple[np.ndarray, np.ndarray]:
    """Newton step : (change of all unknowns, its part in the directions that constraints leave free).

    intended : if True, the step goes to the nearest equilibrium, stable or not
    """
    inverse_root, free, close = free_directions(at, here)
    k = inverse_root @ at.stiffness(here.y) @ inverse_root.T
    own, pull = free.T @ k @ free, free.T @ (inverse_root @ here.force - k @ close)
    values, modes = np.linalg.eigh(0.5 * (own + own.T))
    great = np.max(np.abs(values), initial=0.0)
    flat, pulls = np.abs(values) <= ZERO_STIFFNESS * great, modes.T @ pull
    pulls[
        flat & (np.abs(pulls) <= EQUILIBRIUM_SHARE * np.linalg.norm(inverse_root @ here.scale))
    ] = 0.0
    if intended or not (np.any(values[~flat] < 0.0) or np.any(pulls[flat])):
        way = np.linalg.pinv(own, rcond=ZERO_STIFFNESS) @ pull
    else:
        way = modes @ (pulls / np.maximum(np.abs(values), LEAST_STIFFNESS * great or 1.0))
    return inverse_root.T @ (close + free @ way), inverse_root.T @ free @ way


def free_directions(
    at: Configuration, here: StaticState
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions of a step : (L^-1, basis of the directions that constraints leave free, step that closes gaps).

    L : factor of the mass matrix M = L L'. The basis and the closing step are in the coordinates L' dq.
    """
    inverse_root = np.linalg.inv(np.linalg.cholesky(at.mass(here.y)))
    if not at.count:
        return inverse_root, np.eye(at.size), np.zeros(at.size)
    rows = here.rows @ inverse_root.T
    _, sizes, directions = np.linalg.svd(rows)
    rank = int(np.sum(sizes > RANK_TOLERANCE * sizes[0]))
    return (
        inverse_root,
        directions[rank:].T,
        -np.linalg.pinv(rows, rcond=RANK_TOLERANCE) @ here.gaps,
    )


def limited_step(
    at: Configuration, here: StaticState, move: np.ndarray, free: np.ndarray
) -> np.ndarray:
    """State vector after a step, shortened to limit rotations, displacements and a reversal of the force along it.

    move : step of all unknowns; free : its part in the directions that constraints leave free
    """
    angular = at.angular()
    excess = [
        np.max(np.abs(move[angular]), initial=0.0) / MAX_TURN,
        np.max(np.abs(move[~angular]), initial=0.0) / (MAX_STRETCH * at.shortest()),
    ]
    share, before = 1.0 / max(1.0, *excess), here.force @ free
    for _ in range(MAX_HALVINGS if before > 0.0 else 0):
        if at.force(at.after_step(here.y, share * move)) @ free >= -MAX_REVERSAL * before:
            break
        share *= 0.5
    return at.after_step(here.y, share * move)


def instability_notices(at: Configuration, result: StaticState) -> list[Notice]:
    """List with a notice if the equilibrium is unstable; else empty. Closed chambers count as springs."""
    inverse_root, free, _ = free_directions(at, result)
    own = (
        free.T
        @ inverse_root
        @ (at.stiffness(result.y) + at.fluid_stiffness(result.y))
        @ inverse_root.T
        @ free
    )
    values, modes = np.linalg.eigh(0.5 * (own + own.T))
    if not len(values) or values[0] >= -LEAST_STIFFNESS * np.max(np.abs(values)):
        return []
    name = owner_name(at, int(np.argmax(np.abs(free @ modes[:, 0]))))
    rate = float(np.sqrt(-values[0]))
    duration = at.draft.case.amount(1.0 / rate, "time", 3)
    text = (
        f"{name}: its forces balance, but the equilibrium is unstable: a small displacement grows by a factor e in "
        f"{duration}; state another position, or add a support such as a spring"
    )
    return [Notice("start", f"nodes.{name}", text, "stability", rate, 0.0)]
