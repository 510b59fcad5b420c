"""Swings without damping under a Courant number, by methods whose region lacks the imaginary axis. Knows no run.

A Courant number bounds what decays, and waves, whose scheme damps what such methods feed; a body on a spring has
neither. By |R(i w h)|, of ssp-rk2 sqrt(1 + (w h)^4 / 4), it grows at every step, however short: an estimate made of
the start.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from fvsolve.errors import Notice
from fvsolve.limits.lumped import GROWS, own_modes, quickest
from fvsolve.steppers.analysis.stability import imaginary_interval
from fvsolve.steppers.analysis.stability_function import stability_function
from fvsolve.steppers.tableau import Method, method_named

SWELLS = 1.01  # times that a swing grows in a run: less is not told
FREE = 0.1  # of its frequency, what a swing may be damped by and counts


def swings(model, method: str, step: float, span: float) -> list[Notice]:
    """What is to be said of the swing that grows most in a run of `span` [s] whose steps are first `step` [s]."""
    numerics = model.case.numerics
    if numerics.courant is None or covers_axis(method_named(method)):
        return []
    mode = quickest(stability_function(method), free_swings(model), step, span, True, SWELLS)
    if mode is None:
        return []
    grows = f"by {100.0 * (mode.grows - 1.0):.3g} %" if mode.grows < 2.0 else f"{mode.grows:.3g} times"
    size = f"{numerics.courant * mode.limit / step:.3g}"
    text = (f"{mode.place}: a swing at {mode.frequency:.4g} Hz with hardly any damping grows {grows} in the run, at "
            f"{math.log(mode.grows) / span:.3g} 1/s, with {method} and steps of {model.case.step_amount(step, 4)}, as "
            'the start has it: of the imaginary axis its region has nothing; give numerics.method = "ssp-rk3", or '
            f"numerics.courant = {size}, by which it grows by 1 %")  # fmt: skip
    return [Notice("swing", mode.place, text, "courant", mode.grows, SWELLS, mode.grows < GROWS)]


@functools.lru_cache(maxsize=256)
def covers_axis(method: Method) -> bool:
    """Whether a method's region has a part of the imaginary axis."""
    return imaginary_interval(stability_function(method)) > 0.0


def free_swings(model) -> list:
    """Modes of what no cell holds that swing, and hardly fade."""
    return [(place, s) for place, s in own_modes(model) if np.all(np.abs(s.real) < FREE * np.abs(s.imag))]
