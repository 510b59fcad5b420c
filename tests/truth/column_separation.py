"""A column of liquid that parts from a wall: Joukowsky's cavity at vapour pressure, in closed form.

A frictionless pipe of length L between a reservoir at p0 and a wall; all of it flows from the wall at v0 and at p0, so
a cavity opens at the wall at once. The column leaves it at v0 - (2 k - 1) D after k - 1 returns of the wave, each
2 L / a, D = (p0 - pv) / (rho a); it is back when these have added up to nothing.
"""

from __future__ import annotations


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
