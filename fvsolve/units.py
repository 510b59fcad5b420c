"""Conversion of text with units to SI numbers and back: dimensions, spellings, factors.

A bare number is in SI. Text is a number and a unit, `"304.8 mm"`. The file data/units.toml states the units; pint reads
other spellings, and is imported at the first of these.
"""

import difflib
import functools
import math
import re
import warnings
from collections.abc import Mapping
from decimal import Decimal, DecimalException
from typing import Any, NamedTuple

import numpy as np

from fvsolve.data import read_table


class Unit(NamedTuple):
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


class Dimension(NamedTuple):
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
    numbers = {
        spelling: given if isinstance(given, list) else [given]
        for spelling, given in spellings.items()
    }
    return {spelling: Unit(dimension, *given, **kinds) for spelling, given in numbers.items()}


_TABLES = read_table("units")
DIMENSIONS = {name: Dimension(**keys) for name, keys in _TABLES["dimensions"].items()}
UNITS: dict[str, Unit] = {
    spelling: unit
    for entry in _TABLES["units"].items()
    for spelling, unit in _units(*entry).items()
}
NEAR_MISSES: dict[str, str] = _TABLES["near_misses"]
LIKELY: dict[str, list[str]] = _TABLES["likely"]
WORDS: dict[str, str] = _TABLES["words"]

_SAFE_SPELLING = re.compile(
    r"\(?[^\W\d]+(?: ?(?:\*\*|\^)? ?-?\d)?\)?(?: ?[*/ ] ?\(?[^\W\d]+(?:(?:\*\*|\^)?-?\d)?\)?){0,5}"
)

BASE = {
    "[length]": "m",
    "[mass]": "kg",
    "[time]": "s",
    "[current]": "A",
    "[temperature]": "K",
    "[substance]": "mol",
    "[luminosity]": "cd",
}


def pint_unit(spelling: str) -> Unit | None:
    """Unit with a spelling that is not in `UNITS`, read by pint; None if pint cannot read it."""
    if _NEGATIVE_POWER.search(spelling):  # pint subtracts in "m s-1"
        spelling = _for_pint(_canonical(spelling))
    if not _SAFE_SPELLING.fullmatch(spelling):  # pint would compute 9**9**9
        return None
    import pint

    registry = pint.get_application_registry()
    try:
        unit_value = registry.Quantity(1.0, registry.parse_units(spelling)).to_base_units()
        zero_value = registry.Quantity(0.0, registry.parse_units(spelling)).to_base_units()
    except Exception:
        # pint raises errors of many families; whichever, it does not know the spelling
        return None
    factor = float(unit_value.magnitude - zero_value.magnitude)
    if not (math.isfinite(factor) and factor > 0):
        return None
    for name, dimension in DIMENSIONS.items():
        si = (
            dimension.si.replace("-", "")
            .replace("m2", "m**2")
            .replace("m3", "m**3")
            .replace("s2", "s**2")
        )
        if not dimension.base and registry.Quantity(1.0, si.replace(" ", "*")).check(
            unit_value.dimensionality
        ):
            return Unit(name, factor, offset=float(zero_value.magnitude) / factor)
    return Unit(f"quantity of [{base_units(unit_value.dimensionality)}]", factor)


def powers_of_base_units(si: str) -> dict[str, int]:
    """Powers of the base units in an SI unit of `DIMENSIONS`, such as {"kg": 1, "m": -1, "s": -2} for "Pa"."""
    import pint

    unit = pint.get_application_registry().parse_units("" if si == "-" else _for_pint(si))
    return {BASE[name]: int(power) for name, power in unit.dimensionality.items()}


def base_units(dimensionality: Mapping[str, float]) -> str:
    """Text of the base units of a quantity, such as "kg·m²/s³", sorted in numerator and denominator.

    dimensionality : pint's dimension, such as "[length]" -> power. Pint's own order changes with its version.
    """
    powers = sorted((BASE.get(name, name), power) for name, power in dimensionality.items())
    over = "·".join(unit + superscript(power) for unit, power in powers if power > 0) or "1"
    return "/".join([over, *(unit + superscript(-power) for unit, power in powers if power < 0)])


