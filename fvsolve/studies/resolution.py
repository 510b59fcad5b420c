"""Resolution of a case in studies: cells of pipes and basins, delay lines, and keys that change them.

Quantities in the cells of basins are averaged over coarser meshes. A variable of a basin has the name "BASIN at the
end: QUANTITY". Its values are those of `basin_fields`. The argument `cells_by_key` of several functions has numbers of
cells as from `cell_counts`.
"""

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from fvsolve.core.schemes import SCHEMES
from fvsolve.errors import CaseError, FvsolveError, listing
from fvsolve.features.delay_lines.choice import line_methods, slowest_pipe
from fvsolve.parts import Basin, Pipe
from fvsolve.parts.formula import is_grid
from fvsolve.studies.outcome import study_model

READING_ORDER = 6.0  # order of the interpolation in the history of a line
EXPECTED_ORDER = (
    "delay lines carry jumps exactly, and smooth waves without friction exactly at whole steps. Expected orders: 2 in "
    "the length of stretches with friction (1 behind jumps); 2 in the step behind kinks (about 1.5 in L2, 1 in max) or "
    "in lines shorter than a step, else up to 6 in the step; the order of the method with parts that store fluid or "
    "energy"
)
EXACT_NOTE = (
    "delay lines are exact here, at any step and length of stretches: all errors are rounding errors, except errors of "
    "values along the lines"
)


def delay_lines(case) -> list[str]:
    """Names of the pipes of a case that are delay lines, or may become delay lines by `pipe_model = "auto"`."""
    return [name for name, pipe in line_methods(case).items() if pipe.pipe_model == "delay-line"]


def fixed_choices(case) -> dict[str, str]:
    """Overrides that replace `pipe_model = "auto"` by its present choice for each pipe.

    With these overrides the changes of a study do not alter the choice. Pipes with "auto" that cannot be delay lines
    are left out.
    """
    from fvsolve.core.run import model_of

    own = case.numerics.pipe_model
    undecided = [
        name for name in delay_lines(case) if (case.links[name].pipe_model or own) == "auto"
    ]
    if not undecided:
        return {}
    model = model_of(case)
    pairs = zip(model.pipes, model.tables.pipes["cells"] == 0, strict=True)
    models = {pipe.name: "delay-line" if delayed else "finite-volume" for pipe, delayed in pairs}
    return pipe_model_keys({name: models[name] for name in models if name in undecided})


def as_cells(names: Iterable[str]) -> dict[str, str]:
    """Overrides with which all pipes of a case have cells; names : its delay lines."""
    return {"numerics.pipe_model": "finite-volume"} | pipe_model_keys(
        dict.fromkeys(names, "finite-volume")
    )


def cells_for_lines(case, step: float) -> dict:
    """Overrides with which all delay lines have cells that a wave crosses in at most the time `step` [s].

    For step = 0 the numbers of cells stay as the case states them.
    """
    delayed = delay_lines(case)
    keys = as_cells(delayed)
    for name in delayed if step > 0.0 else ():
        keys[f"links.{name}.cells"] = max(
            1, math.ceil(case.links[name].length / case.wave_speed(name) / step)
        )
    return keys


def pipe_model_keys(chosen: dict[str, str]) -> dict[str, str]:
    """Overrides of the pipe models; chosen : pipe -> "finite-volume" or "delay-line"."""
    return {f"links.{name}.pipe_model": line for name, line in chosen.items()}


# cells ------------------------------------------------------------------------------------------------------------

Counts = dict[str, tuple[int, ...]]  # dotted key -> numbers of cells: one of a pipe, two of a basin
BASIN_ORDER = 2  # order of `muscl`, which replaces all schemes that a basin does not have
# a jump keeps at least this fraction of its greatest difference between neighbours on finer cells
JUMP_SHARE = 0.75


def pipes(case) -> dict[str, Pipe]:
    """Pipes of a case, by name."""
    return {name: link for name, link in case.links.items() if link.kind == "pipe"}


def pipes_with_cells(case) -> dict[str, Pipe]:
    """Pipes with cells, by name: all pipes of a case that are not delay lines."""
    delayed = delay_lines(case)
    return {name: pipe for name, pipe in pipes(case).items() if name not in delayed}


def basins(case) -> dict[str, Basin]:
    """Basins of a case that have cells, by name, without the water of conduits."""
    return {name: case.nodes[name] for name in case.meshes if not case.nodes[name].added}


def cell_counts(case) -> Counts:
    """Numbers of cells that a study can refine: of pipes that are not delay lines, conduits, and rectangular basins.

    Returns dotted key, such as "links.main.cells" -> (cells,) of a pipe, or (cells along x, cells along y) of a basin.
    """
    numbers: Counts = {
        f"links.{name}.cells": (pipe.cells,) for name, pipe in pipes_with_cells(case).items()
    }
    numbers |= {
        f"links.{name}.cells": (link.cells,)
        for name, link in case.links.items()
        if link.kind == "conduit"
    }
    return numbers | {
        f"nodes.{name}.cells": basin.cells for name, basin in basins(case).items() if basin.cells
    }


