"""Fluid properties at one state. The only door to CoolProp; knows no part."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from fvsolve.errors import FluidError, did_you_mean
from fvsolve.fluid.cache import cached
from fvsolve.fluid.coolprop import celsius
from fvsolve.fluid.oils import OILS, ask_oil, oil_name
from fvsolve.fluid.table import FluidTable

__all__ = ["LAWS", "Fluid", "FluidTable", "properties"]

LAWS = ("linear", "log", "table", "mixture")
ATMOSPHERE = 101325.0  # where air_fraction counts [Pa]
USER = dict(density=None, bulk_modulus=None, viscosity=None, vapor_pressure=0.0, table=None, source="user")


@dataclass(frozen=True)
class Air:
    """What is mixed into a liquid.

    fraction : volume of free gas over that of the mixture, at 1 atm; exponent : polytropic, of the gas;
    saturation_pressure : where all of it is dissolved, falling linearly with the gas pressure [Pa], infinite for none;
    cavitation : whether vapour pressure adds to the gas pressure, so that no pressure is below it.
    """

    fraction: float
    exponent: float = 1.0
    saturation_pressure: float = math.inf
    cavitation: bool = False


@dataclass(frozen=True)
class Fluid:
    """A fluid at its reference state.

    temperature [K], pressure [Pa] absolute, density [kg/m3], bulk_modulus = rho a^2 at constant entropy [Pa],
    viscosity, dynamic [Pa s] (None where nobody knows it), vapor_pressure [Pa] (0 where there is none).
    """

    name: str
    law: str
    temperature: float
    pressure: float
    density: float
    bulk_modulus: float
    viscosity: float | None
    vapor_pressure: float
    table: FluidTable | None
    source: str
    air: Air | None = None

    @property
    def sound_speed(self) -> float:
        """Isentropic speed of sound, sqrt(bulk_modulus / density) [m/s]."""
        return math.sqrt(self.bulk_modulus / self.density)

    def plain(self) -> dict[str, Any]:
        """As JSON says it: the liquid at its reference state, SI, and where its numbers are from."""
        keys = ("name", "density", "bulk_modulus", "sound_speed", "viscosity", "vapor_pressure", "source")
        return {key: getattr(self, key) for key in keys}


def properties(
    name: str,
    temperature: float,
    pressure: float,
    law: str = "linear",
    density: float | None = None,
    bulk_modulus: float | None = None,
    viscosity: float | None = None,
    vapor_pressure: float | None = None,
    air_fraction: float | None = None,
    gas_exponent: float | None = None,
    saturation_pressure: float | None = None,
    cavitation: bool | None = None,
) -> Fluid:
    """Properties of a CoolProp fluid, an oil, "INCOMP::..." or "user" at temperature [K] and pressure [Pa].

    Given density [kg/m3], bulk_modulus [Pa], viscosity [Pa s] and vapor_pressure [Pa] stand in place of
    those; "user" has nothing else. `air_fraction` and the rest of Air are for the law "mixture",
    which without any is "log".     Raises FluidError with the key that is to blame.
    """
    given = dict(density=density, bulk_modulus=bulk_modulus, viscosity=viscosity, vapor_pressure=vapor_pressure)
    given = {key: float(value) for key, value in given.items() if value is not None}
    state = dict(temperature=float(temperature), pressure=float(pressure))
    _check_numbers(given | state, law)
    name = oil_name(name) or name
    _check_table(name, law, given)
    found = _found(name, law, **state)
    boiling = max(found["vapor_pressure"], given.get("vapor_pressure", 0.0))
    if state["pressure"] <= boiling:
        raise FluidError("pressure", _not_liquid(name, boiling, **state))
    mixed = dict(air_fraction=air_fraction, gas_exponent=gas_exponent)
    mixed |= dict(saturation_pressure=saturation_pressure, cavitation=cavitation)
    air = _air(law, {key: value for key, value in mixed.items() if value is not None})
    if given and name != "user":
        found = found | {"source": f"{found['source']}; {', '.join(given)} given"}
    fluid = Fluid(name=name, law=law, air=air, **(found | state | given))
    for key in ("density", "bulk_modulus"):
        if getattr(fluid, key) is None:
            raise FluidError(key, _missing(name, key))
    _check_cavities(fluid)
    return fluid


def _found(name: str, law: str, temperature: float, pressure: float) -> dict:
    if name == "user":
        return USER
    if name in OILS:
        return ask_oil(name, temperature, pressure)
    return cached(name, temperature, pressure, law)


def _check_numbers(numbers: dict[str, float], law: str) -> None:
    if law not in LAWS:
        laws = f"{did_you_mean(law, LAWS)}; laws are {', '.join(LAWS)}"
        raise FluidError("law", f'"{law}" is no density law{laws}')
    for key, value in numbers.items():
        if not math.isfinite(value) or value < 0.0 or (value == 0.0 and key != "vapor_pressure"):
            raise FluidError(key, f"{value:g} is not a positive, finite number")


def _check_table(name: str, law: str, given: dict[str, float]) -> None:
    """A table is CoolProp's own density: it needs a fluid that has one, and nothing that contradicts it."""
    if law != "table":
        return
    if name == "user" or name in OILS or name.startswith("INCOMP::"):
        text = f'"table" wants a compressible CoolProp fluid, "{name}" is none; use "linear" or "log"'
        raise FluidError("law", text)
    for key in ("density", "bulk_modulus"):
        if key in given:
            text = f'law = "table" takes it from CoolProp; leave {key} out, or use law = "log"'
            raise FluidError(key, text)


