"""Delay lines under a study: which pipes, as keys, what travels in them, what is expected. Runs nothing."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from fvsolve.model.delay import followed

POINTS = 5  # of a cell of a line, at which it is read
WEIGHTS = np.array([275.0, 100.0, 402.0, 100.0, 275.0]) / 1152.0  # in the middles of fifths; exact to degree 5
READING = 6.0  # order by which lines read what was sent
EXPECTED = (
    "delay lines carry jumps, and smooth waves without friction at whole steps, exactly; expected is order 2 in the "
    "length of stretches with friction (1 behind jumps) and in steps behind kinks (about 1.5 in L2, 1 in max) or in "
    "lines shorter than steps, else up to 6 in steps, and that of the method where something stores"
)
EXACT = (
    "delay lines are exact here, at any step and stretch: rows are right to rounding, but for fields along the lines"
)


def lines(case) -> list[str]:
    """Pipes that are delay lines; of `settled` cases, where none is left to `auto`."""
    return [name for name, one in followed(case).items() if one.line == "delay"]


def slowest(case) -> str:
    """The delay line that waves pass last, whose `cells` say how long steps are."""
    return max(lines(case), key=lambda name: case.links[name].length / case.wave_speed(name))


def settled(case) -> dict[str, str]:
    """Keys by which pipes that `auto` decides stay what they are now, whatever a study changes."""
    from fvsolve.run import model_of

    undecided = [name for name in lines(case) if (case.links[name].line or case.numerics.line) == "auto"]
    if not undecided:
        return {}
    model = model_of(case)
    pairs = zip(model.pipes, model.tables.pipes["delay"] >= 0, strict=True)
    return as_lines({pipe.name: "delay" if delayed else "cells" for pipe, delayed in pairs if pipe.name in undecided})


def in_cells(names: Iterable[str]) -> dict[str, str]:
    """Keys by which these lines, all that a case has, are cells."""
    return {"numerics.line": "cells"} | as_lines(dict.fromkeys(names, "cells"))


def cells_for_lines(case, step: float) -> dict:
    """Keys by which lines are cells that a wave crosses in a step [s], or as many as they are told by without one."""
    delayed = lines(case)
    found = in_cells(delayed)
    for name in delayed if step > 0.0 else ():
        found[f"links.{name}.cells"] = max(1, math.ceil(case.links[name].length / case.wave_speed(name) / step))
    return found


def as_lines(chosen: dict[str, str]) -> dict[str, str]:
    """Keys that say how pipes are followed."""
    return {f"links.{name}.line": line for name, line in chosen.items()}


def averages(slate, t: float, out: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Delay line -> sum and difference of both waves [kg/s], averaged over the cells that it is told by."""
    found = {}
    for k, (r, l) in slate.along(t, out, POINTS).items():  # noqa: E741
        r, l = r.reshape(-1, POINTS) @ WEIGHTS, l.reshape(-1, POINTS) @ WEIGHTS  # noqa: E741
        found[slate.model.pipes[k].name] = r + l, r - l
    return found
