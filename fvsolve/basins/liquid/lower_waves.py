"""Riemann invariants of a liquid under law `table`, for kernels. Knows a fluid; knows no basin.

What a fixed volume holds grows by d ln rho = (1 / (rho a^2) + compliance) dp, walls that swell as in pipes.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from fvsolve.basins.liquid.waves import HEAD
from fvsolve.fluid.laws import TableLaw
from fvsolve.kernels import records as rec

FINER, LEAST = 4, 512  # intervals of the kernels' tables for each of the fluid's, and at least for all of these
STRETCH = 2.0  # of ln(rho / rho at rest)
PANELS = 8  # of the integral, for each of the fluid's


class Waves:
    """w = integral of c / rho, c^2 = dp / drho, from rest at a pressure, and what hangs on it.

    It goes as far as the fluid's table and by its length beyond both ends, where compressibility stays, but no farther
    than to where walls give by STRETCH: even steps of density must know those about rest.
    density [kg/m3], speed [m/s] : at rest; compliance : what makes the speed `wave_speed` [1/Pa]
    """

    def __init__(self, fluid, pressure: float, wave_speed: float | None = None) -> None:
        settings, floats = np.zeros(1, rec.SETTINGS), []
        TableLaw.lower(fluid, settings[0], floats)
        n, start, step = (settings[0][key] for key in ("table_size", "table_start", "table_step"))
        knots, value, slope = start + step * np.arange(n), np.array(floats[:n]), np.array(floats[n : 2 * n])
        far, self.rest, self.many = knots[-1] - knots[0], pressure, 3 * int(n - 1)
        self.ends = min(knots[0], pressure) - far, max(knots[-1], pressure) + far
        below, above = self.ends[0] - knots[0], self.ends[1] - knots[-1]
        self.strain = CubicHermiteSpline(  # ln(rho / rho_ref) of the fluid
            np.concatenate([self.ends[:1], knots, self.ends[1:]]),
            np.concatenate([[value[0] + slope[0] * below], value, [value[-1] + slope[-1] * above]]),
            np.concatenate([slope[:1], slope, slope[-1:]]),
        )
        self.softness = self.strain.derivative()
        own = float(self.softness(pressure))
        self.density = fluid.density * math.exp(self.strain(pressure))
        self.own_speed = 1.0 / math.sqrt(own * self.density)
        self.speed = wave_speed or self.own_speed
        found = 1.0 / (self.density * self.speed**2) - own
        self.compliance = found if found > 1e-9 * own else 0.0
        far = STRETCH / self.compliance if self.compliance > 0.0 else math.inf
        self.ends = max(self.ends[0], pressure - far), min(self.ends[1], pressure + far)

    def stretch(self, p):
        """ln(rho / rho at rest)."""
        return self.strain(p) - self.strain(self.rest) + self.compliance * (p - self.rest)

    def deviation(self, p):
        """Density over that at rest [kg/m3]."""
        return self.density * np.expm1(self.stretch(p))

    def impedance(self, p):
        """rho c [kg/(m2 s)]."""
        return np.sqrt(self.density * np.exp(self.stretch(p)) / (self.softness(p) + self.compliance))

    def pressure(self, deviation: np.ndarray) -> np.ndarray:
        """Pressure [Pa] at deviations of the density, by Newton."""
        wanted = np.log1p(deviation / self.density)
        p = np.interp(wanted, self.stretch(self.grid), self.grid)
        for _ in range(4):
            p = p - (self.stretch(p) - wanted) / (self.softness(p) + self.compliance)
        return p

    @cached_property
    def grid(self) -> np.ndarray:
        """Ends of the panels that the invariant is integrated over [Pa]."""
        return np.unique(np.append(np.linspace(*self.ends, PANELS * self.many + 1), self.rest))

    @cached_property
    def invariant(self) -> CubicHermiteSpline:
        """w of the pressure [m/s], each panel by six Gauss points."""
        nodes, weights = np.polynomial.legendre.leggauss(6)
        half = 0.5 * np.diff(self.grid)
        places = self.grid[:-1, None] + half[:, None] * (1.0 + nodes)
        w = np.append(0.0, np.cumsum(half * ((1.0 / self.impedance(places)) @ weights)))
        return CubicHermiteSpline(self.grid, w - w[self.grid == self.rest], 1.0 / self.impedance(self.grid))

    def pressure_of(self, w: np.ndarray) -> np.ndarray:
        """Pressure [Pa] where the invariant is w, by Newton."""
        p = np.interp(w, self.invariant(self.grid), self.grid)
        for _ in range(4):
            p = p - (self.invariant(p) - w) * self.impedance(p)
        return p

    def table(self) -> np.ndarray:
        """What `basins.liquid.waves` reads : float64[...]."""
        per_r, first_r, r = self.places(self.deviation(np.array(self.ends)))
        per_w, first_w, w = self.places(self.invariant(np.array(self.ends)))
        p, q = self.pressure(r), self.pressure_of(w)
        dense, held = self.density + r, self.density + self.deviation(q)
        of_r = cubics(self.invariant(p), self.impedance(p) / dense**2 / per_r, first_r)
        of_w = [cubics(self.deviation(q), held**2 / self.impedance(q) / per_w, first_w),
                cubics(q - self.rest, self.impedance(q) / per_w, first_w)]  # fmt: skip
        head = [per_r, first_r, r.size - 2, HEAD, per_w, first_w, w.size - 2, HEAD + of_r.size]
        return np.concatenate([head, of_r.ravel(), np.hstack(of_w).ravel()])

    def places(self, ends) -> tuple[float, int, np.ndarray]:
        """(1 / step, number of the first, places between two ends in even steps counted from 0)."""
        step = (ends[1] - ends[0]) / max(FINER * self.many, 3 * LEAST)
        first = math.ceil(ends[0] / step)
        return 1.0 / step, first, step * np.arange(first, math.floor(ends[1] / step) + 1)


def cubics(value: np.ndarray, slope: np.ndarray, first: int) -> np.ndarray:
    """Coefficients of s in [0, 1] between values, slopes per interval; straight at both ends : float64[n - 1, 4]."""
    value[-first] = 0.0
    (f, g), (d, e) = ((both[:-1], both[1:]) for both in (value, slope))
    found = np.column_stack([f, d, 3.0 * (g - f) - 2.0 * d - e, 2.0 * (f - g) + d + e])
    found[0], found[-1] = (g[0] - e[0], e[0], 0.0, 0.0), (f[-1], d[-1], 0.0, 0.0)
    return found
