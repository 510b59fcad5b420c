"""Kinds of what public functions are given, checked at the door. Knows kinds; knows no meaning."""

from __future__ import annotations

import functools
import inspect
import math
import os
from collections.abc import Callable, Mapping, Sequence
from numbers import Integral, Real
from typing import Any, NamedTuple

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.units import show


class Kind(NamedTuple):
    """What an argument may be: a test, and what is wanted in words."""

    holds: Callable[[Any], bool]
    wanted: str


def is_number(given: Any) -> bool:
    """A finite real number; true and false are none."""
    return isinstance(given, Real) and not isinstance(given, (bool, np.bool_)) and math.isfinite(given)


def is_row(given: Any, holds: Callable[[Any], bool]) -> bool:
    """A list or tuple of what `holds`; text is none."""
    return isinstance(given, Sequence) and not isinstance(given, (str, bytes)) and all(holds(one) for one in given)


def is_name(given: Any) -> bool:
    return (isinstance(given, str) and given != "") or hasattr(given, "stages")  # a tableau of the caller's


def is_array(given: Any, kinds: str, least: int, most: int, finite: bool = True) -> bool:
    """Numbers of these kinds of numpy ("f", "c", ...), in `least` to `most` dimensions."""
    try:
        found = np.asarray(given)
    except (TypeError, ValueError):  # rows of different lengths, objects that refuse
        return False
    return found.dtype.kind in kinds and least <= found.ndim <= most and bool(not finite or np.isfinite(found).all())


def made(kind: type) -> Kind:
    """What is a thing of ours."""
    return Kind(lambda given: isinstance(given, kind), f"a {kind.__name__}")


TABLE = Kind(lambda given: isinstance(given, Mapping), 'a table, for example {"links.main.cells": 400}')
PATH = Kind(
    lambda given: isinstance(given, (str, os.PathLike)) and str(given) != "" and "\0" not in str(given), "a path"
)
CALL = Kind(callable, "a function")
FLAG = Kind(lambda given: isinstance(given, (bool, np.bool_)), "True or False")
NUMBER = Kind(is_number, "a finite number")
POSITIVE = Kind(lambda given: is_number(given) and given > 0, "a positive number")
COUNT = Kind(lambda given: isinstance(given, Integral) and is_number(given), "a whole number")
AMOUNT = Kind(lambda given: COUNT.holds(given) and given >= 0, "a whole number from 0 on")
THREADS = Kind(lambda given: COUNT.holds(given) and given > 0, "a whole number from 1 on")
ROW = Kind(lambda given: is_row(given, lambda one: True), "a list")
NUMBERS = Kind(lambda given: is_row(given, is_number), "a list of finite numbers")
SERIES = Kind(lambda given: is_array(given, "fiu", 1, 1), "a row of finite numbers")
MATRIX = Kind(lambda given: is_array(given, "fiu", 2, 2), "rows of finite numbers")
POINT = Kind(lambda given: is_array(given, "fiuc", 0, 0), "a finite complex number")
COMPLEX = Kind(lambda given: is_array(given, "fiuc", 0, 1), "a finite complex number, or a row of them")
TEXT = Kind(lambda given: isinstance(given, str) and given != "", "a name")
NAME = Kind(is_name, "a name")
NAMES = Kind(lambda given: is_name(given) or is_row(given, is_name), "names")


def door(**kinds: Kind) -> Callable:
    """A function whose arguments of these names are of these kinds, or what they are by default; else FvsolveError."""

    def guarded(function: Callable) -> Callable:
        signature = inspect.signature(function)
        order, defaults = [*signature.parameters], {name: one.default for name, one in signature.parameters.items()}

        @functools.wraps(function)
        def checked(*given, **named):
            if len(given) > len(order) or not named.keys() <= defaults.keys():
                signature.bind(*given, **named)  # says what is wrong of it
            for name, value in (*zip(order, given, strict=False), *named.items()):
                kind = kinds.get(name)
                if kind is not None and value is not defaults[name] and not kind.holds(value):
                    said = f"{name} = {show(value)}" + (" cannot be called" if kind is CALL else "")
                    raise FvsolveError(f"{said}; wanted {kind.wanted}")
            return function(*given, **named)

        return checked

    return guarded
