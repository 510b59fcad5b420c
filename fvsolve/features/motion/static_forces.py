"""Forces on joints at the start, computed by the kernels without a run, and the start of bodies and pins."""

import numpy as np

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.table_handle import make_handle, with_features
from fvsolve.core.model.run_data import zeros_for_run
from fvsolve.features.motion.kernels import tables as records
from fvsolve.features.motion.kernels.tables import motion_of

FOLDER = "fvsolve.features.motion.kernels"
MOTION = f"{FOLDER}.body_kinematics: kinematics"
LINES = f"{FOLDER}.bushings_and_pins: add_element_forces"
WEIGH = f"{FOLDER}.mass_matrix: start_mass_matrix"
ACCELERATE = f"{FOLDER}.mass_matrix: solve_accelerations"
BUSHINGS = f"{FOLDER}.bushings_and_pins: add_bushing_loads"
PINNED, GAPS, HOLD = (
    f"{FOLDER}.bushings_and_pins: {name}"
    for name in ("solve_pinned_accelerations", "start_gaps", "add_start_pin_forces")
)
LOADS = f"{FOLDER}.fluid_loads: add_fluid_loads"
INERTIAL = ("set_segment_drives", "moving_tank_pressures", "add_cell_drives", "moving_column_rates")
DRIVES, *DRIVEN = (f"{FOLDER}.inertial_forces: {name}" for name in INERTIAL)
NETWORKS = (DRIVES, *DRIVEN, LOADS)
NONE = np.zeros(0)


def call_pieces(
    all_tables, pieces: tuple[str, ...], t: float, y: np.ndarray, out: np.ndarray, rates=NONE
) -> None:
    """Call the named kernel functions in turn, in the way of the right-hand side; they write to `out` and run arrays.

    all_tables : tables of a model, arrays of a run, features; pieces : names "MODULE: FUNCTION"
    """
    from fvsolve.core.kernels import calls  # not loaded for cases without bodies
    from fvsolve.core.kernels.rhs_assembly import load_function

    addresses = calls.empty_calls(calls.JOBS, len(pieces) + 1)
    for k, piece in enumerate(pieces):
        addresses[calls.RHS, k] = calls.function_address(
            load_function(*piece.rsplit(".", 1)), calls.RATES
        )
    run = calls.compile_as(calls.rhs_in_turn, calls.RATES)
    tables, written, features = all_tables
    own = [None] * (1 + max(feature.slot for feature in features))
    for feature in features:
        own[feature.slot] = feature.tables()
    kept: list = []  # arrays behind the handle
    written = with_features(written, own, kept)
    handle = make_handle((*tables, *written, addresses, calls.empty_calls(0, len(calls.HOOKS))))
    run(t, y, rates, out, handle)


def arrays_without_seen(shapes: rec.RunArrays) -> rec.RunArrays:
    """Arrays that a run writes, with an empty `seen`, so that kernels read the state as given.

    `seen` would hold the state with wetted cells, which these kernels do not read.
    """
    return zeros_for_run(shapes)._replace(seen=np.zeros(0))


def mass_factor(model, y: np.ndarray) -> np.ndarray:
    """Work array `scratch` after `solve_accelerations` at the state y, which contains the factor of the mass matrix.

    From index 8 * freedoms on it holds the factor L of the mass matrix M = L' L, by the rows of `freedoms`. Its
    diagonal, of which kernels store reciprocals, is restored.
    """
    written, t = arrays_without_seen(model.shapes), model.case.numerics.start
    written.clock["limit"] = np.inf
    motion = motion_of(model)
    call_pieces(
        (model.tables, written, model.features), (MOTION, ACCELERATE), t, y.copy(), model.new_out()
    )
    freedoms = motion.freedom_table
    diagonal = 8 * len(freedoms) + freedoms["row"] + freedoms["depth"]
    written.scratch[diagonal] = 1.0 / written.scratch[diagonal]
    return written.scratch


