"""A basin: fields in the plane. Knows its outline, its physics and who may join where; computes nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic.fields import FieldInfo

from fvsolve.errors import FvsolveError, listing
from fvsolve.parts.attitude import Attitude
from fvsolve.parts.formula import Formula, Shaped, even
from fvsolve.parts.node import Node, Rider
from fvsolve.parts.scalar import Carried
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.series import copy_name, find_file
from fvsolve.parts.table import Inside, Named, Table
from fvsolve.parts.value import (
    SHAPE,
    VALUE,
    Choice,
    Quantity,
    Rows,
    Setting,
    Text,
    Value,
    nonnegative,
    positive,
)
from fvsolve.units import show

SIDES = ("west", "east", "south", "north")
OUTLINE = ("size", "cells", "grading", "holes")  # of rectangles
SLOSHING = ("frozen", "modes", "cells")
MOVES = {"u": "velocity", "v": "velocity", "speed": "velocity"}  # fields of what has velocities


class Patch(Table):
    """A stretch of the outline: a place `BASIN.PATCH` that links may join, or a boundary that is no wall."""

    side: Annotated[str | None, Choice("side", SIDES, "of a rectangle, needed there; files name their own patches")] = (
        None
    )
    span: Annotated[
        tuple[float, float] | None,
        Rows(
            "length",
            nonnegative,
            length=2,
            about="along the side, on lines of the grid [m]; all of it if left out",
            changes=SHAPE,
        ),
    ] = None
    boundary: Annotated[
        str | None, Choice("boundary", ("wall", "open"), "waves leave where it is open; a wall if left out")
    ] = None
    impedance: Annotated[
        float | None,
        Quantity(
            "impedance", nonnegative, "pressure over velocity of waves, in place of boundary, of a liquid [Pa s/m]"
        ),
    ] = None
    body: Annotated[
        str | None, Text("a mass, or a body on a prismatic joint, that it moves with, a wall then, along x or y")
    ] = None
    travel: Annotated[
        Schedule | None, Scheduled("position", about="how far it moves along x or y, in place of body [m]")
    ] = None
    zone: Annotated[
        float | None,
        Quantity(
            "length", positive, "behind a wall that moves, in which lines go with it [m]; all of the basin if left out",
            changes=VALUE,
        ),
    ] = None  # fmt: skip
    scalars: Annotated[dict[str, Any], Carried("of scalars that the given velocity brings in")] = {}
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("boundary", "impedance"), ("body", "travel"))

    @property
    def moves(self) -> bool:
        """Whether it is a wall that moves."""
        return self.body is not None or self.travel is not None


class Cells(Value):
    """Numbers of cells along both sides."""

    about = "numbers of cells along x and y; a mesh is needed if left out"
    takes = "[whole number, whole number]"

    def read(self, given: Any, setting: Setting) -> tuple[int, int]:
        whole = (
            isinstance(given, (list, tuple)) and len(given) == 2 and all(type(one) is int and one > 0 for one in given)
        )
        if not whole:
            raise ValueError(f"{show(given)} is no pair of numbers of cells; wanted for example [64, 32]")
        return tuple(given)


class Holes(Value):
    """Rectangles that are cut out."""

    about = "cut out of the rectangle, on lines of the grid"
    takes = "list of [x0, y0, x1, y1], m"

    def read(self, given: Any, setting: Setting) -> tuple[tuple[float, ...], ...]:
        if not isinstance(given, (list, tuple)) or (given and not isinstance(given[0], (list, tuple))):
            raise ValueError(f"{show(given)} is no list of holes; wanted [[x0, y0, x1, y1], ...]")
        return tuple(Rows("length", length=4).read(one, setting) for one in given)


class File(Value):
    """A file, under the name by which it is kept beside the resolved case."""

    def __init__(self, about: str) -> None:
        self.about = about

    def read(self, given: Any, setting: Setting) -> str:
        return copy_name(find_file(Text().read(given, setting), setting), setting)

    def json(self) -> dict[str, Any]:
        return {"type": "string"}


class MeshFile(Table):
    """A mesh of triangles and quadrilaterals; groups of lines are patches."""

    file: Annotated[str, File("that meshio reads, relative to the case")]
    unit: Annotated[str, Text("of its coordinates")] = "m"


class MovingStart(Table):
    """What starts with a velocity."""

    u: Annotated[Formula, Shaped("velocity", "velocity along x [m/s]")] = even(0.0)
    v: Annotated[Formula, Shaped("velocity", "velocity along y [m/s]")] = even(0.0)


class StartOfFields(Table):
    """What a basin starts from where that is not rest: the keys that its physics has."""


class Place(Rider):
    """A patch as a place: pressure in the cells behind it, flow into them."""

    fixes_pressure: ClassVar[bool] = True
    kind: ClassVar[str] = "patch"
    quantities: ClassVar[dict[str, str]] = {**Node.quantities, "flow": "flow"}  # into the basin

    basin: str
    patch: str
    depth: float | None = None  # of water at rest, mean over the cells behind [m]
    pressure: float | None = None  # of a liquid at rest [Pa]


class MovingWall(Place):
    """A patch that is a wall that moves: force on the water, inward, power that it brings, how far it has moved."""

    own: ClassVar[dict[str, str]] = {"force": "force", "power": "power", "travel": "position"}
    quantities: ClassVar[dict[str, str]] = Place.quantities | own


class Physics(Table):
    """What the cells of basins hold: its name in the file, keys of its own, and what goes with it.

    A key without a default must be given; one that several physics have is the same in all. `lower.py` beside what
    declares it turns it into rows of tables.
    states : quantities of cells -> their units, the first is what is stored; fields : what can be read at a point, as
    dimensions; starts : keys of `start`
    laws : of density that it goes with, all if left out; described : what other laws do not go with, in words
    joined : whether links may join its patches; a given velocity passes others
    moves : whether its walls may move; rides : whether it may ride on bodies, sloshes : by other ways than by cells,
    docks : with links at its patches
    carries : whether it carries scalars; echoes : whether its boundary may have an impedance
    steep : whether its fronts steepen into jumps that keep, and smooth flow in the plane is of second order at most
    """

    kinds: ClassVar[dict[str, type[Physics]]] = {}
    name: ClassVar[str] = ""
    states: ClassVar[dict[str, str]] = {}
    fields: ClassVar[dict[str, str]] = {}
    starts: ClassVar[type[Table]] = Table
    laws: ClassVar[tuple[str, ...]] = ()
    described: ClassVar[str] = "basins"
    joined: ClassVar[bool] = True
    moves: ClassVar[bool] = False
    rides: ClassVar[bool] = False
    sloshes: ClassVar[bool] = False
    docks: ClassVar[bool] = False
    carries: ClassVar[bool] = True
    echoes: ClassVar[bool] = False
    steep: ClassVar[bool] = False

    def __init_subclass__(cls, name: str, **rest: Any) -> None:
        super().__init_subclass__(**rest)
        if name in Physics.kinds:
            raise FvsolveError(f"a physics {show(name)} is there already; wanted another name")
        cls.name = name

    @classmethod
    def __pydantic_init_subclass__(cls, **rest: Any) -> None:
        both = (StartOfFields, optional(cls.starts)), (Basin, optional(cls))
        for table, keys in both:
            for key in (key for key in keys if key in table.model_fields):
                own, known = keys[key], table.model_fields[key]
                if (own.metadata, own.default) != (known.metadata, known.default):
                    said = f"physics {show(cls.name)} declares {key} otherwise than a basin has it already"
                    raise FvsolveError(f"{said}; wanted the same, or another name")
        for table, keys in both:
            table.model_fields.update(keys)
            if table.__pydantic_complete__:  # else it is built when a case first has one
                table.model_rebuild(force=True)
        Physics.kinds[cls.name] = cls
        Basin.__doc__ = "\n".join([ABOUT, "", *(f"{name}: {one.__doc__}" for name, one in Physics.kinds.items())])

    @classmethod
    def rubs(cls, basin: Basin) -> bool:
        """Whether its bed or its walls brake the flow."""
        return False

    @classmethod
    def rest(
        cls, basin: Basin, mean: Callable[[Any], np.ndarray], cells: np.ndarray, area: np.ndarray
    ) -> dict[str, Any]:
        """A patch at rest: its elevation [m], and depth of water [m] or pressure [Pa] in the cells behind it.

        mean : of a formula, over all cells; cells : numbers of those behind; area : of all cells
        """
        return {"elevation": basin.elevation, "depth": None, "pressure": None}

    @classmethod
    def shapes(cls, basin: Basin, mesh: Any) -> Iterator[tuple[tuple[str, ...], Any, np.ndarray | None]]:
        """Formulas of its own keys: (keys, formula, points where it is taken), None for all of cells."""
        for key in cls.model_fields:
            if isinstance(shape := getattr(basin, key), Formula):
                yield (key,), shape, None

    @classmethod
    def own_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        """Faults of the keys of physics that a basin of this one has or lacks."""
        faults = cls.key_faults(given)
        for key in given:
            goes = [name for name, one in Physics.kinds.items() if key in one.model_fields]
            if goes and cls.name not in goes:
                faults.append(((key,), f"means nothing to physics {show(cls.name)}; it goes with {listing(goes)}"))
        needed = [key for key, info in cls.model_fields.items() if info.is_required()]
        return faults + [((), f"{key} is missing") for key in needed if key not in given]

    @classmethod
    def goes(cls, law: str) -> bool:
        """Whether it goes with a density law."""
        return law in (cls.laws or (law,))


class Basin(Rider, kind="basin"):
    """Fields in the plane between walls, joined to the network by patches."""

    fixes_pressure: ClassVar[bool] = True
    quantities: ClassVar[dict[str, str]] = {}

    physics: Annotated[str, Choice("physics", Physics.kinds, "of its fields")] = "free-surface"
    size: Annotated[
        tuple[float, float] | None,
        Rows("length", positive, length=2, about="along x and y [m]; a mesh is needed if left out", changes=SHAPE),
    ] = None
    cells: Annotated[Any, Cells()] = None
    grading: Annotated[
        tuple[float, float] | None,
        Rows(
            "number",
            positive,
            length=2,
            about="last over first spacing, along x and y [-]; 1 if left out",
            changes=SHAPE,
        ),
    ] = None
    holes: Annotated[Any, Holes()] = None
    mesh: Annotated[
        MeshFile | None,
        Inside(MeshFile, "a file that meshio reads in place of a rectangle, and the unit of its coordinates"),
    ] = None
    patches: Annotated[Any, Named(Patch, "patches by name: { outlet = { side, span } }")] = {}
    start: Annotated[
        StartOfFields | None,
        Inside(StartOfFields, "level or pressure above that at rest, and velocities; at rest if left out"),
    ] = None

    attitude: Annotated[Attitude | None, Inside(Attitude, "of its axes in those of that body")] = None
    sloshing: Annotated[
        str, Choice("sloshing", SLOSHING, "of water that rides: as one with its body, by linear modes, or by cells")
    ] = "cells"
    scalars: Annotated[dict[str, Any], Carried("of scalars at the start, formulas of x and y", Shaped("number"))] = {}

    @property
    def own(self) -> type[Physics]:
        """What declares its physics."""
        return Physics.kinds[self.physics]

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        physics = given.get("physics", cls.model_fields["physics"].default)
        known = isinstance(physics, str) and physics in Physics.kinds
        faults = Physics.kinds[physics].own_faults(given) if known else []
        if "mesh" in given:
            faults += [((key,), "goes with rectangles; the basin has a mesh") for key in OUTLINE if key in given]
        else:
            faults += [((), f"{key} is missing") for key in OUTLINE[:2] if key not in given]
        for name, one in given["patches"].items() if isinstance(given.get("patches"), dict) else ():
            side = isinstance(one, dict) and "side" in one
            if side and "mesh" in given:
                faults.append((("patches", name), "has its faces from the mesh; leave side and span out"))
            elif isinstance(one, dict) and not side and "mesh" not in given:
                faults.append((("patches", name), "side is missing"))
        return faults

    @classmethod
    def own_places(cls, given: dict[str, Any]) -> tuple[str, ...] | None:
        patches = given.get("patches")
        return tuple(patches) if isinstance(patches, dict) else ()

    @property
    def turn(self) -> np.ndarray:
        """How it stands in the axes of its body : float64[3, 3]."""
        return np.eye(3) if self.attitude is None else self.attitude.rotation

    @property
    def lumped(self) -> bool:
        """Whether its water is but masses on the body that it rides on, without cells."""
        return self.on is not None and self.sloshing != "cells"

    def inner(self, name: str) -> tuple[dict[str, Node], dict[str, Any]]:
        return {}, {}

    @classmethod
    def bodies(cls, given: dict[str, Any]) -> tuple[str, ...]:
        patches = given.get("patches")
        tables = patches.values() if isinstance(patches, dict) else ()
        stated = [one.get("body") for one in tables if isinstance(one, dict)]
        return (*(one for one in stated if isinstance(one, str)), *super().bodies(given))


ABOUT = Basin.__doc__  # to which every physics adds a line


def optional(table: type[Table]) -> dict[str, FieldInfo]:
    """The keys of a table, all of which may be left out."""
    found = {key: copy(info) for key, info in table.model_fields.items()}
    for info in found.values():
        info.default = None if info.is_required() else info.default
    return found


for folder in sorted(Path(__file__).parents[2].glob("basins/*/part.py")):
    import_module(f"fvsolve.basins.{folder.parent.name}.part")
