"""The tables fluid, numerics and output of a case. Knows their keys and defaults; knows no part."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve import units
from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.exact import NAMES
from fvsolve.fluid import LAWS
from fvsolve.fluid.coolprop import OILY
from fvsolve.parts.pipe.part import LINES
from fvsolve.parts.series import copy_name, find_file
from fvsolve.parts.table import Named, Table
from fvsolve.parts.value import (
    COUNTED,
    PROFILE,
    SHAPE,
    VALUE,
    Choice,
    Flag,
    Misfit,
    Number,
    Quantity,
    Rows,
    Setting,
    Text,
    Usual,
    Value,
    Whole,
    between,
    nonnegative,
    positive,
)
from fvsolve.schemes import LIMITERS, SCHEMES
from fvsolve.steppers.methods import AUTO, METHODS
from fvsolve.steppers.structure import KINDS
from fvsolve.steppers.tableau import OWN, method_of_file
from fvsolve.units import show

STARTS = ("steady", "equilibrium", "rest")
CAVITY_SCHEMES = tuple(name for name, one in SCHEMES.items() if one.cavities)

# Every default of [numerics] and [output], chosen by docs/accuracy-and-speed.md. Steps: Courant where there are cells,
# error control elsewhere.
DEFAULT_SCHEME, DEFAULT_LIMITER = "weno5", "van-leer"
DEFAULT_METHOD, DEFAULT_COURANT = "rk4", 0.9
DEFAULT_METHOD_SSP = "ssp-rk3"  # where basins carry scalars, whose bounds rk4 does not keep, or have friction
CAVITY_SCHEME, CAVITY_METHOD, CAVITY_COURANT = "muscl", "ssp-rk2", 0.5  # where cavities are followed in pipes
CAVITY_AIR = 1e-7  # of a degassed liquid, what they grow from
DEFAULT_METHOD_RTOL, DEFAULT_RTOL = AUTO, 1e-6
DEFAULT_CELLS = 100  # in the pipe that takes a wave longest; the others get cells of the same travel time
DEFAULT_ROWS, DEFAULT_FRAMES = 1000, 50
DEFAULT_ACCURACY = 1e-2  # of the greatest jump


# What liquids have, after CoolProp's and the CRC Handbook's: liquid hydrogen to mercury, light ones to cold heavy oil.
TEMPERATURES = Usual(60.0, 1000.0, "liquefied gases to molten salt")  # of "user": others know their own
DENSITIES = Usual(60.0, 14e3, "liquid hydrogen to mercury")
MODULI = Usual(1e7, 4e10, "liquefied gases to mercury")
VISCOSITIES = Usual(1e-5, 5.0, "liquefied gases to heavy fuel oil")


class FluidSpec(Table):
    """`[fluid]`: which fluid, at which state, under which density law; numbers here override CoolProp's."""

    name: Annotated[str, Text('a CoolProp fluid, "ISO VG 46", "INCOMP::..." or "user"', COUNTED)]
    temperature: Annotated[
        float, Quantity("temperature", positive, "where properties are taken [K]", changes=COUNTED)
    ] = 293.15
    pressure: Annotated[float, Quantity("pressure", positive, "where properties are taken [Pa]", changes=COUNTED)] = (
        101325.0
    )
    law: Annotated[
        str, Choice("density law", tuple(LAWS), "one for the case; linear (with cavitation mixture) if left out")
    ] = "linear"
    density: Annotated[float | None, Quantity("density", positive, "[kg/m3]", DENSITIES, COUNTED)] = None
    bulk_modulus: Annotated[float | None, Quantity("modulus", positive, "isentropic [Pa]", MODULI, COUNTED)] = None
    viscosity: Annotated[float | None, Quantity("viscosity", nonnegative, "[Pa s]", VISCOSITIES)] = None
    vapor_pressure: Annotated[float | None, Quantity("pressure", nonnegative, "[Pa]")] = None
    air_fraction: Annotated[
        float | None,
        Number(between(0, 1), f"of the volume at 1 atm, law mixture; {CAVITY_AIR:g} with cavitation if left out"),
    ] = None
    gas_exponent: Annotated[float | None, Number(between(1, 2), "polytropic, 1 isothermal, 1.4 adiabatic")] = None
    saturation_pressure: Annotated[float | None, Quantity("pressure", positive, "where all gas is dissolved [Pa]")] = (
        None
    )
    cavitation: Annotated[bool | None, Flag("vapour pressure adds to that of the gas, law mixture")] = None

    @classmethod
    def in_numbers(cls, given: dict[str, Any], setting: Setting) -> dict[str, Any]:
        cavities = {"law": "mixture", "air_fraction": CAVITY_AIR}
        follows = given.get("cavitation") is True and given.get("law", "mixture") == "mixture"
        return cavities | given if follows else given

    @classmethod
    def wanted(cls, given: Any) -> str:
        if not isinstance(given, str):
            return super().wanted(given)
        return (
            f"[fluid] with name = {show('ISO VG 46' if given.casefold() in OILY else given)}, its temperature and more"
        )

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        found, usual = self.temperature, TEMPERATURES
        if self.name == "user" and not usual.least <= found <= usual.greatest:
            text = f"{found:g} K is outside {usual.least:g} to {usual.greatest:g} K, {usual.practice}"
            text += units.likely(found, "temperature", usual.least, usual.greatest)
            yield ("temperature",), found, usual.least if found < usual.least else usual.greatest, text


