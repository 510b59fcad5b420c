"""A liquid between two plates. Knows its keys and what can be read of it; computes nothing."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from fvsolve.parts.basin.part import MOVES, MovingStart, Physics
from fvsolve.parts.formula import Formula, Shaped
from fvsolve.parts.value import Quantity, positive


class LiquidStart(MovingStart):
    """What it starts from where that is not rest."""

    pressure: Annotated[Formula | None, Shaped("pressure_drop", "of a liquid above that at rest [Pa]")] = None


class Liquid(Physics, name="liquid"):
    """r_t + div m = 0, m_t + div(m m / r) + grad p(r) = 0."""

    states: ClassVar[dict[str, str]] = {"density": "kg/m3", "flow_x": "kg/(m2 s)", "flow_y": "kg/(m2 s)"}
    fields: ClassVar[dict[str, str]] = {"pressure": "pressure", **MOVES}
    starts: ClassVar[type[MovingStart]] = LiquidStart
    laws: ClassVar[tuple[str, ...]] = ("linear", "log", "table")
    moves: ClassVar[bool] = True
    rides: ClassVar[bool] = True
    carries: ClassVar[bool] = False
    echoes: ClassVar[bool] = True

    pressure: Annotated[
        float, Quantity("pressure", positive, "at rest [Pa], on a body that at its middle; liquid, needed there")
    ]
    thickness: Annotated[
        float, Quantity("length", positive, "across the plane [m]; needed by a liquid, in transport 1")
    ]
    wave_speed: Annotated[
        float | None, Quantity("velocity", positive, "of a liquid [m/s]; the fluid's own if left out")
    ] = None

    @classmethod
    def rest(cls, basin, *behind: Any) -> dict[str, Any]:
        return super().rest(basin, *behind) | {"pressure": basin.pressure}
