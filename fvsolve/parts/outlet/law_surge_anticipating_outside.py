"""Surge-anticipating valve to ambient: functions of the valve law and of the outlet law."""

from fvsolve.parts.outlet.law_root import bends, slope, step
from fvsolve.parts.outlet.law_surge_anticipating import events, move, set, value

__all__ = ["bends", "events", "move", "set", "slope", "step", "value"]
