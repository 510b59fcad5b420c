"""Overrides that change the resolution of a case by a factor."""

from __future__ import annotations

from typing import Any

from fvsolve.studies.accuracy.cells import counts, from_files, loads, scaled
from fvsolve.studies.accuracy.cells import keys as cell_keys
from fvsolve.studies.lines import lines, settled, slowest


def finer(case, times: float) -> dict[str, Any]:
    """Overrides for `times` the resolution: cells of pipes and basins, stretches of delay lines, steps, tolerances.

    Tolerances change with the inverse square; Courant numbers stay. Empty if the coarser case is invalid, for example
    because a patch of a basin would begin within a cell.
    """
    keys = cell_keys(scaled(counts(case), times))
    if times < 1.0 and not loads(case, scaled(counts(case), times)):
        return {}
    numerics = case.numerics
    if numerics.step is not None:
        keys["numerics.step"] = numerics.step / times
    if numerics.rtol is not None:
        keys["numerics.rtol"] = min(numerics.rtol / times**2, 0.5)
    if lines(case):
        keys["numerics.delay_tolerance"] = min(numerics.delay_tolerance / times, 0.5)
        keys |= finer_steps(case, times)
    return keys | settled(case)


def finer_steps(case, times: float) -> dict[str, Any]:
    """Overrides with which delay lines take `times` as many steps.

    Without cells it is the Courant number, otherwise `cells` of the slowest line, which sets the step.
    """
    if case.numerics.step is not None:
        return {}
    if case.numerics.courant is not None and not counts(case):
        return {"numerics.courant": case.numerics.courant / times}
    name = slowest(case)
    return {f"links.{name}.cells": max(1, round(case.links[name].cells * times))}


def kept(case) -> list[str]:
    """Basins whose cells come from a file; no resolution changes them."""
    return from_files(case)
