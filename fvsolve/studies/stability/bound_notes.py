"""Notes on a row of a stability study: bounds that differ from the actual limit, and the reasons."""

from __future__ import annotations

import numpy as np

from fvsolve.errors import listing
from fvsolve.studies.linear.operating_point import has_limiter
from fvsolve.studies.stability.vector_growth import TooLarge

AGREEMENT = 0.02  # relative difference of a bound and the prediction below which no note is needed
GROWTH_FLOOR = 1e-9  # of the greatest wave rate or eigenvalue: real parts below are round-off


def bound_notes(row, side, system) -> list[str]:
    """Notes on a row of a stability study, as texts.

    row : `StabilityRow`; side : `LinearSystem` of its scheme
    system : result of `growth_method`, which computes the growth of deviations; None for a limited scheme
    """
    texts = [*case_notes(row, side)]
    if row.limited:
        return texts + limiter_notes(row, side.at.model)
    if not np.isfinite(row.predicted):
        return [
            *texts,
            "in linearised form no step up to 1e4 / ||J|| fails (J: Jacobian)",
            *nonlinear_failure_notes(row),
        ]
    if "eigenvalues" not in row.left_out:
        texts += eigenvalue_notes(row, system)
    texts += field_of_values_notes(row, side)
    texts += von_neumann_notes(row)
    if np.isinf(row.measured):
        texts.append(f"no real run fails, up to h = {row.measured_up_to:.3g} s: the state moves away from the "
                     "linearised state, or nonlinear laws stop the growth")  # fmt: skip
    if np.isfinite(row.difference) and abs(row.difference) > 0.01:
        texts.append(
            f"prediction and measurement differ by {100 * row.difference:+.1f} %: {difference_reason(row, side)}"
        )
    return texts


def difference_reason(row, side) -> str:
    """Reason why the limits of real runs and of the linear system differ; row, side : as in `bound_notes`."""
    if not state_moves(side):
        return "the deviation does not stay linear"
    return (f"{row.steps} steps of the predicted limit take {row.steps * row.predicted:.3g} s, and meanwhile the state "
            "leaves the linearised state; the prediction is for that state only")  # fmt: skip


def nonlinear_failure_notes(row) -> list[str]:
    """Note on real runs that fail although the linear system never fails, as a list; empty if they do not fail.

    row : `StabilityRow`
    """
    if not np.isfinite(row.measured):
        return []
    return [f"only the linear system never fails; real runs fail from h = {row.measured:.5g} s on: in {row.steps} such "
            "steps the solution leaves the linearised state, and nonlinear laws determine the growth"]  # fmt: skip


def case_notes(row, side) -> list[str]:
    """Notes on the operating point and the case, which do not depend on the method; row, side : as in `bound_notes`."""
    texts = []
    growing = row.greatest_real > 0.0
    if growing and row.greatest_real > GROWTH_FLOOR * max(row.rate, np.abs(side.spectrum.values).max(initial=0.0)):
        texts.append(
            f"the case itself is unstable, with a growth rate of {row.greatest_real:.3g} 1/s, not because of long steps"
        )
    if side.full_form is not side.form:
        texts.append(f"{listing(side.idle)}: free motion stores no energy, but states with energy depend on it; "
                     "the norm includes this motion, with the least weight of all states")  # fmt: skip
    elif side.idle:
        texts.append(f"{listing(side.idle)}: free motion stores no energy and is left out")
    model = side.at.model
    if model.cells and model.case.scalars and model.case.numerics.scheme != "upwind" and not has_limiter(model):
        texts.append("scalars in pipes are computed without slopes in cells, because their limiter has no derivative")
    if state_moves(side):
        texts.append("the state is not steady: deviations are measured from a run that starts at this state, with "
                     "schedules held constant")  # fmt: skip
    return texts


def state_moves(side) -> bool:
    """True if the operating point of the `LinearSystem` `side` is not steady."""
    return bool(np.max(np.abs(side.at.rate) / side.at.model.scale) > 1e-9)


def eigenvalue_notes(row, system) -> list[str]:
    """Notes on the bound by eigenvalues, compared with the predicted limit; row, system : as in `bound_notes`."""
    if np.isinf(row.eigenvalues) or row.eigenvalues > (1.0 + AGREEMENT) * row.predicted:
        if np.isinf(row.eigenvalues):
            return ["eigenvalues allow every step, but deviations grow at some steps: the Jacobian J is not normal"]
        try:
            after = system.failing_after(0.99 * row.eigenvalues)
        except TooLarge:
            after = 0
        if after:
            return [f"eigenvalues are misleading: the Jacobian J is not normal; 1 % below their limit growth exceeds "
                    f"{row.threshold:g} after {after} steps"]  # fmt: skip
        return ["eigenvalues allow longer steps than the growth of deviations does: the Jacobian J is not normal"]
    if row.eigenvalues < (1.0 - AGREEMENT) * row.predicted:
        return [f"above the limit of the eigenvalues a mode grows, but by less than a factor of {row.threshold:g} in "
                f"{row.steps} steps: longer runs fail at smaller steps"]  # fmt: skip
    return []


def field_of_values_notes(row, side) -> list[str]:
    """Notes on the bound by the field of values, which is too strict with pipe ends of high order.

    row, side : as in `bound_notes`
    """
    if np.isnan(row.field_of_values) or row.field_of_values > (1.0 - AGREEMENT) * row.predicted:
        return []
    if row.field_of_values == 0.0:
        reach = float(side.field.real.max())
        if reach > GROWTH_FLOOR * np.abs(side.field).max():
            return [f"the field of values allows no step: it reaches {reach:.3g} 1/s into the right half plane; energy "
                    "can grow at first (pipe ends with a scheme above first order, or a gain in the case). This is not "
                    "a failure"]  # fmt: skip
        return [
            "the field of values allows no step: it touches the imaginary axis at points outside the stability region"
        ]
    return ["the bound by the field of values is below the predicted limit here"]


def von_neumann_notes(row) -> list[str]:
    """Notes on von Neumann's limit (interior of a uniform pipe), compared with the limit of the case."""
    if np.isnan(row.von_neumann):
        return []
    if row.von_neumann > (1.0 + AGREEMENT) * row.predicted:
        return ["von Neumann's limit is misleading: pipe ends, nodes or other parts limit the step, not the interior"]
    if row.von_neumann < (1.0 - AGREEMENT) * row.predicted:
        return ["von Neumann's limit holds for any number of steps and any wavelength; in this case growth remains "
                f"below the threshold of {row.threshold:g} in {row.steps} steps"]  # fmt: skip
    return []


def limiter_notes(row, model) -> list[str]:
    """Notes on a limited scheme, whose weights are held constant in predictions."""
    frozen = "these weights give the limits in this row"
    if model.cavitates:
        frozen = "in pipes with cavities only the weights of upwind are used"
    elif model.basins:
        frozen = "in basins only the weights of upwind are used"
    texts = [f"{row.scheme} has no derivative at a constant state, so its limit is measured; in predictions its "
             f"weights are held constant: {frozen}"]  # fmt: skip
    if np.isfinite(row.longer):
        texts.append(f"Euler with a limiter has no sharp limit: Courant number {row.courant(row.measured):.3g} in "
                     f"{row.steps} steps, {row.courant(row.longer):.3g} in {10 * row.steps} steps")  # fmt: skip
    return texts
