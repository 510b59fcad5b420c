"""Delay lines (pipes without cells) in studies: names, keys that select the pipe model, cell averages of waves."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from fvsolve.model.delay_line_selection import line_methods, slowest_pipe

POINTS = 5  # points of a cell of a line at which waves are evaluated
WEIGHTS = np.array([275.0, 100.0, 402.0, 100.0, 275.0]) / 1152.0  # at the middles of fifths; exact to degree 5
READING_ORDER = 6.0  # order of the interpolation in the history of a line
EXPECTED_ORDER = (
    "delay lines carry jumps exactly, and smooth waves without friction exactly at whole steps. Expected orders: 2 in "
    "the length of stretches with friction (1 behind jumps); 2 in the step behind kinks (about 1.5 in L2, 1 in max) or "
    "in lines shorter than a step, else up to 6 in the step; the order of the method with parts that store fluid or "
    "energy"
)
EXACT_NOTE = (
    "delay lines are exact here, at any step and length of stretches: all errors are rounding errors, except errors of "
    "values along the lines"
)


def delay_lines(case) -> list[str]:
    """Names of the pipes of a case that are delay lines, or may become delay lines by `pipe_model = "auto"`."""
    return [name for name, pipe in line_methods(case).items() if pipe.pipe_model == "delay-line"]


def slowest_line(case) -> str:
    """Name of the delay line with the longest travel time; its key `cells` limits the step if the case states none."""
    return slowest_pipe(case, delay_lines(case))


def fixed_choices(case) -> dict[str, str]:
    """Overrides that replace `pipe_model = "auto"` by its present choice for each pipe.

    With these overrides the changes of a study do not alter the choice. Pipes with "auto" that cannot be delay lines
    are left out.
    """
    from fvsolve.run import model_of

    undecided = [
        name for name in delay_lines(case) if (case.links[name].pipe_model or case.numerics.pipe_model) == "auto"
    ]
    if not undecided:
        return {}
    model = model_of(case)
    pairs = zip(model.pipes, model.tables.pipes["delay"] >= 0, strict=True)
    return pipe_model_keys(
        {pipe.name: "delay-line" if delayed else "finite-volume" for pipe, delayed in pairs if pipe.name in undecided}
    )


def as_cells(names: Iterable[str]) -> dict[str, str]:
    """Overrides with which all pipes of a case have cells; names : its delay lines."""
    return {"numerics.pipe_model": "finite-volume"} | pipe_model_keys(dict.fromkeys(names, "finite-volume"))


def cells_for_lines(case, step: float) -> dict:
    """Overrides with which all delay lines have cells that a wave crosses in at most the time `step` [s].

    For step = 0 the numbers of cells stay as the case states them.
    """
    delayed = delay_lines(case)
    keys = as_cells(delayed)
    for name in delayed if step > 0.0 else ():
        keys[f"links.{name}.cells"] = max(1, math.ceil(case.links[name].length / case.wave_speed(name) / step))
    return keys


def pipe_model_keys(chosen: dict[str, str]) -> dict[str, str]:
    """Overrides of the pipe models; chosen : pipe -> "finite-volume" or "delay-line"."""
    return {f"links.{name}.pipe_model": line for name, line in chosen.items()}


def line_averages(run_data, t: float, out: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Averages of the waves in delay lines over the cells of their output, at the time t [s].

    out : output array of the right-hand side at t, as from `RunData.evaluate`
    Returns {name of the delay line: (r + l, r - l)}, float64[cells] each [kg/s], with the forward wave r and the
    backward wave l.
    """
    sums = {}
    for k, (r, l) in run_data.along(t, out, POINTS).items():  # noqa: E741
        r, l = r.reshape(-1, POINTS) @ WEIGHTS, l.reshape(-1, POINTS) @ WEIGHTS  # noqa: E741
        sums[run_data.model.pipes[k].name] = r + l, r - l
    return sums
