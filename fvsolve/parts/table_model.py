"""Tables of a case file: base class, keys, faults of incompatible keys, and context of a part in its case."""

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from math import nan
from typing import Any, ClassVar, NamedTuple

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from fvsolve.errors import listing
from fvsolve.parts.value import (
    NEEDED,
    VALUE,
    ReadContext,
    Text,
    Value,
    ValueFault,
    check_increasing,
    context_of,
    faults_of,
    key_hint,
    pydantic_faults,
    read_each,
)
from fvsolve.units import show

Faults = Iterator[tuple[tuple[Any, ...], str]]  # (keys below the part, text of the fault)


class RunTimes(NamedTuple):
    """Start and end of a run, and its given step [s]; nan for a faulty value and for steps by error control."""

    start: float
    end: float = nan
    step: float = nan

    def most(self, interval: float) -> float:
        """Greatest number of intervals of this length [s] in the run; nan if the run is unknown."""
        return (self.end - self.start) / interval


class CaseContext(NamedTuple):
    """Parts and properties of a case, for checks after its parts are read.

    nodes, links : parts by name; ambient : ambient pressure [Pa]
    gravity : acceleration of gravity [m/s2], None if faulty; fluid : properties of the fluid, None if faulty
    times : times of the run
    boiling_faults : function of (group, name, key, pressures [Pa]) of a part, which yields a fault if the fluid boils
    at one of the pressures
    place_distance : function of two places: distance [m] from the first to the second at the start, None if unknown
    """

    nodes: dict[str, Any]
    links: dict[str, Any]
    ambient: float
    gravity: float | None
    fluid: Any
    times: RunTimes
    boiling_faults: Callable[[str, str, str, list[float]], Faults]
    place_distance: Callable[[str, str], float | None]

    def spatial(self, place: str | None) -> bool:
        """True if a place is a body, or a point of a body or of the world."""
        name, _, point = (place or "").partition(".")
        node = self.nodes.get(name)
        return (
            getattr(node, "domain", "") == "spatial"
            or bool(point)
            and point in getattr(node, "points", {})
        )

    def separation(self, link: Any, first: str, second: str) -> float | None:
        """Distance [m] from the place at port `first` of a link to that at port `second` at the start; None if unknown.

        It is a signed difference of positions for masses on the axis, and a distance for points in space.
        """
        ends = [link.ports.get(port) for port in (first, second)]
        return None if None in ends else self.place_distance(*ends)


SHEET_KEY: dict[str, tuple[Value, Any]] = {  # of a table file
    "sheet": (
        Text("name of a sheet of an Excel workbook; its only sheet if left out", VALUE),
        None,
    )
}
FILE_KEYS: dict[str, tuple[Value, Any]] = {  # of a value whose columns are in a table file
    "file": (Text("CSV file or Excel workbook; path relative to the case file", VALUE), NEEDED),
    **SHEET_KEY,
}


def read_keys(
    given: dict[str, Any], keys: dict[str, tuple[Value, Any]], setting: ReadContext
) -> dict[str, Any]:
    """Read a table by its keys; keys : key -> (declaration, default). Raises ValueFault with all faults."""
    result = {key: default for key, (_, default) in keys.items()}
    faults = [
        ((key,), f"unknown key{key_hint(str(key), list(keys))}") for key in given if key not in keys
    ]
    for key, (value, default) in keys.items():
        try:
            if key in given:
                result[key] = value.read(given[key], setting)
            elif default is NEEDED:
                faults.append(((), f"{key} is missing"))
        except ValueError as error:
            faults += faults_of(error, key)
    if faults:
        raise ValueFault(faults)
    return result


def check_table(given: Any, expected: str) -> None:
    """Raise ValueError if a value is not a table; expected : text about the expected table"""
    if not isinstance(given, dict):
        raise ValueError(f"{show(given)} is not a table; expected {expected}")


