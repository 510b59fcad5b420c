"""Walls of pipes: elasticity, restraint, lining, creep of plastics, stored heat; materials with their sources.

The materials are in data/pipe_materials.toml. Numbers of materials without a source are left out; the user gives them.
Of several sources, the greatest modulus is used (fastest wave, greatest pressure jump), and the mean of least and
greatest value of roughness and all other properties.
"""

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

from fvsolve.data import read_table
from fvsolve.errors import did_you_mean
from fvsolve.parts.table_model import ListTable, Table, check_table, keys_json, read_keys
from fvsolve.parts.value import (
    BY_CELLS,
    NEEDED,
    PROFILE,
    SHAPE,
    VALUE,
    Number,
    Quantity,
    Range,
    ReadContext,
    UsualRange,
    Value,
    between,
    positive,
)
from fvsolve.units import parse, show

SI = {
    "youngs_modulus": 1e9,
    "poisson_ratio": 1.0,
    "roughness": 1e-3,
    "density": 1.0,
    "specific_heat": 1.0,
}
UNITS = {
    "youngs_modulus": " GPa",
    "poisson_ratio": "",
    "roughness": " mm",
    "density": " kg/m3",
    "specific_heat": " J/kg/K",
}
# keys of a wall and a lining from which the heat that they store follows
HEAT_KEYS = ("density", "specific_heat")
# pipe materials without a source for their figures
WITHOUT_SOURCE = ("PVC-O", "PEX", "hydraulic-hose")


@dataclass(frozen=True)
class Figure:
    """Property of a material, such as its density, in SI: least and greatest value in its sources, and the value used.

    key : name of the property; sources : keys of `sources()`
    """

    key: str
    least: float
    greatest: float
    sources: tuple[str, ...]
    material_form: str = ""  # form of the material in the source

    @property
    def used(self) -> float:
        return self.greatest if self.key == "youngs_modulus" else 0.5 * (self.least + self.greatest)

    def span(self, between: str) -> str:
        """Text of the least and greatest value in the unit of the catalogue; between : text between both

        It is a single number if both are equal.
        """
        low, high = (f"{x / SI[self.key]:.4g}" for x in (self.least, self.greatest))
        return low if low == high else f"{low}{between}{high}"

    @property
    def description(self) -> str:
        """Text with the value used, its range and its sources."""
        choice = "the greatest" if self.key == "youngs_modulus" else "the mean"
        span = "" if self.least == self.greatest else f", {choice} of {self.span(' to ')}"
        form = f" ({self.material_form})" if self.material_form else ""
        texts = "; ".join(sources()[key] for key in self.sources)
        return f"{self.key.replace('_', ' ')} {self.used / SI[self.key]:.4g}{UNITS[self.key]}{span}{form}: {texts}"


@dataclass(frozen=True)
class Material:
    """Material of the catalogue; figures : key of a property -> its values (`Figure`)."""

    name: str
    figures: dict[str, Figure] = field(default_factory=dict)

    @property
    def missing_keys(self) -> list[str]:
        """Keys of the properties for which there is no source."""
        return [key for key in SI if key not in self.figures]


@functools.cache
def materials() -> dict[str, Material]:
    """Catalogue of materials: name -> material."""
    catalogue: dict[str, Material] = {}
    for name, figures in read_table("pipe_materials")["materials"].items():
        catalogue[name] = Material(name)
        for key, (least, greatest, source, *form) in figures.items():
            bounds = least * SI[key], greatest * SI[key]
            catalogue[name].figures[key] = Figure(key, *bounds, tuple(source.split(", ")), *form)
    return catalogue


def sources() -> dict[str, str]:
    """Sources of the properties of materials : key -> text."""
    return read_table("pipe_materials")["sources"]


@dataclass(frozen=True)
class Creep(ListTable):
    """Kelvin-Voigt elements: each adds a strain J (1 - exp(-t / tau)) per unit of hoop stress to the elastic strain.

    compliance : J of each element [1/Pa]; time : retardation time tau of each element [s]; t is the time since loading
    """

    compliance: tuple[float, ...]
    time: tuple[float, ...]


