"""CSV files of a run: history.csv, envelope.csv, routes.csv, and lines/NAME-000012.csv along lines in basins."""

import csv
import re
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.case.pipe_routes import legs
from fvsolve.core.output.unit_columns import UnitColumn, column, split_header, to_column_units
from fvsolve.errors import RunError
from fvsolve.file_replacement import replacing, write_file

ENVELOPE_QUANTITIES = {
    "distance": "length",
    "elevation": "head",
    "initial_head": "head",
    "min_pressure": "pressure",
    "t_min": "time",
    "max_pressure": "pressure",
    "t_max": "time",
    "min_head": "head",
    "max_head": "head",
}
VELOCITY_AXES = {"u": 0, "v": 1}  # of velocities
BLOCK, LONGEST_LINE = 2**20, 2**24  # bytes that are read at once, and greatest length of a row
DATES = "time"  # header of the column of dates, which has no unit
DATED_EXTREMES = {"time_min": "t_min", "time_max": "t_max"}  # columns of dates -> their times
LATEST = 1e100  # limit of times, in any unit
LINE_FILE = re.compile(r"(.+)-(\d{6,})\.csv")


class HistoryFile:
    """CSV file to which rows are appended; numbers are written with all digits, so that they are read back exactly.

    start : instant of t = 0 (`StartTime`); with it, dates stand in the second column, `time`
    """

    def __init__(self, path: Path, time: UnitColumn, columns: list[UnitColumn], start: Any = None):
        self.path = path
        self.time = time
        self.columns = columns
        self.start_time = start
        self.rows = 0
        self._file = None

    def start(self) -> None:
        """Start an empty file with its header."""
        self._file = open(self.path, "wb")
        first, *headers = [csv_quoted(column.header) for column in [self.time, *self.columns]]
        dates = [] if self.start_time is None else [DATES]
        self._file.write((",".join([first, *dates, *headers]) + "\n").encode())

    def refuse_unfit(self, rows: int, size: int, t: float) -> None:
        """Raise RunError if the file has not `rows` rows in its first `size` bytes, up to the time `t` [s]."""
        if not self.path.is_file() or self.path.stat().st_size < size:
            text = "is missing or shorter than at its checkpoint; start the run again with --force"
            raise RunError(f"{self.path} {text}")
        lines, last = lines_of(self.path, size)
        if lines != rows + 1 or (rows and not is_row_until(last, self.time, t)):
            text = (
                f"its rows do not fit the checkpoint ({rows} rows up to t = {t:.6g} s in {size} B)"
            )
            raise RunError(f"{self.path}: {text}; start the run again with --force")

    def continue_from(self, rows: int, size: int) -> None:
        """Open the file to continue from a checkpoint, at which it had `rows` rows and `size` bytes.

        Later rows are cut off.
        """
        self._file = open(self.path, "r+b")
        self._file.truncate(size)
        self._file.seek(size)
        self.rows = rows

    def write(self, t: np.ndarray, values: np.ndarray) -> None:
        """Append rows. t : float64[k] [s]; values : float64[k, n] in SI"""
        times = self.time.from_si(t).tolist()
        table = to_column_units(self.columns, values).tolist()
        firsts = map(repr, times)
        if self.start_time is not None:
            dates = self.start_time.texts(t)
            firsts = [f"{first},{date}" for first, date in zip(firsts, dates, strict=True)]
        lines = [
            ",".join([first, *map(repr, row)]) for first, row in zip(firsts, table, strict=True)
        ]
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


def lines_of(path: Path, size: int) -> tuple[int, str]:
    """Number of complete lines in the first `size` bytes of a file, and the last of them; 0 if they end in a line."""
    count, last = 0, b""
    with open(path, "rb") as file:
        while size > 0 and (block := file.read(min(size, BLOCK))):
            size -= len(block)
            count += block.count(b"\n")
            last = (last + block)[-LONGEST_LINE:]
    if not last.endswith(b"\n"):
        return 0, ""
    return count, last[:-1].rpartition(b"\n")[2].decode("utf-8", "replace")


def is_row_until(line: str, time: UnitColumn, t: float) -> bool:
    """True if the first number of a row is a time not after `t` [s]."""
    try:
        row_time = float(time.to_si(float(line.partition(",")[0])))
    except ValueError:
        return False
    return row_time <= t + 1e-9 * abs(t)


