"""With which values of keys runs are made: all combinations, samples of ranges, rows of a file. Knows no runs."""

from __future__ import annotations

import itertools
import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve import units
from fvsolve.case import Case, load
from fvsolve.case.changes import declared
from fvsolve.case.raw import dotted, parsed
from fvsolve.errors import CaseError, Fault, FvsolveError
from fvsolve.parts.csv_rows import number, read_rows, split
from fvsolve.parts.schedule import Scheduled
from fvsolve.parts.value import Quantity, Setting
from fvsolve.units import show

SAMPLERS = ("sobol", "lhs")
WANTED = "sobol:N or lhs:N with N runs, for example sobol:64"
MOST = 10_000_000  # runs


def grid(vary: Mapping[str, Sequence[Any]]) -> list[dict[str, Any]]:
    """Every combination of the values, the last key fastest."""
    return [dict(zip(vary, values, strict=True)) for values in itertools.product(*vary.values())]


def sampled(case: Case, vary: Mapping[str, Sequence[Any]], sample: str, seed: int) -> list[dict[str, Any]]:
    """Points between the two values of each key [SI]: Sobol's, scrambled, or a Latin hypercube (`scipy.stats.qmc`)."""
    kind, count = sampler_of(sample)
    low, high = (np.array(side) for side in zip(*ranges(case, vary).values(), strict=True))
    from scipy.stats import qmc

    make = qmc.LatinHypercube if kind == "lhs" else qmc.Sobol
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of numbers that are no power of two
        unit = make(len(vary), seed=np.random.default_rng(seed)).random(count)
    return [dict(zip(vary, row, strict=True)) for row in (low + (high - low) * unit).tolist()]


def sampler_of(sample: str) -> tuple[str, int]:
    """Kind and number of points of `sobol:64`."""
    match = re.fullmatch(r"(\w+):(\d+)", sample.strip())
    if match is None or match[1] not in SAMPLERS or not 0 < int(match[2]) <= MOST:
        raise FvsolveError(f"sample = {show(sample)}; wanted {WANTED}")
    return match[1], int(match[2])


def ranges(case: Case, vary: Mapping[str, Sequence[Any]]) -> dict[str, tuple[float, float]]:
    """Key -> (low, high) [SI, pressures absolute]; FvsolveError with all that are none."""
    found, faults = {}, []
    for key, given in vary.items():
        try:
            found[key] = range_of(case, key, given)
        except (ValueError, FvsolveError) as error:
            faults.append(Fault(key, str(error), override=True))
    if faults:
        raise CaseError(faults, case.name)
    return found


def range_of(case: Case, key: str, given: Sequence[Any]) -> tuple[float, float]:
    """The two ends of a range; ValueError where it is none."""
    if len(given) != 2:
        raise ValueError(f"{show(list(given))} is no range; wanted two values, LOW,HIGH")
    quantity, setting = quantity_of(case.raw, key), Setting(ambient=case.ambient_pressure)
    if quantity is None:
        raise ValueError("is no quantity, of which there are values between two; wanted a grid: --set KEY=a,b,c")
    low, high = (quantity.read(parsed(one), setting) for one in given)
    if not low < high:
        why = "has nothing in it" if low == high else "has its ends the other way round"
        raise ValueError(f"the range from {show(given[0])} to {show(given[1])} {why}; wanted LOW below HIGH")
    return float(low), float(high)


def quantity_of(raw: dict[str, Any], key: str) -> Quantity | None:
    """What a number under a key is; None where it takes words or whole numbers."""
    keys = dotted(key)
    value = declared(raw, keys)
    if isinstance(value, Scheduled):
        within = len(keys) > 1 and isinstance(declared(raw, keys[:-1]), Scheduled)
        forms = value.forms.values() if within else ()
        value = next((one[keys[-1]][0] for one in forms if keys[-1] in one), Quantity(value.dimension, value.range))
    return value if isinstance(value, Quantity) else None


