"""Linear springs between two masses or points: keys and faults."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from fvsolve.parts.context import CaseContext, Faults
from fvsolve.parts.link import Coupling
from fvsolve.parts.value import VALUE, Quantity, nonnegative, positive


class Spring(Coupling, kind="spring"):
    """Linear spring with the force -stiffness (x_to - x_from - free_length), x the position of a port.

    With `preload` the force is preload - stiffness (length - length at the start), the length x_to - x_from
    (docs/course.md, 81). Ports: from, to; the force pushes `to` forward. Stored energy: force^2 / (2 stiffness) [J]
    (82). Dissipated energy: none.
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("free_length", "preload"),)

    stiffness: Annotated[float, Quantity("stiffness", positive, "spring rate, force per length [N/m]", changes=VALUE)]
    free_length: Annotated[
        float | None,
        Quantity(
            "length",
            nonnegative,
            "length x_to - x_from without load [m]; 0 without `preload` if left out",
            changes=VALUE,
        ),
    ] = None
    preload: Annotated[
        float | None, Quantity("force", about="force at the start, positive in compression [N]", changes=VALUE)
    ] = None

    def model_post_init(self, _: Any) -> None:
        if self.free_length is self.preload is None:
            object.__setattr__(self, "free_length", 0.0)

    def faults(self, name: str, around: CaseContext) -> Faults:
        distance = around.separation(self, "from", "to")
        if distance is not None and distance < 0.0 and (self.free_length or self.preload):
            yield ("to",), f"{self.to} is behind {self.from_} at the start; exchange the keys `from` and `to`"
