"""Bodies, their joints, points and lines lowered to tables, and what balances at the start. Knows names; no rhs."""

from __future__ import annotations

import numpy as np

from fvsolve.basins.lower import at_start
from fvsolve.case import bodies
from fvsolve.kernels import records as rec
from fvsolve.kernels.handle import make_handle
from fvsolve.model.schedules import break_times
from fvsolve.model.slate import wiped
from fvsolve.parts.body.part import Body

WATER = ("frames: set_frames", "frames_flow: turn_fluid")  # what loads bodies beside pushes, at rest
WALLS = ("walls: press_at_rest",)
NETWORKS = ("rides: set_rides", "rides: press_tanks", "recoil: load_networks")
SMALL_ANGLE, SMALL_TRAVEL = 1e-3, 1e-3  # [rad], [m]
SMALL_SPIN, SMALL_SPEED = 0.1, 0.1  # [rad/s], [m/s]
BETWEEN = (-1, -1, -1, rec.ALONG, (0.0, 0.0, 0.0), 0.0)  # a line
ALIKE = 1e-8  # share of the largest row of pins that a row has beside all others: below, it says nothing new
LOOSE = 1e-6  # rate at which a pin may open at the start [m/s]
ROUNDS = 3  # of what holds bodies
SNAP = 1e-12  # share of what makes up a joint's force below which their sum is rounding
KINDS = {"revolute": rec.REVOLUTE, "prismatic": rec.PRISMATIC, "ball": rec.BALL, "free": rec.FREE, "fixed": rec.WELD}
ANGLES, SPINS = ("eta", "eps_x", "eps_y", "eps_z"), ("spin_x", "spin_y", "spin_z")
STATES = {  # of each kind: coordinates, then velocities; with how small each is
    "revolute": ({"angle": SMALL_ANGLE}, {"rate": SMALL_SPIN}),
    "prismatic": ({"travel": SMALL_TRAVEL}, {"travel_rate": SMALL_SPEED}),
    "ball": (dict.fromkeys(ANGLES, SMALL_ANGLE), dict.fromkeys(SPINS, SMALL_SPIN)),
    "free": (dict.fromkeys(("centre_x", "centre_y", "centre_z"), SMALL_TRAVEL) | dict.fromkeys(ANGLES, SMALL_ANGLE),
             dict.fromkeys(("centre_vx", "centre_vy", "centre_vz"), SMALL_SPEED) | dict.fromkeys(SPINS, SMALL_SPIN)),
    "fixed": ({}, {}),
}  # fmt: skip


def lower_bodies(draft) -> None:
    """Fill the tables of bodies and of their freedoms, each body behind the one that it hangs on."""
    nodes = draft.case.loaded
    draft.body_names = list(draft.case.poses)
    table = draft.body_table = np.zeros(len(draft.body_names), rec.BODY)
    paths: list[list[int]] = []
    hung: list[list[int]] = []  # of each body, the freedoms from its root to it
    for i, (name, row) in enumerate(zip(draft.body_names, table, strict=True)):
        body = nodes[name]
        up = bodies.hangs_on(body)[0]
        row["parent"] = draft.body_names.index(up) if isinstance(nodes.get(up), Body) else -1
        row["root"] = table[row["parent"]]["root"] if row["parent"] >= 0 else i
        fill_body(draft, name, body, row)
        row["freedom"] = len(paths)
        path = list(hung[row["parent"]]) if row["parent"] >= 0 else []
        for _ in range(row["freedoms"]):
            path = [*path, len(paths)]
            paths.append(path)
        hung.append(path)
    freedoms = draft.freedom_table = np.zeros(len(paths), rec.FREEDOM)
    at = 0
    for row, path in zip(freedoms, paths, strict=True):
        row["depth"], row["path"], row["row"] = len(path) - 1, len(draft.integers), at
        draft.integers += path
        at += len(path)
    draft.factor_size = at


