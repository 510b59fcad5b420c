"""Tables `[fluid]`, `[numerics]`, `[output]` and `[exact]` of a case: keys and defaults."""

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve import units
from fvsolve.core.fluid import LAWS
from fvsolve.core.fluid.oils import ASTM_D341, OIL_WORDS
from fvsolve.core.schemes import LIMITERS, SCHEMES
from fvsolve.core.steppers.structure import KINDS
from fvsolve.core.steppers.tableau import AUTO, BUILT_IN, METHODS, method_of_file
from fvsolve.declarations import Declarations
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.exact import NAMES
from fvsolve.parts import value as val
from fvsolve.parts.date_keys import StartTimeValue
from fvsolve.parts.pipe.part import LINES
from fvsolve.parts.table_model import NamedTables, RunTimes, Table, check_table, read_keys
from fvsolve.parts.value import (
    BY_CELLS,
    SHAPE,
    VALUE,
    Choice,
    Number,
    PointList,
    Quantity,
    ReadContext,
    positive,
)
from fvsolve.units import show

STARTS = ("steady", "equilibrium", "rest")
CAVITY_SCHEMES = tuple(name for name, entry in SCHEMES.items() if entry.cavities)

# Defaults of [numerics] and [output], chosen in docs/accuracy.md. Steps: Courant number with cells, error
# control without cells.
DEFAULT_SCHEME, DEFAULT_LIMITER = "weno5", "van-leer"
DEFAULT_METHOD, DEFAULT_COURANT = "rk4", 0.9
# for basins with scalars (rk4 violates their bounds) or with friction
DEFAULT_METHOD_SSP = "ssp-rk3"
CAVITY_SCHEME, CAVITY_METHOD, CAVITY_COURANT = "muscl", "ssp-rk2", 0.5  # with cavities in pipes
CAVITY_AIR = 1e-7  # air fraction of a degassed liquid: nuclei of cavities
DEFAULT_METHOD_RTOL, DEFAULT_RTOL = AUTO, 1e-6
# in the pipe with the longest travel time; other pipes get cells of the same travel time
DEFAULT_CELLS = 100
DEFAULT_ROWS, DEFAULT_FRAMES = 1000, 50
DEFAULT_ACCURACY = 1e-2  # fraction of the largest jump

SINKS = Declarations("sink", "sinks", ("core/output/*_sink.py",))  # names in the case file


# Ranges of liquids, after CoolProp and the CRC Handbook: liquid hydrogen to mercury, light liquids to cold heavy oil.
# For fluid "user"; other fluids have their own range
TEMPERATURES = val.UsualRange(60.0, 1000.0, "liquefied gases to molten salt")
DENSITIES = val.UsualRange(60.0, 14e3, "liquid hydrogen to mercury")
MODULI = val.UsualRange(1e7, 4e10, "liquefied gases to mercury")
OILS = val.UsualRange(200.0, 600.0, "cold to hot oil")  # temperatures [K]
VISCOSITIES = val.UsualRange(1e-5, 5.0, "liquefied gases to heavy fuel oil")


@dataclass(frozen=True)
class Walther(val.Value):
    """Value of a case file for a viscosity, or for one that follows the temperature, { law, points }."""

    number: Quantity
    about: str = ""
    changes: str = BY_CELLS

    def read(self, given: Any, setting: ReadContext) -> Any:
        if not isinstance(given, dict):
            return self.number.read(given, setting)
        keys = {
            "law": (Choice("viscosity law", (ASTM_D341,)), val.NEEDED),
            "points": (WaltherPoints(), ()),
        }
        return ViscosityLaw(**read_keys(given, keys, setting))

    @property
    def takes(self) -> str:
        return f'{self.number.takes}, or `{{ law = "{ASTM_D341}", points = [[TEMPERATURE, VISCOSITY], ...] }}`'

    def json(self) -> dict[str, Any]:
        points = {
            "type": "array",
            "items": {"type": "array", "items": {"type": ["number", "string"]}},
        }
        table = {
            "type": "object",
            "properties": {"law": {"const": ASTM_D341}, "points": points},
            "required": ["law"],
            "additionalProperties": False,
        }
        return {"anyOf": [self.number.json(), table]}


