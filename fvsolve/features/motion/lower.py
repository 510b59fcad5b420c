"""Tables of masses, force elements, bodies, joints, points, and networks on bodies; closed chambers at the start."""

import math
from typing import Any

import numpy as np

from fvsolve.case import bodies
from fvsolve.case.bodies import free_joints
from fvsolve.core.assembly.lowering import lowering_of
from fvsolve.core.assembly.schedule_tables import break_times
from fvsolve.core.kernels import dtypes as rec
from fvsolve.features.motion.kernels import tables as records
from fvsolve.features.motion.kernels.tables import motion_of
from fvsolve.features.motion.ports import PLAIN_LINE, distance_and_rate
from fvsolve.features.motion.static_forces import DRIVES, MOTION, StaticForces, pin_rows
from fvsolve.parts import law_elements as codes
from fvsolve.parts.network_elements import fill_network_probe
from fvsolve.parts.nodes_and_links import is_kind
from fvsolve.units import show

SMALL_PRESSURE = 1e5  # a small pressure, which sets the size of a small travel
# [m] of masses without chambers, [m/s] of masses without stiffness, and of joints; [rad], [rad/s] of joints
SMALL_TRAVEL, SMALL_SPEED = 1e-3, 0.1
SMALL_ANGLE, SMALL_SPIN = 1e-3, 0.1


def lower_masses(draft) -> None:
    """Fill the tables of masses, braces (springs, dampers, forces), stops and pistons."""
    motion = motion_of(draft)
    case = draft.case
    motion.mass_names = [
        name for name, node in case.nodes.items() if node.domain == "translational"
    ]
    motion.mass_index = {name: i for i, name in enumerate(motion.mass_names)}
    pushes = [
        link for table in ("brace", "stop", "piston") for _, link, _ in draft.links.get(table, ())
    ]
    ports = [link.ports for link in pushes]
    ends = [
        (own["case"], own["rod"]) if "rod" in own else (own.get("from"), own["to"]) for own in ports
    ]
    # points, or None
    outside = any(place not in motion.mass_index for both in ends for place in both)
    motion.mass_table = np.zeros(len(motion.mass_names) + outside, records.MASS)
    motion.mass_index |= {None: len(motion.mass_names)}
    for name, row in zip(motion.mass_names, motion.mass_table, strict=False):
        node = case.nodes_with_water[name]
        row["position"] = node.initial_position
        if (mass := getattr(node, "mass", None)) is not None:  # a frame is fixed
            row["velocity"], row["lightness"] = node.initial_velocity, 1.0 / mass
    braces, motion.brace_table = draft.fill("brace", records.BRACE)
    stops, motion.stop_table = draft.fill("stop", records.STOP)
    motion.piston_names, motion.piston_table = draft.fill("piston", records.PISTON)
    motion.push_names = [*braces, *stops, *motion.piston_names]
    add_states(draft)


def add_states(draft) -> None:
    """Add position and velocity of every mass as states, with the size of a small deviation of each.

    A small travel changes the pressure of an adjacent chamber by 1 bar; a small velocity belongs to an oscillation with
    this travel as amplitude.
    """
    motion = motion_of(draft)
    nodes, masses = draft.node_table, motion.mass_table
    travel, stiffness = np.full(len(masses), SMALL_TRAVEL), np.zeros(len(masses))
    for row in motion.brace_table:
        stiffness[[row["from_mass"], row["to_mass"]]] += row["stiffness"]
    for row in motion.piston_table:
        for node, area in ((nodes[row["a"]], row["area_a"]), (nodes[row["b"]], row["area_b"])):
            per_travel = draft.fluid.bulk_modulus * area / node["volume"]
            for mass in (row["case"], row["rod"]):
                travel[mass] = min(travel[mass], SMALL_PRESSURE / per_travel)
                stiffness[mass] += area * per_travel
    masses["y"] = -1
    for i, name in enumerate(motion.mass_names):
        if masses[i]["lightness"] > 0.0:
            speed = (
                travel[i] * math.sqrt(stiffness[i] * masses[i]["lightness"])
                if stiffness[i] > 0.0
                else SMALL_SPEED
            )
            masses[i]["y"] = draft.states([f"{name}.position"], travel[i])
            draft.states([f"{name}.velocity"], max(speed, abs(masses[i]["velocity"])))


