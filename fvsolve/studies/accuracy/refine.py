"""The rows of a refinement: which keys a case is given, from coarse to fine. Knows cases; runs nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fvsolve.case.defaults import link_said
from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.steppers.methods import AUTO, METHODS
from fvsolve.studies.accuracy.cells import (
    Counts,
    basins,
    counts,
    from_files,
    greatest_rate,
    in_cells,
    keys,
    most,
    pipes,
    refinable,
    scaled,
    size,
    space_order,
    total,
)
from fvsolve.studies.lines import lines
from fvsolve.studies.outcome import prepared

WAYS = ("both", "space", "time")
TIME_KEYS = ("numerics.step", "numerics.courant", "numerics.rtol")
LEVELS = {"both": 4, "space": 4, "time": 6}
LOOSE = 1e-4  # tolerance that a refinement of it begins with, unless the case is looser
MOST_CELLS = 10**6  # of a row
STEP_SHARE = 0.01  # of what cells do wrong on the finest row that its step may, about, where space alone is refined
LEAST_COURANT = 0.02  # below which that is not worth its time


@dataclass(frozen=True)
class Level:
    """One row: what is set on the case, the size that halves from row to row, and the words of the table.

    set : dotted keys -> values; size : of cells [m], steps [s] or a tolerance; cells : of all pipes and basins
    step : fixed step [s], NaN where steps follow a tolerance
    """

    set: dict
    size: float
    cells: int
    step: float


@dataclass(frozen=True)
class Plan:
    """A refinement: way "both" | "space" | "time", what `size` is, the rows, and what is to be said of it."""

    way: str
    measure: str  # "cell size [m]" | "step [s]" | "rtol"
    levels: tuple[Level, ...]
    words: str


def resolutions(case) -> dict[str, str]:
    """Key -> the way it refines, of every key of a case that is a resolution."""
    found = dict.fromkeys(counts(case), "both")
    if lines(case):
        found["numerics.accuracy"] = "space"
    if pipes(case) or basins(case):
        found["numerics.courant"] = "time"
    if by_cell_time(case):
        found["numerics.cell_time"] = "both"
    return found | {"numerics.step": "time", "numerics.rtol": "time"}


def by_cell_time(case) -> list[str]:
    """Pipes that state no cells."""
    return [name for name in in_cells(case) if "cells" not in link_said(case.raw, name)]


def plan(
    case, refine: str | None = None, key: str | None = None, levels: int | None = None, cells: int | None = None
) -> Plan:
    """The rows of a refinement of a case, coarsest first.

    refine : "both" (cells, stretches of delay lines and steps halved together, the default with any), "space" (cells
    and stretches halved, one step that suits the finest), "time" (steps halved, or rtol where the case steps by error;
    the default without cells)
    key : one resolution in place of all; cells : of the coarsest row, along the pipe or side with most (the others in
    proportion). Raises FvsolveError for a way, key or number of levels that cannot be.
    """
    known = resolutions(case)
    if key is not None and key not in known:
        near = did_you_mean(key, known)
        raise FvsolveError(f"{key} is no resolution{near}; those of this case are {', '.join(known)}")
    refine = refine or (known[key] if key else "both" if counts(case) or lines(case) else "time")
    if refine not in WAYS:
        raise FvsolveError(f'refine = "{refine}" is unknown{did_you_mean(refine, WAYS)}; wanted {", ".join(WAYS)}')
    if refine != "time" and not lines(case):
        refinable(case)
    if key is not None and (known[key] == "time") != (refine == "time"):
        raise FvsolveError(f'{key} refines {"time" if known[key] == "time" else "space"}, not "{refine}"')
    levels = LEVELS[refine] if levels is None else levels
    if levels < 2:
        raise FvsolveError(f"levels = {levels}; wanted 2 at least, and 3 for a fitted order")
    if refine == "time" and cells is not None:
        raise FvsolveError(
            f"cells = {cells}: here steps alone are refined, cells stay; leave it out, or set the case's"
        )
    if refine == "time":
        return time_plan(case, key, levels)
    if lines(case) and (key == "numerics.accuracy" or not counts(case)):
        if cells is not None:
            raise FvsolveError(f"cells = {cells}: those of delay lines are places where fields are told; leave it out")
        return lines_plan(case, refine, levels)
    return space_plan(case, refine, key, levels, cells)


# delay lines ------------------------------------------------------------------------------------------------------


def lines_plan(case, way: str, levels: int) -> Plan:
    """What lines may be off by halved from row to row, which cuts them into twice the stretches; steps with it, or not.

    Sizes are steps, or without these the stretches themselves of the line that has most in the last row.
    """
    count, step = total(case, counts(case)), first_step(case) if case.numerics.rtol is None else math.nan
    rows = [lines_keys(case, way, k) for k in range(levels)]
    if way == "both":
        by_error = math.isnan(step)
        first = 1.0 / greatest_rate(case, counts(case)) if by_error else step
        made = [Level(row if by_error else row | {"numerics.step": step / 2**k}, first / 2**k, count, step / 2**k)
                for k, row in enumerate(rows)]  # fmt: skip
        return Plan(way, "longest step [s]" if by_error else "step [s]", tuple(made), STRETCHED[by_error])
    stretches = [prepared(case, row).tables.delays for row in rows]
    most = int(np.argmax(stretches[-1]["stretches"]))
    if stretches[0]["stretches"][most] == stretches[-1]["stretches"][most]:
        raise FvsolveError("a smaller numerics.accuracy cuts no delay line of this case into more stretches, for want "
                           'of friction or because steps are as long; wanted refine "both" or "time"')  # fmt: skip
    made = [Level(row, float(one["tau"][most]), count, step) for row, one in zip(rows, stretches, strict=True)]
    return Plan(way, "stretch [s]", tuple(made), f"{STRETCHES}, one step for all rows")


STRETCHES = "what delay lines may be off by halved, which cuts them into twice the stretches"
STRETCHED = {False: f"{STRETCHES}, and steps with it", True: f"{STRETCHES}, and their longest step with it"}


def lines_keys(case, way: str, k: int) -> dict:
    """Keys by which row k has delay lines cut into stretches 2^-k as long, and steps that go by their cells too."""
    found = {"numerics.accuracy": case.numerics.accuracy / 2**k} if lines(case) else {}
    if way == "both" and (case.numerics.rtol is not None or (counts(case) and case.numerics.courant is not None)):
        found |= {f"links.{name}.cells": pipes(case)[name].cells * 2**k for name in lines(case)}
    return found


# space ------------------------------------------------------------------------------------------------------------


def space_plan(case, way: str, key: str | None, levels: int, cells: int | None) -> Plan:
    """Cells of all pipes and basins, or of the one that the key names, doubled from row to row."""
    first = coarsest(case, key, cells)
    moving = [name for name in first if key in (None, name)]
    if key == "numerics.cell_time":
        moving = [f"links.{name}.cells" for name in by_cell_time(case)]
    now = [{name: tuple(n * 2**k for n in numbers) if name in moving else numbers for name, numbers in first.items()}
           for k in range(levels)]  # fmt: skip
    finest = total(case, now[-1])
    if finest > MOST_CELLS:
        raise FvsolveError(f"the finest of {levels} levels would have {finest:.3g} cells; {MOST_CELLS:.0e} at most: "
                           "fewer levels, or fewer cells to begin with")  # fmt: skip
    rows, courant = [], space_courant(case, levels) if way == "space" else case.numerics.courant
    for k, own in enumerate(now):
        step, stepping = stepping_of(case, own, own if way == "both" else {**now[-1]}, k, courant)
        length = max(size(case, name, own[name]) for name in moving)
        stretched = lines_keys(case, way, k) if key is None else {}
        if stretched and way == "both" and courant is not None:
            step = courant / greatest_rate(case, first) / 2**k
        rows.append(Level(keys(own) | stepping | stretched, length, total(case, own), step))
    names = ", ".join(name.split(".")[1] for name in moving)
    everything = " and ".join(word for word, there in (("pipes", in_cells(case)), ("basins", basins(case))) if there)
    what = f"cells of all {everything}" if len(moving) == len(first) and not from_files(case) else f"cells of {names}"
    what += " and stretches of delay lines" if lines(case) and key is None else ""
    return Plan(way, "cell size [m]", tuple(rows), f"{what} doubled, {time_words(case, way, courant)}")


def coarsest(case, key: str | None, cells: int | None) -> Counts:
    """Cells of the first row."""
    found = counts(case)
    if cells is None:
        return found
    if cells < 1:
        raise FvsolveError(f"cells = {cells}; wanted 1 at least")
    if key in found:
        return found | scaled({key: found[key]}, cells / max(found[key]))
    return scaled(found, cells / most(found))


def space_courant(case, levels: int) -> float | None:
    """Courant number of the finest row that makes its step err about a hundredth as much as its cells, or the case's.

    The step errs by C^q dx^q, the cells by dx^p; where p > q the share of the step doubles p - q times a level.
    """
    numerics = case.numerics
    if numerics.courant is None:
        return None
    p, q = space_order(case), METHODS[numerics.method].order
    share = STEP_SHARE * 2.0 ** (-(levels - 1) * max(p - q, 0))
    return min(numerics.courant, max(LEAST_COURANT, float(f"{share ** (1.0 / q):.2g}")))


def stepping_of(case, cells: Counts, kept: Counts, k: int, courant: float | None) -> tuple[float, dict]:
    """(step [s], keys) of a row: at a Courant number on the cells `kept`, or the case's step halved k times."""
    numerics = case.numerics
    if numerics.rtol is not None:
        return math.nan, {}
    if numerics.step is not None:
        halved = kept is cells
        finest = numerics.step if halved else min(numerics.step, 1.0 / greatest_rate(case, kept))
        step = finest / 2**k if halved else finest
        return step, {"numerics.step": step}
    step = courant / greatest_rate(case, kept)
    return step, {} if kept is cells else {"numerics.step": step}


