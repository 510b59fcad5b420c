"""The greatest step at which no eigenvalue grows, equation (13). Knows a model and R(s); runs nothing."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.schemes import LIMITED, SCHEMES

GROWTH = 1e3  # within the run: what grows less is not seen
MOST_STATES = 1200  # of a dense spectrum


def spectrum(case, set: dict) -> np.ndarray | None:
    """Eigenvalues [1/s] of the rates at the profile, by the schedules of the start and of the end, in one array.

    A limited scheme is taken by its weights in smooth flow, what arrives from delay lines as if it stood still. None
    where there are too many states.
    """
    from fvsolve.studies.outcome import prepared

    model = prepared(case, set)
    if (scheme := model.case.numerics.scheme) in LIMITED:
        model = prepared(case, {**set, "numerics.scheme": twin(model.case, scheme)})
    if model.y_size > MOST_STATES:
        return None
    rest = np.zeros(model.y_size)
    times = (model.case.numerics.start, model.case.numerics.end)
    return np.concatenate([np.linalg.eigvals(model.held_jacobian(t, rest)) for t in times])


def twin(case, scheme: str) -> str:
    """The linear scheme that stands for a limited one: what it is where all is smooth, or at its steepest."""
    return SCHEMES[scheme].twin if SCHEMES[scheme].twin in case.schemes else "upwind"


def greatest_step(method: str, eigenvalues: np.ndarray, span: float) -> float:
    """The first step [s] at which R(h lambda) grows by GROWTH within `span` [s] more than the truth does.

    inf where there is none up to a thousand times 1 / |lambda|; 0 where each step of any use is too long.
    """
    from fvsolve.steppers import method_named, stability_function

    r = stability_function(method_named(method))
    fastest = float(np.abs(eigenvalues).max(initial=0.0))
    if fastest == 0.0:
        return math.inf
    true = span * max(0.0, float(eigenvalues.real.max()))

    def grows(h: float) -> bool:
        with np.errstate(all="ignore"):
            return span / h * math.log(max(np.abs(r(h * eigenvalues)).max(), 1e-300)) - true > math.log(GROWTH)

    steps = np.geomspace(1e-2, 1e3, 1201) / fastest
    first = next((k for k, h in enumerate(steps) if grows(h)), None)
    if first is None or first == 0:
        return math.inf if first is None else 0.0
    low, high = steps[first - 1], steps[first]
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    return float(low)