class MethodNames(Collection):
    """`auto` and the names of all methods, those of the user included as soon as they are there."""

    def __iter__(self) -> Iterator[str]:
        return iter((AUTO, *METHODS))

    def __contains__(self, name: object) -> bool:
        return name == AUTO or name in METHODS

    def __len__(self) -> int:
        return 1 + len(METHODS)


class MethodChoice(Choice):
    """A method by name, or by a file that holds its tableau as text."""

    def read(self, given: Any, setting: Setting) -> str:
        if not isinstance(given, str) or given in OWN or given == AUTO:
            return super().read(given, setting)
        if not Path(given).suffix or (given in METHODS and METHODS[given].name == given):
            return super().read(given, setting)
        path = find_file(given, setting)
        name = copy_name(path, setting)
        try:
            METHODS[name] = method_of_file(path)
        except FvsolveError as error:
            raise ValueError(str(error)) from None
        return name

    @property
    def takes(self) -> str:
        return f'{super().takes}, or a file that holds a tableau as text, `"ssp43.txt"`'

    def json(self) -> dict[str, Any]:
        return {"anyOf": [super().json(), {"type": "string", "pattern": "[.]"}]}


class Numerics(Table):
    """`[numerics]`: the span of time, how space and time are cut, where to start from."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("courant", "step", "rtol"),)

    end: Annotated[float, Quantity("time", about="when the run ends [s]")]
    start: Annotated[float, Quantity("time", about="when it begins [s]")] = 0.0
    initial: Annotated[
        str,
        Choice(
            "start",
            STARTS,
            "stated levels, pressures and flows are held and the rest in equilibrium; nothing may move, and bodies and "
            "masses stand where their forces balance; or no flow",
            changes=PROFILE,
        ),
    ] = "steady"
    scheme: Annotated[
        str | None,
        Choice(
            "scheme",
            tuple(SCHEMES),
            f"reconstruction in the cells; {DEFAULT_SCHEME} (with cavitation {CAVITY_SCHEME}) if left out",
        ),
    ] = None
    limiter: Annotated[str, Choice("limiter", tuple(LIMITERS), "of the scheme muscl")] = DEFAULT_LIMITER
    method: Annotated[
        str | None,
        MethodChoice(
            "method",
            MethodNames(),
            f"Runge-Kutta method; {DEFAULT_METHOD} (with rtol {DEFAULT_METHOD_RTOL}, with cavitation {CAVITY_METHOD}, "
            f"with scalars or friction in basins {DEFAULT_METHOD_SSP}) if left out",
            changes=PROFILE,
        ),
    ] = None
    courant: Annotated[
        float | None,
        Number(
            positive,
            f"step over the travel time of the quickest cell; {DEFAULT_COURANT} where there are cells (with cavitation "
            f"{CAVITY_COURANT}) if left out",
            changes=VALUE,
        ),
    ] = None
    step: Annotated[float | None, Quantity("time", positive, "fixed step [s]", changes=VALUE)] = None
    rtol: Annotated[
        float | None,
        Number(
            between(0, 1, open=True),
            f"error per step; {DEFAULT_RTOL:g} without cells, under auto and of implicit methods that can if left out",
        ),
    ] = None
    linear_algebra: Annotated[
        str | None,
        Choice("linear algebra", KINDS, "of implicit steps; by the structure of the scene if left out", changes=VALUE),
    ] = None
    cell_time: Annotated[
        float | None,
        Quantity(
            "time",
            positive,
            f"of pipes that state no cells [s]; longest travel time of a pipe / {DEFAULT_CELLS} if left out",
            changes=SHAPE,
        ),
    ] = None
    line: Annotated[
        str,
        Choice("line", LINES, "how pipes that state no line are followed", changes=SHAPE),
    ] = "cells"
    accuracy: Annotated[
        float,
        Number(
            between(0, 1, open=True),
            "what lines chosen by auto may be off by, of the greatest jump; and the share of it below which a jump in "
            "a delay line is smoothed",
            changes=SHAPE,
        ),
    ] = DEFAULT_ACCURACY
    below_vapor: Annotated[str, Choice("choice", ("continue", "stop"), "mark it and go on, or stop")] = "continue"

    def filled(self, has_cells: bool, carries: bool, rubs: bool, parts: bool) -> Numerics:
        """The same with the scheme, step control and method that are the default.

        carries : whether basins carry scalars; rubs : whether their beds brake the flow; parts : whether
        cavities are followed in pipes.
        """
        changes: dict[str, Any] = {}
        if self.scheme is None:
            changes["scheme"] = CAVITY_SCHEME if parts else DEFAULT_SCHEME
        if self.courant is self.step is self.rtol is None:
            by_courant = has_cells and not steps_by_error(self.method)
            courant = CAVITY_COURANT if parts else DEFAULT_COURANT
            changes |= {"courant": courant} if by_courant else {"rtol": DEFAULT_RTOL}
        adaptive = self.rtol is not None or "rtol" in changes
        if self.method is None:
            by_step = CAVITY_METHOD if parts else DEFAULT_METHOD_SSP if carries or rubs else DEFAULT_METHOD
            changes["method"] = DEFAULT_METHOD_RTOL if adaptive else by_step
        return self.model_copy(update=changes)


def steps_by_error(method: str | None) -> bool:
    """Whether a method is meant for error control even where there are cells: `auto`, and implicit ones that can."""
    found = METHODS.get(method or "")
    return method == AUTO or (found is not None and found.adaptive and not found.explicit)


class OutputUnits(Value):
    """`[output] units`: a unit per quantity of a probe, and of what is said of parts."""

    about = 'unit per quantity, for example { pressure = "barg", flow = "l/s" }; SI, absolute if left out'
    takes = "`{ QUANTITY = UNIT }`"
    changes = VALUE
    quantities = (
        "pressure",
        "gauge_pressure",
        "head",
        "level",
        "flow",
        "velocity",
        "position",
        "force",
        "torque",
        "angle",
        "angular_velocity",
        "acceleration",
        "energy",
        "power",
        "time",
        "length",
        "area",
        "volume",
        "density",
    )

    def read(self, given: Any, setting: Setting) -> dict[str, str]:
        if not isinstance(given, dict):
            raise ValueError(f'{show(given)} is no table; wanted one such as {{ pressure = "barg" }}')
        faults = []
        for quantity, unit in given.items():
            if quantity not in self.quantities:
                near = did_you_mean(str(quantity), self.quantities)
                faults.append(((quantity,), f"unknown quantity{near}; quantities are {', '.join(self.quantities)}"))
                continue
            try:
                if not isinstance(unit, str):
                    raise ValueError(f"{show(unit)} is no unit; wanted text")
                units.find(unit, quantity)
            except ValueError as error:
                faults.append(((quantity,), str(error)))
        if faults:
            raise Misfit(faults)
        filled = dict(given)
        if "pressure" in given and not units.find(given["pressure"], "pressure").absolute:
            filled.setdefault("gauge_pressure", given["pressure"])
        return filled

    def json(self) -> dict[str, Any]:
        return {
            "type": "object",
            "properties": {quantity: {"type": "string"} for quantity in self.quantities},
            "additionalProperties": False,
        }


class Names(Value):
    """A list of texts, read as probes later, when the parts are known."""

    about = "what is recorded; those of all nodes and links if left out"
    takes = "list of probes"

    def read(self, given: Any, setting: Setting) -> tuple[Any, ...]:
        if not isinstance(given, (list, tuple)):
            raise ValueError(f'{show(given)} is no list; wanted one such as ["gate.pressure"]')
        return tuple(given)

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": {"type": "string"}}


class Line(Table):
    """A line across a basin along which its fields are written at every frame."""

    basin: Annotated[str, Text("its name", VALUE)]
    from_: Annotated[
        tuple[float, float],
        Rows("length", length=2, about="x, y of its start [m]", changes=VALUE),
        Field(alias="from"),
    ]
    to: Annotated[tuple[float, float], Rows("length", length=2, about="x, y of its end [m]", changes=VALUE)]
    points: Annotated[int, Whole(between(2, 10**5), "evenly along it, both ends among them", VALUE)] = 101


class Output(Table):
    """`[output]`: when and what is recorded, and in which units it is shown."""

    every: Annotated[
        float | None,
        Quantity(
            "time",
            positive,
            f"between rows of the history [s]; (end - start) / {DEFAULT_ROWS} if left out",
            changes=VALUE,
        ),
    ] = None
    fields: Annotated[int, Whole(between(0, 10**6), "number of frames of the fields, 0 for none", VALUE)] = (
        DEFAULT_FRAMES
    )
    probes: Annotated[Any, Names()] = None
    lines: Annotated[Any, Named(Line, "lines by name: { centre = { basin, from, to, points } }")] = {}
    units: Annotated[dict[str, str], OutputUnits()] = {}

    def table(self) -> dict[str, Any]:
        """What the file would say."""
        made = {**super().table(), "probes": [probe.text for probe in self.probes]}
        return {key: value for key, value in made.items() if value != {}}


class ExactSpec(Table):
    """`[exact]`: the exact solution that this scene has; errors of a study are measured against it."""

    name: Annotated[str, Choice("exact solution", tuple(NAMES), "what the scene is exactly", changes=VALUE)]
