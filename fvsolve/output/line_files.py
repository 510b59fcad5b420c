"""lines/NAME-000012.csv: fields of a basin along a straight line, one file for each frame (output time)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from fvsolve.errors import RunError
from fvsolve.output.history_file import csv_quoted
from fvsolve.output.unit_columns import column, to_column_units

VELOCITY_AXES = {"u": 0, "v": 1}  # of velocities
LINE_FILE = re.compile(r"(.+)-(\d{6,})\.csv")


class LineSeries:
    """Writer of a .csv file for each line and frame, numbered like the frames of fields.pvd."""

    def __init__(self, folder: Path, model):
        self.folder = folder / "lines"
        basins = {basin.name: basin for basin in model.basins}
        self.lines = {name: LineSampler(line, basins[line.basin], model.case)
                      for name, line in model.case.output.lines.items()}  # fmt: skip

    def start(self) -> None:
        """Create the folder of the files of a new run."""
        self.folder.mkdir(exist_ok=True)

    def continue_from(self, frames: int) -> None:
        """Keep the first `frames` frames of every line and delete later frames, to continue from a checkpoint.

        Raises RunError if frames are missing.
        """
        for name in self.lines:
            if frames and not self.path(name, frames - 1).is_file():
                raise RunError(f"{self.folder}: frames of {name} are missing; start the run again with --force")
        self.folder.mkdir(exist_ok=True)
        clear_lines(self.folder.parent, frames)

    def write(self, number: int, frame: dict) -> None:
        """Write the files of all lines for the frame `number`. frame : basin -> field -> values of cells in SI"""
        for name, line in self.lines.items():
            self.path(name, number).write_bytes(line.text(frame[line.basin]).encode())

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
        read = [basin.points.cell_weights(*p) if basin.points.cell(*p) >= 0 else (np.zeros(0, int), np.zeros(0))
                for p in points]  # fmt: skip
        self.cells, self.weights = (np.concatenate([sample[k] for sample in read]) for k in (0, 1))
        self.row = np.repeat(np.arange(line.points), [sample[0].size for sample in read])
        self.in_hole = np.array([sample[0].size == 0 for sample in read])
        self.columns = [column("distance", "length", case), *(column(name, "position", case) for name in ("x", "y"))]
        self.columns += [column(name, dimension, case) for name, dimension in fields.items()]
        labels = {name: scalar.unit for name, scalar in case.scalars.items()} if basin.scalars else {}
        self.columns += [column(name, "number", case, label) for name, label in labels.items()]

    def text(self, fields: dict[str, np.ndarray]) -> str:
        """CSV text of a frame: a row of position and fields for each point. fields : name -> values of cells in SI"""
        values = np.column_stack([self.places, *(self.along(column.name, fields) for column in self.columns[3:])])
        rows = [",".join(map(repr, row)) for row in to_column_units(self.columns, values).tolist()]
        return "\n".join([",".join(csv_quoted(column.header) for column in self.columns), *rows]) + "\n"

    def along(self, name: str, fields: dict[str, np.ndarray]) -> np.ndarray:
        """Values of a field at the points of the line, NaN in holes : float64[points]."""
        if name == "speed":
            return np.hypot(self.along("u", fields), self.along("v", fields))
        cells = fields["velocity"][:, VELOCITY_AXES[name]] if name in VELOCITY_AXES else fields[name]
        values = np.bincount(self.row, self.weights * cells[self.cells], self.in_hole.size)
        return np.where(self.in_hole, np.nan, values)


def clear_lines(folder: Path, frames: int = 0) -> None:
    """Delete files of lines with frame numbers of at least `frames`."""
    for path in (folder / "lines").glob("*.csv"):
        match = LINE_FILE.fullmatch(path.name)
        if match and int(match[2]) >= frames:
            path.unlink()
