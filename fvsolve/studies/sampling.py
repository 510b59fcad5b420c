"""Values of keys of a case for the runs of a study: grids, samples of ranges, rows of a file."""

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
from fvsolve.case.changes import declaration_of
from fvsolve.case.reading import parsed, split_key
from fvsolve.errors import CaseError, Fault, FvsolveError
from fvsolve.parts.csv_rows import number, read_rows, split_header
from fvsolve.parts.schedule import Scheduled
from fvsolve.parts.value import Quantity, ReadContext
from fvsolve.units import show

SAMPLERS = ("sobol", "lhs")
SAMPLE_FORMAT = "sobol:N or lhs:N with N runs, for example sobol:64"
MAX_RUNS = 10_000_000  # greatest number of runs


def grid(vary: Mapping[str, Sequence[Any]]) -> list[dict[str, Any]]:
    """All combinations of the values of the keys, as (key -> value) of each run; the last key varies fastest."""
    return [dict(zip(vary, values, strict=True)) for values in itertools.product(*vary.values())]


def sample_points(
    case: Case, vary: Mapping[str, Sequence[Any]], sample: str, seed: int
) -> list[dict[str, Any]]:
    """Sample of points within the ranges of keys, each key -> value [SI], by `scipy.stats.qmc`.

    vary : key -> (low, high); sample : kind and number of points, such as "sobol:64" or "lhs:100" (Latin hypercube)
    seed : equal seeds give equal points
    Raises FvsolveError for an invalid `sample`, CaseError for invalid ranges.
    """
    match = re.fullmatch(r"(\w+):(\d+)", sample.strip())
    if match is None or match[1] not in SAMPLERS or not 0 < int(match[2]) <= MAX_RUNS:
        raise FvsolveError(f"sample = {show(sample)} is not valid; expected {SAMPLE_FORMAT}")
    low, high = (np.array(side) for side in zip(*key_ranges(case, vary).values(), strict=True))
    from scipy.stats import qmc

    make = qmc.LatinHypercube if match[1] == "lhs" else qmc.Sobol
    with warnings.catch_warnings():
        # warnings on sample sizes that are not powers of two
        warnings.simplefilter("ignore", UserWarning)
        unit = make(len(vary), seed=np.random.default_rng(seed)).random(int(match[2]))
    return [dict(zip(vary, row, strict=True)) for row in (low + (high - low) * unit).tolist()]


def key_ranges(case: Case, vary: Mapping[str, Sequence[Any]]) -> dict[str, tuple[float, float]]:
    """Ranges of keys in SI : key -> (low, high), pressures absolute. Raises CaseError with the faults of all ranges."""
    result, faults = {}, []
    for key, given in vary.items():
        try:
            result[key] = range_of(case, key, given)
        except (ValueError, FvsolveError) as error:
            faults.append(Fault(key, str(error), override=True))
    if faults:
        raise CaseError(faults, case.name)
    return result


def range_of(case: Case, key: str, given: Sequence[Any]) -> tuple[float, float]:
    """Range of a key in SI : (low, high). Raises ValueError for an invalid range, FvsolveError for an unknown key.

    given : two values, each a number or a text with a unit
    """
    if len(given) != 2:
        raise ValueError(f"{show(list(given))} is not a range; expected two values, LOW,HIGH")
    quantity, setting = key_quantity(case.raw, key), ReadContext(ambient=case.ambient_pressure)
    if quantity is None:
        raise ValueError(
            "is not a continuous quantity, so it has no range; use a grid: --set KEY=a,b,c"
        )
    low, high = (quantity.read(parsed(end), setting) for end in given)
    if isinstance(low, units.Kinematic) or isinstance(high, units.Kinematic):
        raise ValueError(
            f"{show(list(given))} is a kinematic viscosity; expected dynamic viscosities in Pa s or mPa s"
        )
    if not low < high:
        reason = "is empty" if low == high else "is reversed"
        raise ValueError(
            f"the range from {show(given[0])} to {show(given[1])} {reason}; expected LOW below HIGH"
        )
    return float(low), float(high)


def key_quantity(raw: dict[str, Any], key: str) -> Quantity | None:
    """Quantity (dimension and range) of the values of a key; None if the values are words or whole numbers.

    raw : nested dicts of the case. Raises FvsolveError for an unknown key.
    """
    keys = split_key(key)
    value = declaration_of(raw, keys)
    if isinstance(value, Scheduled):
        within = len(keys) > 1 and isinstance(declaration_of(raw, keys[:-1]), Scheduled)
        forms = value.forms.values() if within else ()
        value = next(
            (form[keys[-1]][0] for form in forms if keys[-1] in form),
            Quantity(value.dimension, value.range),
        )
    value = getattr(value, "number", value)  # of a value that is a number or a table
    return value if isinstance(value, Quantity) else None


