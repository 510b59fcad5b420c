"""Codes of elements of networks of rotation, electricity and heat, of their sources and probes."""

from fvsolve.core.kernels.dtypes import FEATURE_VALUE

SLOT = 3  # of the feature `networks`

# Sources: a schedule; quantity of a device, such as the torque of the fluid on its shaft; force on a mass; torque of
# dry friction that slips; heat that an element dissipates; heat from the fluid through a heat exchanger. Later kinds
# depend on earlier ones.
SCHEDULE_INPUT, DEVICE_INPUT, FORCE_INPUT, FRICTION_FLOW, HEAT_INPUT, FLUID_HEAT = 0, 1, 2, 3, 4, 5
NOT_BOOKED, STORED, DISSIPATED, SUPPLIED = 0, 1, 2, 3  # categories of elements in the energy ledger
SWITCH, DIODE, FRICTION = 0, 1, 2  # kinds of switches

# Kind of probes, with a code in `side`: value of row `index`; times that of row `cell`; row `cell` over its value;
# 1 while the friction with the flag `index` sticks; force of the force element `cell` minus the value of row `index`
NETWORK_VALUE = FEATURE_VALUE + SLOT
ROW, POWER, ENTROPY, LOCKED, NET_PUSH = 0, 1, 2, 3, 4
