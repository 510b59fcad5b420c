"""A conduit in which waves travel. Knows its size, wall and friction; computes nothing."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from fvsolve.parts.conduit import Conduit
from fvsolve.parts.scalar import Carried
from fvsolve.parts.table import Table
from fvsolve.parts.value import Number, Quantity, Setting, Value, Whole, between, positive
from fvsolve.units import show

MOST_CELLS = 10**8


class Wall(Table):
    """An elastic wall: 1/K = 1/beta + diameter / (youngs_modulus thickness), wave speed sqrt(K / rho)."""

    youngs_modulus: Annotated[float, Quantity("modulus", positive, "of the wall's material [Pa]")]
    thickness: Annotated[float, Quantity("length", positive, "of the wall [m]")]


class WallOrStiff(Value):
    """The text "stiff" or the table of an elastic wall."""

    about = 'the wall: "stiff", or { youngs_modulus, thickness }'

    def read(self, given: Any, setting: Setting) -> Wall | str:
        if isinstance(given, Wall) or given == "stiff":
            return given
        if not isinstance(given, dict):
            raise ValueError(f'{show(given)} is no wall; wanted "stiff" or {{ youngs_modulus, thickness }}')
        return Wall.model_validate(given, context=setting)

    def json(self) -> dict[str, Any]:
        return {"anyOf": [{"const": "stiff"}, Wall.model_json_schema()]}


class Pipe(Conduit, kind="pipe"):
    """A pipe of constant slope: mass and momentum along it, wave speed sqrt(K / rho).

    Ports: from, to; each end offers its outgoing characteristic. Stored energy, p from ambient: rho A
    integral of (v^2 / 2 + p^2 / (2 rho K) + g z) dx [J]. Dissipated power: friction and minor loss, pressure
    drop times flow [W].
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (*Conduit.alternatives, ("wave_speed", "wall"))
    along: ClassVar[dict[str, str]] = {
        "pressure": "pressure", "gauge_pressure": "gauge_pressure", "head": "head", "velocity": "velocity",
        "flow": "flow",
    }  # fmt: skip

    wave_speed: Annotated[float | None, Quantity("velocity", positive, "in place of wall [m/s]")] = None
    wall: Annotated[Wall | Literal["stiff"] | None, WallOrStiff()] = None
    cells: Annotated[int | None, Whole(between(1, MOST_CELLS), "finite volumes along it")] = None
    scalars: Annotated[dict[str, Any], Carried("of scalars in it at the start", Number())] = {}