@dataclass(frozen=True)
class PositiveList(Value):
    """Value of a case file: a list of numbers above 0, one for each Kelvin-Voigt element."""

    dimension: str
    changes: str = VALUE

    def read(self, given: Any, setting: ReadContext) -> tuple[float, ...]:
        if not isinstance(given, (list, tuple)) or not given:
            raise ValueError(
                f"{show(given)} is not a list of numbers; expected one number for each creep element"
            )
        values = tuple(float(parse(raw, self.dimension)) for raw in given)
        for raw, value in zip(given, values, strict=True):
            positive.check(value, raw)
        return values

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": {"type": ["number", "string"]}}


CREEP_KEYS = {
    "compliance": (PositiveList("compliance"), NEEDED),
    "time": (PositiveList("time"), NEEDED),
}


class Elements(Value):
    """Value of a case file for Kelvin-Voigt elements: equal numbers of compliances and times, all above 0."""

    about = "Kelvin-Voigt elements of a viscoelastic wall"
    takes = "`{ compliance, time }`, lists of 1/Pa and s"
    changes = SHAPE

    def read(self, given: Any, setting: ReadContext) -> Creep:
        if isinstance(given, Creep):
            return given
        check_table(given, "{ compliance = [1e-10], time = [0.05] }")
        creep = Creep(**read_keys(given, CREEP_KEYS, setting))
        if len(creep.compliance) != len(creep.time):
            sizes = f"`compliance` has length {len(creep.compliance)}, and `time` has length {len(creep.time)}"
            raise ValueError(f"{sizes}; expected one compliance and one time for each element")
        return creep

    def below(self, key: str) -> Value | None:
        return CREEP_KEYS[key][0]

    def json(self) -> dict[str, Any]:
        return keys_json(CREEP_KEYS)


MODULI = UsualRange(1e5, 1.2e12, "soft rubber to diamond")
THICKNESS = UsualRange(1e-6, 2.0, "foils to lined rock")
THIN_WALL = 25.0  # least bore over wall of a thin wall, Wylie, Streeter and Suo 1993
DENSITY = Quantity(
    "density",
    positive,
    "density, for `retardation` [kg/m3]",
    UsualRange(500.0, 2.3e4, "wood to tungsten"),
)
SPECIFIC_HEAT = Quantity(
    "specific_heat",
    positive,
    "specific heat, for `retardation` [J/kg/K]",
    UsualRange(100.0, 3e3, "lead to plastics"),
)
RESTRAINTS = ("joints", "upstream", "anchored")
POISSON = "poisson_ratio"
OF_WALL = "wall"  # retardation factor that follows from the wall


class Wall(Table):
    """An elastic wall: 1/K = 1/beta + c diameter / (youngs_modulus thickness), K the effective bulk modulus.

    beta is the bulk modulus of the fluid, c the factor of the key `restraint`, 1 by default.
    """

    youngs_modulus: Annotated[
        float, Quantity("modulus", positive, "Young's modulus of the wall [Pa]", MODULI, BY_CELLS)
    ]
    thickness: Annotated[
        float, Quantity("length", positive, "wall thickness [m]", THICKNESS, BY_CELLS)
    ]
    poisson_ratio: Annotated[
        float | None,
        Number(between(0.0, 0.5), "Poisson's ratio of the wall, for restraint", changes=BY_CELLS),
    ] = None
    creep: Annotated[Creep | None, Elements()] = None
    density: Annotated[float | None, DENSITY] = None
    specific_heat: Annotated[float | None, SPECIFIC_HEAT] = None


class Lining(Table):
    """An inner layer of the wall, such as cement mortar, with the same hoop strain as the wall.

    The sum of modulus times thickness of wall and lining replaces that of the wall.
    """

    youngs_modulus: Annotated[
        float, Quantity("modulus", positive, "Young's modulus of the lining [Pa]", MODULI, BY_CELLS)
    ]
    thickness: Annotated[
        float, Quantity("length", positive, "thickness of the lining [m]", THICKNESS, BY_CELLS)
    ]
    density: Annotated[float | None, DENSITY] = None
    specific_heat: Annotated[float | None, SPECIFIC_HEAT] = None


