"""Properties of a Runge-Kutta method, all computed from its tableau, and its errors on the test equation y' = lambda y.

Numbers in brackets are equations and sections of docs/course.md.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, fields

import numpy as np

from fvsolve.steppers.analysis import stability_properties
from fvsolve.steppers.analysis.stability_function import StabilityFunction, stability_function
from fvsolve.steppers.analysis.stability_properties import ssp_radius
from fvsolve.steppers.tableau import Method, method_named
from fvsolve.validation import COUNT_FROM_ZERO, NAME, NUMBER, POINT, POSITIVE, validated


@dataclass(frozen=True)
class Facts:
    """Properties of a method: order, cost, stability.

    error_order : order of the embedded solution, 0 without an embedded solution
    digits : number of significant digits in the published coefficients, None if they are exact
    kind : explicit, diagonal (stages solved one by one), full (stages solved together) or linear (Rosenbrock)
    angle : alpha of A(alpha) stability [degrees], None if the negative real axis is not stable
    real_interval, imaginary_interval : lengths of the stable intervals of h lambda on the negative real and on the
    positive imaginary axis, inf if unbounded
    ssp_radius : greatest step in Euler steps in which a norm cannot grow, inf if unbounded
    pade : degrees (k, m) if the stability function R(s) is a Pade approximation of e^s, otherwise None
    error_constant : coefficient of the lowest power of s in R(s) - e^s
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
        """Return the properties for JSON: None for infinity, numerator and denominator of R lowest power first."""
        values = {field.name: getattr(self, field.name) for field in fields(self)[:-1]}
        r = self.stability_function
        values["numerator"], values["denominator"] = (
            [float(x) for x in p.coefficients] for p in (r.numerator, r.denominator)
        )
        return {name: None if value == math.inf else value for name, value in values.items()}


def analyse(method: str | Method) -> Facts:
    """Compute the properties of a method in exact arithmetic from its published coefficients.

    Raises FvsolveError for an unknown method name.
    """
    return _facts(method_named(method))


@functools.cache
def _facts(m: Method) -> Facts:
    r = stability_function(m)
    given = {field.name: getattr(m, field.name) for field in fields(Facts) if hasattr(m, field.name)}
    return Facts(
        **given,
        a_stable=stability_properties.a_stable(r),
        l_stable=stability_properties.l_stable(r),
        i_stable=stability_properties.i_stable(r),
        angle=stability_properties.angle(r),
        real_interval=stability_properties.real_interval(r),
        imaginary_interval=stability_properties.imaginary_interval(r),
        ssp_radius=ssp_radius(m),
        pade=r.pade,
        error_constant=float(r.error_constant[1]),
        stability_function=r,
    )


@validated(method=NAME, lam=POINT, h=NUMBER, y=POINT)
def local_error(method: str | Method, lam: complex, h: float, y: complex = 1.0) -> complex:
    """Error R(h lambda) y - exp(h lambda) y of one step from y, of order h^(p+1).

    It is given by equations (5), (28), (29) of docs/course.md.
    R : stability function; p : order of the method; lam : lambda [1/s]; h : step [s]
    """
    r = analyse(method).stability_function
    return complex((r(h * lam) - np.exp(h * lam)) * y)


@validated(method=NAME, lam=POINT, h=NUMBER, steps=COUNT_FROM_ZERO, y=POINT)
def global_error(method: str | Method, lam: complex, h: float, steps: int, y: complex = 1.0) -> complex:
    """Error R(h lambda)^n y - exp(n h lambda) y after n = `steps` steps from y, of order h^p at a fixed time n h.

    It is the sum of the propagated local errors e_k: sum_k R^(n-1-k) e_k+1 (docs/course.md, (6)).
    R : stability function; p : order of the method; lam : lambda [1/s]; h : step [s]
    """
    r = analyse(method).stability_function
    return complex((r(h * lam) ** steps - np.exp(steps * h * lam)) * y)


@validated(method=NAME, omega=NUMBER, h=POSITIVE)
def seen_frequency(method: str | Method, omega: float, h: float) -> float:
    """Frequency of the numerical solution [rad/s] for an oscillation with the frequency `omega` [rad/s].

    It is |arg R(i omega h)| / h with the stability function R and the step h [s]. It never exceeds pi / h: an A-stable
    method aliases faster oscillations to slower oscillations (docs/course.md, 5.8).
    """
    r = analyse(method).stability_function
    return float(abs(np.angle(r(1j * omega * h))) / h)
