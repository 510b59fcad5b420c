"""Forces on joints at the start, computed by the kernels without a run."""

from __future__ import annotations

import numpy as np

from fvsolve.basins.lower import basin_start
from fvsolve.kernels import dtypes as rec
from fvsolve.kernels.table_handle import make_handle
from fvsolve.model.run_data import zeros_for_run

PACKAGE = "fvsolve"  # package of the kernel functions
FOLDER = "kernels.mechanism"
MOTION, LINES = f"{FOLDER}.body_kinematics: kinematics", f"{FOLDER}.force_elements: add_element_forces"
WEIGH, ACCELERATE = f"{FOLDER}.mass_matrix: start_mass_matrix", f"{FOLDER}.mass_matrix: solve_accelerations"
BUSHINGS = f"{FOLDER}.force_elements: add_bushing_loads"
PINNED, GAPS, HOLD = (
    f"{FOLDER}.loop_constraints: {name}"
    for name in ("solve_pinned_accelerations", "start_gaps", "add_start_pin_forces")
)
# loads on bodies of fluid at rest, in addition to pushes
FLUID_LOADS = ("basins.basin_frames: set_frames", "basins.frame_forces: add_frame_forces")
WALL_LOADS = ("basins.moving_walls: push_bodies_at_rest",)
DRIVES = f"{FOLDER}.inertial_forces: set_segment_drives"
LOADS = f"{FOLDER}.fluid_loads: add_fluid_loads"
NETWORKS = (
    DRIVES,
    *(
        f"{FOLDER}.inertial_forces: {name}"
        for name in ("moving_tank_pressures", "add_cell_drives", "moving_column_rates")
    ),
    LOADS,
)
NONE = np.zeros(0)


def call_pieces(tables: tuple, pieces: tuple[str, ...], t: float, y: np.ndarray, out: np.ndarray, rates=NONE) -> None:
    """Call the named kernel functions in turn, in the way of the right-hand side; they write to `out` and run arrays.

    tables : tables of a model, then arrays of a run; pieces : names "MODULE: FUNCTION" below the package
    """
    from fvsolve.kernels import calls  # not loaded for cases without bodies
    from fvsolve.kernels.rhs_assembly import load_function

    addresses = calls.empty_calls(calls.JOBS, len(pieces) + 1)
    for k, piece in enumerate(pieces):
        addresses[calls.RHS, k] = calls.function_address(load_function(PACKAGE, piece), calls.RATES)
    run = calls.compile_as(calls.rhs_in_turn, calls.RATES.lower())
    handle = make_handle((*tables, addresses, calls.empty_calls(0, len(calls.HOOKS))))
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
    call_pieces((*model.tables, *written), (MOTION, ACCELERATE), t, y.copy(), model.new_out())
    diagonal = 8 * len(model.tables.freedoms) + model.tables.freedoms["row"] + model.tables.freedoms["depth"]
    written.scratch[diagonal] = 1.0 / written.scratch[diagonal]
    return written.scratch


