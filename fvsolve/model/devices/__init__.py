"""Parts with a law of their own, lowered to tables: one file a part, one line here."""

from fvsolve.model.devices.accumulator import Accumulator
from fvsolve.model.devices.air_valve import AirValve
from fvsolve.model.devices.check_valve import CheckValve
from fvsolve.model.devices.device import Device, lower_devices
from fvsolve.model.devices.lifting import Relief
from fvsolve.model.devices.pump import Pump
from fvsolve.model.devices.regulator import FlowControl, PressureReducing, PressureSustaining

__all__ = [
    "Accumulator", "AirValve", "CheckValve", "Device", "FlowControl", "PressureReducing", "PressureSustaining", "Pump",
    "Relief", "lower_devices",
]  # fmt: skip
