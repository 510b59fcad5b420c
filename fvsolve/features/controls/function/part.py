"""Blocks with a formula of their inputs and of the time: keys and faults."""

from dataclasses import dataclass
from keyword import iskeyword
from typing import Annotated, Any, ClassVar

from fvsolve.errors import listing
from fvsolve.parts.control import Control
from fvsolve.parts.formula import FUNCTIONS, TIME_NAMES
from fvsolve.parts.formula_program import Program, program_in
from fvsolve.parts.value import ReadContext, Text, Value, ValueFault, read_each
from fvsolve.units import DIMENSIONS, show, unit_of


@dataclass(frozen=True)
class InputNames(Value):
    """Table of inputs: name in the formula -> probe or block."""

    about: str = "name in the formula, and its probe or controls.NAME"
    takes: ClassVar[str] = "`{ NAME = PROBE }`"
    schema: ClassVar[dict[str, Any]] = {
        "type": "object",
        "additionalProperties": {"type": "string"},
    }

    def read(self, given: Any, setting: ReadContext) -> dict[str, str]:
        if not isinstance(given, dict):
            raise ValueError(f"{show(given)} is not a table of inputs; expected {{ NAME = PROBE }}")
        faults = [((name,), text) for name in given if (text := name_fault(name))]
        if faults:
            raise ValueFault(faults)
        return read_each(given.items(), lambda item: Text().read(item, setting))


RESERVED = (*TIME_NAMES, *FUNCTIONS)


def name_fault(name: str) -> str:
    """Text of the fault of a name in a formula; "" for a valid name."""
    if name in RESERVED or iskeyword(name):
        return f"{show(name)} is reserved; expected another name than {listing(RESERVED, 20)}"
    if not (name.isidentifier() and name.isascii()):
        return f"{show(name)} is not a name in a formula; expected letters a to z, digits and _, a letter first"
    return ""


class FormulaBlock(Control, kind="function"):
    """Block with the value of a formula of its inputs and of the time t, in SI.

    Gain, sum, saturation, dead band and logic by 0 and 1 are such blocks.
    """

    inputs: Annotated[dict[str, str], InputNames()] = {}
    formula: Annotated[str, Text("formula of the names of the inputs and of t, in SI")]
    unit: Annotated[str, Text("unit of the value of the formula; SI if left out")] = ""

    @classmethod
    def inputs_of(cls, given: dict[str, Any]) -> dict[tuple[str, ...], Any]:
        inputs = given.get("inputs")
        return (
            {("inputs", name): text for name, text in inputs.items()}
            if isinstance(inputs, dict)
            else {}
        )

    @classmethod
    def own_dimension(cls, given: dict[str, Any]) -> str | None:
        unit = unit_of(str(given.get("unit", "")))
        return unit.dimension if unit is not None and unit.dimension in DIMENSIONS else None

    @classmethod
    def resolve_keys(cls, given: dict[str, Any], setting: ReadContext) -> dict[str, Any]:
        names = given.get("inputs", {})
        formula = given.get("formula")
        unit = given.get("unit", "")
        sound = isinstance(names, dict) and not any(map(name_fault, names))
        if sound and isinstance(formula, str) and isinstance(unit, str):
            output = setting.block_units[1]
            try:
                program = program_in(
                    unit if output else "", output, formula, tuple(names), setting.ambient
                )
            except ValueFault as error:
                raise ValueFault(error.faults, given) from None
            if (
                not names
                and setting.span is not None
                and (text := program.pole_fault(*setting.span))
            ):
                raise ValueFault([(("formula",), text)], given)
        return given

    def program(self, dimension: str, ambient: float) -> Program:
        """Steps of the formula; dimension : that of the output; ambient : ambient pressure [Pa]"""
        return program_in(self.unit, dimension, self.formula, tuple(self.inputs), ambient)
