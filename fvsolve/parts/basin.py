"""Basins, their patches, and the base class for the equations of basins (`Physics`)."""

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from copy import copy
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic.fields import FieldInfo

from fvsolve.core.assembly.lowering import Lowering
from fvsolve.core.kernels import dtypes as rec
from fvsolve.errors import FvsolveError, listing
from fvsolve.parts.attitude_keys import Attitude
from fvsolve.parts.carried_scalar import ScalarValues
from fvsolve.parts.csv_rows import copy_name, find_file
from fvsolve.parts.formula import SpatialField, SpatialFieldKey, uniform
from fvsolve.parts.kinds import Kinds
from fvsolve.parts.nodes_and_links import Node, PlaceOnBody
from fvsolve.parts.raster_systems import is_in_degrees
from fvsolve.parts.schedule import Schedule, Scheduled, constant
from fvsolve.parts.table_model import NamedTables, Nested, Table
from fvsolve.parts.value import (
    SHAPE,
    VALUE,
    Choice,
    PointList,
    Quantity,
    ReadContext,
    Rows,
    Text,
    UsualRange,
    Value,
    Whole,
    between,
    nonnegative,
    positive,
)
from fvsolve.units import show

MANNING_RANGE = UsualRange(0.008, 0.3, "smooth plastic to dense grass")
SIDES = ("west", "east", "south", "north")
RECTANGLE_KEYS = ("size", "cells", "grading", "holes")  # keys of rectangles
SLOSHING_MODELS = ("frozen", "modes", "cells")
# fields of a physics that has velocities
VELOCITY_FIELDS = {"u": "velocity", "v": "velocity", "speed": "velocity"}


class Rating(Table):
    """Flow out of a basin by the level of its water."""

    level: Annotated[
        tuple[float, ...], Rows("level", rising=True, about="levels above the elevation [m]")
    ]
    flow: Annotated[
        tuple[float, ...], Rows("flow", nonnegative, about="flow out at each level [m3/s]")
    ]

    @property
    def fault(self) -> tuple[str, str] | None:
        """(key, text) of the fault of the points; None for a rating whose flow rises from 0."""
        if len(self.level) != len(self.flow) or len(self.level) < 2:
            counts = f"has {len(self.flow)} flows for {len(self.level)} levels"
            return "flow", f"{counts}; expected a flow for each of two or more levels"
        if self.flow[0] > 0.0:
            return "flow", f"begins with {self.flow[0]:g} m3/s; expected 0 at the lowest level"
        rises = np.diff(self.flow)
        first = int(np.argmax(rises > 0.0))
        if not rises.any() or (rises[first:] <= 0.0).any():
            return (
                "flow",
                "does not rise; expected flows that rise above the highest level without flow",
            )
        return None

    @property
    def lowest(self) -> float:
        """Highest level without flow [m]."""
        return self.level[int(np.flatnonzero(np.array(self.flow) <= 0.0)[-1])]


CLOSURES = ("stage", "discharge", "rating", "normal_slope")  # keys that close a driven patch
INTERIOR_KEYS = ("at", "area", "polygon", "discharge", "scalars")  # keys of interior patches