def superscript(power: float) -> str:
    """Text of a power in superscript digits; empty for 1."""
    return (
        "" if power == 1 else f"{power:g}".translate(str.maketrans("0123456789.-", "⁰¹²³⁴⁵⁶⁷⁸⁹·⁻"))
    )


__all__ = [
    "DIMENSIONS",
    "UNITS",
    "Dimension",
    "Kinematic",
    "Unit",
    "begins_as_quantity",
    "convert",
    "find",
    "unit_of",
    "is_number_with_unit",
    "likely",
    "parse",
    "plain_numbers",
    "show",
    "span",
    "vacuum",
    "expected",
]

LONGEST = 100  # greatest length of a unit [characters]
SIGNS = (
    ("²", "2"),
    ("³", "3"),
    ("¹", "1"),
    ("⁻", "-"),
    ("µ", "u"),
    ("μ", "u"),
    ("°", "deg"),
    ("·", " "),
    ("*", " "),
)
# Least and greatest magnitude of a number other than 0 [SI]: fifth powers and quotients of such numbers stay finite.
MIN_NUMBER, MAX_NUMBER = 1e-30, 1e30
WATER_DENSITY = 1000.0  # [kg/m3]
LONGEST_TEXT = 300  # greatest length of a number with a unit [characters]
_NUMBER = re.compile(r"([+-]?(?:\d[\d_]*(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*)", re.DOTALL)
_NEGATIVE_POWER = re.compile(r"(?<=[A-Za-z])\^?(?:\*\*)?[-⁻](?=[\d¹²³])")
_PLAIN_NUMBER = re.compile(
    r"[+-]?(?:(?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d+)?|nan|inf(?:inity)?)", re.ASCII | re.IGNORECASE
)


def parse(given: Any, dimension: str) -> Any:
    """SI value of a bare number, or of text with a number and a unit.

    For the dimensions "pressure" and "gauge_pressure" the result is (value, True if the unit is a gauge unit).
    For a kinematic viscosity, where `dimension` is "viscosity", it is a `Kinematic` [m2/s].
    Raises ValueError with the text found, the dimension expected and a suggestion.
    """
    if isinstance(given, str):
        value, unit = _parse_text(given, dimension)
    else:
        value, unit = _parse_number(given, dimension), None
    if not is_possible(value):
        raise ValueError(magnitude_fault(value, given, expected(dimension)))
    if may_be_gauge(dimension):
        return value, unit is not None and unit.gauge
    if unit is not None and unit.dimension == "kinematic viscosity" and dimension == "viscosity":
        return Kinematic(value)
    return value


def may_be_gauge(dimension: str) -> bool:
    """True if values of a dimension may be absolute or gauge pressures."""
    return (DIMENSIONS[dimension].base or dimension) == "pressure" and DIMENSIONS[dimension].gauge


def is_possible(value: float) -> bool:
    """True if a number is 0, or neither so large nor so small that products or quotients overflow."""
    return value == 0.0 or MIN_NUMBER <= abs(value) <= MAX_NUMBER


def are_possible(values: np.ndarray) -> np.ndarray:
    """`is_possible` for each number of an array."""
    size = np.abs(values)
    return (size == 0.0) | ((size >= MIN_NUMBER) & (size <= MAX_NUMBER))


def magnitude_fault(value: float, given: Any, remedy: str) -> str:
    """Text of the fault of a number that is not possible.

    given : the number as written in the file; remedy : end of the message
    """
    if not math.isfinite(value):
        return f"{show(given)} is not finite; {remedy}"
    limit = f"above {MAX_NUMBER:g}" if abs(value) > MAX_NUMBER else f"below {MIN_NUMBER:g}"
    results = "products" if abs(value) > MAX_NUMBER else "quotients"
    return f"{show(given)} has a magnitude {limit} in SI units, where {results} overflow; {remedy}"


