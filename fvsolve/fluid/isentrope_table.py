"""Tables of density along an isentrope, computed with a state object of CoolProp."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fvsolve.errors import FluidError

TABLE_PRESSURE = 1e8  # upper end of a table [Pa], or twice the reference pressure if that is higher
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
        return all(np.array_equal(a, b) for a, b in zip(vars(self).values(), vars(other).values(), strict=True))

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
    k = np.clip(((at - grid[0]) / step).astype(int) if hasattr(at, "astype") else int((at - grid[0]) / step), 0,
                len(grid) - 2)  # fmt: skip
    s = (at - grid[k]) / step
    r = 1.0 - s
    rise = values[k + 1] - values[k]
    return values[k] + s * s * (3 - 2 * s) * rise + s * r * step * (r * slopes[k] - s * slopes[k + 1])


def isentrope(state: Any, name: str, vapor_pressure: float) -> FluidTable:
    """Table of the isentrope through the present state of CoolProp's `state`, from the vapour pressure [Pa] up.

    The number of intervals starts at INTERVALS[0]. It is doubled until the error at midpoints is at most
    `TARGET_ERROR`, or until it is INTERVALS[1].
    name : name of the fluid for messages
    Raises FluidError if the state is not liquid, or if the table is not accurate enough.
    """
    temperature, pressure, entropy = state.T(), state.p(), state.smass()
    if not 0.0 < vapor_pressure < pressure:
        raise FluidError(
            "law",
            f'"table" needs a liquid, and {name} is not liquid at this temperature and pressure; use "linear" or "log"',
        )
    span = (vapor_pressure, _reach(state, temperature, pressure))
    intervals, max_intervals = INTERVALS
    try:
        table = _tabulate(state, span, intervals, temperature, entropy)
        while table.error > TARGET_ERROR and intervals < max_intervals:
            intervals *= 2
            table = _tabulate(state, span, intervals, temperature, entropy)
    except ValueError as error:
        raise FluidError(
            "law", f'"table" cannot be computed for {name} at these `temperature` and `pressure` ({error}); use "log"'
        ) from None
    if table.error > MAX_ERROR or not _monotone(table):
        text = f'"table" of {name} has a relative error of {table.error:.1g}, near its critical point; use "log"'
        raise FluidError("law", text)
    return table


def _reach(state: Any, temperature: float, pressure: float) -> float:
    """Upper end of the table [Pa]: `TABLE_PRESSURE`, or twice `pressure` if that is higher, within CoolProp's limits.

    temperature [K], pressure [Pa] : those of the reference state. CoolProp's limits are its greatest pressure and the
    melting pressure.
    """
    from CoolProp import CoolProp

    limits = [max(TABLE_PRESSURE, 2.0 * pressure), state.pmax()]
    melting = value_or_none(lambda: state.melting_line(CoolProp.iP, CoolProp.iT, temperature))
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
    """(ln rho, 1 / (rho a^2) [1/Pa]) on the isentrope of `entropy` at the pressures of `grid` [Pa] : two float64[n].

    At each pressure the temperature follows by Newton iteration from that of the previous pressure, with ds/dT = cp/T.
    temperature : start value for the first pressure [K]; rho : density [kg/m3]; a : speed of sound [m/s]
    """
    from CoolProp import CoolProp

    log_density, compressibility = np.empty_like(grid), np.empty_like(grid)
    for i, pressure in enumerate(grid):
        # Below the critical pressure the phase is imposed; CoolProp would refuse states next to boiling.
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
    """True if all slopes are 0 to 3 times those of adjacent chords, so that the cubics rise (Fritsch, Carlson 1980)."""
    chord = np.diff(table.log_density) / np.diff(table.pressure)
    slopes = np.concatenate([table.compressibility[:-1] / chord, table.compressibility[1:] / chord])
    return bool(np.all(chord > 0.0) and np.all(slopes >= 0.0) and np.all(slopes <= 3.0))


def value_or_none(read: Callable[[], float]) -> float | None:
    """Value that `read`, a call of CoolProp, returns; None if CoolProp has no model for it, or if it is not finite."""
    try:
        value = read()
    except ValueError:
        return None
    return value if math.isfinite(value) else None
