"""Conversion of blocks of `controls` to rows of the table of blocks, one class for each type."""

from __future__ import annotations

import functools
from importlib import import_module
from types import ModuleType
from typing import Any, ClassVar, NamedTuple

import numpy as np

# size of a small change of a quantity [SI], by dimension; 1 for others
SMALL = {
    "pressure": 1e5,
    "gauge_pressure": 1e5,
    "pressure_drop": 1e5,
    "flow": 1e-3,
    "number": 0.1,
    "force": 1e3,
}


DIFFERENCE = 1e-6  # change of an input for differences, relative to a small change


def small_change(dimension: str) -> float:
    """Size of a small change of a quantity of this dimension [SI]."""
    return SMALL.get(dimension, 1.0)


class BlockStart(NamedTuple):
    """Values of a block at the start: of its inputs, of its setpoint (0 without one), and of its output [SI].

    case, block : case and block; time : start time [s]
    """

    case: Any
    block: Any
    time: float
    inputs: tuple[float, ...]
    setpoint: float
    output: float


class ControlRows:
    """Conversion of blocks of one type; law : module of their compiled law, with `decide`, and `adapt` for states."""

    kinds: ClassVar[dict[str, ControlRows]] = {}
    law: ClassVar[ModuleType]

    def __init_subclass__(cls, kind: str = "") -> None:
        if kind:
            ControlRows.kinds[kind] = cls()

    def states(self, control: Any) -> tuple[str, ...]:
        """Names of the states of a block, without those of filters."""
        return ()

    def is_static(self, control: Any) -> bool:
        """True for a block without states, whose output at the start follows from its inputs and its setpoint."""
        return False

    def scales(self, control: Any, change: tuple[float, float]) -> list[float]:
        """Sizes of a small deviation of each state; change : those of the first input and of the output."""
        return []

    def numbers(self, draft, name: str, block: Any) -> list[float]:
        """Numbers of a block, in the order in which its law reads them; those of the start are set by `begin`."""
        return []

    def sampled_numbers(self, control: Any) -> int:
        """Count of the numbers in `discrete` that a block needs if it acts at samples."""
        return 0

    def delay(self, control: Any) -> float:
        """Time by which its output follows its input [s]; 0 if it does not need the history of the input."""
        return 0.0

    def rate(self, control: Any) -> float:
        """Greatest constant rate of its states [1/s]."""
        return 0.0

    def residual(self, control: Any, start: BlockStart) -> float:
        """Quantity that is zero if the block is at rest with these values."""
        raise NotImplementedError

    def output_rate(self, control: Any, start: BlockStart, rates: list[float]) -> float:
        """Rate of its output if its states follow rates of its inputs that last; rates : those of its inputs."""
        return 0.0

    def begin(self, control: Any, start: BlockStart, numbers: np.ndarray) -> None:
        """Set the numbers that depend on the start; numbers : view of those of the block."""

    def flags_at_start(
        self, control: Any, start: BlockStart, numbers: np.ndarray
    ) -> dict[int, bool]:
        """Event flags at the start that do not follow from the state: index -> True if it is set."""
        return {}

    def fault(self, control: Any, start: BlockStart) -> str:
        """Text of the fault of a start that does not tell the state of a block; "" for none."""
        return ""

    def timed_flag(self, numbers: np.ndarray) -> int:
        """Flag at whose changes the time is stored in `discrete`; -1 for none."""
        return -1


class StaticRows(ControlRows):
    """Conversion of blocks without states, whose output is a function of their inputs."""

    def is_static(self, control):
        return True

    def value(self, control: Any, start: BlockStart) -> float:
        """Output for the inputs at the start, before its limits."""
        raise NotImplementedError

    def residual(self, control, start):
        return self.value(control, start) - start.output

    def start_and_value(self, control: Any, start: BlockStart, value: float) -> tuple[float, float]:
        """(output from which the law continues, value of the law at the start); a stated `initial` leaves no offset."""
        return value if control.initial is not None else start.output, value

    def output_rate(self, control, start, rates):
        result, here = 0.0, self.value(control, start)
        for j, rate in enumerate(rates):
            step = DIFFERENCE * small_change(start.block.dimensions[0])
            moved = (*start.inputs[:j], start.inputs[j] + step, *start.inputs[j + 1 :])
            result += (self.value(control, start._replace(inputs=moved)) - here) / step * rate
        return result


@functools.cache
def control_rows_of(control: type) -> ControlRows:
    """Conversion of a type of block, from the module `lower` in the package of its declaration.

    Raises FvsolveError for a faulty conversion or law of another package.
    """
    package = control.__module__.rpartition(".")[0]
    import_module(f"{package}.lower")
    if package.startswith("fvsolve."):
        return ControlRows.kinds[control.kind]
    from fvsolve.features.controls.row_checks import checked

    own = ControlRows.kinds.get(control.kind)
    return checked(control, own or StaticRows(), StaticRows, ControlRows)
