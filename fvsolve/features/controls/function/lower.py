"""Blocks with a formula in the tables of a model, and their value at the start."""

import numpy as np

from fvsolve.core.kernels.formula_programs import run_program
from fvsolve.features.controls.function import law
from fvsolve.features.controls.rows import StaticRows
from fvsolve.parts.formula_program import NO_FLAGS


class FunctionRows(StaticRows, kind="function"):
    """Conversion of blocks with a formula to table rows."""

    law = law

    def numbers(self, draft, name, block):
        program = program_of(draft.case, block)
        if block.control.period is not None:
            return [0.0, 0.0, float(draft.schedules.add_program(program, located=False)), -1.0]
        for time in program.break_times:
            draft.schedules.breaks[time] = True
        for time in program.pulses(*draft.schedules.span) if not program.names else ():
            draft.schedules.breaks.setdefault(time, False)
        flag = draft.flags(name, ())
        return [0.0, 0.0, float(draft.schedules.add_program(program)), float(flag)]

    def value(self, control, start):
        return program_of(start.case, start.block).value(start.time, start.time, start.inputs)

    def begin(self, control, start, numbers):
        numbers[[law.START, law.VALUE]] = self.start_and_value(
            control, start, self.value(control, start)
        )

    def flags_at_start(self, control, start, numbers):
        """Flags of the kinks: blocks that remember read a consistent value from the first moment."""
        program = program_of(start.case, start.block)
        if numbers[law.FLAG] < 0.0 or program.kinks == 0:
            return {}
        g, stack = np.zeros(2 * program.kinks), np.zeros(program.stack_size)
        stack[: len(start.inputs)] = start.inputs
        run_program(program.table, 0, start.time, start.time, len(start.inputs), stack, NO_FLAGS, g)
        return {int(numbers[law.FLAG]) + k: bool(g[k] <= 0.0) for k in range(0, g.size, 2)}


def program_of(case, block):
    """Steps of the formula of a block."""
    return block.control.program(block.dimensions[1], case.ambient_pressure)
