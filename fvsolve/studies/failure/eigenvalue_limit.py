"""Greatest step at which no eigenvalue mode grows visibly, equation (13) of docs/course.md."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.schemes import LIMITED, SCHEMES

VISIBLE_GROWTH = 1e3  # factor within the run; less growth is not visible
MAX_STATES = 1200  # greatest number for a dense spectrum


def eigenvalues_of(case, set: dict) -> np.ndarray | None:
    """Eigenvalues of the linearised rates about the initial steady state, in one array [1/s].

    They are computed twice, with the schedules at their values at the start and at the end of the run. A limited scheme
    has its weights in smooth flow (or is replaced by upwind, see `linear_scheme_for`), and waves that arrive from delay
    lines are constant. Returns None for more than 1200 states. set : changed keys of the case
    """
    from fvsolve.studies.outcome import study_model

    model = study_model(case, set)
    if (scheme := model.case.numerics.scheme) in LIMITED:
        model = study_model(case, {**set, "numerics.scheme": linear_scheme_for(model.case, scheme)})
    if model.y_size > MAX_STATES:
        return None
    rest = np.zeros(model.y_size)
    times = (model.case.numerics.start, model.case.numerics.end)
    return np.concatenate([np.linalg.eigvals(model.jacobian_without_delays(t, rest)) for t in times])


def linear_scheme_for(case, scheme: str) -> str:
    """Linear scheme in place of a limited one: the one equal in smooth flow or, if the case excludes that, `upwind`."""
    return SCHEMES[scheme].twin if SCHEMES[scheme].twin in case.schemes else "upwind"


def greatest_step(method: str, eigenvalues: np.ndarray, span: float) -> float:
    """Greatest step [s] up to which no mode grows 1000 times more than the exact solution in a run of `span` [s].

    eigenvalues : complex128[n]  eigenvalues of the modes [1/s]
    Steps h are searched for which h times the greatest modulus of an eigenvalue is between 0.01 and 1000. Returns inf
    if no mode grows at these steps, and 0 if a mode grows at the shortest of them.
    """
    from fvsolve.steppers import method_named, stability_function

    r = stability_function(method_named(method))
    fastest = float(np.abs(eigenvalues).max(initial=0.0))
    if fastest == 0.0:
        return math.inf
    exact_growth = span * max(0.0, float(eigenvalues.real.max()))

    def grows(h: float) -> bool:
        with np.errstate(all="ignore"):
            return span / h * math.log(max(np.abs(r(h * eigenvalues)).max(), 1e-300)) - exact_growth > math.log(
                VISIBLE_GROWTH
            )

    steps = np.geomspace(1e-2, 1e3, 1201) / fastest
    first = next((k for k, h in enumerate(steps) if grows(h)), None)
    if first is None or first == 0:
        return math.inf if first is None else 0.0
    low, high = steps[first - 1], steps[first]
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    return float(low)
