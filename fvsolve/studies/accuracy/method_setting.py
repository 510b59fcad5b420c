"""Setting of a work-precision study: scheme, method and resolution, as keys of a case."""

from __future__ import annotations

from dataclasses import dataclass, field

from fvsolve.case.case import Case
from fvsolve.case.raw import raw_link
from fvsolve.case.sections import DEFAULT_COURANT, uses_error_control
from fvsolve.model.delay_line_selection import slowest_pipe
from fvsolve.steppers.built_in_methods import AUTO, METHODS
from fvsolve.studies.accuracy.case_resolution import basins, cell_counts, cell_keys_of, pipes_with_cells, scaled

IMPLICIT_RTOL = 1e-4  # rtol of implicit methods with cells: their steps follow the solution, not the cell size


@dataclass(frozen=True)
class MethodSetting:
    """Scheme, method and resolution of a run.

    scheme : None without cells; control : key "courant", "rtol" or "step" that sets the steps; size : its value, the
    step in s
    cells : number of cells of the main part (see `main_part_name`), None without cells; keys : overrides, dotted key ->
    value
    """

    scheme: str | None
    method: str
    control: str
    size: float
    cells: int | None = None
    keys: dict = field(default_factory=dict, compare=False)

    @property
    def curve(self) -> tuple:
        """(scheme, method, step control), which all settings of a curve in a work-precision chart have in common."""
        return self.scheme, self.method, "courant" if self.control == "courant" else self.control

    @property
    def name(self) -> str:
        """Name of scheme and method, such as `upwind5 rk4`."""
        return f"{self.scheme} {self.method}" if self.scheme else self.method

    @property
    def fineness(self) -> str:
        """Resolution in words, such as `200 cells` or `rtol 1e-06`."""
        return f"{self.cells} cells" if self.cells is not None else f"{self.control} {self.size:.3g}"


def main_part_name(case: Case) -> str | None:
    """Name of the main part, whose number of cells is the resolution; None if the case has no cells that can change.

    The main part is the basin with most cells along a side, else the pipe with the longest travel time of a wave.
    """
    sizes = {name: max(basin.cells) for name, basin in basins(case).items() if basin.cells}
    if sizes:
        return max(sizes, key=sizes.get)
    pipes = pipes_with_cells(case)
    return slowest_pipe(case, pipes) if pipes else None


def basin_cells(case: Case) -> int | None:
    """Greatest number of cells along a side of the main part (see `main_part_name`); None if it is not a basin."""
    basin = basins(case).get(main_part_name(case) or "")
    return None if basin is None else max(basin.cells)


def cell_keys(case: Case, cells: int) -> dict:
    """Overrides that set the number of cells of the main part (see `main_part_name`), and scale those of other parts.

    They set `cells` of the pipes that state it in the case; for other pipes they set `numerics.cell_time`. With basins
    they set `cells` of all parts.
    """
    main_part, main_cells = main_part_name(case), basin_cells(case)
    if main_cells is not None:
        return cell_keys_of(scaled(cell_counts(case), cells / main_cells))
    pipes = pipes_with_cells(case)
    stated = {name for name in pipes if raw_link(case.raw, name).get("cells") is not None}
    factor = cells / pipes[main_part].cells
    changed = {f"links.{name}.cells": max(1, round(pipes[name].cells * factor)) for name in stated}
    if main_part not in stated:
        changed["numerics.cell_time"] = pipes[main_part].length / case.wave_speed(main_part) / cells
    elif len(stated) < len(pipes):
        unstated = [pipe for name, pipe in pipes.items() if name not in stated]
        travel = max(pipe.length / case.wave_speed(name) for name, pipe in pipes.items() if name not in stated)
        changed["numerics.cell_time"] = travel / (max(pipe.cells for pipe in unstated) * factor)
    return changed


def cells_setting(case: Case, scheme: str, method: str, cells: int) -> MethodSetting:
    """Setting of a case with cells: Courant number 0.9, or 1 for upwind with Euler.

    Methods with error control have a tolerance instead. cells : number of cells of the main part (see `main_part_name`)
    """
    by_error = uses_error_control(method)
    control = "rtol" if by_error else "courant"
    size = IMPLICIT_RTOL if by_error else 1.0 if (scheme, method) == ("upwind", "euler") else DEFAULT_COURANT
    settings = {"numerics.scheme": scheme, "numerics.method": method, f"numerics.{control}": size}
    return MethodSetting(scheme, method, control, size, cells, settings | cell_keys(case, cells))


def lumped_setting(method: str, size: float, control: str | None = None) -> MethodSetting:
    """Setting of a case without cells, which consists of ordinary differential equations or delay lines.

    size : tolerance [-] or step [s]
    control : "rtol" or "step"; if None a tolerance, or a step for methods without an error estimate
    """
    control = control or ("rtol" if is_adaptive(method) else "step")
    return MethodSetting(None, method, control, size, None, {"numerics.method": method, f"numerics.{control}": size})


def is_adaptive(method: str) -> bool:
    """True if a method can keep the error of its steps within a tolerance."""
    return method == AUTO or METHODS[method].adaptive