def read_lists(
    given: dict[str, Any],
    keys: dict[str, tuple[Value, Any]],
    setting: ReadContext,
    noun: str,
    further=lambda *_: [],
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Read a table of two lists of equal lengths, of which the first rises : (first list, second list).

    keys : the two keys -> (declaration, default); noun : plural name of the values of the first list, for messages
    further : function of both lists that returns further faults. Raises ValueFault with all faults.
    """
    (key, first), (other, second) = read_keys(given, keys, setting).items()
    faults = []
    if len(first) != len(second):
        text = (
            f"has length {len(second)}, but `{key}` has length {len(first)}; expected equal lengths"
        )
        faults.append(((other,), text))
    faults += further(first, second)
    try:
        check_increasing(first, given[key], noun)
    except ValueError as error:
        faults.append(((key,), str(error)))
    if faults:
        raise ValueFault(faults)
    return first, second


@dataclass(frozen=True)
class ListTable:
    """Base of values of parts that are tables of lists of numbers, compared by their contents."""

    def table(self) -> dict[str, list[float]]:
        """Table of a case file: key -> list."""
        return {field.name: [float(x) for x in getattr(self, field.name)] for field in fields(self)}

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and self.table() == other.table()

    def __hash__(self) -> int:
        return hash(tuple(map(tuple, self.table().values())))


def keys_json(keys: dict[str, tuple[Value, Any]]) -> dict[str, Any]:
    """JSON schema of a table; keys : key -> (declaration, default)"""
    return {
        "type": "object",
        "properties": {key: value.json() for key, (value, _) in keys.items()},
        "required": [key for key, (_, default) in keys.items() if default is NEEDED],
        "additionalProperties": False,
    }


class Table(BaseModel):
    """Base of all tables of a case file: frozen, without unknown keys; a single error states all faults of a table."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        populate_by_name=False,
        arbitrary_types_allowed=True,
        defer_build=True,  # tables that a case does not have cost no time
    )

    # groups of keys, of which at most one is given
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = ()
    # groups of keys, of which at least one is given
    needs: ClassVar[tuple[tuple[str, ...], ...]] = ()
    synonyms: ClassVar[dict[str, str]] = {}  # keys of other programs -> equivalent here

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        """Faults of incompatible or missing keys : list of (key path, text)."""
        exclusive_faults = [
            fault for keys in cls.alternatives for fault in exclusive_key_faults(given, keys)
        ]
        return exclusive_faults + [
            fault for keys in cls.needs for fault in missing_key_faults(given, keys)
        ]

    @classmethod
    def resolve_keys(cls, given: dict[str, Any], setting: ReadContext) -> dict[str, Any]:
        """Table in which keys that stand for other keys are replaced. Raises ValueFault for invalid values."""
        return given

    @model_validator(mode="wrap")
    @classmethod
    def _validate(cls, given: Any, handler: Any, info: Any) -> Any:
        if isinstance(given, cls):
            return given
        if not isinstance(given, dict):
            raise ValueFault(
                [((), f"{show(given)} is not a table; expected {cls.expected(given)}")]
            )
        faults = cls.key_faults(given)
        try:
            given = cls.resolve_keys(given, context_of(info))
        except ValueFault as error:
            faults += error.faults
            given = given if error.replacement is None else error.replacement
        try:
            table = handler(given)
        except ValidationError as error:
            raise ValueFault(faults + pydantic_faults(error, cls.keys(), cls.synonyms)) from None
        if faults:
            raise ValueFault(faults)
        return table

    @classmethod
    def keys(cls) -> list[str]:
        """Names of the keys in a case file."""
        return [info.alias or name for name, info in cls.model_fields.items()]

    @classmethod
    @functools.cache
    def values(cls) -> dict[str, Value]:
        """Declaration of each key: name in a case file -> declaration."""
        declared = {
            info.alias or name: (info.metadata, info.annotation)
            for name, info in cls.model_fields.items()
        }
        return {
            key: next((value for value in metadata if isinstance(value, Value)), Nested(model))
            for key, (metadata, model) in declared.items()
        }

    @classmethod
    def expected(cls, given: Any) -> str:
        """Text about the expected table, for a value that is not a table."""
        return f"keys of {listing(cls.keys())}"

    def faults(self, name: str, around: CaseContext) -> Faults:
        """Faults of the part in the context of its case, each as (key path, text)."""
        yield from ()

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        """Unusual combinations of keys, which give notices, each as (key path, value, limit, text)."""
        yield from ()

    def table(self) -> dict[str, Any]:
        """Table of a case file that reads back as this object: SI numbers, with defaults.

        Keys without a value are left out.
        """
        values, result = vars(self), {}
        for name, key in keys_of(type(self)):
            value = values[name]
            if type(value) not in PLAIN:
                value = plain_value(value)
            if value is not None:
                result[key] = value
        return result


