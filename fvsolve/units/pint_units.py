"""Units that are not in `UNITS`, read by pint, which is imported at the first such unit."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from fvsolve.units.spellings import DIMENSIONS, Unit

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
