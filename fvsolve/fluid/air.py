"""What is mixed into a liquid: free gas, and vapour where cavities are asked for. Knows no law."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fvsolve.errors import FluidError

ATMOSPHERE = 101325.0  # where air_fraction counts [Pa]
AIR_KEYS = ("air_fraction", "gas_exponent", "saturation_pressure", "cavitation")


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

    def gas(self, fluid, floor: float) -> float:
        """Volume of the gas over the liquid's at the reference pressure, times x^(1 / exponent), x = p - floor."""
        x, saturation = ATMOSPHERE - floor, self.saturation_pressure - floor
        liquid = 1.0 - (ATMOSPHERE - fluid.pressure) / fluid.bulk_modulus
        free = self.fraction / (1.0 - self.fraction) * liquid
        return free * x ** (1.0 / self.exponent) / (1.0 - x / saturation)


def mixed(given: dict[str, float]) -> Air:
    """What is mixed in, by the keys given."""
    fraction, cavitation = given.get("air_fraction", 0.0), bool(given.get("cavitation"))
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


def check_cavities(fluid) -> None:
    """Cavities need a vapour that is liquid at 1 atm."""
    if fluid.air is None or not fluid.air.cavitation:
        return
    if fluid.vapor_pressure == 0.0:
        raise FluidError("cavitation", f'needs the vapour pressure of "{fluid.name}"; give vapor_pressure')
    if fluid.vapor_pressure >= ATMOSPHERE:
        raise FluidError("cavitation", f"{fluid.name} boils at 1 atm, where air_fraction counts; leave cavitation out")