def fill_body(draft, name: str, body: Body, row) -> None:
    """What one body's row says of itself, and its states."""
    joint, t = body.joint, draft.case.numerics.start
    row["joint"], row["mass"], row["centre"] = KINDS[joint.kind], body.mass, body.centre_of_mass
    row["inertia"], row["axis"] = body.moment().ravel(), joint.unit_axis
    row["at"], row["attitude"] = bodies.joint_place(draft.case.nodes, body), joint.attitude.rotation.ravel()
    row["damping"], row["stiffness"] = joint.damping or 0.0, joint.stiffness or 0.0
    pose = draft.case.poses[name]
    row["height"] = pose.at(body.centre_of_mass)[2]
    speed, spin = pose.moves(body.centre_of_mass), pose.attitude.T @ pose.spin
    row["energy"] = 0.5 * (body.mass * speed @ speed + spin @ body.moment() @ spin)
    row["y"] = row["rate"] = row["schedule"] = -1
    if joint.driven is not None:
        drive(draft, name, joint.driven, row)
        return
    coordinates, velocities = STATES[joint.kind]
    if not coordinates:
        return
    row["freedoms"] = len(velocities)
    row["y"] = draft.states([f"{name}.{key}" for key in coordinates], list(coordinates.values()))
    row["rate"] = draft.states([f"{name}.{key}" for key in velocities], list(velocities.values()))
    if joint.kind == "free":
        row["start"] = [*pose.at(body.centre_of_mass), *joint.attitude.parameters]
        row["speed"] = [*joint.speed, *joint.turning]
    elif joint.kind == "ball":
        row["start"][0], row["speed"][:3] = 1.0, joint.turning
    else:
        row["start"][0], row["speed"][0] = bodies.coordinate(joint, t), joint.rate or 0.0


def drive(draft, name: str, schedule, row) -> None:
    """Let a schedule drive a joint: one whose rate jumps would want a force without end, and is a fault."""
    row["schedule"] = draft.schedules.add(schedule)
    key = "travel" if row["joint"] == rec.PRISMATIC else "angle"
    start, end = draft.case.numerics.start, draft.case.numerics.end  # what it did before does not matter
    kinks = [time for time, _ in sorted(rate_jumps(schedule)) if start < time <= end]
    if kinks:
        what = "it jumps" if schedule.kind == "step" else "its rate jumps"
        text = f"drives the joint, and at t = {kinks[0]:g} s {what}, which asks for a force without end"
        draft.fault(f"nodes.{name}.joint.{key}", f'{text}; wanted kind = "smooth", level at both ends, or a wave')
    for time in schedule.time if np.all(np.isfinite(schedule.time)) else ():  # its acceleration jumps
        draft.schedules.breaks.setdefault(float(time), False)


def rate_jumps(schedule) -> list[tuple[float, bool]]:
    """Times at which the rate of a schedule jumps, or it itself does: a ramp may begin or end level."""
    if schedule.kind != "ramp":
        return break_times(schedule)
    (first, last), n = break_times(schedule), schedule.exponent
    return [first] + ([last] if n <= 1.0 else [])  # v1 + (v0 - v1) (1 - s)^n never begins level


def point_row(draft, place: str) -> int:
    """Row of the point that a link, or a probe, names."""
    if place not in draft.point_index:
        name, where = bodies.point_of(draft.case.nodes, place)
        draft.point_index[place] = len(draft.points)
        draft.points.append((draft.body_names.index(name) if name != bodies.WORLD else -1, tuple(where)))
    return draft.point_index[place]


def pose_of(draft, place: str) -> bodies.Pose:
    """How the body of a point stands at the start; the world's of a frame."""
    return draft.case.poses.get(bodies.point_of(draft.case.nodes, place)[0], bodies.AT_REST)


def add_line(draft, places: tuple[str | None, str], acts: int = rec.ALONG, direction=(0.0, 0.0, 0.0)) -> int:
    """Row of a line between two points, whose push is numbered later."""
    ends = [-1 if place is None else point_row(draft, place) for place in places]
    draft.lines.append((-1, *ends, acts, tuple(direction), 0.0))
    return len(draft.lines) - 1


def lower_lines(draft) -> None:
    """Number pushes as `lines` name them; pins."""
    draft.pin_names, draft.pin_table = draft.fill("pin", rec.PIN)
    draft.bushing_names, draft.bushing_table = draft.fill("bushing", rec.BUSHING)
    for name, row in zip(draft.bushing_names, draft.bushing_table, strict=True):
        link = draft.case.links[name]
        row["energy"] = 0.5 * row["stiffness"] * apart(draft, (link.from_, link.to), BETWEEN)[0] ** 2
    draft.line_table = np.array(draft.lines, rec.LINE) if draft.lines else np.zeros(0, rec.LINE)
    rows = [row for table in (draft.brace_table, draft.stop_table, draft.piston_table) for row in table]
    for k, row in enumerate(rows):
        if row["line"] >= 0:
            draft.line_table[row["line"]]["push"] = k


