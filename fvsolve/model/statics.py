"""Forces of joints as the kernels have them, where nothing runs. Knows which pieces say them; moves no body."""

from __future__ import annotations

import numpy as np

from fvsolve.basins.lower import at_start
from fvsolve.kernels import records as rec
from fvsolve.kernels.handle import make_handle
from fvsolve.model.slate import wiped

HOME = "fvsolve"  # of pieces, as they are named here
ROOM = "kernels.mechanism"
MOTION, LINES = f"{ROOM}.joints: kinematics", f"{ROOM}.lines: push_bodies"
WEIGH, ACCELERATE = f"{ROOM}.matrix: weigh", f"{ROOM}.matrix: accelerate"
RUBBER = f"{ROOM}.bushings: push_bushings"
PINNED, GAPS, HOLD = (f"{ROOM}.pins: {one}" for one in ("accelerate_pinned", "gaps", "hold"))
WATER = ("basins.frames: set_frames", "basins.frames_flow: turn_fluid")  # what loads bodies beside pushes, at rest
WALLS = ("basins.walls: press_at_rest",)
DRIVES = f"{ROOM}.rides: set_rides"
LOADS = f"{ROOM}.freight: load_networks"
NETWORKS = (DRIVES, *(f"{ROOM}.rides: {one}" for one in ("press_tanks", "push_cells", "push_columns")), LOADS)
NONE = np.zeros(0)


def call_pieces(tables: tuple, pieces: tuple[str, ...], t: float, y: np.ndarray, out: np.ndarray, rates=NONE) -> None:
    """Call pieces of the room of mechanisms, and no others, as a right-hand side does."""
    from fvsolve.kernels import calls  # scenes without bodies load none of it
    from fvsolve.kernels.phases import found

    addresses = calls.empty_calls(calls.JOBS, len(pieces) + 1)
    for k, piece in enumerate(pieces):
        addresses[calls.RHS, k] = calls.addressed(found(HOME, piece), calls.RATES)
    run = calls.compile_as(calls.rhs_in_turn, calls.RATES.lower())
    handle = make_handle((*tables, addresses, calls.empty_calls(0, len(calls.HOOKS))))
    run(t, y, rates, out, handle)


def plain(shapes: rec.Written) -> rec.Written:
    """What runs write, where pieces see a state as it is given: none of these reads cells that contents are kept of."""
    return wiped(shapes)._replace(seen=np.zeros(0))


def factored(model, y: np.ndarray) -> np.ndarray:
    """What `accelerate` leaves in `scratch` at a state, L of the mass matrix L'L from 8 freedoms on."""
    written, t = plain(model.shapes), model.case.numerics.start
    written.clock["limit"] = np.inf
    call_pieces((*model.tables, *written), (MOTION, ACCELERATE), t, y.copy(), model.new_out())
    diagonal = 8 * len(model.tables.freedoms) + model.tables.freedoms["row"] + model.tables.freedoms["depth"]
    written.scratch[diagonal] = 1.0 / written.scratch[diagonal]
    return written.scratch


