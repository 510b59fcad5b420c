"""Bodies, their joints, points and lines lowered to tables. Knows names; knows no force and no rhs."""

from __future__ import annotations

import numpy as np

from fvsolve.case import bodies
from fvsolve.kernels import records as rec
from fvsolve.model.schedules import break_times
from fvsolve.parts.body.part import Body

SMALL_ANGLE, SMALL_TRAVEL = 1e-3, 1e-3  # [rad], [m]
SMALL_SPIN, SMALL_SPEED = 0.1, 0.1  # [rad/s], [m/s]
BETWEEN = (-1, -1, -1, rec.ALONG, (0.0, 0.0, 0.0), 0.0)  # a line
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
        when = draft.case.amount(kinks[0], "time", 6)
        text = f"drives the joint, and at t = {when} {what}, which asks for a force without end"
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
    """How the body of a point stands by what is stated; the world's of a frame."""
    return draft.case.stated.poses.get(bodies.point_of(draft.case.nodes, place)[0], bodies.AT_REST)


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
        if draft.case.found:
            row["energy"] += 2.0 * row["turn_stiffness"] * turned_since(draft, (link.from_, link.to))
    draft.line_table = np.array(draft.lines, rec.LINE) if draft.lines else np.zeros(0, rec.LINE)
    rows = [row for table in (draft.brace_table, draft.stop_table, draft.piston_table) for row in table]
    for k, row in enumerate(rows):
        if row["line"] >= 0:
            draft.line_table[row["line"]]["push"] = k


def turned_since(draft, places: tuple[str, str]) -> float:
    """eps.eps of the deviation (56) of two bodies at the start from how they are stated to stand."""
    relative = []
    for case in (draft.case, draft.case.stated):
        here, there = (case.poses.get(bodies.point_of(case.nodes, place)[0], bodies.AT_REST) for place in places)
        relative.append(here.attitude.T @ there.attitude)
    return 0.25 * (3.0 - float(np.sum(relative[0] * relative[1])))


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
