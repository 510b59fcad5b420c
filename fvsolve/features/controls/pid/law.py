"""PI and PID control with limits and tracking (anti-windup).

v = K (b r - x) + I + D, u = v within the limits, dI/dt = K (r - x) / Ti + (u - v) / Tt, and D is
K Td s / (1 + Td s / N) applied to c r - x; r is the setpoint, x the input (Astrom and Hagglund 1995, 3.3 to 3.5).
All of them are changes since the start, where v is `START`.
"""

from fvsolve.features.controls.kernels.blocks import input_change, setpoint_change
from fvsolve.jit import njit

START, ERROR, GAIN, WEIGHT, INTEGRAL, TRACKING, LEAD, LEAD_WEIGHT, LEAD_RATE = range(9)
"""Numbers of a block: v at the start; r - x at the start; K; b; 1 / Ti [1/s], 0 for none; 1 / Tt [1/s]; K N, 0 without
derivative; c; N / Td [1/s]."""


@njit
def decide(t, y, tables, control):
    """Output v before its limits."""
    floats = tables.floats
    at = control["data"]
    i = control["y"] + control["filters"]
    r, x = setpoint_change(t, tables, control), input_change(y, tables, control, 0)
    v = floats[at + START] + floats[at + GAIN] * (floats[at + WEIGHT] * r - x)
    if floats[at + INTEGRAL] > 0.0:
        v += y[i]
        i += 1
    if floats[at + LEAD] != 0.0:
        v += floats[at + LEAD] * ((floats[at + LEAD_WEIGHT] * r - x) - y[i])
    return v


@njit
def sample(t, y, tables, control):
    """Output v of a sample; the integral and the filter of the derivative take a step of backward Euler."""
    floats = tables.floats
    at = control["data"]
    own = control["memory"] + 2
    h = control["period"]
    r, x = setpoint_change(t, tables, control), input_change(y, tables, control, 0)
    memory = tables.discrete
    z = floats[at + LEAD_WEIGHT] * r - x
    rate = h * floats[at + LEAD_RATE]
    memory[own] += floats[at + GAIN] * h * (floats[at + ERROR] + (r - x)) * floats[at + INTEGRAL]
    memory[own + 1] = (memory[own + 1] + rate * z) / (1.0 + rate)
    v = floats[at + START] + floats[at + GAIN] * (floats[at + WEIGHT] * r - x) + memory[own]
    v += floats[at + LEAD] * (z - memory[own + 1])
    u = min(max(v, control["least"]), control["greatest"])
    memory[own] += h * (u - v) * floats[at + TRACKING]
    return v


@njit
def adapt(t, y, dydt, tables, control, v, u):
    """Write the rates of the integral, and of the filtered input of the derivative, to `dydt`."""
    floats = tables.floats
    at = control["data"]
    i = control["y"] + control["filters"]
    r, x = setpoint_change(t, tables, control), input_change(y, tables, control, 0)
    if floats[at + INTEGRAL] > 0.0:
        error = floats[at + ERROR] + (r - x)
        dydt[i] = (
            floats[at + GAIN] * error * floats[at + INTEGRAL] + (u - v) * floats[at + TRACKING]
        )
        i += 1
    if floats[at + LEAD] != 0.0:
        dydt[i] = ((floats[at + LEAD_WEIGHT] * r - x) - y[i]) * floats[at + LEAD_RATE]
