"""Keys of the case file for a liquid between two plates, and its output fields."""

from typing import Annotated, Any, ClassVar

from fvsolve.parts.basin import VELOCITY_FIELDS, Physics, VelocityStart
from fvsolve.parts.formula import SpatialField, SpatialFieldKey
from fvsolve.parts.value import Quantity, positive


class LiquidStart(VelocityStart):
    """Keys of the table `start` of a liquid that is not at rest at the start."""

    pressure: Annotated[
        SpatialField | None,
        SpatialFieldKey("pressure_drop", "pressure of a liquid above the pressure at rest [Pa]"),
    ] = None


class Liquid(Physics, name="liquid"):
    """Density r, mass-flow density m, pressure p: r_t + div m = 0, m_t + div(m m / r) + grad p(r) = 0."""

    states: ClassVar[dict[str, str]] = {
        "density": "kg/m3",
        "flow_x": "kg/(m2 s)",
        "flow_y": "kg/(m2 s)",
    }
    fields: ClassVar[dict[str, str]] = {"pressure": "pressure", **VELOCITY_FIELDS}
    starts: ClassVar[type[VelocityStart]] = LiquidStart
    laws: ClassVar[tuple[str, ...]] = ("linear", "log", "table")
    moves: ClassVar[bool] = True
    on_bodies: ClassVar[bool] = True
    carries: ClassVar[bool] = False
    allows_impedance: ClassVar[bool] = True

    pressure: Annotated[
        float,
        Quantity(
            "pressure",
            positive,
            "pressure at rest (on a body: at the middle of the basin) [Pa]; required for a liquid",
        ),
    ]
    thickness: Annotated[
        float,
        Quantity(
            "length",
            positive,
            "thickness normal to the plane [m]; required for a liquid, else default 1",
        ),
    ]
    wave_speed: Annotated[
        float | None,
        Quantity(
            "velocity", positive, "wave speed of a liquid [m/s]; default: wave speed of the fluid"
        ),
    ] = None

    @classmethod
    def rest(cls, basin, *behind: Any) -> dict[str, Any]:
        return super().rest(basin, *behind) | {"pressure": basin.pressure}
