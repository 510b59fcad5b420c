"""Tables of bodies, joints and points, of pins and bushings, and of networks on bodies."""

from __future__ import annotations

import numpy as np

from fvsolve.assembly.mechanics import PLAIN_LINE, distance_and_rate
from fvsolve.assembly.schedule_tables import break_times
from fvsolve.case import bodies
from fvsolve.case.bodies import free_joints
from fvsolve.kernels import dtypes as rec
from fvsolve.parts.body import Body

SMALL_ANGLE, SMALL_TRAVEL = 1e-3, 1e-3  # [rad], [m]
SMALL_SPIN, SMALL_SPEED = 0.1, 0.1  # [rad/s], [m/s]


KINDS = {"revolute": rec.REVOLUTE, "prismatic": rec.PRISMATIC, "ball": rec.BALL, "free": rec.FREE, "fixed": rec.WELD}
ANGLES, SPINS = ("eta", "eps_x", "eps_y", "eps_z"), ("spin_x", "spin_y", "spin_z")
STATES = {  # for each kind: coordinates, then velocities, each with its size of a small deviation
    "revolute": ({"angle": SMALL_ANGLE}, {"rate": SMALL_SPIN}),
    "prismatic": ({"travel": SMALL_TRAVEL}, {"travel_rate": SMALL_SPEED}),
    "ball": (dict.fromkeys(ANGLES, SMALL_ANGLE), dict.fromkeys(SPINS, SMALL_SPIN)),
    "free": (dict.fromkeys(("centre_x", "centre_y", "centre_z"), SMALL_TRAVEL) | dict.fromkeys(ANGLES, SMALL_ANGLE),
             dict.fromkeys(("centre_vx", "centre_vy", "centre_vz"), SMALL_SPEED) | dict.fromkeys(SPINS, SMALL_SPIN)),
    "fixed": ({}, {}),
}  # fmt: skip


def lower_bodies(draft) -> None:
    """Fill the tables of bodies and of their degrees of freedom, each body after its parent body."""
    nodes = draft.case.nodes_with_water
    draft.body_names = list(draft.case.poses)
    table = draft.body_table = np.zeros(len(draft.body_names), rec.BODY)
    paths: list[list[int]] = []
    chains: list[list[int]] = []  # for each body, the freedoms from its root to it
    for i, (name, row) in enumerate(zip(draft.body_names, table, strict=True)):
        body = nodes[name]
        parent_name = bodies.carrier_of(body)[0]
        row["parent"] = draft.body_names.index(parent_name) if isinstance(nodes.get(parent_name), Body) else -1
        row["root"] = table[row["parent"]]["root"] if row["parent"] >= 0 else i
        fill_body(draft, name, body, row)
        row["freedom"] = len(paths)
        path = list(chains[row["parent"]]) if row["parent"] >= 0 else []
        for _ in range(row["freedoms"]):
            path = [*path, len(paths)]
            paths.append(path)
        chains.append(path)
    freedoms = draft.freedom_table = np.zeros(len(paths), rec.FREEDOM)
    at = 0
    for row, path in zip(freedoms, paths, strict=True):
        row["depth"], row["path"], row["row"] = len(path) - 1, len(draft.integers), at
        draft.integers += path
        at += len(path)
    draft.factor_size = at


