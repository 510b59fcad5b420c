"""Exact Riemann problems of a pipe with liquid, free gas and vapour, by SciPy and independent of fvsolve.

rho_ref / rho = 1 - (p - p_ref) / beta + gas / (p - floor), A = A_ref (1 + compliance (p - p_ref)); m = rho A,
F = integral of A dp. Shocks obey Rankine-Hugoniot, [v]^2 = [F] [-1 / m]. Rarefactions are quadratures of dp / (rho c)
over ln(p - floor), in which the integrand is smooth although c decreases by orders of magnitude.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)


@dataclass(frozen=True)
class Mixture:
    density: float
    bulk_modulus: float
    pressure: float
    floor: float
    gas: float  # gas volume over liquid volume, times gas pressure [Pa]
    compliance: float = 0.0
    area: float = 1.0

    def swollen(self, p):
        return self.area * (1.0 + self.compliance * (p - self.pressure))

    def rho(self, p):
        return self.density / (
            1.0 - (p - self.pressure) / self.bulk_modulus + self.gas / (p - self.floor)
        )

    def m(self, p):
        return self.rho(p) * self.swollen(p)

    def force(self, p):
        over = p - self.pressure
        return self.area * (over + 0.5 * self.compliance * over**2)

    def c(self, p):
        """Wave speed sqrt(A dp / dm) [m/s]."""
        fall = (
            (1.0 / self.bulk_modulus + self.gas / (p - self.floor) ** 2)
            * self.rho(p)
            / self.density
        )
        return np.sqrt(1.0 / (self.rho(p) * (fall + self.compliance * self.area / self.swollen(p))))

    def void(self, p):
        """Volume fraction of the gas [-]."""
        return self.gas / (p - self.floor) * self.rho(p) / self.density

    def p(self, m: float) -> float:
        def gap(log_x: float) -> float:
            return self.m(self.floor + math.exp(log_x)) - m

        return self.floor + math.exp(
            brentq(gap, -60.0, math.log(0.5 * self.bulk_modulus), xtol=1e-13, rtol=1e-15)
        )

    def thinned(self, p_low: float, p_high: float) -> float:
        """Riemann integral of dp / (rho c) [m/s], over panels of width 1/8 in ln(p - floor)."""
        low, high = np.log(p_low - self.floor), np.log(p_high - self.floor)
        return float(np.sum(self.panels(np.linspace(low, high, 2 + int(8.0 * (high - low))))))

    def panels(self, edges: np.ndarray) -> np.ndarray:
        """Integrals of dp / (rho c) [m/s] between edges in ln(p - floor), with 20 Gauss points each."""
        half = 0.5 * np.diff(edges)
        x = np.exp(0.5 * (edges[1:] + edges[:-1])[:, None] + half[:, None] * NODES)
        p = self.floor + x
        return (x / (self.rho(p) * self.c(p))) @ WEIGHTS * half

    def behind(self, p: float, p_ahead: float) -> float:
        """Velocity of the fluid behind a wave to the right into fluid at rest, from pressure `p_ahead` to `p` [m/s]."""
        if p > p_ahead:
            thin = 1.0 / self.m(p_ahead) - 1.0 / self.m(p)
            return math.sqrt((self.force(p) - self.force(p_ahead)) * thin)
        return -self.thinned(p, p_ahead)


@dataclass(frozen=True)
class RiemannProblem:
    """Riemann problem of two uniform states that touch at x = 0 at t = 0."""

    law: Mixture
    left: tuple[float, float]  # pressure [Pa], velocity [m/s]
    right: tuple[float, float]

    def middle(self) -> tuple[float, float]:
        """Pressure [Pa] and velocity [m/s] between the two waves, by root finding in ln(p - floor)."""
        (pl, ul), (pr, ur) = self.left, self.right

        def gap(s: float) -> float:
            p = self.law.floor + math.exp(s)
            return (ul - self.law.behind(p, pl)) - (ur + self.law.behind(p, pr))

        s = brentq(gap, -25.0, math.log(0.3 * self.law.bulk_modulus), xtol=1e-13, rtol=1e-15)
        p = self.law.floor + math.exp(s)
        return p, ul - self.law.behind(p, pl)

    def solution(self):
        """Function of the ray x / t that returns (p, v), with tabulated fans."""
        p, u = self.middle()
        to_right = self._wave(self.right, p, u)
        to_left = self._wave((self.left[0], -self.left[1]), p, -u)

        def at(ray: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            q, v = to_right(ray)
            q_left, v_left = to_left(-ray)
            return np.where(ray < u, q_left, q), np.where(ray < u, -v_left, v)

        return at

    def _wave(self, ahead: tuple[float, float], p: float, u: float):
        law, (p0, u0) = self.law, ahead
        if p > p0:
            speed = (law.m(p) * u - law.m(p0) * u0) / (law.m(p) - law.m(p0))
            return lambda ray: (np.where(ray > speed, p0, p), np.where(ray > speed, u0, u))
        fan = law.floor + np.geomspace(p - law.floor, p0 - law.floor, 4000)
        parts = law.panels(np.log(fan - law.floor))
        v = u0 - np.append(np.cumsum(parts[::-1])[::-1], 0.0)
        rays = v + law.c(fan)

        def at(ray):
            return law.floor + np.exp(np.interp(ray, rays, np.log(fan - law.floor))), np.interp(
                ray, rays, v
            )

        return at
