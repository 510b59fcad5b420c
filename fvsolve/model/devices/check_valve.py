"""Check valves in the tables of a scene."""

from __future__ import annotations

from fvsolve.kernels.devices import check_valve as law
from fvsolve.model.devices.device import Device
from fvsolve.model.devices.lifting import CheckLag, CheckSwing

SMALL_FLOW = 1e-9  # share of the flows of a scene below which a reversed one is rounding


class CheckValve(Device, kind="check-valve"):
    """Open or shut; its steady state is that in which no open one flows back and no shut one is pushed open."""

    law, sudden = law, True
    quantities = ("opening",)
    events = ("shuts", "opens")

    def of(self, part) -> Device:
        return self if not part.moves else CheckLag() if part.natural_frequency is None else CheckSwing()

    def numbers(self, draft, name, part) -> list[float]:
        return [part.cracking_pressure]

    def revise(self, start, part, row) -> bool:
        k = int(row["valve"])
        if k in start.shut:
            before, behind = start.across(k)
            opens = before - behind > part.cracking_pressure + 1e-6
            start.shut -= {k} if opens else set()
            return opens
        shuts = start.valve_flows()[k] < -SMALL_FLOW * start.flow_scale
        start.shut |= {k} if shuts else set()
        return shuts
