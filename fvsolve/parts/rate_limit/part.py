"""Rate limits: keys and faults."""

from typing import Annotated, Any

from fvsolve.parts.control import OfRate, SingleInput, continuous_faults
from fvsolve.parts.value import Quantity, positive


class RateLimit(SingleInput, kind="rate-limit"):
    """Block whose output follows its input no quicker than its limits: dv/dt = (x - v) / T, within them."""

    rising: Annotated[float, OfRate("greatest rate of rise of the output")]
    falling: Annotated[float, OfRate("greatest rate of fall of the output, above 0")]
    time_constant: Annotated[float, Quantity("time", positive, "time constant T of small changes [s]")]

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        return super().key_faults(given) + continuous_faults(given)

    @property
    def passes_at_once(self) -> bool:
        return False
