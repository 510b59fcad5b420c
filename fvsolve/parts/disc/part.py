"""How the disc of a self-acting valve moves. Knows its spring, damper and inertia as data sheets give them."""

from __future__ import annotations

from typing import Annotated, Any

from fvsolve.parts.table import Table, at_most_one
from fvsolve.parts.value import VALUE, Number, Quantity, Usual, nonnegative, positive

DROPS = Usual(20.0, 1e8, "millimetres of water to the springs of test rigs")


class Disc(Table):
    """A disc on a spring, at lift x between its seat at 0 and its stop at 1, which the pressures draw to a target.

    time_constant dx/dt = target - x, or x'' = w^2 (target - x) - 2 damping_ratio w x' with w = 2 pi natural_frequency.
    """

    time_constant: Annotated[
        float | None,
        Quantity(
            "time",
            positive,
            "damper over spring of its disc [s]; at once if left out",
            Usual(1e-6, 300.0, "poppets to damped flaps"),
            VALUE,
        ),
    ] = None
    natural_frequency: Annotated[
        float | None,
        Quantity(
            "frequency",
            positive,
            "of its disc, undamped, in place of time_constant [Hz]",
            Usual(1e-2, 2e4, "flaps to poppets"),
            VALUE,
        ),
    ] = None
    damping_ratio: Annotated[float | None, Number(nonnegative, "of its disc, 1 is critical", changes=VALUE)] = None

    @property
    def moves(self) -> bool:
        """Whether its lift is a state."""
        return self.time_constant is not None or self.natural_frequency is not None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given) + at_most_one(given, ("time_constant", "natural_frequency"))
        if "natural_frequency" in given and "damping_ratio" not in given:
            faults.append((("natural_frequency",), "wants a damping_ratio beside it, for example 0.3"))
        if "damping_ratio" in given and "natural_frequency" not in given:
            faults.append((("damping_ratio",), "wants a natural_frequency beside it"))
        return faults
