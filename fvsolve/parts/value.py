"""One value of a case file: what it may be and what it becomes. Knows ranges and wording; knows no part."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from fvsolve import units
from fvsolve.errors import did_you_mean
from fvsolve.units import show

ROOT = object()  # in the keys of a fault: what follows counts from the top of the case
NEEDED = object()  # in place of a default: the key must be given

# What moving a key from one number to another asks of a model that is there
VALUE = "value"  # its tables alone: the run starts from where it did
PROFILE = "profile"  # another start too, in tables of the same sizes, names and whole numbers
COUNTED = "cells"  # the same, but `shape` where pipes state no cells: those are counted by travel time
SHAPE = "shape"  # another model: cells, parts, methods


class Misfit(ValueError):
    """What does not fit in a value: pairs of the keys below it and a message; what may stand in for the value."""

    def __init__(self, faults: list[tuple[tuple[Any, ...], str]], instead: dict[str, Any] | None = None):
        self.faults, self.instead = faults, instead
        super().__init__("; ".join(message for _, message in faults))


@dataclass
class Setting:
    """What a value may need of the case around it: ambient pressure [Pa], folder, signals, files read."""

    ambient: float = 101325.0
    folder: Path | None = None
    signals: dict[str, Any] = field(default_factory=dict)
    files: dict[str, Path] = field(default_factory=dict)
    used: dict[str, Any] = field(default_factory=dict)  # signals that parts name, in SI
    asked: int = 0  # times that a file or a signal was asked for


def setting_of(info: Any) -> Setting:
    """The setting a validator was called with."""
    return info.context if info is not None and info.context is not None else Setting()


@dataclass(frozen=True)
class Range:
    """The values a number may have, ends excluded where `open`."""

    least: float = -math.inf
    greatest: float = math.inf
    open: bool = False

    def check(self, value: float, given: Any) -> None:
        """ValueError where `value` lies outside; `given` is how the file says it."""
        if value < self.least or value > self.greatest or (self.open and value == self.least):
            raise ValueError(f"{show(given)} is out of range; wanted a value {self}")

    @property
    def bounds(self) -> str:
        """', above 0', as it stands behind a unit; nothing of all numbers."""
        return "" if self == Range() else f", {self}".replace("of at least", "at least")

    def __str__(self) -> str:
        if self.greatest == math.inf:
            return f"above {self.least:g}" if self.open else f"of at least {self.least:g}"
        if self.open:
            return f"above {self.least:g}, {self.greatest:g} at most"
        return f"between {self.least:g} and {self.greatest:g}"


class Usual(NamedTuple):
    """The values that practice knows, SI, both ends among them; outside a number is legal, but noted. 0 is none."""

    least: float
    greatest: float
    practice: str  # whose, or what it spans


anything = Range()
positive = Range(0, open=True)
nonnegative = Range(0)


def between(least: float, greatest: float, open: bool = False) -> Range:
    """The range from `least` (excluded where `open`) to `greatest`."""
    return Range(least, greatest, open)


class Value:
    """Base of the annotations of fields: `read` turns what the file says into what the part holds.

    about : words; "..., WHAT if left out" says what then holds in place of a default
    changes : one of VALUE, PROFILE, COUNTED, SHAPE
    """

    about: str = ""
    changes: str = SHAPE

    def read(self, given: Any, setting: Setting) -> Any:
        """The value, or ValueError (Misfit where the fault lies below a key)."""
        raise NotImplementedError(type(self).__name__)

    def below(self, key: str) -> Value | None:
        """What a key of a table may be, KeyError where there is none such; None where this value says all."""
        return None

    def json(self) -> dict[str, Any]:
        """The JSON schema of what the file may say."""
        return {}

    @property
    def takes(self) -> str:
        """What it may be, in Markdown: unit, range, words."""
        return ""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(lambda given, info: self.read(given, setting_of(info)))

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        return {**self.json(), **({"description": self.about} if self.about else {})}


class Anything(Value):
    """Whatever stands there: what it means is not known, as what it belongs to is at fault."""

    def read(self, given: Any, setting: Setting) -> Any:
        return given


@dataclass(frozen=True)
class Quantity(Value):
    """A number in SI or text with a unit, in a range; a pressure comes out absolute."""

    dimension: str
    range: Range = anything
    about: str = ""
    usual: Usual | None = None
    changes: str = PROFILE

    def read(self, given: Any, setting: Setting) -> float:
        value = units.parse(given, self.dimension)
        if isinstance(value, tuple):
            value = value[0] + (setting.ambient if value[1] and self.dimension == "pressure" else 0.0)
            if self.dimension == "pressure" and value <= 0 and self.range is not nonnegative:
                raise ValueError(units.vacuum(given, value, ambient=setting.ambient))
        try:
            self.range.check(value, given)
        except ValueError as fault:
            if self.dimension != "length" or isinstance(given, str) or value <= self.range.greatest:
                raise
            raise ValueError(f'{fault}, in m; did you mean "{given:g} mm"?') from None
        return value

    @property
    def takes(self) -> str:
        return f"{units.DIMENSIONS[self.dimension].si}{self.range.bounds}"

    def json(self) -> dict[str, Any]:
        if self.dimension == "number":
            return {"type": ["number", "string"]}
        example = units.DIMENSIONS[self.dimension].example
        return {"type": ["number", "string"], "examples": [example], "x-dimension": self.dimension}


def Number(range: Range = anything, about: str = "", usual: Usual | None = None, changes: str = PROFILE) -> Quantity:
    """A number without a unit."""
    return Quantity("number", range, about, usual, changes)


@dataclass(frozen=True)
class Whole(Value):
    """A whole number in a range."""

    range: Range = anything
    about: str = ""
    changes: str = SHAPE

    def read(self, given: Any, setting: Setting) -> int:
        if isinstance(given, bool) or not isinstance(given, int):
            raise ValueError(f"{show(given)} is no whole number; wanted one {self.range}")
        self.range.check(given, given)
        return given

    @property
    def takes(self) -> str:
        return f"whole number{self.range.bounds}"

    def json(self) -> dict[str, Any]:
        return {"type": "integer", "minimum": self.range.least}


@dataclass(frozen=True)
class Choice(Value):
    """One of several words."""

    what: str
    words: Collection[str]
    about: str = ""
    meant: Mapping[str, str] = field(default_factory=dict)  # words of others -> what says it here
    changes: str = SHAPE

    def read(self, given: Any, setting: Setting) -> str:
        if not isinstance(given, str):
            raise ValueError(f"{show(given)} is no text; wanted one of {', '.join(self.words)}")
        if given not in self.words:
            said = self.meant.get(given.casefold().replace("_", "-"))
            hint = (
                f"; say {said}"
                if said
                else did_you_mean(given, self.words) or f"; wanted one of {', '.join(self.words)}"
            )
            raise ValueError(f"no {self.what} named {show(given)}{hint}")
        return given

    @property
    def takes(self) -> str:
        words = [f"`{word}`" for word in self.words]
        return ", ".join(words if len(words) <= 10 else [*words[:3], "..."])

    def json(self) -> dict[str, Any]:
        return {"enum": list(self.words)}


@dataclass(frozen=True)
class Flag(Value):
    """true or false."""

    about: str = ""
    changes: str = SHAPE

    def read(self, given: Any, setting: Setting) -> bool:
        if not isinstance(given, bool):
            raise ValueError(f"{show(given)} is neither true nor false")
        return given

    @property
    def takes(self) -> str:
        return "`true`, `false`"

    def json(self) -> dict[str, Any]:
        return {"type": "boolean"}


@dataclass(frozen=True)
class Text(Value):
    """Any text."""

    about: str = ""
    changes: str = SHAPE

    def read(self, given: Any, setting: Setting) -> str:
        if not isinstance(given, str):
            raise ValueError(f"{show(given)} is no text")
        return given

    @property
    def takes(self) -> str:
        return "text"

    def json(self) -> dict[str, Any]:
        return {"type": "string"}


@dataclass(frozen=True)
class Rows(Value):
    """A list of quantities, rising where asked."""

    dimension: str
    range: Range = anything
    rising: bool = False
    length: int | None = None
    about: str = ""
    usual: Usual | None = None
    changes: str = PROFILE

    def read(self, given: Any, setting: Setting) -> tuple[float, ...]:
        if not isinstance(given, (list, tuple)) or not given:
            raise ValueError(f"{show(given)} is no list; wanted a list of values")
        if self.length is not None and len(given) != self.length:
            raise ValueError(f"{show(given)} has {len(given)} values; wanted {self.length}")
        item = Quantity(self.dimension, self.range)
        values, faults = [], []
        for index, one in enumerate(given):
            try:
                values.append(item.read(one, setting))
            except ValueError as error:
                faults.append(((index,), str(error)))
        if faults:
            raise Misfit(faults)
        if self.rising:
            check_rising(values, given)
        return tuple(values)

    @property
    def takes(self) -> str:
        unit = units.DIMENSIONS[self.dimension].si
        return (
            f"list of {unit}" if self.length is None else f"[{', '.join([unit] * self.length)}]"
        ) + self.range.bounds

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": Quantity(self.dimension).json(), "minItems": self.length or 1}


@dataclass(frozen=True)
class Matrix(Value):
    """A matrix of quantities, three rows of three."""

    dimension: str
    about: str = ""
    changes: str = PROFILE

    def read(self, given: Any, setting: Setting) -> tuple[tuple[float, ...], ...]:
        if not isinstance(given, (list, tuple)) or len(given) != 3:
            raise ValueError(f"{show(given)} is no matrix; wanted three rows of three")
        rows, faults = [], []
        for index, row in enumerate(given):
            try:
                rows.append(Rows(self.dimension, length=3).read(row, setting))
            except Misfit as error:
                faults += [((index, *below), text) for below, text in error.faults]
            except ValueError as error:
                faults.append(((index,), str(error)))
        if faults:
            raise Misfit(faults)
        return tuple(rows)

    @property
    def takes(self) -> str:
        return f"three rows of {Rows(self.dimension, length=3).takes}"

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": Rows(self.dimension, length=3).json(), "minItems": 3}


def check_rising(values: Any, given: Any, what: str = "values") -> None:
    """ValueError naming the first pair that does not rise."""
    for before, after, text_before, text_after in zip(values, values[1:], given, given[1:], strict=False):
        if not after > before:
            raise ValueError(f"{what} out of order: {show(text_after)} comes after {show(text_before)}")
