"""Rate limits in the tables of a model, and their state at the start."""

from fvsolve.features.controls.rate_limit import law
from fvsolve.features.controls.rows import ControlRows

EVENTS = ("falls at its limit", "leaves its limit", "rises at its limit", "leaves its limit")


class RateLimitRows(ControlRows, kind="rate-limit"):
    """Conversion of rate limits to table rows."""

    law = law

    def states(self, control):
        return ("output",)

    def scales(self, control, change):
        return [change[1]]

    def numbers(self, draft, name, block):
        control = block.control
        flag = draft.flags(f"controls.{name}", EVENTS)
        return [0.0, float(flag), control.rising, control.falling, 1.0 / control.time_constant]

    def rate(self, control):
        return 1.0 / control.time_constant

    def residual(self, control, start):
        return start.inputs[0] - start.output

    def output_rate(self, control, start, rates):
        return rates[0]

    def begin(self, control, start, numbers):
        numbers[law.START] = start.output
