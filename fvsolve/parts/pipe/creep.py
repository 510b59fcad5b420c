"""Kelvin-Voigt elements of a wall: what a case may say of them. Knows lists of numbers; computes nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fvsolve.parts.table import keys_json, read_keys
from fvsolve.parts.value import NEEDED, SHAPE, VALUE, Setting, Value, positive
from fvsolve.units import parse, show


@dataclass(frozen=True)
class Creep:
    """Kelvin-Voigt elements: strain J (1 - exp(-t / tau)) each under a unit of hoop stress, beside the elastic one.

    compliance : J of each [1/Pa]; time : tau of each [s]
    """

    compliance: tuple[float, ...]
    time: tuple[float, ...]

    def table(self) -> dict[str, list[float]]:
        """What the file would say."""
        return {"compliance": list(self.compliance), "time": list(self.time)}


@dataclass(frozen=True)
class Positives(Value):
    """A list of numbers above 0, one an element."""

    dimension: str
    changes: str = VALUE

    def read(self, given: Any, setting: Setting) -> tuple[float, ...]:
        if not isinstance(given, (list, tuple)) or not given:
            raise ValueError(f"{show(given)} is no list of numbers; wanted one an element")
        found = tuple(float(parse(one, self.dimension)) for one in given)
        for one, value in zip(given, found, strict=True):
            positive.check(value, one)
        return found

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": {"type": ["number", "string"]}}


LISTS = {"compliance": (Positives("compliance"), NEEDED), "time": (Positives("time"), NEEDED)}


class Elements(Value):
    """The table of Kelvin-Voigt elements: as many compliances as times, all above 0."""

    about = "what the wall gives way by in time, Kelvin-Voigt elements"
    takes = "`{ compliance, time }`, lists of 1/Pa and s"
    changes = SHAPE

    def read(self, given: Any, setting: Setting) -> Creep:
        if isinstance(given, Creep):
            return given
        if not isinstance(given, dict):
            raise ValueError(f"{show(given)} is no table; wanted {{ compliance = [1e-10], time = [0.05] }}, 1/Pa and s")
        found = Creep(**read_keys(given, LISTS, setting))
        if len(found.compliance) != len(found.time):
            sizes = f"{len(found.compliance)} of compliance and {len(found.time)} of time"
            raise ValueError(f"{sizes}; wanted one of each an element")
        return found

    def below(self, key: str) -> Value | None:
        return LISTS[key][0]

    def json(self) -> dict[str, Any]:
        return keys_json(LISTS)
