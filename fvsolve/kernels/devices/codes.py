"""Codes of the laws of devices, as tables hold them."""

CHECK_VALVE = 0
REDUCING, SUSTAINING, FLOW_CONTROL = 1, 2, 3
PUMP = 4
RELIEF, RELIEF_DISC, CHECK_DISC = 5, 6, 7
ACCUMULATOR, AIR_VALVE = 20, 21
