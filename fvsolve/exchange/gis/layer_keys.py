"""Keys of a layer of the table `[gis]`: a file, and the parts that its features become."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.parts.table_model import Table
from fvsolve.parts.value import (
    Choice,
    Quantity,
    ReadContext,
    Text,
    Value,
    anything,
    nonnegative,
    positive,
)
from fvsolve.units import show

# what the features of a layer can become -> the kinds of their shapes
PARTS = {
    "nodes": ("point",),
    "links": ("line", "point"),
    "walls": ("line",),
    "patches": ("polygon", "point"),
    "gauges": ("point",),
    "sections": ("line",),
}
IN_BASINS = ("walls", "patches", "gauges", "sections")
SHAPE_HEIGHTS = "shape"  # instead of a raster: the z of the shapes themselves


@dataclass(frozen=True)
class Templates(Value):
    """Value of a case file: keys of parts, in whose texts `{NAME}` stands for an attribute of the feature."""

    about: str = ""
    takes: ClassVar[str] = '`{ diameter = "{DN} mm" }`'
    schema: ClassVar[dict[str, Any]] = {"type": "object"}

    def read(self, given: Any, setting: ReadContext) -> dict[str, Any]:
        if not isinstance(given, dict):
            text = f"{show(given)} is not a table; expected keys of the parts"
            text = f'{text}, such as {{ diameter = "{{DN}} mm" }}'
            raise ValueError(text)
        return given


@dataclass(frozen=True)
class AttributeValues(Value):
    """Value of a case file: attribute -> value or list of values that a feature must have."""

    about: str = ""
    takes: ClassVar[str] = '`{ STATUS = "active" }`'
    schema: ClassVar[dict[str, Any]] = {"type": "object"}

    def read(self, given: Any, setting: ReadContext) -> dict[str, list[Any]]:
        if not isinstance(given, dict):
            text = f"{show(given)} is not a table of attributes"
            text = f'{text}; expected for example {{ STATUS = "active" }}'
            raise ValueError(text)
        values = {}
        for name, value in given.items():
            values[name] = value if isinstance(value, list) else [value]
        return values


class SourceSystem(Text):
    """Value of a case file for the reference system of a file, which may be in degrees."""

    def read(self, given: Any, setting: ReadContext) -> str:
        text = super().read(given, setting)
        code = text.removeprefix("EPSG:")
        if code == text or not code.isdigit():
            text = f"{show(given)} is not a coordinate reference system"
            text = f'{text}; expected for example "EPSG:4326"'
            raise ValueError(text)
        return text


class GisLayer(Table):
    """Table of a layer: a file, and the parts that its features become."""

    file: Annotated[str, Text("file of shapes: GeoJSON, GeoPackage, shapefile")]
    layer: Annotated[str, Text("layer of the file; the only one if left out")] = ""
    becomes: Annotated[
        str, Choice("kind of parts", tuple(PARTS), "what the features become in the case")
    ]
    basin: Annotated[
        str, Text("basin of walls, patches, gauges and sections; the only basin if left out")
    ] = ""
    name: Annotated[
        str, Text('names of the parts, such as "{ID}"; LAYER-1, LAYER-2, ... if left out')
    ] = ""
    templates: Annotated[
        dict[str, Any],
        Field(alias="keys"),
        Templates(
            "keys of each part; {NAME} stands for an attribute, {x}, {y}, {z} and {length} for those of the shape"
        ),
    ] = {}
    where: Annotated[
        dict[str, Any], AttributeValues("attributes that a feature must have to become a part")
    ] = {}
    crs: Annotated[
        str, SourceSystem("reference system of the file, if it states none, or a wrong one")
    ] = ""
    heights: Annotated[
        str,
        Text(
            'raster of elevations of nodes, profiles of pipes and crests of walls, or "shape" for the z of the shapes'
        ),
    ] = ""
    offset: Annotated[float, Quantity("length", anything, "length added to the heights [m]")] = 0.0
    spacing: Annotated[
        float | None,
        Quantity(
            "length",
            positive,
            "greatest distance of points of profiles and crests [m]; four pixels of the raster if left out",
        ),
    ] = None
    snap: Annotated[
        float,
        Quantity("length", nonnegative, "greatest distance of an end of a link from its node [m]"),
    ] = 0.1
    junctions: Annotated[
        str, Text("beginning of the names of junctions at ends of links without a node")
    ] = ""

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        faults = super().key_faults(given)
        kind = given.get("becomes")
        if kind not in PARTS:
            return faults
        for key, kinds in (
            ("basin", IN_BASINS),
            ("snap", ("links",)),
            ("junctions", ("links",)),
            ("heights", ("nodes", "links", "walls")),
        ):
            if key in given and kind not in kinds:
                text = (
                    f"has no effect on {kind}; expected becomes = {' or '.join(map(show, kinds))}"
                )
                faults.append(((key,), f"{text}, or no key `{key}`"))
        for key in ("offset", "spacing"):
            if key in given and "heights" not in given:
                faults.append(((key,), "needs `heights`; expected a raster, or no such key"))
        return faults
