"""envelope.csv: what each cell of each pipe has met, least and greatest. Knows columns; knows no solver."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from fvsolve.errors import RunError
from fvsolve.output.column import UnitColumn, column, split_header

QUANTITIES = {
    "distance": "length",
    "elevation": "head",
    "initial_head": "head",
    "least_pressure": "pressure",
    "t_least": "time",
    "greatest_pressure": "pressure",
    "t_greatest": "time",
    "least_head": "head",
    "greatest_head": "head",
}


def envelope_columns(case) -> list[UnitColumn]:
    """The columns of envelope.csv after `pipe`, in the units that the case asks for."""
    return [column(name, dimension, case) for name, dimension in QUANTITIES.items()]


def with_start(summary, model) -> dict:
    """The envelope of a solver, cells and what is watched between them by distance, with the heads that the run began
    from, `initial_head` [m]."""
    found = {}
    for k, pipe in enumerate(model.pipes):
        one = {**summary.envelope[pipe.name], "initial_pressure": model.cell_pressure(k, np.zeros(pipe.cells))}
        if (points := summary.points.get(pipe.name)) is not None:
            one = {key: np.concatenate([values, points[key]]) for key, values in one.items()}
            order = np.argsort(one["distance"], kind="stable")
            one = {key: values[order] for key, values in one.items()}
        one["initial_head"] = model.head(one.pop("initial_pressure"), one["elevation"])
        found[pipe.name] = one
    return found


def in_units(envelope: dict, case) -> dict:
    """An envelope in SI in the units of envelope.csv."""
    columns = envelope_columns(case)
    return {pipe: {one.name: np.asarray(one.from_si(np.asarray(arrays[one.name], float))) for one in columns}
            for pipe, arrays in envelope.items()}  # fmt: skip


def write_envelope(path: Path, envelope: dict, case) -> None:
    """One row per cell: pipe, distance from `from`, elevation, extremes and their times.

    `envelope` maps a pipe to `float64[cells]` arrays named as in `QUANTITIES`, in units of the columns.
    """
    columns = envelope_columns(case)
    with open(path, "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["pipe", *(one.header for one in columns)])
        for pipe, arrays in envelope.items():
            values = [arrays[one.name].tolist() for one in columns]
            table.writerows([pipe, *map(repr, row)] for row in zip(*values, strict=True))


def read_envelope(path: Path) -> dict:
    """Pipe -> quantity -> float64[cells] as the file has them."""
    pipes: dict[str, list] = {}
    try:
        with open(path, encoding="utf-8", newline="") as file:
            rows = csv.reader(file)
            names = [split_header(header)[0] for header in next(rows, [])]
            for row in rows:
                pipes.setdefault(row[0], []).append([float(text) for text in row[1:]])
        return {pipe: dict(zip(names[1:], np.array(values).T, strict=True)) for pipe, values in pipes.items()}
    except (OSError, ValueError, IndexError, csv.Error) as error:
        raise RunError(f"{path} cannot be read: {getattr(error, 'strerror', error)}") from None