def parse_ratio(given: Any, over: str, under: str) -> float:
    """SI value of a bare number, or of text with a number and a unit of the dimension `over` per dimension `under`.

    Raises ValueError with the unit expected.
    """
    si = f"{DIMENSIONS[over].si} / ({DIMENSIONS[under].si})"
    return parse_in(given, si, f"expected a number in {_readable(over, under)}")


def parse_in(given: Any, si: str, remedy: str) -> float:
    """SI value of a bare number, or of text with a number and a unit of the same dimension as the unit `si`.

    remedy : end of messages. Raises ValueError with it.
    """
    if not isinstance(given, str):
        value = _parse_number(given, "number")
    else:
        import pint

        match = _split(given)
        if match is None:
            raise ValueError(f"{show(given)} is not a number with a unit; {remedy}")
        number, spelling = match[1], _canonical(match[2])
        if re.match(r",\d", spelling):
            raise ValueError(comma_text(given))
        bare = spelling.removeprefix("1/").replace("%", "percent")
        if spelling and not _SAFE_SPELLING.fullmatch(bare):
            raise ValueError(f"{show(given)}: unknown unit {show(spelling)}; {remedy}")
        registry = pint.get_application_registry()
        try:
            unit = (
                registry.Quantity(1.0, registry.parse_units(_for_pint(bare)))
                if bare
                else registry.Quantity(1.0)
            )
        except Exception:  # pint raises errors of many families
            raise ValueError(f"{show(given)}: unknown unit {show(spelling)}; {remedy}") from None
        unit = 1.0 / unit if spelling.startswith("1/") else unit
        expected_unit = registry.Quantity(1.0, registry.parse_units(_for_pint(si)))
        if unit.dimensionality != expected_unit.dimensionality:
            raise ValueError(f"{show(given)} has the unit {spelling or '1'}; {remedy}")
        value = float(number) * float(unit.to_base_units().magnitude)
    if not is_possible(value):
        raise ValueError(magnitude_fault(value, given, remedy))
    return value


def plain_numbers(text: str, line: int = 1) -> Any:
    """Numbers of a text, separated by blanks and line ends : float64[n].

    line : number of the first line. Raises ValueError with the first text that is not a number, and its line.
    """
    import numpy as np

    if not text or text.isspace():  # NumPy reads blanks as a number
        return np.empty(0)
    try:
        with warnings.catch_warnings():
            # of NumPy before 2.4, for a text that is not a number
            warnings.simplefilter("error", DeprecationWarning)
            return np.fromstring(text, sep=" ")
    except (ValueError, DeprecationWarning):
        faulty = next(
            (item for item in re.finditer(r"\S+", text) if not _PLAIN_NUMBER.fullmatch(item[0])),
            None,
        )
    if faulty is None:
        raise ValueError("the numbers cannot be read")
    comma = re.match(r"[+-]?\d[\d.]*,\d", faulty[0])
    fault = comma_text(faulty[0]) if comma else f"{show(faulty[0])} is not a number"
    raise ValueError(f"line {line + text.count(chr(10), 0, faulty.start())}: {fault}")


def _split(text: str) -> re.Match[str] | None:
    """Match with the number and the unit of a text; None for a text without a number at its start, or a long text."""
    return _NUMBER.fullmatch(text.strip()) if len(text) <= LONGEST_TEXT else None


def is_number_with_unit(text: str) -> bool:
    """True if a text is a number and a spelling that may be that of a unit, such as "12 m3/h", and not a formula."""
    signs = (" + ", " - ", "<", ">", "=", "(", "*", ",")
    return begins_as_quantity(text) and not any(sign in text.replace("**", "") for sign in signs)


def begins_as_quantity(text: str) -> bool:
    """True if a text begins with a number and the letter of a unit."""
    match = _split(text)
    return match is not None and bool(match[2]) and match[2][0] not in "*/+-^<>=!("


def _readable(over: str, under: str) -> str:
    """Unit of the dimension `over` per dimension `under`, such as "1/m" or "m3/s per Pa"."""
    top, bottom = DIMENSIONS[over].si, DIMENSIONS[under].si
    if bottom == "-":
        return top if top != "-" else "1, without a unit"
    return (
        f"1/{bottom}"
        if top == "-" and " " not in bottom and "/" not in bottom
        else f"{top} per {bottom}"
    )


