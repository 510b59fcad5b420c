"""PI and PID controllers: keys and faults."""

from typing import Annotated

from fvsolve.parts.control import Gain, OfInput, SingleInput
from fvsolve.parts.schedule import Schedule
from fvsolve.parts.value import VALUE, Number, Quantity, nonnegative, positive


class Pi(SingleInput, kind="pi"):
    """PI controller: v = K (b r - x) + I, u = v within the limits, dI/dt = K (r - x) / Ti + (u - v) / Tt.

    r is the setpoint, x the input, u the output. Without `integral_time` it has no integral action.
    """

    setpoint: Annotated[Schedule, OfInput("set value of the input")]
    gain: Annotated[float, Gain("gain K; negative for reverse action")]
    integral_time: Annotated[
        float | None,
        Quantity(
            "time",
            positive,
            "time Ti of integral action [s]; no integral action if left out",
            changes=VALUE,
        ),
    ] = None
    setpoint_weight: Annotated[
        float, Number(nonnegative, "weight b of the setpoint", changes=VALUE)
    ] = 1.0
    tracking_time: Annotated[
        float | None,
        Quantity(
            "time",
            positive,
            "time Tt in which the integral follows a limited output [s]; `integral_time` if left out",
            changes=VALUE,
        ),
    ] = None

    @property
    def integrates(self) -> bool:
        return self.integral_time is not None


class Pid(Pi, kind="pid"):
    """PID controller: a PI controller with K Td s / (1 + Td s / N) of (c r - x) added to v."""

    derivative_time: Annotated[
        float, Quantity("time", nonnegative, "time Td of derivative action [s]")
    ] = 0.0
    derivative_filter: Annotated[
        float, Number(positive, "ratio N of Td to the time constant of its filter")
    ] = 10.0
    derivative_weight: Annotated[
        float, Number(nonnegative, "weight c of the setpoint in the derivative")
    ] = 0.0
