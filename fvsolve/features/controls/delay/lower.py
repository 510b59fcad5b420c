"""Delays in the tables of a model, and their state at the start."""

from fvsolve.features.controls.delay import law
from fvsolve.features.controls.kernels.input_histories import BEFORE, START
from fvsolve.features.controls.rows import StaticRows, small_change


class DelayRows(StaticRows, kind="delay"):
    """Conversion of delays to table rows."""

    law = law

    def numbers(self, draft, name, block):
        return [0.0, 0.0, small_change(block.dimensions[0])]

    def delay(self, control):
        return control.delay

    def value(self, control, start):
        return start.inputs[0]

    def output_rate(self, control, start, rates):
        return rates[0] if control.initial is None else self.residual(control, start)

    def begin(self, control, start, numbers):
        balanced = control.initial is None
        numbers[START] = start.output if balanced else start.inputs[0]
        numbers[BEFORE] = 0.0 if balanced else start.output - start.inputs[0]