def pushed_masses(draft) -> np.ndarray:
    """Indices of the masses that each force element joins : int64[elements, 2], braces, stops, then pistons."""
    motion = motion_of(draft)
    ends = (
        (motion.brace_table, "from_mass", "to_mass"),
        (motion.stop_table, "from_mass", "to_mass"),
        (motion.piston_table, "case", "rod"),
    )
    return np.concatenate([np.column_stack([table[a], table[b]]) for table, a, b in ends])


def forces_on_masses(draft, pushes: np.ndarray) -> np.ndarray:
    """Sum of the forces on each mass from force elements and from still water on moving walls : float64[masses] [N].

    pushes : force of each element on its second mass [N], opposite on its first, in the order of `pushed_masses`
    """
    motion = motion_of(draft)
    total = np.zeros(len(motion.mass_table))
    for push, (first, second) in zip(pushes, pushed_masses(draft), strict=True):
        total[first] -= push
        total[second] += push
    for row in motion.still_pushes:
        if row["mass"] >= 0:
            total[row["mass"]] += row["outward"] * row["rest"]
    return total


def start_masses(draft, start) -> list[str]:
    """Set forces of elements and the unbalanced force on each mass at the start; return texts of motions."""
    motion = motion_of(draft)
    nodes = draft.node_table
    masses = motion.mass_table
    ambient = draft.case.ambient_pressure
    size = np.zeros(len(masses))
    for row in motion.brace_table:
        if row["schedule"] >= 0:
            row["given"] = row["force"] = start.schedule_value(row["schedule"])
    for row in motion.piston_table:
        a, b = nodes[row["a"]], nodes[row["b"]]
        row["sweep_a"] = a["mass"] / a["volume"] * row["area_a"]
        row["sweep_b"] = -b["mass"] / b["volume"] * row["area_b"]
        row["leak"] = start.leak_flow(row, float(a["pressure"]), float(b["pressure"]))
        pushed = row["area_a"] * (a["pressure"] - ambient)
        back = row["area_b"] * (b["pressure"] - ambient)
        row["force"] = pushed - back - row["damping"] * row["speed"]
        size[[row["case"], row["rod"]]] += abs(pushed) + abs(back)
    pushes = np.concatenate(
        [table["force"] for table in (motion.brace_table, motion.stop_table, motion.piston_table)]
    )
    total = forces_on_masses(draft, pushes)
    for push, ends in zip(pushes, pushed_masses(draft), strict=True):
        size[ends] += abs(push)
    for row in motion.still_pushes:
        if row["mass"] >= 0:
            size[row["mass"]] += abs(row["rest"])
    masses["force"] = np.where(np.abs(total) > draft.rounding * size, total, 0.0)
    moving = []
    for name, row in zip(motion.mass_names, masses, strict=False):
        if row["velocity"] != 0.0:
            moving.append(f"mass {name} moves at {draft.case.amount(row['velocity'], 'velocity')}")
        # its acceleration is in the texts of the network
        in_network = name in draft.case.network_places
        if row["force"] != 0.0 and row["lightness"] > 0.0 and not in_network:
            acceleration = draft.case.amount(row["force"] * row["lightness"], "acceleration")
            moving.append(f"mass {name} accelerates at {acceleration}")
    return moving


ITERATIONS = 3  # iterations for the forces that support bodies