class Nested(Value):
    """Value of a case file that is a table."""

    def __init__(self, model: type[Table], about: str = "") -> None:
        self.model, self.about = model, about

    def read(self, given: Any, setting: ReadContext) -> Table:
        if (
            isinstance(given, list)
            and len(given) > 1
            and all(isinstance(item, dict) for item in given)
        ):
            text = f"is a list of {len(given)} tables; expected a single table{', ' * bool(self.about)}{self.about}"
            raise ValueError(text)
        return (
            given
            if isinstance(given, self.model)
            else self.model.model_validate(given, context=setting)
        )

    def below(self, key: str) -> Value | None:
        return self.model.values()[key]

    @property
    def takes(self) -> str:
        return f"`{{ {', '.join(self.model.keys())} }}`"

    def json(self) -> dict[str, Any]:
        fields = {info.alias or name: info for name, info in self.model.model_fields.items()}
        keys = {
            key: (value, NEEDED if fields[key].is_required() else None)
            for key, value in self.model.values().items()
        }
        return keys_json(keys)


class NamedTables(Value):
    """Value of a case file that contains tables of the same type, name -> table."""

    schema = {"type": "object", "additionalProperties": {"type": "object"}}

    def __init__(self, model: type[Table], about: str) -> None:
        self.model, self.about = model, about

    def read(self, given: Any, setting: ReadContext) -> dict[str, Any]:
        if not isinstance(given, dict):
            raise ValueError(
                f"{show(given)} is not a table of tables by name; expected {self.about}"
            )
        return read_each(
            given.items(), lambda item: self.model.model_validate(item, context=setting)
        )

    def below(self, key: str) -> Value | None:
        return Nested(self.model)

    @property
    def takes(self) -> str:
        return f"`{{ NAME = {{ {', '.join(self.model.keys())} }} }}`"


PLAIN = {float, int, str, bool, type(None)}


@functools.cache
def keys_of(model: type[Table]) -> list[tuple[str, str]]:
    """Names of the attributes of a table and their keys in a case file."""
    return [(name, info.alias or name) for name, info in model.model_fields.items()]


def plain_value(value: Any) -> Any:
    """Value of a key as in a case file: number, text, list or table."""
    if type(value) in PLAIN:
        return value
    if hasattr(value, "table"):
        return value.table()
    if isinstance(value, (list, tuple)):
        return [plain_value(item) for item in value]
    if isinstance(value, dict):
        return {key: plain_value(item) for key, item in value.items()}
    return value


def exclusive_key_faults(
    given: dict[str, Any], keys: tuple[str, ...]
) -> list[tuple[tuple[Any, ...], str]]:
    """List with a fault if two or more of the keys are given, otherwise empty."""
    present = [key for key in keys if key in given]
    return (
        [((present[1],), f"{' and '.join(present)} are given; keep one")]
        if len(present) > 1
        else []
    )


def missing_key_faults(
    given: dict[str, Any], keys: tuple[str, ...]
) -> list[tuple[tuple[Any, ...], str]]:
    """List with a fault if all of the keys are missing, otherwise empty."""
    if any(key in given for key in keys):
        return []
    return [
        ((), f"expected one of {', '.join(keys)}" if len(keys) > 1 else f"{keys[0]} is missing")
    ]