def si_unit_of(raw: dict[str, Any], key: str) -> str:
    """SI unit of the values of a key that are given without a unit; "" if they have no dimension."""
    quantity = key_quantity(raw, key)
    return (
        ""
        if quantity is None or quantity.dimension == "number"
        else units.DIMENSIONS[quantity.dimension].si
    )


def key_with_unit(raw: dict[str, Any], key: str, values: Iterable[Any]) -> str:
    """Heading of the column of a key, with the SI unit if all values are bare numbers: `links.main.length [m]`."""
    all_bare = all(
        isinstance(value, (int, float)) and not isinstance(value, bool) for value in values
    )
    unit = si_unit_of(raw, key) if all_bare else ""
    return f"{key} [{unit}]" if unit else key


def refuse_unknown(source: Any, values: Mapping[str, Any], raw: dict[str, Any]) -> None:
    """Raise CaseError with all keys in `values` that a case cannot have; source : the case; raw : its nested dicts."""
    unknown = [key for key in values if not is_known(raw, key)]
    try:
        if unknown:
            load(source, values)
    except CaseError as error:
        faults = [
            fault for fault in error.faults if any(fault.place.startswith(key) for key in unknown)
        ]
        if faults:
            raise CaseError(faults, error.file) from None


def is_known(raw: dict[str, Any], key: str) -> bool:
    """True if a case can have the key; raw : nested dicts of the case."""
    try:
        declaration_of(raw, split_key(key))
    except (FvsolveError, KeyError, AttributeError, TypeError):
        # other types if the case itself is invalid
        return False
    return True


def points_from_file(path: Path, source: Any, raw: dict[str, Any]) -> list[dict[str, Any]]:
    """Read the values of runs from a CSV file: a column for each key, units in its header (`KEY [mm]`) or its cells.

    source : the case; raw : its nested dicts. Raises FvsolveError with all faults of the file.
    """
    try:
        table = read_rows(path)
    except ValueError as error:
        raise FvsolveError(f"{error}; expected a header of keys and a row for each run") from None
    faults = [
        f"two columns have the key {name}"
        for name in dict.fromkeys(table.names)
        if table.names.count(name) > 1
    ]
    keys = [Heading.of(header, raw, faults) for header in table.header]
    rows = [
        {
            key.name: key.read(cell, f"line {line}, {key.name}", faults)
            for key, cell in zip(keys, row, strict=True)
        }
        for line, row in zip(table.lines, table.cells, strict=True)
    ]
    try:
        refuse_unknown(source, rows[0], raw)
    except CaseError as error:
        faults = [
            f"{case_fault.place}: {case_fault.message}" for case_fault in error.faults
        ] + faults
    if faults:
        rest = f"\n  and {len(faults) - MAX_FAULTS} more" * (len(faults) > MAX_FAULTS)
        lines_of_faults = "".join(f"\n  {fault}" for fault in faults[:MAX_FAULTS])
        raise FvsolveError(
            f"{path.name}: {len(faults)} fault{'s' * (len(faults) > 1)}{lines_of_faults}{rest}"
        )
    return rows


MAX_FAULTS = 20  # greatest number of faults in a message


class Heading:
    """Column of a CSV file of points: key, unit in the header ("" if none), quantity of the key (None for words)."""

    def __init__(self, name: str, unit: str, quantity: Quantity | None) -> None:
        self.name, self.unit, self.quantity = name, unit, quantity

    @classmethod
    def of(cls, header: str, raw: dict[str, Any], faults: list[str]) -> Heading:
        name, unit = split_header(header)
        quantity = key_quantity(raw, name) if is_known(raw, name) else None
        try:
            if unit and quantity is None:
                raise ValueError(f"values of {name} have no unit; leave [{unit}] out")
            if unit:
                units.find(unit, quantity.dimension)
        except ValueError as error:
            faults.append(f"{header}: {error}")
            unit = ""
        return cls(name, unit, quantity)

    def read(self, cell: str, place: str, faults: list[str]) -> Any:
        """Value of a cell of the file as an override; faults, with the name `place` of the cell, go to `faults`."""
        value = number(cell)
        if not cell:
            faults.append(f"{place}: is empty; expected a value in every row")
        elif self.unit and value is None:
            expected = "expected a number without unit: the unit is in the header"
            faults.append(f"{place}: {show(cell)} is not a number; {expected}")
        elif self.unit:
            return f"{value!r} {self.unit}"
        elif value is not None and self.quantity is not None:
            return value
        elif self.quantity is not None and isinstance(parsed_value := parsed(cell), str):
            try:
                units.parse(parsed_value, self.quantity.dimension)
            except ValueError as error:
                faults.append(f"{place}: {error}")
        return parsed(cell)
