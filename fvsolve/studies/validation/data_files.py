"""Files of a validation: sums, working folder, tables made from files of other formats, EPANET networks."""

import gzip
import hashlib
import re
import shutil
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.case import load, shipped
from fvsolve.case.reading import read_raw
from fvsolve.case.validation_table import Validation
from fvsolve.errors import FvsolveError
from fvsolve.parts.csv_rows import number
from fvsolve.parts.formula import Arithmetic
from fvsolve.studies.validation import measures

PROFILE_POINTS = 4001  # points along x of a start from an exact solution
PROFILE_WIDTH = 100.0  # [m], at least that of the basin
_INTEGRAL = re.compile(r"\s*integral\((.*)\)\s*")
_SEPARATOR = re.compile(r"\s*[,;\t]\s*|\s+")


def missing_files(validation: Validation, data: Path | None) -> list[str]:
    """Texts on files of a validation that are missing in the data folder, or differ from their sums."""
    return [
        text for name, given in validation.files.items() if (text := file_fault(name, given, data))
    ]


def file_fault(name: str, given: str, data: Path | None) -> str:
    """Text on a file that is missing, cut short or changed; "" if it has the given sum.

    given : sum as in the case, "sha256:..." or "sha256:..., 9000 bytes"
    """
    path = None if data is None else data / name
    if path is None or not path.is_file():
        return f"{name} is missing" if path is None else f"{path} is missing"
    content, (expected, _, size) = path.read_bytes(), given.removeprefix("sha256:").partition(", ")
    if hashlib.sha256(content).hexdigest() == expected:
        return ""
    stated = int(size.split()[0]) if size else None
    if stated is not None and len(content) < stated:
        return f"{path} is cut short: it has {len(content)} of {stated} bytes"
    return f"{path} differs from the file of this case: another sum; expected sha256 {expected[:12]}..."


def prepare(validation: Validation, data: Path | None, folder: Path) -> None:
    """Copy the files of a validation into its working folder, and make its tables there.

    Raises FvsolveError if a table cannot be made.
    """
    for name in validation.files:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(data / name, folder / name)
    if validation.profile is not None:
        write_profile(validation.profile, folder)
    for name, table in ((name, dict(table)) for name, table in validation.tables.items()):
        write_table(folder / name, derived_table(folder / table.pop("of"), **table))


def write_profile(given: Mapping[str, Any], folder: Path) -> None:
    """Write exact fields at the start as points of x, y and value: exact-bed.csv, exact-level.csv, exact-u.csv.

    given : table `profile` of a validation, with the `length` of the basin [m]; nothing is written without a length
    """
    if "length" not in given:
        return
    x = np.linspace(0.0, float(given["length"]), PROFILE_POINTS)
    flow = measures.profile(given, x, 0.0)
    for name, unit, values in (
        ("bed", "m", flow.bed),
        ("level", "m", flow.surface),
        ("u", "m/s", flow.u),
    ):
        rows = {
            "x [m]": np.tile(x, 2),
            "y [m]": np.repeat([0.0, PROFILE_WIDTH], len(x)),
            f"{name} [{unit}]": np.tile(values, 2),
        }
        write_table(folder / f"exact-{name}.csv", rows)


