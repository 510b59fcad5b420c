"""A column of liquid that parts from a wall: Joukowsky's cavity at vapour pressure, in closed form.

A frictionless pipe of length L between a reservoir at p0 and a wall; all of it flows from the wall at v0 and at p0, so
a cavity opens at the wall at once. The column leaves it at v0 - (2 k - 1) D after k - 1 returns of the wave, each
2 L / a, D = (p0 - pv) / (rho a); it is back when these have added up to nothing.
"""

from __future__ import annotations

import math

import numpy as np

G = 9.80665


def cavity(v0: float, drop: float, rho: float, a: float, length: float) -> tuple[float, float, float]:
    """(duration [s], greatest length [m], velocity of the return [m/s]) of a cavity; drop = p0 - pv [Pa]."""
    step, turn = drop / (rho * a), 2.0 * length / a
    size, greatest, k = 0.0, 0.0, 1
    while True:
        v = v0 - (2 * k - 1) * step
        if size + v * turn <= 0.0:
            return (k - 1) * turn - size / v, greatest, -v
        size += v * turn
        greatest = max(greatest, size)
        k += 1


def behind_a_gate(lake: float, far: float, length: float, diameter: float, a: float, factor: float, loss: float,
                  shut: float, least: float, reaches: int, end: float) -> np.ndarray:  # fmt: skip
    """Rows of time, head at the gate [m] and cavity there [m3], by characteristics at Courant 1: a lake, a gate that
    shuts at once, a pipe with friction, another lake; `least` is the head of vapour."""
    area, step = 0.25 * math.pi * diameter**2, length / reaches / a
    b, r = a / (G * area), factor * length / reaches / (2.0 * G * diameter * area**2)
    k = loss / (2.0 * G * area**2)
    flow = math.sqrt((lake - far) / (k + r * reaches))
    head = lake - k * flow**2 - r * flow**2 * np.arange(reaches + 1)
    q, hole, rows = np.full(reaches + 1, flow), 0.0, []
    for n in range(1, round(end / step) + 1):
        up = head[:-1] + b * q[:-1] - r * q[:-1] * abs(q[:-1])
        down = head[1:] - b * q[1:] + r * q[1:] * abs(q[1:])
        head, q = np.append(0.0, up), np.append(0.0, 0.0 * up)
        head[1:-1], head[-1] = 0.5 * (up[:-1] + down[1:]), far
        q[1:] = (up - head[1:]) / b
        if n * step <= shut:
            q[0] = (math.sqrt(b * b + 4.0 * k * (lake - down[0])) - b) / (2.0 * k)
        elif hole > 0.0 or down[0] < least:
            q[0] = (least - down[0]) / b  # the flow that leaves the cavity
            hole = max(hole + step * q[0], 0.0)
            q[0] = q[0] if hole > 0.0 else 0.0
        head[0] = down[0] + b * q[0]
        rows.append((n * step, head[0], hole))
    return np.array(rows)
