"""A conduit whose fluid moves as one body. Knows its size and friction; computes nothing."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from fvsolve.parts.conduit import Conduit
from fvsolve.parts.value import Misfit, Rows, Setting, Value
from fvsolve.units import show


class Way(Value):
    """Points in space, in order."""

    takes = "list of [x, y, z], m"

    def __init__(self, about: str) -> None:
        self.about = about

    def read(self, given: Any, setting: Setting) -> list[tuple[float, ...]]:
        if not isinstance(given, (list, tuple)):
            raise ValueError(f"{show(given)} is no list of points; wanted [[x, y, z], ...]")
        found, faults = [], []
        for index, one in enumerate(given):
            try:
                found.append(Rows("position", length=3).read(one, setting))
            except Misfit as error:
                faults += [((index, *below), text) for below, text in error.faults]
            except ValueError as error:
                faults.append(((index,), str(error)))
        if faults:
            raise Misfit(faults)
        return found

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": Rows("position", length=3).json()}


class RigidColumn(Conduit, kind="rigid-column"):
    """An incompressible pipe, (rho length / A) dq/dt = drop of p + rho g z - friction; one state, its flow q.

    Ports: from, to. Stored energy: rho length q^2 / (2 A) [J]. Dissipated power: friction and minor loss,
    pressure drop times flow [W].
    """

    route: Annotated[
        list[tuple[float, ...]],
        Way("on its way between ends that ride on a body, in axes of that [m]; straight if left out"),
    ] = []
    no_scalars: ClassVar[str] = "it has no cells to carry scalars; use a pipe"

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        law = given.get("friction")
        if isinstance(law, dict) and law.get("model") == "unsteady":
            message = 'no "unsteady" friction in a rigid column; wanted "quasi-steady", or a pipe'
            return [*super().key_faults(given), (("friction", "model"), message)]
        return super().key_faults(given)
