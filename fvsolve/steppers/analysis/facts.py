"""All that a tableau says of its method, in one place. Knows methods; knows no time loop."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, fields

from fvsolve.steppers.analysis import stability
from fvsolve.steppers.analysis.monotone import ssp_radius
from fvsolve.steppers.analysis.stability_function import StabilityFunction, stability_function
from fvsolve.steppers.tableau import Method, method_named


@dataclass(frozen=True)
class Facts:
    """A method known: order, cost, stability.

    error_order : of the embedded solution, 0 where there is none; digits : of its source, None where exact;
    kind : explicit, diagonal, full or linear (Rosenbrock); angle : alpha of A(alpha) [degrees], None where no ray
    is stable; real_interval, imaginary_interval, ssp_radius : inf where there is no end; pade : degrees (k, m) of
    the entry of e^s that R is, else None; error_constant : of the least power of s in R(s) - e^s.
    """

    name: str
    source: str
    order: int
    error_order: int
    stage_order: int
    stages: int
    digits: int | None
    kind: str
    explicit: bool
    diagonally_implicit: bool
    adaptive: bool
    stiffly_accurate: bool
    first_same_as_last: bool
    a_stable: bool
    l_stable: bool
    i_stable: bool
    angle: float | None
    real_interval: float
    imaginary_interval: float
    ssp_radius: float
    pade: tuple[int, int] | None
    error_constant: float
    stability_function: StabilityFunction

    def plain(self) -> dict:
        """As JSON says it: None for infinity, numerator and denominator of R lowest power first."""
        found = {one.name: getattr(self, one.name) for one in fields(self)[:-1]}
        r = self.stability_function
        found["numerator"], found["denominator"] = (
            [float(x) for x in p.coefficients] for p in (r.numerator, r.denominator)
        )
        return {name: None if value == math.inf else value for name, value in found.items()}


def analyse(method: str | Method) -> Facts:
    """What follows from the tableau alone: decided in exact numbers, with the numbers as published where rounded.

    Raises FvsolveError for a name that no method has.
    """
    return _facts(method_named(method))


@functools.cache
def _facts(m: Method) -> Facts:
    r = stability_function(m)
    taken = {one.name: getattr(m, one.name) for one in fields(Facts) if hasattr(m, one.name)}
    return Facts(
        **taken,
        a_stable=stability.a_stable(r),
        l_stable=stability.l_stable(r),
        i_stable=stability.i_stable(r),
        angle=stability.angle(r),
        real_interval=stability.real_interval(r),
        imaginary_interval=stability.imaginary_interval(r),
        ssp_radius=ssp_radius(m),
        pade=r.pade,
        error_constant=float(r.error_constant[1]),
        stability_function=r,
    )
