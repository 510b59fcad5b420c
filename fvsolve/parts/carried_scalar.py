"""Scalars transported by the fluid: temperature, concentration, tracer."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from fvsolve.parts.schedule import Scheduled
from fvsolve.parts.table_model import Table
from fvsolve.parts.value import (
    PROFILE,
    VALUE,
    Number,
    Quantity,
    ReadContext,
    Text,
    UsualRange,
    Value,
    nonnegative,
    positive,
    read_each,
)
from fvsolve.units import show


@dataclass(frozen=True)
class Composition(Value):
    """Value of a case file: atoms in a molecule, element -> count above 0."""

    about: str = "atoms in a molecule, element -> count, which balance in reactions"
    changes: str = VALUE
    takes: ClassVar[str] = "`{ ELEMENT = COUNT }`"
    schema: ClassVar[dict[str, Any]] = {"type": "object", "additionalProperties": {"type": "number"}}

    def read(self, given: Any, setting: ReadContext) -> dict[str, float]:
        if not isinstance(given, dict) or not given:
            raise ValueError(f"{show(given)} is not a table of atoms; expected for example {{ H = 2, O = 1 }}")
        return read_each(given.items(), lambda item: Number(positive).read(item, setting))


MOLAR_MASSES = UsualRange(1e-3, 1.0, "hydrogen to large organic molecules")  # [kg/mol]


class Scalar(Table):
    """Quantity c per mass, transported by the fluid: (m c)_t + (M c - D m c_x)_x = -decay m (c - ambient).

    m is the mass of fluid per length, M the mass flow, D the `diffusivity`; indices t and x are derivatives.
    """

    unit: Annotated[str, Text("unit, a label in headers", VALUE)] = "-"
    initial: Annotated[float, Number(about="initial value where a part states no other value")] = 0.0
    diffusivity: Annotated[
        float, Quantity("diffusivity", nonnegative, "diffusivity along pipes [m2/s]", changes=VALUE)
    ] = 0.0
    decay: Annotated[float, Quantity("rate", nonnegative, "rate of decay towards ambient [1/s]", changes=VALUE)] = 0.0
    ambient: Annotated[float, Number(about="value towards which the scalar decays", changes=VALUE)] = 0.0
    molar_mass: Annotated[
        float | None,
        Quantity("molar_mass", positive, "molar mass, for reactions of a mass per volume", MOLAR_MASSES, VALUE),
    ] = None
    composition: Annotated[dict[str, float] | None, Composition()] = None


@dataclass(frozen=True)
class ScalarValues(Value):
    """Value of a case file for transported scalars, name -> number or schedule."""

    about: str = "value of each scalar, by its name"
    value: Value = Scheduled("number")
    changes: str = PROFILE

    def read(self, given: Any, setting: ReadContext) -> dict[str, Any]:
        if not isinstance(given, dict):
            raise ValueError(f"{show(given)} is not a table of scalars; expected {{ NAME = VALUE }}")
        return read_each(given.items(), lambda item: self.value.read(item, setting))

    def below(self, key: str) -> Value | None:
        return self.value

    @property
    def takes(self) -> str:
        return f"`{{ NAME = VALUE }}`, each {self.value.takes}"

    def json(self) -> dict[str, Any]:
        return {"type": "object", "additionalProperties": self.value.json()}
