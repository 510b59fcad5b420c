"""Row of a stability study: columns, bounds of the step, and notes on bounds that differ from the actual limit.

Arguments of functions that make notes : row, the `StabilityRow`; side, the `LinearSystem` of its scheme; system, the
result of `growth_method`, which computes the growth of deviations
"""

from dataclasses import asdict, dataclass, field

import numpy as np

from fvsolve.core.step_limits.greatest_step import limit_from
from fvsolve.core.steppers import analyse
from fvsolve.core.steppers.tableau import Method
from fvsolve.errors import listing
from fvsolve.studies.linearise import ZERO_TOLERANCE
from fvsolve.studies.operating_point import has_limiter
from fvsolve.studies.work_limit import TooLarge


@dataclass(frozen=True)
class StabilityRow:
    """Limits of the step [s] for a scheme with a method; inf: no failing step found, nan: unknown, see `left_out`.

    when : state about which deviations grow; states : number of states; steps : number of steps over which they grow
    predicted : greatest step with which the linearised case grows by `threshold` at most
    growth, after : greatest growth with the least step that is found to fail, and its number of steps
    where, share : part with the most energy of the grown deviation, and its share of the energy
    measured : limit of real runs, nan also if no safe step is found
    measured_up_to : a step with which real runs fail, or the longest step of real runs if none fails
    eigenvalues, field_of_values, von_neumann : bounds, the greatest steps with which the eigenvalues, the field of
    values, or the waves of a uniform grid are in the stability region
    greatest_real : greatest real part of an eigenvalue [1/s], 0 if none is positive
    rate : greatest wave rate [1/s]; the Courant number is the step times this rate; 0 without cells
    frozen : for a limited scheme, predicted limits with constant weights, by name of the resulting linear scheme
    lines : True for a case with delay lines, for which there are no bounds
    longer : for a limited scheme with Euler, the measured limit for ten times as many steps
    left_out : reason for each missing column
    """

    scheme: str
    method: str
    when: str
    states: int
    steps: int
    threshold: float
    rate: float
    predicted: float = np.nan
    growth: float = np.nan
    after: int = 0
    where: str = ""
    share: float = np.nan
    measured: float = np.nan
    measured_up_to: float = np.nan
    eigenvalues: float = np.nan
    field_of_values: float = np.nan
    von_neumann: float = np.nan
    greatest_real: float = np.nan
    frozen: dict[str, float] = field(default_factory=dict)
    longer: float = np.nan
    lines: bool = False
    left_out: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def limited(self) -> bool:
        """True for a limited scheme, whose predictions have fixed weights."""
        return bool(self.frozen) or "frozen weights" in self.left_out

    @property
    def difference(self) -> float:
        """Relative difference of the limits, measured / predicted - 1; nan unless both are finite and positive."""
        known = np.isfinite(self.measured) and np.isfinite(self.predicted) and self.predicted > 0.0
        return self.measured / self.predicted - 1.0 if known else np.nan

    def courant(self, step: float) -> float:
        """Courant number of a step [s]; nan without cells."""
        return step * self.rate if self.rate > 0.0 else np.nan

    def plain(self) -> dict:
        """Data for JSON: steps [s] and Courant numbers; "none" if no failing step was found, null if unknown."""
        data = asdict(self) | {"difference": self.difference}
        for name in (
            "predicted",
            "measured",
            "eigenvalues",
            "field_of_values",
            "von_neumann",
            "longer",
        ):
            data[name] = json_number(getattr(self, name))
            data[f"{name}_courant"] = json_number(self.courant(getattr(self, name)))
        data["frozen"] = {name: json_number(step) for name, step in self.frozen.items()}
        return data


def json_number(x: float):
    """Number for JSON: "none" for infinity, None for NaN."""
    return None if np.isnan(x) else "none" if np.isinf(x) else x


def row_from_json(data: dict) -> StabilityRow:
    """Row of a stability study from the data that `StabilityRow.plain` returned."""
    values = {"none": np.inf, None: np.nan}
    fields = {name: data[name] for name in StabilityRow.__dataclass_fields__}
    for name, value in fields.items():
        if value is None or value == "none":
            fields[name] = values[value]
    fields["frozen"] = {name: values.get(step, step) for name, step in fields["frozen"].items()}
    return StabilityRow(**fields | {"notes": tuple(fields["notes"])})


# bounds -----------------------------------------------------------------------------------------------------------

MODULUS_MARGIN = 1e-9  # |R| may exceed 1 by this: round-off of eigenvalues
POINTS_PER_SIDE = 8  # points along each side of the polygon inscribed in a field of values
TANGENTS = 49  # tangents to a field of values in the upper half plane
MAX_STATES = 400  # greatest number of states for which a field of values is computed
MAX_HS = 1e5  # greatest h |s| of the search