def _for_pint(spelling: str) -> str:
    """Spelling of a unit for pint: `m3/s / (N m)` is `m**3/s/(N*m)`."""
    text = re.sub(
        r"\s*/\s*", "/", spelling.replace("-", "1") if spelling.startswith("-") else spelling
    )
    text = re.sub(r"([A-Za-z])(-?\d)", r"\1**\2", text.replace("(-)", "1"))
    return re.sub(r"(?<=[\w)]) +(?=[\w(])", "*", text)


class Kinematic(float):
    """A kinematic viscosity [m2/s], not yet multiplied by a density."""


@functools.lru_cache(maxsize=1024)
def _known_unit(spelling: str, dimension: str) -> Unit | None:
    """Unit of the table with a given spelling that measures `dimension` and may be written there; else None.

    Schedules repeat few units in many values.
    """
    unit, base = _table_unit(spelling) if len(spelling) <= LONGEST else None, DIMENSIONS[dimension]
    if unit is None or unit.dimension not in (base.base or dimension, dimension):
        return None
    refused = (dimension == "gauge_pressure" and unit.absolute) or (unit.gauge and not base.gauge)
    return None if refused else unit


def find(spelling: str, dimension: str, number: str = "") -> Unit:
    """Unit with a given spelling that measures `dimension`; for "viscosity" also a unit of kinematic viscosity.

    Raises ValueError with a suggestion if the spelling is unknown, or belongs to a unit of another dimension, or to a
    gauge or absolute unit where the dimension does not allow it.
    number : text of the number before the unit, for the message
    """
    if (known := _known_unit(spelling, dimension)) is not None:
        return known
    if len(spelling) > LONGEST:  # pint would take minutes to read it
        text = f"{show(f'{number} {spelling}'.strip())}: unknown unit of {len(spelling)} letters; {expected(dimension)}"
        raise ValueError(text)
    base = DIMENSIONS[dimension].base or dimension
    unit = _table_unit(spelling)
    if unit is None:
        folded = _canonical(spelling).casefold().replace(" ", "")
        for known in _spellings(dimension):
            if known.casefold().replace(" ", "") == folded:
                raise ValueError(
                    f"unknown unit {show(spelling)}; did you mean {show((number + ' ' + known).strip())}?"
                )
        unit = pint_unit(spelling) if _canonical(spelling) not in NEAR_MISSES else None
    text = show(f"{number} {spelling}".strip())
    suggested = NEAR_MISSES.get(_canonical(spelling)) or NEAR_MISSES.get(
        _without_words(_canonical(spelling)), ""
    )
    if unit is None:
        if not suggested or UNITS[suggested].dimension != base:
            close = difflib.get_close_matches(_canonical(spelling), _spellings(dimension), n=1)
            suggested = close[0] if close else ""
        hint = (
            f"did you mean {show((number + ' ' + suggested).strip())}?"
            if suggested
            else expected(dimension)
        )
        raise ValueError(f"{text}: unknown unit {show(spelling)}; {hint}")
    kinematic = dimension == "viscosity" and unit.dimension == "kinematic viscosity"
    if unit.dimension not in (base, dimension) and not kinematic:
        hint = expected(dimension)
        if suggested and UNITS[suggested].dimension == base:
            hint = f"expected {DIMENSIONS[dimension].words}; did you mean {show((number + ' ' + suggested).strip())}?"
        words = (
            DIMENSIONS[unit.dimension].words
            if unit.dimension in DIMENSIONS
            else f"a {unit.dimension}"
        )
        raise ValueError(f"{text} is {words}; {hint}")
    if dimension == "gauge_pressure" and unit.absolute:
        raise ValueError(
            f"{text} is an absolute pressure; expected a gauge pressure, for example {show('5 barg')}"
        )
    if unit.gauge and not DIMENSIONS[dimension].gauge:
        raise ValueError(f"{text} is a gauge pressure; {expected(dimension)}")
    return unit