def supporting_pressures(draft, start) -> dict[int, float]:
    """Pressures of closed chambers that carry loads and have no stated pressure : node -> pressure [Pa].

    Forces of pistons are the least-squares solution that balances the forces on joints and masses. If both chambers of
    a cylinder are closed, the chamber that does not push keeps the pressure of its closed links, or ambient pressure
    without links. A chamber that would need at most the `cavity_pressure` of the density law is left out.
    """
    motion = motion_of(draft)
    pistons = motion.locked
    if not pistons:
        return {}
    ambient, balance = draft.case.ambient_pressure, UnbalancedForces(draft, start.t)
    first = len(motion.brace_table) + len(motion.stop_table)
    pushes = np.zeros(first + len(motion.piston_table))
    for k, row in enumerate([*motion.brace_table, *motion.stop_table]):
        scheduled = "schedule" in row.dtype.names and row["schedule"] >= 0
        pushes[k] = start.schedule_value(row["schedule"]) if scheduled else row["force"]
    gauge = {
        side: [start.pressure(int(row[side])) - ambient for row in motion.piston_table]
        for side in "ab"
    }
    for k, row in enumerate(motion.piston_table):
        if k not in pistons:
            pushes[first + k] = row["area_a"] * gauge["a"][k] - row["area_b"] * gauge["b"][k]
    size = draft.case.ambient_pressure * float(max(motion.piston_table["area_a"]))
    unit_pushes, base = size * np.eye(pushes.size)[first:], balance.under(0.0 * pushes)
    influence = np.array([balance.under(unit_pushes[k]) - base for k in pistons]).T / size
    # forces of pins are unknowns too, so pistons take none of their share
    influence = np.hstack([influence, balance.pins().T])
    forces = np.zeros(len(pistons))
    for _ in range(ITERATIONS):  # the second is exact to rounding
        pushes[[first + k for k in pistons]] = forces
        forces = (
            forces - np.linalg.lstsq(influence, balance.under(pushes), rcond=None)[0][: forces.size]
        )
    pressures = {}
    for (k, closed), force in zip(pistons.items(), forces, strict=True):
        row = motion.piston_table[k]
        side = closed[0] if len(closed) == 1 else "a" if force > 0.0 else "b"
        opposite, sign = ("b", 1.0) if side == "a" else ("a", -1.0)
        push = sign * force + row[f"area_{opposite}"] * gauge[opposite][k]
        pressures |= {int(row[chamber]): ambient + float(gauge[chamber][k]) for chamber in closed}
        pressures[int(row[side])] = ambient + float(push / row[f"area_{side}"])
    return {i: p for i, p in pressures.items() if p > draft.case.law.cavity_pressure}


class UnbalancedForces:
    """Computes unbalanced forces on joint freedoms and free masses, for given forces of springs, stops and pistons."""

    def __init__(self, draft, t: float) -> None:
        motion = motion_of(draft)
        self.draft, self.motion = draft, motion
        self.free = np.flatnonzero(motion.mass_table["y"] >= 0)
        self.joints = StaticForces(draft, t) if len(motion.body_table) else None

    def under(self, pushes: np.ndarray) -> np.ndarray:
        """Unbalanced forces for given pushes [N] : float64[freedoms + masses], joints first."""
        joints = [] if self.joints is None else self.joints.under(pushes)
        return np.concatenate([joints, forces_on_masses(self.draft, pushes)[self.free]])

    def pins(self) -> np.ndarray:
        """Constraint matrix of all pins, see `pin_rows` : float64[constraints, freedoms + masses], zero for masses."""
        rows = np.zeros((0, 0)) if self.joints is None else pin_rows(self.draft, self.joints)
        return np.pad(rows, ((0, 0), (0, len(self.free))))


def find_closed_chambers(draft, start) -> None:
    """Record, for each piston, the sides with a closed chamber that can carry a load, and those with trapped fluid.

    They are written to `locked` and `shut`, see `Motion`.
    """
    motion = motion_of(draft)
    for k, row in enumerate(motion.piston_table):
        closed = [side for side in "ab" if is_closed(draft, start, int(row[side]))]
        isolated = [side for side in "ab" if start.connected_nodes(int(row[side])) == [row[side]]]
        motion.locked |= {k: closed} if closed else {}
        motion.shut |= {k: isolated} if isolated else {}


