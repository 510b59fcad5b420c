"""A setting of a chart: scheme, method and how fine, as keys of a case. Knows cases; runs nothing."""

from __future__ import annotations

from dataclasses import dataclass, field

from fvsolve.case.case import Case
from fvsolve.case.defaults import link_said
from fvsolve.case.sections import DEFAULT_COURANT, steps_by_error
from fvsolve.steppers.methods import AUTO, METHODS
from fvsolve.studies.accuracy.cells import basins, counts, in_cells, keys, scaled

TOLERANCE = 1e-4  # of implicit methods where there are cells: their steps follow what moves, not the cells


@dataclass(frozen=True)
class MethodSetting:
    """Scheme (None without cells), method, step control and its size; cells of the part that counts.

    keys : dotted keys of the case -> values
    """

    scheme: str | None
    method: str
    control: str
    size: float
    cells: int | None = None
    keys: dict = field(default_factory=dict, compare=False)

    @property
    def curve(self) -> tuple:
        """What the points of one curve share."""
        return self.scheme, self.method, "courant" if self.control == "courant" else self.control

    @property
    def name(self) -> str:
        """`upwind5 rk4`."""
        return f"{self.scheme} {self.method}" if self.scheme else self.method

    @property
    def fineness(self) -> str:
        """What makes it finer than its neighbours, in words."""
        return f"{self.cells} cells" if self.cells is not None else f"{self.control} {self.size:.3g}"


def longest(case: Case) -> str | None:
    """Name of the part whose cells count: the basin with most along a side, else the pipe that a wave crosses last.

    None where there is none: delay lines have no cells.
    """
    found = {name: max(basin.cells) for name, basin in basins(case).items() if basin.cells}
    if found:
        return max(found, key=found.get)
    found = {name: pipe.length / case.wave_speed(name) for name, pipe in in_cells(case).items()}
    return max(found, key=found.get, default=None)


def own_cells(case: Case) -> int | None:
    """Cells along the longer side of the basin that counts, None where a pipe does."""
    basin = basins(case).get(longest(case) or "")
    return None if basin is None else max(basin.cells)


def cell_keys(case: Case, cells: int) -> dict:
    """Keys that give the part that counts so many cells, and the others as many more or fewer as they had beside it.

    Pipes that state `cells` keep stating them; those that do not share one `cell_time`. Beside basins all state them.
    """
    main, own = longest(case), own_cells(case)
    if own is not None:
        return keys(scaled(counts(case), cells / own))
    pipes = in_cells(case)
    stated = {name for name in pipes if link_said(case.raw, name).get("cells") is not None}
    factor = cells / pipes[main].cells
    found = {f"links.{name}.cells": max(1, round(pipes[name].cells * factor)) for name in stated}
    if main not in stated:
        found["numerics.cell_time"] = pipes[main].length / case.wave_speed(main) / cells
    elif len(stated) < len(pipes):
        free = [pipe for name, pipe in pipes.items() if name not in stated]
        travel = max(pipe.length / case.wave_speed(name) for name, pipe in pipes.items() if name not in stated)
        found["numerics.cell_time"] = travel / (max(pipe.cells for pipe in free) * factor)
    return found


def with_cells(case: Case, scheme: str, method: str, cells: int) -> MethodSetting:
    """A setting on pipes: Courant 0.9, 1 for upwind with Euler; a tolerance for adaptive implicit methods."""
    by_error = steps_by_error(method)
    control = "rtol" if by_error else "courant"
    size = TOLERANCE if by_error else 1.0 if (scheme, method) == ("upwind", "euler") else DEFAULT_COURANT
    keys = {"numerics.scheme": scheme, "numerics.method": method, f"numerics.{control}": size}
    return MethodSetting(scheme, method, control, size, cells, keys | cell_keys(case, cells))


def without_cells(method: str, size: float, control: str | None = None) -> MethodSetting:
    """A setting of ordinary differential equations or delay lines: by tolerance, or by step where there is no error
    estimate, if `control` does not say."""
    control = control or ("rtol" if adaptive(method) else "step")
    return MethodSetting(None, method, control, size, None, {"numerics.method": method, f"numerics.{control}": size})


def adaptive(method: str) -> bool:
    """Whether a method can hold its steps to a tolerance."""
    return method == AUTO or METHODS[method].adaptive
