"""Hill charts as the numbers that kernels read: rays about the origin of n11 and Q11. Knows one chart; evaluates none.

n = omega / speed and u = flow / capacity, both over the square root of 1 m, `capacity` the greatest flow of a curve.
"""

from __future__ import annotations

import math

import numpy as np

from fvsolve.parts.turbine import law_chart as law

MERGED = 1e-7  # angle between rays that are one [rad]
SPACING = math.pi / 24.0  # of rays where the chart says nothing and a turning runner drives flow back
PUMPED = 2.0  # shaft power there over that of the flow
STEEPEST = 10.0  # flow over speed up to which it rises; beyond there is no head
STANDING, BACKWARD = 0.5 * math.pi, math.pi  # angles


def chart_numbers(part, weight: float) -> list[float]:
    """Numbers of a chart in the order that `law_chart` states; weight = rho g [N/m3]."""
    chart, d = part.hill_chart, part.diameter
    speed = max(abs(n) for one in chart.curves for n in one.speed) * math.pi / 30.0 / d
    flow = max(q for one in chart.curves for q in one.flow) * d * d
    drawn = weight * flow / speed
    curves = [nodes_of(one, part, speed, flow, drawn, weight) for one in chart.curves]
    rays = merged(np.concatenate([angles for _, angles, *_ in curves]))
    at = np.column_stack([np.cos(rays), np.sin(rays)])
    tables = [along(at, rays, *one[1:5]) for one in curves]
    still = 0.0
    if chart.still is not None:
        n11, t11 = chart.still
        still = t11 * d**3 / (n11 * math.pi / 30.0 / d) ** 2
    found = [len(curves), len(rays), speed, flow, still]
    found += [one.opening for one in chart.curves] + [one[0] for one in curves]
    found += [one[5][0] for one in curves] + [one[5][1] for one in curves]
    found += [*rays, *at[:, 0], *at[:, 1], *np.concatenate([root for root, _ in tables])]
    found += [*np.concatenate([torque for _, torque in tables])]
    return [float(one) for one in found]


def nodes_of(one, part, speed: float, flow: float, drawn: float, weight: float):
    """(capacity, angles, directions, roots of head, torques over the head, (least, greatest) angle given) of one curve.

    A ray's root of head is 1 over how far along it the curve lies; flow at rest both ways has what is given nearest
    to rest or the greatest of the curve, a runner that turns backwards no head, and no flow passes at the distance of
    the last point.
    """
    d = part.diameter
    capacity = max(one.flow) * d * d / flow
    n = np.array(one.speed) * math.pi / 30.0 / d / speed
    u = np.array(one.flow) * d * d / flow / capacity
    torque = np.array(one.torques(weight)) * d**3
    angle = np.unwrap(np.arctan2(u, n))
    if angle[-1] < angle[0]:
        n, u, torque, angle = n[::-1], u[::-1], torque[::-1], angle[::-1]
    angle = angle - 2.0 * math.pi * math.floor((angle[0] + STANDING) / (2.0 * math.pi))
    far = np.hypot(n, u)
    nodes = list(zip(angle, 1.0 / far, torque, strict=True))
    nodes = before(nodes[0], n[0], u[0], torque[0], drawn * capacity) + nodes
    nodes += behind(nodes[-1], n[-1], u[-1], torque[-1], drawn * capacity)
    angles, roots, torques = (np.array(column) for column in zip(*nodes, strict=True))
    return capacity, angles, np.column_stack([np.cos(angles), np.sin(angles)]), roots, torques, (angle[0], angle[-1])


def before(first, n: float, u: float, torque: float, drawn: float) -> list:
    """Nodes below the first of a curve, towards flow backwards at rest."""
    angle, root, _ = first
    found = []
    if angle > 0.0:
        braked = min(torque, 0.0) - max(torque, 0.0) * (1.0 / root - n) / n
        found = [(0.0, root, braked)]
        angle, torque = 0.0, braked
    return pumping(angle, root, torque, drawn, -1.0)[::-1] + found


def behind(last, n: float, u: float, torque: float, drawn: float) -> list:
    """Nodes above the last of a curve, towards flow backwards at rest."""
    angle, root, _ = last
    found = []
    if angle < STANDING:
        found.append((STANDING, 1.0 / u, 2.0 * max(torque, 0.0)))
    if angle < BACKWARD:
        return [*found, (BACKWARD, 0.0, 0.0), *pumping(0.0, 0.0, 0.0, drawn, 1.0)]
    return pumping(angle - BACKWARD, root, torque, drawn, 1.0)


def pumping(angle: float, root: float, torque: float, drawn: float, way: float) -> list:
    """Nodes from a ray on which a turning runner has a head to flow backwards at rest, whose root is -1.

    way : -1 of one that turns forward, 1 backward. The shaft brings PUMPED times what the flow takes up, and what it
    brought at the ray.
    """
    tilt = -angle if way < 0.0 else angle
    many = max(2, math.ceil((STANDING - tilt) / SPACING))
    taken = abs(torque) - PUMPED * drawn * math.tan(tilt)
    found = []
    for one in np.linspace(tilt, STANDING, many + 1)[1:]:
        share = min(math.tan(one), STEEPEST)
        found.append((one, straight(tilt, root, one), way * (PUMPED * drawn * share + max(taken, 0.0))))
    return [(-one if way < 0.0 else BACKWARD + one, value, brought) for one, value, brought in found]


def straight(tilt: float, root: float, one: float) -> float:
    """Root at an angle below the axis of turning, on the line from one at `tilt` to -1 at rest."""
    share = math.cos(one) / math.cos(tilt)
    return share * root - (math.sin(one) - share * math.sin(tilt))


def merged(angles: np.ndarray) -> np.ndarray:
    """Rising angles from flow backwards at rest round to it, near ones as one."""
    inner = np.sort(angles[(angles > -STANDING + MERGED) & (angles < 3.0 * STANDING - MERGED)])
    kept = inner[np.concatenate([[True], np.diff(inner) > MERGED])]
    return np.concatenate([[-STANDING], kept, [3.0 * STANDING]])


def along(at: np.ndarray, rays: np.ndarray, angles, directions, roots, torques) -> tuple[np.ndarray, np.ndarray]:
    """(roots, torques over the head) of a curve at rays, on the straight lines between its own."""
    i = np.clip(np.searchsorted(angles, rays) - 1, 0, len(angles) - 2)
    (a, b), (c, d), (x, y) = directions[i].T, directions[i + 1].T, at.T
    one, two = (x * d - y * c) / (a * d - b * c), (a * y - b * x) / (a * d - b * c)
    heavy = one * np.maximum(roots[i], law.LEAST_ROOT), two * np.maximum(roots[i + 1], law.LEAST_ROOT)
    root = one * roots[i] + two * roots[i + 1]
    torque = (heavy[0] * torques[i] + heavy[1] * torques[i + 1]) / (heavy[0] + heavy[1])
    own = np.abs(rays[:, None] - angles).argmin(axis=1)
    mine = np.abs(rays - angles[own]) <= MERGED
    return np.where(mine, roots[own], root), np.where(mine, torques[own], torque)
