"""Density laws: what each can carry, and how density, head and mass hang on pressure. Knows one fluid; knows no scene.

A law is one class here and one file of compiled functions in `kernels.density`; basins of liquid have their own
(`basins.liquid.lower`). What is asked of a law elsewhere is asked by these names, never by its own.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from fvsolve.errors import FluidError
from fvsolve.fluid.air import AIR_KEYS, Air, mixed
from fvsolve.fluid.oils import OILS
from fvsolve.kernels import records as rec

LAWS: dict[str, type[Law]] = {}  # name -> law, in the order of what they know


def named(fits: Callable[[type[Law]], bool]) -> str:
    """Names of the laws that fit, as a message wants them."""
    *some, last = (f'"{name}"' for name, law in LAWS.items() if fits(law))
    return f"{', '.join(some)} or {last}" if some else last


def over_weight(rise, weight: float):
    """rise / weight [m]; no number where nothing weighs."""
    return rise / weight if weight > 0.0 else np.full(np.shape(rise), np.nan)[()]


class Law:
    """How one fluid's density hangs on pressure; heads count from ambient pressure, heights are z [m].

    name, code : as case files and as kernels say it
    linear : waves add up: no state changes their speed or what they carry; pressure is linear in mass and in head
    scalars : whether its flows carry any
    tabulated : whether it reads CoolProp's own density; keys : of [fluid] that no other law knows
    """

    name: ClassVar[str]
    code: ClassVar[int]
    linear: ClassVar[bool] = False
    scalars: ClassVar[bool] = False
    tabulated: ClassVar[bool] = False
    keys: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, name: str = "", **facts: Any) -> None:
        super().__init_subclass__(**facts)
        if name:
            cls.name, LAWS[name] = name, cls

    def __init__(self, fluid, ambient: float, gravity: float) -> None:
        self.fluid, self.rho, self.ambient, self.gravity = fluid, fluid.density, ambient, gravity
        settings, floats = np.zeros(1, rec.SETTINGS), []
        self.lower(fluid, settings[0], floats)
        self.st, self.floats = settings[0], np.array(floats, dtype=float)

    @classmethod
    def lower(cls, fluid, s, floats: list[float]) -> None:
        """Fill in what kernels read of a law: numbers of `settings`, and floats of its own."""
        s["law"], s["rho"], s["beta"], s["reference"] = cls.code, fluid.density, fluid.bulk_modulus, fluid.pressure

    @classmethod
    def check(cls, name: str, given: dict[str, float]) -> None:
        """Raise FluidError where a fluid, or a number given for it, does not go with the law."""

    @classmethod
    def air(cls, given: dict[str, float]) -> Air | None:
        """What is mixed in, by the keys given."""
        for key in given:
            raise FluidError(key, f'law = "{cls.name}" knows no gas; use law = "mixture"')
        return None

    @property
    def cavitates(self) -> bool:
        """Whether it knows cavities: no pressure is below its floor."""
        return bool(self.st["floor"] > 0.0)

    @property
    def family(self) -> str:
        """Which kernels it runs on: "linear" hold pressures, "barotropic" masses, "cavitating" cavities too."""
        return "linear" if self.linear else "cavitating" if self.cavitates else "barotropic"

    @property
    def cavity_pressure(self) -> float:
        """Pressure [Pa] below which a place is a cavity: vapour pressure, or where more vapour than gas is in it."""
        return self.fluid.vapor_pressure * (2.0 if self.cavitates else 1.0)

    @property
    def open_density(self) -> float:
        """Density [kg/m3] of what is open to ambient."""
        return float(self.density(self.ambient))

    @property
    def to_cavitate(self) -> str:
        """What must stand in [fluid] before `cavitation = true`."""
        return 'law = "mixture" and '

    @property
    def advice(self) -> str:
        """What to try where a run cannot go on."""
        return ""

    def wave_speed(self, row, pressure: np.ndarray) -> float:
        """Wave speed of a pipe [m/s] for those who see one number: that of liquid and wall."""
        return float(row["speed"])


class LinearLaw(Law, name="linear"):
    """One density, but that mass and pressure of what is squeezed are linear in each other."""

    code, linear, scalars = rec.LAW_LINEAR, True, True

    def density(self, pressure):
        """Density [kg/m3] of what flows, at pressures."""
        return np.full(np.shape(pressure), self.rho)[()]

    def potential_of(self, pressure: float, z: float) -> float:
        """What is constant in a fluid at rest, as a pressure at z = 0 [Pa]."""
        return pressure + self.rho * self.gravity * z

    def pressure_of(self, potential: float, z: float) -> float:
        """Pressure [Pa] of a potential [Pa] at z."""
        return potential - self.rho * self.gravity * z

    def pressure_under(self, head: float) -> float:
        """Pressure [Pa] under a column of `head` [m] open to ambient."""
        return self.ambient + self.rho * self.gravity * head

    def head(self, pressure, z):
        """Head [m] at pressures and heights."""
        return over_weight(pressure - self.ambient, self.rho * self.gravity) + z

    def held(self, pressure: float, volume: float) -> float:
        """Mass [kg] in a volume."""
        return self.rho * volume * (1.0 + (pressure - self.fluid.pressure) / self.fluid.bulk_modulus)

    def compliance(self, speed: float) -> float:
        """Growth of a pipe's area with pressure that makes its wave speed [1/Pa]; here the speed alone says it."""
        return 0.0

    def area(self, row, pressure):
        """Area [m2] of a pipe at pressures."""
        return row["area"]

    def cell_pressure(self, row, start: np.ndarray, profile: np.ndarray, waves: np.ndarray) -> np.ndarray:
        """Pressure [Pa] in the cells of a pipe from its start [Pa], the profile and the sum of both waves [kg/s]."""
        return start + waves / row["admittance"]

    def held_in_pipe(self, row, start: np.ndarray, profile: np.ndarray) -> float:
        """Mass [kg] in a pipe at the start."""
        strain = (start - self.fluid.pressure) / (self.rho * row["speed"] ** 2)
        return float(np.sum(self.rho * row["area"] * row["dx"] * (1 + strain)))


