"""Conversion of blocks of `controls` to rows of the table of blocks, one class for each type."""

from __future__ import annotations

import functools
from importlib import import_module
from types import ModuleType
from typing import Any, ClassVar, NamedTuple

import numpy as np

# size of a small change of a quantity [SI], by dimension; 1 for others
SMALL = {"pressure": 1e5, "gauge_pressure": 1e5, "pressure_drop": 1e5, "flow": 1e-3, "number": 0.1, "force": 1e3}


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

    def scales(self, control: Any, change: tuple[float, float]) -> list[float]:
        """Sizes of a small deviation of each state; change : those of the first input and of the output."""
        return []

    def numbers(self, draft, name: str, block: Any) -> list[float]:
        """Numbers of a block, in the order in which its law reads them; those of the start are set by `begin`."""
        return []

    def rate(self, control: Any) -> float:
        """Greatest constant rate of its states [1/s]."""
        return 0.0

    def residual(self, control: Any, start: BlockStart) -> float:
        """Quantity that is zero if the block is at rest with these values."""
        raise NotImplementedError

    def begin(self, control: Any, start: BlockStart, numbers: np.ndarray) -> None:
        """Set the numbers that depend on the start; numbers : view of those of the block."""


@functools.cache
def control_rows_of(control: type) -> ControlRows:
    """Conversion of a type of block, from the module `lower` in the package of its declaration."""
    import_module(f"{control.__module__.rpartition('.')[0]}.lower")
    return ControlRows.kinds[control.kind]
