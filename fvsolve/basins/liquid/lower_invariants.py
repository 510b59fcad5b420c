"""Riemann invariants of a liquid under the density law `table`, as tables for compiled functions.

The mass in a fixed volume changes by d ln rho = (1 / (rho a^2) + compliance) dp: speed of sound a of the fluid, and
compliance of elastic walls as in pipes [1/Pa].
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from fvsolve.basins.liquid.riemann_invariants import HEAD
from fvsolve.fluid.laws import TableLaw
from fvsolve.kernels import dtypes as rec

REFINEMENT = 4  # intervals of the kernels' tables per interval of the fluid
LEAST_INTERVALS = 512  # least number of intervals over the range of the fluid
MAX_STRETCH = 2.0  # greatest ln(rho / rho at rest) by compliant walls
PANELS = 8  # panels of the integral per interval of the fluid


class RiemannInvariants:
    """Invariant w = integral of c / rho d rho from rest at `pressure` [Pa], c^2 = dp / drho, and related quantities.

    The range of pressures is that of the fluid's table, extended by its length at both ends with constant
    compressibility. It ends earlier where the compliance of walls alone gives abs(ln(rho / rho at rest)) = MAX_STRETCH,
    because equal steps of density must resolve the neighbourhood of rest.

    wave_speed : wave speed at rest including walls [m/s], None for the speed of sound of the fluid
    density, speed : density [kg/m3] and wave speed [m/s] at rest; compliance : compliance of the walls [1/Pa]
    """

    def __init__(self, fluid, pressure: float, wave_speed: float | None = None) -> None:
        settings, floats = np.zeros(1, rec.SETTINGS), []
        TableLaw.lower(fluid, settings[0], floats)
        n, start, step = (settings[0][key] for key in ("table_size", "table_start", "table_step"))
        knots, value, slope = start + step * np.arange(n), np.array(floats[:n]), np.array(floats[n : 2 * n])
        extension, self.rest, self.interval_count = knots[-1] - knots[0], pressure, 3 * int(n - 1)
        self.ends = min(knots[0], pressure) - extension, max(knots[-1], pressure) + extension
        below, above = self.ends[0] - knots[0], self.ends[1] - knots[-1]
        self.strain = CubicHermiteSpline(  # ln(rho / rho_ref) of the fluid over pressure
            np.concatenate([self.ends[:1], knots, self.ends[1:]]),
            np.concatenate([[value[0] + slope[0] * below], value, [value[-1] + slope[-1] * above]]),
            np.concatenate([slope[:1], slope, slope[-1:]]),
        )
        self.compressibility = self.strain.derivative()
        own = float(self.compressibility(pressure))
        self.density = fluid.density * math.exp(self.strain(pressure))
        self.fluid_speed = 1.0 / math.sqrt(own * self.density)
        self.speed = wave_speed or self.fluid_speed
        compliance = 1.0 / (self.density * self.speed**2) - own
        self.compliance = compliance if compliance > 1e-9 * own else 0.0
        extension = MAX_STRETCH / self.compliance if self.compliance > 0.0 else math.inf
        self.ends = max(self.ends[0], pressure - extension), min(self.ends[1], pressure + extension)

    def stretch(self, p):
        """ln(rho / rho at rest) at a pressure p [Pa]."""
        return self.strain(p) - self.strain(self.rest) + self.compliance * (p - self.rest)

    def deviation(self, p):
        """Density at a pressure p [Pa] minus density at rest [kg/m3]."""
        return self.density * np.expm1(self.stretch(p))

    def impedance(self, p):
        """Density times wave speed [kg/(m2 s)] at a pressure p [Pa]."""
        return np.sqrt(self.density * np.exp(self.stretch(p)) / (self.compressibility(p) + self.compliance))

    def pressure(self, deviation: np.ndarray) -> np.ndarray:
        """Pressure [Pa] at deviations of density from rest [kg/m3], by Newton iteration."""
        target = np.log1p(deviation / self.density)
        p = np.interp(target, self.stretch(self.grid), self.grid)
        for _ in range(4):
            p = p - (self.stretch(p) - target) / (self.compressibility(p) + self.compliance)
        return p

    @cached_property
    def grid(self) -> np.ndarray:
        """Pressures [Pa] that divide the range into intervals of integration, including the pressure at rest."""
        return np.unique(np.append(np.linspace(*self.ends, PANELS * self.interval_count + 1), self.rest))

    @cached_property
    def invariant(self) -> CubicHermiteSpline:
        """Invariant w [m/s] as a function of pressure [Pa], integrated with six Gauss points per interval of `grid`."""
        nodes, weights = np.polynomial.legendre.leggauss(6)
        half = 0.5 * np.diff(self.grid)
        places = self.grid[:-1, None] + half[:, None] * (1.0 + nodes)
        w = np.append(0.0, np.cumsum(half * ((1.0 / self.impedance(places)) @ weights)))
        return CubicHermiteSpline(self.grid, w - w[self.grid == self.rest], 1.0 / self.impedance(self.grid))

    def pressure_of(self, w: np.ndarray) -> np.ndarray:
        """Pressure [Pa] at the invariant w [m/s], by Newton iteration."""
        p = np.interp(w, self.invariant(self.grid), self.grid)
        for _ in range(4):
            p = p - (self.invariant(p) - w) * self.impedance(p)
        return p

    def table(self) -> np.ndarray:
        """Table that `basins.liquid.riemann_invariants` reads : float64[:]."""
        per_r, first_r, r = self.places(self.deviation(np.array(self.ends)))
        per_w, first_w, w = self.places(self.invariant(np.array(self.ends)))
        p, q = self.pressure(r), self.pressure_of(w)
        density_of_r, density_of_w = self.density + r, self.density + self.deviation(q)
        of_r = cubics(self.invariant(p), self.impedance(p) / density_of_r**2 / per_r, first_r)
        of_w = [cubics(self.deviation(q), density_of_w**2 / self.impedance(q) / per_w, first_w),
                cubics(q - self.rest, self.impedance(q) / per_w, first_w)]  # fmt: skip
        head = [per_r, first_r, r.size - 2, HEAD, per_w, first_w, w.size - 2, HEAD + of_r.size]
        return np.concatenate([head, of_r.ravel(), np.hstack(of_w).ravel()])

    def places(self, ends) -> tuple[float, int, np.ndarray]:
        """Uniform grid of multiples of a step between two ends: (1 / step, number of the first multiple, grid points).

        The step is the distance of the ends over the number of intervals of the table.
        """
        step = (ends[1] - ends[0]) / max(REFINEMENT * self.interval_count, 3 * LEAST_INTERVALS)
        first = math.ceil(ends[0] / step)
        return 1.0 / step, first, step * np.arange(first, math.floor(ends[1] / step) + 1)


def cubics(value: np.ndarray, slope: np.ndarray, first: int) -> np.ndarray:
    """Coefficients of a cubic in s from 0 to 1 for each interval between n points : float64[n - 1, 4], constant first.

    value : values at the points; slope : slopes there, as change per interval
    In the first and the last interval the cubic is the tangent at the inner point.
    first : number of the first point (0 or negative); point 0 is at rest, and its value is set to exactly 0
    """
    value[-first] = 0.0
    (f, g), (d, e) = ((both[:-1], both[1:]) for both in (value, slope))
    coefficients = np.column_stack([f, d, 3.0 * (g - f) - 2.0 * d - e, 2.0 * (f - g) + d + e])
    coefficients[0], coefficients[-1] = (g[0] - e[0], e[0], 0.0, 0.0), (f[-1], d[-1], 0.0, 0.0)
    return coefficients
