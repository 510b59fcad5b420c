"""Keys of the case file for water with a free surface, and its output fields."""

from typing import Annotated, Any, ClassVar

import numpy as np

from fvsolve.errors import listing
from fvsolve.parts.basin import MANNING_RANGE, VELOCITY_FIELDS, Physics, VelocityStart
from fvsolve.parts.field_series import ScheduledField, SpatialSeries
from fvsolve.parts.formula import NumberOrField, SpatialField, SpatialFieldKey, samples
from fvsolve.parts.mesh_fields import NODES, NodeElevations
from fvsolve.parts.nodes_and_links import TwoPort
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.table_model import NamedTables, Nested, Table
from fvsolve.parts.value import (
    SHAPE,
    VALUE,
    Choice,
    Number,
    PointList,
    Quantity,
    ReadContext,
    Text,
    UsualRange,
    anything,
    between,
    nonnegative,
)
from fvsolve.parts.weir.part import COEFFICIENTS, WEIR_COEFFICIENTS
from fvsolve.units import show

RAIN = UsualRange(1e-9, 500 / 3.6e6, "drizzle to cloudburst")


class BedKey(SpatialFieldKey):
    """Value of a case file for the bed: a field, or "nodes" for the elevations of the nodes of the mesh file."""

    def read(self, given: Any, setting: ReadContext) -> SpatialField:
        if given == NODES:
            return SpatialField(NODES, NodeElevations())
        return super().read(given, setting)

    @property
    def takes(self) -> str:
        return f"{super().takes}; `{NODES}`"


class SurfaceStart(VelocityStart):
    """Keys of the table `start` of water that is not at rest at the start."""

    level: Annotated[
        SpatialField | None,
        SpatialFieldKey("length", "level of the free surface above the elevation [m]"),
    ] = None


SOIL_KEYS = {  # model of infiltration -> its keys
    "constant": ("rate",),
    "horton": ("initial", "final", "decay"),
    "green-ampt": ("conductivity", "suction", "deficit"),
    "curve-number": ("number", "initial_loss"),
}
OPTIONAL_SOIL_KEYS = ("initial_loss",)
SOIL_RANGES = {"deficit": (0.0, 1.0), "number": (1.0, 100.0)}  # key of a soil -> its range


class Infiltration(Table):
    """Soil into which water infiltrates: each number is a value, a formula of x and y, or points of a file."""

    model: Annotated[
        str, Choice("model", tuple(SOIL_KEYS), "law of the infiltration capacity", changes=SHAPE)
    ]
    rate: Annotated[
        SpatialField | None, SpatialFieldKey("rainfall", "infiltration capacity [m/s]", nonnegative)
    ] = None
    initial: Annotated[
        SpatialField | None,
        SpatialFieldKey("rainfall", "infiltration capacity at the start [m/s]", nonnegative),
    ] = None
    final: Annotated[
        SpatialField | None,
        SpatialFieldKey("rainfall", "infiltration capacity after a long time [m/s]", nonnegative),
    ] = None
    decay: Annotated[
        SpatialField | None,
        SpatialFieldKey("frequency", "rate of decay from initial to final [1/s]", nonnegative),
    ] = None
    conductivity: Annotated[
        SpatialField | None,
        SpatialFieldKey("rainfall", "hydraulic conductivity of the wetted soil [m/s]", nonnegative),
    ] = None
    suction: Annotated[
        SpatialField | None,
        SpatialFieldKey("length", "suction head at the wetting front [m]", nonnegative),
    ] = None
    deficit: Annotated[
        SpatialField | None,
        SpatialFieldKey(
            "number", "moisture deficit, porosity minus water content [-]", between(0, 1)
        ),
    ] = None
    number: Annotated[
        SpatialField | None,
        SpatialFieldKey("number", "curve number of the SCS [-]", between(1, 100)),
    ] = None
    initial_loss: Annotated[
        SpatialField | None,
        SpatialFieldKey(
            "length",
            "height of rain that infiltrates before the curve number limits it [m]; default 0",
            nonnegative,
        ),
    ] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        own = SOIL_KEYS.get(str(given.get("model")), ())
        others = {key for keys in SOIL_KEYS.values() for key in keys} - {*own}
        faults = [
            ((), f"{key} is missing") for key in own if key not in {*given, *OPTIONAL_SOIL_KEYS}
        ]
        text = f"is not a key of the model {show(given.get('model'))}, which has {listing(own)}"
        return faults + [((key,), text) for key in given if own and key in others]

    @property
    def fields(self) -> tuple[str, ...]:
        """Keys of its model that are given."""
        return tuple(key for key in SOIL_KEYS[self.model] if getattr(self, key) is not None)

    @property
    def shapes(self) -> list[SpatialField]:
        """Fields of the numbers of its model."""
        return [getattr(self, key) for key in self.fields]


