"""What all devices of a scene do: a template, in which `compose` puts the calls of its kinds in place of `each`."""

from fvsolve.jit import njit
from fvsolve.kernels.records import (
    DEVICE_VALUE,
    I_COLUMNS,
    I_DEVICES,
    I_MARKS,
    I_NODES,
    I_PIPES,
    I_PISTONS,
    I_PROBES,
)

DEVICE = 3  # rows of `power` a device


@njit
def set_devices(t, y, out, tables):
    """Before nodes are closed: conductances, speeds, pressures and stiffness that devices set, from (t, y) alone."""
    for k in range(tables[I_DEVICES].size):
        device = tables[I_DEVICES][k]  # noqa: F841
        # each: set


@njit
def move_devices(t, y, dydt, out, tables):
    """After: d/dt of what devices hold, where dydt is asked for, and their greatest rates into out[RATE]."""
    for k in range(tables[I_DEVICES].size):
        device = tables[I_DEVICES][k]  # noqa: F841
        # each: move


@njit
def device_events(t, y, out, tables, g):
    """Event functions of devices, from a state whose nodes are closed."""
    for k in range(tables[I_DEVICES].size):
        device = tables[I_DEVICES][k]  # noqa: F841
        # each: events


@njit
def observe_devices(t, y, out, tables, values):
    """Values of the probes that read devices."""
    probes = tables[I_PROBES]
    for k in range(probes.size):
        if probes[k]["kind"] == DEVICE_VALUE:
            device, which = tables[I_DEVICES][probes[k]["index"]], probes[k]["side"]  # noqa: F841
            # each: values[k] = value


@njit
def mark_devices(t, out, tables):
    """The first time that each device works where its law is not to be trusted."""
    marks, devices = tables[I_MARKS], tables[I_DEVICES]
    first = tables[I_PIPES].size + 3 * tables[I_NODES].size + tables[I_COLUMNS].size + tables[I_PISTONS].size
    for k in range(devices.size):
        device, beyond = devices[k], False  # noqa: F841
        # each: beyond = outside
        if beyond and marks[first + k] != marks[first + k]:
            marks[first + k] = t


@njit
def power_devices(t, y, dydt, out, tables, power):
    """Rows of devices, the last of `power` [W]: supplied, rate of what is stored, dissipated."""
    devices = tables[I_DEVICES]
    first = power.size - DEVICE * devices.size
    for k in range(devices.size):
        device, rows = devices[k], power[first + DEVICE * k : first + DEVICE * (k + 1)]  # noqa: F841
        rows[0], rows[1], rows[2] = 0.0, 0.0, 0.0
        # each: rows[0], rows[1], rows[2] = power


@njit
def stored_devices(t, y, out, tables, stored):
    """Rows of devices, the last of `stored`, changes since the profile [J]."""
    devices = tables[I_DEVICES]
    first = stored.size - devices.size
    for k in range(devices.size):
        device = devices[k]  # noqa: F841
        stored[first + k] = 0.0
        # each: stored[first + k] = stored