def is_closed(draft, start, i: int) -> bool:
    """True if chamber i has no stated pressure, and no open path joins it to a node with a fixed pressure."""
    places = list(draft.case.places.values())
    if places[i].initial_pressure is not None:
        return False
    return all(j == i or np.isnan(start.fixed_potentials[j]) for j in start.connected_nodes(i))


KINDS = {
    "revolute": records.REVOLUTE,
    "prismatic": records.PRISMATIC,
    "ball": records.BALL,
    "free": records.FREE,
    "fixed": records.WELD,
}
ANGLES, SPINS = ("eta", "eps_x", "eps_y", "eps_z"), ("spin_x", "spin_y", "spin_z")
STATES = {  # for each kind: coordinates, then velocities, each with its size of a small deviation
    "revolute": ({"angle": SMALL_ANGLE}, {"rate": SMALL_SPIN}),
    "prismatic": ({"travel": SMALL_TRAVEL}, {"travel_rate": SMALL_SPEED}),
    "ball": (dict.fromkeys(ANGLES, SMALL_ANGLE), dict.fromkeys(SPINS, SMALL_SPIN)),
    "free": (
        dict.fromkeys(("centre_x", "centre_y", "centre_z"), SMALL_TRAVEL)
        | dict.fromkeys(ANGLES, SMALL_ANGLE),
        dict.fromkeys(("centre_vx", "centre_vy", "centre_vz"), SMALL_SPEED)
        | dict.fromkeys(SPINS, SMALL_SPIN),
    ),
    "fixed": ({}, {}),
}


def lower_bodies(draft) -> None:
    """Fill the tables of bodies and of their degrees of freedom, each body after its parent body."""
    motion = motion_of(draft)
    nodes = draft.case.nodes_with_water
    motion.body_names = list(draft.case.poses)
    table = motion.body_table = np.zeros(len(motion.body_names), records.BODY)
    paths: list[list[int]] = []
    chains: list[list[int]] = []  # for each body, the freedoms from its root to it
    for i, (name, row) in enumerate(zip(motion.body_names, table, strict=True)):
        body = nodes[name]
        parent_name = bodies.carrier_of(body)[0]
        row["parent"] = (
            motion.body_names.index(parent_name) if is_kind(nodes.get(parent_name), "body") else -1
        )
        row["root"] = table[row["parent"]]["root"] if row["parent"] >= 0 else i
        fill_body(draft, name, body, row)
        row["freedom"] = len(paths)
        path = list(chains[row["parent"]]) if row["parent"] >= 0 else []
        for _ in range(row["freedoms"]):
            path = [*path, len(paths)]
            paths.append(path)
        chains.append(path)
    freedoms = motion.freedom_table = np.zeros(len(paths), records.FREEDOM)
    at = 0
    for row, path in zip(freedoms, paths, strict=True):
        row["depth"], row["path"], row["row"] = len(path) - 1, len(draft.integers), at
        draft.integers += path
        at += len(path)
    motion.factor_size = at


