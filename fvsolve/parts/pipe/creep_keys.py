"""Keys of the Kelvin-Voigt elements, which describe the creep of a viscoelastic wall."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fvsolve.parts.table_model import keys_json, read_keys
from fvsolve.parts.value import NEEDED, SHAPE, VALUE, ReadContext, Value, positive
from fvsolve.units import parse, show


@dataclass(frozen=True)
class Creep:
    """Kelvin-Voigt elements: each adds a strain J (1 - exp(-t / tau)) per unit of hoop stress to the elastic strain.

    compliance : J of each element [1/Pa]; time : retardation time tau of each element [s]; t is the time since loading
    """

    compliance: tuple[float, ...]
    time: tuple[float, ...]

    def table(self) -> dict[str, list[float]]:
        """Elements as a table of a case file: key -> list."""
        return {"compliance": list(self.compliance), "time": list(self.time)}


@dataclass(frozen=True)
class PositiveList(Value):
    """Value of a case file: a list of numbers above 0, one for each Kelvin-Voigt element."""

    dimension: str
    changes: str = VALUE

    def read(self, given: Any, setting: ReadContext) -> tuple[float, ...]:
        if not isinstance(given, (list, tuple)) or not given:
            raise ValueError(f"{show(given)} is not a list of numbers; expected one number for each creep element")
        values = tuple(float(parse(raw, self.dimension)) for raw in given)
        for raw, value in zip(given, values, strict=True):
            positive.check(value, raw)
        return values

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": {"type": ["number", "string"]}}


CREEP_KEYS = {"compliance": (PositiveList("compliance"), NEEDED), "time": (PositiveList("time"), NEEDED)}


class Elements(Value):
    """Value of a case file for Kelvin-Voigt elements: equal numbers of compliances and times, all above 0."""

    about = "Kelvin-Voigt elements of a viscoelastic wall"
    takes = "`{ compliance, time }`, lists of 1/Pa and s"
    changes = SHAPE

    def read(self, given: Any, setting: ReadContext) -> Creep:
        if isinstance(given, Creep):
            return given
        if not isinstance(given, dict):
            raise ValueError(f"{show(given)} is not a table; expected {{ compliance = [1e-10], time = [0.05] }}")
        creep = Creep(**read_keys(given, CREEP_KEYS, setting))
        if len(creep.compliance) != len(creep.time):
            sizes = f"`compliance` has length {len(creep.compliance)}, and `time` has length {len(creep.time)}"
            raise ValueError(f"{sizes}; expected one compliance and one time for each element")
        return creep

    def below(self, key: str) -> Value | None:
        return CREEP_KEYS[key][0]

    def json(self) -> dict[str, Any]:
        return keys_json(CREEP_KEYS)
