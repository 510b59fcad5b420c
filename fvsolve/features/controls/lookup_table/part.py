"""Blocks with a table of values: keys and faults."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.parts.control import SingleInput, read_in
from fvsolve.parts.table_model import ListTable, read_lists
from fvsolve.parts.value import NEEDED, PROFILE, ReadContext, Rows, Value
from fvsolve.units import show


@dataclass(frozen=True, eq=False)
class Points(ListTable):
    """Points of a table: inputs, increasing, and outputs [SI]."""

    input: tuple[float, ...]
    output: tuple[float, ...]


@dataclass(frozen=True)
class PointsValue(Value):
    """Table of a block: list of inputs, increasing, and of outputs."""

    about: str = "inputs, increasing, and outputs; held beyond the ends"
    changes: str = PROFILE
    takes: ClassVar[str] = "`{ input = [...], output = [...] }`"
    schema: ClassVar[dict[str, Any]] = {"type": "object"}

    def read(self, given: Any, setting: ReadContext) -> Points:
        if isinstance(given, Points):
            return given
        if not isinstance(given, dict):
            raise ValueError(
                f"{show(given)} is not a table; expected {{ input = [...], output = [...] }}"
            )

        def few(inputs, outputs):
            return [(("input",), "has one value; expected two or more")] if len(inputs) < 2 else []

        def read(known: tuple[str, ...]) -> Points:
            keys = {
                key: (Rows(dimension), NEEDED)
                for key, dimension in zip(("input", "output"), known, strict=True)
            }
            return Points(*read_lists(given, keys, setting, "inputs", few))

        return read_in(setting.block_units, read, given, Points((0.0, 1.0), (0.0, 1.0)))


class LookupTable(SingleInput, kind="table"):
    """Block with values of a table, interpolated by a monotone cubic and held beyond its ends."""

    points: Annotated[Points, PointsValue(), Field(alias="table")]
