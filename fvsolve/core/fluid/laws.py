"""Density laws: density, head and mass of a fluid as functions of pressure; free gas in a liquid, vapour in cavities.

A density law is one class here and one file of compiled functions in `kernels.density`; basins of liquid have their
own functions (`basins.liquid.lower`). A law of another package is a `SampledLaw`. Other modules use the attributes and
methods of `Law`, never the name of a law.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from fvsolve.core.fluid.fluid_table import MAX_ERROR, FluidTable, is_monotone, refined_table
from fvsolve.core.fluid.oils import OILS
from fvsolve.core.kernels import dtypes as rec
from fvsolve.declarations import Declarations, unreadable
from fvsolve.errors import FluidError, FvsolveError

ATMOSPHERE = 101325.0  # pressure to which air_fraction refers [Pa]
AIR_KEYS = ("air_fraction", "gas_exponent", "saturation_pressure", "cavitation")


@dataclass(frozen=True)
class Air:
    """Free gas in a liquid, and cavitation.

    fraction : volume of free gas over volume of the mixture, at 1 atm; exponent : polytropic exponent of the gas
    saturation_pressure : pressure at which all gas is dissolved [Pa], infinite if gas does not dissolve; the amount of
    free gas decreases linearly with the pressure up to this value
    cavitation : True if vapour forms at vapour pressure, which is then the lower bound of pressure
    """

    fraction: float
    exponent: float = 1.0
    saturation_pressure: float = math.inf
    cavitation: bool = False

    def gas(self, fluid, floor: float) -> float:
        """Constant G of the relative gas volume: volume of free gas over that of the liquid at the reference pressure.

        At the pressure p the relative gas volume is G (1 - x / s) / x^(1 / exponent), with x = p - floor and s =
        saturation_pressure - floor [Pa].
        fluid : fluid at its reference state; floor : lower bound of the pressure [Pa]
        """
        x, saturation = ATMOSPHERE - floor, self.saturation_pressure - floor
        liquid = 1.0 - (ATMOSPHERE - fluid.pressure) / fluid.bulk_modulus
        free = self.fraction / (1.0 - self.fraction) * liquid
        return free * x ** (1.0 / self.exponent) / (1.0 - x / saturation)


def air_of(given: dict[str, float]) -> Air:
    """Free gas and cavitation from the given keys of [fluid]; raises FluidError for a value out of range."""
    fraction, cavitation = given.get("air_fraction", 0.0), bool(given.get("cavitation"))
    if not 0.0 <= fraction < 1.0:
        raise FluidError(
            "air_fraction",
            f"{fraction:g} is not a volume fraction; expected at least 0 and below 1",
        )
    if cavitation and fraction == 0.0:
        raise FluidError(
            "cavitation",
            "needs free gas, from which cavities grow; try `air_fraction = 1e-7` for a degassed liquid",
        )
    exponent = given.get("gas_exponent", 1.0)
    saturation = given.get("saturation_pressure", math.inf)
    if not 1.0 <= exponent <= 2.0:
        raise FluidError(
            "gas_exponent",
            f"{exponent:g} is out of range; expected a value between 1 (isothermal) and 2",
        )
    if cavitation and exponent != 1.0:
        raise FluidError(
            "gas_exponent",
            f"{exponent:g} is not 1; with cavitation the gas is isothermal; expected 1",
        )
    if saturation <= ATMOSPHERE:
        text = f"{saturation:g} Pa is not above 1 atm, the pressure to which `air_fraction` refers"
        raise FluidError("saturation_pressure", f"{text}; expected more than {ATMOSPHERE:g} Pa")
    return Air(fraction, exponent, saturation, cavitation)


def check_cavities(fluid) -> None:
    """Raise FluidError if `cavitation` is true for a fluid without vapour pressure, or for one that boils at 1 atm."""
    if fluid.air is None or not fluid.air.cavitation:
        return
    if fluid.vapor_pressure == 0.0:
        raise FluidError(
            "cavitation",
            f'needs the vapour pressure of "{fluid.name}"; give the key `vapor_pressure`',
        )
    if fluid.vapor_pressure >= ATMOSPHERE:
        text = f"{fluid.name} boils at 1 atm, the pressure to which `air_fraction` refers"
        raise FluidError("cavitation", f"{text}; leave out the key `cavitation`")


# in one line or in several, as a formatter leaves it
HEADER = re.compile(r'\nclass (?P<attribute>\w+)\(\s*\w+,\s*name="(?P<name>[\w-]+)",?\s*\):')
# from the simplest to the most general
LAWS = Declarations("density law", "density laws", ("core/fluid/laws.py",), HEADER)


def law_named(name: str) -> type[Law]:
    """Class of a density law. Raises FvsolveError if the name is unknown, or if its declaration is no density law."""
    law = LAWS.load(name)
    if not (isinstance(law, type) and issubclass(law, Law)):
        found = LAWS[name]
        fault = "it is not a density law; expected a subclass of fvsolve.core.fluid.laws.SampledLaw"
        raise FvsolveError(unreadable(found.source, found.place, fault))
    return law


def law_names(fits: Callable[[str], bool]) -> str:
    """Names of the density laws for which `fits`, a function of the name, is true, as text for a message."""
    *others, last = (f'"{name}"' for name in LAWS if fits(name))
    return f"{', '.join(others)} or {last}" if others else last


def over_weight(rise, weight: float):
    """Height [m] equivalent to a pressure difference, rise [Pa] / weight; NaN for zero weight. weight : rho g [N/m3]"""
    return rise / weight if weight > 0.0 else np.full(np.shape(rise), np.nan)[()]


class Law:
    """Density law: density of one fluid as a function of pressure. Pressures are absolute, heads relative to ambient.

    name, code : name in case files, code in compiled functions
    linear : True if waves superpose: wave speed and impedance are constant, and pressure is linear in mass and in head
    tabulated : True if the density is a table; from_coolprop : True if this table comes from CoolProp
    keys : keys of [fluid] that only this law has
    ambient : ambient pressure [Pa]; gravity : [m/s2]. The argument z of methods is an elevation [m].
    """

    name: ClassVar[str]
    code: ClassVar[int]
    linear: ClassVar[bool] = False
    tabulated: ClassVar[bool] = False
    from_coolprop: ClassVar[bool] = False
    keys: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, name: str = "", **facts: Any) -> None:
        super().__init_subclass__(**facts)
        if name:
            cls.name = name

    def __init__(self, fluid, ambient: float, gravity: float) -> None:
        self.fluid, self.rho, self.ambient, self.gravity = fluid, fluid.density, ambient, gravity
        settings, floats = np.zeros(1, rec.SETTINGS), []
        self.lower(fluid, settings[0], floats)
        self.st, self.floats = settings[0], np.array(floats, dtype=float)

    @classmethod
    def lower(cls, fluid, s, floats: list[float]) -> None:
        """Write the parameters of the law to a record `s` of the table `settings`; append its tables to `floats`."""
        s["law"], s["rho"], s["beta"], s["reference"] = (
            cls.code,
            fluid.density,
            fluid.bulk_modulus,
            fluid.pressure,
        )

    @classmethod
    def check(cls, name: str, given: dict[str, float]) -> None:
        """Raise FluidError if the law does not allow the fluid `name`, or one of its given properties."""

    @classmethod
    def table(cls, fluid) -> FluidTable | None:
        """Table of the density that the law computes; None for a law without one. May raise FluidError."""
        return None

    @classmethod
    def air(cls, given: dict[str, float]) -> Air | None:
        """Free gas from the keys of [fluid] in `given`; None for a law without free gas.

        Such a law raises FluidError if a key is given.
        """
        for key in given:
            raise FluidError(key, f'law = "{cls.name}" has no free gas; use law = "mixture"')
        return None

    @property
    def cavitates(self) -> bool:
        """True if vapour cavities form, so that vapour pressure is the lower bound of pressure."""
        return bool(self.st["floor"] > 0.0)

    @property
    def family(self) -> str:
        """Name of the family of compiled functions for the law: "linear", "barotropic" or "cavitating".

        In "linear" the pressure is linear in the states.
        In "barotropic" the states are masses, from which the density law gives the pressure.
        "cavitating" is "barotropic" with vapour cavities.
        """
        return "linear" if self.linear else "cavitating" if self.cavitates else "barotropic"

    @property
    def cavity_pressure(self) -> float:
        """Pressure [Pa] below which a location counts as a cavity.

        It is the vapour pressure, or with cavitation twice the vapour pressure.
        Below twice the vapour pressure, the vapour has a greater partial pressure than the gas.
        """
        return self.fluid.vapor_pressure * (2.0 if self.cavitates else 1.0)

    @property
    def open_density(self) -> float:
        """Density [kg/m3] at ambient pressure, for example in an open tank."""
        return float(self.density(self.ambient))

    @property
    def cavitation_keys(self) -> str:
        """Words of a message before `cavitation = true`: 'law = "mixture" and '; empty for the law `mixture`."""
        return 'law = "mixture" and '

    @property
    def advice(self) -> str:
        """Advice that is appended to the message of a failed run; empty by default."""
        return ""

    def wave_speed(self, row, pressure: np.ndarray) -> float:
        """Wave speed [m/s] of a pipe with elastic walls, one value for the whole pipe.

        row : row of the pipe in the tables of the model; pressure : pressures along the pipe [Pa]
        """
        return float(row["speed"])


class LinearLaw(Law, name="linear"):
    """Density law `linear`: the fluid flows with constant density; mass stored in a volume is linear in pressure."""

    code, linear = rec.LAW_LINEAR, True

    def density(self, pressure):
        """Density [kg/m3] at given pressures [Pa]: constant under the density law `linear`."""
        return np.full(np.shape(pressure), self.rho)[()]

    def potential_of(self, pressure: float, z: float) -> float:
        """Piezometric pressure [Pa] of a fluid with `pressure` [Pa] at elevation z [m]; constant in a fluid at rest."""
        return pressure + self.rho * self.gravity * z

    def pressure_of(self, potential: float, z: float) -> float:
        """Pressure [Pa] at elevation z [m] for a piezometric pressure `potential` [Pa]."""
        return potential - self.rho * self.gravity * z

    def pressure_under(self, head: float) -> float:
        """Pressure [Pa] under a liquid column of height `head` [m] whose surface is at ambient pressure."""
        return self.ambient + self.rho * self.gravity * head

    def head(self, pressure, z):
        """Piezometric head [m] at pressures [Pa] and elevations z [m]."""
        return over_weight(pressure - self.ambient, self.rho * self.gravity) + z

    def mass_in(self, pressure: float, volume: float) -> float:
        """Mass [kg] of the fluid in a volume [m3] at a pressure [Pa]."""
        return (
            self.rho * volume * (1.0 + (pressure - self.fluid.pressure) / self.fluid.bulk_modulus)
        )

    def compliance(self, speed: float) -> float:
        """Wall compliance (1/A) dA/dp [1/Pa] of a pipe with the area A, from its wave speed `speed` [m/s].

        It is 0 under the density law `linear`, whose compiled functions need the wave speed alone.
        """
        return 0.0

    def area(self, row, pressure):
        """Cross-section [m2] of a pipe at pressures [Pa]. row : row of the pipe in the tables of the model"""
        return row["area"]

    def cell_pressure(
        self, row, start: np.ndarray, profile: np.ndarray, waves: np.ndarray
    ) -> np.ndarray:
        """Pressure [Pa] in the cells of a pipe : float64[cells].

        row : row of the pipe in the tables of the model; start : pressures at the start [Pa]
        waves : sum of forward and backward wave in each cell [kg/s]
        profile : table `profile` of the model, with masses per length [kg/m] at the steady start from index
        row["center"] on; not used by the density law `linear`
        """
        return start + waves / row["admittance"]

    def cell_pressures(
        self, pipes, starts: list[np.ndarray], profile: np.ndarray, waves: np.ndarray
    ) -> np.ndarray:
        """Pressure [Pa] in the cells of all pipes, one pipe after the other : float64[cells].

        pipes : table of pipes of the model; starts : for each pipe pressures at the start [Pa]
        waves, profile : as for `cell_pressure`, for all pipes
        """
        sizes = [len(start) for start in starts]
        return np.concatenate([np.zeros(0), *starts]) + waves / np.repeat(
            pipes["admittance"], sizes
        )

    def mass_in_pipe(self, row, start: np.ndarray, profile: np.ndarray) -> float:
        """Mass [kg] in a pipe at the steady start.

        row, profile : as for `cell_pressure`; start : float64[cells]  pressures at the start [Pa]
        """
        strain = (start - self.fluid.pressure) / (self.rho * row["speed"] ** 2)
        return float(np.sum(self.rho * row["area"] * row["dx"] * (1 + strain)))


class DenseLaw(Law):
    """Base of the density laws `log`, `table` and `mixture`.

    Their compiled functions (`kernels.density`) have masses as states.
    """

    @cached_property
    def kernels(self):
        from fvsolve.core.kernels import density  # not imported for scenes with the linear law

        return density

    def for_each(self, function, *arguments):
        """Values of a compiled function of this law, for each element of the last of its arguments.

        function : called as function(settings record, tables, *arguments)
        """
        *first, last = arguments
        values = [function(self.st, self.floats, *first, float(x)) for x in np.ravel(last)]
        return np.array(values).reshape(np.shape(last))[()]

    def density(self, pressure):
        return self.for_each(self.kernels.density, pressure)

    def enthalpy(self, pressure):
        """Integral of dp / rho from the reference pressure to `pressure` [J/kg]."""
        return self.for_each(self.kernels.enthalpy, pressure)

    def pressure_of_enthalpy(self, h):
        """Pressure [Pa] at which `enthalpy` is h [J/kg]."""
        return self.for_each(self.kernels.pressure_of_enthalpy, h)

    def potential_of(self, pressure: float, z: float) -> float:
        return self.rho * (self.enthalpy(pressure) + self.gravity * z)

    def pressure_of(self, potential: float, z: float) -> float:
        return self.pressure_of_enthalpy(potential / self.rho - self.gravity * z)

    def pressure_under(self, head: float) -> float:
        return self.pressure_of_enthalpy(self.enthalpy(self.ambient) + self.gravity * head)

    def head(self, pressure, z):
        return over_weight(self.enthalpy(pressure) - self.enthalpy(self.ambient), self.gravity) + z

    def mass_in(self, pressure: float, volume: float) -> float:
        return self.density(pressure) * volume

    def compliance(self, speed: float) -> float:
        return 1.0 / (self.rho * speed**2) - 1.0 / self.fluid.bulk_modulus

    def area(self, row, pressure):
        return self.for_each(self.kernels.wall_area, row, pressure)

    def cell_pressure(
        self, row, start: np.ndarray, profile: np.ndarray, waves: np.ndarray
    ) -> np.ndarray:
        masses = profile[row["center"] + np.arange(len(waves))] + waves / row["speed"]
        return self.for_each(self.kernels.pressure_of_mass, row, masses)

    def cell_pressures(
        self, pipes, starts: list[np.ndarray], profile: np.ndarray, waves: np.ndarray
    ) -> np.ndarray:
        parts, at = [np.zeros(0)], 0
        for row, start in zip(pipes, starts, strict=True):
            parts.append(self.cell_pressure(row, start, profile, waves[at : at + len(start)]))
            at += len(start)
        return np.concatenate(parts)

    def mass_in_pipe(self, row, start: np.ndarray, profile: np.ndarray) -> float:
        return float(np.sum(profile[row["center"] + np.arange(len(start))])) * row["dx"]


class LogLaw(DenseLaw, name="log"):
    """Density law `log`: p = p_ref + beta ln(rho / rho_ref), with a constant bulk modulus beta [Pa]."""

    code = rec.LAW_LOG


class TabulatedLaw(DenseLaw):
    """Base of the density laws whose density is a table over pressure, `fluid.table`."""

    code, tabulated = rec.LAW_TABLE, True

    @classmethod
    def lower(cls, fluid, s, floats: list[float]) -> None:
        super().lower(fluid, s, floats)
        p = fluid.table.pressure
        s["table"], s["table_size"], s["table_start"] = len(floats), len(p), p[0]
        s["table_step"] = (p[-1] - p[0]) / (len(p) - 1)
        floats += fluid.table.numbers(fluid.density, fluid.pressure)


class TableLaw(TabulatedLaw, name="table"):
    """Density law `table`: density from CoolProp along the isentrope through the reference state."""

    from_coolprop = True

    @classmethod
    def check(cls, name: str, given: dict[str, float]) -> None:
        if name == "user" or name in OILS or name.startswith("INCOMP::"):
            text = f'"table" needs a compressible fluid of CoolProp, not "{name}"; use "linear" or "log"'
            raise FluidError("law", text)
        for key in ("density", "bulk_modulus"):
            if key in given:
                text = f'law = "table" reads {key} from CoolProp; leave out the key `{key}`, or use law = "log"'
                raise FluidError(key, text)


class SampledLaw(TabulatedLaw):
    """Base of a density law of another package: a formula of the density over pressure, which becomes a table.

    lowest, highest : pressures between which the formula is sampled [Pa], not below the vapour pressure. The reference
    pressure and its double always lie between them. Beyond both ends ln rho is linear in pressure.
    """

    lowest: ClassVar[float] = 100.0
    highest: ClassVar[float] = 1e8

    @classmethod
    def log_density(cls, fluid, pressure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(ln(rho / rho_ref), its slope d ln rho / dp [1/Pa]) : two float64[n].

        fluid : reference state, with `density` rho_ref [kg/m3] and `bulk_modulus` [Pa] at the pressure `pressure` [Pa]
        pressure : absolute pressures [Pa] : float64[n]
        """
        raise FluidError("law", f'"{cls.name}" has no method `log_density`; expected its formula')

    @classmethod
    def table(cls, fluid) -> FluidTable:
        """Table of the formula; FluidError if it contradicts the fluid, is not smooth, or falls with pressure."""

        def sample(pressures: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            value, slope = cls.log_density(fluid, pressures)
            return math.log(fluid.density) + np.asarray(value), np.asarray(slope)

        value, slope = (float(x[0]) for x in cls.log_density(fluid, np.array([fluid.pressure])))
        ratio = slope * fluid.bulk_modulus
        if not abs(value) <= MAX_ERROR:
            text = f"ln(rho / rho_ref) is {value:g} at the reference pressure; expected 0"
            raise FluidError("law", f'"{cls.name}": {text}')
        if not abs(ratio - 1.0) <= MAX_ERROR:
            text = f"its bulk modulus is {1.0 / slope:g} Pa at the reference pressure"
            expected = f"expected that of the fluid, {fluid.bulk_modulus:g} Pa"
            raise FluidError("law", f'"{cls.name}": {text}; {expected}')
        least = max(min(cls.lowest, fluid.pressure), fluid.vapor_pressure)
        span = least, max(cls.highest, 2.0 * fluid.pressure)
        values, slopes = sample(grid := np.linspace(*span, 1025))
        # Simpson's rule over pairs of intervals
        rise = (slopes[:-2:2] + 4.0 * slopes[1::2] + slopes[2::2]) * (grid[1] - grid[0]) / 3.0
        if (
            not np.abs(rise - (values[2::2] - values[:-2:2])).max()
            <= MAX_ERROR * np.abs(rise).max()
        ):
            text = "its slope is not that of its values, or not smooth"
            raise FluidError("law", f'"{cls.name}": {text}; expected d ln rho / dp')
        table = refined_table(sample, span)
        if not table.error <= MAX_ERROR:
            text = f"a table of its density has a relative error of {table.error:.1g}"
            expected = "expected a smooth formula, with the slope that belongs to it"
            raise FluidError("law", f'"{cls.name}": {text}; {expected}')
        if not is_monotone(table):
            raise FluidError("law", f'"{cls.name}": its density does not rise with pressure')
        return table


class MixtureLaw(DenseLaw, name="mixture"):
    """Density law `mixture`: liquid with free gas, and with vapour if `cavitation` is true.

    Without free gas it is the density law `log`.
    """

    code, keys = rec.LAW_MIXTURE, AIR_KEYS

    @classmethod
    def air(cls, given: dict[str, float]) -> Air:
        return air_of(given)

    @classmethod
    def lower(cls, fluid, s, floats: list[float]) -> None:
        super().lower(fluid, s, floats)
        if fluid.air is None or fluid.air.fraction == 0.0:
            s["law"] = LogLaw.code
            return
        s["floor"] = fluid.vapor_pressure if fluid.air.cavitation else 0.0
        s["gas_power"], s["saturation"] = (
            1.0 / fluid.air.exponent,
            fluid.air.saturation_pressure - s["floor"],
        )
        s["gas"] = fluid.air.gas(fluid, s["floor"])

    @property
    def open_density(self) -> float:
        """Density [kg/m3] at ambient pressure, for example in an open tank."""
        return float(self.density(self.ambient))

    @property
    def cavitation_keys(self) -> str:
        return ""

    @property
    def advice(self) -> str:
        """Advice on runs that fail because gas expands strongly; empty with cavitation.

        With cavitation the vapour pressure is a lower bound of pressure.
        """
        if self.cavitates:
            return ""
        return (
            "; where much gas expands, set `cavitation = true` in [fluid] and "
            "a suitable scheme (see docs/fluids.md)"
        )

    def wave_speed(self, row, pressure: np.ndarray) -> float:
        """Harmonic mean of the local wave speeds along a pipe [m/s]; arguments as for `Law.wave_speed`."""
        return len(pressure) / sum(1.0 / self.for_each(self.kernels.local_speed, row, pressure))
