"""Rupture discs in the tables of a scene: whole at the start."""

from __future__ import annotations

from fvsolve.model.device import Device
from fvsolve.parts.outlet.law import NO_END
from fvsolve.parts.rupture_disc import law, law_outside
from fvsolve.parts.rupture_disc.part import ToAmbient

SPAN = 1e5  # drop at which an outlet's law has its flow [Pa]


class RuptureDiscRows(Device, kind="rupture-disc"):
    """Between two places, a root."""

    law, sudden = law, True
    quantities = ("opening",)
    events = ("bursts",)

    def of(self, part) -> Device:
        return ToAmbientRows() if isinstance(part, ToAmbient) else self

    def numbers(self, draft, name, part) -> list[float]:
        return [part.burst_pressure]

    def revise(self, start, part, row) -> bool:
        k = int(row["valve"])
        new = k not in start.shut
        start.shut |= {k}
        return new

    def follow(self, start, k) -> None:
        """Nothing: it carries none."""

    def begin(self, start, part, row) -> list[str]:
        k = int(row["valve"])
        drop, name = start.drive_of(k)[0], start.draft.valve_names[k]
        if drop >= part.burst_pressure:
            what = f"{drop:.6g} Pa across it at the start; it would have burst, set it higher or leave the disc out"
            start.draft.fault(f"links.{name}.burst_pressure", what)
        return []


class ToAmbientRows(RuptureDiscRows, kind=""):
    """To ambient, an outlet."""

    law = law_outside
    events = ("",) * law_outside.EVENTS + ("bursts",)

    def numbers(self, draft, name, part) -> list[float]:
        return [0.5, 0.0, SPAN, NO_END, part.burst_pressure]