def derived_table(
    path: Path, skip: int, columns: Mapping[str, str], matrix: bool, every: int, where: str
) -> dict[str, np.ndarray]:
    """Columns of a table made from a text file : header -> float64[n].

    skip : number of lines before the rows; columns : header -> formula of the columns c1, c2, ... of the file
    matrix : True if the file is a matrix; then c1, c2 are the indices of an entry and c3 is the entry, of which every
    `every`-th row and column counts; where : condition for a row to count, "" for none
    `integral(F)` is the integral of F over the first made column, by trapezoids. Rows in which a used column is not a
    number are left out. Raises FvsolveError for an invalid formula, or if no row is left.
    """
    lines = read_lines(path)[skip:]
    cells = [
        _SEPARATOR.split(line.strip())
        for line in lines
        if line.strip() and not line.startswith("#")
    ]
    if matrix:
        cells = [
            [str(i), str(j), row[j]]
            for i, row in enumerate(cells)
            for j in range(0, len(row), every)
            if i % every == 0
        ]
    names = tuple(f"c{k + 1}" for k in range(max(map(len, cells), default=0)))
    formulas = {
        header: formula_of(text, names, f"{path.name}, column {header}")
        for header, text in columns.items()
    }
    condition = formula_of(where or "1", names, f"{path.name}, where")[0]
    used = sorted(
        {
            int(step.rule[1:]) - 1
            for formula in (condition, *(pair[0] for pair in formulas.values()))
            for step in formula.steps
            if step.count == 0 and step.rule in names
        }
    )
    numbers = [[number(row[k]) if k < len(row) else None for k in used] for row in cells]
    rows = np.array([row for row in numbers if None not in row], float).reshape(-1, len(used))
    if not len(rows):
        raise FvsolveError(
            f"{path.name}: no row has numbers in columns {', '.join(names[k] for k in used)}"
        )
    known = {names[k]: rows[:, j] for j, k in enumerate(used)}
    counts = condition.evaluate(known)[0] != 0.0
    known = {name: column[counts] for name, column in known.items()}
    result: dict[str, np.ndarray] = {}
    for header, (formula, integrated) in formulas.items():
        values = np.array(formula.evaluate(known)[0], float)
        if integrated:
            steps = np.diff(next(iter(result.values())))
            values = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * steps)])
        result[header] = values
    return in_order(result)


def formula_of(text: str, names: tuple[str, ...], place: str) -> tuple[Arithmetic, bool]:
    """(formula, True if it is integrated) of a column. Raises FvsolveError, which names the place."""
    match = _INTEGRAL.fullmatch(text)
    try:
        return Arithmetic(match[1] if match else text, names=(*names, "pi")), match is not None
    except ValueError as error:
        raise FvsolveError(f"{place}: {error}") from None


def in_order(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Rows of a table sorted by its first column; of rows with equal first values the first is kept.

    Digitised points are not always in order of time.
    """
    first = next(iter(columns.values()))
    if np.all(np.diff(first) > 0.0):
        return columns
    if not any(header.partition(" ")[0] in ("t", "time") for header in list(columns)[:1]):
        return columns
    _, order = np.unique(first, return_index=True)
    return {header: values[order] for header, values in columns.items()}


def read_lines(path: Path) -> list[str]:
    """Lines of a text file, also of one packed by gzip. Raises FvsolveError if it is not text."""
    try:
        content = path.read_bytes()
        return (
            (gzip.decompress(content) if path.suffix == ".gz" else content)
            .decode("utf-8-sig")
            .splitlines()
        )
    except (OSError, UnicodeDecodeError) as error:
        raise FvsolveError(f"{path.name} cannot be read: {error}") from None


def write_table(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns as a CSV file with a header."""
    rows = np.column_stack(list(columns.values()))
    path.parent.mkdir(parents=True, exist_ok=True)
    text = "\n".join(",".join(f"{value:.12g}" for value in row) for row in rows)
    path.write_text(f"{','.join(columns)}\n{text}\n", encoding="utf-8")


def completed(table: dict[str, Any], validation: Validation, folder: Path) -> dict[str, Any]:
    """Tables of a case, completed by those of a shipped case or of an EPANET network if it names one."""
    if validation.case is not None:
        path = shipped.find(validation.case)
        for used in load(path).files:
            shutil.copyfile(used, folder / Path(used).name)
        return merged(read_raw(path).table, table)
    if validation.network is None:
        return table
    from fvsolve.exchange.epanet import import_network

    given = validation.network
    keys = {key: given[key] for key in ("hour", "wave_speed") if given.get(key) is not None}
    imported = tomllib.loads(import_network(network_path(given["inp"], folder), **keys).text)
    return merged(imported, table)


def network_path(name: str, folder: Path) -> Path:
    """Path of an EPANET file in the working folder, or of a network that WNTR ships, such as "Net3"."""
    if (folder / name).is_file():
        return folder / name
    from fvsolve.exchange.epanet.network_file import wntr_folder

    return wntr_folder() / "library" / "networks" / f"{name}.inp"


def merged(base: dict[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Nested dicts of `base` with the keys of `over`; tables are merged, all other values are replaced."""
    result = dict(base)
    for key, value in over.items():
        both = isinstance(value, dict) and isinstance(result.get(key), dict)
        result[key] = merged(result[key], value) if both else value
    return result