class Patch(Table):
    """A section of the boundary of a basin: a node `BASIN.PATCH` for links, an open boundary, or a moving wall."""

    # those that exclude a link
    boundary_keys: ClassVar[tuple[str, ...]] = ("boundary", "impedance", *CLOSURES)

    side: Annotated[
        str | None,
        Choice(
            "side",
            SIDES,
            "side of the rectangle, required for a rectangle; a mesh file names its own patches",
        ),
    ] = None
    at: Annotated[
        tuple[float, float] | None,
        Rows(
            "length",
            length=2,
            about="middle of an interior patch, a square of the size `area` [m]",
            changes=SHAPE,
        ),
    ] = None
    area: Annotated[
        float | None,
        Quantity(
            "area",
            positive,
            "area about `at`: the cells with their centre in it, one at least",
            changes=SHAPE,
        ),
    ] = None
    polygon: Annotated[
        tuple[tuple[float, ...], ...] | None,
        PointList(
            3,
            "corners of an interior patch, instead of `at`: the cells with their centre in it, one at least",
        ),
    ] = None
    span: Annotated[
        tuple[float, float] | None,
        Rows(
            "length",
            nonnegative,
            length=2,
            about="start and end along the side, on grid lines [m]; the whole side if left out",
            changes=SHAPE,
        ),
    ] = None
    boundary: Annotated[
        str | None,
        Choice(
            "boundary",
            ("wall", "open", "critical"),
            "boundary condition: open (waves leave) or critical (free overfall); a wall if left out",
        ),
    ] = None
    impedance: Annotated[
        float | None,
        Quantity(
            "impedance",
            nonnegative,
            "ratio of pressure to velocity of waves in a liquid, instead of `boundary` [Pa s/m]",
        ),
    ] = None
    stage: Annotated[
        Schedule | None,
        Scheduled(
            "level",
            about="level of the water at the patch above the elevation [m]",
            needs_unit=True,
        ),
    ] = None
    discharge: Annotated[
        Schedule | None, Scheduled("flow", about="flow into the basin through the patch [m3/s]")
    ] = None
    depth: Annotated[
        Schedule | None,
        Scheduled(
            "length",
            nonnegative,
            "depth of a supercritical inflow by `discharge` [m]; at most critical flow if left out, "
            "and while a schedule is 0",
        ),
    ] = None
    rating: Annotated[
        Rating | None,
        Nested(Rating, "flow out of the basin by the level at the patch, linear between points"),
    ] = None
    normal_slope: Annotated[
        float | None,
        Quantity(
            "number",
            positive,
            "slope of the uniform outflow through the patch, which needs `manning` [-]",
            UsualRange(1e-5, 0.1, "lowland river to torrent"),
            VALUE,
        ),
    ] = None
    body: Annotated[
        str | None, Text("mass, or body on a prismatic joint, that moves this wall along x or y")
    ] = None
    travel: Annotated[
        Schedule | None,
        Scheduled(
            "position",
            about="displacement of this wall along x or y, instead of `body` [m]",
            moves=True,
        ),
    ] = None
    zone: Annotated[
        float | None,
        Quantity(
            "length",
            positive,
            "width of the zone whose grid lines follow the wall [m]; the whole basin if left out",
            changes=VALUE,
        ),
    ] = None
    scalars: Annotated[
        dict[str, Any],
        ScalarValues("scalar values of the inflow, for a given velocity or an open boundary"),
    ] = {}
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("boundary", "impedance", *CLOSURES),
        ("body", "travel"),
        ("side", "at", "polygon"),
        ("area", "polygon"),
    )

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        faults = super().key_faults(given)
        # a fault already, by which other keys are right or not
        if len({"side", "at", "polygon"} & given.keys()) > 1:
            return faults
        if "polygon" not in given and ("at" in given) != ("area" in given):
            present, missing = ("at", "area") if "at" in given else ("area", "at")
            faults.append(
                ((), f"{missing} is missing, which an interior patch with `{present}` needs")
            )
        if "at" in given or "polygon" in given:
            text = "applies to patches of the boundary, and this is an interior patch; leave this key out"
            faults += [
                ((key,), text) for key in given if key in cls.keys() and key not in INTERIOR_KEYS
            ]
        return faults

    @property
    def is_interior(self) -> bool:
        """True if the patch lies inside the basin and not on its boundary."""
        return self.at is not None or self.polygon is not None

    @property
    def closure(self) -> str | None:
        """Key of the closure of a driven patch, or "critical"; None for other patches, and for interior patches."""
        if self.is_interior:
            return None
        stated = next((key for key in CLOSURES if getattr(self, key) is not None), None)
        return self.boundary if stated is None and self.boundary == "critical" else stated

    @property
    def passes(self) -> bool:
        """True if water flows through the patch without a link: it is open or driven."""
        return self.boundary == "open" or self.closure is not None

    @property
    def moves(self) -> bool:
        """True if the patch is a moving wall."""
        return self.body is not None or self.travel is not None