def apart(draft, places: tuple[str | None, str], line) -> tuple[float, float]:
    """How far the second of two points lies from the first at the start [m], and how fast that grows [m/s]."""
    ends = []
    for place in places:
        name, where = (bodies.WORLD, np.zeros(3)) if place is None else bodies.point_of(draft.case.nodes, place)
        pose = draft.case.poses.get(name, bodies.AT_REST)
        ends.append((pose.at(where), pose.moves(where), pose.spin))
    (x, u, a), (z, v, b) = ends
    _, _, _, acts, direction, _ = line
    if acts == rec.ABOUT:
        axis = draft.case.poses[bodies.point_of(draft.case.nodes, places[1])[0]].attitude @ direction
        return 0.0, float(np.dot(axis, b - a))
    if acts == rec.TOWARD:
        return 0.0, float(np.dot(direction, v - u))
    length = float(np.linalg.norm(z - x))
    return length, float(np.dot(z - x, v - u)) / length if length > 0.0 else 0.0


def call_pieces(tables: tuple, pieces: tuple[str, ...], t: float, y: np.ndarray, out: np.ndarray) -> None:
    """Call pieces of the room of mechanisms, and no others, as a right-hand side does."""
    from fvsolve.kernels import calls
    from fvsolve.kernels.phases import found

    addresses = calls.empty_calls(calls.JOBS, len(pieces) + 1)
    for k, piece in enumerate(pieces):
        home = "fvsolve.basins" if piece in (*WATER, *WALLS) else "fvsolve.kernels.mechanism"
        addresses[calls.RHS, k] = calls.addressed(found(home, piece), calls.RATES)
    calls.compile_as(calls.rhs_in_turn, calls.RATES.lower())
    handle = make_handle((*tables, addresses, calls.empty_calls(0, len(calls.HOOKS))))
    calls.rhs_in_turn(t, y, np.zeros(0), out, handle)


def factored(model, y: np.ndarray) -> np.ndarray:
    """What `accelerate` leaves in `scratch` at a state: the factor of the mass matrix from 8 freedoms on."""
    written, t = wiped(model.shapes), model.case.numerics.start
    written.clock["limit"] = np.inf
    pieces = ("joints: kinematics", "matrix: accelerate")
    call_pieces((*model.tables, *written), pieces, t, y.copy(), model.new_out())
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
        rubber = ("bushings: push_bushings",) if len(draft.bushing_table) else ()
        self.pushes = ("joints: kinematics", "lines: push_bodies", *rubber, *(WATER if rides else ()))
        self.pushes += WALLS if (draft.wall_table["body"] >= 0).any() else ()
        if len(draft.ride_table) and draft.case.law.linear:
            self.pushes += NETWORKS
        if rides:
            self.y, self.tables = (
                at_start(draft.basins, draft.size),
                draft.tables._replace(plane=draft.tables.plane.copy()),
            )
        self.run("joints: kinematics")

    def run(self, *pieces: str) -> None:
        """Call pieces of the room of mechanisms as a right-hand side does."""
        call_pieces((*self.tables, *self.written), pieces, self.t, self.y, self.out)

    def rates(self) -> np.ndarray:
        """Velocities of all freedoms at the start."""
        return np.concatenate([row["speed"][: row["freedoms"]] for row in self.draft.body_table])

    def forces(self) -> np.ndarray:
        """Forces of all freedoms under what `out` says of bodies, what their motion asks for taken off."""
        n = len(self.draft.freedom_table)
        self.run("matrix: weigh")
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
        self.run("joints: kinematics")
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
            self.run("lines: push_bodies")
            found.append(self.forces() - bias)
        self.loads()[:] = weights
        return np.array(found).reshape(len(found), len(self.draft.freedom_table))

    def by(self, loads: np.ndarray) -> np.ndarray:
        """Forces of freedoms under these forces and torques of bodies."""
        self.loads()[:] = loads
        return self.forces()