class WaltherPoints(val.Value):
    """Value of a case file: two points of temperature [K] and viscosity, kinematic or dynamic."""

    def read(self, given: Any, setting: ReadContext) -> tuple[tuple[float, float], ...]:
        example = 'expected [[TEMPERATURE, VISCOSITY], ...], such as [["40 degC", "46 cSt"], ["100 degC", "6.8 cSt"]]'
        pairs = isinstance(given, (list, tuple)) and all(
            isinstance(item, (list, tuple)) for item in given
        )
        if not pairs or [len(item) for item in given] != [2, 2]:
            raise ValueError(f"{show(given)} are not two points; {example}")
        temperature, viscosity = Quantity("temperature", positive), Quantity("viscosity", positive)
        points = tuple((temperature.read(a, setting), viscosity.read(b, setting)) for a, b in given)
        if points[0][0] == points[1][0]:
            raise ValueError(f"{show(given)} have the same temperature; {example}")
        return points


@dataclass(frozen=True)
class ViscosityLaw:
    """Viscosity by temperature: its law, and two points (temperature [K], viscosity); none for the points of an oil."""

    law: str
    points: tuple[tuple[float, float], ...] = ()

    def table(self) -> dict[str, Any]:
        """Table of a case file."""
        points = [
            [a, f"{float(b)!r} m2/s" if isinstance(b, units.Kinematic) else b]
            for a, b in self.points
        ]
        return {"law": self.law} | ({"points": points} if points else {})


class FluidSpec(Table):
    """Table `[fluid]`: fluid, its state and its density law. Stated properties replace the properties from CoolProp."""

    name: Annotated[
        str, val.Text('a CoolProp fluid, "ISO VG 46", "INCOMP::..." or "user"', BY_CELLS)
    ]
    temperature: Annotated[
        float,
        Quantity(
            "temperature",
            positive,
            "temperature at which properties are evaluated [K]",
            changes=BY_CELLS,
        ),
    ] = 293.15
    pressure: Annotated[
        float,
        Quantity(
            "pressure",
            positive,
            "pressure at which properties are evaluated [Pa]",
            changes=BY_CELLS,
        ),
    ] = 101325.0
    law: Annotated[
        str,
        Choice(
            "density law",
            LAWS,
            "density law of the whole case; linear (mixture with cavitation) if left out",
        ),
    ] = "linear"
    density: Annotated[
        float | None, Quantity("density", positive, "density [kg/m3]", DENSITIES, BY_CELLS)
    ] = None
    bulk_modulus: Annotated[
        float | None,
        Quantity("modulus", positive, "isentropic bulk modulus [Pa]", MODULI, BY_CELLS),
    ] = None
    viscosity: Annotated[
        float | ViscosityLaw | None,
        Walther(
            Quantity("viscosity", val.nonnegative, "", VISCOSITIES),
            "dynamic viscosity [Pa s], or its law over the temperature, which friction of pipes follows",
        ),
    ] = None
    vapor_pressure: Annotated[
        float | None, Quantity("pressure", val.nonnegative, "vapour pressure [Pa]")
    ] = None
    air_fraction: Annotated[
        float | None,
        Number(
            val.between(0, 1),
            f"volume fraction of air at 1 atm, law mixture; {CAVITY_AIR:g} with cavitation if left out",
        ),
    ] = None
    gas_exponent: Annotated[
        float | None,
        Number(
            val.between(1, 2),
            "polytropic exponent of the gas, law mixture: 1 isothermal, 1.4 adiabatic",
        ),
    ] = None
    saturation_pressure: Annotated[
        float | None,
        Quantity(
            "pressure", positive, "pressure above which all gas is dissolved, law mixture [Pa]"
        ),
    ] = None
    cavitation: Annotated[
        bool | None,
        val.Flag(
            "cavities of gas and vapour: vapour pressure is added to the gas pressure, law mixture"
        ),
    ] = None

    @classmethod
    def resolve_keys(cls, given: dict[str, Any], setting: ReadContext) -> dict[str, Any]:
        cavities = {"law": "mixture", "air_fraction": CAVITY_AIR}
        follows = given.get("cavitation") is True and given.get("law", "mixture") == "mixture"
        return cavities | given if follows else given

    @classmethod
    def expected(cls, given: Any) -> str:
        if not isinstance(given, str):
            return super().expected(given)
        name = "ISO VG 46" if given.casefold() in OIL_WORDS else given
        return f"[fluid] with name = {show(name)}, its temperature and more"

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        given = [(("temperature",), self.temperature, TEMPERATURES)] * (self.name == "user")
        given += [
            (("viscosity", "points"), a, OILS) for a, _ in getattr(self.viscosity, "points", ())
        ]
        for keys, value, usual in given:
            if not usual.least <= value <= usual.greatest:
                text = f"{value:g} K is outside {usual.least:g} to {usual.greatest:g} K, {usual.source}"
                text += units.likely(value, "temperature", usual.least, usual.greatest)
                yield keys, value, usual.least if value < usual.least else usual.greatest, text