class Cells(Value):
    """Numbers of cells along x and y of a rectangle."""

    about = "numbers of cells along x and y; required without `mesh`"
    takes = "[whole number, whole number]"

    def read(self, given: Any, setting: ReadContext) -> tuple[int, int]:
        is_pair = (
            isinstance(given, (list, tuple))
            and len(given) == 2
            and all(type(n) is int and n > 0 for n in given)
        )
        if not is_pair:
            raise ValueError(
                f"{show(given)} is not a pair of numbers of cells; expected for example [64, 32]"
            )
        return tuple(given)


class Holes(Value):
    """Rectangles cut out of a rectangular basin."""

    about = (
        "rectangles cut out of the basin, on grid lines, or polygons of a file, such as buildings"
    )
    takes = 'list of [x0, y0, x1, y1], m; `{ polygons = "FILE" }`'

    def read(self, given: Any, setting: ReadContext) -> Any:
        if isinstance(given, dict) and "polygons" in given:
            from fvsolve.parts.polygon_values import read_polygon_holes  # few basins have some

            return read_polygon_holes(given, setting)
        if not isinstance(given, (list, tuple)) or (
            given and not isinstance(given[0], (list, tuple))
        ):
            raise ValueError(
                f"{show(given)} is not a list of holes; expected [[x0, y0, x1, y1], ...], "
                'or { polygons = "NAME.gpkg" }'
            )
        return tuple(Rows("length", length=4).read(hole, setting) for hole in given)


class File(Value):
    """Key that gives the path of a file; its value as read is the name of the copy in the run directory."""

    takes = "path"

    def __init__(self, about: str) -> None:
        self.about = about

    def read(self, given: Any, setting: ReadContext) -> str:
        return copy_name(find_file(Text().read(given, setting), setting), setting)

    def json(self) -> dict[str, Any]:
        return {"type": "string"}


class GroupNames(Value):
    """Value of a case file: names of groups of a mesh file."""

    takes = "list of names"
    schema = {"type": "array", "items": {"type": "string"}}

    def __init__(self, about: str) -> None:
        self.about = about

    def read(self, given: Any, setting: ReadContext) -> tuple[str, ...]:
        if not isinstance(given, (list, tuple)) or not all(isinstance(x, str) for x in given):
            raise ValueError(
                f'{show(given)} is not a list of names; expected for example ["section 1"]'
            )
        return tuple(given)


class BasinMesh(Table):
    """A mesh of triangles and quadrilaterals, whose groups of lines are patches; or square cells over a raster."""

    raster_keys: ClassVar[tuple[str, ...]] = ("cell", "outside", "band", "variable")
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("file", "raster"),
        ("unit", "raster"),
        ("ignore", "raster"),
    )
    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("file", "raster"),)

    file: Annotated[str | None, File("mesh file that meshio reads, path relative to the case")] = (
        None
    )
    unit: Annotated[str, Text("unit of the coordinates of the file")] = "m"
    ignore: Annotated[
        tuple[str, ...], GroupNames("groups of lines of the file that are no patches")
    ] = ()
    raster: Annotated[str | None, File("raster that the cells cover, instead of a mesh file")] = (
        None
    )
    cell: Annotated[
        float | None,
        Quantity("length", positive, "side of the cells over the raster [m]", changes=SHAPE),
    ] = None
    outside: Annotated[
        str | None,
        Choice("choice", ("hole",), "hole: cells without data in the raster are left out"),
    ] = None
    band: Annotated[int, Whole(between(1, 1e6), "band of a GeoTIFF")] = 1
    variable: Annotated[str, Text("variable of a NetCDF file; the only one if left out")] = ""

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        faults = super().key_faults(given)
        if "raster" in given:
            return faults + (
                []
                if "cell" in given
                else [((), "cell is missing, the side of the cells over the raster")]
            )
        text = "applies to the cells over a `raster`; give `raster` instead of `file`, or leave this key out"
        return faults + [((key,), text) for key in cls.raster_keys if key in given]

    def table(self) -> dict[str, Any]:
        """Keys and values as in a case file: those of a mesh file, or those of a raster."""
        others = ("unit",) if self.raster else self.raster_keys
        return {
            key: value
            for key, value in super().table().items()
            if key not in others and value not in ("", [])
        }


