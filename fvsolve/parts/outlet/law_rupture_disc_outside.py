"""Rupture disc to ambient: functions of the disc law and of the outlet law."""

from fvsolve.parts.outlet.law_root import bends, slope, step
from fvsolve.parts.outlet.law_rupture_disc import events, set, value

__all__ = ["bends", "events", "set", "slope", "step", "value"]
