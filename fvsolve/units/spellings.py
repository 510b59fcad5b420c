"""Dimensions and units: their spellings, and their factors to SI."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal, DecimalException
from typing import Any


@dataclass(frozen=True)
class Unit:
    """A unit: SI value = (number + offset) numerator / denominator.

    gauge : True for pressures relative to ambient pressure; absolute : True if the spelling states an absolute pressure
    In a pressure unit that is neither, such as `bar`, a value may be absolute, gauge or a difference, as the dimension
    requires.
    """

    dimension: str
    numerator: float
    denominator: float = 1
    offset: float = 0
    gauge: bool = False
    absolute: bool = False

    def si(self, number: Any) -> Any:
        """SI value of a number or array in this unit; in a gauge unit it remains a gauge pressure."""
        return (number + self.offset) * self.numerator / self.denominator

    def read(self, number: str) -> float:
        """SI value of the text of a decimal number in this unit, rounded only once: "0.26" in mm is 0.00026."""
        try:
            exact = (Decimal(number) + Decimal(repr(self.offset))) * Decimal(repr(self.numerator))
            return float(exact / Decimal(repr(self.denominator)))
        except DecimalException:
            return math.inf if float(number) != 0 else 0.0

    def number(self, si: Any) -> Any:
        """Number or array in this unit, from an SI value or array `si`; for a gauge unit, `si` is a gauge pressure."""
        return si * self.denominator / self.numerator - self.offset


@dataclass(frozen=True)
class Dimension:
    """A dimension: words for messages, SI unit and example of a value.

    base : dimension whose units it uses, "" if it has units of its own; gauge : True if gauge units are allowed
    """

    words: str
    si: str
    example: str
    base: str = ""
    gauge: bool = False


DIMENSIONS = {
    "length": Dimension("a length", "m", "300 mm"),
    "head": Dimension("a head", "m", "45 m", base="length"),
    "level": Dimension("a level", "m", "2 m", base="length"),
    "area": Dimension("an area", "m2", "18 cm2"),
    "volume": Dimension("a volume", "m3", "50 l"),
    "time": Dimension("a time", "s", "10 ms"),
    "pressure": Dimension("a pressure", "Pa", "5 barg", gauge=True),
    "gauge_pressure": Dimension("a pressure", "Pa", "5 barg", base="pressure", gauge=True),
    "pressure_drop": Dimension("a pressure difference", "Pa", "0.2 bar", base="pressure"),
    "modulus": Dimension("a modulus", "Pa", "210 GPa", base="pressure"),
    "flow": Dimension("a flow", "m3/s", "20 l/s"),
    "velocity": Dimension("a velocity", "m/s", "1.2 m/s"),
    "acceleration": Dimension("an acceleration", "m/s2", "9.81 m/s2"),
    "density": Dimension("a density", "kg/m3", "998 kg/m3"),
    "viscosity": Dimension("a viscosity", "Pa s", "1 mPa s"),
    "temperature": Dimension("a temperature", "K", "20 degC"),
    "number": Dimension("a number", "-", "0.5"),
    "kinematic viscosity": Dimension("a kinematic viscosity", "m2/s", "1 cSt"),
    "diffusivity": Dimension("a diffusivity", "m2/s", "1e-9 m2/s", base="kinematic viscosity"),
    "mass": Dimension("a mass", "kg", "3 kg"),
    "mass flow": Dimension("a mass flow", "kg/s", "3 kg/s"),
    "force": Dimension("a force", "N", "3 N"),
    "energy": Dimension("an energy", "J", "3 J"),
    "power": Dimension("a power", "W", "3 kW"),
    "frequency": Dimension("a frequency", "Hz", "3 Hz"),
    "rate": Dimension("a rate", "1/s", "0.5 1/day", base="frequency"),
    "compliance": Dimension("a compliance", "1/Pa", "0.1 1/GPa"),
    "impedance": Dimension("an impedance", "Pa s/m", "1.5e6 Pa s/m"),
    "position": Dimension("a position", "m", "120 mm", base="length"),
    "stiffness": Dimension("a stiffness", "N/m", "50 N/mm"),
    "damping": Dimension("a damping", "N s/m", "200 N s/m"),
    "leakage": Dimension("a leakage", "m3/s/Pa", "0.1 l/min/bar"),
    "angular_velocity": Dimension("a speed of rotation", "rad/s", "1480 rpm"),
    "torque": Dimension("a torque", "N m", "200 N m"),
    "inertia": Dimension("a moment of inertia", "kg m2", "12 kg m2"),
    "angle": Dimension("an angle", "rad", "3 deg"),
    "rotational_damping": Dimension("a damping of rotation", "N m s", "20 N m s"),
    "momentum": Dimension("a momentum", "N s", "3 N s"),
    "angular_momentum": Dimension("an angular momentum", "kg m2/s", "3 kg m2/s"),
    "charge": Dimension("a charge", "C", "3 C"),
    "capacitance": Dimension("a capacitance", "F", "3 F"),
}

FOOT, INCH = 0.3048, 0.0254
LITRE, GALLON, IMPERIAL_GALLON = 1e-3, 3.785411784e-3, 4.54609e-3
CUBIC_FOOT, ACRE_FOOT = 0.028316846592, 43560 * 0.028316846592
POUND, GRAVITY = 0.45359237, 9.80665
POUND_FORCE = POUND * GRAVITY
PSI = POUND_FORCE / INCH**2
WATER = 1000 * GRAVITY  # one metre of the conventional column of water, 1000 kg/m3 [Pa]
MERCURY = 133.322387415  # one millimetre of mercury, conventional [Pa]
MINUTE, HOUR, DAY = 60, 3600, 86400

# Per dimension: spelling -> numerator, or (numerator, denominator) if only the quotient is exact.
SPELLINGS: dict[str, dict[str, Any]] = {
    "length": {
        "m": 1, "mm": (1, 1000), "cm": (1, 100), "dm": (1, 10), "km": 1000, "um": (1, 10**6),
        "in": INCH, "inch": INCH, "ft": FOOT, "yd": 0.9144, "mi": 1609.344,
    },
    "area": {
        "m2": 1, "cm2": (1, 10**4), "mm2": (1, 10**6), "dm2": (1, 100), "km2": 10**6, "ha": 10**4,
        "in2": INCH**2, "ft2": FOOT**2, "sqft": FOOT**2, "acre": 4046.8564224,
    },
    "volume": {
        "m3": 1, "cm3": (1, 10**6), "mm3": (1, 10**9), "dm3": (1, 1000), "l": (1, 1000), "L": (1, 1000),
        "ml": (1, 10**6), "mL": (1, 10**6), "cl": (1, 10**5), "hl": (1, 10), "Ml": 1000, "ML": 1000,
        "in3": INCH**3, "ft3": CUBIC_FOOT, "gal": GALLON, "impgal": IMPERIAL_GALLON, "acre ft": ACRE_FOOT,
    },
    "time": {
        "s": 1, "ms": (1, 1000), "us": (1, 10**6), "ns": (1, 10**9), "min": MINUTE, "h": HOUR, "hr": HOUR,
        "d": DAY, "day": DAY,
    },
    "pressure": {
        "Pa": 1, "hPa": 100, "kPa": 1000, "MPa": 10**6, "GPa": 10**9, "mbar": 100, "bar": 10**5,
        "kbar": 10**8,
        "atm": 101325, "at": 98066.5, "kgf/cm2": 98066.5, "N/m2": 1, "N/mm2": 10**6, "kN/m2": 1000,
        "psi": PSI, "ksi": 1000 * PSI, "psf": POUND_FORCE / FOOT**2, "lbf/in2": PSI,
        "mH2O": WATER, "cmH2O": WATER / 100, "mmH2O": WATER / 1000, "mwc": WATER, "inH2O": WATER * INCH,
        "ftH2O": WATER * FOOT, "mmHg": MERCURY, "inHg": MERCURY * 25.4, "Torr": (101325, 760),
        "torr": (101325, 760),
    },
    "absolute": {
        "Paa": 1, "kPaa": 1000, "MPaa": 10**6, "mbara": 100, "bara": 10**5, "psia": PSI,
    },
    "gauge": {
        "Pag": 1, "kPag": 1000, "MPag": 10**6, "mbarg": 100, "barg": 10**5, "psig": PSI, "mH2Og": WATER,
    },
    "flow": {
        "m3/s": 1, "m3/min": (1, MINUTE), "m3/h": (1, HOUR), "m3/hr": (1, HOUR), "m3/d": (1, DAY),
        "m3/day": (1, DAY),
        "cmh": (1, HOUR), "CMH": (1, HOUR), "cmd": (1, DAY), "CMD": (1, DAY), "cms": 1, "CMS": 1,
        "l/s": (1, 1000), "L/s": (1, 1000), "lps": (1, 1000), "LPS": (1, 1000),
        "l/min": (1, 60000), "L/min": (1, 60000), "lpm": (1, 60000), "LPM": (1, 60000),
        "l/h": (1, 3600000), "L/h": (1, 3600000), "l/d": (1, 86400000), "L/d": (1, 86400000),
        "ml/s": (1, 10**6), "mL/s": (1, 10**6), "ml/min": (1, 6 * 10**7), "mL/min": (1, 6 * 10**7),
        "cm3/s": (1, 10**6), "cm3/min": (1, 6 * 10**7), "mm3/s": (1, 10**9), "dm3/s": (1, 1000),
        "Ml/d": (1000, DAY), "ML/d": (1000, DAY), "mld": (1000, DAY), "MLD": (1000, DAY),
        "cfs": CUBIC_FOOT, "CFS": CUBIC_FOOT, "ft3/s": CUBIC_FOOT, "cfm": (CUBIC_FOOT, MINUTE),
        "CFM": (CUBIC_FOOT, MINUTE), "ft3/min": (CUBIC_FOOT, MINUTE),
        "gpm": (GALLON, MINUTE), "GPM": (GALLON, MINUTE), "gal/min": (GALLON, MINUTE), "gal/s": GALLON,
        "gpd": (GALLON, DAY), "gph": (GALLON, HOUR), "mgd": (10**6 * GALLON, DAY),
        "MGD": (10**6 * GALLON, DAY),
        "igpm": (IMPERIAL_GALLON, MINUTE), "imgd": (10**6 * IMPERIAL_GALLON, DAY),
        "IMGD": (10**6 * IMPERIAL_GALLON, DAY), "afd": (ACRE_FOOT, DAY), "AFD": (ACRE_FOOT, DAY),
    },
    "velocity": {
        "m/s": 1, "mm/s": (1, 1000), "cm/s": (1, 100), "km/s": 1000, "m/min": (1, MINUTE), "m/h": (1, HOUR),
        "km/h": (1000, HOUR), "ft/s": FOOT, "fps": FOOT, "ft/min": (FOOT, MINUTE), "in/s": INCH,
        "mph": (1609.344, HOUR),
    },
    "acceleration": {"m/s2": 1, "cm/s2": (1, 100), "ft/s2": FOOT},
    "density": {
        "kg/m3": 1, "g/cm3": 1000, "g/ml": 1000, "g/mL": 1000, "kg/l": 1000, "kg/L": 1000,
        "kg/dm3": 1000, "g/l": 1,
        "g/L": 1, "t/m3": 1000, "lb/ft3": POUND / CUBIC_FOOT,
    },
    "viscosity": {
        "Pa s": 1, "mPa s": (1, 1000), "uPa s": (1, 10**6), "P": (1, 10), "cP": (1, 1000), "N s/m2": 1,
        "kg/m/s": 1,
    },
    "kinematic viscosity": {
        "m2/s": 1, "mm2/s": (1, 10**6), "cSt": (1, 10**6), "St": (1, 10**4), "cm2/s": (1, 10**4),
        "ft2/s": FOOT**2,
    },
    "number": {"-": 1, "1": 1, "%": (1, 100)},
    "mass": {"kg": 1, "g": (1, 1000), "mg": (1, 10**6), "t": 1000, "tonne": 1000, "lb": POUND, "lbm": POUND},
    "mass flow": {"kg/s": 1, "g/s": (1, 1000), "kg/min": (1, MINUTE), "kg/h": (1, HOUR), "t/h": (1000, HOUR),
                  "lb/s": POUND},
    "force": {"N": 1, "kN": 1000, "MN": 10**6, "kgf": GRAVITY, "lbf": POUND_FORCE},
    "energy": {"J": 1, "kJ": 1000, "MJ": 10**6, "kWh": 3.6e6},
    "power": {"W": 1, "kW": 1000, "MW": 10**6, "hp": 550 * FOOT * POUND_FORCE},
    "frequency": {"Hz": 1, "kHz": 1000, "1/s": 1, "1/min": (1, MINUTE), "1/h": (1, HOUR), "1/day": (1, DAY)},
    "compliance": {"1/Pa": 1, "1/MPa": (1, 10**6), "1/GPa": (1, 10**9), "1/bar": (1, 10**5), "1/psi": 1 / PSI},
    "impedance": {"Pa s/m": 1},
    "stiffness": {
        "N/m": 1, "N/mm": 1000, "N/um": 10**6, "kN/m": 1000, "kN/mm": 10**6, "MN/m": 10**6,
        "lbf/in": POUND_FORCE / INCH,
    },
    "damping": {
        "N s/m": 1, "N/(m/s)": 1, "kN s/m": 1000, "N s/mm": 1000, "lbf s/in": POUND_FORCE / INCH,
    },
    "leakage": {
        "m3/s/Pa": 1, "l/s/bar": (1, 10**8), "l/min/bar": (1, 6 * 10**9), "L/min/bar": (1, 6 * 10**9),
        "ml/min/bar": (1, 6 * 10**12), "cm3/s/bar": (1, 10**11), "cm3/min/bar": (1, 6 * 10**12),
    },
    "angular_velocity": {"rad/s": 1, "deg/s": (math.pi, 180), "rpm": (math.pi, 30), "RPM": (math.pi, 30)},
    "torque": {
        "N m": 1, "Nm": 1, "kN m": 1000, "kNm": 1000, "lbf ft": POUND_FORCE * FOOT, "lbf in": POUND_FORCE * INCH,
    },
    "inertia": {
        "kg m2": 1, "kgm2": 1, "t m2": 1000, "g m2": (1, 1000), "kg cm2": (1, 10**4), "kg mm2": (1, 10**6),
        "g cm2": (1, 10**7), "g mm2": (1, 10**9), "lb ft2": POUND * FOOT**2, "lb in2": POUND * INCH**2,
        "slug ft2": POUND_FORCE * FOOT,
    },
    "angle": {"rad": 1, "deg": (math.pi, 180)},
    "rotational_damping": {"N m s": 1, "N m s/rad": 1, "Nms": 1, "kN m s": 1000},
    "momentum": {"N s": 1, "kg m/s": 1, "kN s": 1000},
    "angular_momentum": {"kg m2/s": 1},
    "charge": {"C": 1},
    "capacitance": {"F": 1},
}  # fmt: skip


def _table() -> dict[str, Unit]:
    table = {}
    for dimension, spellings in SPELLINGS.items():
        kinds = {kind: dimension == kind for kind in ("gauge", "absolute")}
        for spelling, factor in spellings.items():
            pair = factor if isinstance(factor, tuple) else (factor,)
            table[spelling] = Unit("pressure" if any(kinds.values()) else dimension, *pair, **kinds)
    table["K"] = Unit("temperature", 1)
    table["degC"] = table["celsius"] = Unit("temperature", 1, offset=273.15)
    table["degF"] = Unit("temperature", 5, 9, offset=459.67)
    table["degR"] = Unit("temperature", 5, 9)
    return table


UNITS: dict[str, Unit] = _table()

# Near misses that are units of another dimension, or not units -> suggested unit.
NEAR_MISSES = {
    "C": "degC", "F": "degF", "R": "degR", "deg C": "degC", "deg F": "degF", "degK": "K", "deg": "degC",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "mins": "min", "minute": "min", "minutes": "min",
    "hour": "h", "hours": "h", "days": "d", "meter": "m", "metre": "m", "meters": "m", "metres": "m",
    "feet": "ft",
    "inches": "in", '"': "in", "'": "ft", "kg/cm2": "kgf/cm2", "bars": "bar", "lbs/in2": "psi",
    "PSIG": "psig",
    "m": "mH2O", "ft": "ftH2O", "mWC": "mH2O", "mwg": "mH2O", "cc": "cm3", "litre": "l", "liter": "l",
    "gallon": "gal",
    "gallons/min": "gpm", "usgpm": "gpm", "cusec": "cfs", "cumec": "m3/s", "cumecs": "m3/s",
    "centistokes": "cSt",
    "centipoise": "cP", "kg": "", "kg/s": "", "kg/h": "", "t/h": "",
}  # fmt: skip

# Likely units of a number out of range, likeliest first -> extra factor to SI besides that of the unit: kinematic
# viscosity is multiplied by the density of water.
LIKELY = {
    dimension: dict.fromkeys(units, 1.0) | ({"cSt": 1000.0} if dimension == "viscosity" else {})
    for dimension, units in {
        "length": ("mm", "um", "cm", "m", "in"),
        "area": ("mm2", "cm2", "m2"),
        "volume": ("l", "cm3", "mm3", "m3"),
        "time": ("ms", "s", "us", "min"),
        "pressure": ("GPa", "bar", "MPa", "kPa", "Pa"),
        "velocity": ("m/s", "km/s", "mm/s", "ft/s"),
        "density": ("g/cm3", "kg/m3"),
        "viscosity": ("mPa s",),
        "temperature": ("degC",),
        "mass": ("kg", "g", "t"),
        "power": ("kW", "W", "MW"),
        "inertia": ("kg cm2", "g m2", "kg m2", "t m2"),
        "frequency": ("Hz", "kHz"),
        "angular_velocity": ("rpm",),
        "angle": ("deg",),
    }.items()
}
