"""Claims of a case: expectations (`[expect]`), measured series (`[compare]`) and design limits (`[limits]`).

Arguments of the functions that read them: kinds : as for `read_probe`; routes, links : by name, None if faulty.
"""

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from fvsolve.case.probe import (
    ALL,
    OF_PRESSURE,
    Extent,
    Kinds,
    Probe,
    only_dimension,
    read_extent,
    read_probe,
)
from fvsolve.case.reading import Reading
from fvsolve.errors import did_you_mean, listing
from fvsolve.parts import value as val
from fvsolve.parts.date_keys import DATE_KEYS, TimeColumns
from fvsolve.parts.table_model import SHEET_KEY, check_table, read_keys
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

FUNCTIONS = ("max", "min", "mean", "final", "at")
VACUUM, VAPOR = "vacuum", "vapor"
NAMED = {"vacuum": VACUUM, "vapor": VAPOR, "vapour": VAPOR}
RUN_UP = "run_up."  # begins the name of a run-up in an expectation
BOUNDS = ("minimum", "maximum", "class_fraction")
_CLAIM = re.compile(r"(\w++)\s*+\(([^()]++)\)")  # of a text without blanks at its ends
_BARE = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")


@dataclass(frozen=True)
class RunUpPlace:
    """Run-up in an expectation: its name, and the angle [deg] or distance [m] of the function `at`, else None."""

    name: str
    place: float | None
    dimension: ClassVar[str] = "length"


@dataclass(frozen=True)
class Expect:
    """Expectation that a function of a probe, or an extreme over a part or route, equals `value`.

    function : max, min, mean, final or at; time : time of the function `at` [s], else None
    text : expectation as in the file, such as "max(gate.pressure)"
    probe, extent, run_up : the probe, the quantity with its parts (`Extent`), or the run-up; the others are None
    value : expected value [SI]; rtol, atol : relative and absolute [SI] tolerance
    """

    text: str
    function: str
    probe: Probe | None
    extent: Extent | None
    time: float | None
    value: float
    rtol: float
    atol: float
    run_up: RunUpPlace | None = None

    def table(self) -> dict[str, Any]:
        """Keys of the expectation as in a file."""
        return {"value": self.value, "rtol": self.rtol, "atol": self.atol}


@dataclass(frozen=True, eq=False)
class Compare:
    """Measured series for comparison with a probe.

    file : name of the copy of the CSV file beside the resolved case, see `copy_name`; path : path of the CSV file
    time, value : headers of the columns of the CSV file
    shift : time that is added to the measured times [s]
    t, v : float64[n]  measured times without shift [s], and values [SI, pressures absolute]
    stated : further keys that the file of the case states, such as `time_zone`
    """

    probe: Probe
    file: str
    path: Path
    time: str | list[str]
    value: str
    shift: float
    t: np.ndarray = field(repr=False)
    v: np.ndarray = field(repr=False)
    stated: dict[str, Any] = field(default_factory=dict)

    def table(self) -> dict[str, Any]:
        """Keys of the series as in a file."""
        keys = {"file": self.file, "time": self.time, "value": self.value, "shift": self.shift}
        return keys | self.stated


def read_expect(
    claim: str, given: Any, kinds: Kinds, routes: Mapping[str, Any], setting: ReadContext
) -> Expect | None:
    """Read one entry of `[expect]`; None if the part that it names is faulty. Raises ValueFault.

    claim, given : key and value of the entry; other arguments as for `read_claim`
    """
    faults, named = [], (None, None, None, None)
    try:
        named = read_claim(claim, kinds, routes, setting)
    except ValueError as error:
        faults.append(((), str(error)))
    function, probe, extent, time = named
    target = probe or extent
    keys = expect_keys("number" if target is None else target.dimension)
    if target is None:
        keys |= {"value": (val.Anything(), NEEDED), "atol": (val.Anything(), 0.0)}
    try:
        check_table(given, "for example { value = 1.0, rtol = 1e-2 }")
        if "rtol" not in given and "atol" not in given:
            faults.append(((), "tolerance is missing; expected rtol, atol or both"))
        values = read_keys(given, keys, setting)
    except ValueError as error:
        raise ValueFault(faults + faults_of(error)) from None
    if faults:
        raise ValueFault(faults)
    if isinstance(extent, RunUpPlace):
        return Expect(claim, function, None, None, None, **values, run_up=extent)
    return None if target is None else Expect(claim, function, probe, extent, time, **values)