def fill_body(draft, name: str, body: Any, row) -> None:
    """Fill the BODY row of a body, and add the states of its joint."""
    joint, t = body.joint, draft.case.numerics.start
    row["joint"], row["mass"], row["centre"] = KINDS[joint.kind], body.mass, body.centre_of_mass
    row["inertia"], row["axis"] = body.inertia_matrix().ravel(), joint.unit_axis
    row["at"], row["attitude"] = (
        bodies.joint_position(draft.case.nodes, body),
        joint.attitude.rotation.ravel(),
    )
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
    key = "travel" if row["joint"] == records.PRISMATIC else "angle"
    # kinks before the start have no effect
    start, end = draft.case.numerics.start, draft.case.numerics.end
    if schedule.kind == "formula" and schedule.program.kinks:
        text = f"{show(schedule.program.text)} drives the joint, and has kinks, which need an infinite force"
        text = f"{text}; expected a formula without abs, min, max, where and comparisons"
        draft.fault(f"nodes.{name}.joint.{key}", text)
    kinks = [(time, jump) for time, jump in sorted(rate_jumps(schedule)) if start < time <= end]
    if kinks:
        kind = "it jumps" if kinks[0][1] else "its rate jumps"
        time_text = draft.case.moment(kinks[0][0])
        text = f"drives the joint, and at t = {time_text} {kind}, which needs an infinite force"
        remedy = 'expected kind = "smooth" with zero slope at both ends, or a harmonic'
        draft.fault(f"nodes.{name}.joint.{key}", f"{text}; {remedy}")
    # jumps of acceleration
    for time in schedule.time if np.all(np.isfinite(schedule.time)) else ():
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
    motion = motion_of(draft)
    motion.pin_names, motion.pin_table = draft.fill("pin", records.PIN)
    motion.bushing_names, motion.bushing_table = draft.fill("bushing", records.BUSHING)
    for name, row in zip(motion.bushing_names, motion.bushing_table, strict=True):
        link = draft.case.links[name]
        row["energy"] = (
            0.5
            * row["stiffness"]
            * distance_and_rate(draft, (link.from_, link.to), PLAIN_LINE)[0] ** 2
        )
        if draft.case.equilibrium_nodes:
            row["energy"] += (
                2.0 * row["turn_stiffness"] * relative_turn(draft, (link.from_, link.to))
            )
    motion.line_table = (
        np.array(motion.lines, records.LINE) if motion.lines else np.zeros(0, records.LINE)
    )
    rows = [
        row
        for table in (motion.brace_table, motion.stop_table, motion.piston_table)
        for row in table
    ]
    for k, row in enumerate(rows):
        if row["line"] >= 0:
            motion.line_table[row["line"]]["push"] = k


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
    motion = motion_of(draft)
    rows: list[tuple] = []
    links, places = draft.case.conduits, draft.case.places
    for name, row in [
        *zip(draft.pipe_names, draft.pipe_table, strict=True),
        *zip(draft.column_names, draft.column_table, strict=True),
    ]:
        link = links[name]
        first, last = places[link.from_], places[link.to]
        if getattr(first, "on", None) is None:
            continue
        row["forcing"] = len(rows)
        ends = np.array(first.place), np.array(last.place)
        if "cells" in row.dtype.names:
            shares = np.linspace(0.0, 1.0, int(row["cells"]) + 1)[:, None]
            points = ends[0] + shares * (ends[1] - ends[0])
            rows += [
                moving_segment_row(draft, first.on, points[k : k + 2])
                for k in range(len(points) - 1)
            ]
        else:
            points = np.array([ends[0], *link.route, ends[1]])
            row["forcings"] = len(points) - 1
            rows += [
                moving_segment_row(draft, first.on, points[k : k + 2])
                for k in range(len(points) - 1)
            ]
    for node, row in zip(places.values(), draft.node_table, strict=True):
        if getattr(node, "on", None) is None or row["kind"] == rec.PATCH:
            continue
        row["forcing"] = len(rows)
        foot, high = np.array(node.place), node.level if row["kind"] == rec.TANK else 0.0
        points = np.array([foot, foot + [0.0, 0.0, high]])
        body, start, end, swept, rise, heavy = moving_segment_row(draft, node.on, points)
        rows.append((body, start, end, swept, -rise, heavy))
    motion.moving_segment_table = (
        np.array(rows, records.MOVING_SEGMENT) if rows else np.zeros(0, records.MOVING_SEGMENT)
    )
    if reads_joint_forces(draft):
        for place, text in bodies.missing_reactions(draft.case.nodes, draft.case.links):
            draft.fault(".".join(place), f"a probe reads forces of joints, but {text}")