def fill_body(draft, name: str, body: Body, row) -> None:
    """Fill the BODY row of a body, and add the states of its joint."""
    joint, t = body.joint, draft.case.numerics.start
    row["joint"], row["mass"], row["centre"] = KINDS[joint.kind], body.mass, body.centre_of_mass
    row["inertia"], row["axis"] = body.inertia_matrix().ravel(), joint.unit_axis
    row["at"], row["attitude"] = bodies.joint_position(draft.case.nodes, body), joint.attitude.rotation.ravel()
    row["damping"], row["stiffness"] = joint.damping or 0.0, joint.stiffness or 0.0
    pose = draft.case.poses[name]
    row["height"] = pose.at(body.centre_of_mass)[2]
    speed, spin = pose.velocity_at(body.centre_of_mass), pose.attitude.T @ pose.spin
    row["energy"] = 0.5 * (body.mass * speed @ speed + spin @ body.inertia_matrix() @ spin)
    row["y"] = row["rate"] = row["schedule"] = -1
    if joint.drive_schedule is not None:
        drive_joint(draft, name, joint.drive_schedule, row)
        return
    coordinates, velocities = STATES[joint.kind]
    if not coordinates:
        return
    row["freedoms"] = len(velocities)
    row["y"] = draft.states([f"{name}.{key}" for key in coordinates], list(coordinates.values()))
    row["rate"] = draft.states([f"{name}.{key}" for key in velocities], list(velocities.values()))
    if joint.kind == "free":
        row["start"] = [*pose.at(body.centre_of_mass), *joint.attitude.parameters]
        row["speed"] = [*joint.centre_velocity, *joint.angular_velocity]
    elif joint.kind == "ball":
        row["start"][0], row["speed"][:3] = 1.0, joint.angular_velocity
    else:
        row["start"][0], row["speed"][0] = bodies.joint_coordinate(joint, t), joint.rate or 0.0


def drive_joint(draft, name: str, schedule, row) -> None:
    """Write the schedule that drives a joint to the BODY row.

    Adds a fault if the value or the rate of the schedule jumps during the run, because this needs an infinite force.
    """
    row["schedule"] = draft.schedules.add(schedule)
    key = "travel" if row["joint"] == rec.PRISMATIC else "angle"
    start, end = draft.case.numerics.start, draft.case.numerics.end  # kinks before the start have no effect
    kinks = [time for time, _ in sorted(rate_jumps(schedule)) if start < time <= end]
    if kinks:
        kind = "it jumps" if schedule.kind == "step" else "its rate jumps"
        time_text = draft.case.amount(kinks[0], "time", 6)
        text = f"drives the joint, and at t = {time_text} {kind}, which needs an infinite force"
        draft.fault(
            f"nodes.{name}.joint.{key}", f'{text}; expected kind = "smooth" with zero slope at both ends, or a harmonic'
        )
    for time in schedule.time if np.all(np.isfinite(schedule.time)) else ():  # jumps of acceleration
        draft.schedules.breaks.setdefault(float(time), False)


def rate_jumps(schedule) -> list[tuple[float, bool]]:
    """Times at which the value or the rate of a schedule jumps : list of (time [s], True if the value jumps).

    The end of a ramp counts only if its exponent is at most 1; with a greater exponent the ramp ends with zero rate.
    """
    if schedule.kind != "ramp":
        return break_times(schedule)
    (first, last), n = break_times(schedule), schedule.exponent
    return [first] + ([last] if n <= 1.0 else [])  # v1 + (v0 - v1) (1 - s)^n never begins level


def lower_lines(draft) -> None:
    """Fill the tables of pins and bushings; write the number of its force element to each line of action."""
    draft.pin_names, draft.pin_table = draft.fill("pin", rec.PIN)
    draft.bushing_names, draft.bushing_table = draft.fill("bushing", rec.BUSHING)
    for name, row in zip(draft.bushing_names, draft.bushing_table, strict=True):
        link = draft.case.links[name]
        row["energy"] = 0.5 * row["stiffness"] * distance_and_rate(draft, (link.from_, link.to), PLAIN_LINE)[0] ** 2
        if draft.case.equilibrium_nodes:
            row["energy"] += 2.0 * row["turn_stiffness"] * relative_turn(draft, (link.from_, link.to))
    draft.line_table = np.array(draft.lines, rec.LINE) if draft.lines else np.zeros(0, rec.LINE)
    rows = [row for table in (draft.brace_table, draft.stop_table, draft.piston_table) for row in table]
    for k, row in enumerate(rows):
        if row["line"] >= 0:
            draft.line_table[row["line"]]["push"] = k


def relative_turn(draft, places: tuple[str, str]) -> float:
    """sin(angle / 2)^2 of the rotation between the stated relative attitude of two bodies and that at the start."""
    relative = []
    for case in (draft.case, draft.case.as_stated):
        here, there = (case.pose_of(case.body_point(place)[0]) for place in places)
        relative.append(here.attitude.T @ there.attitude)
    return 0.25 * (3.0 - float(np.sum(relative[0] * relative[1])))