def holding_pressures(draft, start) -> dict[int, float]:
    """Pressures at which shut chambers that state none hold the bodies that stand on them : node -> pressure [Pa].

    Forces of their pistons by least squares, so that forces of joints vanish; of two such chambers of one cylinder the
    one that need not push is at ambient pressure. None of a chamber that would have to pull.
    """
    pistons = {}
    for k, row in enumerate(draft.piston_table):
        free = [side for side in "ab" if row["line"] >= 0 and is_shut(draft, start, int(row[side]))]
        pistons |= {k: free} if free else {}
    if not pistons:
        return {}
    ambient, at = draft.case.ambient_pressure, Statics(draft, start.t)
    first = len(draft.brace_table) + len(draft.stop_table)
    pushes = np.zeros(first + len(draft.piston_table))
    for k, row in enumerate([*draft.brace_table, *draft.stop_table]):
        scheduled = "schedule" in row.dtype.names and row["schedule"] >= 0
        pushes[k] = start.given(row["schedule"]) if scheduled else row["force"]
    gauge = {side: [start.pressure(int(row[side])) - ambient for row in draft.piston_table] for side in "ab"}
    for k, row in enumerate(draft.piston_table):
        if k not in pistons:
            pushes[first + k] = row["area_a"] * gauge["a"][k] - row["area_b"] * gauge["b"][k]
    size = draft.case.ambient_pressure * float(max(draft.piston_table["area_a"]))
    alone, nothing = size * np.eye(pushes.size)[first:], at.under(0.0 * pushes)
    unit = np.array([at.under(alone[k]) - nothing for k in pistons]).T / size
    unit = np.hstack([unit, pin_rows(draft, at).T])  # what pins hold, pistons need not
    forces = np.zeros(len(pistons))
    for _ in range(ROUNDS):  # the second to rounding
        pushes[[first + k for k in pistons]] = forces
        forces = forces - np.linalg.lstsq(unit, at.under(pushes), rcond=None)[0][: forces.size]
    found = {}
    for (k, free), force in zip(pistons.items(), forces, strict=True):
        row = draft.piston_table[k]
        side = free[0] if len(free) == 1 else "a" if force > 0.0 else "b"
        other = gauge["b" if side == "a" else "a"][k] if len(free) == 1 else 0.0
        sign, area, against = (1.0, "area_a", "area_b") if side == "a" else (-1.0, "area_b", "area_a")
        pressure = ambient + (sign * force + row[against] * other) / row[area]
        found |= dict.fromkeys([int(row[one]) for one in free], ambient)
        found[int(row[side])] = float(pressure)
    return {i: p for i, p in found.items() if p > draft.case.law.cavity_pressure}


def is_shut(draft, start, i: int) -> bool:
    """Whether a chamber that states no pressure is joined to nothing that has one."""
    places = list(draft.case.places.values())
    if places[i].initial_pressure is not None:
        return False
    return all(j == i or np.isnan(start.held[j]) for j in start.reaches(i))


def refuse_weightless(draft, at: Statics) -> None:
    """Faults of bodies whose joint lets them move where neither they nor what hangs on them have inertia."""
    at.run("joints: kinematics", "matrix: accelerate")
    n = len(draft.freedom_table)
    for name, row in reversed(list(zip(draft.body_names, draft.body_table, strict=True))):
        own = np.linalg.norm(row["inertia"]) + row["mass"] * float(row["centre"] @ row["centre"])
        least = ALIKE**2 * (own if row["joint"] in (rec.REVOLUTE, rec.BALL) else 0.0)
        for freedom in draft.freedom_table[row["freedom"] : row["freedom"] + row["freedoms"]]:
            left = at.written.scratch[8 * n + freedom["row"] + freedom["depth"]] ** 2
            if np.isnan(left) and len(draft.ride_table):
                text = "fluid in tall tanks, whose own flow has no inertia here, outweighs what carries it"
                wanted = "wanted wider tanks, a heavier body, or a driven joint"
                return draft.fault(f"nodes.{name}.mass", f"{text}; {wanted}")
            if not left > least:
                text = "nothing resists the motion that its joint leaves it: its inertia there is 0"
                return draft.fault(f"nodes.{name}.inertia", f"{text}; give it some, about the axis of the joint")


