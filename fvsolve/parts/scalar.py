"""What the fluid carries with it: temperature, concentration, tracer. Knows numbers; knows no flow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from fvsolve.parts.schedule import Scheduled
from fvsolve.parts.table import Table
from fvsolve.parts.value import PROFILE, VALUE, Misfit, Number, Quantity, Setting, Text, Value, nonnegative
from fvsolve.units import show


class Scalar(Table):
    """A quantity c per mass that the fluid carries: (m c)_t + (M c - D m c_x)_x = -decay m (c - ambient)."""

    unit: Annotated[str, Text("a label, for headers", VALUE)] = "-"
    initial: Annotated[float, Number(about="wherever nothing else is said")] = 0.0
    diffusivity: Annotated[float, Quantity("diffusivity", nonnegative, "along pipes [m2/s]", changes=VALUE)] = 0.0
    decay: Annotated[float, Quantity("rate", nonnegative, "at which it falls to ambient [1/s]", changes=VALUE)] = 0.0
    ambient: Annotated[float, Number(about="what it decays to", changes=VALUE)] = 0.0


@dataclass(frozen=True)
class Carried(Value):
    """Values of scalars by name, each a number or a schedule."""

    about: str = "value of each scalar, by its name"
    value: Value = Scheduled("number")
    changes: str = PROFILE

    def read(self, given: Any, setting: Setting) -> dict[str, Any]:
        if not isinstance(given, dict):
            raise ValueError(f"{show(given)} is no table of scalars; wanted {{ NAME = VALUE }}")
        found, faults = {}, []
        for name, one in given.items():
            try:
                found[name] = self.value.read(one, setting)
            except Misfit as error:
                faults += [((name, *below), message) for below, message in error.faults]
            except ValueError as error:
                faults.append(((name,), str(error)))
        if faults:
            raise Misfit(faults)
        return found

    def below(self, key: str) -> Value | None:
        return self.value

    @property
    def takes(self) -> str:
        return f"`{{ NAME = VALUE }}`, each {self.value.takes}"

    def json(self) -> dict[str, Any]:
        return {"type": "object", "additionalProperties": self.value.json()}