class DenseLaw(Law):
    """Laws whose kernels hold masses: their questions are those of `kernels.density`."""

    @cached_property
    def kernels(self):
        from fvsolve.kernels import density  # which scenes under a linear law do without

        return density

    def each(self, question, *arguments):
        """A compiled question for each pressure, or whatever comes last."""
        *first, last = arguments
        found = [question(self.st, self.floats, *first, float(x)) for x in np.ravel(last)]
        return np.array(found).reshape(np.shape(last))[()]

    def density(self, pressure):
        return self.each(self.kernels.density, pressure)

    def enthalpy(self, pressure):
        """Integral of dp / rho from the reference pressure [J/kg]."""
        return self.each(self.kernels.enthalpy, pressure)

    def pressure_of_enthalpy(self, h):
        """Pressure [Pa] at which `enthalpy` is h."""
        return self.each(self.kernels.pressure_of_enthalpy, h)

    def potential_of(self, pressure: float, z: float) -> float:
        return self.rho * (self.enthalpy(pressure) + self.gravity * z)

    def pressure_of(self, potential: float, z: float) -> float:
        return self.pressure_of_enthalpy(potential / self.rho - self.gravity * z)

    def pressure_under(self, head: float) -> float:
        return self.pressure_of_enthalpy(self.enthalpy(self.ambient) + self.gravity * head)

    def head(self, pressure, z):
        return over_weight(self.enthalpy(pressure) - self.enthalpy(self.ambient), self.gravity) + z

    def held(self, pressure: float, volume: float) -> float:
        return self.density(pressure) * volume

    def compliance(self, speed: float) -> float:
        return 1.0 / (self.rho * speed**2) - 1.0 / self.fluid.bulk_modulus

    def area(self, row, pressure):
        return self.each(self.kernels.wall_area, row, pressure)

    def cell_pressure(self, row, start: np.ndarray, profile: np.ndarray, waves: np.ndarray) -> np.ndarray:
        masses = profile[row["center"] + np.arange(len(waves))] + waves / row["speed"]
        return self.each(self.kernels.pressure_of_mass, row, masses)

    def held_in_pipe(self, row, start: np.ndarray, profile: np.ndarray) -> float:
        return float(np.sum(profile[row["center"] + np.arange(len(start))])) * row["dx"]


class LogLaw(DenseLaw, name="log"):
    """p = p_ref + beta ln(rho / rho_ref): one bulk modulus."""

    code = rec.LAW_LOG


class TableLaw(DenseLaw, name="table"):
    """CoolProp's own density along the isentrope through the reference state."""

    code, tabulated = rec.LAW_TABLE, True

    @classmethod
    def check(cls, name: str, given: dict[str, float]) -> None:
        if name == "user" or name in OILS or name.startswith("INCOMP::"):
            text = f'"table" wants a compressible CoolProp fluid, "{name}" is none; use "linear" or "log"'
            raise FluidError("law", text)
        for key in ("density", "bulk_modulus"):
            if key in given:
                text = f'law = "table" takes it from CoolProp; leave {key} out, or use law = "log"'
                raise FluidError(key, text)

    @classmethod
    def lower(cls, fluid, s, floats: list[float]) -> None:
        super().lower(fluid, s, floats)
        p = fluid.table.pressure
        s["table"], s["table_size"], s["table_start"] = len(floats), len(p), p[0]
        s["table_step"] = (p[-1] - p[0]) / (len(p) - 1)
        floats += fluid.table.numbers(fluid.density, fluid.pressure)


class MixtureLaw(DenseLaw, name="mixture"):
    """Liquid with free gas, and vapour where cavities are asked for; with nothing mixed in it is `log`."""

    code, keys = rec.LAW_MIXTURE, AIR_KEYS

    @classmethod
    def air(cls, given: dict[str, float]) -> Air:
        return mixed(given)

    @classmethod
    def lower(cls, fluid, s, floats: list[float]) -> None:
        super().lower(fluid, s, floats)
        if fluid.air is None or fluid.air.fraction == 0.0:
            s["law"] = LogLaw.code
            return
        s["floor"] = fluid.vapor_pressure if fluid.air.cavitation else 0.0
        s["gas_power"], s["saturation"] = 1.0 / fluid.air.exponent, fluid.air.saturation_pressure - s["floor"]
        s["gas"] = fluid.air.gas(fluid, s["floor"])

    @property
    def open_density(self) -> float:
        """Density [kg/m3] of what is open to ambient."""
        return float(self.density(self.ambient))

    @property
    def to_cavitate(self) -> str:
        return ""

    @property
    def advice(self) -> str:
        """Gas that expands far is more than it can follow without a floor."""
        if self.cavitates:
            return ""
        return "; where much gas expands, give the fluid cavitation = true and a scheme for it (docs/cavitation)"

    def wave_speed(self, row, pressure: np.ndarray) -> float:
        """The mean along the pipe."""
        return len(pressure) / sum(1.0 / self.each(self.kernels.local_speed, row, pressure))
