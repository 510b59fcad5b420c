"""Rate limits: keys and faults."""

from typing import Annotated, ClassVar

from fvsolve.parts.control import OfRate, SingleInput, Unsampled
from fvsolve.parts.value import Quantity, positive


class RateLimit(Unsampled, SingleInput, kind="rate-limit"):
    """Block whose output follows its input no quicker than its limits: dv/dt = (x - v) / T, within them."""

    same_unit: ClassVar[bool] = True

    rising: Annotated[float, OfRate("greatest rate of rise of the output")]
    falling: Annotated[float, OfRate("greatest rate of fall of the output, above 0")]
    time_constant: Annotated[
        float, Quantity("time", positive, "time constant T of small changes [s]")
    ]

    @property
    def passes_at_once(self) -> bool:
        return False
