"""Exact flow in a stiff pipe under the density law `p = p_ref + beta ln(rho / rho_ref)`.

`c = sqrt(beta / rho)`; `u - 2 c` is constant along `u + c`, and `u + 2 c` along `u - c`. Shocks obey
`(u_1 - u_2)^2 = (p_1 - p_2) (1/rho_2 - 1/rho_1)` (Rankine-Hugoniot for mass and momentum).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

Array = np.ndarray


@dataclass(frozen=True)
class LogFluid:
    density: float
    bulk_modulus: float
    pressure: float

    def rho(self, p):
        return self.density * np.exp((p - self.pressure) / self.bulk_modulus)

    def p(self, rho):
        return self.pressure + self.bulk_modulus * np.log(rho / self.density)

    def c(self, p):
        return np.sqrt(self.bulk_modulus / self.rho(p))

    def behind(self, p: float, p_ahead: float) -> float:
        """Velocity of the fluid behind a wave to the right into fluid at rest, from pressure `p_ahead` to `p` [m/s]."""
        if p > p_ahead:
            return math.sqrt((p - p_ahead) * (1 / self.rho(p_ahead) - 1 / self.rho(p)))
        return 2 * (self.c(p_ahead) - self.c(p))

    def shock_speed(self, p: float, p_ahead: float) -> float:
        """Speed of a shock to the right relative to the fluid ahead, `rho u / (rho - rho_ahead)` [m/s]."""
        return self.rho(p) * self.behind(p, p_ahead) / (self.rho(p) - self.rho(p_ahead))

    def stopped(self, p: float, u: float) -> float:
        """Pressure behind the shock that a wall reflects into a stream of velocity `u` [Pa]."""
        most = p + 10 * self.rho(p) * self.c(p) * abs(u) + 1.0
        return brentq(lambda q: self.behind(q, p) - u, p, most, xtol=1e-12 * most, rtol=1e-14)


@dataclass(frozen=True)
class Riemann:
    """Riemann problem of two uniform states that touch at x = 0 at t = 0."""

    fluid: LogFluid
    left: tuple[float, float]  # pressure [Pa], velocity [m/s]
    right: tuple[float, float]

    def middle(self) -> tuple[float, float]:
        """Pressure [Pa] and velocity [m/s] between the two waves."""
        (pl, ul), (pr, ur) = self.left, self.right

        def gap(p: float) -> float:
            return (ul - self.fluid.behind(p, pl)) - (ur + self.fluid.behind(p, pr))

        span = abs(pl - pr) + 10 * self.fluid.rho(pl) * self.fluid.c(pl) * abs(ul - ur) + 1.0
        p = brentq(gap, min(pl, pr) - span, max(pl, pr) + span, xtol=1e-9, rtol=1e-15)
        return p, ul - self.fluid.behind(p, pl)

    def at(self, xi: float) -> tuple[float, float]:
        """Pressure [Pa] and velocity [m/s] on the ray x / t = xi."""
        p, u = self.middle()
        if xi < u:  # mirrored, so that the wave always travels to the right
            q, v = self._wave(-self.left[1], self.left[0], -u, p, -xi)
            return q, -v
        return self._wave(self.right[1], self.right[0], u, p, xi)

    def _wave(self, u0: float, p0: float, u: float, p: float, xi: float) -> tuple[float, float]:
        if p > p0:
            return (p0, u0) if xi > u0 + self.fluid.shock_speed(p, p0) else (p, u)
        head, tail = u0 + self.fluid.c(p0), u + self.fluid.c(p)
        if xi >= head:
            return p0, u0
        if xi <= tail:
            return p, u
        c = (u0 + 2 * self.fluid.c(p0)) - xi  # u + 2c is uniform in the fan, and u + c = xi
        return float(self.fluid.p(self.fluid.bulk_modulus / c**2)), xi - c


@dataclass(frozen=True)
class SimpleWave:
    """Smooth wave to the right into fluid at rest: `u + 2 c` is uniform, and each value travels at `u + c`."""

    fluid: LogFluid
    ahead: float  # pressure of the fluid at rest ahead [Pa]
    velocity: Callable[[Array], Array]  # u(x) at t = 0
    slope: Callable[[Array], Array]  # derivative of the velocity

    def averages(self, edges: Array, t: float) -> tuple[Array, Array]:
        """Cell averages of density [kg/m3] and mass flux [kg/(m2 s)] at time t."""
        start = self._origin(edges, t)
        nodes, weights = np.polynomial.legendre.leggauss(12)
        half = np.diff(start)[:, None] / 2
        x = (start[:-1] + start[1:])[:, None] / 2 + half * nodes
        stretch = 1 + self.slope(x) * t / 2
        rho = self._rho(x)
        width = np.diff(edges)
        mean = [
            ((q * stretch) @ weights) * half[:, 0] / width for q in (rho, rho * self.velocity(x))
        ]
        return mean[0], mean[1]

    def breaks(self, x: Array) -> float:
        """Time at which the wave becomes a shock [s]."""
        return float(-2 / np.min(self.slope(x)))

    def _rho(self, x: Array) -> Array:
        c = float(self.fluid.c(self.ahead)) - self.velocity(x) / 2
        return self.fluid.bulk_modulus / c**2

    def _origin(self, x: Array, t: float) -> Array:
        c0 = float(self.fluid.c(self.ahead))
        start = x - c0 * t
        for _ in range(100):
            miss = start + (c0 + self.velocity(start) / 2) * t - x
            start = start - miss / (1 + self.slope(start) * t / 2)
            if np.max(np.abs(miss)) < 1e-14 * np.max(np.abs(x)):
                break
        return start