class ReferenceSystem(Text):
    """Value of a case file for a coordinate reference system, by its number."""

    def read(self, given: Any, setting: ReadContext) -> str:
        if re.fullmatch(r"EPSG:\d+", text := super().read(given, setting)) is None:
            raise ValueError(
                f'{show(given)} is not a coordinate reference system; expected for example "EPSG:32633"'
            )
        if is_in_degrees(text):
            raise ValueError(
                f'{show(given)} is in degrees; expected a system in metres, for example "EPSG:32633"'
            )
        return text


ORIGIN = Rows(
    "length",
    length=2,
    about="easting and northing of x = 0, y = 0, for rasters [m]; default [0, 0]",
    changes=SHAPE,
)


class VelocityStart(Table):
    """Initial velocities of a basin whose equations have velocities."""

    u: Annotated[SpatialField, SpatialFieldKey("velocity", "velocity along x [m/s]")] = uniform(0.0)
    v: Annotated[SpatialField, SpatialFieldKey("velocity", "velocity along y [m/s]")] = uniform(0.0)


class BasinStart(Table):
    """Initial values of a basin that is not at rest; the valid keys depend on its `physics`."""


class PatchNode(PlaceOnBody):
    """A patch as a node: it has the pressure of the cells behind it and carries flow into them."""

    fixes_pressure: ClassVar[bool] = True
    kind: ClassVar[str] = "patch"
    quantities: ClassVar[dict[str, str]] = {**Node.quantities, "flow": "flow"}  # into the basin

    basin: str
    patch: str
    depth: float | None = None  # of water at rest, mean over the cells behind the patch [m]
    pressure: float | None = None  # of a liquid at rest [Pa]


class DrivenPatch(PatchNode):
    """A patch with a closure; probes: level above the elevation of the basin, Froude number of the flow through it."""

    quantities: ClassVar[dict[str, str]] = PatchNode.quantities | {
        "level": "level",
        "froude": "number",
    }


class PatchJunction(PatchNode):
    """The place `BASIN.PATCH` of links whose flow passes through the faces of the patch to its cells.

    Probes: as of a `DrivenPatch`. The cells are at the place `BASIN.PATCH.inside`.
    """

    fixes_pressure: ClassVar[bool] = False
    kind: ClassVar[str] = "patch-junction"
    quantities: ClassVar[dict[str, str]] = DrivenPatch.quantities
    flow: Schedule = constant(0.0)  # given inflow


class MovingWall(PatchNode):
    """A patch that is a moving wall; probes: force on the water (inward), power into the water, travel."""

    wall_quantities: ClassVar[dict[str, str]] = {
        "force": "force",
        "power": "power",
        "travel": "position",
    }
    quantities: ClassVar[dict[str, str]] = PatchNode.quantities | wall_quantities


