"""lines/NAME-000012.csv: the fields of a basin along a line, a file a frame. Knows meshes and columns; no physics."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from fvsolve.errors import RunError
from fvsolve.output.column import column, converted
from fvsolve.output.history import quoted

AXES = {"u": 0, "v": 1}  # of velocities
FILE = re.compile(r"(.+)-(\d{6,})\.csv")


class LineSeries:
    """Writes one .csv per line and frame, numbered as the frames of fields.pvd are."""

    def __init__(self, folder: Path, model):
        self.folder = folder / "lines"
        basins = {basin.name: basin for basin in model.basins}
        self.lines = {name: LineReading(line, basins[line.basin], model.case)
                      for name, line in model.case.output.lines.items()}  # fmt: skip

    def start(self) -> None:
        """Begin an empty series."""
        self.folder.mkdir(exist_ok=True)

    def continue_from(self, frames: int) -> None:
        """Keep the first `frames` of every line, drop what came after their checkpoint."""
        for name in self.lines:
            if frames and not self.path(name, frames - 1).is_file():
                raise RunError(f"{self.folder} lacks frames of {name}; start the run again with --force")
        self.folder.mkdir(exist_ok=True)
        clear_lines(self.folder.parent, frames)

    def write(self, number: int, frame: dict) -> None:
        """Add a frame: basin -> field -> values of cells, SI."""
        for name, line in self.lines.items():
            self.path(name, number).write_bytes(line.text(frame[line.basin]).encode())

    def path(self, name: str, number: int) -> Path:
        """Where a line is written."""
        return self.folder / f"{name}-{number:06d}.csv"


class LineReading:
    """Points on a line, and which cells are read there; nothing is in holes."""

    def __init__(self, said, basin, case) -> None:
        self.basin, fields = said.basin, basin.part.own.fields
        share = np.linspace(0.0, 1.0, said.points)
        start, end = np.array(said.from_), np.array(said.to)
        points = start + share[:, None] * (end - start)
        self.places = np.column_stack([share * np.hypot(*(end - start)), points])
        read = [basin.points.reading(*p) if basin.points.cell(*p) >= 0 else (np.zeros(0, int), np.zeros(0))
                for p in points]  # fmt: skip
        self.cells, self.weights = (np.concatenate([one[k] for one in read]) for k in (0, 1))
        self.row = np.repeat(np.arange(said.points), [one[0].size for one in read])
        self.lost = np.array([one[0].size == 0 for one in read])
        self.columns = [column("distance", "length", case), *(column(name, "position", case) for name in ("x", "y"))]
        self.columns += [column(name, dimension, case) for name, dimension in fields.items()]
        labels = {name: scalar.unit for name, scalar in case.scalars.items()} if basin.scalars else {}
        self.columns += [column(name, "number", case, label) for name, label in labels.items()]

    def text(self, fields: dict[str, np.ndarray]) -> str:
        """The file of a frame."""
        values = np.column_stack([self.places, *(self.along(one.name, fields) for one in self.columns[3:])])
        rows = [",".join(map(repr, row)) for row in converted(self.columns, values).tolist()]
        return "\n".join([",".join(quoted(one.header) for one in self.columns), *rows]) + "\n"

    def along(self, name: str, fields: dict[str, np.ndarray]) -> np.ndarray:
        """A field at the points, nan in holes : float64[points]."""
        if name == "speed":
            return np.hypot(self.along("u", fields), self.along("v", fields))
        cells = fields["velocity"][:, AXES[name]] if name in AXES else fields[name]
        found = np.bincount(self.row, self.weights * cells[self.cells], self.lost.size)
        return np.where(self.lost, np.nan, found)


def clear_lines(folder: Path, frames: int = 0) -> None:
    """Delete the files of lines from frame number `frames` on."""
    for path in (folder / "lines").glob("*.csv"):
        found = FILE.fullmatch(path.name)
        if found and int(found[2]) >= frames:
            path.unlink()
