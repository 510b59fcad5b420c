"""Files of greatest values of a run: maxima-BASIN.vtu with the cells of a basin, run_up-NAME.csv with a run-up."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from fvsolve.core.output.csv_files import csv_quoted
from fvsolve.core.output.fields import (
    basin_geometry,
    grid_xml,
    reference_xml,
    split_blocks,
    write_frame,
)
from fvsolve.core.output.unit_columns import UnitColumn, column, to_column_units
from fvsolve.errors import RunError
from fvsolve.file_replacement import write_file


def write_maxima(folder: Path, model, maxima: dict[str, dict[str, np.ndarray]]) -> None:
    """Write maxima-BASIN.vtu of each basin. maxima : basin -> quantity -> float64[n] in SI"""
    for basin in model.meshed:
        if basin.name in maxima:
            points, cells = basin_geometry(basin, np.array(basin.part.position or (0.0, 0.0)))
            blocks = {
                key: split_blocks(values, cells) for key, values in maxima[basin.name].items()
            }
            grid = grid_xml(points, cells, reference_xml(basin))
            write_frame(folder / f"maxima-{basin.name}.vtu", grid, blocks, basin.units_of_maxima)


def read_maxima(paths: Iterable[Path]) -> dict[str, dict[str, np.ndarray]]:
    """Read files maxima-BASIN.vtu: basin -> quantity -> float64[n]; raises RunError if unreadable."""
    from meshio import vtu  # meshio.read would print and exit on a damaged file

    maxima = {}
    for path in paths:
        try:
            data = vtu.read(str(path)).cell_data
        except Exception as error:  # meshio and its parsers raise many types on a damaged file
            text = f"{type(error).__name__}: {error}"
            raise RunError(f"{path} cannot be read ({text}); run again with --force") from None
        maxima[path.stem.removeprefix("maxima-")] = {
            key: np.concatenate(blocks) for key, blocks in data.items()
        }
    return maxima


def write_run_up(path: Path, table, case) -> None:
    """Write run_up-NAME.csv with a row for each sector: its angle or distance, its run-up, the position of the cell.

    table : `RunUpTable`
    """
    first = (
        UnitColumn("angle", "number", "deg")
        if table.along == "angle"
        else column("distance", "length", case)
    )
    columns = [
        first,
        column("run_up", "length", case),
        column("x", "position", case),
        column("y", "position", case),
    ]
    rows = to_column_units(
        columns, np.column_stack([table.places, table.run_up, table.points])
    ).tolist()
    lines = [
        ",".join(csv_quoted(item.header) for item in columns),
        *(",".join(map(repr, row)) for row in rows),
    ]
    write_file(path, "\n".join(lines) + "\n")