def reads_joint_forces(draft) -> bool:
    """True if a probe reads forces of a joint."""
    return any(probe.quantity.startswith("joint_") for probe in draft.case.probes)


def moving_segment_row(draft, on: str, points: np.ndarray) -> tuple:
    """Row of the table `moving_segments` for a straight line between two points, given in axes of the body `on` [m]."""
    motion = motion_of(draft)
    rise = (draft.case.poses[on].attitude @ (points[1] - points[0]))[2]
    heavy = records.MOVED_BY_FORCES if any(free_joints(on, draft.case.nodes)) else 0
    heavy = records.JOINT_LOAD_READ if reads_joint_forces(draft) else heavy
    return (
        motion.body_names.index(on),
        *points,
        np.cross(*points),
        -draft.case.gravity * rise,
        heavy,
    )


def driven_at_start(draft, start) -> list[str]:
    """Texts of pipes and rigid columns whose flow is driven by the motion of their body at the start."""
    motion = motion_of(draft)
    if not len(motion.moving_segment_table):
        return []
    at = StaticForces(draft, start.t)
    at.run(MOTION, DRIVES)
    first, rho = int(at.layout["forcing"]), draft.fluid.density
    drives = at.out[first : first + len(motion.moving_segment_table)]
    texts = []
    for kind, names, table in (
        ("pipe", draft.pipe_names, draft.pipe_table),
        ("rigid column", draft.column_names, draft.column_table),
    ):
        for name, row in zip(names, table, strict=True):
            if row["forcing"] >= 0:
                count = int(row["cells" if "cells" in row.dtype.names else "forcings"])
                push = float(drives[row["forcing"] : row["forcing"] + count].sum())
                if abs(push) > ROUNDING:
                    texts.append(
                        f"{kind} {name}: the motion of its body drives its flow with "
                        f"{draft.case.amount(rho * push, 'pressure', span=True)}"
                    )
    return texts


LINK_PROBES = {
    "pin": (rec.PIN_VALUE, ("gap", "force")),
    "bushing": (rec.BUSHING_VALUE, ("gap", "force", "torque")),
}


def lower_link_probe(draft, row, probe) -> bool:
    """Fill the row of a probe of a force element, a pin or a bushing; False for other links."""
    motion, link = motion_of(draft), draft.case.links[probe.name]
    table = lowering_of(type(link)).of(link).table
    if table in LINK_PROBES:
        row["kind"], quantities = LINK_PROBES[table]
        row["side"] = quantities.index(probe.quantity)
        row["index"] = (motion.pin_names if table == "pin" else motion.bushing_names).index(
            probe.name
        )
    elif table == "piston" and probe.quantity != "force":
        row["index"] = motion.piston_names.index(probe.name)
        row["kind"] = rec.PISTON_POSITION if probe.quantity == "position" else rec.PISTON_VELOCITY
    elif table == "piston" and link.has_dry_friction:
        fill_network_probe(draft, row, f"links.{probe.name}", "all flows")
        row["side"], row["cell"] = codes.NET_PUSH, motion.push_names.index(probe.name)
    elif table in ("brace", "stop", "piston"):
        row["kind"], row["index"] = rec.FORCE, motion.push_names.index(probe.name)
    else:
        return False
    return True


def pose_facts(pose) -> dict[str, float]:
    """Position, attitude, speed and angular speed of a body at the start."""
    place = dict(zip("xyz", pose.place.tolist(), strict=True))
    from fvsolve.attitude import roll_pitch_yaw

    angles = dict(zip(("roll", "pitch", "yaw"), roll_pitch_yaw(pose.attitude), strict=True))
    return (
        place
        | angles
        | {"speed": float(np.linalg.norm(pose.velocity)), "spin": float(np.linalg.norm(pose.spin))}
    )
