"""Block with values of a table, interpolated by a monotone cubic and held beyond its ends.

Two pairs of event functions locate the kinks at both ends; their flags select the piece within a step.
"""

from fvsolve.core.kernels.formula_programs import is_low
from fvsolve.features.controls.kernels.blocks import flag_count, input_change
from fvsolve.jit import njit

START, VALUE, FLAG, COUNT, OWN = range(5)
"""Numbers of a block: output and value of the table at the start; first event flag; number n of points; then their n
inputs, and (a, b, c, d) of a + b s + c s^2 + d s^3 of each piece, s from its first point on."""


@njit
def table_value(y, tables, control, armed, g):
    """Value of the table; its event functions are written to g unless it is empty."""
    floats, at = tables.floats, control["data"]
    n, flag = int(floats[at + COUNT]), int(floats[at + FLAG])
    x = floats[control["starts"]] + input_change(y, tables, control, 0)
    first, last = floats[at + OWN], floats[at + OWN + n - 1]
    below, inside = is_low(x - first, 0.0, flag, armed, g), is_low(x - last, 2.0, flag, armed, g)
    x = first if below else x if inside else last
    k = 0
    while k < n - 2 and x >= floats[at + OWN + k + 1]:
        k += 1
    own, s = at + OWN + n + 4 * k, x - floats[at + OWN + k]
    return floats[own] + s * (floats[own + 1] + s * (floats[own + 2] + s * floats[own + 3]))


@njit
def decide(t, y, tables, control):
    """Output before its limits."""
    floats, at = tables.floats, control["data"]
    flags = tables.armed[: flag_count(tables, control)]
    value = table_value(y, tables, control, flags, tables.armed[:0])
    return floats[at + START] + (value - floats[at + VALUE])


@njit
def switch(t, y, tables, control, g):
    """Write the event functions of both ends of the table to g."""
    table_value(y, tables, control, tables.armed, g)
