"""Column separation: Joukowsky's vapour cavity in closed form, and cavities at nodes by characteristics.

A frictionless pipe of length L connects a reservoir at p0 with a wall. The fluid starts at p0 and flows away from the
wall at v0, so a cavity opens at the wall at once. Its rate of growth is v0 - (2 k - 1) D after k - 1 returns of the
wave. Each return lasts 2 L / a, and D = (p0 - pv) / (rho a). The cavity closes when the growths add up to zero.
The pipeline over a summit is that of Wylie and Streeter 1993, chapter 8.
"""

import math

import numpy as np
from CoolProp.CoolProp import PropsSI

G = 9.80665


def cavity(
    v0: float, drop: float, rho: float, a: float, length: float
) -> tuple[float, float, float]:
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


def behind_a_gate(
    lake: float,
    far: float,
    length: float,
    diameter: float,
    a: float,
    factor: float,
    loss: float,
    shut: float,
    least: float,
    reaches: int,
    end: float,
) -> np.ndarray:
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


# cases/summit-cavity.toml
GRAVITY, LENGTH, DIAMETER, SPEED, FACTOR = 9.80665, 6000.0, 0.4, 1000.0, 0.018
CHAINAGE, ELEVATION, SUMMIT = [0, 1500, 2500, 4000, 5200, 6000], [0, 22, 45, 12, 18, 30], 2500.0
# heads of a one-point pump [m]
SUMP, TOP, SHUT_OFF, CURVE = 2.0, 60.0, 4.0 / 3.0 * 77.0, 77.0 / 3.0 / 0.15**2


def line(reaches: int, end: float) -> tuple[np.ndarray, list[tuple[float, str, float]]]:
    """Rows of time [s], heads at the pumps and at the summit [m], volume of all cavities [m3]; and events.

    The second result lists events as (time [s], "parts" or "meets", chainage [m]).
    """
    step = LENGTH / reaches / SPEED
    x = np.linspace(0.0, LENGTH, reaches + 1)
    pressure = PropsSI("P", "T", 288.15, "Q", 0, "Water") - 101325.0
    vapor = np.interp(x, CHAINAGE, ELEVATION) + pressure / (
        PropsSI("D", "T", 288.15, "P", 101325, "Water") * GRAVITY
    )
    area = 0.25 * np.pi * DIAMETER**2
    b, r = (
        SPEED / (GRAVITY * area),
        FACTOR * LENGTH / reaches / (2.0 * GRAVITY * DIAMETER * area**2),
    )
    flow = np.sqrt((SUMP + SHUT_OFF - TOP) / (CURVE + r * reaches))
    head = SUMP + SHUT_OFF - CURVE * flow**2 - r * flow**2 * np.arange(reaches + 1)
    # inflow and outflow of a node
    left, right = np.full(reaches + 1, flow), np.full(reaches + 1, flow)
    volume, rows, events = np.zeros(reaches + 1), [], []
    inner, middle = slice(1, -1), round(SUMMIT / LENGTH * reaches)
    for k in range(1, round(end / step) + 1):
        up = head[:-1] + b * right[:-1] - r * right[:-1] * abs(right[:-1])  # C+, to the next node
        down = head[1:] - b * left[1:] + r * left[1:] * abs(left[1:])  # C-, to the previous node
        head = np.concatenate(([0.0], 0.5 * (up[:-1] + down[1:]), [TOP]))
        left, right = np.append(0.0, (up - head[1:]) / b), np.append((head[:-1] - down) / b, 0.0)
        apart = np.zeros(reaches + 1, bool)
        apart[inner] = (head[inner] < vapor[inner]) | (volume[inner] > 0.0)
        to, off = (np.append(0.0, up) - vapor) / b, (vapor - np.append(down, 0.0)) / b
        grown = np.where(apart, np.maximum(volume + step * (off - to), 0.0), 0.0)
        events += [
            (k * step, "parts", x[i]) for i in np.nonzero((grown > 0.0) & (volume == 0.0))[0]
        ]
        events += [
            (k * step, "meets", x[i]) for i in np.nonzero((grown == 0.0) & (volume > 0.0))[0]
        ]
        volume, open_ = grown, grown > 0.0
        head, left, right = (
            np.where(open_, vapor, head),
            np.where(open_, to, left),
            np.where(open_, off, right),
        )
        relative = np.clip(1.0 - (k * step - 2.0) / 20.0, 0.0, 1.0)
        push = SUMP + relative**2 * SHUT_OFF - down[0]
        # check valve
        right[0] = (np.sqrt(b * b + 4.0 * CURVE * push) - b) / (2.0 * CURVE) if push > 0.0 else 0.0
        head[0], left[-1] = down[0] + b * right[0], (up[-1] - TOP) / b
        rows.append((k * step, head[0], head[middle], volume.sum()))
    return np.array(rows), events
