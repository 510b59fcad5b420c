"""Free gas in a liquid, and vapour in cavities."""

import math
from dataclasses import dataclass

from fvsolve.errors import FluidError

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
        raise FluidError("air_fraction", f"{fraction:g} is not a volume fraction; expected at least 0 and below 1")
    if cavitation and fraction == 0.0:
        raise FluidError(
            "cavitation", "needs free gas, from which cavities grow; try `air_fraction = 1e-7` for a degassed liquid"
        )
    exponent, saturation = given.get("gas_exponent", 1.0), given.get("saturation_pressure", math.inf)
    if not 1.0 <= exponent <= 2.0:
        raise FluidError("gas_exponent", f"{exponent:g} is out of range; expected a value between 1 (isothermal) and 2")
    if cavitation and exponent != 1.0:
        raise FluidError("gas_exponent", f"{exponent:g} is not 1; with cavitation the gas is isothermal, expected 1")
    if saturation <= ATMOSPHERE:
        raise FluidError(
            "saturation_pressure",
            f"{saturation:g} Pa is not above 1 atm, the pressure to which `air_fraction` refers; "
            f"expected more than {ATMOSPHERE:g} Pa",
        )
    return Air(fraction, exponent, saturation, cavitation)


def check_cavities(fluid) -> None:
    """Raise FluidError if `cavitation` is true for a fluid without vapour pressure, or for one that boils at 1 atm."""
    if fluid.air is None or not fluid.air.cavitation:
        return
    if fluid.vapor_pressure == 0.0:
        raise FluidError("cavitation", f'needs the vapour pressure of "{fluid.name}"; give the key `vapor_pressure`')
    if fluid.vapor_pressure >= ATMOSPHERE:
        raise FluidError(
            "cavitation",
            f"{fluid.name} boils at 1 atm, the pressure to which `air_fraction` refers; leave out the key `cavitation`",
        )
