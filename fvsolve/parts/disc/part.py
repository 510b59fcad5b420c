"""Dynamics of the disc of a self-acting valve: keys and faults."""

from typing import Annotated, Any

from fvsolve.parts.table_model import Table, exclusive_key_faults
from fvsolve.parts.value import VALUE, Number, Quantity, UsualRange, nonnegative, positive

DROPS = UsualRange(20.0, 1e8, "millimetres of water to the springs of test rigs")


class Disc(Table):
    """A disc on a spring; its lift x, from 0 on the seat to 1 at the stop, tends to a target that pressures set.

    time_constant dx/dt = target - x, or x'' = w^2 (target - x) - 2 damping_ratio w x' with w = 2 pi natural_frequency.
    """

    time_constant: Annotated[
        float | None,
        Quantity(
            "time",
            positive,
            "time constant of the disc, damping over stiffness [s]; no delay if left out",
            UsualRange(1e-6, 300.0, "poppets to damped flaps"),
            VALUE,
        ),
    ] = None
    natural_frequency: Annotated[
        float | None,
        Quantity(
            "frequency",
            positive,
            "undamped natural frequency of the disc, instead of `time_constant` [Hz]",
            UsualRange(1e-2, 2e4, "flaps to poppets"),
            VALUE,
        ),
    ] = None
    damping_ratio: Annotated[
        float | None,
        Number(nonnegative, "damping ratio of the disc, with `natural_frequency`; 1 is critical", changes=VALUE),
    ] = None

    @property
    def has_dynamics(self) -> bool:
        """True if the disc moves with a delay, so that its lift is a state."""
        return self.time_constant is not None or self.natural_frequency is not None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given) + exclusive_key_faults(given, ("time_constant", "natural_frequency"))
        if "natural_frequency" in given and "damping_ratio" not in given:
            faults.append((("natural_frequency",), "needs the key `damping_ratio`, for example 0.3"))
        if "damping_ratio" in given and "natural_frequency" not in given:
            faults.append((("damping_ratio",), "needs the key `natural_frequency`"))
        return faults