def region_limit(method: Method, points: np.ndarray) -> float:
    """Greatest step h [s] for which all points s [1/s] times any shorter step are in the stability region.

    The result is 0 if there is no such step, inf if all steps are possible. Points within 1e-10 of the imaginary axis
    (round-off, relative to the greatest |s|) are moved onto it, and points within 1e-10 of 0 are left out. Points to
    the right of the axis allow no step.
    """
    size = np.max(np.abs(points), initial=0.0)
    points = points[np.abs(points) > ZERO_TOLERANCE * size]
    if size == 0.0 or not points.size:
        return np.inf
    on_axis = np.abs(points.real) <= ZERO_TOLERANCE * size
    facts = analyse(method)
    if np.any(points.real[~on_axis] > 0.0) or (np.any(on_axis) and facts.imaginary_interval == 0.0):
        return 0.0
    if facts.a_stable:
        return np.inf
    points = np.where(on_axis, 1j * points.imag, points)
    r = facts.stability_function

    def outside(h: float) -> bool:
        with np.errstate(all="ignore"):
            return not bool(np.all(np.abs(r(h * points)) <= 1.0 + MODULUS_MARGIN))

    return limit_from(outside, 0.05 / size, MAX_HS / size, ratio=1.02, width=1e-7).step


def field_of_values(e: np.ndarray) -> np.ndarray:
    """Points on a polygon inscribed in the field of values of the real matrix E : complex[m].

    The field of values is the set of all x* E x with |x| = 1. Its tangent at an angle touches it at x* E x, where x is
    the eigenvector of the greatest eigenvalue of the Hermitian part of exp(-i angle) E (Johnson 1978). The lower half
    mirrors the upper half.
    """
    from scipy.linalg import eigh

    points = []
    for angle in np.linspace(0.0, np.pi, TANGENTS):
        rotated = np.exp(-1j * angle) * e
        # LAPACK's search for one value can lose a multiple eigenvalue
        hermitian = 0.5 * (rotated + rotated.conj().T)
        x = eigh(hermitian, check_finite=False, driver="evd")[1][:, -1]
        points.append(np.vdot(x, e @ x))
    upper = np.array(points)
    corners = np.concatenate([upper, upper[::-1].conj()])
    share = np.arange(POINTS_PER_SIDE) / POINTS_PER_SIDE
    return np.concatenate(
        [a + (b - a) * share for a, b in zip(corners, np.roll(corners, -1), strict=True)]
    )


# notes ------------------------------------------------------------------------------------------------------------

AGREEMENT = 0.02  # relative difference of a bound and the prediction below which no note is needed
GROWTH_FLOOR = 1e-9  # of the greatest wave rate or eigenvalue: real parts below are round-off


def bound_notes(row, side, system) -> list[str]:
    """Notes on a row of a stability study, as texts; `system` is None for a limited scheme."""
    texts = case_notes(row, side)
    if row.limited:
        return texts + limiter_notes(row, side.at.model)
    if not np.isfinite(row.predicted):
        texts.append("in linearised form no step up to 1e4 / ||J|| fails (J: Jacobian)")
        if np.isfinite(row.measured):
            texts.append(
                f"only the linear system never fails; real runs fail from h = {row.measured:.5g} s on: in "
                f"{row.steps} such steps the solution leaves the linearised state, and nonlinear laws "
                "determine the growth"
            )
        return texts
    if "eigenvalues" not in row.left_out:
        texts += eigenvalue_notes(row, system)
    texts += field_of_values_notes(row, side)
    texts += von_neumann_notes(row)
    if np.isinf(row.measured):
        texts.append(
            f"no real run fails, up to h = {row.measured_up_to:.3g} s: the state moves away from the "
            "linearised state, or nonlinear laws stop the growth"
        )
    if np.isfinite(row.difference) and abs(row.difference) > 0.01:
        reason = "the deviation does not stay linear"
        if state_moves(side):
            reason = (
                f"{row.steps} steps of the predicted limit take {row.steps * row.predicted:.3g} s, and meanwhile "
                "the state leaves the linearised state; the prediction is for that state only"
            )
        texts.append(
            f"prediction and measurement differ by {100 * row.difference:+.1f} %: {reason}"
        )
    return texts