def start_bodies(draft, start) -> list[str]:
    """Lengths of lines, and of joints what is balanced at the start; returns what moves, in words."""
    if not len(draft.body_table):
        return []
    at = Statics(draft, start.t)
    tables = (draft.brace_table, draft.stop_table, draft.piston_table)
    pushes = np.array([row["force"] for table in tables for row in table])
    travel, first = int(at.layout["travel"]), int(at.layout["push"])
    rows = [row for table in tables for row in table]
    for line in draft.line_table:
        line["length"] = at.out[travel + 2 * line["push"]] if line["acts"] == rec.ALONG else 0.0
        if "speed" in rows[line["push"]].dtype.names:
            rows[line["push"]]["speed"] = at.out[travel + 2 * line["push"] + 1]
    refuse_weightless(draft, at)
    draft.check()
    size = np.abs(at.shares(pushes)).sum(axis=0)
    at.out[first : first + pushes.size] = pushes
    at.run(*at.pushes[:2])
    dry = at.forces()
    at.run(*at.pushes)
    left = at.forces()
    size += np.abs(left - dry)
    freedoms = draft.freedom_table
    accelerate = "matrix: accelerate"
    if len(draft.pin_table):
        accelerate = "pins: accelerate_pinned"
        left, held = start_pins(draft, at)
        size += held
    freedoms["balance"] = np.where(np.abs(left) <= SNAP * size, left, 0.0)
    at.run(*at.pushes, accelerate)
    return moves(draft, at.accelerations())


def pin_rows(draft, at: Statics) -> np.ndarray:
    """G of all rows of pins at the start : float64[rows, freedoms]."""
    n, many = len(draft.freedom_table), int(draft.pin_table["rows"].sum())
    if many:
        at.run(*at.pushes, "pins: accelerate_pinned")
    first = 8 * n + draft.factor_size + 16 * len(draft.body_table)
    return at.written.scratch[first : first + many * n].reshape(many, n).copy()


def start_pins(draft, at: Statics) -> tuple[np.ndarray, np.ndarray]:
    """Gaps and forces of pins at the start: (what is left of forces of freedoms with these, their size). Faults."""
    at.run(*at.pushes, "pins: gaps")
    first = int(at.layout["pin"])
    for k, row in enumerate(draft.pin_table):
        row["gap"][: row["rows"]] = at.out[first + 3 * k :][: row["rows"]]
    rows = pin_rows(draft, at)
    names = [name for name, row in zip(draft.pin_names, draft.pin_table, strict=True) for _ in range(row["rows"])]
    for name in dict.fromkeys(redundant(rows, names)):
        text = "in some direction nothing can open it, or others hold it there already"
        draft.fault(f"links.{name}", f"{text}; of a loop in a plane give its axis, else leave one pin out")
    slips = dict(zip(names, rows @ at.rates(), strict=True))
    for name, slip in slips.items():
        if abs(slip) > LOOSE:
            draft.fault(f"links.{name}", f"the rates of the start open it at {abs(slip):.4g} m/s; let them agree")
    draft.check()
    forces = at.out[int(at.layout["pin"]) :][: 3 * len(draft.pin_table)].reshape(-1, 3)
    for row, force in zip(draft.pin_table, forces, strict=True):
        row["force"][: row["rows"]] = force[: row["rows"]]
    sizes = np.concatenate([np.abs(row["force"][: row["rows"]]) for row in draft.pin_table])
    size = np.abs(rows.T) @ sizes
    at.run(*at.pushes, "pins: hold")
    return at.forces(), size


def redundant(rows: np.ndarray, names: list[str]) -> list[str]:
    """Pins of rows that are sums of those before, or nothing."""
    found, basis = [], np.zeros((0, rows.shape[1]))
    size = np.linalg.norm(rows, axis=1).max()
    for name, row in zip(names, rows, strict=True):
        rest = row - basis.T @ (basis @ row)
        rest -= basis.T @ (basis @ rest)
        if np.linalg.norm(rest) <= ALIKE * size:
            found.append(name)
        else:
            basis = np.vstack([basis, rest / np.linalg.norm(rest)])
    return found


def moves(draft, accelerations: np.ndarray) -> list[str]:
    """What moves at the start, and what begins to, in words."""
    found = []
    for name, row in zip(draft.body_names, draft.body_table, strict=True):
        pose, own = draft.case.poses[name], accelerations[row["freedom"] : row["freedom"] + row["freedoms"]]
        if (fast := np.linalg.norm(pose.spin)) > 0.0:
            found.append(f"body {name} turns at {fast:.4g} rad/s")
        if (fast := np.linalg.norm(pose.velocity)) > 0.0:
            found.append(f"body {name} moves at {fast:.4g} m/s")
        slides = 0 if row["joint"] in (rec.REVOLUTE, rec.BALL) else 3 if row["joint"] == rec.FREE else 1
        for part, unit in ((own[:slides], "m/s2"), (own[slides:], "rad/s2")):
            if np.any(part):
                found.append(f"body {name} accelerates at {np.linalg.norm(part):.4g} {unit}")
    return found