def basins_from_files(case) -> list[str]:
    """Names of the basins whose mesh is read from a file, so that it cannot be refined."""
    return [name for name, basin in basins(case).items() if basin.cells is None]


def cell_keys_of(cells_by_key: Counts) -> dict[str, Any]:
    """Overrides of a case that set these numbers of cells: dotted key -> number, or list of two numbers."""
    return {
        key: list(numbers) if len(numbers) > 1 else numbers[0]
        for key, numbers in cells_by_key.items()
    }


def scaled(cells_by_key: Counts, factor: float) -> Counts:
    """Numbers of cells multiplied by `factor` along every pipe and every side of a basin; at least 1."""
    return {
        key: tuple(max(1, round(n * factor)) for n in numbers)
        for key, numbers in cells_by_key.items()
    }


def total_cells(case, cells_by_key: Counts) -> int:
    """Total number of cells of a case with these numbers of cells, including basins whose mesh comes from a file."""
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
    """Cell size of a pipe [m], or the greater mean size along a side of a basin; arguments as for `part_cells`."""
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

    With basins or conduits the result is at least the step-limiting rate of all parts at the start
    (`Model.wave_rate`), times the greatest factor by which one is refined. With delay lines it is at least the number
    of cells of the slowest line divided by the travel time of a wave along it.
    """
    rates = [
        case.wave_speed(name) * cells_by_key[f"links.{name}.cells"][0] / pipe.length
        for name, pipe in pipes_with_cells(case).items()
    ]
    rates += [
        method.rate for method in line_methods(case).values() if method.pipe_model == "delay-line"
    ]
    if case.meshes:
        lines = {f"links.{name}.cells" for name in pipes_with_cells(case)}
        own_cells = {key: numbers for key, numbers in cell_counts(case).items() if key not in lines}
        factor = max(
            (max(cells_by_key[key]) / max(numbers) for key, numbers in own_cells.items()),
            default=1.0,
        )
        rates.append(factor * study_model(case).wave_rate)
    return max(rates)


def scheme_order(case) -> int:
    """Order of the scheme in smooth flow, the least of all parts with cells."""
    scheme = SCHEMES[case.numerics.scheme]
    of_basins = [
        scheme.for_basin(pool.physics_type.has_fifth_order(pool, is_grid(case.meshes[name])))
        for name, pool in basins(case).items()
    ]
    return min(entry.order for entry in (scheme, *of_basins))


def order_varies(case) -> bool:
    """True if `scheme_order` is only an upper bound.

    For free surfaces, a scheme above second order has its full order if waves travel along one axis only, otherwise
    second order.
    """
    fifth = scheme_order(case) > BASIN_ORDER
    return fifth and any(basin.physics_type.has_shocks for basin in basins(case).values())


def has_initial_jump(case, coarse: Mapping, fine: Mapping) -> bool:
    """True if a basin starts with a jump: differences of neighbours hardly fall from `coarse` to `fine` (overrides)."""
    if not any(basin.start or getattr(basin, "scalars", {}) for basin in basins(case).values()):
        return False
    steps = [initial_steps(study_model(case, cells)) for cells in (coarse, fine)]
    return any(b > JUMP_SHARE * a > 0.0 for a, b in zip(*steps, strict=True))


def initial_steps(model) -> list[float]:
    """Greatest difference between neighbouring cells at the start, for every quantity of every basin [SI]."""
    greatest = []
    for basin in model.meshed:
        inner = basin.mesh.inner
        left, right = basin.mesh.left[:inner], basin.mesh.right[:inner]
        values = basin_fields(basin, model.start).values()
        greatest += [
            float(np.max(np.abs(field[left] - field[right]), initial=0.0)) for field in values
        ]
    return greatest


def refinable_counts(case) -> Counts:
    """Numbers of cells that can be doubled, as from `cell_counts`. Raises FvsolveError without such cells."""
    cells_by_key = cell_counts(case)
    if not cells_by_key:
        files, reason = basins_from_files(case), "this case has no pipe or basin, and so no cells"
        reason = f"meshes from files cannot be refined ({listing(files)})" if files else reason
        raise FvsolveError(f'{reason}: refine = "both" or "space" is impossible; expected "time"')
    return cells_by_key


def refined_keys(case, times: float) -> dict[str, Any]:
    """Overrides that multiply the resolution by `times`: cells, stretches of delay lines, steps and tolerances.

    The tolerance `rtol` is divided by the square of `times`. The Courant number stays, except in cases with delay
    lines, see `refined_step_keys`. The result is empty if nothing can be refined, or if the coarser case is invalid,
    for example because a patch of a basin would begin within a cell.
    """
    fixed = fixed_choices(case)
    if fixed:  # cells of pipes with "auto" count as cells only after this choice
        from fvsolve.case import load

        case = load(case, fixed)
    keys = cell_keys_of(scaled(cell_counts(case), times))
    if times < 1.0 and not is_valid(case, scaled(cell_counts(case), times)):
        return {}
    numerics = case.numerics
    if numerics.step is not None:
        keys["numerics.step"] = numerics.step / times
    if numerics.rtol is not None:
        keys["numerics.rtol"] = min(numerics.rtol / times**2, 0.5)
    if delay_lines(case):
        keys["numerics.delay_tolerance"] = min(numerics.delay_tolerance / times, 0.5)
        keys |= refined_step_keys(case, times)
    return keys | fixed


def refined_step_keys(case, times: float) -> dict[str, Any]:
    """Overrides with which a case with delay lines takes `times` as many steps; empty if the case states the step.

    If the case states a Courant number and has no cells, this number changes. Otherwise the key `cells` of the delay
    line with the longest travel time changes, which then sets the step.
    """
    if case.numerics.step is not None:
        return {}
    if case.numerics.courant is not None and not cell_counts(case):
        return {"numerics.courant": case.numerics.courant / times}
    name = slowest_pipe(case, delay_lines(case))
    return {f"links.{name}.cells": max(1, round(case.links[name].cells * times))}


# quantities of basins ---------------------------------------------------------------------------------------------

# fraction of the length: edges of coarse and fine cells that lie nearer are equal
EDGE_TOLERANCE = 1e-9
SPLINE_DEGREE = 5  # degree of the spline through cumulative contents, for edges that are not equal


def basin_fields(basin, y: np.ndarray) -> dict[str, np.ndarray]:
    """Values in the cells of a basin, quantity -> float64[cells], from the state vector `y` of a model.

    Quantities of the flow are deviations from the initial steady state; scalars are amounts per area.
    """
    fields = dict(zip(basin.quantities, basin.deviations(y), strict=True))
    scalars = getattr(basin, "scalars", ())
    return fields | (dict(zip(scalars, basin.amounts(y), strict=True)) if scalars else {})


def variable_name(basin, quantity: str) -> str:
    """Name of the variable that is a quantity of a basin at the end of a run."""
    return f"{basin.name} at the end: {quantity}"


def unit_of(case, variable: str) -> str | None:
    """SI unit of a variable by its name, "-" for a scalar; None if the variable does not belong to a basin."""
    name, _, quantity = variable.partition(" at the end: ")
    node = case.nodes.get(name)
    if not quantity or node is None or node.kind != "basin":
        return None
    return node.physics_type.states.get(quantity, "-")


def project_to(fine, values, coarse) -> np.ndarray:
    """Average values in the cells of a fine basin over the cells of a coarse basin with the same outline.

    values : float64[quantities, fine cells]; returns float64[quantities, coarse cells]
    """
    if fine.n == coarse.n and np.array_equal(fine.mesh.centre, coarse.mesh.centre):
        return np.asarray(values)
    fine_grid, coarse_grid = fine.mesh.grid, coarse.mesh.grid
    degree = SPLINE_DEGREE if fine.is_grid else 1  # higher splines would smooth across holes
    averages = []
    fine_area, coarse_area = (
        np.outer(np.diff(grid.y), np.diff(grid.x)) for grid in (fine_grid, coarse_grid)
    )
    for value in values:
        contents = np.where(fine_grid.index >= 0, value[fine_grid.index], 0.0) * fine_area
        contents = coarse_contents(contents, fine_grid.x, coarse_grid.x, degree, 1)
        contents = coarse_contents(contents, fine_grid.y, coarse_grid.y, degree, 0)
        averages.append((contents / coarse_area)[coarse_grid.index >= 0])
    return np.array(averages)


def coarse_contents(
    fine_contents: np.ndarray, fine: np.ndarray, coarse: np.ndarray, degree: int, axis: int
) -> np.ndarray:
    """Integrals over the cells between the edges `coarse`, from integrals over the cells between the edges `fine`.

    axis : axis of `fine_contents` along which the cells lie
    degree : degree of the spline through cumulative integrals, used if the coarse edges are not among the fine edges
    """
    first = np.zeros_like(np.take(fine_contents, [0], axis=axis))
    cumulative = np.concatenate([first, np.cumsum(fine_contents, axis=axis)], axis=axis)
    edges = np.clip(
        np.searchsorted(fine, coarse - EDGE_TOLERANCE * (fine[-1] - fine[0])), 0, fine.size - 1
    )
    if np.all(np.abs(fine[edges] - coarse) <= EDGE_TOLERANCE * (fine[-1] - fine[0])):
        return np.diff(np.take(cumulative, edges, axis=axis), axis=axis)
    from scipy.interpolate import make_interp_spline

    return np.diff(
        make_interp_spline(fine, cumulative, k=min(degree, fine.size - 1), axis=axis)(coarse),
        axis=axis,
    )
