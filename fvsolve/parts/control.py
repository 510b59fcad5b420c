"""Blocks of `controls`: base class of their types, keys that all have, and values in units of their input or output."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from fvsolve import units
from fvsolve.errors import FvsolveError
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.table_model import Table
from fvsolve.parts.value import PROFILE, VALUE, Quantity, ReadContext, Rows, Text, Value, positive
from fvsolve.units import show

PREFIX = "controls."  # of a block in the key `input` of another block


@dataclass(frozen=True)
class OfInput(Value):
    """Schedule in the unit of the first input of the block."""

    about: str = ""
    changes: str = PROFILE
    takes: ClassVar[str] = "unit of the input; schedule"
    schema: ClassVar[dict[str, Any]] = {"type": ["number", "string", "object"]}

    def read(self, given: Any, setting: ReadContext) -> Schedule:
        return Scheduled(setting.block_units[0]).read(given, setting)


@dataclass(frozen=True)
class OfOutput(Value):
    """Number in the unit of the output of the block, or several numbers if `length` is given."""

    about: str = ""
    length: int | None = None
    changes: str = PROFILE

    def read(self, given: Any, setting: ReadContext) -> Any:
        dimension = setting.block_units[1]
        item = Quantity(dimension) if self.length is None else Rows(dimension, length=self.length)
        return item.read(given, setting)

    @property
    def takes(self) -> str:
        return "unit of the output" if self.length is None else f"list of {self.length}, unit of the output"

    def json(self) -> dict[str, Any]:
        item = {"type": ["number", "string"]}
        return item if self.length is None else {"type": "array", "items": item, "minItems": self.length}


@dataclass(frozen=True)
class OfInputNumber(Value):
    """Number in the unit of the first input of the block."""

    about: str = ""
    changes: str = PROFILE
    takes: ClassVar[str] = "unit of the input"
    schema: ClassVar[dict[str, Any]] = {"type": ["number", "string"]}

    def read(self, given: Any, setting: ReadContext) -> float:
        return Quantity(setting.block_units[0]).read(given, setting)


@dataclass(frozen=True)
class OfRate(Value):
    """Number above 0 with the unit of the output over that of a time."""

    about: str = ""
    changes: str = VALUE
    takes: ClassVar[str] = "unit of the output per s, above 0"
    schema: ClassVar[dict[str, Any]] = {"type": ["number", "string"]}

    def read(self, given: Any, setting: ReadContext) -> float:
        value = units.parse_ratio(given, setting.block_units[1], "time")
        positive.check(value, given)
        return value


@dataclass(frozen=True)
class Gain(Value):
    """Number with the unit of the output over that of the input; a bare number is in SI."""

    about: str = ""
    changes: str = PROFILE
    takes: ClassVar[str] = "unit of the output over unit of the input"
    schema: ClassVar[dict[str, Any]] = {"type": ["number", "string"]}

    def read(self, given: Any, setting: ReadContext) -> float:
        under, over = setting.block_units
        return units.parse_ratio(given, over, under)


class Control(Table):
    """Block of `controls`: its output is a schedule for keys of parts and for other blocks.

    kinds : type in the case file -> class; passes_at_once : True if its output depends on the present values of its
    inputs; integrates : see `integrating`
    """

    kind: ClassVar[str] = ""
    kinds: ClassVar[dict[str, type[Control]]] = {}

    filter: Annotated[
        float | None,
        Quantity("time", positive, "time constant of a first-order lag of its inputs [s]; none if left out"),
    ] = None
    limits: Annotated[
        tuple[float, float] | None,
        OfOutput("least and greatest output; the range of the driven key if left out", 2),
    ] = None
    initial: Annotated[float | None, OfOutput("output at the start; balanced if left out")] = None

    def __init_subclass__(cls, kind: str = "", **rest: Any) -> None:
        super().__init_subclass__(**rest)
        if kind:
            if kind in cls.kinds:
                raise FvsolveError(f"a control of type {show(kind)} exists already; expected another name")
            cls.kind = kind
            cls.kinds[kind] = cls

    @classmethod
    def inputs_of(cls, given: dict[str, Any]) -> dict[tuple[str, ...], Any]:
        """Inputs of a block as in the case file : key path in the block -> text of a probe, or "controls.NAME"."""
        return {("input",): given["input"]} if "input" in given else {}

    @classmethod
    def own_dimension(cls, given: dict[str, Any], first: str, output: str) -> str | None:
        """Dimension of the output that the keys of a block state; None if the driven keys decide.

        first, output : dimensions of its first input, and of its output as far as known
        """
        return None

    @property
    def setpoint_schedule(self) -> Schedule | None:
        """Schedule of the setpoint; None for a block without a setpoint."""
        return getattr(self, "setpoint", None)

    @property
    def initial_output(self) -> float | None:
        """Output at the start if it is stated, else None."""
        return self.initial

    @property
    def switches(self) -> bool:
        """True if its output only changes at events, so that its limits have none."""
        return False

    @property
    def integrates(self) -> bool:
        """True if its output is constant only while its input agrees with its setpoint."""
        return False

    @property
    def passes_at_once(self) -> bool:
        """True if its output depends on the present values of its inputs."""
        return self.filter is None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        limits = given.get("limits")
        numbers = isinstance(limits, list) and len(limits) == 2 and all(isinstance(x, (int, float)) for x in limits)
        if numbers and not limits[0] < limits[1]:
            text = f"{show(limits)} has no values between; expected the least value, then the greatest"
            faults.append((("limits",), text))
        return faults


class SingleInput(Control):
    """Block with a single input."""

    input: Annotated[str, Text("probe, such as tower.level, or controls.NAME")]
