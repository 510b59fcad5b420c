"""Time series of a case, read from CSV files."""

from pathlib import Path

import numpy as np

from fvsolve.errors import did_you_mean
from fvsolve.parts.csv_rows import read_rows
from fvsolve.parts.value import ReadContext
from fvsolve.units import show


def find_file(name: str, setting: ReadContext) -> Path:
    """Path of a file whose name is relative to the case; add the file to those of the context.

    Raises ValueError if it is missing.
    """
    setting.lookups += 1
    path = Path(name)
    if not path.is_absolute():
        path = (setting.folder or Path.cwd()) / path
    try:
        if not path.is_file():
            near = did_you_mean(path.name, _neighbours(path))
            state = "is a directory, not a file" if path.is_dir() else "there is no such file"
            raise ValueError(f"{show(name)}: {state}{near}; a relative path starts at the folder of the case file")
    except OSError as error:
        raise ValueError(f"{show(name)}: {error.strerror}") from None
    setting.files.setdefault(copy_name(path, setting), path)
    return path


def copy_name(path: Path, setting: ReadContext) -> str:
    """Name of the copy of a file beside the resolved case: its own name, numbered if another file has it."""
    name, number = path.name, 2
    while setting.files.get(name, path) != path:
        name, number = f"{path.stem}-{number}{path.suffix}", number + 1
    return name


def read_columns(
    path: Path, time: str | None, value: str | None, dimension: str, setting: ReadContext
) -> tuple[np.ndarray, np.ndarray, str, str]:
    """(times [s], values [SI, pressures absolute], header of the times, header of the values) of a CSV file.

    Times and values are float64[n].
    time, value : headers of the columns, with or without unit; None for the first and the second column
    Raises ValueError with the faulty line of the file.
    """
    rows = read_rows(path)
    time_column, value_column = rows.column(time, 0), rows.column(value, 1)
    t, v = rows.numbers(time_column, "time"), rows.numbers(value_column, dimension, setting.ambient)
    return t, v, rows.header[time_column], rows.header[value_column]


def _neighbours(path: Path) -> list[str]:
    return [other.name for other in path.parent.iterdir()] if path.parent.is_dir() else []
