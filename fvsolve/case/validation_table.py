"""Table `[validation]` of a case: sources, files of measurements, and rows that compare computed values."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fvsolve.case.basins import BasinFields
from fvsolve.case.claims import FUNCTIONS, RunUpPlace, read_claim
from fvsolve.case.probe import Extent, Kinds, Probe, read_probe
from fvsolve.case.reading import Reading
from fvsolve.errors import did_you_mean, listing
from fvsolve.parts import value as val
from fvsolve.parts.table_model import check_table, keys_json, read_keys
from fvsolve.parts.value import (
    NEEDED,
    VALUE,
    Quantity,
    ReadContext,
    ValueFault,
    faults_of,
    nonnegative,
)
from fvsolve.units import show

MEASURED, OTHERS, EXACT = GATES = ("measured", "others", "exact")
# relative to the range of the measured series
ERRORS = ("mean_error", "rms_error", "greatest_error")
DIFFERENCE = "rms_difference"  # from the measured series, in the unit of the probe
CROSSING = "time"  # first time at which a probe passes a value
# mean error of a field at the end, relative to the mean of the exact field
PROFILE = "profile_error"
PROFILES = ("depth", "surface", "u", "discharge")  # quantities of exact fields
PROFILE_KEYS = ("length", "from", "to")  # keys of a profile that are not data of its solution
MEASURES = (*FUNCTIONS, CROSSING, *ERRORS, DIFFERENCE, PROFILE)
OF_SERIES = (*ERRORS, DIFFERENCE)
OF_ERROR = (*OF_SERIES, PROFILE)  # their reference value is 0
FINER = val.between(1.0, 16.0, open=True)  # a run at the same resolution would agree with itself
_MEASURE = re.compile(r"(\w++)\s*+\((.*)\)")  # of a text without blanks at its ends
_SUM = re.compile(r"sha256:[0-9a-f]{64}(?:, \d+ bytes)?")


@dataclass(frozen=True)
class Measure:
    """Quantity that a row computes from a run.

    function : one of `MEASURES`; text : as in the file; dimension : of its values
    probe, extent, run_up : as for `Expect`, all None for a profile; argument : time or value [SI], else None
    field : (basin, quantity) of a profile, else None
    """

    text: str
    function: str
    dimension: str
    probe: Probe | None = None
    extent: Extent | None = None
    argument: float | None = None
    field: tuple[str, str] | None = None
    run_up: RunUpPlace | None = None


@dataclass(frozen=True)
class Row:
    """Row of a validation: a computed value, values of others, and the gate.

    what : name of the row; measure : what is computed; None in a validation by a program
    from_, to : first and last time that count [s], None for start and end; set : overrides of the case for this row
    curves : name -> CSV file with run-up over angle or distance, for the figure of a run-up
    series : name of the compared series in the figure; "" for a measurement or an exact solution
    measured : {value, spread, source}; others : tuple of {code, value, source}; exact : {value, source, resolution}
    gate : {of, rtol, atol, reason}; because : why the model differs from the measurement; unit : of a program's value
    """

    what: str
    computed: str
    measure: Measure | None
    measured: dict[str, Any] | None
    others: tuple[dict[str, Any], ...]
    exact: dict[str, Any] | None
    gate: dict[str, Any]
    because: str
    unit: str
    set: dict[str, Any]
    curves: dict[str, str]
    series: str
    from_: float | None
    to: float | None


@dataclass(frozen=True)
class Validation:
    """Table `[validation]` as read.

    files : path in the data folder -> sum; tables : CSV file to make -> {of, skip, columns}; get : how to get the files
    case : shipped case that the file completes; network : EPANET file that it completes, with keys of the import
    program, profile : name with parameters
    """

    source: str
    licence: str
    get: str
    note: str
    files: dict[str, str]
    tables: dict[str, dict[str, Any]]
    case: str | None
    network: dict[str, Any] | None
    program: str | None
    profile: dict[str, Any] | None
    compare: tuple[Row, ...]


class Subtable(val.Value):
    """Value that is a table with declared keys."""

    changes = VALUE

    def __init__(self, keys: Mapping[str, tuple[val.Value, Any]], about: str) -> None:
        self.keys, self.about = dict(keys), about

    def read(self, given: Any, setting: ReadContext) -> dict[str, Any]:
        check_table(given, self.about)
        return read_keys(given, self.keys, setting)

    def json(self) -> dict[str, Any]:
        return keys_json(self.keys)


class Sequence(val.Value):
    """Value that is a list of values of the same declaration."""

    changes = VALUE

    def __init__(self, item: val.Value, about: str) -> None:
        self.item, self.about = item, about

    def read(self, given: Any, setting: ReadContext) -> tuple[Any, ...]:
        if not isinstance(given, list):
            raise ValueError(f"{show(given)} is not a list; expected {self.about}")
        return tuple(
            val.read_each(enumerate(given), lambda item: self.item.read(item, setting)).values()
        )

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": self.item.json()}


class ByName(val.Value):
    """Value that is a table of values of the same declaration by name."""

    changes = VALUE

    def __init__(self, item: val.Value, about: str) -> None:
        self.item, self.about = item, about

    def read(self, given: Any, setting: ReadContext) -> dict[str, Any]:
        check_table(given, self.about)
        return val.read_each(given.items(), lambda item: self.item.read(item, setting))

    def json(self) -> dict[str, Any]:
        return {"type": "object", "additionalProperties": self.item.json()}


class Below(ByName):
    """Value that is a table by paths below a folder."""

    def read(self, given: Any, setting: ReadContext) -> dict[str, Any]:
        check_table(given, self.about)
        faults = [
            ((name,), "leads out of its folder; expected a path below it")
            for name in given
            if Path(name).is_absolute() or ".." in Path(name).parts
        ]
        if faults:
            raise ValueFault(faults)
        return super().read(given, setting)


class FileSum(val.Text):
    """Value that is the sum of a file, for example "sha256:...", "sha256:..., 9000 bytes"."""

    def read(self, given: Any, setting: ReadContext) -> str:
        text = super().read(given, setting)
        if not _SUM.fullmatch(text):
            raise ValueError(
                f'{show(text)} is not a sum; expected "sha256:" and 64 digits, as sha256sum prints them'
            )
        return text


class Span(val.Value):
    """Value that is a list of two numbers of a dimension, least and greatest."""

    changes = VALUE

    def __init__(self, dimension: str, about: str) -> None:
        self.item, self.about = Quantity(dimension, changes=VALUE), about

    def read(self, given: Any, setting: ReadContext) -> tuple[float, float]:
        if not isinstance(given, list) or len(given) != 2:
            raise ValueError(f"{show(given)} is not a list of the least and the greatest value")
        least, greatest = (self.item.read(item, setting) for item in given)
        if least > greatest:
            raise ValueError(f"{show(given)} falls; expected the least value, then the greatest")
        return least, greatest

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": self.item.json(), "minItems": 2, "maxItems": 2}


def text(about: str, default: Any = "") -> tuple[val.Value, Any]:
    """Declaration of a key for text, with its default."""
    return val.Text(about, VALUE), default


def row_keys(dimension: str) -> dict[str, tuple[val.Value, Any]]:
    """Keys of a row whose computed value has a dimension : name -> (declaration, default)."""
    quantity = Quantity(dimension, changes=VALUE)
    difference = Quantity(
        "modulus" if dimension.endswith("pressure") else dimension, nonnegative, changes=VALUE
    )
    source = text("where the value is published")
    measured = {
        "value": (quantity, None),
        "source": source,
        "spread": (Span(dimension, "least and greatest of repeats, or of published values"), None),
    }
    other = {
        "code": text("name of the program", NEEDED),
        "value": (quantity, NEEDED),
        "source": source,
    }
    exact = {
        "value": (quantity, None),
        "source": source,
        "resolution": (
            val.Number(FINER, "times the resolution of the case, for a converged answer"),
            None,
        ),
    }
    gate = {
        "of": (val.Choice("gate", GATES, "value that decides", changes=VALUE), NEEDED),
        "rtol": (val.Number(nonnegative, "tolerance relative to that value", changes=VALUE), 0.0),
        "atol": (difference, 0.0),
        "reason": text(
            "why the gate is wider than the spread of measurement, codes and numerical error together"
        ),
    }
    return {
        "what": text("name of the row", NEEDED),
        "computed": text("computed value, for example max(gate.pressure)", NEEDED),
        "from": (Quantity("time", about="first time that counts [s]", changes=VALUE), None),
        "to": (Quantity("time", about="last time that counts [s]", changes=VALUE), None),
        "set": (ByName(val.Anything(), "overrides of the case, for example { KEY = VALUE }"), {}),
        "curves": (
            ByName(val.Text(changes=VALUE), "{ NAME = FILE }, run-up over angle or distance"),
            {},
        ),
        "series": text("name of the compared series in the picture, for example of a program"),
        "measured": (Subtable(measured, "for example { value, spread, source }"), None),
        "others": (
            Sequence(Subtable(other, "for example { code, value }"), "results of other programs"),
            (),
        ),
        "exact": (Subtable(exact, "for example { value, source }"), None),
        "gate": (Subtable(gate, 'for example { of = "measured", rtol = 0.05 }'), NEEDED),
        "because": text("why the model differs from the measurement"),
        "unit": text("unit of the value that a program computes"),
    }


TABLE_KEYS = {
    "of": text("file of the data folder", NEEDED),
    "skip": (
        val.Whole(val.between(0, 10**6), "number of lines before the rows of numbers", VALUE),
        0,
    ),
    "matrix": (
        val.Flag("true if the file is a matrix: c1, c2 are indices from 0, c3 the entry", VALUE),
        False,
    ),
    "every": (
        val.Whole(
            val.between(1, 1000), "step between the rows and columns of a matrix that count", VALUE
        ),
        1,
    ),
    "where": text("condition for a row to count, for example c2 > 0"),
    "columns": (
        ByName(val.Text(changes=VALUE), '{ "t [s]" = "c1 - 22" }, formulas of columns c1, c2, ...'),
        NEEDED,
    ),
}
NETWORK_KEYS = {
    "inp": text("EPANET file of the data folder, or name of a network of WNTR", NEEDED),
    "hour": (val.Number(nonnegative, "hour of EPANET's run [h]"), None),
    "wave_speed": (Quantity("velocity", val.positive, changes=VALUE), None),
}
KEYS = {
    "source": text("publication", NEEDED),
    "licence": text("licence of the data"),
    "get": text("how to get the files"),
    "note": text("what a reader must know about the case"),
    "files": (Below(FileSum(changes=VALUE), "{ PATH = SUM }, files of the data folder"), {}),
    "tables": (
        Below(Subtable(TABLE_KEYS, "{ of, skip, columns }"), "CSV files to make, by name"),
        {},
    ),
    "case": text("shipped case that this file completes", None),
    "network": (Subtable(NETWORK_KEYS, '{ inp = "town.inp" }'), None),
    "program": text("program of fvsolve that computes the values, in place of a scene", None),
    "profile": (
        ByName(val.Anything(), "{ solution = NAME, ... }, exact fields at the end of the run"),
        None,
    ),
    "compare": (val.Anything(), NEEDED),
}


def schema() -> dict[str, Any]:
    """JSON schema of the table `[validation]`."""
    rows = Sequence(Subtable(row_keys("number"), ""), "")
    return keys_json(KEYS | {"compare": (rows, NEEDED)})


def read_validation(
    reading: Reading, kinds: Kinds | None, routes: Mapping[str, Any]
) -> Validation | None:
    """Table `[validation]` of a case; None if there is none, or if it is faulty.

    kinds, routes : as for `read_claim`; kinds is None where the parts are not read; then only the rows of a program are
    """
    given = reading.raw.table.get("validation")
    if given is None:
        return None
    values, rows = {}, []
    with reading.catch("validation"):
        check_table(given, "source, files, compare")
        values = read_keys(given, KEYS, reading.setting)
        if values["profile"] is not None:
            check_profile(values["profile"])
    listed = given.get("compare") if isinstance(given, dict) else None
    if not isinstance(listed, list) or not listed:
        if listed is not None:
            reading.fault(
                ("validation", "compare"), f"{show(listed)} is not a list of tables; expected rows"
            )
        return None
    by_scene = kinds is None and "program" not in given  # rows are read with the parts
    for number, row in enumerate([] if by_scene else listed):
        with reading.catch("validation", "compare", number):
            rows.append(read_row(row, kinds, routes, reading))
    if not values or None in rows or (len(rows) < len(listed) and not by_scene):
        return None
    return Validation(**{key: values[key] for key in KEYS if key != "compare"}, compare=tuple(rows))


def check_profile(given: Mapping[str, Any]) -> None:
    """Raise ValueFault for an unknown solution, for unknown data, and for data that are not numbers."""
    # SciPy is imported only for a profile
    from fvsolve.exact.shallow_water import SOLUTIONS, data_of

    name = given.get("solution")
    if name not in SOLUTIONS:
        text = f"{show(name)} is unknown{did_you_mean(str(name), SOLUTIONS)}; solutions are {listing(SOLUTIONS)}"
        raise ValueFault([(("profile", "solution"), text)])
    known = (*data_of(name), *PROFILE_KEYS)
    faults = [
        (("profile", key), f"unknown key{did_you_mean(key, known)}; keys are {', '.join(known)}")
        for key in given
        if key not in ("solution", *known)
    ]
    faults += [
        (("profile", key), f"{show(value)} is not a number")
        for key, value in given.items()
        if key in known and (isinstance(value, bool) or not isinstance(value, (int, float)))
    ]
    if faults:
        raise ValueFault(faults)


def read_row(
    given: Any, kinds: Kinds | None, routes: Mapping[str, Any], reading: Reading
) -> Row | None:
    """Read a row; None if the part that it names is faulty. Raises ValueFault."""
    check_table(given, "for example { what, computed, measured, gate }")
    faults = []
    measure = None
    known = kinds is None
    if kinds is not None and "computed" in given:
        try:
            measure, known = read_measure(given["computed"], kinds, routes, reading), True
        except ValueError as error:
            faults += faults_of(error, "computed")
    keys = row_keys("number" if measure is None else measure.dimension)
    if not known:
        keys |= {key: (val.Anything(), None) for key in ("measured", "others", "exact", "gate")}
    try:
        values = read_keys(given, keys, reading.setting)
    except ValueError as error:
        raise ValueFault(faults + faults_of(error)) from None
    if not faults and known:
        faults += gate_faults(values, measure)
    if faults:
        raise ValueFault(faults)
    if kinds is not None and measure is None:
        return None
    return Row(measure=measure, from_=values.pop("from"), **values)


def gate_faults(values: Mapping[str, Any], measure: Measure | None) -> list[tuple[tuple, str]]:
    """Faults (key path, text) of a row whose gate refers to a value that is not given; values : its keys as read."""
    of, is_error = values["gate"]["of"], measure is not None and measure.function in OF_ERROR
    if of == OTHERS and not values["others"] and measure is not None:
        return [(("gate", "of"), '"others" has no values; expected others = [{ code, value }]')]
    if is_error:
        return []
    reference = (
        values["measured"] if of == MEASURED else values["exact"] if of == EXACT else {"value": 0.0}
    )
    if reference is None and measure is not None:
        return [(("gate", "of"), f'"{of}" has no value; expected {of} = {{ value }}')]
    if reference is not None and all(
        reference.get(key) is None for key in ("value", "spread", "resolution")
    ):
        return [((of,), "value is missing")]
    return []


def read_measure(
    given: Any, kinds: Kinds, routes: Mapping[str, Any], reading: Reading
) -> Measure | None:
    """Measure from its text, such as "time(tank.depth@1,0, 2 cm)"; None if its part is faulty. Raises ValueError."""
    match = _MEASURE.fullmatch(given.strip()) if isinstance(given, str) else None
    if match is None or match[1] not in MEASURES:
        near = did_you_mean(match[1], MEASURES) if match else ""
        raise ValueError(
            f"{show(given)} is not a measure; expected FUNCTION(PROBE) with {listing(MEASURES)}{near}"
        )
    function, inner = match.groups()
    if function == PROFILE:
        basin, _, quantity = inner.rpartition(".")
        if quantity not in PROFILES:
            raise ValueError(f"{show(quantity)} has no exact profile; expected {listing(PROFILES)}")
        if not isinstance(kinds["nodes"].get(basin), BasinFields):
            raise ValueError(f"{show(basin)} is not a basin; expected {PROFILE}(BASIN.{quantity})")
        return Measure(given, function, "number", field=(basin, quantity))
    if function in FUNCTIONS:
        _, probe, extent, when = read_claim(given, kinds, routes, reading.setting)
        target = probe or extent
        if isinstance(target, RunUpPlace):
            return Measure(given, function, target.dimension, run_up=target)
        return (
            None
            if target is None
            else Measure(given, function, target.dimension, probe, extent, when)
        )
    argument = None
    if function == CROSSING:
        inner, comma, argument = map(str.strip, inner.rpartition(","))
        if not comma:
            raise ValueError("the value is missing; expected time(PROBE, VALUE)")
    probe = read_probe(inner, kinds)
    if probe is None:
        return None
    if function == CROSSING:
        try:
            argument = float(argument)
        except ValueError:
            pass
        argument = Quantity(probe.dimension).read(argument, reading.setting)
        return Measure(given, function, "time", probe, argument=argument)
    if inner not in reading.group("compare") and "exact" not in reading.raw.table:
        text = f'{show(inner)} has no measured series; expected [compare] "{inner}" = {{ file }}, or [exact]'
        raise ValueError(text)
    difference = "modulus" if probe.dimension.endswith("pressure") else probe.dimension
    return Measure(given, function, difference if function == DIFFERENCE else "number", probe)