class StaticForces:
    """Forces on joints at the start, computed as in a run, and their unbalanced part.

    A freedom is a degree of freedom of a joint; generalised forces are in [N] or [N m].
    """

    def __init__(self, draft, t: float) -> None:
        motion = motion_of(draft)
        self.draft, self.motion, self.t = draft, motion, t
        self.written = arrays_without_seen(draft.shapes)
        self.written.clock["limit"] = t
        self.layout = draft.tables.layout[0]
        self.out = np.zeros(int(self.layout["size"]))
        self.y, self.tables = np.zeros(draft.size), draft.tables
        rubber = (BUSHINGS,) if len(motion.bushing_table) else ()
        loads = [name for feature in draft.features for name in feature.level(draft, self.y)]
        self.pushes = (MOTION, LINES, *rubber, *loads)
        if len(motion.moving_segment_table):
            self.pushes += NETWORKS
        if loads:  # these functions write to `plane`
            self.tables = draft.tables._replace(plane=draft.tables.plane.copy())
        self.run(MOTION)

    def run(self, *pieces: str) -> None:
        """Call the named kernel functions of bodies and joints."""
        rates = np.zeros(self.draft.size) if LOADS in pieces else NONE
        call_pieces(
            (self.tables, self.written, self.draft.features),
            pieces,
            self.t,
            self.y,
            self.out,
            rates,
        )

    def rates(self) -> np.ndarray:
        """Velocities of all freedoms at the start : float64[freedoms] [m/s], [rad/s]."""
        return np.concatenate([row["speed"][: row["freedoms"]] for row in self.motion.body_table])

    def forces(self) -> np.ndarray:
        """Generalised forces on all freedoms from loads in `out`, minus inertial forces : float64[freedoms] [N], [N m].

        Springs and dampers of joints are included.
        """
        n = len(self.motion.freedom_table)
        self.run(WEIGH)
        return self.written.scratch[6 * n : 7 * n].copy()

    def accelerations(self) -> np.ndarray:
        """Accelerations of all freedoms after a call of `solve_accelerations` : float64[freedoms] [m/s2], [rad/s2]."""
        n = len(self.motion.freedom_table)
        return self.written.scratch[6 * n : 7 * n].copy()

    def loads(self) -> np.ndarray:
        """Force [N] and torque [N m] on every body : float64[bodies, 6], a view of `out`."""
        from fvsolve.core.kernels.moving_frames import FORCE

        first, count = int(self.layout["body"]), len(self.motion.body_table)
        return self.out[first : first + rec.BODY_OUT * count].reshape(count, rec.BODY_OUT)[
            :, FORCE : FORCE + 6
        ]

    def under(self, pushes: np.ndarray) -> np.ndarray:
        """Generalised forces on all freedoms from weights, fluid, bushings and given pushes of force elements [N].

        Inertial forces are subtracted, see `forces`.
        """
        self.run(MOTION)
        at = int(self.layout["push"])
        self.out[at : at + pushes.size] = pushes
        self.run(*self.pushes[1:])
        return self.forces()

    def sizes(self, pushes: np.ndarray) -> np.ndarray:
        """Upper bound of the sum of magnitudes of all loads on each freedom : float64[freedoms].

        A load counts as its magnitude times its distance from the joint, whatever its direction, because a load
        perpendicular to the motion of a freedom acts on it by rounding errors.
        """
        first = int(self.layout["push"])
        self.run(MOTION)
        loads = [
            (i, row["centre"], np.linalg.norm(load[:3]), 0.0)
            for i, (row, load) in enumerate(zip(self.motion.body_table, self.loads(), strict=True))
        ]
        self.out[first : first + pushes.size] = pushes
        self.run(LINES)
        before = self.loads().copy()
        self.run(*self.pushes[2:])
        added = enumerate(self.loads() - before)
        loads += [
            (i, np.zeros(3), *np.linalg.norm(load.reshape(2, 3), axis=1)) for i, load in added
        ]
        for row in self.motion.line_table:
            size, is_torque = abs(pushes[row["push"]]), row["acts"] == records.ABOUT
            loads += self.at_ends(row, 0.0 if is_torque else size, size if is_torque else 0.0)
        for row in self.motion.bushing_table:
            first_place, second_place = (
                self.position_of(row[end]) for end in ("from_point", "to_point")
            )
            loads += self.at_ends(
                row, float(row["stiffness"] * np.linalg.norm(second_place - first_place)), 0.0
            )
        for row in self.motion.pin_table:
            loads += self.at_ends(row, float(np.linalg.norm(row["force"][: row["rows"]])), 0.0)
        self.forces()  # leaves S in scratch
        return sum(
            (self.reach(*arguments) for arguments in loads),
            np.zeros(len(self.motion.freedom_table)),
        )

    def at_ends(self, row, force: float, torque: float) -> list[tuple]:
        """Loads on the two points of a line of action, as arguments of `reach`."""
        ends = [
            self.motion.point_table[row[end]] for end in ("from_point", "to_point") if row[end] >= 0
        ]
        return [
            (int(point["body"]), point["place"], force, torque)
            for point in ends
            if point["body"] >= 0
        ]

    def row_of(self, i: int) -> np.ndarray:
        """Values of body i in `out` (`kernels.moving_frames`)."""
        return self.out[int(self.layout["body"]) + rec.BODY_OUT * i :][: rec.BODY_OUT]

    def position_of(self, point: int) -> np.ndarray:
        """Position of a point in the current configuration [m]."""
        from fvsolve.core.kernels.moving_frames import ATTITUDE, POSITION

        i = int(self.motion.point_table[point]["body"])
        place = self.motion.point_table[point]["place"]
        if i < 0:
            return place
        body_row = self.row_of(i)
        return (
            body_row[POSITION : POSITION + 3]
            + body_row[ATTITUDE : ATTITUDE + 9].reshape(3, 3) @ place
        )

    def reach(self, i: int, place: np.ndarray, force: float, torque: float) -> np.ndarray:
        """Largest possible effect of a force [N] and torque [N m] on each freedom, in any direction.

        i, place : body and point in its axes at which they act. `forces` must have written the joint axes to `scratch`.
        """
        from fvsolve.core.kernels.moving_frames import ARM, ATTITUDE

        bodies, effects = self.motion.body_table, np.zeros(len(self.motion.freedom_table))
        columns = self.written.scratch[: 6 * len(effects)].reshape(-1, 6)
        at = (
            self.row_of(i)[ARM : ARM + 3]
            + self.row_of(i)[ATTITUDE : ATTITUDE + 9].reshape(3, 3) @ place
        )
        while i >= 0:
            row, joint = bodies[i], self.row_of(i)[ARM : ARM + 3]
            for j in range(row["freedom"], row["freedom"] + row["freedoms"]):
                angular = np.linalg.norm(columns[j, :3])
                linear = np.linalg.norm(columns[j, 3:]) if angular == 0.0 else 0.0
                effects[j] = (
                    force * (linear + angular * np.linalg.norm(at - joint)) + torque * angular
                )
            i = int(row["parent"])
        return effects

    def by(self, loads: np.ndarray) -> np.ndarray:
        """Result of `forces` for given loads on bodies.

        loads : float64[bodies, 6]  force [N] and torque [N m] on each body, which replace those in `out`
        """
        self.loads()[:] = loads
        return self.forces()