class Statics:
    """Forces of joints at the start, as the kernels have them: which are balanced, and what is left."""

    def __init__(self, draft, t: float) -> None:
        self.draft, self.t = draft, t
        self.written = plain(draft.shapes)
        self.written.clock["limit"] = t
        self.layout = draft.tables.layout[0]
        self.out = np.zeros(int(self.layout["size"]))
        self.y, self.tables, rides = np.zeros(draft.size), draft.tables, (draft.basin_table["frame"] >= 0).any()
        rubber = (RUBBER,) if len(draft.bushing_table) else ()
        self.pushes = (MOTION, LINES, *rubber, *(WATER if rides else ()))
        self.pushes += WALLS if (draft.wall_table["body"] >= 0).any() else ()
        if len(draft.ride_table):
            self.pushes += NETWORKS
        if rides:
            self.y, self.tables = (
                at_start(draft.basins, draft.size),
                draft.tables._replace(plane=draft.tables.plane.copy()),
            )
        self.run(MOTION)

    def run(self, *pieces: str) -> None:
        """Call pieces of the room of mechanisms as a right-hand side does."""
        rates = np.zeros(self.draft.size) if LOADS in pieces else NONE
        call_pieces((*self.tables, *self.written), pieces, self.t, self.y, self.out, rates)

    def rates(self) -> np.ndarray:
        """Velocities of all freedoms at the start."""
        return np.concatenate([row["speed"][: row["freedoms"]] for row in self.draft.body_table])

    def forces(self) -> np.ndarray:
        """Forces of all freedoms under what `out` says of bodies, what their motion asks for taken off."""
        n = len(self.draft.freedom_table)
        self.run(WEIGH)
        return self.written.scratch[6 * n : 7 * n].copy()

    def accelerations(self) -> np.ndarray:
        """Of all freedoms, where `accelerate` has just been run [rad/s2] or [m/s2]."""
        n = len(self.draft.freedom_table)
        return self.written.scratch[6 * n : 7 * n].copy()

    def loads(self) -> np.ndarray:
        """Force and torque of every body, as `out` holds them : float64[bodies, 6]."""
        from fvsolve.kernels.mechanism.room import FORCE

        first, many = int(self.layout["body"]), len(self.draft.body_table)
        return self.out[first : first + rec.BODY_OUT * many].reshape(many, rec.BODY_OUT)[:, FORCE : FORCE + 6]

    def under(self, pushes: np.ndarray) -> np.ndarray:
        """Forces of all freedoms under weights and these pushes."""
        self.run(MOTION)
        at = int(self.layout["push"])
        self.out[at : at + pushes.size] = pushes
        self.run(*self.pushes[1:])
        return self.forces()

    def sizes(self, pushes: np.ndarray) -> np.ndarray:
        """What all that acts on bodies can be to each freedom at most : float64[freedoms].

        Forces times the distance from the joint that turns them there, whichever way they point: what points at right
        angles to where a freedom leads does so but for rounding.
        """
        draft, first = self.draft, int(self.layout["push"])
        self.run(MOTION)
        acts = [(i, row["centre"], np.linalg.norm(load[:3]), 0.0)
                for i, (row, load) in enumerate(zip(draft.body_table, self.loads(), strict=True))]  # fmt: skip
        self.out[first : first + pushes.size] = pushes
        self.run(LINES)
        dry = self.loads().copy()
        self.run(*self.pushes[2:])
        acts += [
            (i, np.zeros(3), *np.linalg.norm(load.reshape(2, 3), axis=1)) for i, load in enumerate(self.loads() - dry)
        ]
        for row in draft.line_table:
            size, turns = abs(pushes[row["push"]]), row["acts"] == rec.ABOUT
            acts += self.at_ends(row, 0.0 if turns else size, size if turns else 0.0)
        for row in draft.bushing_table:
            here, there = (self.place_of(row[end]) for end in ("from_point", "to_point"))
            acts += self.at_ends(row, float(row["stiffness"] * np.linalg.norm(there - here)), 0.0)
        for row in draft.pin_table:
            acts += self.at_ends(row, float(np.linalg.norm(row["force"][: row["rows"]])), 0.0)
        self.forces()  # which leaves S in scratch
        return sum((self.reach(*one) for one in acts), np.zeros(len(draft.freedom_table)))

    def at_ends(self, row, force: float, torque: float) -> list[tuple]:
        """What acts on two points, as `reach` takes it."""
        ends = [self.tables.points[row[end]] for end in ("from_point", "to_point") if row[end] >= 0]
        return [(int(one["body"]), one["place"], force, torque) for one in ends if one["body"] >= 0]

    def row_of(self, i: int) -> np.ndarray:
        """What `out` has of body i (`kernels.mechanism.room`)."""
        return self.out[int(self.layout["body"]) + rec.BODY_OUT * i :][: rec.BODY_OUT]

    def place_of(self, point: int) -> np.ndarray:
        """Where a point is now [m]."""
        from fvsolve.kernels.mechanism.room import ATTITUDE, PLACE

        i, place = int(self.tables.points[point]["body"]), self.tables.points[point]["place"]
        if i < 0:
            return place
        own = self.row_of(i)
        return own[PLACE : PLACE + 3] + own[ATTITUDE : ATTITUDE + 9].reshape(3, 3) @ place

    def reach(self, i: int, place: np.ndarray, force: float, torque: float) -> np.ndarray:
        """What a force on body i at a place in its axes, and a torque, can be to each freedom, by S in scratch."""
        from fvsolve.kernels.mechanism.room import ARM, ATTITUDE

        bodies, found = self.draft.body_table, np.zeros(len(self.draft.freedom_table))
        columns = self.written.scratch[: 6 * len(found)].reshape(-1, 6)
        at = self.row_of(i)[ARM : ARM + 3] + self.row_of(i)[ATTITUDE : ATTITUDE + 9].reshape(3, 3) @ place
        while i >= 0:
            row, joint = bodies[i], self.row_of(i)[ARM : ARM + 3]
            for j in range(row["freedom"], row["freedom"] + row["freedoms"]):
                turns = np.linalg.norm(columns[j, :3])
                slides = np.linalg.norm(columns[j, 3:]) if turns == 0.0 else 0.0
                found[j] = force * (slides + turns * np.linalg.norm(at - joint)) + torque * turns
            i = int(row["parent"])
        return found

    def by(self, loads: np.ndarray) -> np.ndarray:
        """Forces of freedoms under these forces and torques of bodies."""
        self.loads()[:] = loads
        return self.forces()
