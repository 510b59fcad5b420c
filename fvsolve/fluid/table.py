"""Density along an isentrope, as a table. Knows CoolProp's state object; knows nothing of the cache."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fvsolve.errors import FluidError

REACH = 1e8  # a table goes up to this pressure [Pa], or to twice the reference pressure where that is more
AIM = 1e-9  # relative density error at which a table is fine enough
WORST = 1e-6  # ... and above which it is refused
INTERVALS = (32, 2048)  # least and most


@dataclass(frozen=True, eq=False)
class FluidTable:
    """Density along the isentrope through the reference state, for cubic Hermite interpolation of ln rho.

    pressure        : float64[n]  uniform grid from the vapour pressure up, absolute  [Pa]
    log_density     : float64[n]  ln(rho / (1 kg/m3))  [-]
    compressibility : float64[n]  d ln rho / dp = 1 / (rho a^2) at constant entropy  [1/Pa]
    error           : greatest relative density error, met at the midpoints against CoolProp  [-]

    Outside the grid compressibility keeps its end value: ln rho goes on in a straight line. Below the vapour
    pressure there is no stable liquid to ask CoolProp for.
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
        return all(np.array_equal(a, b) for a, b in zip(vars(self).values(), vars(other).values(), strict=True))

    def __hash__(self) -> int:
        return hash((self.error, self.pressure.size))

    def numbers(self, density: float, pressure: float) -> list[float]:
        """Four columns for kernels: ln(rho / density), its slope, enthalpy from `pressure` on [J/kg], its slope."""
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
    """Cubic Hermite interpolant of a uniform table at given places."""
    step = grid[1] - grid[0]
    k = np.clip(((at - grid[0]) / step).astype(int) if hasattr(at, "astype") else int((at - grid[0]) / step), 0,
                len(grid) - 2)  # fmt: skip
    s = (at - grid[k]) / step
    r = 1.0 - s
    rise = values[k + 1] - values[k]
    return values[k] + s * s * (3 - 2 * s) * rise + s * r * step * (r * slopes[k] - s * slopes[k + 1])


def isentrope(state: Any, name: str, vapor_pressure: float) -> FluidTable:
    """The table through the present state of CoolProp's `state`; raises FluidError where it has no liquid.

    Intervals are doubled until the error met between the nodes is below AIM, or there are INTERVALS[1].
    """
    temperature, pressure, entropy = state.T(), state.p(), state.smass()
    if not 0.0 < vapor_pressure < pressure:
        raise FluidError("law", f'"table" wants a liquid, and {name} is none there; use "linear" or "log"')
    span = (vapor_pressure, _reach(state, temperature, pressure))
    intervals, most = INTERVALS
    try:
        table = _tabulate(state, span, intervals, temperature, entropy)
        while table.error > AIM and intervals < most:
            intervals *= 2
            table = _tabulate(state, span, intervals, temperature, entropy)
    except ValueError as error:
        raise FluidError("law", f'no "table" of {name} from there (CoolProp: {error}); use "log"') from None
    if table.error > WORST or not _monotone(table):
        text = f'"table" of {name} would err by {table.error:.1g}, too near its critical point; use "log"'
        raise FluidError("law", text)
    return table


def _reach(state: Any, temperature: float, pressure: float) -> float:
    """Where the table ends [Pa]: REACH, or twice the pressure, but no further than CoolProp allows."""
    from CoolProp import CoolProp

    limits = [max(REACH, 2.0 * pressure), state.pmax()]
    melting = known(lambda: state.melting_line(CoolProp.iP, CoolProp.iT, temperature))
    if melting is not None and melting > pressure:
        limits.append(melting)
    return min(limits)


def _tabulate(state: Any, span: tuple[float, float], intervals: int, temperature: float, entropy: float) -> FluidTable:
    grid = np.linspace(*span, 2 * intervals + 1)
    log_density, compressibility = _march(state, grid, temperature, entropy)
    f, d = log_density[::2], compressibility[::2]
    middle = 0.5 * (f[:-1] + f[1:]) + (grid[2] - grid[0]) / 8.0 * (d[:-1] - d[1:])
    error = float(np.max(np.abs(np.expm1(middle - log_density[1::2]))))
    return FluidTable(np.linspace(*span, intervals + 1), f, d, error)


def _march(state: Any, grid: np.ndarray, temperature: float, entropy: float) -> tuple[np.ndarray, np.ndarray]:
    """ln rho and 1/(rho a^2) at the pressures of `grid`; Newton on T from the neighbour, ds/dT = cp/T."""
    from CoolProp import CoolProp

    log_density, compressibility = np.empty_like(grid), np.empty_like(grid)
    for i, pressure in enumerate(grid):
        # Below the critical pressure the phase is named, or states next to boiling would be refused.
        subcritical = pressure < state.p_critical()
        state.specify_phase(CoolProp.iphase_liquid if subcritical else CoolProp.iphase_not_imposed)
        for _ in range(12):
            state.update(CoolProp.PT_INPUTS, pressure, temperature)
            step = (entropy - state.smass()) * temperature / state.cpmass()
            if abs(step) <= 1e-11 * temperature:
                break
            temperature += step
        log_density[i] = math.log(state.rhomass())
        compressibility[i] = 1.0 / (state.rhomass() * state.speed_sound() ** 2)
    return log_density, compressibility


def _monotone(table: FluidTable) -> bool:
    """Whether slopes are within [0, 3] times the chord's, so that the cubics rise (Fritsch, Carlson 1980)."""
    chord = np.diff(table.log_density) / np.diff(table.pressure)
    slopes = np.concatenate([table.compressibility[:-1] / chord, table.compressibility[1:] / chord])
    return bool(np.all(chord > 0.0) and np.all(slopes >= 0.0) and np.all(slopes <= 3.0))


def known(ask: Callable[[], float]) -> float | None:
    """What CoolProp answers, or None where it has no model for it."""
    try:
        value = ask()
    except ValueError:
        return None
    return value if math.isfinite(value) else None
