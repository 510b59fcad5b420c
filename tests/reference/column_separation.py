"""Column separation at a wall: Joukowsky's vapour cavity in closed form.

A frictionless pipe of length L connects a reservoir at p0 with a wall. The fluid starts at p0 and flows away from the
wall at v0, so a cavity opens at the wall at once. Its rate of growth is v0 - (2 k - 1) D after k - 1 returns of the
wave. Each return lasts 2 L / a, and D = (p0 - pv) / (rho a). The cavity closes when the growths add up to zero.
"""

from __future__ import annotations

import math

import numpy as np

G = 9.80665


def cavity(v0: float, drop: float, rho: float, a: float, length: float) -> tuple[float, float, float]:
    """Duration [s], greatest length [m] and return velocity [m/s] of a cavity; drop = p0 - pv [Pa]."""
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
    """Rows of time [s], head [m] and cavity volume [m3] at a gate, by characteristics at Courant number 1.

    The gate between a lake and a pipe with friction shuts at once at `shut`; the pipe ends at another lake. `least` is
    the vapour head.
    """
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
            q[0] = (least - down[0]) / b  # flow from the cavity into the pipe
            hole = max(hole + step * q[0], 0.0)
            q[0] = q[0] if hole > 0.0 else 0.0
        head[0] = down[0] + b * q[0]
        rows.append((n * step, head[0], hole))
    return np.array(rows)
