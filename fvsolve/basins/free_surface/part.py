"""Keys of the case file for water with a free surface, and its output fields."""

from typing import Annotated, Any, ClassVar

import numpy as np

from fvsolve.parts.basin import VELOCITY_FIELDS, Physics, VelocityStart
from fvsolve.parts.formula import SpatialField, SpatialFieldKey
from fvsolve.parts.value import VALUE, Quantity, UsualRange, anything, nonnegative


class SurfaceStart(VelocityStart):
    """Keys of the table `start` of water that is not at rest at the start."""

    level: Annotated[
        SpatialField | None, SpatialFieldKey("length", "level of the free surface above the elevation [m]")
    ] = None


class FreeSurface(Physics, name="free-surface"):
    """Depth h, flow per width q: h_t + div q = 0, q_t + div(q q / h + g h^2 / 2) = -g h grad(bed) - friction."""

    states: ClassVar[dict[str, str]] = {"depth": "m", "flow_x": "m2/s", "flow_y": "m2/s"}
    fields: ClassVar[dict[str, str]] = {"depth": "level", "surface": "level", "bed": "level", **VELOCITY_FIELDS}
    maxima: ClassVar[dict[str, str]] = {
        "max_depth": "level", "max_surface": "level", "max_speed": "velocity", "max_hazard": "unit_flow",
        "arrival_time": "time", "wet_duration": "time",
    }  # fmt: skip
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("manning", "factor"),)
    starts: ClassVar[type[VelocityStart]] = SurfaceStart
    laws: ClassVar[tuple[str, ...]] = ("linear",)
    moves: ClassVar[bool] = True
    on_bodies: ClassVar[bool] = True
    has_modes: ClassVar[bool] = True
    links_on_bodies: ClassVar[bool] = True
    description: ClassVar[str] = "a free surface, whose water has one density"
    has_shocks: ClassVar[bool] = True
    has_closures: ClassVar[bool] = True

    level: Annotated[
        float,
        Quantity("level", anything, "level of the water at rest above the elevation [m]; required for a free surface"),
    ]
    bed: Annotated[
        SpatialField | None,
        SpatialFieldKey("length", "height of the bed of a free surface above the elevation [m]; default 0"),
    ] = None
    manning: Annotated[
        float | None,
        Quantity(
            "number", nonnegative, "Manning's n of the bed of a free surface [s/m^(1/3)]; default: no friction",
            UsualRange(0.005, 0.5, "glass to dense brush"), VALUE,
        ),
    ] = None  # fmt: skip
    factor: Annotated[
        float | None,
        Quantity(
            "number", nonnegative,
            "Darcy friction factor of the bed of a free surface, instead of `manning` [-]; default: no friction",
            UsualRange(0.002, 3.0, "glass to boulders"), VALUE,
        ),
    ] = None  # fmt: skip

    @classmethod
    def has_friction(cls, basin) -> bool:
        return bool(basin.manning or basin.factor)

    @classmethod
    def rest(cls, basin, mean, cells, area) -> dict[str, Any]:
        """Elevation [m], depth [m] and pressure (None) of the node of a patch at rest, as a dict.

        The elevation is that of the mean bed of the cells under water, or of the lowest cells if all are dry. It is
        None if neither elevation nor bed of the basin is stated.
        mean : function from a formula to its means over all cells; cells : numbers of the cells behind the patch
        area : areas of all cells [m2]
        """
        bed = mean(basin.bed)
        cells = cells[bed[cells] <= max(bed[cells].min(), np.nextafter(basin.level, -np.inf))]
        height = float(np.average(bed[cells], weights=area[cells]))
        stated = basin.elevation is not None or basin.bed is not None
        return {
            "elevation": (basin.elevation or 0.0) + height if stated else None,
            "depth": float(np.average(np.maximum(basin.level - bed[cells], 0.0), weights=area[cells])),
            "pressure": None,
        }
