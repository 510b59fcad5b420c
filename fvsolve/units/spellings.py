"""Dimensions and units: spellings and factors to SI.

The file data/units.toml states them; pint reads other spellings, and is imported at the first of these.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal, DecimalException
from typing import Any

from fvsolve.data import read_table


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


def _units(dimension: str, spellings: dict[str, Any]) -> dict[str, Unit]:
    """Units of a dimension, or of "gauge" or "absolute" pressure : spelling -> unit."""
    kinds = {kind: dimension == kind for kind in ("gauge", "absolute")}
    dimension = "pressure" if any(kinds.values()) else dimension
    numbers = {spelling: given if isinstance(given, list) else [given] for spelling, given in spellings.items()}
    return {spelling: Unit(dimension, *given, **kinds) for spelling, given in numbers.items()}


_TABLES = read_table("units")
DIMENSIONS = {name: Dimension(**keys) for name, keys in _TABLES["dimensions"].items()}
UNITS: dict[str, Unit] = {
    spelling: unit for entry in _TABLES["units"].items() for spelling, unit in _units(*entry).items()
}
NEAR_MISSES: dict[str, str] = _TABLES["near_misses"]
LIKELY: dict[str, list[str]] = _TABLES["likely"]

_SAFE_SPELLING = re.compile(
    r"\(?[^\W\d]+(?: ?(?:\*\*|\^)? ?-?\d)?\)?(?: ?[*/ ] ?\(?[^\W\d]+(?:(?:\*\*|\^)?-?\d)?\)?){0,5}"
)

BASE = {
    "[length]": "m", "[mass]": "kg", "[time]": "s", "[current]": "A", "[temperature]": "K", "[substance]": "mol",
    "[luminosity]": "cd",
}  # fmt: skip


def pint_unit(spelling: str) -> Unit | None:
    """Unit with a spelling that is not in `UNITS`, read by pint; None if pint cannot read it."""
    if not _SAFE_SPELLING.fullmatch(spelling):  # pint would compute 9**9**9
        return None
    import pint

    registry = pint.get_application_registry()
    try:
        unit_value = registry.Quantity(1.0, registry.parse_units(spelling)).to_base_units()
        zero_value = registry.Quantity(0.0, registry.parse_units(spelling)).to_base_units()
    except Exception:  # pint raises errors of many families; whichever, it does not know the spelling
        return None
    factor = float(unit_value.magnitude - zero_value.magnitude)
    if not (math.isfinite(factor) and factor > 0):
        return None
    for name, dimension in DIMENSIONS.items():
        si = dimension.si.replace("-", "").replace("m2", "m**2").replace("m3", "m**3").replace("s2", "s**2")
        if not dimension.base and registry.Quantity(1.0, si.replace(" ", "*")).check(unit_value.dimensionality):
            return Unit(name, factor, offset=float(zero_value.magnitude) / factor)
    return Unit(f"quantity of [{base_units(unit_value.dimensionality)}]", factor)


def base_units(dimensionality: Mapping[str, float]) -> str:
    """Text of the base units of a quantity, such as "kg·m²/s³", sorted in numerator and denominator.

    dimensionality : pint's dimension, such as "[length]" -> power. Pint's own order changes with its version.
    """
    powers = sorted((BASE.get(name, name), power) for name, power in dimensionality.items())
    over = "·".join(unit + superscript(power) for unit, power in powers if power > 0) or "1"
    return "/".join([over, *(unit + superscript(-power) for unit, power in powers if power < 0)])


def superscript(power: float) -> str:
    """Text of a power in superscript digits; empty for 1."""
    return "" if power == 1 else f"{power:g}".translate(str.maketrans("0123456789.-", "⁰¹²³⁴⁵⁶⁷⁸⁹·⁻"))