# a row of pins is redundant if its independent part is below this share of the largest row
RANK_TOLERANCE = 1e-8
PIN_RATE_TOLERANCE = 1e-6  # greatest rate at which a pin may open at the start [m/s]


def refuse_massless(draft, at: StaticForces) -> None:
    """Add a fault for a body whose joint allows a motion without inertia, of the body or of bodies attached to it.

    A body that the fluid in its tanks outweighs gets a fault too. Only the last such body in the table gets one.
    """
    motion = motion_of(draft)
    at.run(MOTION, ACCELERATE)
    n = len(motion.freedom_table)
    for name, row in reversed(list(zip(motion.body_names, motion.body_table, strict=True))):
        own = np.linalg.norm(row["inertia"]) + row["mass"] * float(row["centre"] @ row["centre"])
        least = RANK_TOLERANCE**2 * (
            own if row["joint"] in (records.REVOLUTE, records.BALL) else 0.0
        )
        for freedom in motion.freedom_table[row["freedom"] : row["freedom"] + row["freedoms"]]:
            left = at.written.scratch[8 * n + freedom["row"] + freedom["depth"]] ** -2.0
            if np.isnan(left) and len(motion.moving_segment_table):
                text = "fluid in tall tanks, whose own flow has no inertia in the model, outweighs its carrying body"
                remedy = "expected wider tanks, a heavier body, or a driven joint"
                return draft.fault(f"nodes.{name}.mass", f"{text}; {remedy}")
            if not left > least:
                text = (
                    "the inertia of the body is 0 in a direction in which its joint allows motion"
                )
                remedy = "expected an inertia above 0 about the axis of the joint"
                return draft.fault(f"nodes.{name}.inertia", f"{text}; {remedy}")


def start_bodies(draft, start) -> list[str]:
    """Set lengths and rates of lines of action, data of pins and `balance` of freedoms at the start.

    Returns texts of motions at the start. Raises CaseError for motions without inertia and for pins that are redundant
    or open.
    """
    motion = motion_of(draft)
    if not len(motion.body_table):
        return []
    at = StaticForces(draft, start.t)
    tables = (motion.brace_table, motion.stop_table, motion.piston_table)
    pushes = np.array([row["force"] for table in tables for row in table])
    travel, first = int(at.layout["travel"]), int(at.layout["push"])
    rows = [row for table in tables for row in table]
    for line in motion.line_table:
        line["length"] = at.out[travel + 2 * line["push"]] if line["acts"] == records.ALONG else 0.0
        if "speed" in rows[line["push"]].dtype.names:
            rows[line["push"]]["speed"] = at.out[travel + 2 * line["push"] + 1]
    refuse_massless(draft, at)
    draft.check()
    at.out[first : first + pushes.size] = pushes
    at.run(*at.pushes)
    left, accelerate = at.forces(), ACCELERATE
    if len(motion.pin_table):
        left, accelerate = start_pins(draft, at), PINNED
    size = at.sizes(pushes)
    motion.freedom_table["balance"] = np.where(np.abs(left) <= draft.rounding * size, left, 0.0)
    at.run(*at.pushes, accelerate)
    return motion_at_start(draft, at.accelerations())