def read_claim(
    claim: str, kinds: Kinds, routes: Mapping[str, Any], setting: ReadContext
) -> tuple[str, Probe | None, Extent | RunUpPlace | None, float | None]:
    """Split the text `claim` of an expectation into (function, probe, extent or run-up, time [s]). Raises ValueError.

    The probe or the extent is None; both are None if the part is faulty. The time is None except for the function `at`
    of a probe.
    kinds : as for `read_probe`; routes : routes by name, None if faulty
    """
    match = _CLAIM.fullmatch(claim.strip())
    if match is None or match[1] not in FUNCTIONS or not match[2].strip():
        hint = did_you_mean(match[1], FUNCTIONS) if match else ""
        forms = "max(PROBE), min(PROBE), mean(PROBE), final(PROBE), at(PROBE, TIME), max(PART.QUANTITY) or "
        forms += f"min(PART.QUANTITY), max({RUN_UP}NAME) or at({RUN_UP}NAME, PLACE)"
        raise ValueError(f"is not a claim; expected {forms}{hint}")
    function, probe_text = match[1], match[2].strip()
    if probe_text.startswith(RUN_UP) and "run_up" not in kinds["nodes"] | kinds["links"]:
        return (
            function,
            None,
            read_run_up(function, probe_text.removeprefix(RUN_UP), kinds["run_up"], setting),
            None,
        )
    when = None
    if function == "at":  # split at the last comma: a point in a basin contains a comma
        probe_text, comma, when = map(str.strip, probe_text.rpartition(","))
        if not comma:
            raise ValueError("the time is missing; expected at(PROBE, TIME)")
    elif "," in probe_text and "@" not in probe_text:
        raise ValueError(f"only at() has a time; expected {function}(PROBE)")
    time = None
    if when is not None:
        given_time = float(when) if _BARE.fullmatch(when) else when.strip("\"'")
        time = Quantity("time").read(given_time, setting)
    try:
        return function, read_probe(probe_text, kinds), None, time
    except ValueError:
        on, dot, quantity = probe_text.rpartition(".")
        if not dot or "@" in probe_text or function not in ("max", "min"):
            raise
        try:
            return function, None, read_extent(on, quantity, kinds, routes), time
        except ValueError:
            if on in routes or on in ALL:
                raise
        raise  # the fault of the probe


def read_run_up(
    function: str, text: str, run_ups: Mapping[str, Any], setting: ReadContext
) -> RunUpPlace | None:
    """Run-up in an expectation from its text, such as "shore, 90"; None if it is faulty. Raises ValueError.

    run_ups : run-ups of `[output]` by name, None if `[output]` is faulty
    """
    if function not in (able := ("max", "min", "at")):
        raise ValueError(f"a run-up has no {function}; expected {listing(able)}")
    name, comma, place = map(str.strip, text.partition(","))
    if (function == "at") != bool(comma):
        raise ValueError(
            f"expected {f'at({RUN_UP}NAME, PLACE)' if function == 'at' else f'{function}({RUN_UP}NAME)'}"
        )
    if name not in run_ups:
        known = f"; run-ups are {listing(run_ups)}" if run_ups else "; [output] has no run_up"
        raise ValueError(f"no run-up named {show(name)}{did_you_mean(name, run_ups) or known}")
    if (spec := run_ups[name]) is None or not comma:
        return None if spec is None else RunUpPlace(name, None)
    given = float(place) if _BARE.fullmatch(place) else place.strip("\"'")
    if spec.about is not None:
        return RunUpPlace(name, val.Number().read(given, setting))
    return RunUpPlace(name, Quantity("length", val.between(0, spec.length)).read(given, setting))


def expect_keys(dimension: str) -> dict[str, tuple[Any, Any]]:
    """Keys of an expectation on a quantity of the given dimension: name -> (declaration, default).

    `atol` of a pressure is a difference of pressures, never a gauge pressure.
    """
    difference = "modulus" if dimension.endswith("pressure") else dimension
    return {
        "value": (Quantity(dimension, changes=VALUE), NEEDED),
        "rtol": (val.Number(nonnegative, changes=VALUE), 0.0),
        "atol": (Quantity(difference, nonnegative, changes=VALUE), 0.0),
    }


COMPARE_KEYS = {
    "file": (
        val.Text("CSV file or Excel workbook with a header; path relative to the case file", VALUE),
        NEEDED,
    ),
    "time": (TimeColumns(), None),
    "value": (
        val.Text("header of the column of values; the second column if left out", VALUE),
        None,
    ),
    "shift": (
        Quantity("time", about="time shift, added to the times of the file [s]", changes=VALUE),
        0.0,
    ),
    **SHEET_KEY,
    **DATE_KEYS,
}