class MethodNames(Collection):
    """Collection of valid method names: `auto` and all methods, also methods that are added while the program runs."""

    def __iter__(self) -> Iterator[str]:
        return iter((AUTO, *METHODS))

    def __contains__(self, name: object) -> bool:
        return name == AUTO or name in METHODS

    def __len__(self) -> int:
        return 1 + len(METHODS)


class MethodChoice(Choice):
    """Value of a case file for a Runge-Kutta method: its name, or the path of a file with its tableau as text."""

    def read(self, given: Any, setting: ReadContext) -> str:
        if not isinstance(given, str) or given in BUILT_IN or given == AUTO:
            return super().read(given, setting)
        if not Path(given).suffix or (given in METHODS and METHODS[given].name == given):
            return super().read(given, setting)
        from fvsolve.parts.csv_rows import copy_name, find_file

        path = find_file(given, setting)
        name = copy_name(path, setting)
        try:
            METHODS[name] = method_of_file(path)
        except FvsolveError as error:
            raise ValueError(str(error)) from None
        return name

    @property
    def takes(self) -> str:
        return f'{super().takes}, or a file that contains a tableau as text, `"ssp43.txt"`'

    def json(self) -> dict[str, Any]:
        return {"anyOf": [super().json(), {"type": "string", "pattern": "[.]"}]}


