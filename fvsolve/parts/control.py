"""Blocks of `controls`: base class of their types, keys that all have, and values in units of their input or output."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from fvsolve import units
from fvsolve.parts.kinds import Kinds
from fvsolve.parts.schedule import UNKNOWN, Schedule, Scheduled, constant
from fvsolve.parts.table_model import CaseContext, Faults, Table
from fvsolve.parts.value import (
    PROFILE,
    VALUE,
    Quantity,
    ReadContext,
    Rows,
    Text,
    Value,
    nonnegative,
    positive,
)

MOST_SAMPLES = 1e9  # of a block in a run


def read_in(
    dimensions: tuple[str, ...], read: Callable[[tuple[str, ...]], Any], given: Any, instead: Any
) -> Any:
    """Value of a key in units of the input or of the output; `instead` if it has a unit that cannot be checked.

    dimensions : some may be `UNKNOWN`; read : function of known dimensions. Raises ValueError.
    """
    try:
        return read(tuple(dimension or "number" for dimension in dimensions))
    except ValueError:
        if UNKNOWN in dimensions and has_unit(given):
            return instead
        raise


def has_unit(given: Any) -> bool:
    """True if a value of the case file, or a value in its lists and tables, may have a unit."""
    if isinstance(given, dict):
        return "unit" in given or "signal" in given or any(map(has_unit, given.values()))
    if isinstance(given, (list, tuple)):
        return any(map(has_unit, given))
    return isinstance(given, str) and units.is_number_with_unit(given)


@dataclass(frozen=True)
class OfInput(Value):
    """Schedule in the unit of the first input of the block."""

    about: str = ""
    changes: str = PROFILE
    takes: ClassVar[str] = "unit of the input; schedule"
    schema: ClassVar[dict[str, Any]] = {"type": ["number", "string", "object"]}

    def read(self, given: Any, setting: ReadContext) -> Schedule:
        first = setting.block_units[:1]
        return read_in(
            first, lambda known: Scheduled(*known).read(given, setting), given, constant(0.0)
        )


@dataclass(frozen=True)
class OfOutput(Value):
    """Number in the unit of the output of the block, or several numbers if `length` is given."""

    about: str = ""
    length: int | None = None
    changes: str = PROFILE

    def read(self, given: Any, setting: ReadContext) -> Any:
        def read(known: tuple[str, ...]) -> Any:
            item = Quantity(*known) if self.length is None else Rows(*known, length=self.length)
            return item.read(given, setting)

        return read_in(setting.block_units[1:], read, given, None)

    @property
    def takes(self) -> str:
        return (
            "unit of the output"
            if self.length is None
            else f"list of {self.length}, unit of the output"
        )

    def json(self) -> dict[str, Any]:
        item = {"type": ["number", "string"]}
        return (
            item
            if self.length is None
            else {"type": "array", "items": item, "minItems": self.length}
        )


@dataclass(frozen=True)
class OfInputNumber(Value):
    """Number in the unit of the first input of the block."""

    about: str = ""
    changes: str = PROFILE
    takes: ClassVar[str] = "unit of the input"
    schema: ClassVar[dict[str, Any]] = {"type": ["number", "string"]}

    def read(self, given: Any, setting: ReadContext) -> float:
        first = setting.block_units[:1]
        return read_in(first, lambda known: Quantity(*known).read(given, setting), given, 0.0)


@dataclass(frozen=True)
class OfRate(Value):
    """Number above 0 with the unit of the output over that of a time."""

    about: str = ""
    changes: str = VALUE
    takes: ClassVar[str] = "unit of the output per s, above 0"
    schema: ClassVar[dict[str, Any]] = {"type": ["number", "string"]}

    def read(self, given: Any, setting: ReadContext) -> float:
        output = setting.block_units[1:]
        value = read_in(output, lambda known: units.parse_ratio(given, *known, "time"), given, 1.0)
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
        return read_in(
            setting.block_units,
            lambda known: units.parse_ratio(given, known[1], known[0]),
            given,
            0.0,
        )


class Control(Table):
    """Block of `controls`: its output is a schedule for keys of parts and for other blocks.

    kinds : type in the case file -> class; passes_at_once : True if its output depends on the present values of its
    inputs; integrates : see its docstring; same_unit : True if its output has the unit of its input
    """

    kind: ClassVar[str] = ""
    kinds: ClassVar[Kinds] = Kinds()
    same_unit: ClassVar[bool] = False

    filter: Annotated[
        float | None,
        Quantity(
            "time",
            positive,
            "time constant of a first-order lag of its inputs [s]; none if left out",
        ),
    ] = None
    limits: Annotated[
        tuple[float, float] | None,
        OfOutput("least and greatest output; the range of the driven key if left out", 2),
    ] = None
    period: Annotated[
        float | None,
        Quantity(
            "time",
            positive,
            "time between samples; it acts then, and holds [s]; continuous if left out",
        ),
    ] = None
    offset: Annotated[
        float, Quantity("time", nonnegative, "time of the first sample after the start [s]")
    ] = 0.0
    initial: Annotated[float | None, OfOutput("output at the start; balanced if left out")] = None

    def __init_subclass__(cls, kind: str = "", **rest: Any) -> None:
        super().__init_subclass__(**rest)
        if not cls.__module__.startswith("fvsolve."):
            from fvsolve.core.assembly.lowering_checks import check_methods

            check_methods(cls)
        if kind:
            cls.kind = kind
            cls.kinds.declare(kind, cls, "a control of type")

    @classmethod
    def inputs_of(cls, given: dict[str, Any]) -> dict[tuple[str, ...], Any]:
        """Inputs of a block as in the case file : key path in the block -> text of a probe, or "controls.NAME"."""
        return {("input",): given["input"]} if "input" in given else {}

    @classmethod
    def own_dimension(cls, given: dict[str, Any]) -> str | None:
        """Dimension of the output that the keys of a block state, for a block that drives no key; None if they do not.

        given : keys of the block as in the file
        """
        return None

    def faults(self, name: str, around: CaseContext) -> Faults:
        """Faults of its samples; those of further keys are added in the class of its type."""
        yield from super().faults(name, around)
        if self.period is None and self.offset:
            yield ("offset",), "has no effect without `period`; give both keys, or remove this key"
        if self.period is None:
            return
        if self.offset >= self.period:
            text = f"{self.offset:g} s is not below the period"
            yield ("offset",), f"{text}; expected less than {self.period:g} s"
        if (most := around.times.most(self.period)) > MOST_SAMPLES:
            text = f"{self.period:g} s gives {most:.3g} samples"
            yield ("period",), f"{text}; expected at most {MOST_SAMPLES:.0e} in the run"

    @property
    def setpoint_schedule(self) -> Schedule | None:
        """Schedule of the setpoint; None for a block without a setpoint."""
        return getattr(self, "setpoint", None)

    @property
    def feeds_through(self) -> bool:
        """True if its output at any time depends on its inputs at this time; a sampled block holds its output."""
        return self.passes_at_once and self.period is None

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


class Unsampled(Control):
    """Block that acts at all times, and has no keys for samples."""

    period: ClassVar[None] = None
    offset: ClassVar[float] = 0.0
    synonyms: ClassVar[dict[str, str]] = dict.fromkeys(
        ("period", "offset"), "it in a `function` that reads this block, which acts at all times"
    )


class SingleInput(Control):
    """Block with a single input."""

    input: Annotated[str, Text("probe, such as tower.level, or controls.NAME")]
