"""How coarse a refinement begins, so that it ends within minutes. Knows the cost of the rates; runs nothing."""

from __future__ import annotations

import math
from dataclasses import replace

from fvsolve.model.checks import rhs_seconds
from fvsolve.steppers import automatic
from fvsolve.steppers.tableau import method_named
from fvsolve.studies.accuracy.cells import basins, counts, loads, most, scaled, total
from fvsolve.studies.accuracy.refine import Plan, plan
from fvsolve.studies.outcome import prepared
from fvsolve.studies.points import Points

LONGEST = 40.0  # CPU time that all rows and their reference may take, about [s]
LEAST = 8  # cells along the pipe or side with most to begin with
REFERENCE = 21.0 * 7.0  # calls of a reference for each of the finest row's, a stage: 4, 2 and 1 times as fine, 7 stages


def affordable(
    case, refine: str | None, key: str | None, levels: int | None, cells: int | None, against: str,
    points: Points | None,
) -> Plan:  # fmt: skip
    """The rows of a refinement; where nothing says on how many cells it begins, as many as a minute or two allow."""
    made = plan(case, refine, key, levels, cells)
    if cells is not None or key is not None or made.way == "time" or not counts(case):
        return made
    asked = {"study": "order", "what": "first cells", "way": made.way, "levels": len(made.levels), "against": against}
    known = None if points is None else points.find(case, asked)
    first = known["cells"] if known else first_cells(case, made, refine, levels, against)
    if first == most(counts(case)):
        return made
    if points is not None and known is None:
        points.get(case, asked, lambda: {"cells": first})
    said = f"begun on {first} of {most(counts(case))} cells, to end within minutes (--cells says otherwise)"
    made = plan(case, refine, key, levels, first)
    return replace(made, words=f"{made.words}; {said}")


def first_cells(case, made: Plan, refine: str | None, levels: int | None, against: str) -> int:
    """Cells to begin with: those of the case, or halved as often as the time asks and patches and holes allow."""
    own, exact = counts(case), case.exact is not None or against != "auto" or bool(basins(case))
    cells, seconds = most(own), rhs_seconds(prepared(case)) / total(case, own)
    while cells >= 2 * LEAST and time_of(case, made, seconds, exact) > LONGEST:
        if not loads(case, scaled(own, (cells // 2) / most(own))):
            break
        cells //= 2
        made = plan(case, refine, None, levels, cells)
    return cells


def time_of(case, made: Plan, seconds: float, exact: bool) -> float:
    """CPU time of all rows, and of a reference where there is no exact solution [s]; 0 where steps follow an error.

    seconds : of one call of the rates, a cell
    """
    numerics = case.numerics
    stages = method_named(automatic.first_method(numerics.method)).stages
    each = [level.cells * (numerics.end - numerics.start) / level.step * seconds for level in made.levels]
    if any(math.isnan(one) for one in each):
        return 0.0
    return stages * sum(each) + (0.0 if exact else REFERENCE * each[-1])
