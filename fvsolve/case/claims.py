"""What a case claims and is laid beside: `[expect]`, `[compare]`. Knows their wording; knows no result."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.case.extent import Extent, read_extent
from fvsolve.case.probe import Kinds, Probe, read_probe
from fvsolve.errors import did_you_mean
from fvsolve.parts.series import copy_name, find_file, read_columns
from fvsolve.parts.table import read_keys
from fvsolve.parts.value import NEEDED, VALUE, Anything, Misfit, Number, Quantity, Setting, Text, nonnegative
from fvsolve.units import show

FUNCTIONS = ("max", "min", "mean", "final", "at", "greatest", "least")
WHOLE = ("greatest", "least")
_CLAIM = re.compile(r"\s*(\w+)\s*\(\s*([^()]+?)\s*\)\s*")
_BARE = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")


@dataclass(frozen=True)
class Expect:
    """A claim: a function (max, min, mean, final, at) of a probe, or the greatest or least of a whole part or route, is
    `value` [SI], within tolerance."""

    text: str
    function: str
    probe: Probe | None
    extent: Extent | None
    time: float | None
    value: float
    rtol: float
    atol: float

    def table(self) -> dict[str, Any]:
        """What the file would say."""
        return {"value": self.value, "rtol": self.rtol, "atol": self.atol}


@dataclass(frozen=True, eq=False)
class Compare:
    """A measured series laid over a probe: columns by header, shift to be added to its times [s].

    t, v : float64[n]  times as measured, without shift [s], and values [SI, pressures absolute]
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
        """What the file would say."""
        return {"file": self.file, "time": self.time, "value": self.value, "shift": self.shift}


def read_expect(claim: str, given: Any, kinds: Kinds, routes: Mapping[str, Any], setting: Setting) -> Expect | None:
    """One line of `[expect]`; None where the part of its probe is at fault itself. Raises Misfit."""
    faults, named = [], (None, None, None, None)
    try:
        named = read_claim(claim, kinds, routes, setting)
    except ValueError as error:
        faults.append(((), str(error)))
    function, probe, extent, time = named
    read = probe or extent
    keys = expect_keys("number" if read is None else read.dimension)
    if read is None:
        keys |= {"value": (Anything(), NEEDED), "atol": (Anything(), 0.0)}
    try:
        if not isinstance(given, dict):
            raise ValueError(f"{show(given)} is no table; wanted one such as {{ value = 1.0, rtol = 1e-2 }}")
        if "rtol" not in given and "atol" not in given:
            faults.append(((), "no tolerance; wanted rtol, atol or both"))
        found = read_keys(given, keys, setting)
    except ValueError as error:
        raise Misfit(faults + getattr(error, "faults", [((), str(error))])) from None
    if faults:
        raise Misfit(faults)
    return None if read is None else Expect(claim, function, probe, extent, time, **found)


def read_claim(
    claim: str, kinds: Kinds, routes: Mapping[str, Any], setting: Setting
) -> tuple[str, Probe | None, Extent | None, float | None]:
    """(function, probe, extent, time [s]) that a claim names; neither where the part is at fault itself."""
    match = _CLAIM.fullmatch(claim)
    if match is None or match[1] not in FUNCTIONS:
        hint = did_you_mean(match[1], FUNCTIONS) if match else ""
        wanted = "max, min, mean or final(PROBE), at(PROBE, TIME), or greatest or least(PART.QUANTITY)"
        raise ValueError(f"no such claim; wanted {wanted}{hint}")
    function, probe_text = match.groups()
    when = None
    if function == "at":  # the last comma: a point in a basin has one of its own
        probe_text, comma, when = map(str.strip, probe_text.rpartition(","))
        if not comma:
            raise ValueError("wanted at(PROBE, TIME)")
    elif "," in probe_text and "@" not in probe_text:
        raise ValueError(f"wanted {function}(PROBE)")
    time = None
    if when is not None:
        given_time = float(when) if _BARE.fullmatch(when) else when.strip("\"'")
        time = Quantity("time").read(given_time, setting)
    if function in WHOLE and "@" not in probe_text:
        on, dot, quantity = probe_text.rpartition(".")
        if not dot:
            raise ValueError(f"wanted {function}(PART.QUANTITY)")
        return function, None, read_extent(on, quantity, kinds, routes), time
    return function, read_probe(probe_text, kinds), None, time


def expect_keys(dimension: str) -> dict[str, tuple[Any, Any]]:
    """Keys of a claim on a probe of that dimension; a pressure's tolerance is a difference, never gauge."""
    difference = "modulus" if dimension.endswith("pressure") else dimension
    return {
        "value": (Quantity(dimension, changes=VALUE), NEEDED),
        "rtol": (Number(nonnegative, changes=VALUE), 0.0),
        "atol": (Quantity(difference, nonnegative, changes=VALUE), 0.0),
    }


COMPARE_KEYS = {
    "file": (Text("a CSV file with a header, relative to the case", VALUE), NEEDED),
    "time": (Text("header of the times, the first column if left out", VALUE), None),
    "value": (Text("header of the values, the second column if left out", VALUE), None),
    "shift": (Quantity("time", about="added to its times [s]", changes=VALUE), 0.0),
}


def read_compare(probe: Probe | None, given: Any, setting: Setting) -> Compare | None:
    """One line of `[compare]`; None where its probe is at fault. Raises ValueError."""
    if not isinstance(given, dict):
        raise ValueError(f'{show(given)} is no table; wanted one such as {{ file = "rig.csv" }}')
    found = read_keys(given, COMPARE_KEYS, setting)
    try:
        path = find_file(found["file"], setting)
        if probe is None:
            return None
        t, v, *headers = read_columns(path, found["time"], found["value"], probe.dimension, setting)
    except ValueError as error:
        raise Misfit([(("file",), str(error))]) from None
    return Compare(probe, copy_name(path, setting), path, *headers, found["shift"], t, v)