def time_words(case, way: str, courant: float | None) -> str:
    numerics = case.numerics
    if numerics.rtol is not None:
        return f"steps by error, rtol = {numerics.rtol:g} in all rows"
    if way == "space":
        finest = "" if courant is None else f": Courant number {courant:g}"
        return f"one step for all rows, that of the finest{finest}"
    if numerics.step is not None or lines(case):
        return "steps halved with them"
    return f"Courant number {numerics.courant:g} in all rows"


# time -------------------------------------------------------------------------------------------------------------


def time_plan(case, key: str | None, levels: int) -> Plan:
    """Steps halved from row to row on one grid, or tolerances divided by ten."""
    numerics, count = case.numerics, total(case, counts(case))
    by_error = key == "numerics.rtol" or (key is None and numerics.rtol is not None)
    if by_error:
        if numerics.method != AUTO and not METHODS[numerics.method].adaptive:
            raise FvsolveError(f"{numerics.method} estimates no error, so rtol is no resolution of it; "
                               "wanted numerics.step, or another method")  # fmt: skip
        first = max(LOOSE, numerics.rtol or 0.0)
        tolerances = [first / 10.0**k for k in range(levels)]
        rows = tuple(Level({"numerics.rtol": rtol}, rtol, count, math.nan) for rtol in tolerances)
        return Plan("time", "rtol", rows, "rtol divided by ten, on one grid" if count else "rtol divided by ten")
    if numerics.method == AUTO:
        raise FvsolveError('method "auto" goes by the error of its steps; refine numerics.rtol')
    step = first_step(case)
    steps = [step / 2**k for k in range(levels)]
    rows = tuple(Level({"numerics.step": h}, h, count, h) for h in steps)
    return Plan("time", "step [s]", rows, "steps halved, on one grid" if count else "steps halved")


def first_step(case) -> float:
    """The longest step of a time refinement [s]: the case's, made to fit between two rows of its history."""
    numerics, every = case.numerics, case.output.every
    if numerics.step is not None:
        return numerics.step
    if not (pipes(case) or basins(case)):
        return every
    step = (numerics.courant or 0.9) / greatest_rate(case, counts(case))
    return every / math.ceil(every / step) if every > step else step
