"""Elastic bushings between two bodies: keys and faults."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve.parts.context import CaseContext, Faults
from fvsolve.parts.link import TwoPort
from fvsolve.parts.value import VALUE, Quantity, nonnegative


class Bushing(TwoPort, kind="bushing"):
    """Spring and damper in all directions between two points; it also turns the second body to its initial attitude.

    gap : vector from point `from` to point `to`; w : relative angular velocity; (eta, eps) : Euler parameters of the
    deviation from the initial relative attitude (docs/course.md, 56). In the axes of `from`, the force -stiffness gap -
    damping d(gap)/dt and the torque -2 rotational_stiffness eta eps - rotational_damping w (57) act on both bodies at
    point `to`. Ports: from, to; velocity and force. Stored energy: stiffness gap^2 / 2 + 2 rotational_stiffness eps^2
    [J]. Dissipated power: damping (d(gap)/dt)^2 + rotational_damping w^2 [W].
    """

    joins: ClassVar[dict[str, str]] = {"from": "spatial", "to": "spatial"}
    quantities: ClassVar[dict[str, str]] = {"gap": "length", "force": "force", "torque": "torque"}

    def faults(self, name: str, around: CaseContext) -> Faults:
        if not any((self.stiffness, self.damping, self.rotational_stiffness, self.rotational_damping)):
            yield (
                ("stiffness",),
                "is 0, like `damping`, `rotational_stiffness` and `rotational_damping`; "
                "expected at least one of these four keys above 0",
            )

    stiffness: Annotated[
        float, Quantity("stiffness", nonnegative, "force per displacement between the points [N/m]", changes=VALUE)
    ] = 0.0
    damping: Annotated[
        float, Quantity("damping", nonnegative, "force per relative velocity of the points [N s/m]", changes=VALUE)
    ] = 0.0
    rotational_stiffness: Annotated[
        float, Quantity("torque", nonnegative, "torque per angle, for small angles [N m]", changes=VALUE)
    ] = 0.0
    rotational_damping: Annotated[
        float, Quantity("rotational_damping", nonnegative, "torque per angular velocity [N m s]", changes=VALUE)
    ] = 0.0
