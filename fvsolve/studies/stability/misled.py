"""Where a bound misleads, and why, in words. Knows numbers of rows; computes one power or two."""

from __future__ import annotations

import numpy as np

from fvsolve.errors import listing
from fvsolve.studies.linear.frozen import has_limiter
from fvsolve.studies.stability.carried import TooLarge

CLOSE = 0.02  # bounds that differ by less from the prediction need no word
GROWS = 1e-9  # of the greatest wave rate or eigenvalue: real parts below are round-off


def notes(row, side, system) -> list[str]:
    """What a reader of the row has to know."""
    found = [*of_the_case(row, side)]
    if row.limited:
        return found + of_a_limiter(row, side.at.model)
    if not np.isfinite(row.predicted):
        return [*found, "no step up to 1e4 / ||J|| fails", *of_a_state_left(row)]
    if "eigenvalues" not in row.left_out:
        found += of_eigenvalues(row, system)
    found += of_the_field(row, side)
    found += of_von_neumann(row)
    if np.isinf(row.measured):
        found.append(f"no real run fails, up to h = {row.measured_up_to:.3g} s: the state moves away from where it was "
                     "linearised, or laws that are not linear stop the growth")  # fmt: skip
    if np.isfinite(row.difference) and abs(row.difference) > 0.01:
        found.append(f"prediction and measurement differ by {100 * row.difference:+.1f} %: {why_apart(row, side)}")
    return found


def why_apart(row, side) -> str:
    """Why real runs may fail at another step than the linear system."""
    if not moves(side):
        return "the deviation does not stay linear"
    return (f"{row.steps} such steps take {row.steps * row.predicted:.3g} s, and meanwhile the state leaves the one "
            "that was linearised; the prediction is for that one alone")  # fmt: skip


def of_a_state_left(row) -> list[str]:
    """A run that fails where the linear system never does."""
    if not np.isfinite(row.measured):
        return []
    return [f"that is said of the linear system; real runs fail from h = {row.measured:.5g} s on: in so long a "
            "time they leave the state that was linearised, and laws that are not linear decide"]  # fmt: skip


def of_the_case(row, side) -> list[str]:
    """What is wrong with the state itself."""
    found = []
    grows = row.greatest_real > 0.0
    if grows and row.greatest_real > GROWS * max(row.rate, np.abs(side.spectrum.values).max(initial=0.0)):
        found.append(f"the case itself grows, at {row.greatest_real:.3g} 1/s: long steps do not make it so")
    if side.whole is not side.form:
        found.append(f"{listing(side.idle)}: no energy hangs on it, but it moves what has some: it counts, with the "
                     "least weight of all")  # fmt: skip
    elif side.idle:
        found.append(f"{listing(side.idle)}: no energy hangs on it where it moves freely, and that motion is left out")
    model = side.at.model
    if model.cells and model.case.scalars and model.case.numerics.scheme != "upwind" and not has_limiter(model):
        found.append("scalars in pipes are taken without slopes, whose limiter has no derivative")
    if moves(side):
        found.append("the state moves: runs are compared with a run from the same state, schedules held")
    return found


def moves(side) -> bool:
    """Whether the state does."""
    return bool(np.max(np.abs(side.at.rate) / side.at.model.scale) > 1e-9)


def of_eigenvalues(row, system) -> list[str]:
    """Eigenvalues against powers."""
    if np.isinf(row.eigenvalues) or row.eigenvalues > (1.0 + CLOSE) * row.predicted:
        if np.isinf(row.eigenvalues):
            return ["eigenvalues say that no step fails; powers do, J is not normal"]
        try:
            after = system.failing_after(0.99 * row.eigenvalues)
        except TooLarge:
            after = 0
        if after:
            return [f"eigenvalues mislead: J is not normal, 1 % below their limit growth passes {row.threshold:g} "
                    f"after {after} steps"]  # fmt: skip
        return ["eigenvalues allow longer steps than powers do: J is not normal"]
    if row.eigenvalues < (1.0 - CLOSE) * row.predicted:
        return [f"beyond the eigenvalues' limit a mode grows, but not by {row.threshold:g} in {row.steps} steps: "
                "longer runs fail earlier"]  # fmt: skip
    return []


def of_the_field(row, side) -> list[str]:
    """The field of values against powers: a bound, which ends of high order spoil."""
    if np.isnan(row.field_of_values) or row.field_of_values > (1.0 - CLOSE) * row.predicted:
        return []
    if row.field_of_values == 0.0:
        reach = float(side.field.real.max())
        if reach > GROWS * np.abs(side.field).max():
            return [f"the field of values says 0: it reaches {reach:.3g} 1/s into the right half plane; energy can "
                    "grow at first (ends of a scheme above first order, a gain in the case): no failure"]  # fmt: skip
        return ["the field of values says 0: it touches the imaginary axis, of which the method's region has nothing"]
    return ["the field of values is a bound on the safe side here"]


def of_von_neumann(row) -> list[str]:
    """The inside of a uniform pipe against the whole case."""
    if np.isnan(row.von_neumann):
        return []
    if row.von_neumann > (1.0 + CLOSE) * row.predicted:
        return [
            "von Neumann's limit misleads: not the inside of the pipes sets the step, but ends, nodes or other parts"
        ]
    if row.von_neumann < (1.0 - CLOSE) * row.predicted:
        return ["von Neumann's limit holds for any number of steps and any length of wave; in this pipe and this many "
                "steps growth stays below the threshold"]  # fmt: skip
    return []


def of_a_limiter(row, model) -> list[str]:
    """What frozen weights say, and what they do not."""
    beside = "its weights give the limits beside it"
    if model.cavitates:
        beside = "pipes with cavities know its weights only as upwind"
    elif model.basins:
        beside = "basins know its weights only as upwind"
    found = [f"{row.scheme} has no derivative at a constant state: its limit is measured; frozen, {beside}"]
    if np.isfinite(row.longer):
        found.append(f"Euler with a limiter has no sharp limit: {row.courant(row.measured):.3g} in {row.steps} steps, "
                     f"{row.courant(row.longer):.3g} in {10 * row.steps}")  # fmt: skip
    return found
