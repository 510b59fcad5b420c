"""Expectations (`[expect]`) and measured series (`[compare]`) of a case."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.case.extent import ALL, Extent, read_extent
from fvsolve.case.probe import Kinds, Probe, read_probe
from fvsolve.errors import did_you_mean
from fvsolve.parts.table_model import read_keys
from fvsolve.parts.time_series import copy_name, find_file, read_columns
from fvsolve.parts.value import NEEDED, VALUE, Anything, Number, Quantity, ReadContext, Text, ValueFault, nonnegative
from fvsolve.units import show

FUNCTIONS = ("max", "min", "mean", "final", "at")
_CLAIM = re.compile(r"\s*(\w+)\s*\(\s*([^()]+?)\s*\)\s*")
_BARE = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")


@dataclass(frozen=True)
class Expect:
    """Expectation that a function of a probe, or an extreme over a part or route, equals `value`.

    function : max, min, mean, final or at; time : time of the function `at` [s], else None
    text : expectation as in the file, such as "max(gate.pressure)"
    probe, extent : the probe, or the quantity with its parts (`Extent`); the other is None
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
    """

    probe: Probe
    file: str
    path: Path
    time: str
    value: str
    shift: float
    t: np.ndarray = field(repr=False)
    v: np.ndarray = field(repr=False)

    def table(self) -> dict[str, Any]:
        """Keys of the series as in a file."""
        return {"file": self.file, "time": self.time, "value": self.value, "shift": self.shift}


def read_expect(claim: str, given: Any, kinds: Kinds, routes: Mapping[str, Any], setting: ReadContext) -> Expect | None:
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
        keys |= {"value": (Anything(), NEEDED), "atol": (Anything(), 0.0)}
    try:
        if not isinstance(given, dict):
            raise ValueError(f"{show(given)} is not a table; expected for example {{ value = 1.0, rtol = 1e-2 }}")
        if "rtol" not in given and "atol" not in given:
            faults.append(((), "tolerance is missing; expected rtol, atol or both"))
        values = read_keys(given, keys, setting)
    except ValueError as error:
        raise ValueFault(faults + getattr(error, "faults", [((), str(error))])) from None
    if faults:
        raise ValueFault(faults)
    return None if target is None else Expect(claim, function, probe, extent, time, **values)


def read_claim(
    claim: str, kinds: Kinds, routes: Mapping[str, Any], setting: ReadContext
) -> tuple[str, Probe | None, Extent | None, float | None]:
    """Split the text `claim` of an expectation into (function, probe, extent, time [s]). Raises ValueError.

    The probe or the extent is None; both are None if the part is faulty. The time is None except for the function `at`.
    kinds : as for `read_probe`; routes : routes by name, None if faulty
    """
    match = _CLAIM.fullmatch(claim)
    if match is None or match[1] not in FUNCTIONS:
        hint = did_you_mean(match[1], FUNCTIONS) if match else ""
        forms = "max(PROBE), min(PROBE), mean(PROBE), final(PROBE), at(PROBE, TIME), max(PART.QUANTITY) or "
        forms += "min(PART.QUANTITY)"
        raise ValueError(f"is not a claim; expected {forms}{hint}")
    function, probe_text = match.groups()
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


def expect_keys(dimension: str) -> dict[str, tuple[Any, Any]]:
    """Keys of an expectation on a quantity of the given dimension: name -> (declaration, default).

    `atol` of a pressure is a difference of pressures, never a gauge pressure.
    """
    difference = "modulus" if dimension.endswith("pressure") else dimension
    return {
        "value": (Quantity(dimension, changes=VALUE), NEEDED),
        "rtol": (Number(nonnegative, changes=VALUE), 0.0),
        "atol": (Quantity(difference, nonnegative, changes=VALUE), 0.0),
    }


COMPARE_KEYS = {
    "file": (Text("CSV file with a header; path relative to the case file", VALUE), NEEDED),
    "time": (Text("header of the column of times; the first column if left out", VALUE), None),
    "value": (Text("header of the column of values; the second column if left out", VALUE), None),
    "shift": (Quantity("time", about="time shift, added to the times of the file [s]", changes=VALUE), 0.0),
}


def read_compare(probe: Probe | None, given: Any, setting: ReadContext) -> Compare | None:
    """Read one entry of `[compare]`; None if its probe is faulty. Raises ValueError if entry or file are invalid."""
    if not isinstance(given, dict):
        raise ValueError(f'{show(given)} is not a table; expected for example {{ file = "rig.csv" }}')
    values = read_keys(given, COMPARE_KEYS, setting)
    try:
        path = find_file(values["file"], setting)
        if probe is None:
            return None
        t, v, *headers = read_columns(path, values["time"], values["value"], probe.dimension, setting)
    except ValueError as error:
        raise ValueFault([(("file",), str(error))]) from None
    return Compare(probe, copy_name(path, setting), path, *headers, values["shift"], t, v)