class StaticForces:
    """Forces on joints at the start, computed as in a run, and their unbalanced part.

    A freedom is a degree of freedom of a joint; generalised forces are in [N] or [N m].
    """

    def __init__(self, draft, t: float) -> None:
        self.draft, self.t = draft, t
        self.written = arrays_without_seen(draft.shapes)
        self.written.clock["limit"] = t
        self.layout = draft.tables.layout[0]
        self.out = np.zeros(int(self.layout["size"]))
        self.y, self.tables, moving_basins = np.zeros(draft.size), draft.tables, (draft.basin_table["frame"] >= 0).any()
        rubber = (BUSHINGS,) if len(draft.bushing_table) else ()
        self.pushes = (MOTION, LINES, *rubber, *(FLUID_LOADS if moving_basins else ()))
        self.pushes += WALL_LOADS if (draft.wall_table["body"] >= 0).any() else ()
        if len(draft.moving_segment_table):
            self.pushes += NETWORKS
        if moving_basins:
            self.y, self.tables = (
                basin_start(draft.basins, draft.size),
                draft.tables._replace(plane=draft.tables.plane.copy()),
            )
        self.run(MOTION)

    def run(self, *pieces: str) -> None:
        """Call the named kernel functions of bodies and joints."""
        rates = np.zeros(self.draft.size) if LOADS in pieces else NONE
        call_pieces((*self.tables, *self.written), pieces, self.t, self.y, self.out, rates)

    def rates(self) -> np.ndarray:
        """Velocities of all freedoms at the start : float64[freedoms] [m/s], [rad/s]."""
        return np.concatenate([row["speed"][: row["freedoms"]] for row in self.draft.body_table])

    def forces(self) -> np.ndarray:
        """Generalised forces on all freedoms from loads in `out`, minus inertial forces : float64[freedoms] [N], [N m].

        Springs and dampers of joints are included.
        """
        n = len(self.draft.freedom_table)
        self.run(WEIGH)
        return self.written.scratch[6 * n : 7 * n].copy()

    def accelerations(self) -> np.ndarray:
        """Accelerations of all freedoms after a call of `solve_accelerations` : float64[freedoms] [m/s2], [rad/s2]."""
        n = len(self.draft.freedom_table)
        return self.written.scratch[6 * n : 7 * n].copy()

    def loads(self) -> np.ndarray:
        """Force [N] and torque [N m] on every body : float64[bodies, 6], a view of `out`."""
        from fvsolve.kernels.mechanism.body_layout import FORCE

        first, count = int(self.layout["body"]), len(self.draft.body_table)
        return self.out[first : first + rec.BODY_OUT * count].reshape(count, rec.BODY_OUT)[:, FORCE : FORCE + 6]

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
        draft, first = self.draft, int(self.layout["push"])
        self.run(MOTION)
        loads = [(i, row["centre"], np.linalg.norm(load[:3]), 0.0)
                for i, (row, load) in enumerate(zip(draft.body_table, self.loads(), strict=True))]  # fmt: skip
        self.out[first : first + pushes.size] = pushes
        self.run(LINES)
        before = self.loads().copy()
        self.run(*self.pushes[2:])
        loads += [
            (i, np.zeros(3), *np.linalg.norm(load.reshape(2, 3), axis=1))
            for i, load in enumerate(self.loads() - before)
        ]
        for row in draft.line_table:
            size, is_torque = abs(pushes[row["push"]]), row["acts"] == rec.ABOUT
            loads += self.at_ends(row, 0.0 if is_torque else size, size if is_torque else 0.0)
        for row in draft.bushing_table:
            first_place, second_place = (self.position_of(row[end]) for end in ("from_point", "to_point"))
            loads += self.at_ends(row, float(row["stiffness"] * np.linalg.norm(second_place - first_place)), 0.0)
        for row in draft.pin_table:
            loads += self.at_ends(row, float(np.linalg.norm(row["force"][: row["rows"]])), 0.0)
        self.forces()  # leaves S in scratch
        return sum((self.reach(*arguments) for arguments in loads), np.zeros(len(draft.freedom_table)))

    def at_ends(self, row, force: float, torque: float) -> list[tuple]:
        """Loads on the two points of a line of action, as arguments of `reach`."""
        ends = [self.tables.points[row[end]] for end in ("from_point", "to_point") if row[end] >= 0]
        return [(int(point["body"]), point["place"], force, torque) for point in ends if point["body"] >= 0]

    def row_of(self, i: int) -> np.ndarray:
        """Values of body i in `out` (`kernels.mechanism.body_layout`)."""
        return self.out[int(self.layout["body"]) + rec.BODY_OUT * i :][: rec.BODY_OUT]

    def position_of(self, point: int) -> np.ndarray:
        """Position of a point in the current configuration [m]."""
        from fvsolve.kernels.mechanism.body_layout import ATTITUDE, POSITION

        i, place = int(self.tables.points[point]["body"]), self.tables.points[point]["place"]
        if i < 0:
            return place
        body_row = self.row_of(i)
        return body_row[POSITION : POSITION + 3] + body_row[ATTITUDE : ATTITUDE + 9].reshape(3, 3) @ place

    def reach(self, i: int, place: np.ndarray, force: float, torque: float) -> np.ndarray:
        """Largest possible effect of a force [N] and torque [N m] on each freedom, in any direction.

        i, place : body and point in its axes at which they act. `forces` must have written the joint axes to `scratch`.
        """
        from fvsolve.kernels.mechanism.body_layout import ARM, ATTITUDE

        bodies, effects = self.draft.body_table, np.zeros(len(self.draft.freedom_table))
        columns = self.written.scratch[: 6 * len(effects)].reshape(-1, 6)
        at = self.row_of(i)[ARM : ARM + 3] + self.row_of(i)[ATTITUDE : ATTITUDE + 9].reshape(3, 3) @ place
        while i >= 0:
            row, joint = bodies[i], self.row_of(i)[ARM : ARM + 3]
            for j in range(row["freedom"], row["freedom"] + row["freedoms"]):
                angular = np.linalg.norm(columns[j, :3])
                linear = np.linalg.norm(columns[j, 3:]) if angular == 0.0 else 0.0
                effects[j] = force * (linear + angular * np.linalg.norm(at - joint)) + torque * angular
            i = int(row["parent"])
        return effects

    def by(self, loads: np.ndarray) -> np.ndarray:
        """Result of `forces` for given loads on bodies.

        loads : float64[bodies, 6]  force [N] and torque [N m] on each body, which replace those in `out`
        """
        self.loads()[:] = loads
        return self.forces()
