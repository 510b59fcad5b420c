"""Current, force and stored energy of a solenoid; the network integrates the voltage of its coil to flux linkage."""

from fvsolve.jit import njit

TURNS, CORE, SATURATION, PER_GAP, CLOSED, FLUX, POSITION, SPEED = range(8)
"""Numbers: turns; reluctance of the core [1/H]; 1 / saturation_flux^2, 0 without saturation [1/Wb2]; reluctance per
length of the gap [1/(H m)]; position of the armature without gap [m]; flux [Wb], position
[m] and speed [m/s] of the armature at the start."""
CURRENT, LINKED_FLUX, FORCE, ENERGY = range(4)  # quantities; the last is no probe
TINY = 1e-300  # in place of a zero of an event function


@njit
def quantity_of(quantity, numbers, data, flux, distance, side):
    """Value of a quantity at a flux [Wb] and a distance to the closed position [m].

    numbers, data : array with the numbers of the part, and their offset; side : sign of the distance
    """
    core = numbers[data + CORE]
    per_gap = numbers[data + PER_GAP]
    gap = side * distance
    square = numbers[data + SATURATION] * flux * flux
    if quantity == CURRENT:
        return (core * (1.0 + square) + per_gap * gap) * flux / numbers[data + TURNS]
    if quantity == FORCE:
        return side * 0.5 * per_gap * flux * flux
    if quantity == ENERGY:
        return 0.5 * (core * (1.0 + 0.5 * square) + per_gap * gap) * flux * flux
    return flux


@njit(forceinline=True)
def position_of(y, tables, device):
    """Position of the armature [m]; it may be fixed."""
    start = tables.floats[device["data"] + POSITION]
    return start + (y[device["travel"]] if device["travel"] >= 0 else 0.0)


@njit
def value(t, y, out, tables, device, quantity):
    """Value of a quantity: current [A], flux [Wb], force on the armature [N], or stored energy [J]."""
    numbers, data = tables.floats, device["data"]
    side = 1.0 if tables.armed[device["event"]] > 0.0 else -1.0
    flux = numbers[data + FLUX] + y[device["y"]] / numbers[data + TURNS]
    distance = numbers[data + CLOSED] - position_of(y, tables, device)
    return quantity_of(quantity, numbers, data, flux, distance, side)


@njit
def events(t, y, out, tables, device, g):
    """Write the distance beyond the closed position, and its negative, to g."""
    at = device["event"]
    left = position_of(y, tables, device) - tables.floats[device["data"] + CLOSED]
    if left == 0.0:  # at the closed position the side does not change
        left = -TINY if tables.armed[at] > 0.0 else TINY
    g[at], g[at + 1] = left, -left


@njit
def power(t, y, dydt, out, tables, device):
    """(power supplied, rate of the stored energy, dissipation) [W], the rate i d(flux linkage)/dt - force v."""
    at = device["travel"]
    speed = tables.floats[device["data"] + SPEED] + y[at + 1] if at >= 0 else 0.0
    current = value(t, y, out, tables, device, CURRENT)
    return 0.0, current * dydt[device["y"]] - value(t, y, out, tables, device, FORCE) * speed, 0.0


@njit
def stored(y, tables, device):
    """Change of the stored energy since the start [J]."""
    numbers, data = tables.floats, device["data"]
    start = numbers[data + CLOSED] - numbers[data + POSITION]
    before = quantity_of(
        ENERGY, numbers, data, numbers[data + FLUX], start, 1.0 if start >= 0.0 else -1.0
    )
    return value(0.0, y, y, tables, device, ENERGY) - before