def read_compare(probe: Probe | None, given: Any, setting: ReadContext) -> Compare | None:
    """Read one entry of `[compare]`; None if its probe is faulty. Raises ValueError if entry or file are invalid."""
    from fvsolve.parts.csv_rows import copy_name, find_file, read_columns, stated_keys

    check_table(given, 'for example { file = "rig.csv" }')
    values = read_keys(given, COMPARE_KEYS, setting)
    try:
        path = find_file(values["file"], setting)
        if probe is None:
            return None
        t, v, *headers = read_columns(path, values, probe.dimension, setting)
    except ValueError as error:
        raise ValueFault([(("file",), str(error))]) from None
    name, stated = copy_name(path, setting), stated_keys(values)
    return Compare(probe, name, path, *headers, values["shift"], t, v, stated)


class Bound(val.Value):
    """Value of a key that bounds a quantity: a number with the dimension of the quantity, or "vacuum" or "vapor"."""

    changes = VALUE
    schema = {"type": ["number", "string"]}

    def __init__(self, dimension: str, named: bool) -> None:
        self.item, self.named = Quantity(dimension, changes=VALUE), named

    def read(self, given: Any, setting: ReadContext) -> float | str:
        if isinstance(given, str) and given.casefold() in NAMED:
            if self.named:
                return NAMED[given.casefold()]
            raise ValueError(f"{show(given)} is a pressure; expected a {self.item.dimension}")
        try:
            return self.item.read(given, setting)
        except ValueError as error:
            hint = did_you_mean(given, NAMED) if isinstance(given, str) and self.named else ""
            raise ValueError(f"{error}{hint}") from None


class On(val.Value):
    """Value of the key `on` of a limit: names of parts or routes, which are looked up when all parts are read."""

    changes = VALUE
    schema = {"type": ["string", "array"], "items": {"type": "string"}}

    def read(self, given: Any, setting: ReadContext) -> Any:
        return tuple(given) if isinstance(given, list) else given


@dataclass(frozen=True)
class DesignLimit:
    """Lower and upper bound [SI] of a quantity in some parts of a case (the extent), checked after every step.

    minimum, maximum : a number, "vacuum" (ambient pressure), "vapor" (vapour pressure), or None without a bound
    class_fraction : greatest allowed gauge pressure over the allowable pressure of each pipe [-], or None
    """

    name: str
    extent: Extent
    minimum: float | str | None
    maximum: float | str | None
    class_fraction: float | None

    def table(self) -> dict[str, Any]:
        """Keys of the limit as in a file."""
        on = self.extent.on[0] if len(self.extent.on) == 1 else list(self.extent.on)
        result = {"on": on, "quantity": self.extent.quantity}
        return result | {key: bound for key in BOUNDS if (bound := getattr(self, key)) is not None}


def limit_keys(quantity: str, dimension: str) -> dict[str, tuple[val.Value, Any]]:
    """Keys of a limit on a quantity: name -> (declaration, default)."""
    bound = Bound(dimension, quantity in OF_PRESSURE)
    return {
        "on": (On(), NEEDED),
        "quantity": (val.Text(changes=VALUE), "pressure"),
        "minimum": (bound, None),
        "maximum": (bound, None),
        "class_fraction": (val.Number(val.positive, changes=VALUE), None),
    }


