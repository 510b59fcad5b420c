"""What all devices of one kind do: a template, in which `loops` puts the kind and its calls in place of `each`."""

from fvsolve.jit import njit
from fvsolve.kernels.devices.codes import PASSING
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import DEVICE_VALUE

KIND = -1
DEVICE = 3  # rows of `power` a device


@njit
def prepare(t, y, dydt, out, handle):
    """Before nodes are closed: conductances, speeds, pressures and stiffness that devices set, from (t, y) alone."""
    tables = open_tables(handle)
    for k in range(tables.devices.size):
        device = tables.devices[k]
        if device["kind"] == KIND:
            ...  # each: set


@njit
def move(t, y, dydt, out, handle):
    """d/dt of what devices hold, where dydt is asked for, and their greatest rates into out[RATE]."""
    tables = open_tables(handle)
    for k in range(tables.devices.size):
        device = tables.devices[k]
        if device["kind"] == KIND:
            ...  # each: move


@njit
def events(t, y, out, handle, g):
    """Event functions of devices, from a state whose nodes are closed."""
    tables = open_tables(handle)
    for k in range(tables.devices.size):
        device = tables.devices[k]
        if device["kind"] == KIND:
            ...  # each: events


@njit
def observe(t, y, out, handle, values):
    """Values of the probes that read devices."""
    tables = open_tables(handle)
    probes = tables.probes
    for k in range(probes.size):
        if probes[k]["kind"] == DEVICE_VALUE:
            device, which = tables.devices[probes[k]["index"]], probes[k]["side"]  # noqa: F841
            if device["kind"] == KIND:
                ...  # each: values[k] = value


@njit
def record(t, y, out, handle, values):
    """The first time that each device works where its law is not to be trusted, and where that passes by itself."""
    tables = open_tables(handle)
    marks, devices = tables.marks, tables.devices
    first = tables.pipes.size + 3 * tables.nodes.size + tables.columns.size + tables.pistons.size
    for k in range(devices.size):
        device, beyond = devices[k], 0
        if device["kind"] == KIND:
            ...  # each: beyond = outside
            at = first + k + (devices.size if beyond == PASSING else 0)
            if beyond and marks[at] != marks[at]:
                marks[at] = t


@njit
def power(t, y, dydt, out, handle, power):
    """Rows of devices, the last of `power` [W]: supplied, rate of what is stored, dissipated."""
    tables = open_tables(handle)
    devices = tables.devices
    first = power.size - DEVICE * devices.size
    for k in range(devices.size):
        device, rows = devices[k], power[first + DEVICE * k : first + DEVICE * (k + 1)]
        if device["kind"] == KIND:
            rows[0], rows[1], rows[2] = 0.0, 0.0, 0.0
            ...  # each: rows[0], rows[1], rows[2] = power


@njit
def stored(t, y, dydt, out, handle, stored):
    """Rows of devices, the last of `stored`, changes since the profile [J]."""
    tables = open_tables(handle)
    devices = tables.devices
    first = stored.size - devices.size
    for k in range(devices.size):
        device = devices[k]
        if device["kind"] == KIND:
            stored[first + k] = 0.0
            ...  # each: stored[first + k] = stored