def read_headers(path: Path) -> list[tuple[str, str]]:
    """Name and unit of every column of a table, `t` first; raises RunError if the file cannot be read."""
    try:
        with open(path, encoding="utf-8", newline="") as file:
            return [split_header(header) for header in next(csv.reader(file), [])]
    except OSError as error:
        raise RunError(
            f"{path}: {error.strerror}; expected a run directory with this file"
        ) from None
    except (ValueError, csv.Error) as error:
        text = f"its header is damaged ({error}); run again with --force"
        raise RunError(f"{path} cannot be read: {text}") from None


def read_table(path: Path) -> np.ndarray:
    """All rows of a table without its header and without dates : float64[k, columns].

    Raises RunError if it cannot be read.
    """
    headers = [name for name, unit in read_headers(path)]
    dated = headers[1:2] == [DATES]
    names = len(headers)
    with open(path, encoding="utf-8") as file:
        file.readline()
        start = file.tell()
        if not file.read(1):  # no rows
            return np.empty((0, names - dated))
        file.seek(start)
        try:
            skipped = {1: lambda date: 0.0} if dated else None
            table = np.loadtxt(file, delimiter=",", ndmin=2, converters=skipped)
        except ValueError:
            text = f"a row does not have {names} numbers; the file was truncated or edited; run again with --force"
            raise RunError(f"{path} cannot be read: {text}") from None
    if table.size and table.shape[1] != names:
        text = f"rows have {table.shape[1]} numbers, the header has {names} columns; run again with --force"
        raise RunError(f"{path} cannot be read: {text}")
    if table.size and not (np.diff(table[:, 0], prepend=-LATEST, append=LATEST) >= 0.0).all():
        raise RunError(
            f"{path} cannot be read: its times are not numbers in rising order; run again with --force"
        )
    if dated:
        table = np.delete(table, 1, axis=1)
    return table if table.size else np.empty((0, names - dated))


def csv_quoted(text: str) -> str:
    """Text of a CSV field, in quotes if it contains a comma, a quote or a line break."""
    return '"' + text.replace('"', '""') + '"' if any(sign in text for sign in ',"\n') else text


def envelope_columns(case) -> list[UnitColumn]:
    """Columns of envelope.csv after `pipe`, in the units of the case."""
    return [column(name, dimension, case) for name, dimension in ENVELOPE_QUANTITIES.items()]


def with_points(summary, pipe: str, arrays: dict) -> dict:
    """Envelope of a pipe at its cells (`arrays`) and at observed points between cells, sorted by distance."""
    points = summary.points.get(pipe)
    if points is None:
        return arrays
    order = np.argsort(np.concatenate([arrays["distance"], points["distance"]]), kind="stable")
    return {key: np.concatenate([values, points[key]])[order] for key, values in arrays.items()}


def with_initial_heads(summary, model) -> dict:
    """Envelope of each pipe in SI, with the heads at the start as `initial_head` [m].

    Cells, and observed points between cells, are sorted by their distance along the pipe.
    """
    envelopes = {}
    for k, pipe in enumerate(model.pipes):
        cells = {
            **summary.envelope[pipe.name],
            "initial_pressure": model.cell_pressure(k, np.zeros(pipe.cells)),
        }
        arrays = with_points(summary, pipe.name, cells)
        arrays["initial_head"] = model.head(arrays.pop("initial_pressure"), arrays["elevation"])
        envelopes[pipe.name] = arrays
    return envelopes


def envelope_in_units(envelope: dict, case) -> dict:
    """Convert an envelope from SI to the units of envelope.csv."""
    columns = envelope_columns(case)
    return {
        pipe: {
            col.name: np.asarray(col.from_si(np.asarray(arrays[col.name], float)))
            for col in columns
        }
        for pipe, arrays in envelope.items()
    }


