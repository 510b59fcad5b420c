"""Method of characteristics with friction at Courant number 1, for the linear density law.

Along `dx/dt = +-a`, `d(P +- Z M)/dt = -+ a F(M)` with the friction gradient `F` [Pa/m]. The trapezoidal rule
integrates F and the new value is iterated, which gives second order. `richardson` extrapolates two solutions.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Array = np.ndarray
GRAVITY = 9.80665


def darcy(factor: float, diameter: float, density: float) -> Callable[[Array], Array]:
    """Pressure gradient of a Darcy factor, `f rho v |v| / (2 D)` [Pa/m], from the mass flow [kg/s]."""
    area = math.pi / 4 * diameter**2
    k = factor / (2 * diameter * density * area**2)
    return lambda m: k * np.abs(m) * m


def laminar(viscosity: float, diameter: float, density: float) -> Callable[[Array], Array]:
    """Pressure gradient of Poiseuille's law, `32 mu v / D^2` [Pa/m], from the mass flow [kg/s]."""
    area = math.pi / 4 * diameter**2
    k = 32 * viscosity / (diameter**2 * density * area)
    return lambda m: k * np.asarray(m)


def hazen_williams(coefficient: float, diameter: float, density: float) -> Callable[[Array], Array]:
    """Pressure gradient of `v = 0.849 C R^0.63 S^0.54` [Pa/m], from the mass flow [kg/s]."""
    area = math.pi / 4 * diameter**2
    scale = 0.849 * coefficient * (diameter / 4) ** 0.63 * density * area
    return lambda m: density * GRAVITY * np.sign(m) * (np.abs(m) / scale) ** (1 / 0.54)


@dataclass(frozen=True)
class ValvePipe:
    """Reservoir, pipe and valve to a fixed pressure; `flow_area` is Cd A [m2] as a function of time."""

    length: float
    diameter: float
    wave_speed: float
    density: float
    gradient: Callable[[Array], Array]
    upstream: float
    outside: float
    flow_area: Callable[[float], float]

    def steady_mass_flow(self) -> float:
        """Mass flow at the start [kg/s], by bisection on the balance of the drops."""
        low, high = 0.0, self.flow_area(-1.0) * math.sqrt(2 * self.density * (self.upstream - self.outside))
        for _ in range(200):
            m = (low + high) / 2
            at_valve = self.upstream - self.length * float(self.gradient(np.float64(m)))
            most = self.flow_area(-1.0) * math.sqrt(2 * self.density * max(at_valve - self.outside, 0.0))
            low, high = (m, high) if most > m else (low, m)
        return (low + high) / 2

    def valve_pressure(self, reaches: int, end: float) -> tuple[Array, Array]:
        """Times of the steps [s] and pressure before the valve at these times [Pa]."""
        z = self.wave_speed / (math.pi / 4 * self.diameter**2)
        dx = self.length / reaches
        dt, steps = dx / self.wave_speed, round(end * self.wave_speed / dx)
        m = np.full(reaches + 1, self.steady_mass_flow())
        p = self.upstream - self.gradient(m) * dx * np.arange(reaches + 1)
        m_new, p_new, found = m.copy(), p.copy(), np.empty(steps + 1)
        found[0] = p[-1]
        for n in range(1, steps + 1):
            force = self.gradient(m)
            plus = p[:-1] + z * m[:-1] - dx / 2 * force[:-1]  # arrives at points 1 ..
            minus = p[1:] - z * m[1:] + dx / 2 * force[1:]  # arrives at points 0 ..
            m_new[:] = m
            for _ in range(4):
                half = dx / 2 * self.gradient(m_new)
                m_new[1:-1] = (plus[:-1] - minus[1:] - 2 * half[1:-1]) / (2 * z)
                m_new[0] = (self.upstream - minus[0] - half[0]) / z
                m_new[-1], p_new[-1] = self._valve(plus[-1] - half[-1], z, n * dt)
            p_new[1:-1] = (plus[:-1] + minus[1:]) / 2
            p_new[0] = self.upstream
            m, m_new, p, p_new = m_new, m, p_new, p
            found[n] = p[-1]
        return dt * np.arange(steps + 1), found

    def _valve(self, incoming: float, z: float, t: float) -> tuple[float, float]:
        b = z * self.flow_area(t) * math.sqrt(2 * self.density)
        closed = incoming - self.outside
        root = (-b + math.sqrt(b * b + 4 * abs(closed))) / 2
        p = self.outside + math.copysign(root * root, closed)
        return (incoming - p) / z, p

    def richardson(self, reaches: int, end: float) -> tuple[Array, Array]:
        """Times and Richardson extrapolation from `reaches` and 2 `reaches`, at the steps of the coarser solution."""
        t, coarse = self.valve_pressure(reaches, end)
        _, fine = self.valve_pressure(2 * reaches, end)
        return t, (4 * fine[::2][: len(t)] - coarse) / 3