class FaceWall(Table):
    """A wall on faces between cells, over which water may flow."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("line", "group"),)
    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("line", "group"),)

    line: Annotated[
        tuple[tuple[float, float], ...] | None,
        PointList(
            2, "points of a line; the wall is on the faces between the cells on both of its sides"
        ),
    ] = None
    group: Annotated[
        str | None, Text("group of lines of the mesh file on which the wall is, instead of `line`")
    ] = None
    crest: Annotated[
        Schedule,
        Scheduled("level", anything, "height of its crest above the elevation of the basin [m]"),
    ]
    coefficient: Annotated[
        float, Number(between(0.01, 1.0), "coefficient C of the weir [-]", WEIR_COEFFICIENTS)
    ] = COEFFICIENTS["broad"]

    def chain(self, mesh) -> Any:
        """`FaceChain` of the wall in a mesh; without faces for an unknown group."""
        from fvsolve.core.mesh.face_chains import FaceChain, chain_along

        if self.line is not None:
            return chain_along(mesh, self.line)
        faces = mesh.groups.get(self.group, np.zeros(0, int))
        return FaceChain(faces, np.ones(faces.size), np.ones(faces.size), np.zeros(faces.size))


class PatchFace(TwoPort):
    """Faces of a patch of water, from the junction of its links to its cells.

    basin, patch : names; length : of the faces [m]
    """

    kind: ClassVar[str] = "patch-face"
    basin: str
    patch: str
    length: float


class FreeSurface(Physics, name="free-surface"):
    """Depth h, flow per width q: h_t + div q = 0, q_t + div(q q / h + g h^2 / 2) = -g h grad(bed) - friction."""

    states: ClassVar[dict[str, str]] = {"depth": "m", "flow_x": "m2/s", "flow_y": "m2/s"}
    fields: ClassVar[dict[str, str]] = {
        "depth": "level",
        "surface": "level",
        "bed": "level",
        **VELOCITY_FIELDS,
    }
    maxima: ClassVar[dict[str, str]] = {
        "max_depth": "level",
        "max_surface": "level",
        "max_speed": "velocity",
        "max_hazard": "unit_flow",
        "arrival_time": "time",
        "wet_duration": "time",
    }
    totals: ClassVar[dict[str, str]] = {
        "volume": "volume",
        "wet_area": "area",
        "rain": "flow",
        "rained": "volume",
        "infiltration": "flow",
        "infiltrated": "volume",
    }
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
        Quantity(
            "level",
            anything,
            "level of the water at rest above the elevation [m]; required for a free surface",
        ),
    ]
    bed: Annotated[
        SpatialField | None,
        BedKey(
            "length",
            "height of the bed of a free surface above the elevation [m], nodes: that of the nodes of the mesh file; "
            "default 0",
        ),
    ] = None
    manning: Annotated[
        float | SpatialField | None,
        NumberOrField(
            Quantity("number", nonnegative, usual=MANNING_RANGE),
            "Manning's n of the bed of a free surface [s/m^(1/3)]; default: no friction",
            VALUE,
        ),
    ] = None
    factor: Annotated[
        float | None,
        Quantity(
            "number",
            nonnegative,
            "Darcy friction factor of the bed of a free surface, instead of `manning` [-]; default: no friction",
            UsualRange(0.002, 3.0, "glass to boulders"),
            VALUE,
        ),
    ] = None

    rain: Annotated[
        Schedule | SpatialSeries | None,
        ScheduledField(
            "rainfall",
            nonnegative,
            "rate of rain on the basin [m/s]; default: none",
            RAIN,
            needs_unit=True,
        ),
    ] = None
    infiltration: Annotated[
        Infiltration | None,
        Nested(Infiltration, "soil into which water infiltrates; default: none"),
    ] = None
    walls: Annotated[
        Any,
        NamedTables(
            FaceWall,
            "walls on faces between cells: { levee = { line, crest } } or { group, crest }",
        ),
    ] = None

    @classmethod
    def formulas(cls, basin, mesh):
        yield from super().formulas(basin, mesh)
        for key in basin.infiltration.fields if basin.infiltration is not None else ():
            yield ("infiltration", key), getattr(basin.infiltration, key), None
        if isinstance(basin.rain, SpatialSeries):
            yield ("rain",), basin.rain.least, None

    @classmethod
    def value_faults(cls, basin, place, shape, mesh):
        if place[0] not in ("infiltration", "manning", "rain") or shape is None:
            return
        values, (least, greatest) = samples(shape, mesh), SOIL_RANGES.get(place[-1], (0.0, np.inf))
        if not (values.min() >= least and values.max() <= greatest):
            worst = values.min() if values.min() < least else values.max()
            expected = f"{least:g} to {greatest:g}" if greatest < np.inf else "no values below 0"
            yield f"is {worst:g} in a cell; expected {expected}"
        elif place[-1] == "initial" and (values < samples(basin.infiltration.final, mesh)).any():
            yield "is below `final` in a cell; expected a capacity that decreases"

    @classmethod
    def has_fifth_order(cls, basin, rectangle):
        return rectangle and not basin.walls

    @classmethod
    def face_type(cls):
        return PatchFace

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
            "depth": float(
                np.average(np.maximum(basin.level - bed[cells], 0.0), weights=area[cells])
            ),
            "pressure": None,
        }