def write_envelope(path: Path, envelope: dict, case) -> None:
    """Write envelope.csv with a row for each cell: pipe, distance from its `from` end, elevation, extremes, times.

    envelope : pipe -> name as in `ENVELOPE_QUANTITIES` -> float64[cells] in the units of the columns
    """
    columns = envelope_columns(case)
    start = case.numerics.start_time
    with replacing(path) as fresh, open(fresh, "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        dated = [] if start is None else DATED_EXTREMES
        table.writerow(["pipe", *(col.header for col in columns), *dated])
        for pipe, arrays in envelope.items():
            values = [map(repr, arrays[col.name].tolist()) for col in columns]
            values += extreme_dates(arrays, columns, start)
            table.writerows([pipe, *row] for row in zip(*values, strict=True))


def extreme_dates(arrays: dict, columns: list[UnitColumn], start: Any) -> list[list[str]]:
    """Dates of the extremes in the order of `DATED_EXTREMES`; [] without a start time (`start` is None).

    arrays : quantity -> float64[cells] in the units of the columns
    """
    if start is None:
        return []
    known = {col.name: col for col in columns}
    return [start.texts(known[key].to_si(arrays[key])) for key in DATED_EXTREMES.values()]


def read_envelope(path: Path) -> dict:
    """Read envelope.csv: pipe -> quantity -> float64[cells] in the units of the file; raises RunError if unreadable."""
    pipes: dict[str, list] = {}
    try:
        with open(path, encoding="utf-8", newline="") as file:
            rows = csv.reader(file)
            names = [split_header(header)[0] for header in next(rows, [])]
            if dated := [name for name in names if name in DATED_EXTREMES]:
                names = names[: -len(dated)]
            for row in rows:
                numbers = row[1 : len(row) - len(dated)]
                pipes.setdefault(row[0], []).append([float(text) for text in numbers])
        tables = {
            pipe: dict(zip(names[1:], np.array(values).T, strict=True))
            for pipe, values in pipes.items()
        }
        for pipe, arrays in tables.items():
            if not all(
                np.isfinite(arrays[name]).all()
                for name in ("distance", "elevation")
                if name in arrays
            ):
                raise ValueError(
                    f"a distance or an elevation of {pipe} is not finite; run again with --force"
                )
        return tables
    except (OSError, ValueError, IndexError, csv.Error) as error:
        raise RunError(f"{path} cannot be read: {getattr(error, 'strerror', error)}") from None


def route_envelopes(envelope: dict, case) -> dict[str, dict[str, Any]]:
    """Envelopes along all routes: route -> "chainage", "pipe" or quantity -> array along the route.

    envelope : pipe -> quantity -> float64[cells]; both it and the result are in the units of envelope.csv
    """
    distances = column("distance", "length", case)
    return {
        name: joined_envelopes(envelope, legs(route, case.links), distances)
        for name, route in case.routes.items()
    }


def joined_envelopes(envelope: dict, route, distances) -> dict[str, Any]:
    """Envelopes of the pipes of a route in order: "chainage", "pipe" or quantity -> array along the route.

    Pipes followed backwards are reversed. distances : column with the unit of lengths
    """
    arrays: dict[str, list] = {"chainage": [], "pipe": []}
    for leg in route:
        turn = slice(None, None, -1) if leg.backwards else slice(None)
        pipe = {key: np.asarray(values)[turn] for key, values in envelope[leg.pipe].items()}
        arrays["chainage"].append(
            distances.from_si(leg.chainage(distances.to_si(pipe["distance"])))
        )
        arrays["pipe"].append(np.full(pipe["distance"].size, leg.pipe))
        for key, values in pipe.items():
            arrays.setdefault(key, []).append(values)
    return {key: np.concatenate(parts) for key, parts in arrays.items()}


def write_routes(path: Path, envelope: dict, case) -> None:
    """Write routes.csv with a row for each cell along each route. envelope : in the units of envelope.csv"""
    columns = envelope_columns(case)
    headers = [
        "route",
        column("chainage", "length", case).header,
        "pipe",
        *(item.header for item in columns),
    ]
    start = case.numerics.start_time
    headers += [] if start is None else DATED_EXTREMES
    with replacing(path) as fresh, open(fresh, "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(headers)
        for name, item in route_envelopes(envelope, case).items():
            values = [map(repr, item[key.name].tolist()) for key in columns]
            values = zip(*values, *extreme_dates(item, columns, start), strict=True)
            for chainage, pipe, row in zip(
                item["chainage"].tolist(), item["pipe"].tolist(), values, strict=True
            ):
                table.writerow([name, repr(chainage), pipe, *row])


class LineSeries:
    """Writer of a .csv file for each line and frame, numbered like the frames of fields.pvd."""

    def __init__(self, folder: Path, model):
        self.folder = folder / "lines"
        basins = {basin.name: basin for basin in model.meshed}
        self.lines = {
            name: LineSampler(line, basins[line.basin], model.case)
            for name, line in model.case.output.lines.items()
        }

    def start(self) -> None:
        """Create the folder of the files of a new run."""
        self.folder.mkdir(exist_ok=True)

    def continue_from(self, frames: int) -> None:
        """Keep the first `frames` frames of every line and delete later frames, to continue from a checkpoint.

        Raises RunError if frames are missing.
        """
        for name in self.lines:
            if frames and not self.path(name, frames - 1).is_file():
                raise RunError(
                    f"{self.folder}: frames of {name} are missing; start the run again with --force"
                )
        self.folder.mkdir(exist_ok=True)
        clear_lines(self.folder.parent, frames)

    def write(self, number: int, frame: dict) -> None:
        """Write the files of all lines for the frame `number`. frame : basin -> field -> values of cells in SI"""
        for name, line in self.lines.items():
            write_file(self.path(name, number), line.text(frame[line.basin]))

    def path(self, name: str, number: int) -> Path:
        """Path of the file of a line and frame."""
        return self.folder / f"{name}-{number:06d}.csv"


class LineSampler:
    """Points on a line in a basin, and the cells and weights that interpolate fields at each point.

    Points in holes of the mesh have no cells.
    """

    def __init__(self, line, basin, case) -> None:
        self.basin, fields = line.basin, basin.part.physics_type.fields
        share = np.linspace(0.0, 1.0, line.points)
        start, end = np.array(line.from_), np.array(line.to)
        points = start + share[:, None] * (end - start)
        self.places = np.column_stack([share * np.hypot(*(end - start)), points])
        read = [
            basin.points.cell_weights(*p)
            if basin.points.cell(*p) >= 0
            else (np.zeros(0, int), np.zeros(0))
            for p in points
        ]
        self.cells, self.weights = (np.concatenate([sample[k] for sample in read]) for k in (0, 1))
        self.row = np.repeat(np.arange(line.points), [sample[0].size for sample in read])
        self.in_hole = np.array([sample[0].size == 0 for sample in read])
        self.columns = [
            column("distance", "length", case),
            *(column(name, "position", case) for name in ("x", "y")),
        ]
        self.columns += [column(name, dimension, case) for name, dimension in fields.items()]
        labels = (
            {name: scalar.unit for name, scalar in case.scalars.items()} if basin.scalars else {}
        )
        self.columns += [column(name, "number", case, label) for name, label in labels.items()]

    def text(self, fields: dict[str, np.ndarray]) -> str:
        """CSV text of a frame: a row of position and fields for each point. fields : name -> values of cells in SI"""
        values = np.column_stack(
            [self.places, *(self.along(column.name, fields) for column in self.columns[3:])]
        )
        rows = [",".join(map(repr, row)) for row in to_column_units(self.columns, values).tolist()]
        return (
            "\n".join([",".join(csv_quoted(column.header) for column in self.columns), *rows])
            + "\n"
        )

    def along(self, name: str, fields: dict[str, np.ndarray]) -> np.ndarray:
        """Values of a field at the points of the line, NaN in holes : float64[points]."""
        if name == "speed":
            return np.hypot(self.along("u", fields), self.along("v", fields))
        cells = (
            fields["velocity"][:, VELOCITY_AXES[name]] if name in VELOCITY_AXES else fields[name]
        )
        values = np.bincount(self.row, self.weights * cells[self.cells], self.in_hole.size)
        return np.where(self.in_hole, np.nan, values)


def clear_lines(folder: Path, frames: int = 0) -> None:
    """Delete files of lines with frame numbers of at least `frames`."""
    for path in (folder / "lines").glob("*.csv"):
        match = LINE_FILE.fullmatch(path.name)
        if match and int(match[2]) >= frames:
            path.unlink()
