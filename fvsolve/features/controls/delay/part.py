"""Delays: keys."""

from typing import Annotated, ClassVar

from fvsolve.parts.control import SingleInput
from fvsolve.parts.value import Quantity, positive


class Delay(SingleInput, kind="delay"):
    """Block whose output is its input a `delay` earlier; before the start plus the delay it is that of the start.

    Jumps of the input arrive as jumps, between them the output is a polynomial of degree 5 through accepted states.
    """

    same_unit: ClassVar[bool] = True

    delay: Annotated[
        float, Quantity("time", positive, "time by which the output follows the input [s]")
    ]

    @property
    def passes_at_once(self) -> bool:
        return False
