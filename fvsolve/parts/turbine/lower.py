"""Turbines in the tables of a model, with their hill charts, and their steady start.

For the kernels a hill chart is a table of values on rays from the origin of the plane of unit speed n = omega / speed
and unit flow u = flow / (flow scale capacity), at a head of 1 m. The flow scale is the greatest flow of the chart,
`capacity` the greatest flow of a curve over this scale.
"""

import math
from itertools import pairwise

import numpy as np

from fvsolve.core.assembly.lowering import ANGULAR_SPEED, Device, opening_input
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.steady import Edge
from fvsolve.errors import Notice
from fvsolve.parts.pump.law import INERTIA, RATED
from fvsolve.parts.pump.lower import unusual_inertia
from fvsolve.parts.pump.lower_shaft import ShaftLowering, numbers_of
from fvsolve.parts.turbine import law

ANGLE_TOLERANCE = 1e-7  # angle below which two rays are merged [rad]
# angle between rays outside the chart where a turning runner pumps in reverse [rad]
SPACING = math.pi / 24.0
PUMP_RATIO = 2.0  # shaft power over hydraulic power there
STEEPEST = 10.0  # flow over speed up to which the shaft torque rises; the head vanishes beyond
# angles of a runner at rest and in backward rotation without flow [rad]
STANDING, BACKWARD = 0.5 * math.pi, math.pi


def chart_numbers(part, weight: float) -> list[float]:
    """Parameters of the hill chart of a turbine, in the order that `law` states; weight : rho g [N/m3]"""
    chart, d = part.hill_chart, part.diameter
    speed = max(abs(n) for entry in chart.curves for n in entry.speed) * math.pi / 30.0 / d
    flow = max(q for entry in chart.curves for q in entry.flow) * d * d
    torque_scale = weight * flow / speed
    curves = [nodes_of(entry, part, speed, flow, torque_scale, weight) for entry in chart.curves]
    rays = merge_angles(np.concatenate([angles for _, angles, *_ in curves]))
    directions = np.column_stack([np.cos(rays), np.sin(rays)])
    tables = [curve_at_rays(directions, rays, *entry[1:5]) for entry in curves]
    shut_torque = 0.0
    if chart.shut_point is not None:
        n11, t11 = chart.shut_point
        shut_torque = t11 * d**3 / (n11 * math.pi / 30.0 / d) ** 2
    numbers = [len(curves), len(rays), speed, flow, shut_torque]
    numbers += [entry.opening for entry in chart.curves] + [entry[0] for entry in curves]
    numbers += [entry[5][0] for entry in curves] + [entry[5][1] for entry in curves]
    numbers += [
        *rays,
        *directions[:, 0],
        *directions[:, 1],
        *np.concatenate([root for root, _ in tables]),
    ]
    numbers += [*np.concatenate([torque for _, torque in tables])]
    return [float(entry) for entry in numbers]


def nodes_of(curve, part, speed: float, flow: float, torque_scale: float, weight: float):
    """(capacity, angles, directions, roots, torques, range) of a curve: its values on its own rays from the origin.

    capacity : greatest flow at 1 m over the flow scale [-]; angles : angles of the rays [rad]
    directions : (cosine, sine) of each ray
    roots : square root of the head at unit distance from the origin, 1 over the distance of the curve
    torques : torque over head [N]; range : (least, greatest) angle of the given points [rad]
    speed, flow : scales of speed [rad/s] and flow [m3/s] at 1 m; torque_scale : weight flow / speed
    weight : rho g [N/m3]
    Assumptions outside the given points: at standstill, forward flow is that of the last point, and reverse flow is the
    greatest flow of the curve; no head at backward rotation without flow; at forward rotation without flow, the
    distance of the first point from the origin.
    """
    d = part.diameter
    capacity = max(curve.flow) * d * d / flow
    n = np.array(curve.speed) * math.pi / 30.0 / d / speed
    u = np.array(curve.flow) * d * d / flow / capacity
    torque = np.array(curve.torques(weight)) * d**3
    angle = np.unwrap(np.arctan2(u, n))
    if angle[-1] < angle[0]:
        n = n[::-1]
        u = u[::-1]
        torque = torque[::-1]
        angle = angle[::-1]
    angle = angle - 2.0 * math.pi * math.floor((angle[0] + STANDING) / (2.0 * math.pi))
    distance = np.hypot(n, u)
    nodes = list(zip(angle, 1.0 / distance, torque, strict=True))
    nodes = nodes_before(nodes[0], n[0], u[0], torque[0], torque_scale * capacity) + nodes
    nodes += nodes_behind(nodes[-1], n[-1], u[-1], torque[-1], torque_scale * capacity)
    angles, roots, torques = (np.array(column) for column in zip(*nodes, strict=True))
    return (
        capacity,
        angles,
        np.column_stack([np.cos(angles), np.sin(angles)]),
        roots,
        torques,
        (angle[0], angle[-1]),
    )


