"""Reading of JSON files of runs and studies: bounded size, and values of declared types."""

import dataclasses
import functools
import json
import math
import types
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fvsolve.errors import RunError
from fvsolve.units import show

# size of a file, and number of its values, that are read
MOST_BYTES, MOST_VALUES = 100_000_000, 5_000_000
MOST_FAULTS = 5  # faults that a message lists
GREATEST_WHOLE = 2**63  # limit of whole numbers
AGAIN = "the file was changed, or written by another version of fvsolve"
WORDS = {
    str: "a text",
    bool: "true or false",
    float: "a number",
    int: "a whole number from 0",
    type(None): "null",
    list: "a list",
    dict: "a table",
    Any: "a finite value",
}


def read_json(path: Path, remedy: str) -> Any:
    """Content of a JSON file; raises RunError if it cannot be read, or is larger than a run writes.

    remedy : end of the message, such as "run the case again with --force"
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise ValueError(f"it has more than {MOST_BYTES // 1_000_000} MB")
        text = path.read_text(encoding="utf-8")
        if text.count(",") + text.count("[") + text.count("{") > MOST_VALUES:
            raise ValueError(f"it has more than {MOST_VALUES} values")
        return json.loads(text)
    except RecursionError:
        raise RunError(f"{path} cannot be read: it is nested too deeply; {remedy}") from None
    except (OSError, ValueError) as error:
        raise RunError(
            f"{path} cannot be read: {getattr(error, 'strerror', None) or error}; {remedy}"
        ) from None


def refuse_faults(path: Path, faults: Iterator[str], remedy: str) -> None:
    """Raise RunError with the first faults of a file, if there are any; remedy : as for `read_json`."""
    texts = list(faults)
    if texts:
        more = [f"and {len(texts) - MOST_FAULTS} more"] if len(texts) > MOST_FAULTS else []
        raise RunError(
            f"{path}: {'; '.join(texts[:MOST_FAULTS] + more)}. It seems that {AGAIN}; {remedy}"
        )


def faults_of(value: Any, kind: Any, place: str = "") -> Iterator[str]:
    """Yield a text for each value that does not have its declared type; place : path of `value` in the file.

    kind : str, bool, int (a whole number from 0), float (a finite number), None, Any (any finite value), a Literal, a
    union, list[...], dict[str, ...], a TypedDict (which may have further keys), or a NamedTuple or dataclass (which may
    not)
    """
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin is list and isinstance(value, list):
        for k, item in enumerate(value):
            yield from faults_of(item, inner[0], f"{place}.{k}")
    elif origin is dict and isinstance(value, dict):
        for key, item in value.items():
            yield from faults_of(item, inner[1], joined(place, key))
    elif is_record(kind) and isinstance(value, dict):
        yield from faults_of_record(value, kind, place)
    elif kind is Any:
        yield from unreasonable_numbers(value, place)
    elif not fits(value, kind):
        yield f"{place}{': ' if place else ''}{value_and_type(value)}; expected {expected_text(kind)}"


def faults_of_record(value: dict, kind: Any, place: str) -> Iterator[str]:
    kinds, required, exact = fields_of(kind)
    yield from (f"{joined(place, key)} is missing" for key in required if key not in value)
    for key, item in value.items():
        if key in kinds:
            yield from faults_of(item, kinds[key], joined(place, key))
        elif exact:
            yield f"{joined(place, key)} is unknown to this version"
        else:
            yield from unreasonable_numbers(item, joined(place, key))


def unreasonable_numbers(value: Any, place: str) -> Iterator[str]:
    """Yield a text for each number in nested lists and tables that is not finite, or too large for a whole number."""
    if isinstance(value, (list, dict)):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from unreasonable_numbers(item, joined(place, key))
    elif type(value) in (int, float) and not fits(value, float):
        yield f"{place}: {value_and_type(value)}; expected a finite number"


@functools.cache
def fields_of(kind: Any) -> tuple[dict[str, Any], tuple[str, ...], bool]:
    """Types of the fields of a record, its required fields, and True if it has no others."""
    kinds = typing.get_type_hints(kind)
    if typing.is_typeddict(kind):
        return kinds, tuple(key for key in kinds if key in kind.__required_keys__), False
    return kinds, tuple(kinds), True


def is_record(kind: Any) -> bool:
    return typing.is_typeddict(kind) or dataclasses.is_dataclass(kind) or hasattr(kind, "_fields")


def fits(value: Any, kind: Any) -> bool:
    """True if a value without declared contents has a type."""
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Literal:
        return isinstance(value, str) and value in inner
    if origin in (types.UnionType, typing.Union):
        return any(fits(value, part) for part in inner)
    if kind in (None, type(None)):
        return value is None
    if kind is float:
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        return (
            is_number and abs(value) < GREATEST_WHOLE
            if isinstance(value, int)
            else is_number and math.isfinite(value)
        )
    if kind is int:
        return type(value) is int and 0 <= value < GREATEST_WHOLE
    return kind in (str, bool) and type(value) is kind


def value_and_type(value: Any) -> str:
    """Text of a value of a wrong type, and its type."""
    if type(value) is int and abs(value) >= GREATEST_WHOLE:
        return f"a whole number of more than {len(str(GREATEST_WHOLE))} digits"
    if isinstance(value, float) and not math.isfinite(value):
        return f"{value} is not a finite number"
    if isinstance(value, (list, dict)):
        return f"it is {WORDS[type(value)]}"
    return (
        "it is null"
        if value is None
        else f"{show(value)} is {'a number' if type(value) is int else WORDS[type(value)]}"
    )


def expected_text(kind: Any) -> str:
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Literal:
        return f"one of {', '.join(map(show, inner))}"
    if origin in (types.UnionType, typing.Union):
        return " or ".join(map(expected_text, inner))
    return "a table" if is_record(kind) else WORDS[origin or kind]


def joined(place: str, key: Any) -> str:
    """Path of an entry; long keys are cut."""
    text = str(key) if len(str(key)) <= 60 else f"{str(key)[:57]}..."
    return f"{place}.{text}" if place else text
