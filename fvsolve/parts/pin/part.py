"""Pins that close a loop of bodies: keys and constrained directions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

import numpy as np

from fvsolve.parts.attitude_keys import is_zero_vector, length_notices
from fvsolve.parts.context import CaseContext, Faults
from fvsolve.parts.link import TwoPort
from fvsolve.parts.value import VALUE, Quantity, Rows, positive


class Pin(TwoPort, kind="pin"):
    """Joint that keeps point `to` at point `from`; with `axis`, only in the two directions normal to it (plane loop).

    gap is the distance vector between the points. Ports: from, to. Stored and dissipated energy: none, except the
    energy by which `stabilisation` closes a gap. The forces are Lagrange multipliers of
    d2(gap)/dt2 = -2 stabilisation d(gap)/dt - stabilisation^2 gap (Baumgarte, 1972).
    """

    joins: ClassVar[dict[str, str]] = {"from": "spatial", "to": "spatial"}
    quantities: ClassVar[dict[str, str]] = {"gap": "length", "force": "force"}

    axis: Annotated[
        tuple[float, ...] | None,
        Rows(
            "number",
            length=3,
            about="free direction, in the axes of `from`; none (all three directions constrained) if left out",
        ),
    ] = None
    stabilisation: Annotated[
        float, Quantity("rate", positive, "rate at which a gap closes (Baumgarte stabilisation) [1/s]", changes=VALUE)
    ] = 10.0

    def faults(self, name: str, around: CaseContext) -> Faults:
        if is_zero_vector(self.axis):
            yield ("axis",), "is all zeros; expected for example [0, 1, 0]"

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        yield from length_notices("axis", self.axis)

    def directions(self) -> np.ndarray:
        """Constrained directions in the axes of `from`, as unit vectors : float64[directions, 3]."""
        if self.axis is None:
            return np.eye(3)
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        first /= np.linalg.norm(first)
        return np.array([first, np.cross(axis, first)])
