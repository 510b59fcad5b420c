"""Loops over all devices of a model, which call the functions of the devices' laws by address."""

from fvsolve.core.kernels import calls
from fvsolve.core.kernels.dtypes import DEVICE_VALUE
from fvsolve.core.kernels.energy_rows import DEVICE_ROWS, device_power_row, device_stored_row
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.jit import njit

# columns of `hooks`
(
    SET,
    MOVE,
    EVENTS,
    VALUE,
    OUTSIDE,
    POWER,
    HEAT,
    STORED,
    STEP,
    SLOPE,
    LIFT,
    BENDS,
    LEAD,
) = range(len(calls.HOOKS))
# result of a hook `outside`: to be reported, but it ends by itself when a check valve closes
TEMPORARY = 2


@njit
def set_devices(t, y, dydt, out, handle):
    """Write conductances, speeds, pressures and stiffness that devices set to `out`, before the nodes are solved."""
    tables = open_tables(handle)
    for k in range(tables.devices.size):
        device = tables.devices[k]
        hook = tables.hooks[device["hooks"], SET]
        # The address 0 stands for a function that the law of the device does not have.
        if hook != 0:
            calls.call_set(hook, t, y, out, tables, device)


@njit
def device_rates(t, y, dydt, out, handle):
    """Write d/dt of device states to `dydt`, and raise out[RATE] to their greatest rate [1/s]; if `dydt` is not empty.

    Laws would otherwise need a branch each, without which they write beyond their array.
    """
    if dydt.size == 0:
        return
    tables = open_tables(handle)
    for k in range(tables.devices.size):
        device = tables.devices[k]
        hook = tables.hooks[device["hooks"], MOVE]
        if hook != 0:
            calls.call_move(hook, t, y, dydt, out, tables, device)


@njit
def device_events(t, y, out, handle, g):
    """Write the event functions of devices to g, from a state with solved nodes."""
    tables = open_tables(handle)
    for k in range(tables.devices.size):
        device = tables.devices[k]
        hook = tables.hooks[device["hooks"], EVENTS]
        if hook != 0:
            calls.call_events(hook, t, y, out, tables, device, g)


@njit
def observe_devices(t, y, out, handle, values):
    """Write the values of the probes of devices to `values`."""
    tables = open_tables(handle)
    probes = tables.probes
    for k in range(probes.size):
        if probes[k]["kind"] == DEVICE_VALUE:
            device = tables.devices[probes[k]["index"]]
            hook = tables.hooks[device["hooks"], VALUE]
            if hook != 0:
                values[k] = calls.call_value(hook, t, y, out, tables, device, probes[k]["side"])


@njit
def record_devices(t, y, out, handle, values):
    """Record the first time at which each device leaves the range of validity of its law, in `marks`.

    Temporary violations, which end by themselves, have entries of their own.
    """
    tables = open_tables(handle)
    marks, devices = tables.marks, tables.devices
    first = tables.layout[0]["device_mark"]
    for k in range(devices.size):
        hook = tables.hooks[devices[k]["hooks"], OUTSIDE]
        beyond = calls.call_outside(hook, out, tables, devices[k]) if hook != 0 else 0
        at = first + k + (devices.size if beyond == TEMPORARY else 0)
        # A mark is NaN until the first time is recorded.
        if beyond != 0 and marks[at] != marks[at]:
            marks[at] = t


@njit
def power_devices(t, y, dydt, out, handle, power):
    """Write for each device the power supplied, the rate of stored energy and the dissipation [W] to `power`."""
    tables = open_tables(handle)
    devices, at = tables.devices, device_power_row(tables, power)
    for k in range(devices.size):
        hook = tables.hooks[devices[k]["hooks"], POWER]
        power[at], power[at + 1], power[at + 2] = 0.0, 0.0, 0.0
        if hook != 0:
            power[at], power[at + 1], power[at + 2] = calls.call_power(
                hook, t, y, dydt, out, tables, devices[k]
            )
        at += DEVICE_ROWS


@njit
def stored_devices(t, y, dydt, out, handle, stored):
    """Write for each device the change of its stored energy since the start [J] to `stored`."""
    tables = open_tables(handle)
    devices, first = tables.devices, device_stored_row(tables, stored)
    for k in range(devices.size):
        hook = tables.hooks[devices[k]["hooks"], STORED]
        stored[first + k] = calls.call_stored(hook, y, tables, devices[k]) if hook != 0 else 0.0
