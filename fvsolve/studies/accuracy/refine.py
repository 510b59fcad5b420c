"""Plan of a refinement: levels from coarse to fine, as keys of a case, and a first row that the study can afford.

Arguments of several functions : refine or way, key, levels, cells as for `refinement_plan`; against, kind of the
reference as in `order`; courant, Courant number of the finest row; k, number of a row, from 0
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from fvsolve.case.reading import raw_link
from fvsolve.core.model.model_facts import rhs_seconds
from fvsolve.core.steppers import automatic
from fvsolve.core.steppers.tableau import AUTO, METHODS, method_named
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.features.delay_lines.feature import lines_of
from fvsolve.studies.outcome import study_model
from fvsolve.studies.resolution import (
    Counts,
    basins,
    basins_from_files,
    cell_counts,
    cell_keys_of,
    cell_size,
    delay_lines,
    greatest_wave_rate,
    is_valid,
    most_cells,
    pipes,
    pipes_with_cells,
    refinable_counts,
    scaled,
    scheme_order,
    total_cells,
)
from fvsolve.studies.result_cache import ResultCache

WAYS = ("both", "space", "time")
TIME_KEYS = ("numerics.step", "numerics.courant", "numerics.rtol")
DEFAULT_LEVELS = {"both": 4, "space": 4, "time": 6}
FIRST_RTOL = 1e-4  # first tolerance of a refinement of rtol, unless that of the case is greater
MAX_CELLS = 10**6  # greatest number of cells of a row
# approximate ratio of time error to space error on the finest row, if space alone is refined
STEP_ERROR_SHARE = 0.01
LEAST_COURANT = 0.02  # smaller Courant numbers would take too long


@dataclass(frozen=True)
class Level:
    """Refinement level: one resolution of a refinement.

    set : overrides of the level, dotted key -> value
    size : cell size [m], time step [s], travel time of a stretch of a delay line [s], or tolerance [-]; it decreases
    from level to level
    cells : number of cells of all pipes and basins; step : fixed time step [s], NaN if steps follow a tolerance
    """

    set: dict
    size: float
    cells: int
    step: float


@dataclass(frozen=True)
class Plan:
    """Refinement of a case.

    way : "both" (space and time), "space" or "time"; measure : quantity that is the size of a level, with its unit
    levels : refinement levels from coarse to fine; words : description of the refinement
    """

    way: str
    measure: str  # "cell size [m]" | "step [s]" | "longest step [s]" | "stretch [s]" | "rtol"
    levels: tuple[Level, ...]
    words: str


def resolutions(case) -> dict[str, str]:
    """Keys of a case that set its resolution -> kind of refinement: "both" (space and time), "space" or "time"."""
    ways = dict.fromkeys(cell_counts(case), "both")
    if delay_lines(case):
        ways["numerics.delay_tolerance"] = "space"
    if pipes(case) or basins(case):
        ways["numerics.courant"] = "time"
    if pipes_by_cell_time(case):
        ways["numerics.cell_time"] = "both"
    return ways | {"numerics.step": "time", "numerics.rtol": "time"}


def pipes_by_cell_time(case) -> list[str]:
    """Names of pipes with cells whose number the case does not state."""
    return [name for name in pipes_with_cells(case) if "cells" not in raw_link(case.raw, name)]


def refinement_plan(
    case,
    refine: str | None = None,
    key: str | None = None,
    levels: int | None = None,
    cells: int | None = None,
) -> Plan:
    """Plan of a refinement of a case; a row is the run of a level, coarsest first.

    refine : "both", "space" or "time"; default that of `key`, else "both" with cells or delay lines, "time" without

    "both" : sizes of cells, stretches of delay lines, and steps are halved from row to row
    "space" : sizes of cells and stretches are halved; all rows have one step, which suits the finest row
    "time" : steps are halved, or rtol is divided by ten if the case or `key` states it
    With "both" and "space", steps follow the tolerance in all rows if the case states rtol.

    key : key of the only resolution that is refined, such as "links.main.cells" (default all); levels : number of rows
    cells : number of cells in the coarsest row, of the part whose cells `key` states. For other keys, and without a
    key, it is the number along the pipe or side with most cells, and all other numbers change in proportion.
    Raises FvsolveError for an unknown or impossible refinement, key, or number of levels or cells.
    """
    known = resolutions(case)
    if key is not None and key not in known:
        hint = did_you_mean(key, known)
        raise FvsolveError(
            f"{key} is not a resolution of this case; expected one of {listing(known)}{hint}"
        )
    refine = refine or (
        known[key] if key else "both" if cell_counts(case) or delay_lines(case) else "time"
    )
    if refine not in WAYS:
        hint = did_you_mean(refine, WAYS) or f"; expected {', '.join(WAYS)}"
        raise FvsolveError(f'refine = "{refine}" is unknown{hint}')
    if refine != "time" and not delay_lines(case):
        refinable_counts(case)
    if key is not None and (known[key] == "time") != (refine == "time"):
        way = "time" if known[key] == "time" else "space"
        raise FvsolveError(
            f'{key} refines {way}, so refine = "{refine}" is impossible; leave `refine` out'
        )
    levels = DEFAULT_LEVELS[refine] if levels is None else levels
    if levels < 2:
        raise FvsolveError(
            f"levels = {levels} is too few; expected at least 2, and at least 3 for a fitted order"
        )
    if refine == "time" and cells is not None:
        text = "only steps are refined here; leave `cells` out, or set the cells of the case"
        raise FvsolveError(f"cells = {cells}: {text}")
    if refine == "time":
        return time_plan(case, key, levels)
    if delay_lines(case) and (key == "numerics.delay_tolerance" or not cell_counts(case)):
        if cells is not None:
            raise FvsolveError(
                f"cells = {cells}: cells of delay lines are only for output; leave `cells` out"
            )
        return delay_line_plan(case, refine, levels)
    return space_plan(case, refine, key, levels, cells)


# delay lines ------------------------------------------------------------------------------------------------------


def delay_line_plan(case, way: str, levels: int) -> Plan:
    """Plan in which the tolerance of delay lines is halved from row to row, so that they have twice as many stretches.

    With way = "both" steps are halved too, and the size of a row is its step (with error control its longest step) [s].
    With "space" it is the travel time of a stretch [s], in the line with most stretches in the last row.
    Raises FvsolveError if with "space" the stretches do not change.
    """
    count = total_cells(case, cell_counts(case))
    step = first_step(case) if case.numerics.rtol is None else math.nan
    rows = [stretch_keys(case, way, k) for k in range(levels)]
    if way == "both":
        by_error = math.isnan(step)
        first = 1.0 / greatest_wave_rate(case, cell_counts(case)) if by_error else step
        refined = [
            Level(
                row if by_error else row | {"numerics.step": step / 2**k},
                first / 2**k,
                count,
                step / 2**k,
            )
            for k, row in enumerate(rows)
        ]
        what = "longest step" if by_error else "step"
        words = f"{STRETCH_WORDS}, and {'the longest step' if by_error else 'steps'} halved"
        return Plan(way, f"{what} [s]", tuple(refined), words)
    tables = [lines_of(study_model(case, row)) for row in rows]
    line = int(np.argmax(tables[-1]["stretches"]))
    if tables[0]["stretches"][line] == tables[-1]["stretches"][line]:
        raise FvsolveError(
            "a smaller numerics.delay_tolerance divides no delay line of this case into more stretches: "
            "there is no friction, or stretches are as short as a step; "
            'expected refine = "both" or refine = "time"'
        )
    refined = [
        Level(row, float(table["tau"][line]), count, step)
        for row, table in zip(rows, tables, strict=True)
    ]
    return Plan(way, "stretch [s]", tuple(refined), f"{STRETCH_WORDS}, one step for all rows")


STRETCH_WORDS = "tolerance of delay lines halved, so that they have twice as many stretches"


def stretch_keys(case, way: str, k: int) -> dict:
    """Overrides of row k: tolerance of delay lines divided by 2^k, and their cells times 2^k if cells set the step.

    With way = "space" the cells of delay lines stay.
    """
    keys = (
        {"numerics.delay_tolerance": case.numerics.delay_tolerance / 2**k}
        if delay_lines(case)
        else {}
    )
    if way == "both" and (
        case.numerics.rtol is not None or (cell_counts(case) and case.numerics.courant is not None)
    ):
        keys |= {
            f"links.{name}.cells": pipes(case)[name].cells * 2**k for name in delay_lines(case)
        }
    return keys


# space ------------------------------------------------------------------------------------------------------------


def space_plan(case, way: str, key: str | None, levels: int, cells: int | None) -> Plan:
    """Plan in which the cells of all pipes and basins, or of the part that `key` names, are doubled from row to row.

    Raises FvsolveError for more than `MAX_CELLS` cells in the finest row.
    """
    first = coarsest_counts(case, key, cells)
    refined = [name for name in first if key in (None, name)]
    if key == "numerics.cell_time":
        refined = [f"links.{name}.cells" for name in pipes_by_cell_time(case)]
    all_counts = [
        {
            name: tuple(n * 2**k for n in numbers) if name in refined else numbers
            for name, numbers in first.items()
        }
        for k in range(levels)
    ]
    finest = total_cells(case, all_counts[-1])
    if finest > MAX_CELLS:
        raise FvsolveError(
            f"the finest of {levels} levels would have {finest:.3g} cells; expected at most "
            f"{MAX_CELLS:.0e}; try fewer levels, or fewer cells in the first row"
        )
    rows, courant = [], space_courant(case, levels) if way == "space" else case.numerics.courant
    for k, row_counts in enumerate(all_counts):
        step, stepping = step_keys(
            case, row_counts, row_counts if way == "both" else {**all_counts[-1]}, k, courant
        )
        length = max(cell_size(case, name, row_counts[name]) for name in refined)
        stretched = stretch_keys(case, way, k) if key is None else {}
        if stretched and way == "both" and courant is not None:
            step = courant / greatest_wave_rate(case, first) / 2**k
        rows.append(
            Level(
                cell_keys_of(row_counts) | stepping | stretched,
                length,
                total_cells(case, row_counts),
                step,
            )
        )
    names = ", ".join(name.split(".")[1] for name in refined)
    kinds = " and ".join(
        kind
        for kind, parts in (("pipes", pipes_with_cells(case)), ("basins", basins(case)))
        if parts
    )
    all_refined = len(refined) == len(first) and not basins_from_files(case)
    text = f"cells of all {kinds}" if all_refined else f"cells of {names}"
    text += " and stretches of delay lines" if delay_lines(case) and key is None else ""
    return Plan(
        way, "cell size [m]", tuple(rows), f"{text} doubled, {stepping_words(case, way, courant)}"
    )


def coarsest_counts(case, key: str | None, cells: int | None) -> Counts:
    """Numbers of cells of the first row, as from `cell_counts`."""
    own_counts = cell_counts(case)
    if cells is None:
        return own_counts
    if cells < 1:
        raise FvsolveError(f"cells = {cells} is too few; expected at least 1")
    if key in own_counts:
        return own_counts | scaled({key: own_counts[key]}, cells / max(own_counts[key]))
    return scaled(own_counts, cells / most_cells(own_counts))


def space_courant(case, levels: int) -> float | None:
    """Courant number of the finest row, with a time error of about a hundredth of the space error there.

    With Courant number C, cell size dx and orders p in space and q in time, the time error is C^q dx^q and the space
    error dx^p. If p > q, their ratio grows by 2^(p - q) from row to row. The result is at least `LEAST_COURANT`, but at
    most the Courant number of the case, and None if the case states none.
    """
    numerics = case.numerics
    if numerics.courant is None:
        return None
    p, q = scheme_order(case), METHODS[numerics.method].order
    share = STEP_ERROR_SHARE * 2.0 ** (-(levels - 1) * max(p - q, 0))
    return min(numerics.courant, max(LEAST_COURANT, float(f"{share ** (1.0 / q):.2g}")))


def step_keys(
    case, cells: Counts, step_cells: Counts, k: int, courant: float | None
) -> tuple[float, dict]:
    """(time step [s], overrides that set it) of row k: by the Courant number, or from the step that the case states.

    cells : numbers of cells of row k; step_cells : numbers of cells whose wave rate sets the step. If both are the same
    object, the step is refined with the cells: a step that the case states is halved k times; otherwise the step is the
    same in all rows. Under error control it is NaN.
    """
    numerics = case.numerics
    if numerics.rtol is not None:
        return math.nan, {}
    if numerics.step is not None:
        halved = step_cells is cells
        finest = (
            numerics.step
            if halved
            else min(numerics.step, 1.0 / greatest_wave_rate(case, step_cells))
        )
        step = finest / 2**k if halved else finest
        return step, {"numerics.step": step}
    step = courant / greatest_wave_rate(case, step_cells)
    return step, {} if step_cells is cells else {"numerics.step": step}


def stepping_words(case, way: str, courant: float | None) -> str:
    """Text on the time steps of a refinement with way = "both" or "space"."""
    numerics = case.numerics
    if numerics.rtol is not None:
        return f"steps by error, rtol = {numerics.rtol:g} in all rows"
    if way == "space":
        finest = "" if courant is None else f": Courant number {courant:g}"
        return f"one step for all rows, the step of the finest row{finest}"
    if numerics.step is not None or delay_lines(case):
        return "steps halved too"
    return f"Courant number {numerics.courant:g} in all rows"


# time -------------------------------------------------------------------------------------------------------------


def time_plan(case, key: str | None, levels: int) -> Plan:
    """Plan in which the step is halved from row to row, or the tolerance divided by ten, with constant cells.

    Raises FvsolveError if the method does not permit it.
    """
    numerics, count = case.numerics, total_cells(case, cell_counts(case))
    by_error = key == "numerics.rtol" or (key is None and numerics.rtol is not None)
    if by_error:
        if numerics.method != AUTO and not METHODS[numerics.method].adaptive:
            raise FvsolveError(
                f"{numerics.method} estimates no error, so rtol cannot be refined; expected "
                "numerics.step, or another method"
            )
        first = max(FIRST_RTOL, numerics.rtol or 0.0)
        tolerances = [first / 10.0**k for k in range(levels)]
        rows = tuple(Level({"numerics.rtol": rtol}, rtol, count, math.nan) for rtol in tolerances)
        return Plan(
            "time",
            "rtol",
            rows,
            "rtol divided by ten, on one grid" if count else "rtol divided by ten",
        )
    if numerics.method == AUTO:
        raise FvsolveError(
            'method "auto" chooses its steps by their error; expected the key numerics.rtol'
        )
    step = first_step(case)
    steps = [step / 2**k for k in range(levels)]
    rows = tuple(Level({"numerics.step": h}, h, count, h) for h in steps)
    return Plan("time", "step [s]", rows, "steps halved, on one grid" if count else "steps halved")


def first_step(case) -> float:
    """Longest time step of a refinement in time [s].

    It is the step that the case states, otherwise the step for its Courant number (0.9 if none is stated). A step below
    the output interval is shortened to a whole fraction of this interval. If the case states no step and has neither
    pipes nor basins, the result is the output interval.
    """
    numerics, every = case.numerics, case.output.every
    if numerics.step is not None:
        return numerics.step
    if not (pipes(case) or basins(case)):
        return every
    step = (numerics.courant or 0.9) / greatest_wave_rate(case, cell_counts(case))
    return every / math.ceil(every / step) if every > step else step


CPU_BUDGET = 40.0  # approximate CPU time of all rows and their reference [s]
LEAST_CELLS = 8  # least number of cells of the first row, along the pipe or side with most cells
# Calls of a reference per call and stage of the finest row: 4, 2 and 1 times as fine (16 + 4 + 1), 7 stages.
REFERENCE_COST = 21.0 * 7.0


def affordable_plan(
    case,
    refine: str | None,
    key: str | None,
    levels: int | None,
    cells: int | None,
    against: str,
    points: ResultCache | None,
) -> Plan:
    """Plan of a refinement; if neither `cells` nor `key` is given, the study is planned to end within minutes.

    For this the number of cells of the first row is reduced if necessary, unless only steps are refined.
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
    of_case = most_cells(cell_counts(case))
    remark = f"starts with {first} of {of_case} cells, to end within minutes (change with --cells)"
    refinement = refinement_plan(case, refine, key, levels, first)
    return replace(refinement, words=f"{refinement.words}; {remark}")


def first_cells(case, rows: Plan, refine: str | None, levels: int | None, against: str) -> int:
    """Number of cells of the first row: that of the case, halved until the study takes at most `CPU_BUDGET`.

    It is not halved below `LEAST_CELLS`, nor if patches or holes of a basin would then not end between cells.
    rows : plan with the cells of the case
    """
    own_counts = cell_counts(case)
    exact = case.exact is not None or against != "auto" or bool(basins(case))
    cells = most_cells(own_counts)
    seconds = rhs_seconds(study_model(case)) / total_cells(case, own_counts)
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
    row_times = [
        level.cells * (numerics.end - numerics.start) / level.step * seconds
        for level in rows.levels
    ]
    if any(math.isnan(seconds_of_row) for seconds_of_row in row_times):
        return 0.0
    return stages * sum(row_times) + (0.0 if exact else REFERENCE_COST * row_times[-1])