def case_notes(row, side) -> list[str]:
    """Notes on the operating point and the case, which do not depend on the method."""
    texts = []
    growing = row.greatest_real > 0.0
    if growing and row.greatest_real > GROWTH_FLOOR * max(
        row.rate, np.abs(side.spectrum.values).max(initial=0.0)
    ):
        rate = f"{row.greatest_real:.3g} 1/s"
        texts.append(
            f"the case itself is unstable, with a growth rate of {rate}, not because of long steps"
        )
    if side.full_form is not side.form:
        texts.append(
            f"{listing(side.idle)}: free motion stores no energy, but states with energy depend on it; "
            "the norm includes this motion, with the least weight of all states"
        )
    elif side.idle:
        texts.append(f"{listing(side.idle)}: free motion stores no energy and is left out")
    model = side.at.model
    if (
        model.cells
        and model.case.scalars
        and model.case.numerics.scheme != "upwind"
        and not has_limiter(model)
    ):
        texts.append(
            "scalars in pipes are computed without slopes in cells, because their limiter has no derivative"
        )
    if state_moves(side):
        texts.append(
            "the state is not steady: deviations are measured from a run that starts at this state, with "
            "schedules held constant"
        )
    return texts


def state_moves(side) -> bool:
    """True if the operating point of the `LinearSystem` `side` is not steady."""
    return bool(np.max(np.abs(side.at.rate) / side.at.model.scale) > 1e-9)


def eigenvalue_notes(row, system) -> list[str]:
    """Notes on the bound by eigenvalues, compared with the predicted limit."""
    if np.isinf(row.eigenvalues) or row.eigenvalues > (1.0 + AGREEMENT) * row.predicted:
        if np.isinf(row.eigenvalues):
            return [
                "eigenvalues allow every step, but deviations grow at some steps: the Jacobian J is not normal"
            ]
        try:
            after = system.failing_after(0.99 * row.eigenvalues)
        except TooLarge:
            after = 0
        if after:
            return [
                f"eigenvalues are misleading: the Jacobian J is not normal; 1 % below their limit growth exceeds "
                f"{row.threshold:g} after {after} steps"
            ]
        return [
            "eigenvalues allow longer steps than the growth of deviations does: the Jacobian J is not normal"
        ]
    if row.eigenvalues < (1.0 - AGREEMENT) * row.predicted:
        return [
            f"above the limit of the eigenvalues a mode grows, but by less than a factor of {row.threshold:g} in "
            f"{row.steps} steps: longer runs fail at smaller steps"
        ]
    return []


def field_of_values_notes(row, side) -> list[str]:
    """Notes on the bound by the field of values, which is too strict with pipe ends of high order."""
    if np.isnan(row.field_of_values) or row.field_of_values > (1.0 - AGREEMENT) * row.predicted:
        return []
    if row.field_of_values == 0.0:
        reach = float(side.field.real.max())
        if reach > GROWTH_FLOOR * np.abs(side.field).max():
            return [
                f"the field of values allows no step: it reaches {reach:.3g} 1/s into the right half plane; energy "
                "can grow at first (pipe ends with a scheme above first order, or a gain in the case). This is not "
                "a failure"
            ]
        touches = "it touches the imaginary axis at points outside the stability region"
        return [f"the field of values allows no step: {touches}"]
    return ["the bound by the field of values is below the predicted limit here"]


def von_neumann_notes(row) -> list[str]:
    """Notes on von Neumann's limit (interior of a uniform pipe), compared with the limit of the case."""
    if np.isnan(row.von_neumann):
        return []
    if row.von_neumann > (1.0 + AGREEMENT) * row.predicted:
        return [
            "von Neumann's limit is misleading: pipe ends, nodes or other parts limit the step, not the interior"
        ]
    if row.von_neumann < (1.0 - AGREEMENT) * row.predicted:
        return [
            "von Neumann's limit holds for any number of steps and any wavelength; in this case growth remains "
            f"below the threshold of {row.threshold:g} in {row.steps} steps"
        ]
    return []


def limiter_notes(row, model) -> list[str]:
    """Notes on a limited scheme, whose weights are held constant in predictions."""
    frozen = "these weights give the limits in this row"
    if model.cavitates:
        frozen = "in pipes with cavities only the weights of upwind are used"
    elif model.meshed:
        frozen = "in basins only the weights of upwind are used"
    texts = [
        f"{row.scheme} has no derivative at a constant state, so its limit is measured; in predictions its "
        f"weights are held constant: {frozen}"
    ]
    if np.isfinite(row.longer):
        texts.append(
            f"Euler with a limiter has no sharp limit: Courant number {row.courant(row.measured):.3g} in "
            f"{row.steps} steps, {row.courant(row.longer):.3g} in {10 * row.steps} steps"
        )
    return texts