def _air(law: str, given: dict[str, float]) -> Air | None:
    """What is mixed in, by the keys given; only a mixture has any."""
    fraction, cavitation = given.get("air_fraction", 0.0), bool(given.get("cavitation"))
    if law != "mixture":
        for key in given:
            raise FluidError(key, f'law = "{law}" knows no gas; use law = "mixture"')
        return None
    if not 0.0 <= fraction < 1.0:
        raise FluidError("air_fraction", f"{fraction:g} is no share of a volume; wanted at least 0 and below 1")
    if cavitation and fraction == 0.0:
        raise FluidError("cavitation", "cavities grow from free gas; give air_fraction, 1e-7 for a degassed liquid")
    exponent, saturation = given.get("gas_exponent", 1.0), given.get("saturation_pressure", math.inf)
    if not 1.0 <= exponent <= 2.0:
        raise FluidError("gas_exponent", f"{exponent:g} is not between 1, isothermal, and 2")
    if cavitation and exponent != 1.0:
        raise FluidError("gas_exponent", f"{exponent:g} is not 1, and the gas in a cavity is isothermal")
    if saturation <= ATMOSPHERE:
        raise FluidError("saturation_pressure", f"{saturation:g} Pa is not above 1 atm, where air_fraction counts")
    return Air(fraction, exponent, saturation, cavitation)


def _check_cavities(fluid: Fluid) -> None:
    """Cavities need a vapour that is liquid at 1 atm."""
    if fluid.air is None or not fluid.air.cavitation:
        return
    if fluid.vapor_pressure == 0.0:
        raise FluidError("cavitation", f'needs the vapour pressure of "{fluid.name}"; give vapor_pressure')
    if fluid.vapor_pressure >= ATMOSPHERE:
        raise FluidError("cavitation", f"{fluid.name} boils at 1 atm, where air_fraction counts; leave cavitation out")


def _missing(name: str, key: str) -> str:
    if name == "user":
        return f'a "user" fluid needs density [kg/m3] and bulk_modulus [Pa]; {key} is missing'
    return f'CoolProp has no compressibility for "{name}"; give {key}, for example "1.5 GPa"'


def _not_liquid(name: str, boiling: float, temperature: float, pressure: float) -> str:
    return (
        f"{pressure:.6g} Pa is not above the vapour pressure of {name} at {celsius(temperature)}, "
        f"{boiling:.6g} Pa; wanted a liquid (pressures are absolute)"
    )