class Numerics(Table):
    """Table `[numerics]`: time span, discretisation in space and time, initial state."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("courant", "step", "rtol"),)

    end: Annotated[float, Quantity("time", about="end time of the run [s]")]
    start: Annotated[float, Quantity("time", about="start time of the run [s]")] = 0.0
    start_time: Annotated[Any, StartTimeValue()] = None
    initial: Annotated[
        str,
        Choice(
            "start",
            STARTS,
            "steady: stated levels, pressures and flows are kept, the rest is in equilibrium; equilibrium: nothing "
            "moves and bodies and masses are placed where their forces balance; rest: no flow",
            changes=val.PROFILE,
        ),
    ] = "steady"
    scheme: Annotated[
        str | None,
        Choice(
            "scheme",
            tuple(SCHEMES),
            f"reconstruction scheme of the cells; {DEFAULT_SCHEME} (with cavitation {CAVITY_SCHEME}) if left out",
        ),
    ] = None
    limiter: Annotated[str, Choice("limiter", LIMITERS, "slope limiter of the scheme muscl")] = (
        DEFAULT_LIMITER
    )
    method: Annotated[
        str | None,
        MethodChoice(
            "method",
            MethodNames(),
            f"Runge-Kutta method; {DEFAULT_METHOD} (with rtol {DEFAULT_METHOD_RTOL}, with cavitation {CAVITY_METHOD}, "
            f"with scalars or friction in basins {DEFAULT_METHOD_SSP}) if left out",
            changes=val.PROFILE,
        ),
    ] = None
    courant: Annotated[
        float | None,
        Number(
            positive,
            f"Courant number: step over the shortest wave travel time of a cell; {DEFAULT_COURANT} with cells "
            f"(with cavitation {CAVITY_COURANT}) if left out",
            changes=VALUE,
        ),
    ] = None
    step: Annotated[float | None, Quantity("time", positive, "fixed step [s]", changes=VALUE)] = (
        None
    )
    rtol: Annotated[
        float | None,
        Number(
            val.between(0, 1, open=True),
            f"relative tolerance of the error per step; {DEFAULT_RTOL:g} (without cells, with auto, or with adaptive "
            "implicit methods) if left out",
            usual=val.UsualRange(0.0, 1e-2, "for errors of a few percent at most"),
        ),
    ] = None
    linear_algebra: Annotated[
        str | None,
        Choice(
            "linear algebra",
            KINDS,
            "linear solver of implicit steps; chosen by the structure of the case if left out",
            changes=VALUE,
        ),
    ] = None
    cell_time: Annotated[
        float | None,
        Quantity(
            "time",
            positive,
            f"wave travel time of a cell, for pipes that state no cells [s]; longest travel time of a pipe / "
            f"{DEFAULT_CELLS} if left out",
            changes=SHAPE,
        ),
    ] = None
    pipe_model: Annotated[
        str, Choice("pipe model", LINES, "model of pipes that state no pipe_model", changes=SHAPE)
    ] = "finite-volume"
    delay_tolerance: Annotated[
        float,
        Number(
            val.between(0, 1, open=True),
            "allowed error of pipe models chosen by auto, and size below which jumps in a delay line are smoothed; "
            "both as a fraction of the largest jump",
            changes=SHAPE,
        ),
    ] = DEFAULT_ACCURACY
    delay_velocity: Annotated[
        float,
        Quantity(
            "velocity",
            val.nonnegative,
            "velocity up to which the friction of delay lines is within delay_tolerance; at "
            "least that at the start",
            changes=SHAPE,
        ),
    ] = 0.0
    below_vapor: Annotated[
        str,
        Choice(
            "choice",
            ("continue", "stop"),
            "action at pressures below vapour pressure: mark the results and continue, or stop",
        ),
    ] = "continue"

    def filled(self, has_cells: bool, carries: bool, rubs: bool, parts: bool) -> "Numerics":
        """Copy with the default scheme, step control and method filled in.

        has_cells : True if the case has pipes or basins; carries : True if basins carry scalars
        rubs : True if friction acts on the flow in basins; parts : True if cavities in pipes are computed
        """
        changes: dict[str, Any] = {}
        if self.scheme is None:
            changes["scheme"] = CAVITY_SCHEME if parts else DEFAULT_SCHEME
        if self.courant is self.step is self.rtol is None:
            by_courant = has_cells and not uses_error_control(self.method)
            courant = CAVITY_COURANT if parts else DEFAULT_COURANT
            changes |= {"courant": courant} if by_courant else {"rtol": DEFAULT_RTOL}
        adaptive = self.rtol is not None or "rtol" in changes
        if self.method is None:
            by_step = (
                CAVITY_METHOD
                if parts
                else DEFAULT_METHOD_SSP
                if carries or rubs
                else DEFAULT_METHOD
            )
            changes["method"] = DEFAULT_METHOD_RTOL if adaptive else by_step
        return self.model_copy(update=changes)

    @property
    def times(self) -> RunTimes:
        """Times of the run."""
        return RunTimes(self.start, self.end, math.nan if self.step is None else self.step)


def uses_error_control(method: str | None) -> bool:
    """True if a method controls the error of its steps by default, even in a case with cells.

    These are `auto` and the adaptive implicit methods.
    """
    known = METHODS.get(method or "")
    return method == AUTO or (known is not None and known.adaptive and not known.explicit)


class OutputUnits(val.Value):
    """Value of `units` in `[output]`: unit of each quantity of probes and parts."""

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
        "voltage",
        "current",
        "temperature",
        "molar_flow",
        "affinity",
    )

    def read(self, given: Any, setting: ReadContext) -> dict[str, str]:
        check_table(given, 'for example { pressure = "barg" }')
        faults = []
        for quantity, unit in given.items():
            if quantity not in self.quantities:
                near = did_you_mean(str(quantity), self.quantities)
                faults.append(
                    (
                        (quantity,),
                        f"unknown quantity{near}; quantities are {', '.join(self.quantities)}",
                    )
                )
                continue
            try:
                if not isinstance(unit, str):
                    raise ValueError(f"{show(unit)} is not a unit; expected text")
                units.find(unit, quantity)
            except ValueError as error:
                faults.append(((quantity,), str(error)))
        if faults:
            raise val.ValueFault(faults)
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


@dataclass(frozen=True)
class NameList(val.Value):
    """Value of a key of `[output]`: a list of names, which are looked up later, when all parts are read.

    noun : noun of the names in plural; example : list for messages
    """

    noun: str
    example: str
    about: str = ""
    changes: str = SHAPE
    schema = {"type": "array", "items": {"type": "string"}}

    def read(self, given: Any, setting: ReadContext) -> tuple[Any, ...]:
        if not isinstance(given, (list, tuple)):
            raise ValueError(f"{show(given)} is not a list; expected for example {self.example}")
        return tuple(given)

    @property
    def takes(self) -> str:
        return f"list of {self.noun}"


@dataclass(frozen=True)
class SinkNames(NameList):
    """Value of `sinks` in `[output]`: names of sinks of other packages; only these are read."""

    def read(self, given: Any, setting: ReadContext) -> tuple[str, ...]:
        names = super().read(given, setting)
        for name in names:
            if not isinstance(name, str) or name not in SINKS:
                near = did_you_mean(name, SINKS) if isinstance(name, str) else ""
                installed = listing(SINKS) if SINKS else "a package with entry points fvsolve.sinks"
                raise ValueError(f"no sink named {show(name)}{near or f'; expected {installed}'}")
        return tuple(dict.fromkeys(names))


class OutputLine(Table):
    """Table of one line across a basin, along which its fields are written with every frame."""

    basin: Annotated[str, val.Text("name of the basin", VALUE)]
    from_: Annotated[
        tuple[float, float],
        val.Rows(
            "length",
            length=2,
            about="x, y of the start of the line [m]",
            changes=VALUE,
        ),
        Field(alias="from"),
    ]
    to: Annotated[
        tuple[float, float],
        val.Rows("length", length=2, about="x, y of the end of the line [m]", changes=VALUE),
    ]
    points: Annotated[
        int,
        val.Whole(val.between(2, 10**5), "number of evenly spaced points, with both ends", VALUE),
    ] = 101


class RunUp(Table):
    """Table of the run-up in a basin, by direction about a point, or by distance along a line."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("about", "from"),
        ("about", "to"),
        ("about", "width"),
        ("radius", "from"),
        ("radius", "to"),
    )
    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("about", "from", "to"),)

    basin: Annotated[str, val.Text("name of the basin")]
    about: Annotated[
        tuple[float, float] | None,
        val.Rows(
            "length",
            length=2,
            about="x, y of the point [m]; the table is by angle, anticlockwise from the x axis",
            changes=VALUE,
        ),
    ] = None
    radius: Annotated[
        float | None,
        Quantity(
            "length",
            positive,
            "greatest distance of cells from the point [m]; no limit if left out",
            changes=VALUE,
        ),
    ] = None
    from_: Annotated[
        tuple[float, float] | None,
        val.Rows(
            "length",
            length=2,
            about="x, y of the start of the line [m]; the table is by distance from it",
            changes=VALUE,
        ),
        Field(alias="from"),
    ] = None
    to: Annotated[
        tuple[float, float] | None,
        val.Rows("length", length=2, about="x, y of the end of the line [m]", changes=VALUE),
    ] = None
    width: Annotated[
        float | None,
        Quantity(
            "length",
            positive,
            "greatest distance of cells from the line [m]; no limit if left out",
            changes=VALUE,
        ),
    ] = None
    sectors: Annotated[
        int,
        val.Whole(
            val.between(1, 10**5),
            "number of equal sectors of the circle, or parts of the line",
            VALUE,
        ),
    ] = 48

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        faults, ends = super().key_faults(given), {"from", "to"} - given.keys()
        missing = len(ends) == 1 and "about" not in given
        return [
            *faults,
            *(((), f"{key} is missing; a line has `from` and `to`") for key in ends if missing),
        ]

    @property
    def length(self) -> float:
        """Length of the line [m]; 0 for a point."""
        return 0.0 if self.about is not None else math.dist(self.from_, self.to)


