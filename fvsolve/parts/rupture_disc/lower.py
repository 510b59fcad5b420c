"""Rupture discs in the tables of a model; discs are intact at the start."""

from fvsolve.assembly.device_lowering import Device
from fvsolve.parts.outlet.law import EVENT_COUNT
from fvsolve.parts.outlet.lower import RelievingRows
from fvsolve.parts.rupture_disc import law, law_outside


class RuptureDiscRows(RelievingRows, kind="rupture-disc"):
    """Conversion to table rows of rupture discs between two nodes."""

    law, events_only = law, True
    events = ("bursts",)

    def of(self, part) -> Device:
        return DiscToAmbient() if part.outward else self

    def own_numbers(self, draft, name, part) -> list[float]:
        return [part.burst_pressure]

    def begin(self, start, part, row) -> list[str]:
        k = int(row["valve"])
        drop, name = start.valve_drive(k)[0], start.draft.valve_names[k]
        if drop >= part.burst_pressure:
            across = start.case.amount(drop, "pressure", 6, span=True)
            text = f"a drop of {across} at the start would burst the disc; raise `burst_pressure` or remove the disc"
            start.draft.fault(f"links.{name}.burst_pressure", text)
        return []


class DiscToAmbient(RuptureDiscRows, kind=""):
    """Conversion to table rows of rupture discs that open to ambient."""

    law, mode = law_outside, EVENT_COUNT
    events = ("",) * EVENT_COUNT + ("bursts",)
