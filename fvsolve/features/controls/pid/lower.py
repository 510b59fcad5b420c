"""PI and PID controllers in the tables of a model, and their state at the start."""

from fvsolve.features.controls.pid import law
from fvsolve.features.controls.rows import ControlRows

ROUNDING = 1e-12  # error at the start, relative to setpoint and input, that is rounding


def start_error(start) -> float:
    """Difference of setpoint and input at the start; 0 if it is rounding."""
    error = start.setpoint - start.inputs[0]
    return 0.0 if abs(error) <= ROUNDING * (abs(start.setpoint) + abs(start.inputs[0])) else error


class PiRows(ControlRows, kind="pi"):
    """Conversion of PI and PID controllers to table rows."""

    law = law

    def states(self, control):
        return ("integral",) * control.integrates + ("derivative",) * (
            derivative(control)[0] != 0.0
        )

    def is_static(self, control):
        return not self.states(control)

    def scales(self, control, change):
        return [change[1]] * control.integrates + [change[0]] * (derivative(control)[0] != 0.0)

    def numbers(self, draft, name, block):
        control = block.control
        integral = 1.0 / control.integral_time if control.integrates else 0.0
        tracking = 1.0 / control.tracking_time if control.tracking_time else integral
        return [
            0.0,
            0.0,
            control.gain,
            control.setpoint_weight,
            integral,
            tracking,
            *derivative(control),
        ]

    def sampled_numbers(self, control):
        return 2

    def rate(self, control):
        return derivative(control)[2]

    def residual(self, control, start):
        if control.integrates:
            return start_error(start)
        return (
            control.gain * (control.setpoint_weight * start.setpoint - start.inputs[0])
            - start.output
        )

    def output_rate(self, control, start, rates):
        return -control.gain * rates[0]

    def begin(self, control, start, numbers):
        numbers[law.START], numbers[law.ERROR] = start.output, start_error(start)


class PidRows(PiRows, kind="pid"):
    """Conversion of PID controllers to table rows."""


def derivative(control) -> tuple[float, float, float]:
    """Factor K N, weight c and rate N / Td [1/s] of the derivative; zeros without derivative action."""
    time = getattr(control, "derivative_time", 0.0)
    if time == 0.0:
        return 0.0, 0.0, 0.0
    ratio = control.derivative_filter
    return control.gain * ratio, control.derivative_weight, ratio / time
