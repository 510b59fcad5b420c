"""Scalars transported by the fluid: temperature, concentration, tracer."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from fvsolve.parts.schedule import Scheduled
from fvsolve.parts.table_model import Table
from fvsolve.parts.value import (
    PROFILE,
    SHAPE,
    VALUE,
    Flag,
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
    schema: ClassVar[dict[str, Any]] = {
        "type": "object",
        "additionalProperties": {"type": "number"},
    }

    def read(self, given: Any, setting: ReadContext) -> dict[str, float]:
        if not isinstance(given, dict) or not given:
            raise ValueError(
                f"{show(given)} is not a table of atoms; expected for example {{ H = 2, O = 1 }}"
            )
        return read_each(given.items(), lambda item: Number(positive).read(item, setting))


MOLAR_MASSES = UsualRange(1e-3, 1.0, "hydrogen to large organic molecules")  # [kg/mol]


@dataclass(frozen=True)
class PartNames(Value):
    """Value of a case file: names of parts, or "all"."""

    about: str = ""
    changes: str = SHAPE
    takes: ClassVar[str] = '`["NAME", ...]`, `"all"`'
    schema: ClassVar[dict[str, Any]] = {
        "anyOf": [{"const": "all"}, {"type": "array", "items": {"type": "string"}}]
    }

    def read(self, given: Any, setting: ReadContext) -> str | tuple[str, ...]:
        if given == "all":
            return given
        if not isinstance(given, (list, tuple)) or not all(isinstance(name, str) for name in given):
            raise ValueError(
                f'{show(given)} is not a list of names; expected ["NAME", ...] or "all"'
            )
        return tuple(given)


# units of a temperature that heat changes: absolute temperature of 0 [K]
ZEROS = {"K": 0.0, "degC": 273.15}
# unit of a scalar -> amount of substance per volume [mol/m3]
AMOUNT_UNITS = {"mol/m3": 1.0, "mmol/l": 1.0}
MASS_UNIT, MASS = "mg/l", 1e-3  # mass per volume [kg/m3]


class Scalar(Table):
    """Quantity c per mass, transported by the fluid: (m c)_t + (M c - D m c_x)_x = -decay m (c - ambient) + Q / cp.

    m is the mass of fluid per length, M the mass flow, D the `diffusivity`; indices t and x are derivatives. Q is the
    heat per length that parts in `heat_from` dissipate, cp the `specific_heat`.
    """

    unit: Annotated[
        str, Text("unit, a label in headers; with `heat` K (if left out) or degC", VALUE)
    ] = "-"
    initial: Annotated[float, Number(about="initial value where a part states no other value")] = (
        0.0
    )
    diffusivity: Annotated[
        float, Quantity("diffusivity", nonnegative, "diffusivity along pipes [m2/s]", changes=VALUE)
    ] = 0.0
    decay: Annotated[
        float, Quantity("rate", nonnegative, "rate of decay towards ambient [1/s]", changes=VALUE)
    ] = 0.0
    ambient: Annotated[
        float, Number(about="value towards which the scalar decays", changes=VALUE)
    ] = 0.0
    molar_mass: Annotated[
        float | None,
        Quantity(
            "molar_mass",
            positive,
            "molar mass, for reactions of a mass per volume",
            MOLAR_MASSES,
            VALUE,
        ),
    ] = None
    composition: Annotated[dict[str, float] | None, Composition()] = None
    heat: Annotated[bool, Flag("true for the temperature of the fluid, which heat changes")] = False
    specific_heat: Annotated[
        float | None,
        Quantity(
            "specific_heat",
            positive,
            "specific heat of the fluid, for `heat` and heat in walls of pipes [J/kg/K]; that of the fluid if left out",
            UsualRange(500.0, 15e3, "liquid metals to liquid hydrogen"),
        ),
    ] = None
    heat_from: Annotated[
        str | tuple[str, ...] | None,
        PartNames('parts whose dissipated power heats the fluid, or "all"; none if left out'),
    ] = None

    @classmethod
    def resolve_keys(cls, given: dict[str, Any], setting: ReadContext) -> dict[str, Any]:
        return {"unit": "K"} | given if given.get("heat") is True else given

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        faults = super().key_faults(given)
        if (
            given.get("heat") is True
            and isinstance(unit := given.get("unit", "K"), str)
            and unit not in ZEROS
        ):
            faults.append(
                (
                    ("unit",),
                    f"{show(unit)} is not a unit of a temperature with heat; expected K or degC",
                )
            )
        if given.get("heat", False) is False:
            faults += [(("heat_from",), "needs heat = true")] if "heat_from" in given else []
        return faults

    @property
    def zero(self) -> float:
        """Absolute temperature at which the value of a scalar with heat is 0 [K]."""
        return ZEROS.get(self.unit, 0.0)


def molar_factor(scalar: Scalar) -> float | None:
    """Amount of substance per volume [mol/m3] of the value 1 of a scalar; None if its unit is no amount."""
    unit = scalar.unit.replace(" ", "").replace("³", "3").replace("^", "").replace("L", "l")
    if unit == MASS_UNIT:
        return None if scalar.molar_mass is None else MASS / scalar.molar_mass
    return AMOUNT_UNITS.get(unit)


@dataclass(frozen=True)
class ScalarValues(Value):
    """Value of a case file for transported scalars, name -> number or schedule."""

    about: str = "value of each scalar, by its name"
    value: Value = Scheduled("number")
    changes: str = PROFILE

    def read(self, given: Any, setting: ReadContext) -> dict[str, Any]:
        if not isinstance(given, dict):
            raise ValueError(
                f"{show(given)} is not a table of scalars; expected {{ NAME = VALUE }}"
            )
        return read_each(given.items(), lambda item: self.value.read(item, setting))

    def below(self, key: str) -> Value | None:
        return self.value

    @property
    def takes(self) -> str:
        return f"`{{ NAME = VALUE }}`, each {self.value.takes}"

    def json(self) -> dict[str, Any]:
        return {"type": "object", "additionalProperties": self.value.json()}
