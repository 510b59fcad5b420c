"""Integrals over intervals, quadrilaterals and their sides, and derivatives by differences, for (71) to (76)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(24)
STEP = 1e-3


def rate(of: Callable[[float], np.ndarray], t: float) -> np.ndarray:
    """Derivative by central differences of sixth order."""
    sides = [of(t + k * STEP) - of(t - k * STEP) for k in (1, 2, 3)]
    return (45 * sides[0] - 9 * sides[1] + sides[2]) / (60 * STEP)


def on_interval(of: Callable, a: float, b: float) -> float:
    """Integral of a function of x."""
    x = 0.5 * (b - a) * POINTS + 0.5 * (a + b)
    return 0.5 * (b - a) * float(np.sum(WEIGHTS * of(x)))


def inside(of: Callable, corners: np.ndarray) -> float:
    """Integral of a function of x and y over a quadrilateral; corners : float64[4, 2], counter-clockwise."""
    s, t = np.meshgrid(POINTS, POINTS, indexing="ij")
    shape = np.array([(1 - s) * (1 - t), (1 + s) * (1 - t), (1 + s) * (1 + t), (1 - s) * (1 + t)]) / 4
    along_s = np.array([-(1 - t), 1 - t, 1 + t, -(1 + t)]) / 4
    along_t = np.array([-(1 - s), -(1 + s), 1 + s, 1 - s]) / 4
    x, y = (np.tensordot(corners[:, k], shape, 1) for k in (0, 1))
    xs, ys, xt, yt = (np.tensordot(corners[:, k], slope, 1) for slope in (along_s, along_t) for k in (0, 1))
    return float(np.sum(np.outer(WEIGHTS, WEIGHTS) * (xs * yt - xt * ys) * of(x, y)))


def around(of: Callable, corners: np.ndarray, speeds: np.ndarray | None = None) -> float:
    """Integral of (phi v) . n over the sides of a quadrilateral.

    of(x, y) : phi v as float64[2, ...], or phi if `speeds` gives the velocities of the corners
    """
    total = 0.0
    for k in range(4):
        start, end = corners[k], corners[(k + 1) % 4]
        share = 0.5 * (POINTS + 1)
        x, y = (start[i] + share * (end[i] - start[i]) for i in (0, 1))
        normal = np.array([end[1] - start[1], start[0] - end[0]])  # outward normal with the length of the side
        carried = of(x, y)
        if speeds is not None:
            carried = carried * (np.outer(speeds[k], 1 - share) + np.outer(speeds[(k + 1) % 4], share))
        total += 0.5 * float(np.sum(WEIGHTS * (normal @ carried)))
    return total
