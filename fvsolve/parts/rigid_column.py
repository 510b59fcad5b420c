"""Rigid columns of liquid."""

import math
from typing import Annotated, Any, ClassVar

from fvsolve.core.assembly.lowering import Lowering
from fvsolve.core.kernels import dtypes as rec
from fvsolve.parts.full_pipe import FullPipe
from fvsolve.parts.value import ReadContext, Rows, Value, ValueFault
from fvsolve.units import show


class Way(Value):
    """Value of a case file for a list of points in space."""

    takes = "list of [x, y, z], m"

    def __init__(self, about: str) -> None:
        self.about = about

    def read(self, given: Any, setting: ReadContext) -> list[tuple[float, ...]]:
        if not isinstance(given, (list, tuple)):
            raise ValueError(f"{show(given)} is not a list of points; expected [[x, y, z], ...]")
        points, faults = [], []
        for index, point in enumerate(given):
            try:
                points.append(Rows("position", length=3).read(point, setting))
            except ValueFault as error:
                faults += [((index, *below), text) for below, text in error.faults]
            except ValueError as error:
                faults.append(((index,), str(error)))
        if faults:
            raise ValueFault(faults)
        return points

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": Rows("position", length=3).json()}


class RigidColumn(FullPipe, kind="rigid-column"):
    """An incompressible pipe, (rho length / A) dq/dt = drop of p + rho g z minus friction; its flow q is a state.

    A is the area, p the pressure and z the elevation. Ports: from, to. Stored energy: rho length q^2 / (2 A) [J].
    Dissipated power: friction and minor loss, pressure drop times flow [W].
    """

    route: Annotated[
        list[tuple[float, ...]],
        Way(
            "points between the ends of a column on a body, in the axes of the body [m]; straight if left out"
        ),
    ] = []
    no_scalars: ClassVar[str] = "it has no cells to carry scalars; use a pipe"

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        law = given.get("friction")
        if isinstance(law, dict) and law.get("model") == "unsteady":
            message = '"unsteady" friction is not available in a rigid column; expected "quasi-steady", or use a pipe'
            return [*super().key_faults(given), (("friction", "model"), message)]
        return super().key_faults(given)


class RigidColumnRows(Lowering, kind="rigid-column"):
    """Conversion to table rows of rigid columns, each with its flow as state."""

    table = "column"

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        draft.ends(link, row)
        row["area"], row["length"] = math.pi / 4.0 * link.diameter**2, link.length
        draft.hydraulics.friction(name, link, row, draft.fault)
        row["y"] = draft.states([f"{name}.flow"], 0.1 * draft.fluid.density * row["area"])

    def probe(self, draft, name, probe, row) -> None:
        row["kind"], row["index"] = rec.COLUMN_FLOW, draft.column_names.index(name)
