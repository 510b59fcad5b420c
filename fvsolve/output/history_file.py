"""history.csv: probe values over time, written row by row."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fvsolve.errors import RunError
from fvsolve.output.unit_columns import UnitColumn, split_header, to_column_units


class HistoryFile:
    """CSV file to which rows are appended; numbers are written with all digits, so that they are read back exactly."""

    def __init__(self, path: Path, time: UnitColumn, columns: list[UnitColumn]):
        self.path = path
        self.time = time
        self.columns = columns
        self.rows = 0
        self._file = None

    def start(self) -> None:
        """Start an empty file with its header."""
        self._file = open(self.path, "wb")
        headers = ",".join(csv_quoted(column.header) for column in [self.time, *self.columns])
        self._file.write(f"{headers}\n".encode())

    def continue_from(self, rows: int, size: int) -> None:
        """Open the file to continue from a checkpoint, at which it had `rows` rows and `size` bytes.

        Later rows are cut off. Raises RunError if the file is missing or shorter.
        """
        if not self.path.is_file() or self.path.stat().st_size < size:
            raise RunError(
                f"{self.path} is missing or shorter than at its checkpoint; start the run again with --force"
            )
        self._file = open(self.path, "r+b")
        self._file.truncate(size)
        self._file.seek(size)
        self.rows = rows

    def write(self, t: np.ndarray, values: np.ndarray) -> None:
        """Append rows. t : float64[k] [s]; values : float64[k, n] in SI"""
        times = self.time.from_si(t).tolist()
        table = to_column_units(self.columns, values).tolist()
        lines = [",".join(map(repr, [time, *row])) for time, row in zip(times, table, strict=True)]
        if lines:
            self._file.write(("\n".join(lines) + "\n").encode())
            self.rows += len(lines)

    def flush(self) -> int:
        """Flush all rows to the operating system; returns the size of the file [bytes]."""
        self._file.flush()
        return self._file.tell()

    def close(self) -> None:
        """Close the file; has no effect if it is already closed."""
        if self._file is not None:
            file, self._file = self._file, None
            file.close()


def read_headers(path: Path) -> list[tuple[str, str]]:
    """Name and unit of every column of a table, `t` first; raises RunError if the file cannot be read."""
    import csv

    try:
        with open(path, encoding="utf-8", newline="") as file:
            return [split_header(header) for header in next(csv.reader(file), [])]
    except OSError as error:
        raise RunError(f"{path}: {error.strerror}; expected a run directory with this file") from None


def read_table(path: Path) -> np.ndarray:
    """All rows of a table without its header : float64[k, columns]; raises RunError if it cannot be read."""
    names = len(read_headers(path))
    with open(path, encoding="utf-8") as file:
        file.readline()
        try:
            table = np.loadtxt(file, delimiter=",", ndmin=2)
        except ValueError:
            text = f"a row does not have {names} numbers; the file was truncated or edited; run again with --force"
            raise RunError(f"{path} cannot be read: {text}") from None
    if table.size and table.shape[1] != names:
        raise RunError(
            f"{path} cannot be read: rows have {table.shape[1]} numbers, the header has {names} columns; "
            "run again with --force"
        )
    return table if table.size else np.empty((0, names))


def csv_quoted(text: str) -> str:
    """Text of a CSV field, in quotes if it contains a comma, a quote or a line break."""
    return '"' + text.replace('"', '""') + '"' if any(sign in text for sign in ',"\n') else text