def pin_rows(draft, at: StaticForces) -> np.ndarray:
    """Constraint matrix of all pins at the start : float64[constraints, freedoms].

    The matrix times the joint velocities gives the velocities at which the pins open, one per constrained direction.
    """
    motion = motion_of(draft)
    n, count = len(motion.freedom_table), int(motion.pin_table["rows"].sum())
    if count:
        at.run(*at.pushes, PINNED)
    first = 8 * n + motion.factor_size + 16 * len(motion.body_table)
    return at.written.scratch[first : first + count * n].reshape(count, n).copy()


def start_pins(draft, at: StaticForces) -> np.ndarray:
    """Set gaps and constraint forces of pins at the start; raises CaseError for pins that are redundant or open.

    Returns the remaining generalised force on each joint freedom : float64[freedoms] [N] or [N m].
    """
    motion = motion_of(draft)
    at.run(*at.pushes, GAPS)
    first = int(at.layout["pin"])
    for k, row in enumerate(motion.pin_table):
        row["gap"][: row["rows"]] = at.out[first + 3 * k :][: row["rows"]]
    rows = pin_rows(draft, at)
    names = [
        name
        for name, row in zip(motion.pin_names, motion.pin_table, strict=True)
        for _ in range(row["rows"])
    ]
    for name in dict.fromkeys(redundant_pins(rows, names)):
        text = "this pin is redundant: in some direction joints or other pins already hold its two points together"
        draft.fault(
            f"links.{name}",
            f"{text}; give the key `axis` for a loop in a plane, else remove one pin",
        )
    slips: dict[str, float] = {}
    for name, slip in zip(names, rows @ at.rates(), strict=True):
        slips[name] = float(np.hypot(slips.get(name, 0.0), slip))
    for name, slip in slips.items():
        if slip > PIN_RATE_TOLERANCE:
            text = f"separate the two points of this pin at {draft.case.amount(slip, 'velocity')}"
            draft.fault(
                f"links.{name}", f"velocities at the start {text}; expected equal velocities"
            )
    draft.check()
    forces = at.out[int(at.layout["pin"]) :][: 3 * len(motion.pin_table)].reshape(-1, 3)
    for row, force in zip(motion.pin_table, forces, strict=True):
        row["force"][: row["rows"]] = force[: row["rows"]]
    at.run(*at.pushes, HOLD)
    return at.forces()


def redundant_pins(rows: np.ndarray, names: list[str]) -> list[str]:
    """Names of pins whose constraint rows are zero or linearly dependent on earlier rows.

    rows : float64[constraints, freedoms]  see `pin_rows`; names : name of the pin of each row
    """
    dependent, basis = [], np.zeros((0, rows.shape[1]))
    size = np.linalg.norm(rows, axis=1).max()
    for name, row in zip(names, rows, strict=True):
        remainder = row - basis.T @ (basis @ row)
        remainder -= basis.T @ (basis @ remainder)
        if np.linalg.norm(remainder) <= RANK_TOLERANCE * size:
            dependent.append(name)
        else:
            basis = np.vstack([basis, remainder / np.linalg.norm(remainder)])
    return dependent


def motion_at_start(draft, accelerations: np.ndarray) -> list[str]:
    """Texts of the velocities and accelerations of bodies at the start.

    accelerations : float64[freedoms]  [m/s2] or [rad/s2]
    """
    motion = motion_of(draft)
    texts, amount = [], draft.case.amount
    for name, row in zip(motion.body_names, motion.body_table, strict=True):
        pose = draft.case.poses[name]
        own = accelerations[row["freedom"] : row["freedom"] + row["freedoms"]]
        # water in sloshing modes is not among the nodes: only its accelerations are listed
        stated = name in draft.case.nodes
        if stated and (size := np.linalg.norm(pose.spin)) > 0.0:
            texts.append(f"body {name} turns at {amount(size, 'angular_velocity')}")
        if stated and (size := np.linalg.norm(pose.velocity)) > 0.0:
            texts.append(f"body {name} moves at {amount(size, 'velocity')}")
        slides = (
            0
            if row["joint"] in (records.REVOLUTE, records.BALL)
            else 3
            if row["joint"] == records.FREE
            else 1
        )
        for part, unit in ((own[:slides], "m/s2"), (own[slides:], "rad/s2")):
            if np.any(part):
                texts.append(f"body {name} accelerates at {np.linalg.norm(part):.4g} {unit}")
    return texts
