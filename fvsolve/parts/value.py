"""Declarations of values of a case file: types, units, ranges."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from fvsolve import units
from fvsolve.errors import did_you_mean, listing
from fvsolve.units import show

ROOT = object()  # in the key path of a fault: the following keys start at the top of the case
NEEDED = object()  # instead of a default: the key is required
UNREAD = object()  # instead of a value: it is stated, but faulty

OF_TIME = re.compile(r"[*/+(-] ?t\b(?![\w.])|(?<![\w.])t ?[*/+)<>^-]")  # formula with the name t
CHANGING = ("control", "formula", "signal", "sum", "time")  # keys of schedules

PLAIN = re.compile(r"[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)? ")  # a number before its unit
GREATEST_WHOLE = 10**15  # of a whole number; floats contain it exactly

# Effect of a changed value on an existing model
VALUE = "value"  # only numbers in its tables change; the initial state stays
# the initial state changes too; sizes, names and whole numbers of the tables stay
PROFILE = "profile"
# as `profile`, but `shape` if a pipe states no cells: their number follows from travel times
BY_CELLS = "cells"
SHAPE = "shape"  # a new model: cells, parts, methods


class ValueFault(ValueError):
    """Error with the faults of a value: list of (keys below the value, message).

    instead : values with which reading continues, so that it finds further faults, or None; stored as `replacement`
    """

    def __init__(
        self, faults: list[tuple[tuple[Any, ...], str]], instead: dict[str, Any] | None = None
    ):
        self.faults, self.replacement = faults, instead
        super().__init__("; ".join(message for _, message in faults))


def faults_of(error: ValueError, *keys: Any) -> list[tuple[tuple[Any, ...], str]]:
    """Faults (key path, message) of an error of a value at the key path `keys`."""
    if hasattr(error, "errors"):
        faults = pydantic_faults(error, [], {})
    else:
        faults = getattr(error, "faults", [((), str(error))])
    return [((*keys, *below), message) for below, message in faults]


def pydantic_faults(
    error: Any, known: list[str], synonyms: Mapping[str, str]
) -> list[tuple[tuple[Any, ...], str]]:
    """Faults (key path, text) in an error of pydantic.

    known : keys of the table; synonyms : keys of other programs -> equivalent here
    """
    result: list[tuple[tuple[Any, ...], str]] = []
    for entry in error.errors(include_url=False, include_input=False):
        place, cause = tuple(entry["loc"]), entry.get("ctx", {}).get("error")
        if isinstance(cause, ValueFault):
            result += [(place + below, message) for below, message in cause.faults]
        elif entry["type"] == "missing":
            result.append((place[:-1], f"{place[-1]} is missing"))
        elif entry["type"] == "extra_forbidden":
            hint = synonyms.get(str(place[-1]).casefold().replace("-", "_"))
            result.append(
                (
                    place,
                    f"unknown key{f'; use {hint}' if hint else key_hint(str(place[-1]), known)}",
                )
            )
        else:
            result.append((place, str(cause) if cause else entry["msg"]))
    return result


def key_hint(name: str, keys: list[str]) -> str:
    """Text on the valid key that is most similar to an unknown key, else on all valid keys."""
    return did_you_mean(name, keys) or f"; keys are {listing(keys)}"


def read_each(entries: Iterable[tuple[Any, Any]], read: Callable[[Any], Any]) -> dict[Any, Any]:
    """Values of the pairs (key, given) : key -> read(given). Raises ValueFault with the faults of all entries."""
    result, faults = {}, []
    for key, given in entries:
        try:
            result[key] = read(given)
        except ValueError as error:
            faults += faults_of(error, key)
    if faults:
        raise ValueFault(faults)
    return result


@dataclass
class ReadContext:
    """Context in which a value is read: ambient pressure [Pa], folder, signals, controls and files of the case.

    driven : control -> (dimension, range) of each key that it drives; block_units : dimensions of the first input and
    of the output of the block that is read
    """

    ambient: float = 101325.0
    folder: Path | None = None
    signals: dict[str, Any] = field(default_factory=dict)
    files: dict[str, Path] = field(default_factory=dict)
    used: dict[str, Any] = field(default_factory=dict)  # signals that parts refer to, in SI
    # schedules of signals that parts scale by a factor
    scaled: dict[str, Any] = field(default_factory=dict)
    lookups: int = 0  # number of uses of files, signals and controls
    controls: dict[str, Any] = field(default_factory=dict)
    driven: dict[str, list[tuple[str, Range]]] = field(default_factory=dict)
    block_units: tuple[str, str] = ("number", "number")
    span: tuple[float, float] | None = None  # start and end of the run [s]; None if unknown
    start_time: Any = (
        None  # instant of t = 0 (`StartTime`); None without one, UNREAD if it is faulty
    )
    # easting and northing [m] of the basin, and its CRS
    frame: tuple[tuple[float, float], str] = ((0.0, 0.0), "")


def context_of(info: Any) -> ReadContext:
    """Context in the arguments `info` of a validator of pydantic; the default context if it has none."""
    return info.context if info is not None and info.context is not None else ReadContext()


@dataclass(frozen=True)
class Range:
    """Range of valid numbers, from `least` to `greatest`.

    open : True if the lower bound is excluded; nonzero : True if 0 is excluded
    """

    least: float = -math.inf
    greatest: float = math.inf
    open: bool = False
    nonzero: bool = False

    def check(self, value: float, given: Any) -> None:
        """Raise ValueError if `value` is outside the range; given : value as written in the file"""
        excluded = (self.open and value == self.least) or (self.nonzero and value == 0.0)
        if value < self.least or value > self.greatest or excluded:
            raise ValueError(f"{show(given)} is out of range; expected a value {self}")

    def holds(self, values: np.ndarray) -> np.ndarray:
        """True for each number within the range : bool[n]"""
        inside = (values >= self.least) & (values <= self.greatest)
        return inside & ~((self.open & (values == self.least)) | (self.nonzero & (values == 0.0)))

    @property
    def bounds(self) -> str:
        """Text of the range, such as ", above 0", that is appended to a unit; "" if all numbers are valid."""
        return "" if self == Range() else f", {self}".replace("of at least", "at least")

    def __str__(self) -> str:
        if self.nonzero:
            return "other than 0"
        if self.greatest == math.inf:
            return f"above {self.least:g}" if self.open else f"of at least {self.least:g}"
        if self.open:
            return f"above {self.least:g}, {self.greatest:g} at most"
        return f"between {self.least:g} and {self.greatest:g}"


class UsualRange(NamedTuple):
    """Usual range of a value in practice [SI], bounds included.

    Other values are valid but give a notice; 0 never gives a notice.
    """

    least: float
    greatest: float
    source: str  # source or meaning of the range


anything = Range()
positive = Range(0, open=True)
nonnegative = Range(0)
nonzero = Range(nonzero=True)


def between(least: float, greatest: float, open: bool = False) -> Range:
    """Range from `least` (excluded if `open`) to `greatest`."""
    return Range(least, greatest, open)


class Value:
    """Base of the declarations of keys: `read` converts a value of the case file to a value of the part.

    about : description; "...; TEXT if left out" describes the default
    changes : effect of a changed value on an existing model: VALUE, PROFILE, BY_CELLS or SHAPE
    takes : text on the valid values, in Markdown: unit, range, words; schema : JSON schema of the value
    """

    about: str = ""
    changes: str = SHAPE
    takes: ClassVar[str] = ""
    schema: ClassVar[dict[str, Any]] = {}

    def read(self, given: Any, setting: ReadContext) -> Any:
        """Value of the part for a value of the case file.

        Raises ValueError, or ValueFault if the fault is at a key below the value.
        """
        raise NotImplementedError(type(self).__name__)

    def below(self, key: str) -> Value | None:
        """Declaration of a key below this value; None if the value has no keys. Raises KeyError for unknown keys."""
        return None

    def json(self) -> dict[str, Any]:
        """JSON schema of the value in the case file."""
        return self.schema

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(
            lambda given, info: self.read(given, context_of(info))
        )

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        return {**self.json(), **({"description": self.about} if self.about else {})}


class Anything(Value):
    """Value of a key whose declaration is unknown, because another key is faulty; all values are valid."""

    def read(self, given: Any, setting: ReadContext) -> Any:
        return given


@dataclass(frozen=True)
class Quantity(Value):
    """Value of a case file in a range: a number in SI, or text with a number and a unit; pressures become absolute."""

    dimension: str
    range: Range = anything
    about: str = ""
    usual: UsualRange | None = None
    changes: str = PROFILE

    def read(self, given: Any, setting: ReadContext) -> float:
        if isinstance(given, dict) and (
            form := next((key for key in CHANGING if key in given), "")
        ):
            text = f"{show(given)} changes with time, and this value does not; {units.expected(self.dimension)}"
            raise ValueError(
                text.replace("changes with time", "follows a control")
                if form == "control"
                else text
            )
        if isinstance(given, str) and OF_TIME.search(given) and not units.begins_as_quantity(given):
            text = f"{show(given)} is a formula of t, and this value does not change with time"
            raise ValueError(f"{text}; {units.expected(self.dimension)}")
        value = units.parse(given, self.dimension)
        if isinstance(value, tuple):
            value = value[0] + (
                setting.ambient if value[1] and self.dimension == "pressure" else 0.0
            )
            if self.dimension == "pressure" and value <= 0 and self.range is not nonnegative:
                raise ValueError(units.vacuum(given, value, ambient=setting.ambient))
        try:
            self.range.check(value, given)
        except ValueError as fault:
            if self.dimension != "length" or isinstance(given, str) or value <= self.range.greatest:
                raise
            raise ValueError(f'{fault}, in m; did you mean "{given:g} mm"?') from None
        return value

    def read_all(self, given: list[Any] | tuple[Any, ...]) -> tuple[float, ...] | None:
        """Values of a list of bare numbers, or of numbers with the same unit, all at once.

        None if an entry needs `read`, because it has another form or a fault.
        """
        kinds = set(map(type, given))
        if units.may_be_gauge(self.dimension) or self.dimension == "viscosity":
            return None
        if kinds == {str}:
            given = self.numbers_of(given)
        elif not kinds <= {int, float}:
            return None
        try:
            values = np.array(given, dtype=float)
        except OverflowError:
            return None
        return (
            tuple(values.tolist())
            if np.all(units.are_possible(values) & self.range.holds(values))
            else None
        )

    def numbers_of(self, texts: list[str] | tuple[str, ...]) -> list[float]:
        """SI values of texts that all end with the same unit; not a number for texts of another form."""
        spelling = texts[0].rpartition(" ")[2]
        try:
            unit = units.find(spelling, self.dimension)
        except ValueError:
            return [math.nan]
        numbers = [text.removesuffix(spelling) for text in texts]
        return [unit.read(number) if PLAIN.fullmatch(number) else math.nan for number in numbers]

    @property
    def takes(self) -> str:
        return f"{units.DIMENSIONS[self.dimension].si}{self.range.bounds}"

    def json(self) -> dict[str, Any]:
        if self.dimension == "number":
            return {"type": ["number", "string"]}
        example = units.DIMENSIONS[self.dimension].example
        return {"type": ["number", "string"], "examples": [example], "x-dimension": self.dimension}


def Number(
    range: Range = anything,
    about: str = "",
    usual: UsualRange | None = None,
    changes: str = PROFILE,
) -> Quantity:
    """Declaration of a key for a number without a unit; arguments as for `Quantity`."""
    return Quantity("number", range, about, usual, changes)


@dataclass(frozen=True)
class Whole(Value):
    """Value of a case file: a whole number in a range."""

    range: Range = anything
    about: str = ""
    changes: str = SHAPE

    def read(self, given: Any, setting: ReadContext) -> int:
        if isinstance(given, bool) or not isinstance(given, int):
            raise ValueError(
                f"{show(given)} is not a whole number; expected a whole number {self.range}"
            )
        if abs(given) > GREATEST_WHOLE:
            raise ValueError(
                f"{show(given)} is above {GREATEST_WHOLE:g}; expected a whole number {self.range}"
            )
        self.range.check(given, given)
        return given

    @property
    def takes(self) -> str:
        return f"whole number{self.range.bounds}"

    def json(self) -> dict[str, Any]:
        return {"type": "integer", "minimum": self.range.least}


@dataclass(frozen=True)
class Choice(Value):
    """Value of a case file: a word from a list.

    noun : name of the choice, for messages; words : valid words
    """

    noun: str
    words: Collection[str]
    about: str = ""
    # words of other programs -> equivalent here
    synonyms: Mapping[str, str] = field(default_factory=dict)
    changes: str = SHAPE

    def read(self, given: Any, setting: ReadContext) -> str:
        if not isinstance(given, str):
            raise ValueError(f"{show(given)} is not text; expected one of {', '.join(self.words)}")
        if given not in self.words:
            synonym = self.synonyms.get(given.casefold().replace("_", "-"))
            hint = f"; use {synonym}" if synonym else did_you_mean(given, self.words)
            hint = hint or f"; expected one of {', '.join(self.words)}"
            raise ValueError(f"no {self.noun} named {show(given)}{hint}")
        return given

    @property
    def takes(self) -> str:
        words = [f"`{word}`" for word in self.words]
        return ", ".join(words if len(words) <= 10 else [*words[:3], "..."])

    def json(self) -> dict[str, Any]:
        return {"enum": list(self.words)}


@dataclass(frozen=True)
class Flag(Value):
    """Value of a case file: `true` or `false`."""

    about: str = ""
    changes: str = SHAPE
    takes: ClassVar[str] = "`true`, `false`"
    schema: ClassVar[dict[str, Any]] = {"type": "boolean"}

    def read(self, given: Any, setting: ReadContext) -> bool:
        if not isinstance(given, bool):
            raise ValueError(
                f"{show(given)} is neither true nor false; expected true or false, without quotes"
            )
        return given


@dataclass(frozen=True)
class Text(Value):
    """Value of a case file: any text."""

    about: str = ""
    changes: str = SHAPE
    takes: ClassVar[str] = "text"
    schema: ClassVar[dict[str, Any]] = {"type": "string"}

    def read(self, given: Any, setting: ReadContext) -> str:
        if not isinstance(given, str):
            raise ValueError(f"{show(given)} is not text; expected text in quotes")
        return given


@dataclass(frozen=True)
class Rows(Value):
    """Value of a case file: a list of quantities.

    rising : True if the values must increase; length : number of values, None for any number
    """

    dimension: str
    range: Range = anything
    rising: bool = False
    length: int | None = None
    about: str = ""
    usual: UsualRange | None = None
    changes: str = PROFILE

    def read(self, given: Any, setting: ReadContext) -> tuple[float, ...]:
        if not isinstance(given, (list, tuple)) or not given:
            state = "has no values" if isinstance(given, (list, tuple)) else "is not a list"
            raise ValueError(f"{show(given)} {state}; expected a list of values")
        if self.length is not None and len(given) != self.length:
            raise ValueError(f"{show(given)} has {len(given)} values; expected {self.length}")
        item = Quantity(self.dimension, self.range)
        values = item.read_all(given)
        if values is None:
            values = tuple(
                read_each(enumerate(given), lambda entry: item.read(entry, setting)).values()
            )
        if self.rising:
            check_increasing(values, given)
        return values

    @property
    def takes(self) -> str:
        unit = units.DIMENSIONS[self.dimension].si
        entries = (
            f"list of {unit}" if self.length is None else f"[{', '.join([unit] * self.length)}]"
        )
        return entries + self.range.bounds

    def json(self) -> dict[str, Any]:
        return {
            "type": "array",
            "items": Quantity(self.dimension).json(),
            "minItems": self.length or 1,
        }


class PointList(Value):
    """Value of a case file: a list of points of a plane. least : least number of points"""

    takes = "list of [x, y], m"

    def __init__(self, least: int, about: str) -> None:
        self.least, self.about = least, about

    def read(self, given: Any, setting: ReadContext) -> tuple[tuple[float, ...], ...]:
        if not isinstance(given, (list, tuple)) or len(given) < self.least:
            text = f"{show(given)} is not a list of {self.least} or more points"
            raise ValueError(
                f"{text}; expected for example {show([[0, 0], [2, 0], [2, 1]][: self.least])}"
            )
        read_point = Rows("length", length=2).read
        points = tuple(
            read_each(enumerate(given), lambda point: read_point(point, setting)).values()
        )
        if any(start == stop for start, stop in zip(points, points[1:], strict=False)):
            raise ValueError(
                f"{show(given)} has two equal points in succession; expected different points"
            )
        return points

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": Rows("length", length=2).json(), "minItems": self.least}


@dataclass(frozen=True)
class Matrix(Value):
    """Value of a case file: a matrix of quantities, three rows of three."""

    dimension: str
    about: str = ""
    changes: str = PROFILE

    def read(self, given: Any, setting: ReadContext) -> tuple[tuple[float, ...], ...]:
        if not isinstance(given, (list, tuple)) or len(given) != 3:
            raise ValueError(f"{show(given)} is not a matrix; expected three rows of three numbers")
        item = Rows(self.dimension, length=3)
        return tuple(read_each(enumerate(given), lambda row: item.read(row, setting)).values())

    @property
    def takes(self) -> str:
        return f"three rows of {Rows(self.dimension, length=3).takes}"

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": Rows(self.dimension, length=3).json(), "minItems": 3}


def check_increasing(values: Any, given: Any, noun: str = "values") -> None:
    """Raise ValueError if a value is not greater than the one before it; the message states the first such pair.

    given : values as written in the file; noun : plural name of the values for the message
    """
    for before, after, text_before, text_after in zip(
        values, values[1:], given, given[1:], strict=False
    ):
        if not after > before:
            wrong = f"{show(text_after)} comes after {show(text_before)}"
            raise ValueError(
                f"{noun} out of order: {wrong}; expected rising {noun.split(': ')[-1]}"
            )
