"""Exact flow of a liquid along an isentrope of CoolProp, `dp / drho = a^2`.

In rarefactions `u` changes by the integral of `dp / (rho a)`.
Shocks obey `(u_1 - u_2)^2 = (p_1 - p_2) (1/rho_2 - 1/rho_1)`.
"""

import math
from dataclasses import dataclass

import numpy as np
from CoolProp import AbstractState, CoolProp
from numpy.polynomial import Chebyshev
from scipy.optimize import brentq


class Isentrope:
    """Isentrope of the liquid `name` between two pressures [Pa], by Chebyshev polynomials of degree 80."""

    def __init__(
        self, name: str, temperature: float, pressure: float, low: float, high: float
    ) -> None:
        state = AbstractState("HEOS", name)
        state.update(CoolProp.PT_INPUTS, pressure, temperature)
        entropy, self.low, self.high = state.smass(), low, high

        def at(p: float) -> tuple[float, float]:
            state.update(CoolProp.PSmass_INPUTS, p, entropy)
            return state.rhomass(), state.speed_sound()

        def fitted(values) -> Chebyshev:
            return Chebyshev.interpolate(
                lambda p: np.array([values(*at(q)) for q in p]), 80, (low, high)
            )

        self.rho, self.c = fitted(lambda rho, c: rho), fitted(lambda rho, c: c)
        self.w = fitted(lambda rho, c: 1.0 / (rho * c)).integ()

    def p(self, rho: float) -> float:
        return brentq(lambda p: self.rho(p) - rho, self.low, self.high, xtol=1e-6, rtol=1e-15)

    def behind(self, p: float, p_ahead: float) -> float:
        """Velocity of the fluid behind a wave to the right into fluid at rest, from pressure `p_ahead` to `p` [m/s]."""
        if p > p_ahead:
            return math.sqrt((p - p_ahead) * (1 / self.rho(p_ahead) - 1 / self.rho(p)))
        return self.w(p) - self.w(p_ahead)


@dataclass(frozen=True)
class Riemann:
    """Riemann problem of two uniform states that touch at x = 0 at t = 0."""

    fluid: Isentrope
    left: tuple[float, float]  # pressure [Pa], velocity [m/s]
    right: tuple[float, float]

    def middle(self) -> tuple[float, float]:
        """Pressure [Pa] and velocity [m/s] between the two waves."""
        f, (pl, ul), (pr, ur) = self.fluid, self.left, self.right
        p = brentq(
            lambda p: ul - ur - f.behind(p, pl) - f.behind(p, pr),
            f.low,
            f.high,
            xtol=1e-6,
            rtol=1e-15,
        )
        return p, ul - f.behind(p, pl)

    def at(self, rays: np.ndarray) -> np.ndarray:
        """Density [kg/m3] and mass flow density [kg/(m2 s)] on rays x / t : float64[2, n]."""
        p, u = self.middle()
        found = [
            self._wave(*self.right, p, u, ray, 1.0)
            if ray > u
            else self._wave(*self.left, p, u, ray, -1.0)
            for ray in rays
        ]
        rho = self.fluid.rho(np.array(found)[:, 0])
        return np.array([rho, rho * np.array(found)[:, 1]])

    def _wave(self, p0, u0, p, u, ray, way) -> tuple[float, float]:
        """Pressure and velocity on a ray on the side of the right wave (way 1) or of the left wave (way -1)."""
        f = self.fluid
        if p > p0:
            speed = f.rho(p) * f.behind(p, p0) / (f.rho(p) - f.rho(p0))
            return (p0, u0) if way * (ray - u0) > speed else (p, u)
        if way * (ray - u0) >= f.c(p0):
            return p0, u0
        if way * (ray - u) <= f.c(p):
            return p, u

        def velocity(q: float) -> float:
            return u0 + way * (f.w(q) - f.w(p0))

        q = brentq(lambda q: way * (ray - velocity(q)) - f.c(q), p, p0, xtol=1e-6, rtol=1e-15)
        return q, velocity(q)
