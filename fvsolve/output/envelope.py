"""envelope.csv: least and greatest pressure and head of each pipe cell, with their times."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from fvsolve.errors import RunError
from fvsolve.output.unit_columns import UnitColumn, column, split_header

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


def envelope_columns(case) -> list[UnitColumn]:
    """Columns of envelope.csv after `pipe`, in the units of the case."""
    return [column(name, dimension, case) for name, dimension in ENVELOPE_QUANTITIES.items()]


def with_initial_heads(summary, model) -> dict:
    """Envelope of each pipe in SI, with the heads at the start as `initial_head` [m].

    Cells, and observed points between cells, are sorted by their distance along the pipe.
    """
    envelopes = {}
    for k, pipe in enumerate(model.pipes):
        arrays = {**summary.envelope[pipe.name], "initial_pressure": model.cell_pressure(k, np.zeros(pipe.cells))}
        if (points := summary.points.get(pipe.name)) is not None:
            arrays = {key: np.concatenate([values, points[key]]) for key, values in arrays.items()}
            order = np.argsort(arrays["distance"], kind="stable")
            arrays = {key: values[order] for key, values in arrays.items()}
        arrays["initial_head"] = model.head(arrays.pop("initial_pressure"), arrays["elevation"])
        envelopes[pipe.name] = arrays
    return envelopes


def envelope_in_units(envelope: dict, case) -> dict:
    """Convert an envelope from SI to the units of envelope.csv."""
    columns = envelope_columns(case)
    return {pipe: {col.name: np.asarray(col.from_si(np.asarray(arrays[col.name], float))) for col in columns}
            for pipe, arrays in envelope.items()}  # fmt: skip


def write_envelope(path: Path, envelope: dict, case) -> None:
    """Write envelope.csv with a row for each cell: pipe, distance from its `from` end, elevation, extremes, times.

    envelope : pipe -> name as in `ENVELOPE_QUANTITIES` -> float64[cells] in the units of the columns
    """
    columns = envelope_columns(case)
    with open(path, "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["pipe", *(col.header for col in columns)])
        for pipe, arrays in envelope.items():
            values = [arrays[col.name].tolist() for col in columns]
            table.writerows([pipe, *map(repr, row)] for row in zip(*values, strict=True))


def read_envelope(path: Path) -> dict:
    """Read envelope.csv: pipe -> quantity -> float64[cells] in the units of the file; raises RunError if unreadable."""
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
