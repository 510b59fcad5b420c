"""Transfer function in controllable canonical form, for changes since the start.

dz_k/dt = z_(k+1) for k < n, dz_n/dt = x - a_n z_1 - ... - a_1 z_n, v = START + c_1 z_1 + ... + c_n z_n + D x; x is the
change of the input, z the states. `EXCESS` is the constant part of dz_n/dt, from an input that is not at rest.
"""

from fvsolve.features.controls.kernels.blocks import input_change
from fvsolve.jit import njit

START, DIRECT, EXCESS, COUNT, OWN = range(5)
"""Numbers of a block: v at the start; D; constant part of dz_n/dt; n; then a_n to a_1 and c_1 to c_n. With samples: the
rows of M and the entries of g in z = M z_before + g (x + x_before), Tustin's method."""


@njit
def decide(t, y, tables, control):
    """Output v before its limits."""
    floats = tables.floats
    at = control["data"]
    i = control["y"] + control["filters"]
    n = int(floats[at + COUNT])
    v = floats[at + START]
    if floats[at + DIRECT] != 0.0:
        v += floats[at + DIRECT] * input_change(y, tables, control, 0)
    for k in range(n):
        v += floats[at + OWN + n + k] * y[i + k]
    return v


@njit
def sample(t, y, tables, control):
    """Output v of a sample; the states take a step of the trapezoidal rule (Tustin)."""
    floats = tables.floats
    at = control["data"]
    own = control["memory"] + 2
    memory = tables.discrete
    n, x = int(floats[at + COUNT]), input_change(y, tables, control, 0)
    matrix, gain = at + OWN + 2 * n, at + OWN + 2 * n + n * n
    drive = x + memory[own + 2 * n] + 2.0 * floats[at + EXCESS]
    v = floats[at + START] + floats[at + DIRECT] * x
    for k in range(n):
        memory[own + n + k] = floats[gain + k] * drive
        for j in range(n):
            memory[own + n + k] += floats[matrix + n * k + j] * memory[own + j]
    for k in range(n):
        memory[own + k] = memory[own + n + k]
        v += floats[at + OWN + n + k] * memory[own + k]
    memory[own + 2 * n] = x
    return v


@njit
def adapt(t, y, dydt, tables, control, v, u):
    """Write the rates of all states to `dydt`."""
    floats = tables.floats
    at = control["data"]
    i = control["y"] + control["filters"]
    n = int(floats[at + COUNT])
    rate = floats[at + EXCESS] + input_change(y, tables, control, 0)
    for k in range(n):
        rate -= floats[at + OWN + k] * y[i + k]
    for k in range(n - 1):
        dydt[i + k] = y[i + k + 1]
    dydt[i + n - 1] = rate
