"""Checks of the arguments of public functions: numbers, names, arrays, paths."""

import functools
import inspect
import math
import os
from collections.abc import Callable, Mapping, Sequence
from numbers import Integral, Real
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.units import show

Function = TypeVar("Function", bound=Callable[..., Any])


class Kind(NamedTuple):
    """Kind of an argument: test that accepts a value (`accepts`), and the expected value in words (`expected`)."""

    accepts: Callable[[Any], bool]
    expected: str


def is_number(value: Any) -> bool:
    """True if the argument is a real number, within the range of float64, and not a bool."""
    try:
        return (
            not isinstance(value, (bool, np.bool_))
            and isinstance(value, Real)
            and math.isfinite(value)
        )
    except OverflowError:  # an integer beyond this range
        return False


def is_row(value: Any, holds: Callable[[Any], bool]) -> bool:
    """True if the argument is a sequence, such as a list, whose items all pass the test `holds`.

    Texts and numpy arrays do not count as sequences.
    """
    return (
        isinstance(value, Sequence)
        and not isinstance(value, (str, bytes))
        and all(holds(item) for item in value)
    )


def is_name(value: Any) -> bool:
    # a tableau of the caller
    return (isinstance(value, str) and value != "") or hasattr(value, "stages")


def is_array(value: Any, kinds: str, least: int, most: int, finite: bool = True) -> bool:
    """True if the argument is a number or an array whose numpy kind is in `kinds` ("f", "c", ...).

    It must have `least` to `most` dimensions, and with `finite` only finite numbers.
    """
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):  # rows of different lengths, objects without conversion
        return False
    return (
        array.dtype.kind in kinds
        and least <= array.ndim <= most
        and bool(not finite or np.isfinite(array).all())
    )


def instance_of(kind: type) -> Kind:
    """Kind of an argument that must be an instance of a class."""
    return Kind(lambda value: isinstance(value, kind), f"a {kind.__name__}")


TABLE = Kind(
    lambda value: isinstance(value, Mapping), 'a dict, for example {"links.main.cells": 400}'
)
PATH = Kind(
    lambda value: (
        isinstance(value, (str, os.PathLike)) and str(value) != "" and "\0" not in str(value)
    ),
    "a path",
)
FUNCTION = Kind(callable, "a function")
FLAG = Kind(lambda value: isinstance(value, (bool, np.bool_)), "True or False")
NUMBER = Kind(is_number, "a finite number")
POSITIVE = Kind(lambda value: is_number(value) and value > 0, "a positive number")
COUNT = Kind(lambda value: isinstance(value, Integral) and is_number(value), "a whole number")
COUNT_FROM_ZERO = Kind(
    lambda value: COUNT.accepts(value) and value >= 0, "a whole number, 0 or more"
)
COUNT_FROM_ONE = Kind(lambda value: COUNT.accepts(value) and value > 0, "a whole number, 1 or more")
ROW = Kind(lambda value: is_row(value, lambda item: True), "a list")
NUMBERS = Kind(lambda value: is_row(value, is_number), "a list of finite numbers")
SERIES = Kind(lambda value: is_array(value, "fiu", 1, 1), "a 1-D array of finite numbers")
MATRIX = Kind(lambda value: is_array(value, "fiu", 2, 2), "a 2-D array of finite numbers")
POINT = Kind(lambda value: is_array(value, "fiuc", 0, 0), "a finite complex number")
COMPLEX = Kind(
    lambda value: is_array(value, "fiuc", 0, 1), "a finite complex number, or a 1-D array of them"
)
TEXT = Kind(lambda value: isinstance(value, str) and value != "", "a name")
NAME = Kind(is_name, "a name")
NAMES = Kind(lambda value: is_name(value) or is_row(value, is_name), "a name or a list of names")


def validated(**kinds: Kind) -> Callable[[Function], Function]:
    """Decorate a function so that it checks its arguments, and raises FvsolveError for an invalid argument.

    kinds : name of an argument -> `Kind` that it must have; its default value is also valid
    """

    def decorate(function: Function) -> Function:
        signature = inspect.signature(function)
        order = [*signature.parameters]
        defaults = {name: p.default for name, p in signature.parameters.items()}

        @functools.wraps(function)
        def checked(*arguments: Any, **keywords: Any) -> Any:
            if len(arguments) > len(order) or not keywords.keys() <= defaults.keys():
                signature.bind(*arguments, **keywords)  # raises a TypeError with the reason
            for name, value in (*zip(order, arguments, strict=False), *keywords.items()):
                kind = kinds.get(name)
                if kind is not None and value is not defaults[name] and not kind.accepts(value):
                    text = f"{name} = {show(value)}" + (
                        " cannot be called" if kind is FUNCTION else ""
                    )
                    raise FvsolveError(f"{text}; expected {kind.expected}")
            return function(*arguments, **keywords)

        return cast(Function, checked)

    return decorate
