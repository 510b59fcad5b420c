"""Blocks with a formula in the tables of a model, and their value at the start."""

from fvsolve.assembly.control_rows import StaticRows
from fvsolve.parts.function import law


class FunctionRows(StaticRows, kind="function"):
    """Conversion of blocks with a formula to table rows."""

    law = law

    def numbers(self, draft, name, block):
        program = program_of(draft.case, block)
        if block.control.period is not None:
            return [0.0, 0.0, float(draft.schedules.add_program(program, located=False))]
        for time in program.break_times:
            draft.schedules.breaks[time] = True
        return [0.0, 0.0, float(draft.schedules.add_program(program))]

    def value(self, control, start):
        return program_of(start.case, start.block).value(start.time, start.time, start.inputs)

    def begin(self, control, start, numbers):
        numbers[law.START], numbers[law.VALUE] = start.output, self.value(control, start)


def program_of(case, block):
    """Steps of the formula of a block."""
    return block.control.program(block.dimensions[1], case.ambient_pressure)
