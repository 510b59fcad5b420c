"""Two columns of a CSV file. Knows headers and the units in them; knows not what the columns are for."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np

from fvsolve import units
from fvsolve.errors import did_you_mean
from fvsolve.parts.value import Setting
from fvsolve.units import show


def find_file(name: str, setting: Setting) -> Path:
    """The file `name`, relative to the case, noted in the setting's files. ValueError where there is none."""
    path = Path(name)
    if not path.is_absolute():
        path = (setting.folder or Path.cwd()) / path
    try:
        if not path.is_file():
            near = did_you_mean(path.name, _neighbours(path))
            what = "is a directory" if path.is_dir() else "there is no such file"
            raise ValueError(f"{show(name)}: {what}{near}; a path is relative to the case file")
    except OSError as error:
        raise ValueError(f"{show(name)}: {error.strerror}") from None
    setting.files.setdefault(copy_name(path, setting), path)
    return path


def copy_name(path: Path, setting: Setting) -> str:
    """The name under which a file is kept beside the resolved case: its own, numbered if another has it."""
    name, number = path.name, 2
    while setting.files.get(name, path) != path:
        name, number = f"{path.stem}-{number}{path.suffix}", number + 1
    return name


def read_columns(
    path: Path, time: str | None, value: str | None, dimension: str, setting: Setting
) -> tuple[np.ndarray, np.ndarray, str, str]:
    """Time [s] and value [SI, pressures absolute] : float64[n] and their headers.

    `time` and `value` name columns by header, with or without the unit; None is the first and the second.
    Raises ValueError with the line of the file where one is at fault.
    """
    header, rows = read_rows(path)
    time_column, value_column = _column(header, time, 0, path), _column(header, value, 1, path)
    t = _numbers(rows, time_column, header, "time", path, setting)
    v = _numbers(rows, value_column, header, dimension, path, setting)
    return t, v, header[time_column], header[value_column]


def _neighbours(path: Path) -> list[str]:
    return [other.name for other in path.parent.iterdir()] if path.parent.is_dir() else []


def read_rows(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The header, and of each row its line and its cells; ValueError where there is neither."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{path.name} is not UTF-8 text") from None
    except OSError as error:
        raise ValueError(f"{path.name}: {error.strerror}") from None
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and line[0] != "#"]
    if len(lines) < 2:
        raise ValueError(f"{path.name} is empty; wanted a header and rows of numbers")
    mark = next((mark for mark in (",", ";", "\t") if mark in lines[0][1]), ",")
    try:
        rows = [(n, next(csv.reader([line], delimiter=mark))) for n, line in lines]
    except csv.Error as error:
        raise ValueError(f"{path.name}: {error}") from None
    header = [name.strip() for name in rows[0][1]]
    if all(_is_number(name) for name in header):
        raise ValueError(f'{path.name} has no header; wanted one such as "t [s],opening [-]"')
    return header, rows[1:]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _column(header: list[str], name: str | None, default: int, path: Path) -> int:
    if name is None:
        if len(header) <= default:
            raise ValueError(f"{path.name} has one column; wanted a time and a value")
        return default
    if name in header:
        return header.index(name)
    bare = [_split(one)[0] for one in header]
    if bare.count(name) == 1:
        return bare.index(name)
    hint = did_you_mean(name, header)
    raise ValueError(f"{path.name} has no column {show(name)}{hint}; columns are {', '.join(map(show, header))}")


def _split(header: str) -> tuple[str, str]:
    match = re.fullmatch(r"(.*?)\s*\[(.*)\]", header)
    return (match[1], match[2]) if match else (header, "")


def _numbers(
    rows: list[tuple[int, list[str]]],
    column: int,
    header: list[str],
    dimension: str,
    path: Path,
    setting: Setting,
) -> np.ndarray:
    unit = _split(header[column])[1]
    try:
        found = units.find(unit, dimension) if unit else None
    except ValueError as error:
        raise ValueError(f"{path.name}, column {show(header[column])}: {error}") from None
    values = np.empty(len(rows))
    for index, (line, row) in enumerate(rows):
        text = row[column].strip() if column < len(row) else ""
        if not _is_number(text) or not np.isfinite(float(text)):
            raise ValueError(f"{path.name}, line {line}: {show(text)} is no number in column {show(header[column])}")
        values[index] = float(text)
    if found is not None:
        values = found.si(values)
        if found.gauge and dimension == "pressure":
            values = values + setting.ambient
    return values
