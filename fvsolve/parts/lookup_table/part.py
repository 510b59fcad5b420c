"""Blocks with a table of values: keys and faults."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.parts.control import SingleInput
from fvsolve.parts.table_model import ListTable, read_lists
from fvsolve.parts.value import NEEDED, PROFILE, ReadContext, Rows, Value


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
            raise ValueError("expected a table { input = [...], output = [...] }")
        first, output = setting.block_units
        keys = {"input": (Rows(first), NEEDED), "output": (Rows(output), NEEDED)}

        def few(inputs, outputs):
            return [(("input",), "has one value; expected two or more")] if len(inputs) < 2 else []

        return Points(*read_lists(given, keys, setting, "inputs", few))


class LookupTable(SingleInput, kind="table"):
    """Block with values of a table, interpolated by a monotone cubic and held beyond its ends."""

    points: Annotated[Points, PointsValue(), Field(alias="table")]
