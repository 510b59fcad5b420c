"""Rate limit: dv/dt = (x - v) / T between -falling and rising. Event flags select the part of this law."""

from fvsolve.core.kernels.formula_programs import is_low
from fvsolve.features.controls.kernels.blocks import input_change
from fvsolve.jit import njit

START, FLAG, RISING, FALLING, RATE = range(5)
"""Numbers of a block: v at the start; first event flag; greatest rates of rise and of fall; 1 / T [1/s]."""


@njit
def decide(t, y, tables, control):
    """Output before its limits."""
    return tables.floats[control["data"] + START] + y[control["y"] + control["filters"]]


@njit
def rate_of(y, tables, control, armed, g):
    """Rate of the output; the event functions of both limits are written to g unless it is empty."""
    floats, at = tables.floats, control["data"]
    x = floats[control["starts"]] + input_change(y, tables, control, 0)
    rate = (x - floats[at + START] - y[control["y"] + control["filters"]]) * floats[at + RATE]
    flag = int(floats[at + FLAG])
    falls = is_low(rate + floats[at + FALLING], 0.0, flag, armed, g)
    rises = is_low(floats[at + RISING] - rate, 2.0, flag, armed, g)
    return -floats[at + FALLING] if falls else floats[at + RISING] if rises else rate


@njit
def adapt(t, y, dydt, tables, control, v, u):
    """Write the rate of the output to `dydt`."""
    dydt[control["y"] + control["filters"]] = rate_of(
        y, tables, control, tables.armed, tables.armed[:0]
    )


@njit
def switch(t, y, tables, control, g):
    """Write the event functions of both limits to g."""
    rate_of(y, tables, control, tables.armed, g)
