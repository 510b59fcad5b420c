"""The wall of a pipe: how far it gives way to pressure, at once and in time. Knows no fluid and no file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from fvsolve.errors import did_you_mean
from fvsolve.parts.pipe.creep import Creep, Elements
from fvsolve.parts.table import Table
from fvsolve.parts.value import COUNTED, Number, Quantity, Setting, Usual, Value, between, positive
from fvsolve.units import parse, show

MODULI = Usual(1e5, 1.2e12, "soft rubber to diamond")
THICKNESS = Usual(1e-6, 2.0, "foils to lined rock")
THIN = 25.0  # bores over walls from which on a wall counts as thin, Wylie, Streeter and Suo 1993
RESTRAINTS = ("joints", "upstream", "anchored")
POISSON = "poisson_ratio"


class Wall(Table):
    """An elastic wall: 1/K = 1/beta + c diameter / (youngs_modulus thickness), c of its restraint."""

    youngs_modulus: Annotated[float, Quantity("modulus", positive, "of the wall's material [Pa]", MODULI, COUNTED)]
    thickness: Annotated[float, Quantity("length", positive, "of the wall [m]", THICKNESS, COUNTED)]
    poisson_ratio: Annotated[
        float | None, Number(between(0.0, 0.5), "of the wall's material, for restraint", changes=COUNTED)
    ] = None
    creep: Annotated[Creep | None, Elements()] = None


class Lining(Table):
    """A second layer within the wall, such as cement mortar: it shares the hoop strain, E e + E' e' in place of E e."""

    youngs_modulus: Annotated[float, Quantity("modulus", positive, "of the lining [Pa]", MODULI, COUNTED)]
    thickness: Annotated[float, Quantity("length", positive, "of the lining [m]", THICKNESS, COUNTED)]


class OfCatalogue(Value):
    """The name of a material whose figures were read."""

    about = "of the wall: modulus, Poisson's ratio and roughness, where their source was read"
    changes = COUNTED

    @property
    def names(self) -> list[str]:
        from fvsolve.parts.pipe.materials import materials  # read by pipes that name one

        return list(materials())

    def read(self, given: Any, setting: Setting) -> str:
        from fvsolve.parts.pipe.materials import UNREAD

        if isinstance(given, str) and given in self.names:
            return given
        if not isinstance(given, str):
            raise ValueError(f"{show(given)} is no text; wanted one of {', '.join(self.names)}")
        wall = "give wall = { youngs_modulus, thickness }"
        if given in UNREAD:
            raise ValueError(f"no source of the figures of {given} was read; {wall}")
        raise ValueError(f"no material named {show(given)}{did_you_mean(given, self.names)}; materials are "
                         f"{', '.join(self.names)}; of any other {wall}")  # fmt: skip

    @property
    def takes(self) -> str:
        return ", ".join(f"`{name}`" for name in self.names)

    def json(self) -> dict[str, Any]:
        return {"enum": self.names}


class WallOrStiff(Value):
    """The text "stiff" or the table of an elastic wall."""

    about = 'elastic or stiff; "stiff" if left out'
    takes = '`"stiff"`, or `{ youngs_modulus, thickness, poisson_ratio, creep }`, Pa and m'
    changes = COUNTED

    def read(self, given: Any, setting: Setting) -> Wall | str:
        if isinstance(given, Wall) or given == "stiff":
            return given
        if not isinstance(given, dict):
            raise ValueError(f'{show(given)} is no wall; wanted "stiff" or {{ youngs_modulus, thickness }}')
        return Wall.model_validate(given, context=setting)

    def below(self, key: str) -> Value | None:
        return Wall.values()[key]

    def json(self) -> dict[str, Any]:
        made = Wall.model_json_schema()
        del made["required"]  # a material or a size may say it
        return {"anyOf": [{"const": "stiff"}, made]}


class Restraint(Value):
    """How a pipe is held along its axis: a word, or the factor itself."""

    about = "how it is held along its axis; 1, a thin wall between expansion joints, if left out"
    takes = "`joints`, `upstream`, `anchored`, or a number, above 0"
    changes = COUNTED

    def read(self, given: Any, setting: Setting) -> str | float:
        if isinstance(given, str):
            if given in RESTRAINTS:
                return given
            raise ValueError(f"no restraint named {show(given)}; wanted one of {', '.join(RESTRAINTS)}, or a number")
        value = parse(given, "number")
        positive.check(value, given)
        return value

    def json(self) -> dict[str, Any]:
        return {"anyOf": [{"enum": list(RESTRAINTS)}, {"type": "number", "exclusiveMinimum": 0}]}


def restraint_factor(restraint: str | float | None, bore: float, wall: Wall) -> float:
    """c of the growth of area c D / (E e) dp / p: 1 where nothing is said.

    Thin walls, D/e from 25 on: 1 between expansion joints, 1 - nu/2 held upstream alone, 1 - nu^2 anchored throughout.
    Thick ones, of Lame's stresses: that times D / (D + e), and 2 (e/D) (1 + nu) more; as in Wylie and Streeter 1993.
    """
    if restraint is None:
        return 1.0
    if not isinstance(restraint, str):
        return restraint
    nu = wall.poisson_ratio or 0.0
    held = {"joints": 1.0, "upstream": 1.0 - 0.5 * nu, "anchored": 1.0 - nu * nu}[restraint]
    ratio = wall.thickness / bore
    if ratio * THIN <= 1.0:
        return held
    return held / (1.0 + ratio) + 2.0 * ratio * (1.0 + nu)


def wants_poisson(restraint: str | float | None, bore: float, wall: Wall) -> bool:
    """Whether the factor depends on Poisson's ratio."""
    return restraint in ("upstream", "anchored") or (restraint == "joints" and wall.thickness * THIN > bore)


def yielding(pipe: Any) -> tuple[tuple[float, float], ...]:
    """(growth of its bore with pressure in the end, dA / (A dp) [1/Pa], time tau [s]) of each element of its wall."""
    wall = pipe.wall
    if not isinstance(wall, Wall) or wall.creep is None:
        return ()
    factor = restraint_factor(pipe.restraint, pipe.diameter, wall) * pipe.diameter / wall.thickness
    return tuple((factor * one, time) for one, time in zip(wall.creep.compliance, wall.creep.time, strict=True))


def softness(pipe: Any) -> float:
    """Growth of a pipe's bore with pressure at once, dA / (A dp) [1/Pa]; 0 of a stiff wall."""
    wall = pipe.wall
    if not isinstance(wall, Wall):
        return 0.0
    stiffness = wall.youngs_modulus * wall.thickness
    if pipe.lining is not None:
        stiffness += pipe.lining.youngs_modulus * pipe.lining.thickness
    if pipe.restraint is None:
        return pipe.diameter / stiffness
    return restraint_factor(pipe.restraint, pipe.diameter, wall) * pipe.diameter / stiffness


def wall_faults(pipe: Any) -> Iterator[tuple[tuple[Any, ...], str]]:
    """What is wrong of a pipe's wall beside its restraint and lining: (keys, text)."""
    wall = pipe.wall
    if not isinstance(wall, Wall):
        return
    if wall.poisson_ratio is None and wants_poisson(pipe.restraint, pipe.diameter, wall):
        why = f"no source of that of {pipe.material} was read" if pipe.material else "it has none"
        text = f"{show(pipe.restraint)} wants Poisson's ratio of the wall, and {why}; give it in wall as poisson_ratio"
        yield ("restraint",), text
    if wall.creep is not None and pipe.lining is not None:
        yield ("wall", "creep"), "is not known of a lined wall; keep one of creep and lining"