def read_limit(
    name: str,
    given: Any,
    kinds: Kinds,
    routes: Mapping[str, Any],
    links: Mapping[str, Any],
    setting: ReadContext,
) -> DesignLimit | None:
    """Read one table of `[limits]`; None if the parts that it names are faulty. Raises ValueError, ValueFault.

    name, given : name and content of the table; kinds : as for `read_probe`; routes, links : by name
    """
    check_table(given, 'for example { on = "pipes", maximum = "16 barg" }')
    quantity = given.get("quantity", "gauge_pressure" if "class_fraction" in given else "pressure")
    faults, extent = [], None
    if not isinstance(quantity, str):
        faults.append(
            (("quantity",), f"{show(quantity)} is not text; expected the name of a quantity")
        )
    elif "on" in given:
        try:
            extent = read_extent(given["on"], quantity, kinds, routes)
        except ValueError as error:
            key = "quantity" if isinstance(error, ValueFault) and "quantity" in given else "on"
            faults.append(((key,), str(error)))
    dimension = (
        extent.dimension
        if extent is not None
        else only_dimension(quantity)
        if isinstance(quantity, str)
        else None
    )
    keys = limit_keys(quantity if isinstance(quantity, str) else "", dimension or "number")
    if dimension is None:
        keys |= dict.fromkeys(("minimum", "maximum"), (val.Anything(), None))
    bounds = dict.fromkeys(BOUNDS)
    try:
        read_keys(given, keys, setting)
    except ValueFault as error:
        faults += error.faults
    for key in BOUNDS:
        with suppress(KeyError, ValueError):
            bounds[key] = keys[key][0].read(given[key], setting)
    if not any(key in given for key in BOUNDS):
        faults.append(((), f"bound is missing; expected at least one of {', '.join(BOUNDS)}"))
    if bounds["maximum"] is not None and bounds["class_fraction"] is not None:
        faults.append((("class_fraction",), "maximum and class_fraction are given; keep one"))
    minimum, maximum = bounds["minimum"], bounds["maximum"]
    if (
        dimension is not None
        and isinstance(minimum, float)
        and isinstance(maximum, float)
        and not minimum < maximum
    ):
        faults.append(
            (
                ("minimum",),
                f"{show(given['minimum'])} is not below maximum, {show(given['maximum'])}",
            )
        )
    if extent is not None and bounds["class_fraction"] is not None:
        faults += list(pipes_without_class(extent, links))
    if faults:
        raise ValueFault(faults)
    return None if extent is None else DesignLimit(name, extent, **bounds)


def limit_faults(
    limit: DesignLimit | None, fluid: Any, gravity: float
) -> Iterator[tuple[tuple, str]]:
    """Faults (key path, message) of a limit that depend on the properties of the fluid and on gravity [m/s2]."""
    if limit is None:
        return
    if gravity == 0.0 and limit.extent.quantity in ("head", "pressure_head"):
        text = f"{limit.extent.quantity} does not exist where gravity is 0; expected pressure"
        yield ("quantity",), text
    for key in ("minimum", "maximum"):
        if getattr(limit, key) == VAPOR and fluid is not None and not fluid.vapor_pressure:
            yield (
                (key,),
                'the fluid has no vapour pressure; expected vapor_pressure above 0 under [fluid], or "vacuum"',
            )


def pipes_without_class(extent: Extent, links: Mapping[str, Any]):
    """Yield a fault of the key `class_fraction` if the quantity is not a pressure, or a part has no pressure class."""
    if extent.quantity not in OF_PRESSURE or extent.quantity == "head":
        yield (
            ("class_fraction",),
            f"a pressure class limits the pressure, not {extent.quantity}; leave out `quantity`",
        )
        return
    bare = {
        name for name, link in links.items() if getattr(link, "allowable_pressure", None) is None
    }
    parts = [name for group, name in extent.parts if group != "links" or name in bare]
    if parts:
        more = f" and {len(parts) - 1} more" if len(parts) > 1 else ""
        text = f"no pressure class is given for {parts[0]}{more}; expected pipes with `class` or `allowable_pressure`"
        yield ("class_fraction",), text


def read_expectations(
    reading: Reading, kinds: Kinds, routes: Mapping[str, Any]
) -> dict[str, Expect | None]:
    """Expectations by their text; None for an expectation on a faulty part."""
    result = {}
    for claim, given in reading.group("expect").items():
        with reading.catch("expect", claim):
            result[claim] = read_expect(claim, given, kinds, routes, reading.setting)
    return result


def read_comparisons(reading: Reading, kinds: Kinds) -> dict[str, Compare | None]:
    """Measured series by the text of their probe; None for a faulty probe."""
    result = {}
    for name, given in reading.group("compare").items():
        probe = None
        with reading.catch("compare", name):
            probe = read_probe(name, kinds)
        with reading.catch("compare", name):
            result[name] = read_compare(probe, given, reading.setting)
    return result


def read_limits(
    reading: Reading,
    kinds: Kinds,
    routes: Mapping[str, Any],
    links: Mapping[str, Any],
    fluid: Any,
    gravity: float,
) -> dict[str, DesignLimit | None]:
    """Design limits by name; None for a limit on faulty parts.

    fluid : properties of the fluid, or None if it is faulty; gravity [m/s2]
    """
    result = {}
    for name, given in reading.group("limits").items():
        with reading.catch("limits", name):
            result[name] = read_limit(name, given, kinds, routes, links, reading.setting)
            reading.add(
                (("limits", name, *keys), text)
                for keys, text in limit_faults(result[name], fluid, gravity)
            )
    return result
