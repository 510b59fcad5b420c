"""Circular sections, gradually varied flow and Riemann problems of partly full pipes, by quadrature and ODE solvers."""

from math import acos, pi, sin, sqrt

import numpy as np
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

G = 9.80665


def half_angle(h: float, d: float) -> float:
    """Half angle of the wetted arc."""
    return acos(1.0 - 2.0 * h / d)


def area(h: float, d: float) -> float:
    t = half_angle(h, d)
    return 0.25 * d * d * (t - 0.5 * sin(2.0 * t))


def width(h: float, d: float) -> float:
    return d * sin(half_angle(h, d))


def thrust(h: float, d: float) -> float:
    """g times the integral of the area over the depth [m4/s2]."""
    return G * quad(area, 0.0, h, args=(d,), epsabs=1e-14)[0]


def celerity(h: float, d: float) -> float:
    return sqrt(G * area(h, d) / width(h, d))


def slope_of_friction(q: float, n: float, h: float, d: float) -> float:
    """Slope of the energy line by Manning."""
    a = area(h, d)
    radius = a / (half_angle(h, d) * d)
    return n * n * q * abs(q) / (a * a * radius ** (4.0 / 3.0))


def uniform_depth(q: float, n: float, slope: float, d: float) -> float:
    """Depth of uniform flow by Manning, below 0.9 of the diameter."""
    return brentq(lambda h: slope_of_friction(q, n, h, d) - slope, 1e-6 * d, 0.9 * d, xtol=1e-14)


def backwater(
    q: float, n: float, slope: float, d: float, end: float, x: np.ndarray, loss: float = 0.0
) -> np.ndarray:
    """Depths at distances x upstream of a place with the depth `end`, by gradually varied flow.

    loss : coefficient of minor losses over the length [1/m], of q^2 / (2 g A^2)
    """

    def rise(_, h):
        froude = q * q * width(h[0], d) / (G * area(h[0], d) ** 3)
        friction = slope_of_friction(q, n, h[0], d) + loss * q * q / (2.0 * G * area(h[0], d) ** 2)
        return [-(slope - friction) / (1.0 - froude)]

    found = solve_ivp(rise, (0.0, x.max()), [end], rtol=1e-11, atol=1e-13, dense_output=True)
    return found.sol(x)[0]


def bore(h: float, q: float, d: float, a: float) -> tuple[float, float]:
    """(head behind the bore, its speed) after a flow q of depth h is shut; slot of celerity a from the crown."""
    full, before = 0.25 * pi * d * d, area(h, d)
    slot = G * full / a**2
    crown, low = thrust(d, d), thrust(h, d)

    def momentum(behind):
        above = (behind - full) / slot
        return (
            crown
            + G * above * (full + 0.5 * slot * above)
            - low
            - q * q / before
            - q * q / (behind - before)
        )

    behind = brentq(momentum, full * (1.0 + 1e-9), 2.0 * full, xtol=1e-15)
    return d + (behind - full) / slot, q / (behind - before)


def riemann(h: float, d: float) -> float:
    """Integral of sqrt(g T / A) over the depth w^2; its lowest part with T / A = 1.5 / h (1 - h / 5 d)."""
    rate = lambda w: 2.0 * w * sqrt(G * width(w * w, d) / area(w * w, d))  # noqa: E731
    low = 1e-2 * sqrt(d)
    lowest = 2.0 * sqrt(1.5 * G) * low * (1.0 - low * low / (30.0 * d))
    return lowest + quad(rate, low, sqrt(h), epsabs=1e-12, epsrel=1e-12)[0]


class DamBreak:
    """Exact solution of a dam break in a pipe: still water of depth `left` over still water of depth `right`."""

    def __init__(self, left: float, right: float, d: float) -> None:
        self.left, self.right, self.d = left, right, d

        def by_rarefaction(h):
            return riemann(left, d) - riemann(h, d)

        def by_bore(h):
            a, b = area(h, d), area(right, d)
            return sqrt((thrust(h, d) - thrust(right, d)) * (a - b) / (a * b))

        self.h = brentq(lambda h: by_rarefaction(h) - by_bore(h), right * 1.0001, left, xtol=1e-14)
        self.u = by_rarefaction(self.h)
        self.speed = area(self.h, d) * self.u / (area(self.h, d) - area(right, d))

    def depth(self, s: float) -> float:
        """Depth at the speed s = x / t."""
        if s >= self.speed:
            return self.right
        if s >= self.u - celerity(self.h, self.d):
            return self.h
        if s <= -celerity(self.left, self.d):
            return self.left
        total = riemann(self.left, self.d)
        return brentq(
            lambda h: total - riemann(h, self.d) - celerity(h, self.d) - s,
            self.h,
            self.left,
            xtol=1e-12,
        )
