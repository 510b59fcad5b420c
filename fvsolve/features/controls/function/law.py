"""Block with the value of a formula of its inputs and of the time."""

from fvsolve.core.kernels.formula_programs import run_program
from fvsolve.features.controls.kernels.blocks import flag_count, input_change
from fvsolve.jit import njit

START, VALUE, PROGRAM, FLAG = range(4)
"""Numbers of a block: output and value of the formula at the start; header row of its steps in `pieces`; first event
flag of its kinks, -1 for a sampled block."""


@njit
def formula_value(t, y, tables, control, g):
    """Value of the formula; its event functions are written to g unless it is empty."""
    floats, count = tables.floats, control["input_count"]
    for j in range(count):
        tables.stack[j] = floats[control["starts"] + j] + input_change(y, tables, control, j)
    limit, flags = tables.clock[0]["limit"], tables.armed[: flag_count(tables, control)]
    first = int(floats[control["data"] + PROGRAM])
    return run_program(tables.pieces, first, t, limit, count, tables.stack, flags, g)


@njit
def decide(t, y, tables, control):
    """Output before its limits."""
    floats, at = tables.floats, control["data"]
    return floats[at + START] + (
        formula_value(t, y, tables, control, tables.armed[:0]) - floats[at + VALUE]
    )


@njit
def switch(t, y, tables, control, g):
    """Write the two event functions of each kink of the formula to g."""
    formula_value(t, y, tables, control, g)