class MaterialName(Value):
    """Value of a case file for the name of a material of the catalogue."""

    about = "material of the wall: gives Young's modulus, Poisson's ratio and roughness, where the catalogue has them"
    changes = BY_CELLS

    @property
    def names(self) -> list[str]:
        return list(materials())

    def read(self, given: Any, setting: ReadContext) -> str:
        if isinstance(given, str) and given in self.names:
            return given
        if not isinstance(given, str):
            raise ValueError(f"{show(given)} is not text; expected one of {', '.join(self.names)}")
        wall = "leave `material` out, and give wall = { youngs_modulus, thickness }"
        if given in WITHOUT_SOURCE:
            raise ValueError(f"the catalogue has no data of {given}; {wall}")
        raise ValueError(
            f"unknown material {show(given)}{did_you_mean(given, self.names)}; expected "
            f"{', '.join(self.names)}; for any other material {wall}"
        )

    @property
    def takes(self) -> str:
        return ", ".join(f"`{name}`" for name in self.names)

    def json(self) -> dict[str, Any]:
        return {"enum": self.names}


class WallOrRigid(Value):
    """Value of a case file for the wall of a pipe: the text "rigid", or the table of an elastic wall."""

    about = 'wall, elastic or rigid; "rigid" if left out'
    takes = '`"rigid"`, or `{ youngs_modulus, thickness, poisson_ratio, creep, density, specific_heat }`, SI'
    changes = BY_CELLS

    def read(self, given: Any, setting: ReadContext) -> Wall | str:
        if isinstance(given, Wall) or given == "rigid":
            return given
        if not isinstance(given, dict):
            raise ValueError(
                f'{show(given)} is not a wall; expected "rigid" or {{ youngs_modulus, thickness }}'
            )
        return Wall.model_validate(given, context=setting)

    def below(self, key: str) -> Value | None:
        return Wall.values()[key]

    def json(self) -> dict[str, Any]:
        schema = Wall.model_json_schema()
        del schema["required"]  # a material or a nominal size may give them
        return {"anyOf": [{"const": "rigid"}, schema]}


class Restraint(Value):
    """Value of a case file for the axial restraint of a pipe: a word, or the factor c of the wall compliance."""

    about = "axial restraint; 1 (thin wall between expansion joints) if left out"
    takes = "`joints`, `upstream`, `anchored`, or a number, above 0"
    changes = BY_CELLS

    def read(self, given: Any, setting: ReadContext) -> str | float:
        if isinstance(given, str):
            if given in RESTRAINTS:
                return given
            raise ValueError(
                f"unknown restraint {show(given)}; expected one of {', '.join(RESTRAINTS)}, or a number"
            )
        value = parse(given, "number")
        positive.check(value, given)
        return value

    def json(self) -> dict[str, Any]:
        return {"anyOf": [{"enum": list(RESTRAINTS)}, {"type": "number", "exclusiveMinimum": 0}]}


class RetardationFactor(Value):
    """Value of a case file for a retardation factor: a number of at least 1, or "wall"."""

    changes = PROFILE
    takes = '1 or more, or `"wall"`'
    schema: ClassVar[dict[str, Any]] = {
        "anyOf": [{"const": OF_WALL}, {"type": "number", "minimum": 1}]
    }

    def read(self, given: Any, setting: ReadContext) -> str | float:
        if given == OF_WALL:
            return OF_WALL
        if isinstance(given, str):
            raise ValueError(
                f'{show(given)} is not a number; expected a number of at least 1, or "{OF_WALL}"'
            )
        value = parse(given, "number")
        Range(1.0).check(value, given)
        return value


def restraint_factor(restraint: str | float | None, bore: float, wall: Wall) -> float:
    """Factor c of the growth of the bore area A with pressure, dA / A = c D / (E e) dp; 1 without a restraint.

    restraint : the factor itself, or one of `RESTRAINTS`
    D : bore, E : Young's modulus, e : thickness, nu : Poisson's ratio of the wall
    For a thin wall (D/e >= 25) it is 1 with expansion joints, 1 - nu/2 if the pipe is anchored only upstream, and
    1 - nu^2 if it is anchored throughout.
    For a thick wall (Lame) it is the factor of the thin wall times D / (D + e), plus 2 (e/D) (1 + nu); Wylie and
    Streeter 1993.
    """
    if restraint is None:
        return 1.0
    if not isinstance(restraint, str):
        return restraint
    nu = wall.poisson_ratio or 0.0
    thin = {"joints": 1.0, "upstream": 1.0 - 0.5 * nu, "anchored": 1.0 - nu * nu}[restraint]
    ratio = wall.thickness / bore
    if ratio * THIN_WALL <= 1.0:
        return thin
    return thin / (1.0 + ratio) + 2.0 * ratio * (1.0 + nu)