class Physics(Table):
    """Base of the declarations of equations of basins: name in the file, keys, capabilities.

    A key without a default must be given. A key that several declarations have must be declared equally in all.
    The module `lower.py` beside the declaration fills the rows of tables.
    states : quantity of cells -> its unit, the stored quantity first
    fields : quantity that can be probed at a point -> its dimension; starts : table with the keys of `start`
    maxima : quantity of each cell over all steps, such as a greatest value -> its dimension; {} if there are none
    laws : supported density laws, all if empty; description : text for messages about unsupported laws
    joined : True if links may join its patches (False where the velocity is given); moves : True if walls may move
    on_bodies : True if the basin may be on a body; links_on_bodies : True if links may then join its patches
    has_modes : True if `sloshing` may be other than "cells"; carries : True if the basin carries scalars
    allows_impedance : True if a boundary may have an impedance
    has_closures : True if patches may have a stage, discharge, rating or slope
    has_shocks : True if waves steepen into lasting shocks; schemes then have at most second order in smooth plane flow
    """

    kinds: ClassVar[Kinds] = Kinds()
    name: ClassVar[str] = ""
    package: ClassVar[str] = ""  # that fills rows of tables; that of the declaration if empty
    states: ClassVar[dict[str, str]] = {}
    fields: ClassVar[dict[str, str]] = {}
    maxima: ClassVar[dict[str, str]] = {}
    totals: ClassVar[dict[str, str]] = {}
    starts: ClassVar[type[Table]] = Table
    laws: ClassVar[tuple[str, ...]] = ()
    description: ClassVar[str] = "basins"
    joined: ClassVar[bool] = True
    moves: ClassVar[bool] = False
    on_bodies: ClassVar[bool] = False
    has_modes: ClassVar[bool] = False
    links_on_bodies: ClassVar[bool] = False
    carries: ClassVar[bool] = True
    allows_impedance: ClassVar[bool] = False
    has_shocks: ClassVar[bool] = False
    has_closures: ClassVar[bool] = False

    def __init_subclass__(cls, name: str, **rest: Any) -> None:
        super().__init_subclass__(**rest)
        cls.name = name
        if name:  # otherwise no basin of a case file may have these equations
            # whose modules are those of all physics
            Physics.kinds.declare(name, cls, "physics", "basin")

    @classmethod
    def __pydantic_init_subclass__(cls, **rest: Any) -> None:
        if not cls.name:
            return
        both = (BasinStart, optional_keys(cls.starts)), (Basin, optional_keys(cls))
        for table, keys in both:
            for key in (key for key in keys if key in table.model_fields):
                own, known = keys[key], table.model_fields[key]
                if (own.metadata, own.default) != (known.metadata, known.default):
                    del Physics.kinds[cls.name]
                    text = f"physics {show(cls.name)} declares {key} differently from the existing key of a basin"
                    raise FvsolveError(
                        f"{text}; declare it identically in both, or choose another name"
                    )
        for table, keys in both:
            table.model_fields.update(keys)
            if table.__pydantic_complete__:  # otherwise it is built when a case first has a basin
                table.model_rebuild(force=True)
        Basin.__doc__ = "\n".join([Basin.__doc__ or "", f"{cls.name}: {cls.__doc__}"])

    @classmethod
    def face_type(cls) -> type:
        """Class of the link that represents the faces of a patch."""
        raise NotImplementedError

    @classmethod
    def has_fifth_order(cls, basin: "Basin", rectangle: bool) -> bool:
        """True if schemes above second order apply to a basin; rectangle : True if its mesh is a full rectangle"""
        return rectangle

    @classmethod
    def has_friction(cls, basin: "Basin") -> bool:
        """True if friction of the bed or of walls acts on the flow of a basin."""
        return False

    @classmethod
    def rest(
        cls, basin: "Basin", mean: Callable[[Any], np.ndarray], cells: np.ndarray, area: np.ndarray
    ) -> dict[str, Any]:
        """State of a patch at rest: "elevation" [m], "depth" of water [m] and "pressure" [Pa] -> value.

        Depth and pressure are means over the cells behind the patch. A value is None for a quantity that the equations
        do not have, and for an elevation that is not stated.
        mean : function from a formula to its means over all cells
        cells : numbers of the cells behind the patch; area : areas of all cells [m2]
        """
        return {"elevation": basin.elevation, "depth": None, "pressure": None}

    @classmethod
    def formulas(
        cls, basin: "Basin", mesh: Any
    ) -> Iterator[tuple[tuple[str, ...], Any, np.ndarray | None]]:
        """Yield (key path, formula, points) for each field over the plane that the keys of these equations contain.

        points : float64[n, 2]  points at which the formula is evaluated; None if its means over the cells are used
        """
        for key in cls.model_fields:
            if isinstance(shape := getattr(basin, key), SpatialField):
                yield (key,), shape, None

    @classmethod
    def value_faults(
        cls, basin: "Basin", place: tuple[str, ...], shape: Any, mesh: Any
    ) -> Iterator[str]:
        """Yield fault texts of the values of a field in the cells of a basin; place : its key path"""
        yield from ()

    @classmethod
    def own_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        """Faults of keys that belong to other equations, and of missing keys that these equations need."""
        faults = cls.key_faults(given)
        for key in given:
            owners = [name for name, kind in Physics.kinds.items() if key in kind.model_fields]
            if owners and cls.name not in owners:
                faults.append(
                    (
                        (key,),
                        f"is not a key of physics {show(cls.name)}; it belongs to {listing(owners)}",
                    )
                )
        needed = [key for key, info in cls.model_fields.items() if info.is_required()]
        return faults + [((), f"{key} is missing") for key in needed if key not in given]

    @classmethod
    def accepts_law(cls, law: str) -> bool:
        """True if these equations support a density law."""
        return law in (cls.laws or (law,))


