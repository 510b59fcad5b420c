"""Codes of the laws of devices, as tables hold them."""

CHECK_VALVE = 0
REDUCING, SUSTAINING, FLOW_CONTROL = 1, 2, 3
PUMP = 4
RELIEF, RELIEF_DISC, CHECK_DISC = 5, 6, 7
PASSING = 2  # of a law's `outside`: to be known, but it passes with the shutting of a check valve
ACCUMULATOR, AIR_VALVE = 20, 21