def creep_elements(pipe: Any) -> tuple[tuple[float, float], ...]:
    """(final relative growth of the bore area per pressure [1/Pa], time constant [s]) of each creep element of a wall.

    The growth is dA / (A dp), with the bore area A.
    """
    wall = pipe.wall
    if not isinstance(wall, Wall) or wall.creep is None:
        return ()
    factor = restraint_factor(pipe.restraint, pipe.diameter, wall) * pipe.diameter / wall.thickness
    return tuple(
        (factor * compliance, time)
        for compliance, time in zip(wall.creep.compliance, wall.creep.time, strict=True)
    )


def elastic_compliance(pipe: Any) -> float:
    """Elastic growth of the bore area A of a pipe with pressure, dA / (A dp) [1/Pa]; 0 for a rigid wall."""
    wall = pipe.wall
    if not isinstance(wall, Wall):
        return 0.0
    stiffness = wall.youngs_modulus * wall.thickness
    if pipe.lining is not None:
        stiffness += pipe.lining.youngs_modulus * pipe.lining.thickness
    if pipe.restraint is None:
        return pipe.diameter / stiffness
    return restraint_factor(pipe.restraint, pipe.diameter, wall) * pipe.diameter / stiffness


def heat_retardation(pipe: Any, density: float, specific_heat: float) -> float:
    """Heat that fluid, lining and wall of a pipe store, over that of the fluid: 1 + sum of rho' c' A' / (rho c A).

    rho', c', A' : density, specific heat and cross section of lining and wall; A : cross section of the bore
    density, specific_heat : rho [kg/m3] and c [J/kg/K] of the fluid
    """
    bore, factor = pipe.diameter, 1.0
    for layer in (pipe.lining, pipe.wall):
        if layer is not None:
            section = math.pi * (bore + layer.thickness) * layer.thickness
            content = density * specific_heat * 0.25 * math.pi * pipe.diameter**2
            factor += layer.density * layer.specific_heat * section / content
            bore += 2.0 * layer.thickness
    return factor


def retardation_faults(pipe: Any) -> Iterator[tuple[tuple[Any, ...], str]]:
    """Faults (keys, text) of retardation factors by the wall of a pipe: data of the wall or the lining are missing."""
    for scalar, factor in pipe.retardation.items():
        if factor != OF_WALL:
            continue
        layers = {"wall": pipe.wall, **({} if pipe.lining is None else {"lining": pipe.lining})}
        for key, layer in layers.items():
            missing = [name for name in HEAT_KEYS if getattr(layer, name, None) is None]
            if not isinstance(layer, (Wall, Lining)):
                text = '"wall" needs wall = { youngs_modulus, thickness, density, specific_heat }, or a material'
                yield (
                    ("retardation", scalar),
                    f"{text} with a wall thickness; or give the factor as a number",
                )
            elif missing:
                source = (
                    f" (the catalogue has no value for {pipe.material})"
                    if pipe.material and key == "wall"
                    else ""
                )
                keys = " and ".join(f"{key}.{name}" for name in missing)
                yield (
                    ("retardation", scalar),
                    f'"wall" needs {keys}{source}; or give the factor as a number',
                )


def wall_faults(pipe: Any) -> Iterator[tuple[tuple[Any, ...], str]]:
    """Faults (keys, text) of a pipe wall: no Poisson's ratio for its restraint, or creep together with a lining."""
    wall = pipe.wall
    if not isinstance(wall, Wall):
        return
    thick_joints = pipe.restraint == "joints" and wall.thickness * THIN_WALL > pipe.diameter
    if wall.poisson_ratio is None and (pipe.restraint in ("upstream", "anchored") or thick_joints):
        reason = (
            f"the catalogue has no value for {pipe.material}" if pipe.material else "none is given"
        )
        text = f"{show(pipe.restraint)} needs Poisson's ratio of the wall, and {reason}; give wall.poisson_ratio"
        yield ("restraint",), text
    if wall.creep is not None and pipe.lining is not None:
        yield (
            ("wall", "creep"),
            "is not available for a lined wall; keep only one of the keys `creep` and `lining`",
        )