class Gauge(Table):
    """Table of a named point of a basin, at which probes may record fields: `BASIN.depth@GAUGE`."""

    basin: Annotated[str, val.Text("name of the basin", VALUE)]
    at: Annotated[
        tuple[float, float],
        val.Rows("length", length=2, about="x, y of the point [m]", changes=SHAPE),
    ]


class Gauges(NamedTables):
    """Value of a case file for gauges: tables by name, or a table file with a row for each gauge."""

    columns = ("name", "basin", "x", "y")
    schema = {"type": "object", "additionalProperties": {"type": ["object", "string"]}}

    def read(self, given: Any, setting: ReadContext) -> dict[str, Any]:
        if isinstance(given, dict) and isinstance(given.get("file"), str):
            if other := next((key for key in given if key not in ("file", "sheet")), ""):
                raise ValueError(
                    f"file and {other} are given; expected all gauges in the file, or all in this table"
                )
            given = self.rows(given, setting)
        return super().read(given, setting)

    def rows(self, given: dict[str, Any], setting: ReadContext) -> dict[str, Any]:
        """Tables of the gauges of a table { file, sheet } by name. Raises ValueError for faults of the file."""
        from fvsolve.parts.csv_rows import CsvError, read_table_file

        _, rows, _ = read_table_file(given, setting)
        name, basin, x, y = (rows.column(column, 0) for column in self.columns)
        tables: dict[str, Any] = {}
        points = zip(
            rows.numbers(x, "length").tolist(), rows.numbers(y, "length").tolist(), strict=True
        )
        for row, line, point in zip(rows.cells, rows.lines, points, strict=True):
            if row[name] in tables or not row[name]:
                fault = (
                    f"{show(row[name])} is the name of two gauges"
                    if row[name]
                    else "a gauge has no name"
                )
                raise CsvError(rows.file, f"{fault}; expected a name of its own for each", line)
            tables[row[name]] = {"basin": row[basin], "at": list(point)}
        return tables


