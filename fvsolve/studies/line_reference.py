"""Reference runs of a case with delay lines in place of cells.

Under the linear law waves travel along delay lines unchanged except for friction, so pulses and kinks keep their
shape. The errors of two such runs with short steps and many stretches are far smaller than those of cells, and their
difference shows them. The second run has a quarter of the step and an eighth of the delay tolerance of the first, and
stretches for the friction of the greatest flows of the first.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from fvsolve.case import load
from fvsolve.core.run import Result, model_of, run
from fvsolve.errors import CaseError, RunError
from fvsolve.features.delay_lines.choice import reason_for_cells
from fvsolve.features.delay_lines.feature import lines_of
from fvsolve.studies.resolution import pipe_model_keys, pipes

# steps of the first reference: for each step of the run, and at least
FIRST_STEPS, FEWEST_STEPS = 4, 4000
STEP_RATIO, TOLERANCE_RATIO = 4, 8.0
# of the second reference: the least that is cheap enough
TOLERANCES = (2.5e-5, 1e-4, 4e-4, 1.6e-3, 6.4e-3)
# least tolerance if schedules jump, because smaller reflections of jumps are many
LEAST_WITH_JUMPS = 4e-4
MOST_STRETCH_STEPS = 2e7  # number of steps times stretches below which a tolerance is cheap enough
METHOD = "rk4"


def can_be_lines(case: Any) -> bool:
    """True if all pipes of a case can be delay lines, and no other part of it has cells."""
    lines = pipes(case)
    if not lines or case.meshes or any(link.kind == "conduit" for link in case.links.values()):
        return False
    if any(
        (line.pipe_model or case.numerics.pipe_model) == "quasi-steady" for line in lines.values()
    ):
        return False
    return not any(reason_for_cells(case, name, line) for name, line in lines.items())


def line_references(
    own: Result, case: Any, settings: dict[str, Any], progress: Callable[[str], None] | None
) -> dict[int, Result]:
    """Two finished runs of a case with delay lines : steps for each step of the run -> result, or {}.

    own : result of the case; settings : changed keys of both runs; progress : called with a text before each run
    """
    steps, duration = own.summary["steps"], own.summary["t"] - case.numerics.start
    if not can_be_lines(case) or own.reason != "finished" or steps == 0 or not duration > 0.0:
        return {}
    first = max(FIRST_STEPS * steps, FEWEST_STEPS)
    try:
        step = duration / (STEP_RATIO * first)
        steps = STEP_RATIO * first
        velocity = case.numerics.delay_velocity
        tolerance = cheap_tolerance(case, step, steps, velocity)
        if progress is not None:
            progress("delay lines with short steps")
        keys = line_keys(case, duration / first, min(tolerance * TOLERANCE_RATIO, 1.0), velocity)
        flows = {name: [f"links.{name}.flow@{end}" for end in (0, 1)] for name in pipes(case)}
        named = settings.get("output.probes", [probe.text for probe in case.output.probes])
        added = [text for pair in flows.values() for text in pair if text not in named]
        coarse = run(
            load(case, keys), set=settings | {"output.probes": [*named, *added]}, pictures=False
        )
        if coarse.reason != "finished":
            return {}
        if progress is not None:
            progress("delay lines with short steps")
        for name, pipe in pipes(case).items():
            section = 0.25 * math.pi * pipe.diameter**2
            for text in flows[name]:  # at both ends
                velocity = max(velocity, float(np.abs(coarse.si(text)).max()) / section)
        tolerance = cheap_tolerance(case, step, steps, velocity)
        fine = run(
            load(case, line_keys(case, step, tolerance, velocity)), set=settings, pictures=False
        )
    except (CaseError, RunError):
        return {}
    return {1: coarse, STEP_RATIO: fine} if fine.reason == "finished" else {}


def line_keys(case: Any, step: float, tolerance: float, velocity: float) -> dict[str, Any]:
    """Overrides with which all pipes are delay lines with a fixed step [s].

    tolerance, velocity : `delay_tolerance` and `delay_velocity` [m/s]
    """
    keys: dict[str, Any] = {
        "numerics.pipe_model": "delay-line",
        "numerics.method": METHOD,
        "numerics.step": step,
    }
    keys |= {"numerics.delay_tolerance": tolerance, "numerics.delay_velocity": velocity}
    return keys | pipe_model_keys(
        {name: "delay-line" for name, line in pipes(case).items() if line.pipe_model}
    )


def cheap_tolerance(case: Any, step: float, steps: int, velocity: float) -> float:
    """Least of `TOLERANCES` whose stretches, times the number of steps, are below `MOST_STRETCH_STEPS`."""
    for tolerance in TOLERANCES:
        model = model_of(load(case, line_keys(case, step, tolerance, velocity)))
        if tolerance < LEAST_WITH_JUMPS and any(
            jump for t, jump in model.breaks if t > case.numerics.start
        ):
            continue
        if math.prod((steps, int(lines_of(model)["stretches"].sum()))) <= MOST_STRETCH_STEPS:
            return tolerance
    return TOLERANCES[-1]
