"""Tables of networks, behind the same handle as those of the model."""

import functools
from collections import namedtuple

from fvsolve.core.kernels import table_handle
from fvsolve.core.kernels.dtypes import f8, i8, record
from fvsolve.jit import COMPILING, Intrinsic
from fvsolve.parts.law_elements import SLOT

NETWORK_INPUT = record(  # source of a network of potential and flow, see `networks`
    kind=i8,  # a code of sources of `parts.law_elements`
    index=i8,  # schedule, device, mass, switch, element or heat exchanger
    side=i8,  # of a device: quantity that is read
    sign=f8,  # factor of the value that is read
    start=f8,  # value at the start
)
NETWORK_RATE = record(
    y=i8,  # state whose rate is the value of the row of the same number
)
NETWORK_ELEMENT = record(  # element of a network with power
    drop=i8,  # row of its difference of potentials
    flow=i8,  # row of its flow
    category=i8,  # NOT_BOOKED, STORED, DISSIPATED or SUPPLIED
    thermal=i8,  # 1 if its flow is a heat flow: then its power is `weight` times the flow
    weight=f8,  # of a thermal element: 1 or -1 if it has only a start or an end, else 0
    capacity=f8,  # of a store of potential, else 0
    inertance=f8,  # of a store of flow, else 0
    start=f8,  # potential or flow that it stores at the start
)
NETWORK_SWITCH = record(
    kind=i8,  # SWITCH, DIODE or FRICTION
    flag=i8,  # first of two event flags, of friction four
    schedule=i8,  # of a switch; torque of a clutch; -1 for none
    drop=i8,  # row of its difference of potentials
    flow=i8,  # row of its flow, of friction while it sticks
    forward=f8,  # forward voltage of a diode [V]
    kinetic=f8,  # friction torque in motion [N m]
    static=f8,  # greatest friction torque at rest [N m]
    stribeck=f8,  # speed at which the excess at rest has fallen to 1/e; 0 for none [rad/s]
    factor=f8,  # greatest torque at rest over a scheduled torque
    rounding=f8,  # slip of friction, or reverse current of a diode, that is rounding
)
NETWORK_SETTINGS = record(
    inputs=i8,  # offset in `out` of the sources: change since the start
    zero=f8,  # absolute temperature at which the temperature of the fluid is 0 in its unit [K]
)
# turned : row of the speed of each shaft that a device reads; turned_devices : these devices
# thermal_rows : row of the temperature of the thermal node of each heat exchanger
# network_places, network_factors : written by a run, see `networks`
NetworkTables = namedtuple(
    "NetworkTables",
    (
        "network_inputs",
        "network_rates",
        "network_elements",
        "network_switches",
        "network_settings",
        "turned",
        "turned_devices",
        "thermal_rows",
        "network_places",
        "network_factors",
    ),
)


@functools.cache
def network_types() -> NetworkTables:
    """Numba types of these tables."""
    from numba import from_dtype, types

    records = (NETWORK_INPUT, NETWORK_RATE, NETWORK_ELEMENT, NETWORK_SWITCH, NETWORK_SETTINGS)
    kinds = (*map(from_dtype, records), *[types.int64] * 4, types.float64)
    return NetworkTables(*(types.Array(kind, 1, "C") for kind in kinds))


if COMPILING:

    @Intrinsic
    def open_networks(typingctx, handle):
        """Tables behind a handle as `open_tables`, and those of networks."""
        return table_handle.open_with("NetworkTables", network_types, SLOT, handle)
else:

    def open_networks(handle):
        """Tables of a handle as `open_tables`, and those of networks."""
        core = table_handle.open_tables(handle)
        return table_handle.BothTables(core, core.features[SLOT])