class OutputSection(Table):
    """Table of a section: a line across a basin of water, with the probe `SECTION.flow` of the flow through it."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("from", "line"), ("to", "line"))

    basin: Annotated[str, val.Text("name of the basin")]
    from_: Annotated[
        tuple[float, float] | None,
        val.Rows(
            "length",
            length=2,
            about="x, y of the start of a straight line [m]",
            changes=SHAPE,
        ),
        Field(alias="from"),
    ] = None
    to: Annotated[
        tuple[float, float] | None,
        val.Rows(
            "length",
            length=2,
            about="x, y of the end of the line [m]; flow to the left of it is positive",
            changes=SHAPE,
        ),
    ] = None
    line: Annotated[
        tuple[tuple[float, float], ...] | None,
        PointList(2, "points of the line, instead of `from` and `to`"),
    ] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        faults = super().key_faults(given)
        if "line" in given:
            return faults
        return faults + [((), f"{key} is missing") for key in ("from", "to") if key not in given]

    @property
    def points(self) -> tuple[tuple[float, float], ...]:
        """Points of the line [m]."""
        return self.line or (self.from_, self.to)

    def chain(self, mesh: Any) -> Any:
        """`FaceChain` of the section in a mesh."""
        from fvsolve.core.mesh.face_chains import chain_along

        return chain_along(mesh, self.points)


class OutputGrid(Table):
    """Table of fields of a basin on square pixels, as files `grids/NAME-FIELD.tif` or `grids/NAME.nc`."""

    basin: Annotated[str, val.Text("name of the basin")]
    fields: Annotated[
        Any,
        NameList(
            "fields",
            '["max_depth"]',
            "greatest values at the end of the run, or fields of frames (the last in a GeoTIFF)",
        ),
    ]
    format: Annotated[
        str,
        Choice(
            "format",
            ("geotiff", "netcdf"),
            "file format: geotiff, or netcdf (NetCDF-3)",
            changes=VALUE,
        ),
    ]
    cell: Annotated[float, Quantity("length", positive, "side of a pixel [m]", changes=VALUE)]


class Output(Table):
    """Table `[output]`: recorded quantities, output times and units."""

    every: Annotated[
        float | None,
        Quantity(
            "time",
            positive,
            f"interval between rows of the history [s]; (end - start) / {DEFAULT_ROWS} if left out",
            changes=VALUE,
        ),
    ] = None
    fields: Annotated[
        int, val.Whole(val.between(0, 10**6), "number of frames of the fields, 0 for none", VALUE)
    ] = DEFAULT_FRAMES
    probes: Annotated[
        Any,
        NameList(
            "probes",
            '["gate.pressure"]',
            "recorded quantities; those of all nodes and links if left out",
        ),
    ] = None
    lines: Annotated[
        Any,
        NamedTables(
            OutputLine, "named lines across basins: { centre = { basin, from, to, points } }"
        ),
    ] = {}
    maxima: Annotated[
        Any,
        NameList(
            "basins",
            '["reach"]',
            "basins whose greatest depths, speeds and times of arrival are recorded in every cell",
        ),
    ] = ()
    wet_depth: Annotated[
        float,
        Quantity(
            "length",
            val.between(1e-6, 1e6),
            "depth above which a cell counts as wet in `maxima` and `run_up` [m]",
            changes=VALUE,
        ),
    ] = 0.01
    run_up: Annotated[
        Any,
        NamedTables(
            RunUp, "named run-ups: { shore = { basin, about } } or { beach = { basin, from, to } }"
        ),
    ] = {}
    gauges: Annotated[
        Any,
        Gauges(
            Gauge,
            'named points of basins for probes: { kerb = { basin, at } }, or { file = "gauges.csv" }',
        ),
    ] = {}
    sections: Annotated[
        Any,
        NamedTables(
            OutputSection,
            "lines across basins for probes of the flow: { bridge = { basin, from, to } }",
        ),
    ] = {}
    grids: Annotated[
        Any,
        NamedTables(
            OutputGrid, "fields of basins on pixels: { flood = { basin, fields, format, cell } }"
        ),
    ] = {}
    sinks: Annotated[
        Any,
        SinkNames(
            "sinks",
            '["json-lines"]',
            "names of sinks of other packages, which receive what the run directory receives",
            VALUE,
        ),
    ] = ()
    units: Annotated[dict[str, str], OutputUnits()] = {}

    @property
    def basins_with_maxima(self) -> tuple[str, ...]:
        """Names of the basins whose greatest values are recorded: of `maxima`, run-ups and grids that need them."""
        drawn: list[str] = []
        if self.grids:
            from fvsolve.parts.basin import Physics

            recorded = {key for physics in Physics.kinds.values() for key in physics.maxima}
            drawn += [
                spec.basin
                for spec in self.grids.values()
                if recorded.intersection(map(str, spec.fields))
            ]
        return tuple(
            dict.fromkeys([*self.maxima, *(spec.basin for spec in self.run_up.values()), *drawn])
        )

    def table(self) -> dict[str, Any]:
        """Keys and values as in a case file, without sinks: they change no number, and other machines may lack them."""
        values = {**super().table(), "probes": [probe.text for probe in self.probes]}
        del values["sinks"]
        return {
            key: value
            for key, value in values.items()
            if value != {} and (key, value) != ("maxima", [])
        }


class ExactSpec(Table):
    """Table `[exact]`: exact solution of the case, from which studies compute errors."""

    name: Annotated[
        str, Choice("exact solution", NAMES, "name of the exact solution", changes=VALUE)
    ]
