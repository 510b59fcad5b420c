"""A basin: fields in the plane. Knows its outline, its physics and who may join where; computes nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from fvsolve.errors import listing
from fvsolve.parts.formula import Formula, Shaped, even
from fvsolve.parts.node import Node
from fvsolve.parts.scalar import Carried
from fvsolve.parts.series import copy_name, find_file
from fvsolve.parts.table import Inside, Named, Table, at_most_one, read_keys
from fvsolve.parts.value import (
    PROFILE,
    SHAPE,
    VALUE,
    Choice,
    Misfit,
    Quantity,
    Rows,
    Setting,
    Text,
    Usual,
    Value,
    anything,
    nonnegative,
    positive,
)
from fvsolve.units import show

SIDES = ("west", "east", "south", "north")
PHYSICS = ("free-surface", "liquid", "transport")
OF_ONE = {  # keys that mean something to some physics alone
    "level": ("free-surface",), "bed": ("free-surface",), "manning": ("free-surface",), "factor": ("free-surface",),
    "pressure": ("liquid",), "wave_speed": ("liquid",), "velocity": ("transport",),
    "thickness": ("liquid", "transport"),
}  # fmt: skip
NEEDS = {"free-surface": ("level",), "liquid": ("pressure", "thickness"), "transport": ("velocity",)}
OUTLINE = ("size", "cells", "grading", "holes")  # of rectangles
MOVES = {"u": "velocity", "v": "velocity", "speed": "velocity"}
FIELDS = {  # what can be read at a point: name -> dimension
    "free-surface": {"depth": "level", "surface": "level", "bed": "level", **MOVES},
    "liquid": {"pressure": "pressure", **MOVES},
    "transport": {},
}


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
    scalars: Annotated[dict[str, Any], Carried("of scalars that the given velocity brings in")] = {}
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("boundary", "impedance"),)


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


class Start(Table):
    """What a basin starts from where that is not rest."""

    level: Annotated[Formula | None, Shaped("length", "of the free surface above the elevation [m]")] = None
    pressure: Annotated[Formula | None, Shaped("pressure_drop", "of a liquid above that at rest [Pa]")] = None
    u: Annotated[Formula, Shaped("velocity", "velocity along x [m/s]")] = even(0.0)
    v: Annotated[Formula, Shaped("velocity", "velocity along y [m/s]")] = even(0.0)


@dataclass(frozen=True)
class Velocity:
    """A given velocity: `way` "u, v" | "stream" | "expression" | "file", what it takes, and when it turns back [s].

    given : {"u": Formula, "v": Formula} | {"stream": Formula} | {"expression": name, its parameters} | {"file": path}
    """

    way: str
    given: dict[str, Any]
    period: float | None
    said: dict[str, Any]

    def table(self) -> dict[str, Any]:
        """What the file would say."""
        return self.said


PARAMETERS: dict[str, Value] = {  # of velocities by name
    "expression": Text(),
    **dict.fromkeys(("u", "v", "speed"), Quantity("velocity")),
    **dict.fromkeys(("size", "width", "height", "y0", "south", "north"), Quantity("length")),
    **dict.fromkeys(("centre", "origin"), Rows("length", length=2)),
    "angular_velocity": Quantity("angular_velocity"),
    "rate": Quantity("rate"),
}


class Flowing(Value):
    """A velocity: { u, v } or { stream }, formulas of x and y, { expression, ... } or { file }."""

    about = "{ u, v } or { stream }, formulas of x and y in SI, { expression, its parameters } or { file }; and period"
    takes = "`{ u, v }`, `{ stream }`, `{ expression, ... }` or `{ file }`, and `period`"
    changes = PROFILE

    def read(self, given: Any, setting: Setting) -> Velocity:
        if isinstance(given, Velocity):
            return given
        ways = [way for way in ("u", "v", "stream", "expression", "file") if isinstance(given, dict) and way in given]
        if "expression" in ways and not {"stream", "file"} & {*ways}:
            ways = ["expression"]  # which may have parameters u and v
        if not ways or (len(ways) > 1 and ways != ["u", "v"]):
            has = f"has {listing(given) or 'nothing'}" if isinstance(given, dict) else f"{show(given)} is no velocity"
            raise ValueError(f"{has}; wanted {self.about}")
        found = {key: value for key, value in given.items() if key != "period"}
        period, said = None, dict(given)
        if "period" in given:
            period = said["period"] = Quantity("time", positive).read(given["period"], setting)
        way = "u, v" if ways[0] in "uv" else ways[0]
        known = {"u, v": ("u", "v"), "stream": ("stream",), "file": ("file",)}.get(way, tuple(found))
        faults = [((key,), f"unknown key; wanted {listing([*known, 'period'])}") for key in found if key not in known]
        if faults:
            raise Misfit(faults)
        if way in ("u, v", "stream"):
            of = "number" if way == "stream" else "velocity"
            found = {key: Shaped(of).read(found.get(key, 0.0), setting) for key in known}
        elif way == "expression":
            own = {key: one for key, one in found.items() if key in PARAMETERS}
            found |= read_keys(own, {key: (PARAMETERS[key], None) for key in own}, setting)
        elif way == "file":
            said["file"] = File("").read(found["file"], setting)
            found = {"file": setting.files[said["file"]]}
        return Velocity(way, found, period, said)


class Place(Node):
    """A patch as a place: pressure in the cells behind it, flow into them."""

    fixes_pressure: ClassVar[bool] = True
    kind: ClassVar[str] = "patch"
    quantities: ClassVar[dict[str, str]] = {**Node.quantities, "flow": "flow"}  # into the basin

    basin: str
    patch: str
    depth: float | None = None  # of water at rest, mean over the cells behind [m]
    pressure: float | None = None  # of a liquid at rest [Pa]


class Basin(Node, kind="basin"):
    """Fields in the plane between walls, joined to the network by patches.

    free-surface: h_t + div q = 0, q_t + div(q q / h + g h^2 / 2) = -g h grad(bed) - friction.
    liquid: r_t + div m = 0, m_t + div(m m / r) + grad p(r) = 0.
    transport: (d phi)_t + div(d w phi) = div(d D grad phi), velocity w given.
    """

    fixes_pressure: ClassVar[bool] = True
    quantities: ClassVar[dict[str, str]] = {}

    physics: Annotated[str, Choice("physics", PHYSICS, "of its fields")] = "free-surface"
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
        Start | None, Inside(Start, "level or pressure above that at rest, and velocities; at rest if left out")
    ] = None

    level: Annotated[
        float | None,
        Quantity("level", anything, "of the water at rest, above the elevation [m]; free surface, needed there"),
    ] = None
    bed: Annotated[Formula | None, Shaped("length", "height above the elevation [m], free surface; 0 if left out")] = (
        None
    )
    manning: Annotated[
        float | None,
        Quantity(
            "number",
            nonnegative,
            "Manning's n [s/m^(1/3)], free surface; no friction if left out",
            Usual(0.005, 0.5, "glass to dense brush"),
            VALUE,
        ),
    ] = None
    factor: Annotated[
        float | None,
        Quantity(
            "number",
            nonnegative,
            "Darcy's, in place of manning [-], free surface; no friction if left out",
            Usual(0.002, 3.0, "glass to boulders"),
            VALUE,
        ),
    ] = None

    pressure: Annotated[float | None, Quantity("pressure", positive, "at rest [Pa]; liquid, needed there")] = None
    thickness: Annotated[
        float | None, Quantity("length", positive, "across the plane [m]; needed by a liquid, in transport 1")
    ] = None
    wave_speed: Annotated[
        float | None, Quantity("velocity", positive, "of a liquid [m/s]; the fluid's own if left out")
    ] = None

    velocity: Annotated[Any, Flowing()] = None
    scalars: Annotated[dict[str, Any], Carried("of scalars at the start, formulas of x and y", Shaped("number"))] = {}

    def fields(self) -> dict[str, str]:
        """What can be read at a point of it: name -> dimension."""
        return FIELDS[self.physics]

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        physics = given.get("physics", "free-surface")
        faults = at_most_one(given, ("manning", "factor"))
        if physics in PHYSICS:
            for key, goes in OF_ONE.items():
                if key in given and physics not in goes:
                    faults.append(((key,), f"means nothing to physics {show(physics)}; it goes with {listing(goes)}"))
            faults += [((), f"{key} is missing") for key in NEEDS[physics] if key not in given]
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
