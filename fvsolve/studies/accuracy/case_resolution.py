"""Pipes and basins of a case that have cells: numbers and sizes of cells, wave rates, order of the scheme."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from fvsolve.errors import CaseError, FvsolveError, listing
from fvsolve.model.delay_line_selection import line_methods
from fvsolve.parts import Basin, Pipe
from fvsolve.schemes import SCHEMES
from fvsolve.studies.accuracy.basin_projection import basin_fields
from fvsolve.studies.delay_line_keys import delay_lines
from fvsolve.studies.outcome import study_model

Counts = dict[str, tuple[int, ...]]  # dotted key -> numbers of cells: one of a pipe, two of a basin
BASIN_ORDER = 2  # order of `muscl`, which replaces all schemes that a basin does not have
JUMP_SHARE = 0.75  # a jump keeps at least this fraction of its greatest difference between neighbours on finer cells


def pipes(case) -> dict[str, Pipe]:
    """Pipes of a case, by name."""
    return {name: link for name, link in case.links.items() if isinstance(link, Pipe)}


def pipes_with_cells(case) -> dict[str, Pipe]:
    """Pipes with cells, by name: all pipes of a case that are not delay lines."""
    delayed = delay_lines(case)
    return {name: pipe for name, pipe in pipes(case).items() if name not in delayed}


def basins(case) -> dict[str, Basin]:
    """Basins of a case that have cells, by name."""
    return {name: case.nodes[name] for name in case.meshes}


def cell_counts(case) -> Counts:
    """Numbers of cells that a study can refine: of pipes that are not delay lines, and of rectangular basins.

    Returns dotted key, such as "links.main.cells" -> (cells,) of a pipe, or (cells along x, cells along y) of a basin.
    """
    numbers: Counts = {f"links.{name}.cells": (pipe.cells,) for name, pipe in pipes_with_cells(case).items()}
    return numbers | {f"nodes.{name}.cells": basin.cells for name, basin in basins(case).items() if basin.cells}


def basins_from_files(case) -> list[str]:
    """Names of the basins whose mesh is read from a file, so that it cannot be refined."""
    return [name for name, basin in basins(case).items() if basin.cells is None]


def cell_keys_of(cells_by_key: Counts) -> dict[str, Any]:
    """Overrides of a case that set these numbers of cells: dotted key -> number, or list of two numbers."""
    return {key: list(numbers) if len(numbers) > 1 else numbers[0] for key, numbers in cells_by_key.items()}


def scaled(cells_by_key: Counts, factor: float) -> Counts:
    """Numbers of cells multiplied by `factor` along every pipe and every side of a basin; at least 1."""
    return {key: tuple(max(1, round(n * factor)) for n in numbers) for key, numbers in cells_by_key.items()}


def total_cells(case, cells_by_key: Counts) -> int:
    """Total number of cells of a case with these numbers of cells, including basins whose mesh comes from a file.

    cells_by_key : as from `cell_counts`
    """
    fixed = sum(case.meshes[name].area.size for name in basins_from_files(case))
    return fixed + sum(part_cells(case, key, numbers) for key, numbers in cells_by_key.items())


def part_cells(case, key: str, numbers: tuple[int, ...]) -> int:
    """Number of cells of a pipe or basin; holes of a rectangular basin have no cells.

    key : key of its cells, such as "links.main.cells"; numbers : cells of the pipe, or along both sides of the basin
    """
    table = key.split(".")[0]
    if table == "links":
        return numbers[0]
    name = key.split(".")[1]
    own = case.nodes[name].cells
    return round(case.meshes[name].area.size * math.prod(numbers) / math.prod(own))


def most_cells(cells_by_key: Counts) -> int:
    """Greatest number of cells along a pipe or along a side of a basin."""
    return max(max(numbers) for numbers in cells_by_key.values())


def cell_size(case, key: str, numbers: tuple[int, ...]) -> float:
    """Cell size of a pipe [m], or the greater of the mean cell sizes along the sides of a basin [m].

    key, numbers : as for `part_cells`
    """
    table, name, _ = key.split(".")
    lengths = (case.links[name].length,) if table == "links" else case.nodes[name].size
    return max(length / n for length, n in zip(lengths, numbers, strict=True))


def is_valid(case, cells_by_key: Counts) -> bool:
    """True if a case can have these numbers of cells: edges of patches and holes must lie between cells."""
    from fvsolve.case import load

    try:
        load(case, cell_keys_of(cells_by_key))
    except CaseError:
        return False
    return True


def greatest_wave_rate(case, cells_by_key: Mapping[str, tuple[int, ...]]) -> float:
    """Greatest wave rate of a case with these numbers of cells: cells that a wave crosses per second [1/s].

    With basins the result is at least the step-limiting rate of all parts at the start (`Model.wave_rate`), times the
    greatest factor by which a basin is refined. With delay lines it is at least the number of cells of the slowest
    line divided by the travel time of a wave along it.
    cells_by_key : as from `cell_counts`
    """
    rates = [case.wave_speed(name) * cells_by_key[f"links.{name}.cells"][0] / pipe.length
             for name, pipe in pipes_with_cells(case).items()]  # fmt: skip
    rates += [method.rate for method in line_methods(case).values() if method.pipe_model == "delay-line"]
    if basins(case):
        own_cells = {key: numbers for key, numbers in cell_counts(case).items() if key.startswith("nodes.")}
        factor = max((max(cells_by_key[key]) / max(numbers) for key, numbers in own_cells.items()), default=1.0)
        rates.append(factor * study_model(case).wave_rate)
    return max(rates)


def scheme_order(case) -> int:
    """Order of the scheme in smooth flow, the least of all parts with cells."""
    scheme = SCHEMES[case.numerics.scheme]
    return min(
        [
            scheme.order,
            *(scheme.for_basin(bool(basin.cells) and not basin.holes).order for basin in basins(case).values()),
        ]
    )


def order_varies(case) -> bool:
    """True if `scheme_order` is only an upper bound.

    For free surfaces, a scheme above second order has its full order if waves travel along one axis only, otherwise
    second order.
    """
    fifth = scheme_order(case) > BASIN_ORDER
    return fifth and any(basin.physics_type.has_shocks for basin in basins(case).values())


def has_initial_jump(case, coarse: Mapping, fine: Mapping) -> bool:
    """True if a basin starts with a jump: differences between neighbouring cells hardly decrease on finer cells.

    coarse, fine : overrides that set the numbers of cells
    """
    if not any(basin.start or getattr(basin, "scalars", {}) for basin in basins(case).values()):
        return False
    steps = [initial_steps(study_model(case, cells)) for cells in (coarse, fine)]
    return any(b > JUMP_SHARE * a > 0.0 for a, b in zip(*steps, strict=True))


def initial_steps(model) -> list[float]:
    """Greatest difference between neighbouring cells at the start, for every quantity of every basin [SI]."""
    greatest = []
    for basin in model.basins:
        inner = basin.mesh.inner
        left, right = basin.mesh.left[:inner], basin.mesh.right[:inner]
        values = basin_fields(basin, model.start).values()
        greatest += [float(np.max(np.abs(field[left] - field[right]), initial=0.0)) for field in values]
    return greatest


def refinable_counts(case) -> Counts:
    """Numbers of cells that can be doubled, as from `cell_counts`. Raises FvsolveError without such cells."""
    cells_by_key = cell_counts(case)
    if not cells_by_key:
        files = basins_from_files(case)
        reason = (
            f"meshes from files cannot be refined ({listing(files)})"
            if files
            else "this case has no pipe or basin, and so no cells"
        )
        raise FvsolveError(f'{reason}: refine = "both" or "space" is impossible. Expected "time"')
    return cells_by_key