def unit_of(spelling: str) -> Unit | None:
    """Unit with a given spelling, from the table or from pint; None if there is none."""
    return (_table_unit(spelling) or pint_unit(spelling)) if 0 < len(spelling) <= LONGEST else None


def is_unit(spelling: str) -> bool:
    """True for the spelling of a unit in `UNITS`."""
    return len(spelling) <= LONGEST and _table_unit(spelling) is not None


def vacuum(
    given: Any, pressure: float, vapor_pressure: float = 0.0, ambient: float = 101325.0
) -> str:
    """Text of a message about a given pressure that is too low for a liquid; pressure : its value in Pa, absolute

    vapor_pressure : of the fluid [Pa]; ambient : ambient pressure [Pa]
    """
    below = (
        "a vacuum" if pressure <= 0 else f"not above the vapour pressure of {vapor_pressure:.4g} Pa"
    )
    match = _split(given) if isinstance(given, str) else None
    number, spelling = match.groups() if match else (str(given), "Pa")
    if spelling in UNITS and UNITS[spelling].gauge:
        return f"{show(given)} is {pressure:.4g} Pa absolute, {below}"
    gauge = f"{spelling}g" in UNITS and pressure + ambient > vapor_pressure
    hint = f"; did you mean {show(f'{number} {spelling}g')}?" if gauge else ""
    return f"{show(given)} is absolute, {below}{hint}"


def convert(value_si: Any, dimension: str, unit: str, ambient: float = 101325.0) -> Any:
    """Value or array in `unit`, from an SI value or array.

    In a gauge unit, an absolute pressure becomes a pressure relative to `ambient` [Pa].
    """
    target = find(unit, dimension)
    if target.gauge and dimension == "pressure":
        value_si = value_si - ambient
    return target.number(value_si)


def span(unit: str) -> str:
    """Unit of a difference of two values in `unit`: "bar" for "barg" and for "bara"."""
    entry = _table_unit(unit)
    return _canonical(unit)[:-1] if entry is not None and (entry.gauge or entry.absolute) else unit


def likely(given: Any, dimension: str, least: float, greatest: float) -> str:
    """Text '; did you mean "304.8 mm"?': the number of `given` with a unit that gives a usual value; else empty text.

    least, greatest : usual range of the quantity [SI]
    """
    match = _split(given) if isinstance(given, str) else None
    number, spelling = match.groups() if match else (f"{given:g}", DIMENSIONS[dimension].si)
    units = [
        unit
        for unit in LIKELY.get(DIMENSIONS[dimension].base or dimension, ())
        if unit != _canonical(spelling)
    ]
    weights = {"cSt": WATER_DENSITY}  # a kinematic viscosity instead of a dynamic one
    fit = [
        unit
        for unit in units
        if least <= weights.get(unit, 1.0) * UNITS[unit].si(float(number)) <= greatest
    ]
    fit = [show(f"{number} {unit}") for unit in fit[: 2 if dimension == "viscosity" else 1]]
    return f"; did you mean {' or '.join(fit)}?" if fit else ""


def expected(dimension: str) -> str:
    """Text 'expected a length, for example "300 mm"' for a dimension."""
    words, example = DIMENSIONS[dimension].words, DIMENSIONS[dimension].example
    return f"expected {words}, for example {example if dimension == 'number' else show(example)}"


def show(given: Any) -> str:
    """Text of a value as it stands in a case file, cut to 60 characters."""
    if isinstance(given, bool):
        return str(given).lower()
    try:
        text = f'"{given}"' if isinstance(given, str) else repr(given)
    except ValueError:  # of Python, for whole numbers of more than 4300 digits
        text = "a whole number of thousands of digits"
    return text if len(text) <= 60 else text[:57] + "..."


def _parse_number(given: Any, dimension: str) -> float:
    if isinstance(given, bool) or not isinstance(given, (int, float)):
        kind = {bool: "true or false", dict: "a table", list: "a list"}.get(
            type(given), f"a {type(given).__name__}"
        )
        raise ValueError(f"{show(given)} is {kind}; {expected(dimension)}")
    try:
        return float(given)
    except OverflowError:
        return math.inf