class Basin(PlaceOnBody, kind="basin"):
    """Water or liquid in a plane region between walls, joined to the network by patches."""

    fixes_pressure: ClassVar[bool] = True
    quantities: ClassVar[dict[str, str]] = {}

    physics: Annotated[str, Choice("physics", Physics.kinds, "equations solved in the basin")] = (
        "free-surface"
    )
    size: Annotated[
        tuple[float, float] | None,
        Rows(
            "length",
            positive,
            length=2,
            about="lengths along x and y [m]; required without `mesh`",
            changes=SHAPE,
        ),
    ] = None
    cells: Annotated[Any, Cells()] = None
    grading: Annotated[
        tuple[float, float] | None,
        Rows(
            "number",
            positive,
            length=2,
            about="ratio of last to first cell size along x and y [-]; 1 if left out",
            changes=SHAPE,
        ),
    ] = None
    holes: Annotated[Any, Holes()] = None
    mesh: Annotated[
        BasinMesh | None,
        Nested(
            BasinMesh,
            "mesh file (any format of meshio), or square cells over a raster, instead of a rectangle",
        ),
    ] = None
    origin: Annotated[tuple[float, float] | None, ORIGIN] = None
    crs: Annotated[
        str | None,
        ReferenceSystem(
            "coordinate reference system of `origin` and of rasters, such as EPSG:32633"
        ),
    ] = None
    patches: Annotated[
        Any, NamedTables(Patch, "named parts of the boundary: { outlet = { side, span } }")
    ] = {}
    start: Annotated[
        BasinStart | None,
        Nested(
            BasinStart,
            "initial level, or pressure above the pressure at rest, and velocities; at rest if left out",
        ),
    ] = None

    attitude: Annotated[
        Attitude | None, Nested(Attitude, "attitude of the basin axes relative to the body axes")
    ] = None
    sloshing: Annotated[
        str,
        Choice(
            "sloshing",
            SLOSHING_MODELS,
            "model of the water on a body: frozen (rigid), linear modes, or cells",
        ),
    ] = "cells"
    scalars: Annotated[
        dict[str, Any],
        ScalarValues("scalar values at the start, formulas of x and y", SpatialFieldKey("number")),
    ] = {}

    @property
    def physics_type(self) -> type[Physics]:
        """Declaration of the equations that `physics` names."""
        return Physics.kinds[self.physics]

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        physics = given.get("physics", cls.model_fields["physics"].default)
        known = isinstance(physics, str) and physics in Physics.kinds
        faults = Physics.kinds[physics].own_faults(given) if known else []
        rectangle = "mesh" not in given or (
            isinstance(given["mesh"], dict) and "raster" in given["mesh"]
        )
        if "mesh" in given:
            text = "is a key of rectangles, but this basin has a `mesh`; remove this key or `mesh`"
            keys = [key for key in RECTANGLE_KEYS if key in given]
            faults += [((key,), text) for key in keys if not (key == "holes" and rectangle)]
        else:
            faults += [((), f"{key} is missing") for key in RECTANGLE_KEYS[:2] if key not in given]
        for name, patch in (
            given["patches"].items() if isinstance(given.get("patches"), dict) else ()
        ):
            side = isinstance(patch, dict) and not {"side", "at", "polygon"}.isdisjoint(patch)
            if side and "side" in patch and not rectangle:
                faults.append(
                    (
                        ("patches", name),
                        "takes its faces from the mesh; remove the keys `side` and `span`",
                    )
                )
            elif isinstance(patch, dict) and not side and rectangle:
                faults.append((("patches", name), "side is missing"))
        return faults

    @classmethod
    def resolve_keys(cls, given: dict[str, Any], setting: ReadContext) -> dict[str, Any]:
        setting.frame = (0.0, 0.0), str(given.get("crs") or "")  # for the rasters of the other keys
        with suppress(ValueError):  # a fault of the key itself
            setting.frame = (
                ORIGIN.read(given.get("origin") or (0.0, 0.0), setting),
                setting.frame[1],
            )
        return given

    @classmethod
    def own_places(cls, given: dict[str, Any]) -> tuple[str, ...] | None:
        patches = given.get("patches")
        return tuple(patches) if isinstance(patches, dict) else ()

    @property
    def rotation(self) -> np.ndarray:
        """Rotation matrix from the axes of the basin to those of its body : float64[3, 3]."""
        return np.eye(3) if self.attitude is None else self.attitude.rotation

    @property
    def is_rectangle(self) -> bool:
        """True if the mesh is a rectangle of cells: from its keys, or over a raster."""
        return self.mesh is None or self.mesh.raster is not None

    @property
    def lumped(self) -> bool:
        """True if masses on the body represent the water of the basin, which then has no cells."""
        return self.on is not None and self.sloshing != "cells"

    def inner(self, name: str) -> tuple[dict[str, Node], dict[str, Any]]:
        return {}, {}

    def face_link(self, name: str, patch: str, length: float) -> Any:
        """Link from the junction `name`.`patch` of the links at a patch to its cells; length : of the faces [m]"""
        ends = {
            "from_": f"{name}.{patch}",
            "to": f"{name}.{patch}.inside",
            "basin": name,
            "patch": patch,
        }
        return self.physics_type.face_type().model_construct(**ends, length=length)

    @classmethod
    def bodies(cls, given: dict[str, Any]) -> tuple[str, ...]:
        patches = given.get("patches")
        tables = patches.values() if isinstance(patches, dict) else ()
        stated = [entry.get("body") for entry in tables if isinstance(entry, dict)]
        return (*(entry for entry in stated if isinstance(entry, str)), *super().bodies(given))


