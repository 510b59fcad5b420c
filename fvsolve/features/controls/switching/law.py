"""Relay, latch and timer: two outputs, selected by an event flag.

The event function of a flag is above zero while it is off, and below while it is on; each is followed by its negative.
A timer has a flag for its input, then one for its state; `discrete` has the time at which its input last changed.
"""

from fvsolve.core.kernels.formula_programs import TIE
from fvsolve.features.controls.kernels.blocks import input_change
from fvsolve.jit import njit

MODE, FLAG, LOW, HIGH, ON, OFF = range(6)
"""Numbers of a block: mode; first event flag; output while off and while on; thresholds of a relay, or delays of
a timer [s]."""
RELAY, LATCH, TIMER = 0, 1, 2
THRESHOLD = 0.5  # of inputs that are logical


@njit
def decide(t, y, tables, control):
    """Output of the present state."""
    floats, at = tables.floats, control["data"]
    flag = int(floats[at + FLAG]) + (2 if floats[at + MODE] == TIMER else 0)
    return floats[at + HIGH] if tables.armed[flag] > 0.0 else floats[at + LOW]


@njit(forceinline=True)
def value_of(y, tables, control, j):
    """Value of input j."""
    return tables.floats[control["starts"] + j] + input_change(y, tables, control, j)


@njit(forceinline=True)
def write_pair(g, at, left):
    """Write the event function of a flag, the distance `left` to its condition, and its negative."""
    g[at], g[at + 1] = left, -left if left != 0.0 else TIE


@njit
def switch(t, y, tables, control, g):
    """Write the event functions of the block to g."""
    floats = tables.floats
    at = control["data"]
    armed = tables.armed
    flag, x = int(floats[at + FLAG]), value_of(y, tables, control, 0)
    on = armed[flag] > 0.0
    if floats[at + MODE] == RELAY:
        side = 1.0 if floats[at + ON] < floats[at + OFF] else -1.0
        write_pair(g, flag, side * (x - floats[at + (OFF if on else ON)]))
    elif floats[at + MODE] == LATCH:
        reset = value_of(y, tables, control, 1) - THRESHOLD
        write_pair(g, flag, reset if on else max(THRESHOLD - x, reset))
    else:
        write_pair(g, flag, THRESHOLD - x)
        waits, since = armed[flag + 2] > 0.0, tables.discrete[control["memory"]]
        left = since + floats[at + ON] - t if on else t - since - floats[at + OFF]
        if on == waits:  # its state agrees with its input
            left = -1.0 if on else 1.0
        write_pair(g, flag + 2, left)