def nodes_before(first, n: float, u: float, torque: float, torque_scale: float) -> list:
    """(angle, root of head, torque over head) of each ray below the first angle of a curve, down to -pi / 2.

    At -pi / 2 the flow is reverse and the runner stands still. first : these values on the ray of the first point
    n, u, torque : relative speed, relative flow and torque over head of the first point
    torque_scale : as for `pump_nodes`
    """
    angle, root, _ = first
    nodes = []
    if angle > 0.0:
        braked = min(torque, 0.0) - max(torque, 0.0) * (1.0 / root - n) / n
        nodes = [(0.0, root, braked)]
        angle, torque = 0.0, braked
    return pump_nodes(angle, root, torque, torque_scale, -1.0)[::-1] + nodes


def nodes_behind(last, n: float, u: float, torque: float, torque_scale: float) -> list:
    """(angle, root of head, torque over head) of each ray above the last angle of a curve, up to 3 pi / 2.

    At 3 pi / 2 the flow is reverse and the runner stands still. last : these values on the ray of the last point
    n, u, torque : relative speed, relative flow and torque over head of the last point
    torque_scale : as for `pump_nodes`
    """
    angle, root, _ = last
    nodes = []
    if angle < STANDING:
        nodes.append((STANDING, 1.0 / u, 2.0 * max(torque, 0.0)))
    if angle < BACKWARD:
        return [*nodes, (BACKWARD, 0.0, 0.0), *pump_nodes(0.0, 0.0, 0.0, torque_scale, 1.0)]
    return pump_nodes(angle - BACKWARD, root, torque, torque_scale, 1.0)


def pump_nodes(
    angle: float, root: float, torque: float, torque_scale: float, direction: float
) -> list:
    """(angle, root of head, torque over head) of each ray with reverse flow beyond a first ray, up to standstill.

    The root is -1 at standstill. The torque is that at which shaft power is PUMP_RATIO times hydraulic power, constant
    beyond STEEPEST, plus the surplus of the torque on the first ray over it.
    angle, root, torque : these values on the first ray; direction : -1 for forward rotation, 1 for backward rotation
    torque_scale : torque over head [N] at which shaft power is hydraulic power, at equal relative speed and flow
    """
    first_tilt = -angle if direction < 0.0 else angle
    count = max(2, math.ceil((STANDING - first_tilt) / SPACING))
    excess = abs(torque) - PUMP_RATIO * torque_scale * math.tan(first_tilt)
    nodes = []
    for tilt in np.linspace(first_tilt, STANDING, count + 1)[1:]:
        ratio = min(math.tan(tilt), STEEPEST)
        shaft_torque = direction * (PUMP_RATIO * torque_scale * ratio + max(excess, 0.0))
        # the root lies on the line from the first ray to -1 at standstill
        share = math.cos(tilt) / math.cos(first_tilt)
        root_there = share * root - (math.sin(tilt) - share * math.sin(first_tilt))
        nodes.append((tilt, root_there, shaft_torque))
    return [
        (-tilt if direction < 0.0 else BACKWARD + tilt, value, shaft_torque)
        for tilt, value, shaft_torque in nodes
    ]


def merge_angles(angles: np.ndarray) -> np.ndarray:
    """Angles [rad] of the rays of all curves, ascending, with those closer than ANGLE_TOLERANCE merged.

    They go from reverse flow at standstill (-pi / 2) over a full turn to 3 pi / 2, both included. The angle of a point
    is atan2(u, n), with its relative flow u and relative speed n.
    """
    inner = np.sort(
        angles[(angles > -STANDING + ANGLE_TOLERANCE) & (angles < 3.0 * STANDING - ANGLE_TOLERANCE)]
    )
    distinct = inner[np.concatenate([[True], np.diff(inner) > ANGLE_TOLERANCE])]
    return np.concatenate([[-STANDING], distinct, [3.0 * STANDING]])


