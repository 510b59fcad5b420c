"""Properties of a fluid at its reference state."""

import math
from dataclasses import dataclass, replace
from typing import Any

from fvsolve.core.fluid.fluid_table import FluidTable
from fvsolve.core.fluid.laws import LAWS, Air, check_cavities, law_named
from fvsolve.core.fluid.oils import (
    OILS,
    oil_name,
    oil_properties,
    oil_specific_heat,
    walther_numbers,
    walther_points,
    walther_viscosity,
)
from fvsolve.core.fluid.property_cache import cached_properties, cached_specific_heat
from fvsolve.errors import FluidError, did_you_mean
from fvsolve.units import Kinematic, celsius

__all__ = [
    "LAWS",
    "law_named",
    "Fluid",
    "FluidTable",
    "follow_temperature",
    "properties",
    "specific_heat",
]

USER = dict(
    density=None, bulk_modulus=None, viscosity=None, vapor_pressure=0.0, table=None, source="user"
)


@dataclass(frozen=True)
class Fluid:
    """A fluid at its reference state.

    law : name of the density law; temperature : [K]; pressure : absolute [Pa]; density : [kg/m3]
    bulk_modulus : rho a^2 at constant entropy [Pa], with the density rho and the speed of sound a
    viscosity : dynamic viscosity [Pa s], None if unknown
    vapor_pressure : absolute [Pa], 0 for a fluid without vapour pressure
    table : density over pressure for density laws that are tabulated, otherwise None
    source : where the properties come from
    air : free gas for the density law `mixture`, otherwise None
    walther : numbers of the viscosity over the temperature, see `oils.walther_numbers`; otherwise None
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
    walther: tuple[float, float] | None = None

    @property
    def sound_speed(self) -> float:
        """Isentropic speed of sound, sqrt(bulk_modulus / density) [m/s]."""
        return math.sqrt(self.bulk_modulus / self.density)

    def plain(self) -> dict[str, Any]:
        """Name, properties in SI and their source, as a dict for JSON."""
        keys = (
            "name",
            "density",
            "bulk_modulus",
            "sound_speed",
            "viscosity",
            "vapor_pressure",
            "source",
        )
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
    """Properties of a CoolProp fluid, an oil, "INCOMP::..." or "user" at temperature [K] and absolute pressure [Pa].

    law : name of the density law
    density [kg/m3], bulk_modulus [Pa], viscosity [Pa s], vapor_pressure [Pa] : if given, they replace the properties of
    the fluid; the fluid "user" has only given properties
    air_fraction, gas_exponent, saturation_pressure, cavitation : for the density law `mixture` (see `Air`), which
    equals the law `log` without them
    Raises FluidError with the key at fault.
    """
    given = dict(
        density=density,
        bulk_modulus=bulk_modulus,
        viscosity=viscosity,
        vapor_pressure=vapor_pressure,
    )
    given = {key: float(value) for key, value in given.items() if value is not None}
    state = dict(temperature=float(temperature), pressure=float(pressure))
    _check_numbers(given | state, law)
    name = oil_name(name) or name
    law_named(law).check(name, given)
    values = _look_up(name, law, **state)
    boiling = max(values["vapor_pressure"], given.get("vapor_pressure", 0.0))
    if state["pressure"] <= boiling:
        raise FluidError(
            "pressure",
            f"{state['pressure']:.6g} Pa is not above the vapour pressure of {name} at "
            f"{celsius(state['temperature'])}, {boiling:.6g} Pa; expected a liquid, at a higher pressure (absolute) or "
            "a lower temperature",
        )
    mixed = dict(air_fraction=air_fraction, gas_exponent=gas_exponent)
    mixed |= dict(saturation_pressure=saturation_pressure, cavitation=cavitation)
    air = law_named(law).air({key: value for key, value in mixed.items() if value is not None})
    if given and name != "user":
        values = values | {"source": f"{values['source']}; {', '.join(given)} given"}
    fluid = Fluid(name=name, law=law, air=air, **(values | state | given))
    for key in ("density", "bulk_modulus"):
        if getattr(fluid, key) is not None:
            continue
        text = f'CoolProp has no compressibility for "{name}"; give the key `{key}`, for example "1.5 GPa"'
        if name == "user":
            text = f'a "user" fluid needs the keys `density` [kg/m3] and `bulk_modulus` [Pa]; `{key}` is missing'
        raise FluidError(key, text)
    check_cavities(fluid)
    if (table := law_named(law).table(fluid)) is not None:
        fluid = replace(fluid, table=table)
    return fluid


def follow_temperature(fluid: Fluid, points: tuple[tuple[float, float], ...]) -> Fluid:
    """Copy of a fluid whose viscosity follows its temperature through two points, for oils those of their grade.

    points : (temperature [K], viscosity, dynamic [Pa s] or `Kinematic` [m2/s]). Raises FluidError.
    """
    kinematic = [
        (t, float(nu) if isinstance(nu, Kinematic) else nu / fluid.density) for t, nu in points
    ]
    found = tuple(kinematic) or walther_points(fluid.name)
    if not found:
        text = 'the law needs two points of this fluid, points = [["40 degC", "46 cSt"], ["100 degC", "6.8 cSt"]]'
        raise FluidError("viscosity", text)
    numbers = walther_numbers(found)
    viscosity = fluid.density * walther_viscosity(numbers, fluid.temperature)
    return replace(
        fluid,
        walther=numbers,
        viscosity=viscosity,
        source=f"{fluid.source}; viscosity by ASTM D341",
    )


def specific_heat(name: str, temperature: float, pressure: float) -> float:
    """Specific heat at constant pressure [J/kg/K] of a fluid at temperature [K] and absolute pressure [Pa].

    name : as for `properties`. Raises FluidError for "user", which has none.
    """
    name = oil_name(name) or name
    if name == "user":
        raise FluidError("specific_heat", 'heat without specific heat: a "user" fluid has none')
    return (
        oil_specific_heat(temperature)
        if name in OILS
        else cached_specific_heat(name, temperature, pressure)
    )


def _look_up(name: str, law: str, temperature: float, pressure: float) -> dict:
    if name == "user":
        return USER
    if name in OILS:
        return oil_properties(name, temperature, pressure)
    return cached_properties(name, temperature, pressure, law)


def _check_numbers(numbers: dict[str, float], law: str) -> None:
    if law not in LAWS:
        laws = f"{did_you_mean(law, LAWS)}; laws are {', '.join(LAWS)}"
        raise FluidError("law", f'"{law}" is an unknown density law{laws}')
    for key, value in numbers.items():
        if not math.isfinite(value) or value < 0.0 or (value == 0.0 and key != "vapor_pressure"):
            least = "of 0 or more" if key == "vapor_pressure" else "above 0"
            raise FluidError(key, f"{value:g} is out of range; expected a finite number {least}")
