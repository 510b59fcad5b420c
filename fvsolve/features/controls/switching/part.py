"""Relays, latches and timers: keys and faults."""

from typing import Annotated, Any

from fvsolve.parts.control import OfInputNumber, OfOutput, SingleInput, Unsampled
from fvsolve.parts.value import PROFILE, Quantity, Text, Whole, between, nonnegative
from fvsolve.units import show

STATE = Whole(
    between(0, 1), "state at the start: 0 off, 1 on; that of its input if left out", PROFILE
)
OUTPUTS = OfOutput("output while it is off, and while it is on", 2)


class Switching(Unsampled):
    """Block with two outputs, one for each of its states off and on; events change the state."""

    output: Annotated[tuple[float, float], OUTPUTS] = (0.0, 1.0)
    initial: Annotated[int | None, STATE] = None

    @property
    def initial_output(self) -> float | None:
        return None if self.initial is None else self.output[self.initial]

    @property
    def passes_at_once(self) -> bool:
        return False

    @property
    def switches(self) -> bool:
        return True


class Relay(Switching, SingleInput, kind="relay"):
    """Two-point controller with hysteresis.

    With `on` below `off` it turns on when the input falls to `on`, and off when it rises to `off`; with `on` above
    `off` the reverse.
    """

    on: Annotated[float, OfInputNumber("input at which it turns on")]
    off: Annotated[float, OfInputNumber("input at which it turns off")]

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        if "on" in given and given.get("on") == given.get("off"):
            text = f"{show(given['on'])} is also `off`, so it would switch without end; expected another value"
            faults.append((("on",), text))
        return faults


class Latch(Switching, kind="latch"):
    """Memory: on from when `set` exceeds 0.5 until `reset` exceeds 0.5; `reset` wins."""

    set: Annotated[str, Text("probe or controls.NAME that turns it on")]
    reset: Annotated[str, Text("probe or controls.NAME that turns it off")]
    initial: Annotated[int, Whole(between(0, 1), "state at the start: 0 off, 1 on", PROFILE)]

    @classmethod
    def inputs_of(cls, given: dict[str, Any]) -> dict[tuple[str, ...], Any]:
        return {(key,): given[key] for key in ("set", "reset") if key in given}


class Timer(Switching, SingleInput, kind="timer"):
    """Its state follows its input, above 0.5 or not, `on_delay` and `off_delay` later, if the input still holds."""

    on_delay: Annotated[
        float, Quantity("time", nonnegative, "time that the input must hold to turn it on [s]")
    ] = 0.0
    off_delay: Annotated[
        float, Quantity("time", nonnegative, "time that the input must hold to turn it off [s]")
    ] = 0.0