def bare_unit(raw: dict[str, Any], key: str) -> str:
    """SI unit of bare numbers under a key; "" where they have none."""
    quantity = quantity_of(raw, key)
    return "" if quantity is None or quantity.dimension == "number" else units.DIMENSIONS[quantity.dimension].si


def headed(raw: dict[str, Any], key: str, values: Iterable[Any]) -> str:
    """A key with the unit of its values where all are bare numbers that have one: `links.main.length [m]`."""
    bare = all(isinstance(one, (int, float)) and not isinstance(one, bool) for one in values)
    unit = bare_unit(raw, key) if bare else ""
    return f"{key} [{unit}]" if unit else key


def refuse_unknown(source: Any, values: Mapping[str, Any], raw: dict[str, Any]) -> None:
    """CaseError with every key that a case with these values cannot have, before anything runs."""
    unknown = [key for key in values if not is_known(raw, key)]
    try:
        if unknown:
            load(source, values)
    except CaseError as error:
        faults = [one for one in error.faults if any(one.place.startswith(key) for key in unknown)]
        if faults:
            raise CaseError(faults, error.file) from None


def is_known(raw: dict[str, Any], key: str) -> bool:
    """Whether a case has a key, or could."""
    try:
        declared(raw, dotted(key))
    except (FvsolveError, KeyError, AttributeError, TypeError):  # of a case that is none besides
        return False
    return True


def of_file(path: Path, source: Any, raw: dict[str, Any]) -> list[dict[str, Any]]:
    """Values from a CSV file: a column for each key, units in its header (`KEY [mm]`) or in its cells.

    Raises FvsolveError with all that is wrong of it.
    """
    try:
        table = read_rows(path)
    except ValueError as error:
        raise FvsolveError(f"{error}; wanted a header of keys and a row for each run") from None
    faults = [f"two columns are {name}" for name in dict.fromkeys(table.names) if table.names.count(name) > 1]
    keys = [Heading.of(header, raw, faults) for header in table.header]
    rows = [
        {key.name: key.read(cell, f"line {line}, {key.name}", faults) for key, cell in zip(keys, row, strict=True)}
        for line, row in zip(table.lines, table.cells, strict=True)
    ]
    try:
        refuse_unknown(source, rows[0], raw)
    except CaseError as error:
        faults = [f"{one.place}: {one.message}" for one in error.faults] + faults
    if faults:
        more = f"\n  and {len(faults) - SHOWN} more" * (len(faults) > SHOWN)
        said = "".join(f"\n  {fault}" for fault in faults[:SHOWN])
        raise FvsolveError(f"{path.name}: {len(faults)} fault{'s' * (len(faults) > 1)}{said}{more}")
    return rows


SHOWN = 20  # faults of a file


class Heading:
    """A column of a file of points: its key, its unit, and what it measures."""

    def __init__(self, name: str, unit: str, quantity: Quantity | None) -> None:
        self.name, self.unit, self.quantity = name, unit, quantity

    @classmethod
    def of(cls, header: str, raw: dict[str, Any], faults: list[str]) -> Heading:
        name, unit = split(header)
        quantity = quantity_of(raw, name) if is_known(raw, name) else None
        try:
            if unit and quantity is None:
                raise ValueError(f"a column of {name} has no unit")
            if unit:
                units.find(unit, quantity.dimension)
        except ValueError as error:
            faults.append(f"{header}: {error}")
            unit = ""
        return cls(name, unit, quantity)

    def read(self, cell: str, place: str, faults: list[str]) -> Any:
        """The value of a cell as a setting takes it."""
        value = number(cell)
        if not cell:
            faults.append(f"{place}: is empty; wanted a value in every row")
        elif self.unit and value is None:
            faults.append(f"{place}: {show(cell)} is no number; its unit stands in the header")
        elif self.unit:
            return f"{value!r} {self.unit}"
        elif value is not None and self.quantity is not None:
            return value
        elif self.quantity is not None and isinstance(found := parsed(cell), str):
            try:
                units.parse(found, self.quantity.dimension)
            except ValueError as error:
                faults.append(f"{place}: {error}")
        return parsed(cell)
