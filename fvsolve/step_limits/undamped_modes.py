"""Growth of undamped oscillations under methods that are unstable on the whole imaginary axis, at a Courant number.

A given Courant number limits modes that decay; in waves the scheme damps the growth. A body on a spring has no such
damping: at an angular frequency w [rad/s] and a step h [s] its oscillation grows by |R(i w h)| in every step, however
short, with the stability function R; for ssp-rk2 by sqrt(1 + (w h)^4 / 4). The growth is estimated at the start.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from fvsolve.errors import Notice
from fvsolve.step_limits.lumped_modes import LEAST_GROWTH, fastest_growing, modes_outside_cells
from fvsolve.steppers.analysis.stability_function import stability_function
from fvsolve.steppers.analysis.stability_properties import imaginary_interval
from fvsolve.steppers.tableau import Method, method_named

NOTICE_GROWTH = 1.01  # growth of an oscillation in a run above which a notice is given
GREATEST_DAMPING = 0.1  # greatest damping rate of a mode that counts as undamped, relative to its frequency


def undamped_notices(model, method: str, step: float, span: float) -> list[Notice]:
    """Notice for the oscillation that grows most in a run of `span` [s] with a first step of `step` [s], as a list.

    The list is empty if no oscillation grows by more than 1 %, without a given Courant number, and for a method whose
    stability region contains a part of the imaginary axis near 0.
    """
    numerics = model.case.numerics
    if numerics.courant is None or covers_axis(method_named(method)):
        return []
    mode = fastest_growing(stability_function(method), undamped_modes(model), step, span, True, NOTICE_GROWTH)
    if mode is None:
        return []
    grows = f"by {100.0 * (mode.growth - 1.0):.3g} %" if mode.growth < 2.0 else f"{mode.growth:.3g} times"
    size = f"{numerics.courant * mode.limit / step:.3g}"
    text = (f"{mode.place}: an oscillation at {mode.frequency:.4g} Hz with little damping grows {grows} in the run, at "
            f"{math.log(mode.growth) / span:.3g} 1/s, with {method} and steps of {model.case.step_amount(step, 4)} "
            "(estimated at the start), because the method is unstable on the imaginary axis; give "
            f'numerics.method = "ssp-rk3", or numerics.courant = {size}, with which the growth is 1 %')  # fmt: skip
    return [Notice("swing", mode.place, text, "courant", mode.growth, NOTICE_GROWTH, mode.growth < LEAST_GROWTH)]


@functools.lru_cache(maxsize=256)
def covers_axis(method: Method) -> bool:
    """True if the stability region of a method contains a part of the imaginary axis near 0."""
    return imaginary_interval(stability_function(method)) > 0.0


def undamped_modes(model) -> list:
    """Oscillating modes with little damping of states outside cells: pairs (name of the state, eigenvalue [1/s])."""
    return [
        (place, s)
        for place, s in modes_outside_cells(model)
        if np.all(np.abs(s.real) < GREATEST_DAMPING * np.abs(s.imag))
    ]
