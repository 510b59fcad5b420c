"""Blocks with a table of values in the tables of a model, and their value at the start."""

import numpy as np

from fvsolve.features.controls.lookup_table import law
from fvsolve.features.controls.rows import StaticRows

EVENTS = ("",) * 4  # both ends of the table, in both directions; not reported


class LookupTableRows(StaticRows, kind="table"):
    """Conversion of blocks with a table to table rows."""

    law = law

    def numbers(self, draft, name, block):
        points = block.control.points
        flag = draft.flags(f"controls.{name}", EVENTS) if block.control.period is None else 0
        pieces = cubic(points).c[::-1].T
        return [0.0, 0.0, float(flag), float(len(points.input)), *points.input, *pieces.ravel()]

    def value(self, control, start):
        points = control.points
        return float(cubic(points)(np.clip(start.inputs[0], points.input[0], points.input[-1])))

    def begin(self, control, start, numbers):
        value = table_value_at(numbers, start.inputs[0])
        numbers[[law.START, law.VALUE]] = self.start_and_value(control, start, value)


def cubic(points):
    """Monotone cubic through the points of a table."""
    from scipy.interpolate import PchipInterpolator

    return PchipInterpolator(points.input, points.output)


def table_value_at(numbers: np.ndarray, x: float) -> float:
    """Value of a table at the input x, by the operations of its law; numbers : those of the block"""
    n = int(numbers[law.COUNT])
    inputs = numbers[law.OWN :][:n]
    x = min(max(x, inputs[0]), inputs[-1])
    k = min(int(np.searchsorted(inputs, x, "right")) - 1, n - 2)
    a, b, c, d = numbers[law.OWN + n + 4 * k :][:4]
    s = x - inputs[k]
    return float(a + s * (b + s * (c + s * d)))