Basin.__doc__ = f"{Basin.__doc__}\n"  # every physics adds a line


def optional_keys(table: type[Table]) -> dict[str, FieldInfo]:
    """Declarations of the keys of a table, each made optional: key -> field of pydantic."""
    keys = {key: copy(info) for key, info in table.model_fields.items()}
    for info in keys.values():
        info.default = None if info.is_required() else info.default
    return keys


class PatchRows(Lowering, kind="patch"):
    """Conversion to table rows of patches of basins: nodes with the pressure of the cells behind the patch."""

    ledger_name = "dry patch"

    def place(self, draft, name, node, row) -> None:
        row["kind"], row["row"] = rec.PATCH, draft.stiff()

    def pressure_at_start(self, start, i, node, row) -> float:
        if node.pressure is not None:
            return node.pressure
        return start.law.pressure_under(node.depth) if node.depth else start.case.ambient_pressure

    def motion_text(self, name, node, row, inflow, flow, amount) -> str:
        return f"basin {name}: {amount(flow, 'flow')} flow in"


class PatchJunctionRows(Lowering, kind="patch-junction"):
    """Conversion to table rows of the places of links at patches: junctions."""

    def place(self, draft, name, node, row) -> None:
        row["kind"], row["schedule"] = (
            rec.JUNCTION,
            draft.schedules.add(node.flow, -draft.fluid.density),
        )
