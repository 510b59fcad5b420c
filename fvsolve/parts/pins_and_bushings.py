"""Links between two points of bodies: pins, which close loops, and bushings."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

import numpy as np

from fvsolve.assembly.lowering import Lowering
from fvsolve.assembly.mechanics import point_row, pose_of
from fvsolve.kernels import dtypes as rec
from fvsolve.parts.attitude_keys import is_zero_vector, length_notices
from fvsolve.parts.context import CaseContext, Faults
from fvsolve.parts.link import TwoPort
from fvsolve.parts.value import VALUE, Quantity, Rows, nonnegative, positive


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


class PinRows(Lowering, kind="pin"):
    """Conversion to table rows of pins: loop constraints between two points."""

    table = "pin"

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        row["from_point"], row["to_point"] = point_row(draft, link.from_), point_row(draft, link.to)
        directions = link.directions()
        row["rows"], row["pull"] = len(directions), link.stabilisation
        row["directions"][: directions.size] = directions.ravel()

    def probe(self, draft, name, probe, row) -> None:
        row["kind"], row["side"] = rec.PIN_VALUE, ("gap", "force").index(probe.quantity)
        row["index"] = draft.pin_names.index(name)


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


class BushingRows(Lowering, kind="bushing"):
    """Conversion to table rows of bushings: three forces and three torques between two bodies."""

    table = "bushing"

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        row["from_point"], row["to_point"] = point_row(draft, link.from_), point_row(draft, link.to)
        row["stiffness"], row["damping"] = link.stiffness, link.damping
        row["turn_stiffness"], row["turn_damping"] = link.rotational_stiffness, link.rotational_damping
        poses = [pose_of(draft, end) for end in (link.from_, link.to)]
        row["attitude"] = (poses[0].attitude.T @ poses[1].attitude).ravel()

    def probe(self, draft, name, probe, row) -> None:
        row["kind"], row["side"] = rec.BUSHING_VALUE, ("gap", "force", "torque").index(probe.quantity)
        row["index"] = draft.bushing_names.index(name)
