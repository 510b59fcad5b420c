"""Kelvin-Voigt elements of a wall: what a case may say of them. Knows lists of numbers; computes nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fvsolve.parts.value import SHAPE, Misfit, Setting, Value
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


class Elements(Value):
    """The table of Kelvin-Voigt elements: as many compliances as times, all positive."""

    about = "what the wall gives way by in time, Kelvin-Voigt elements"
    takes = "`{ compliance, time }`, lists of 1/Pa and s"
    changes = SHAPE

    def read(self, given: Any, setting: Setting) -> Creep:
        if isinstance(given, Creep):
            return given
        if not isinstance(given, dict):
            raise ValueError(f"{show(given)} is no table; wanted {{ compliance = [1e-10], time = [0.05] }}, 1/Pa and s")
        faults: list = [((key,), "unknown key; keys are compliance, time") for key in given if key not in LISTS]
        found = {}
        for key in LISTS:
            try:
                found[key] = _positives(given[key], LISTS[key])
            except KeyError:
                faults.append(((), f"{key} is missing"))
            except ValueError as error:
                faults.append(((key,), str(error)))
        if not faults and len(found["compliance"]) != len(found["time"]):
            sizes = " and ".join(f"{len(found[key])} of {key}" for key in LISTS)
            faults.append(((), f"{sizes}; wanted one of each an element"))
        if faults:
            raise Misfit(faults)
        return Creep(**found)

    def below(self, key: str) -> Value | None:
        if key not in LISTS:
            raise KeyError(key)
        return None

    def json(self) -> dict[str, Any]:
        lists = {key: {"type": "array", "items": {"type": ["number", "string"]}} for key in LISTS}
        return {"type": "object", "properties": lists, "required": list(LISTS), "additionalProperties": False}


LISTS = {"compliance": "number", "time": "time"}


def _positives(given: Any, dimension: str) -> tuple[float, ...]:
    if not isinstance(given, (list, tuple)) or not given:
        raise ValueError(f"{show(given)} is no list of numbers; wanted one an element")
    found = tuple(float(parse(one, dimension)) for one in given)
    for one, value in zip(given, found, strict=True):
        if not value > 0.0:
            raise ValueError(f"{show(one)} is out of range; wanted a value above 0")
    return found
