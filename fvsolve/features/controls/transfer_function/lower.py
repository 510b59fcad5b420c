"""Transfer functions in the tables of a model, and their state at the start."""

import numpy as np

from fvsolve.features.controls.rows import ControlRows
from fvsolve.features.controls.transfer_function import law


class TransferFunctionRows(ControlRows, kind="transfer-function"):
    """Conversion of transfer functions to table rows."""

    law = law

    def states(self, control):
        return tuple(f"state{k + 1}" for k in range(len(control.denominator) - 1))

    def scales(self, control, change):
        _, weights = coefficients(control)
        known = [change[1] / abs(c) for c in weights if c != 0.0]
        return [change[1] / abs(c) if c != 0.0 else min(known, default=change[0]) for c in weights]

    def numbers(self, draft, name, block):
        control = block.control
        own, weights = coefficients(control)
        return [
            0.0,
            control.direct,
            0.0,
            float(len(own)),
            *own,
            *weights,
            *tustin(own, control.period),
        ]

    def sampled_numbers(self, control):
        return 2 * (len(control.denominator) - 1) + 1

    def rate(self, control):
        return float(np.max(np.abs(np.roots(control.denominator)), initial=0.0))

    def residual(self, control, start):
        if control.integrates:
            return start.inputs[0]
        return control.numerator[-1] / control.denominator[-1] * start.inputs[0] - start.output

    def output_rate(self, control, start, rates):
        if control.integrates or control.initial is not None:
            return self.residual(control, start)
        return control.numerator[-1] / control.denominator[-1] * rates[0]

    def begin(self, control, start, numbers):
        numbers[law.START], x = start.output, start.inputs[0]
        (own, weights), first = coefficients(control), 0.0
        if weights[0] != 0.0:
            first = (start.output - control.direct * x) / weights[0]
        excess = x - own[0] * first
        numbers[law.EXCESS] = (
            0.0 if abs(excess) <= 1e-12 * (abs(x) + abs(own[0] * first)) else excess
        )


def coefficients(control) -> tuple[list[float], list[float]]:
    """Coefficients a_n to a_1 of the denominator, and weights c_1 to c_n of the states, both with a_0 = 1."""
    a = np.array(control.denominator) / control.denominator[0]
    b = np.zeros(a.size)
    b[a.size - len(control.numerator) :] = np.array(control.numerator) / control.denominator[0]
    weights = b[1:] - b[0] * a[1:]
    return a[:0:-1].tolist(), weights[::-1].tolist()


def tustin(own: list[float], period: float | None) -> list[float]:
    """Rows of M, then g, of the states of a sampled block; own : coefficients a_n to a_1; empty without samples."""
    if period is None:
        return []
    n = len(own)
    a, unit = np.eye(n, k=1), np.eye(n)
    a[-1] = -np.array(own)
    inverse = np.linalg.inv(unit - 0.5 * period * a)
    return [*(inverse @ (unit + 0.5 * period * a)).ravel(), *(0.5 * period * inverse[:, -1])]
