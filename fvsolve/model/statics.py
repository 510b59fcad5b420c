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
WATER = ("basins.frames: set_frames", "basins.frames: turn_water")  # what loads bodies beside pushes, at rest
WALLS = ("basins.walls: press_at_rest",)
DRIVES = f"{ROOM}.rides: set_rides"
NETWORKS = (DRIVES, f"{ROOM}.rides: press_tanks", f"{ROOM}.recoil: load_networks")


def call_pieces(tables: tuple, pieces: tuple[str, ...], t: float, y: np.ndarray, out: np.ndarray) -> None:
    """Call pieces of the room of mechanisms, and no others, as a right-hand side does."""
    from fvsolve.kernels import calls  # scenes without bodies load none of it
    from fvsolve.kernels.phases import found

    addresses = calls.empty_calls(calls.JOBS, len(pieces) + 1)
    for k, piece in enumerate(pieces):
        addresses[calls.RHS, k] = calls.addressed(found(HOME, piece), calls.RATES)
    calls.compile_as(calls.rhs_in_turn, calls.RATES.lower())
    handle = make_handle((*tables, addresses, calls.empty_calls(0, len(calls.HOOKS))))
    calls.rhs_in_turn(t, y, np.zeros(0), out, handle)


def factored(model, y: np.ndarray) -> np.ndarray:
    """What `accelerate` leaves in `scratch` at a state: the factor of the mass matrix from 8 freedoms on."""
    written, t = wiped(model.shapes), model.case.numerics.start
    written.clock["limit"] = np.inf
    call_pieces((*model.tables, *written), (MOTION, ACCELERATE), t, y.copy(), model.new_out())
    return written.scratch


class Statics:
    """Forces of joints at the start, as the kernels have them: which are balanced, and what is left."""

    def __init__(self, draft, t: float) -> None:
        self.draft, self.t = draft, t
        self.written = wiped(draft.shapes)
        self.written.clock["limit"] = t
        self.layout = draft.tables.layout[0]
        self.out = np.zeros(int(self.layout["size"]))
        self.y, self.tables, rides = np.zeros(draft.size), draft.tables, (draft.basin_table["frame"] >= 0).any()
        rubber = (RUBBER,) if len(draft.bushing_table) else ()
        self.pushes = (MOTION, LINES, *rubber, *(WATER if rides else ()))
        self.pushes += WALLS if (draft.wall_table["body"] >= 0).any() else ()
        if len(draft.ride_table) and draft.case.law.linear:
            self.pushes += NETWORKS
        if rides:
            self.y, self.tables = (
                at_start(draft.basins, draft.size),
                draft.tables._replace(plane=draft.tables.plane.copy()),
            )
        self.run(MOTION)

    def run(self, *pieces: str) -> None:
        """Call pieces of the room of mechanisms as a right-hand side does."""
        call_pieces((*self.tables, *self.written), pieces, self.t, self.y, self.out)

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

    def shares(self, pushes: np.ndarray) -> np.ndarray:
        """Forces of freedoms by each body's weight, then by each line's push : float64[bodies + lines, freedoms]."""
        weights, found = self.loads().copy(), []
        bias = self.by(np.zeros_like(weights))
        for i in range(len(weights)):
            alone = np.zeros_like(weights)
            alone[i] = weights[i]
            found.append(self.by(alone) - bias)
        at = int(self.layout["push"])
        for row in self.draft.line_table:
            self.loads()[:] = 0.0
            self.out[at : at + pushes.size] = 0.0
            self.out[at + row["push"]] = pushes[row["push"]]
            self.run(LINES)
            found.append(self.forces() - bias)
        self.loads()[:] = weights
        return np.array(found).reshape(len(found), len(self.draft.freedom_table))

    def by(self, loads: np.ndarray) -> np.ndarray:
        """Forces of freedoms under these forces and torques of bodies."""
        self.loads()[:] = loads
        return self.forces()