def comma_text(text: str) -> str:
    """Text of the fault of a number with a comma: the last of comma and point is the decimal sign."""
    number = re.match(r"[^\d]*[\d.,]*", text)[0]
    decimal, other = (",", ".") if number.rfind(",") > number.rfind(".") else (".", ",")
    corrected = number.replace(other, "").replace(decimal, ".") + text.removeprefix(number)
    return f"{show(text)} has a comma; did you mean {show(corrected)}?"


def _parse_text(text: str, dimension: str) -> tuple[float, Unit | None]:
    if len(text) > LONGEST_TEXT:
        count = f"{len(text)} letters, more than a number with its unit"
        raise ValueError(f"{show(text)} has {count}; {expected(dimension)}")
    match = _split(text.replace("\N{MINUS SIGN}", "-"))
    if match is None:
        raise ValueError(f"{show(text)} is not a number with a unit; {expected(dimension)}")
    number, spelling = match.groups()
    if not spelling:
        if dimension != "number":
            si = DIMENSIONS[dimension].si
            raise ValueError(
                f'{show(text)} has no unit; did you mean "{number} {si}", or the bare number {number}?'
            )
        return float(number), None
    if re.match(r",\d", spelling):
        raise ValueError(comma_text(text))
    unit = find(spelling, dimension, number)
    return unit.read(number), unit


def _spellings(dimension: str) -> list[str]:
    base = DIMENSIONS[dimension].base or dimension
    names = [name for name, unit in UNITS.items() if unit.dimension in (base, dimension)]
    return [name for name in names if DIMENSIONS[dimension].gauge or not UNITS[name].gauge]


def _table_unit(spelling: str) -> Unit | None:
    """Unit of the table `UNITS` with a given spelling, with words in place of symbols too; None if there is none."""
    text = _canonical(spelling)
    return UNITS.get(text) or UNITS.get(_without_words(text))


def _without_words(spelling: str) -> str:
    """Spelling of a unit with symbols in place of words: "metres per second" is "m/s"."""
    text = re.sub(r" per (?=[A-Za-z])", "/", spelling)
    return re.sub(r"[A-Za-z_]+", lambda match: WORDS.get(match[0].lower(), match[0]), text)


@functools.lru_cache(maxsize=1024)
def _canonical(spelling: str) -> str:
    """Spelling as in `UNITS`: `m^3 / h`, `m³/h` and `m3 h-1` are `m3/h`; `Pa.s` is `Pa s`."""
    text = spelling.strip().replace("**", "").replace("^", "")
    for old, new in SIGNS:
        text = text.replace(old, new)
    text = re.sub(r"(?<=[A-Za-z0-9])\.(?=[A-Za-z])", " ", text)
    gauge = re.fullmatch(r"([A-Za-z0-9]+) ?\(([ag])\)", text)
    text = gauge[1] + gauge[2] if gauge else text
    return _without_negative_powers(re.sub(r"\s+", " ", re.sub(r"\s*/\s*", "/", text)))


def _without_negative_powers(spelling: str) -> str:
    """Spelling of a unit with slashes in place of negative powers, after CF and udunits: `kg m-2 s-1` is `kg/m2/s`."""
    if not _NEGATIVE_POWER.search(spelling) or any(sign in spelling for sign in "/()"):
        return spelling
    factors = [
        (factor, re.fullmatch(r"([A-Za-z_]+)-(\d)", factor)) for factor in spelling.split(" ")
    ]
    above = " ".join(factor for factor, power in factors if power is None)
    below = [
        power[1] + ("" if power[2] == "1" else power[2])
        for _, power in factors
        if power is not None
    ]
    return "/".join([above or "1", *below])


def celsius(temperature: float) -> str:
    """Text of a temperature in degC, such as "20 degC"; temperature : [K]"""
    return f"{temperature - 273.15:.6g} degC"
