"""Mineral hydraulic oils by ISO viscosity grade, with the numbers of their sources (docs/fluids.md).

Viscosity: Walther's equation (ASTM D341) through 40 and 100 degC. Density: ASTM D1250 for lubricating oils, from the
value at 15 degC. Compressibility: Tait's equation of an HLP 32 for all grades, made isentropic by
1/K_s = 1/K_T - T a^2 / (rho cp): bulk moduli K at constant entropy (s) and temperature (T), thermal expansion a.
"""

import math
import re
from dataclasses import dataclass
from typing import Any

from fvsolve.errors import FluidError

# words for oils that name none of them
OIL_WORDS = ("oil", "hydraulic oil", "mineral oil", "hydraulic fluid", "hlp", "hm", "iso vg", "vg")
ASTM_D341 = "astm-d341"  # name of Walther's equation in case files
ZERO, ATMOSPHERE = 273.15, 1.01325  # [K], [bar]
# range of the sources [K], [Pa]
MIN_TEMPERATURE, MAX_TEMPERATURE, MAX_PRESSURE = 273.15, 373.15, 1e8


@dataclass(frozen=True)
class Oil:
    """Oil: kinematic viscosity at 40 and 100 degC [mm2/s], density at 15 degC and 1 atm [kg/m3]."""

    viscosity_40: float
    viscosity_100: float
    density_15: float


OILS = {  # ISO 3448 mid-point, viscosity index 100 by ASTM D2270, typical density of a data sheet
    "ISO VG 32": Oil(32.0, 5.36, 871.0),
    "ISO VG 46": Oil(46.0, 6.76, 876.0),
    "ISO VG 68": Oil(68.0, 8.73, 881.0),
}
# K1 of lubricating oils, ASTM D1250-80: thermal expansion at 15 degC is K1 / density [kg/m3/K]
EXPANSION = 0.6278
# C, b0 [bar], b1 [bar/K]: rho = rho(1 bar) / (1 - C ln((b + p) / b)), b = b0 + b1 T
TAIT_COEFFICIENTS = 0.0732965, 1965.02, -2.96813
HEAT_CAPACITY = 1895.4, 2118.1  # cp at 25 and 80 degC [J/kg/K]


def oil_name(name: str) -> str | None:
    """Name of the grade of an oil: `ISO VG 46` for "ISO-VG46", "VG 46", "HLP 46" or "HM 46"; None for other fluids.

    Raises FluidError for a grade without data.
    """
    match = re.fullmatch(r"(?:ISO[\s-]*VG|VG|HLP|HM)[\s-]*(\d+)", name.strip(), re.IGNORECASE)
    if match is None:
        return None
    grade = f"ISO VG {match[1]}"
    if grade not in OILS:
        raise FluidError(
            "name",
            f'"{name}" is an unknown oil; expected one of {", ".join(OILS)}, or a "user" fluid',
        )
    return grade


def oil_properties(name: str, temperature: float, pressure: float) -> dict[str, Any]:
    """Fields of `Fluid` for an oil at temperature [K] and pressure [Pa].

    Raises FluidError outside the range of the data.
    """
    if not MIN_TEMPERATURE <= temperature <= MAX_TEMPERATURE:
        text = f"{temperature - ZERO:.6g} degC"
        raise FluidError(
            "temperature", f"{text} is outside the range of {name}, 0 degC to 100 degC"
        )
    if pressure > MAX_PRESSURE:
        raise FluidError(
            "pressure", f"{pressure:g} Pa is above the range of {name}, up to {MAX_PRESSURE:g} Pa"
        )
    oil, p = OILS[name], pressure / 1e5
    expansion, rho = density_1atm(oil, temperature)
    c, b = TAIT_COEFFICIENTS[0], TAIT_COEFFICIENTS[1] + TAIT_COEFFICIENTS[2] * temperature
    rho /= 1.0 - c * math.log((b + p) / (b + ATMOSPHERE))
    isothermal = 1e5 * (b + p) / c * (1.0 - c * math.log((b + p) / b))
    cp = oil_specific_heat(temperature)
    isentropic = 1.0 / (1.0 / isothermal - temperature * expansion**2 / (rho * cp))
    values = dict(density=rho, bulk_modulus=isentropic, viscosity=rho * walther(oil, temperature))
    return values | dict(vapor_pressure=0.0, table=None, source="docs/fluids.md, oils")


def walther_points(name: str) -> tuple[tuple[float, float], ...]:
    """Points (temperature [K], kinematic viscosity [m2/s]) of an oil, by its grade; empty for other fluids."""
    if name not in OILS:
        return ()
    return (ZERO + 40.0, 1e-6 * OILS[name].viscosity_40), (
        ZERO + 100.0,
        1e-6 * OILS[name].viscosity_100,
    )


def walther_numbers(points: tuple[tuple[float, float], ...]) -> tuple[float, float]:
    """(a, b) of log10(log10(nu + 0.7)) = a - b log10(T), nu in mm2/s, through two points (T [K], nu [m2/s]).

    Raises FluidError where the equation does not hold.
    """
    if min(nu for _, nu in points) <= 3e-7:
        raise FluidError(
            "viscosity", "a point has a viscosity of 0.3 cSt or less, where ASTM D341 does not hold"
        )
    (cold, first), (hot, last) = (
        (math.log10(t), math.log10(math.log10(1e6 * nu + 0.7))) for t, nu in points
    )
    slope = (first - last) / (hot - cold)
    if slope <= 0.0:
        raise FluidError(
            "viscosity", "the viscosity of the points rises with temperature; expected a fall"
        )
    return first + slope * cold, slope


def walther_viscosity(numbers: tuple[float, float], temperature: float) -> float:
    """Kinematic viscosity [m2/s] at a temperature [K]; numbers : of `walther_numbers`"""
    return 1e-6 * (10.0 ** (10.0 ** (numbers[0] - numbers[1] * math.log10(temperature))) - 0.7)


def oil_specific_heat(temperature: float) -> float:
    """Specific heat of all oils at a temperature [K]: cp [J/kg/K], linear between 25 and 80 degC and beyond."""
    return (
        HEAT_CAPACITY[0]
        + (HEAT_CAPACITY[1] - HEAT_CAPACITY[0]) * (temperature - ZERO - 25.0) / 55.0
    )


def density_1atm(oil: Oil, temperature: float) -> tuple[float, float]:
    """(thermal expansion [1/K], density [kg/m3]) at 1 atm: rho = rho_15 exp(-a dt (1 + 0.8 a dt)), ASTM D1250.

    rho_15, a : density and thermal expansion at 15 degC; dt : temperature above 15 degC [K]
    """
    a, dt = EXPANSION / oil.density_15, temperature - ZERO - 15.0
    return a * (1.0 + 1.6 * a * dt), oil.density_15 * math.exp(-a * dt * (1.0 + 0.8 * a * dt))


def walther(oil: Oil, temperature: float) -> float:
    """Kinematic viscosity [m2/s] at 1 atm by ASTM D341: log10(log10(nu + 0.7)) is linear in log10(T), nu in mm2/s."""
    cold, hot = (math.log10(math.log10(nu + 0.7)) for nu in (oil.viscosity_40, oil.viscosity_100))
    share = math.log(temperature / (ZERO + 40.0)) / math.log((ZERO + 100.0) / (ZERO + 40.0))
    return 1e-6 * (10.0**10.0 ** (cold + share * (hot - cold)) - 0.7)
