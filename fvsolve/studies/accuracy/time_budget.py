"""Number of cells on the first row of a refinement, so that the study ends within minutes."""

from __future__ import annotations

import math
from dataclasses import replace

from fvsolve.model.model_facts import rhs_seconds
from fvsolve.steppers import automatic
from fvsolve.steppers.tableau import method_named
from fvsolve.studies.accuracy.case_resolution import basins, cell_counts, is_valid, most_cells, scaled, total_cells
from fvsolve.studies.accuracy.refine import Plan, refinement_plan
from fvsolve.studies.outcome import study_model
from fvsolve.studies.result_cache import ResultCache

CPU_BUDGET = 40.0  # approximate CPU time of all rows and their reference [s]
LEAST_CELLS = 8  # least number of cells of the first row, along the pipe or side with most cells
# Calls of a reference per call and stage of the finest row: 4, 2 and 1 times as fine (16 + 4 + 1), 7 stages.
REFERENCE_COST = 21.0 * 7.0


def affordable_plan(
    case, refine: str | None, key: str | None, levels: int | None, cells: int | None, against: str,
    points: ResultCache | None,
) -> Plan:  # fmt: skip
    """Plan of a refinement; if neither `cells` nor `key` is given, the study is planned to end within minutes.

    For this the number of cells of the first row is reduced if necessary, unless only steps are refined.
    refine, key, levels, cells : as in `refinement_plan`; against : kind of the reference as in `order`
    points : result cache, which also stores the chosen number of cells
    """
    refinement = refinement_plan(case, refine, key, levels, cells)
    if cells is not None or key is not None or refinement.way == "time" or not cell_counts(case):
        return refinement
    settings = {
        "study": "order",
        "what": "first cells",
        "way": refinement.way,
        "levels": len(refinement.levels),
        "against": against,
    }
    stored = None if points is None else points.find(case, settings)
    first = stored["cells"] if stored else first_cells(case, refinement, refine, levels, against)
    if first == most_cells(cell_counts(case)):
        return refinement
    if points is not None and stored is None:
        points.get(case, settings, lambda: {"cells": first})
    remark = (
        f"starts with {first} of {most_cells(cell_counts(case))} cells, to end within minutes (change with --cells)"
    )
    refinement = refinement_plan(case, refine, key, levels, first)
    return replace(refinement, words=f"{refinement.words}; {remark}")


def first_cells(case, rows: Plan, refine: str | None, levels: int | None, against: str) -> int:
    """Number of cells of the first row: that of the case, halved until the study takes at most `CPU_BUDGET`.

    It is not halved below `LEAST_CELLS`, nor if patches or holes of a basin would then not end between cells.
    rows : plan with the cells of the case; other arguments as in `affordable_plan`
    """
    own_counts, exact = cell_counts(case), case.exact is not None or against != "auto" or bool(basins(case))
    cells, seconds = most_cells(own_counts), rhs_seconds(study_model(case)) / total_cells(case, own_counts)
    while cells >= 2 * LEAST_CELLS and cpu_time(case, rows, seconds, exact) > CPU_BUDGET:
        if not is_valid(case, scaled(own_counts, (cells // 2) / most_cells(own_counts))):
            break
        cells //= 2
        rows = refinement_plan(case, refine, None, levels, cells)
    return cells


def cpu_time(case, rows: Plan, seconds: float, exact: bool) -> float:
    """Estimated CPU time of all rows [s], and of a finer reference unless `exact`; 0 if steps follow a tolerance.

    rows : plan of the refinement; exact : True if the study needs no finer run as reference
    seconds : time of one call of the rates, divided by the number of cells [s]
    """
    numerics = case.numerics
    stages = method_named(automatic.first_method(numerics.method)).stages
    row_times = [level.cells * (numerics.end - numerics.start) / level.step * seconds for level in rows.levels]
    if any(math.isnan(seconds_of_row) for seconds_of_row in row_times):
        return 0.0
    return stages * sum(row_times) + (0.0 if exact else REFERENCE_COST * row_times[-1])