def curve_at_rays(
    ray_directions: np.ndarray, rays: np.ndarray, angles, directions, roots, torques
) -> tuple[np.ndarray, np.ndarray]:
    """(roots of head, torques over head) of a curve on all rays; between its own rays the curve is a straight line.

    ray_directions, rays : directions (cosine, sine) and angles [rad] of all rays
    angles, directions, roots, torques : values on the own rays of the curve, see `nodes_of`
    """
    i = np.clip(np.searchsorted(angles, rays) - 1, 0, len(angles) - 2)
    (a, b), (c, d), (x, y) = directions[i].T, directions[i + 1].T, ray_directions.T
    share_1, share_2 = (x * d - y * c) / (a * d - b * c), (a * y - b * x) / (a * d - b * c)
    weights = (
        share_1 * np.maximum(roots[i], law.LEAST_ROOT),
        share_2 * np.maximum(roots[i + 1], law.LEAST_ROOT),
    )
    root = share_1 * roots[i] + share_2 * roots[i + 1]
    torque = (weights[0] * torques[i] + weights[1] * torques[i + 1]) / (weights[0] + weights[1])
    nearest = np.abs(rays[:, None] - angles).argmin(axis=1)
    is_own = np.abs(rays - angles[nearest]) <= ANGLE_TOLERANCE
    return np.where(is_own, roots[nearest], root), np.where(is_own, torques[nearest], torque)


FLOW_TOLERANCE = 1e-6  # pressure difference regarded as zero, over the pressure drops


class TurbineRows(ShaftLowering, Device, kind="turbine"):
    """Conversion to table rows of turbines: restrictions that follow their hill chart."""

    law = law
    quantities = ("head", "speed", "torque", "power", "opening")
    small = 1.0  # rad/s
    fluid_torque_sign = 1.0

    def inputs(self, model, name, part):
        return opening_input(model, name) | self.speed_input(model, name, ANGULAR_SPEED)

    def restriction(self, draft, name, link, row) -> None:
        density = draft.fluid.density
        row["data"], row["schedule"] = len(draft.floats), draft.schedules.add(link.opening)
        draft.floats += chart_numbers(link, density * draft.case.gravity)
        row["conductance"] = (
            density * draft.floats[row["data"] + law.FLOW] ** 2 / draft.case.gravity
        )

    def numbers(self, draft, name, part) -> list[float]:
        by_index = self.drive_numbers(draft, name, part) | {
            INERTIA: part.inertia or np.inf,
            RATED: 1.0,
        }
        return numbers_of(by_index, self.torque_schedules(draft, name), [])

    def energy_rows(self, model, part, row, y, out) -> list[dict[int, float]]:
        return [{int(row["y"]): math.sqrt(0.5 * part.inertia)}] if row["y"] >= 0 else []

    def above(self, model, part, row) -> float:
        speed = float(model.tables.valves[row["valve"]]["drive"])
        return 0.5 * part.inertia * speed**2 if row["y"] >= 0 else 0.0

    def passing_notice(self, model, name, part, time) -> Notice:
        moment = model.case.moment(time)
        text = (
            f"{name}: leaves its hill chart at {moment}; beyond the chart the curves are straight lines to the "
            "flow at rest and to the speed without flow; give more points there"
        )
        return Notice("range", f"links.{name}", text, "hill_chart")

    def edge(self, start, k: int):
        row = start.valves[k]
        i, j = int(row["from_node"]), int(row["to_node"])
        row["drive"] = omega = self.speed_at(start, k)
        vanes = float(start.schedule_value(row["schedule"]))
        row["open"] = g = (
            row["conductance"] * vanes * vanes if vanes * vanes >= law.SHUT_SHARE else 0.0
        )
        if g <= 0.0:
            return Edge(i, j, None, 0.0, shut=True)
        if start.rest:
            row["open"] = 0.0
            return Edge(i, j, None, 0.0, drop=lambda flow: 0.0)
        floats = start.draft.tables.floats
        at = int(row["data"])
        rho = start.density_at(i)
        weight, ratio = rho * start.case.gravity, rho / start.draft.fluid.density

        def newton(flow, present):
            present = float(present * ratio)
            # finds the greatest of several flows
            first = law.flow_bound(floats, at, vanes, weight, present)
            a, s = law.chart_step(
                floats, at, vanes, omega, rho, weight, 0.0, float(g), float(flow), present, first
            )
            return 1.0 / s, ratio, a / s

        first = rho * floats[at + law.FLOW] * law.capacity(floats, at, vanes)
        return Edge(i, j, newton, float(first), drives=omega != 0.0)

    def follow(self, start, k) -> None:
        """Do nothing: the function `begin` sets the drop of turbine k."""

    def begin(self, start, part, row) -> list[str]:
        draft = start.draft
        valve = start.valves[int(row["valve"])]
        moving = []
        name = draft.valve_names[row["valve"]]
        if valve["open"] > 0.0:
            rho, floats = start.density_at(int(valve["from_node"])), draft.tables.floats
            vanes = float(start.schedule_value(valve["schedule"]))
            at = floats, int(valve["data"]), vanes, float(valve["drive"])
            drop = rho * start.case.gravity * law.chart_head(*at, float(valve["flow"]) / rho)[0]
            ratio = rho / draft.fluid.density
            if (
                abs(drop - valve["drop"] * ratio)
                > FLOW_TOLERANCE * (abs(drop) + abs(valve["drop"])) + 1e-3
            ):
                moving.append(f"turbine {name}: its flow at the start is not on its hill chart")
                valve["open"] = 0.0
            elif draft.case.law.linear:
                valve["drop"] = drop
        draft.warnings += [
            *folded_curve_notice(start, name, part, valve),
            *unusual_inertia_notice(start, name, part, valve),
        ]
        return moving + self.set_free_shaft(start, part, row, valve)

    def fluid_torque(self, start, row, valve) -> float:
        rho = start.density_at(int(valve["from_node"]))
        vanes, omega = float(start.schedule_value(valve["schedule"])), float(valve["drive"])
        floats, density_ratio = start.draft.tables.floats, rho / start.draft.fluid.density
        return -density_ratio * law.chart_torque(
            floats, int(valve["data"]), vanes, omega, float(valve["flow"]) / rho
        )


