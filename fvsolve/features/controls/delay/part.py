"""Delays: keys."""

from typing import Annotated, ClassVar

from fvsolve.parts.control import MOST_SAMPLES, SingleInput
from fvsolve.parts.table_model import CaseContext, Faults
from fvsolve.parts.value import Quantity, positive


class Delay(SingleInput, kind="delay"):
    """Block whose output is its input a `delay` earlier; before the start plus the delay it is that of the start.

    Jumps of the input arrive as jumps, between them the output is a polynomial of degree 5 through accepted states.
    """

    same_unit: ClassVar[bool] = True

    delay: Annotated[
        float, Quantity("time", positive, "time by which the output follows the input [s]")
    ]

    def faults(self, name: str, around: CaseContext) -> Faults:
        yield from super().faults(name, around)
        times, most = around.times, around.times.most(self.delay)
        if self.delay < times.step:
            text = f"{self.delay:g} s is shorter than numerics.step"
            text = f"{text}, so a step would read an input that is not known yet"
            yield ("delay",), f"{text}; expected at least {times.step:g} s, or a shorter step"
        elif most > MOST_SAMPLES:
            text = f"{self.delay:g} s gives {most:.3g} steps, since no step may exceed the delay"
            yield ("delay",), f"{text}; expected at most {MOST_SAMPLES:.0e} in the run"

    @property
    def passes_at_once(self) -> bool:
        return False
