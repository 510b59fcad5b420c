"""Pipeline over a summit with vapour cavities at its nodes, by characteristics (Wylie and Streeter 1993, chapter 8)."""

from __future__ import annotations

import numpy as np
from CoolProp.CoolProp import PropsSI

GRAVITY, LENGTH, DIAMETER, SPEED, FACTOR = 9.80665, 6000.0, 0.4, 1000.0, 0.018  # cases/summit-cavity.toml
CHAINAGE, ELEVATION, SUMMIT = [0, 1500, 2500, 4000, 5200, 6000], [0, 22, 45, 12, 18, 30], 2500.0
SUMP, TOP, SHUT_OFF, CURVE = 2.0, 60.0, 4.0 / 3.0 * 77.0, 77.0 / 3.0 / 0.15**2  # heads of a one-point pump [m]


def line(reaches: int, end: float) -> tuple[np.ndarray, list[tuple[float, str, float]]]:
    """Rows of time [s], heads at the pumps and at the summit [m], volume of all cavities [m3]; and events.

    The second result lists events as (time [s], "parts" or "meets", chainage [m]).
    """
    step = LENGTH / reaches / SPEED
    x = np.linspace(0.0, LENGTH, reaches + 1)
    pressure = PropsSI("P", "T", 288.15, "Q", 0, "Water") - 101325.0
    vapor = np.interp(x, CHAINAGE, ELEVATION) + pressure / (PropsSI("D", "T", 288.15, "P", 101325, "Water") * GRAVITY)
    area = 0.25 * np.pi * DIAMETER**2
    b, r = SPEED / (GRAVITY * area), FACTOR * LENGTH / reaches / (2.0 * GRAVITY * DIAMETER * area**2)
    flow = np.sqrt((SUMP + SHUT_OFF - TOP) / (CURVE + r * reaches))
    head = SUMP + SHUT_OFF - CURVE * flow**2 - r * flow**2 * np.arange(reaches + 1)
    left, right = np.full(reaches + 1, flow), np.full(reaches + 1, flow)  # inflow and outflow of a node
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
        events += [(k * step, "parts", x[i]) for i in np.nonzero((grown > 0.0) & (volume == 0.0))[0]]
        events += [(k * step, "meets", x[i]) for i in np.nonzero((grown == 0.0) & (volume > 0.0))[0]]
        volume, open_ = grown, grown > 0.0
        head, left, right = np.where(open_, vapor, head), np.where(open_, to, left), np.where(open_, off, right)
        relative = np.clip(1.0 - (k * step - 2.0) / 20.0, 0.0, 1.0)
        push = SUMP + relative**2 * SHUT_OFF - down[0]
        right[0] = (np.sqrt(b * b + 4.0 * CURVE * push) - b) / (2.0 * CURVE) if push > 0.0 else 0.0  # check valve
        head[0], left[-1] = down[0] + b * right[0], (up[-1] - TOP) / b
        rows.append((k * step, head[0], head[middle], volume.sum()))
    return np.array(rows), events