def folded_curve_notice(start, name: str, part, valve) -> list[Notice]:
    """Notice if a turbine with folded curves is between two nodes that are not junctions; as a list."""
    ends = (start.nodes["kind"][int(valve[key])] for key in ("from_node", "to_node"))
    if rec.JUNCTION in ends or not any(map(has_fold, part.hill_chart.curves)):
        return []
    cause = f"{part.from_} and {part.to} both set their own pressures"
    text = (
        f"{name}: its hill chart is folded, with several flows at one head, and {cause}: the turbine may jump "
        "between these flows; connect the turbine through a pipe or rigid-column"
    )
    return [Notice("range", f"links.{name}", text, "hill_chart")]


def unusual_inertia_notice(start, name: str, part, valve) -> list[Notice]:
    """Notice if the inertia of a turbine is far from the usual value for its power; as a list.

    The power is the greatest of the hill chart at the initial head.
    """
    speed = float(np.max(np.abs(part.speed.value)))
    ends = [int(valve["from_node"]), int(valve["to_node"])]
    if part.inertia is None or speed == 0.0 or start.weight == 0.0:
        return []
    high, low = start.nodes["pressure"][ends] / start.weight + start.nodes["elevation"][ends]
    unit = max(
        n * torque
        for curve in part.hill_chart.curves
        for n, torque in zip(curve.speed, curve.torques(start.weight), strict=True)
    )
    power = math.pi / 30.0 * unit * part.diameter**2 * max(high - low, 0.0) ** 1.5
    return unusual_inertia(start.case, name, part.inertia, power, speed) if power > 0.0 else []


def has_fold(curve) -> bool:
    """True if the unit speed, where it is positive, rises somewhere with the angle of the points of a curve."""
    points = list(zip(curve.speed, curve.flow, strict=True))
    rising = points[0][0] * points[1][1] > points[0][1] * points[1][0]
    ahead = points if rising else points[::-1]
    return any(n < m for (n, _), (m, _) in pairwise(ahead) if n > 0.0 and m > 0.0)
