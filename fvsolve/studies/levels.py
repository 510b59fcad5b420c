"""A case at half, twice or four times its resolution: which keys say so. Knows cases; runs nothing."""

from __future__ import annotations

from typing import Any

from fvsolve.studies.accuracy.cells import counts, from_files, loads, scaled
from fvsolve.studies.accuracy.cells import keys as cell_keys
from fvsolve.studies.lines import lines, settled, slowest


def finer(case, times: float) -> dict[str, Any]:
    """Keys of a case of `times` the resolution: cells of pipes and basins, stretches of delay lines, steps, and
    tolerances, which go by the square of it. Courant numbers stay.

    Empty where its cells cannot be said so, as patches of a basin would begin within one.
    """
    found = cell_keys(scaled(counts(case), times))
    if times < 1.0 and not loads(case, scaled(counts(case), times)):
        return {}
    numerics = case.numerics
    if numerics.step is not None:
        found["numerics.step"] = numerics.step / times
    if numerics.rtol is not None:
        found["numerics.rtol"] = min(numerics.rtol / times**2, 0.5)
    if lines(case):
        found["numerics.accuracy"] = min(numerics.accuracy / times, 0.5)
        found |= finer_steps(case, times)
    return found | settled(case)


def finer_steps(case, times: float) -> dict[str, Any]:
    """Keys by which delay lines take `times` as many steps: without cells the Courant number, else `cells` of the line
    whose places steps go by."""
    if case.numerics.step is not None:
        return {}
    if case.numerics.courant is not None and not counts(case):
        return {"numerics.courant": case.numerics.courant / times}
    name = slowest(case)
    return {f"links.{name}.cells": max(1, round(case.links[name].cells * times))}


def kept(case) -> list[str]:
    """What no resolution changes: basins whose cells a file has."""
    return from_files(case)
