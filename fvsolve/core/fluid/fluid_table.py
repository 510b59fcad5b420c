"""Density over pressure as a table, for cubic Hermite interpolation of its logarithm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

TARGET_ERROR = 1e-9  # relative density error at which refinement stops
MAX_ERROR = 1e-6  # relative density error above which a table is refused
INTERVALS = (32, 2048)  # least and greatest number of intervals


@dataclass(frozen=True, eq=False)
class FluidTable:
    """Density along the isentrope through the reference state, for cubic Hermite interpolation of ln rho.

    pressure        : float64[n]  absolute pressure [Pa], a uniform grid from the vapour pressure up
    log_density     : float64[n]  ln(rho / (1 kg/m3)) [-]
    compressibility : float64[n]  d ln rho / dp = 1 / (rho a^2) at constant entropy [1/Pa], a the speed of sound
    error           : greatest relative error of the density at the midpoints of the grid, against CoolProp [-]

    Outside the grid the compressibility keeps its end value, so that ln rho is extrapolated linearly. Below the vapour
    pressure CoolProp has no stable liquid.
    """

    pressure: np.ndarray
    log_density: np.ndarray
    compressibility: np.ndarray
    error: float

    def __post_init__(self) -> None:
        for name in ("pressure", "log_density", "compressibility"):
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, FluidTable):
            return NotImplemented
        return all(
            np.array_equal(a, b)
            for a, b in zip(vars(self).values(), vars(other).values(), strict=True)
        )

    def __hash__(self) -> int:
        return hash((self.error, self.pressure.size))

    def numbers(self, density: float, pressure: float) -> list[float]:
        """Values and slopes at the grid for kernels, in one list: ln(rho / density), its slope, enthalpy, its slope.

        Each has one number per grid pressure. Slopes are derivatives by pressure [1/Pa], [J/kg/Pa].
        The enthalpy [J/kg] is the integral of dp / rho from `pressure`.
        density : density [kg/m3] at the reference pressure `pressure` [Pa]
        """
        p, k = self.pressure, self.compressibility
        step = (p[-1] - p[0]) / (len(p) - 1)
        log_density = self.log_density - hermite_at(p, self.log_density, k, pressure)
        nodes, weights = np.polynomial.legendre.leggauss(6)
        h = np.zeros(len(p))
        for x, w in zip(nodes, weights, strict=True):
            at = p[:-1] + 0.5 * (1.0 + x) * step
            h[1:] += 0.5 * w * step / (density * np.exp(hermite_at(p, log_density, k, at)))
        h = np.cumsum(h)
        slope = 1.0 / (density * np.exp(log_density))
        h -= hermite_at(p, h, slope, pressure)
        return [*log_density, *k, *h, *slope]


def hermite_at(grid, values, slopes, at):
    """Cubic Hermite interpolant at the abscissas `at`, from values and slopes (derivatives) on a uniform grid."""
    step = grid[1] - grid[0]
    k = np.clip(
        ((at - grid[0]) / step).astype(int)
        if hasattr(at, "astype")
        else int((at - grid[0]) / step),
        0,
        len(grid) - 2,
    )
    s = (at - grid[k]) / step
    r = 1.0 - s
    rise = values[k + 1] - values[k]
    return (
        values[k] + s * s * (3 - 2 * s) * rise + s * r * step * (r * slopes[k] - s * slopes[k + 1])
    )


def refined_table(
    sample: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], span: tuple[float, float]
) -> FluidTable:
    """Table of a density over pressure, with intervals that are halved until its error is small enough.

    The number of intervals starts at INTERVALS[0]. It is doubled until the error at midpoints is at most
    `TARGET_ERROR`, or until it is INTERVALS[1].
    sample : pressures [Pa] : float64[n] -> (ln rho, d ln rho / dp [1/Pa]) : two float64[n]
    span : least and greatest pressure [Pa]
    """
    intervals, most = INTERVALS
    table = _tabulate(sample, span, intervals)
    while table.error > TARGET_ERROR and intervals < most:
        intervals *= 2
        table = _tabulate(sample, span, intervals)
    return table


def _tabulate(
    sample: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    span: tuple[float, float],
    intervals: int,
) -> FluidTable:
    grid = np.linspace(*span, 2 * intervals + 1)
    log_density, compressibility = sample(grid)
    f, d = log_density[::2], compressibility[::2]
    middle = 0.5 * (f[:-1] + f[1:]) + (grid[2] - grid[0]) / 8.0 * (d[:-1] - d[1:])
    error = float(np.max(np.abs(np.expm1(middle - log_density[1::2]))))
    return FluidTable(np.linspace(*span, intervals + 1), f, d, error)


def is_monotone(table: FluidTable) -> bool:
    """True if all slopes are 0 to 3 times those of adjacent chords, so that the cubics rise (Fritsch, Carlson 1980)."""
    chord = np.diff(table.log_density) / np.diff(table.pressure)
    slopes = np.concatenate([table.compressibility[:-1] / chord, table.compressibility[1:] / chord])
    return bool(np.all(chord > 0.0) and np.all(slopes >= 0.0) and np.all(slopes <= 3.0))