ROUNDING = 1e-9  # specific force times length [J/kg] below which it counts as rounding


def lower_moving_segments(draft) -> None:
    """Fill a row for every pipe cell, every segment of a rigid column and every node (except patches) on a body.

    Adds faults if a probe reads forces of joints, but the force of a part on its body is not modelled.
    """
    rows: list[tuple] = []
    links, places = draft.case.conduits, draft.case.places
    for name, row in [*zip(draft.pipe_names, draft.pipe_table, strict=True),
                      *zip(draft.column_names, draft.column_table, strict=True)]:  # fmt: skip
        link = links[name]
        first, last = places[link.from_], places[link.to]
        if getattr(first, "on", None) is None:
            continue
        row["moving_segment"] = len(rows)
        ends = np.array(first.place), np.array(last.place)
        if "cells" in row.dtype.names:
            shares = np.linspace(0.0, 1.0, int(row["cells"]) + 1)[:, None]
            points = ends[0] + shares * (ends[1] - ends[0])
            rows += [moving_segment_row(draft, first.on, points[k : k + 2]) for k in range(len(points) - 1)]
        else:
            points = np.array([ends[0], *link.route, ends[1]])
            row["moving_segments"] = len(points) - 1
            rows += [moving_segment_row(draft, first.on, points[k : k + 2]) for k in range(len(points) - 1)]
    for node, row in zip(places.values(), draft.node_table, strict=True):
        if getattr(node, "on", None) is None or row["kind"] == rec.PATCH:
            continue
        row["moving_segment"] = len(rows)
        foot, high = np.array(node.place), node.level if row["kind"] == rec.TANK else 0.0
        body, start, end, swept, rise, heavy = moving_segment_row(
            draft, node.on, np.array([foot, foot + [0.0, 0.0, high]])
        )
        rows.append((body, start, end, swept, -rise, heavy))
    draft.moving_segment_table = np.array(rows, rec.MOVING_SEGMENT) if rows else np.zeros(0, rec.MOVING_SEGMENT)
    if reads_joint_forces(draft):
        for place, text in bodies.missing_reactions(draft.case.nodes, draft.case.links):
            draft.fault(".".join(place), f"a probe reads forces of joints, but {text}")


def reads_joint_forces(draft) -> bool:
    """True if a probe reads forces of a joint."""
    return any(probe.quantity.startswith("joint_") for probe in draft.case.probes)


def moving_segment_row(draft, on: str, points: np.ndarray) -> tuple:
    """Row of the table `moving_segments` for a straight line between two points, given in axes of the body `on` [m]."""
    rise = (draft.case.poses[on].attitude @ (points[1] - points[0]))[2]
    heavy = (
        rec.JOINT_LOAD_READ
        if reads_joint_forces(draft)
        else rec.MOVED_BY_FORCES
        if any(free_joints(on, draft.case.nodes))
        else 0
    )
    return draft.body_names.index(on), *points, np.cross(*points), -draft.case.gravity * rise, heavy


def driven_at_start(draft, start) -> list[str]:
    """Texts of pipes and rigid columns whose flow is driven by the motion of their body at the start."""
    if not len(draft.moving_segment_table):
        return []
    from fvsolve.model.static_forces import DRIVES, MOTION, StaticForces

    at = StaticForces(draft, start.t)
    at.run(MOTION, DRIVES)
    first, rho = int(at.layout["moving_segment"]), draft.fluid.density
    drives = at.out[first : first + len(draft.moving_segment_table)]
    texts = []
    for kind, names, table in (("pipe", draft.pipe_names, draft.pipe_table),
                               ("rigid column", draft.column_names, draft.column_table)):  # fmt: skip
        for name, row in zip(names, table, strict=True):
            if row["moving_segment"] >= 0:
                count = int(row["cells" if "cells" in row.dtype.names else "moving_segments"])
                push = float(drives[row["moving_segment"] : row["moving_segment"] + count].sum())
                if abs(push) > ROUNDING:
                    texts.append(
                        f"{kind} {name}: the motion of its body drives its flow with "
                        f"{draft.case.amount(rho * push, 'pressure', span=True)}"
                    )
    return texts
