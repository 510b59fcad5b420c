"""Overrides that change the resolution of a case by a factor."""

from __future__ import annotations

from typing import Any

from fvsolve.studies.accuracy.case_resolution import basins_from_files, cell_counts, is_valid, scaled
from fvsolve.studies.accuracy.case_resolution import cell_keys_of as cell_keys
from fvsolve.studies.delay_line_keys import delay_lines, fixed_choices, slowest_line


def refined_keys(case, times: float) -> dict[str, Any]:
    """Overrides that multiply the resolution by `times`: cells, stretches of delay lines, steps and tolerances.

    The tolerance `rtol` is divided by the square of `times`. The Courant number stays, except in cases with delay
    lines, see `refined_step_keys`. The result is empty if nothing can be refined, or if the coarser case is invalid,
    for example because a patch of a basin would begin within a cell.
    """
    keys = cell_keys(scaled(cell_counts(case), times))
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
    return keys | fixed_choices(case)


def refined_step_keys(case, times: float) -> dict[str, Any]:
    """Overrides with which a case with delay lines takes `times` as many steps; empty if the case states the step.

    If the case states a Courant number and has no cells, this number changes. Otherwise the key `cells` of the slowest
    line changes, which then sets the step.
    """
    if case.numerics.step is not None:
        return {}
    if case.numerics.courant is not None and not cell_counts(case):
        return {"numerics.courant": case.numerics.courant / times}
    name = slowest_line(case)
    return {f"links.{name}.cells": max(1, round(case.links[name].cells * times))}


def fixed_basins(case) -> list[str]:
    """Names of basins whose cells come from a file, so that their resolution cannot change."""
    return basins_from_files(case)
